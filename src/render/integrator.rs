//! Whitted ray tracing over streams of rays: eq. 4.1 of the thesis, one depth after the other.
//!
//! A tile is sampled in groups of pixels. The camera rays of a batch go through `generate -> intersect -> shade ->
//! occlude -> accumulate` packet by packet; what they reflect and refract is appended to two streams without gaps,
//! which are the next depth. A sample's radiance is summed in an order that depends on the sample alone: by depth,
//! reflected rays before refracted ones, and each by the order of the rays that they leave. Nothing depends on threads,
//! on the tile's size or on which rays share a packet.

#[cfg(test)]
use glam::Vec2;
use glam::Vec3;

use super::{
    RayCounts, RenderSettings, ShadeSource, Stop,
    aov::DataSample,
    film::FilmTile,
    lights::{Light, LightSamples, light_of},
    materials::{Material, ShadingPoints, WhittedMaterial, materials_of},
    roulette::SplitRule,
    sampler::{FilmSampler, PathSeed},
    shading::{BackgroundLanes, CameraLanes, camera_rays},
    stream::{RayStream, SegmentPacket, sum_of_lanes},
    tile::{SIDE, pixels_of},
};
use crate::accel::Coherence;
use crate::math::{LANES, Lanes, Lanes3, Supported, first_lanes, lanes_in, splat};
use crate::ray::RayPacket;
use crate::scene::{self, Scene};
use crate::surface::{Intersections, MaterialId, Shape, Side};

/// Samples whose place on the film and radiance are held, unless one pixel has more.
const GROUP: u32 = 4096;

/// Path segments of one depth, at most, as far as batches of a packet of samples allow.
const SEGMENTS: usize = 16_384;

/// Renders tiles by Whitted's method over streams.
pub(super) struct WhittedIntegrator<'a> {
    /// Whatever rays meet; the floor is first, as it is soonest asked.
    pub(super) shapes: Vec<&'a dyn Shape>,
    /// The particles, opaque or transmissive; all other shapes are opaque.
    pub(super) particles: Option<&'a dyn Shape>,
    pub(super) source: &'a dyn ShadeSource,
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a RenderSettings,
    pub(super) simd: Supported,
    pub(super) camera: CameraLanes,
    pub(super) background: BackgroundLanes,
    pub(super) lights: Vec<Box<dyn Light>>,
    /// By [`MaterialId`].
    pub(super) materials: [Box<dyn Material>; MaterialId::COUNT],
    /// Base colour of all particles, if it is one.
    pub(super) color: Option<Vec3>,
    pub(super) interior: Interior,
    /// Which of two rays are followed.
    pub(super) split: SplitRule,
    /// Whether the camera is inside of a connected body.
    is_eye_inside: bool,
    sampler: FilmSampler,
    /// Path segments of one depth, at most, as far as batches of a packet of samples allow.
    pub(super) segments: usize,
}

/// What lies behind the surface of the particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Interior {
    /// Nothing that light gets to.
    Opaque,
    /// The inside of a sphere, each a body of its own. A ray's angle with the normal tells whether it enters or leaves.
    Spheres,
    /// One connected body. Which side of it a ray is on belongs to the ray; all of its depth are crossings, and the way
    /// between them costs nothing, whatever particles lie there.
    Body,
}

/// The pixels of a group and what is gathered for them.
pub(super) struct Pixel {
    pub(super) column: u32,
    pub(super) row: u32,
    path: PathSeed,
    pub(super) data: DataSample,
}

/// Memory for the samples of a group and the rays of a batch; it lives on from tile to tile.
#[derive(Default)]
pub(super) struct Scratch {
    /// Where samples lie on the film, pixels.
    film: Vec<[Lanes; 2]>,
    /// Samples on the film.
    samples: usize,
    /// Radiance of each sample.
    radiance: Vec<Lanes3>,
    /// What of each sample surfaces cover.
    coverage: Vec<Lanes>,
    pixels: Vec<Pixel>,
    /// The depth that is traced, and the one after it.
    now: NextRays,
    next: NextRays,
    /// What one packet takes.
    packet: Box<PacketScratch>,
    counts: RayCounts,
}

/// Rays of the next depth by how they left a surface.
#[derive(Debug, Default)]
pub(super) struct NextRays {
    pub(super) reflected: RayStream,
    pub(super) refracted: RayStream,
}

/// Memory for one packet.
#[derive(Default)]
pub(super) struct PacketScratch {
    camera: SegmentPacket,
    pub(super) hits: Intersections,
    pub(super) points: ShadingPoints,
    pub(super) light: LightSamples,
    /// What rays to a light go through.
    pub(super) crossings: Intersections,
    pub(super) base: Lanes3,
    /// What of the radiance at the intersections arrives at the samples.
    pub(super) throughput: Lanes3,
    pub(super) weight: Lanes3,
    pub(super) radiance: Lanes3,
    /// Particles that a place between them takes its colour from.
    pub(super) blend: Vec<(u32, f32)>,
}

/// What is the same for all segments of a depth.
#[derive(Clone, Copy)]
pub(super) struct Depth {
    /// 1 for camera rays.
    pub(super) number: u32,
    pub(super) coherence: Coherence,
    /// Whether rays that meet nothing see the background.
    pub(super) sees_background: bool,
}

impl Interior {
    fn of(material: &scene::Material, is_connected: bool) -> Self {
        match (material.transmission > 0.0, is_connected) {
            (false, _) => Self::Opaque,
            (true, false) => Self::Spheres,
            (true, true) => Self::Body,
        }
    }
}

impl NextRays {
    fn clear(&mut self) {
        self.reflected.clear();
        self.refracted.clear();
    }

    fn is_empty(&self) -> bool {
        self.reflected.len() + self.refracted.len() == 0
    }
}

/// Bytes of the [`Scratch`] of one thread, rounded up: what is gathered for samples, and the rays of two depths.
pub(super) fn scratch_bytes(
    settings: &RenderSettings,
    is_transmissive: bool,
    is_body: bool,
) -> u64 {
    let rule = split_rule(settings, is_body);
    let paths = most_paths(&rule, settings, is_transmissive);
    let tile = (SIDE * SIDE) as usize * settings.samples as usize;
    let held = tile.min(GROUP.max(settings.samples) as usize);
    let rays = match settings.max_depth {
        1 => 0,
        _ => batch(SEGMENTS, paths).min(held) * paths,
    };
    let samples = held.div_ceil(LANES) * 6 * size_of::<Lanes>();
    let segments = (rays.div_ceil(LANES) + 4) * 2 * size_of::<SegmentPacket>();
    (samples + segments + size_of::<PacketScratch>()) as u64 + 32_768
}

fn split_rule(settings: &RenderSettings, is_body: bool) -> SplitRule {
    match is_body {
        true => SplitRule::body(settings),
        false => SplitRule::spheres(settings),
    }
}

fn most_paths(rule: &SplitRule, settings: &RenderSettings, is_transmissive: bool) -> usize {
    match is_transmissive {
        true => rule.most_paths(settings.max_depth),
        false => 1,
    }
}

/// Samples that are traced together where each may have so many paths, and all so many segments: whole packets.
fn batch(segments: usize, paths: usize) -> usize {
    (segments / paths).min(GROUP as usize).max(LANES) / LANES * LANES
}

impl<'a> WhittedIntegrator<'a> {
    pub(super) fn new(
        shapes: Vec<&'a dyn Shape>,
        scene: &'a Scene,
        source: &'a dyn ShadeSource,
        settings: &'a RenderSettings,
    ) -> Self {
        let is_particles = |shape: &&&dyn Shape| shape.material() == MaterialId::PARTICLES;
        let particles = shapes.iter().find(is_particles).copied();
        let is_connected = particles.is_some_and(|shape| shape.is_connected());
        let interior = Interior::of(&scene.material, is_connected);
        let is_body = interior == Interior::Body;
        let eye = scene.camera.eye();
        let is_eye_inside = |shape: &dyn Shape| shape.side_of(eye) == Side::Inside;
        Self {
            is_eye_inside: is_body && particles.is_some_and(is_eye_inside),
            shapes,
            particles,
            source,
            scene,
            settings,
            simd: Supported::default(),
            camera: CameraLanes::new(&scene.camera, settings.width, settings.height),
            background: BackgroundLanes::from(&scene.background),
            lights: scene.lights.iter().map(light_of).collect(),
            materials: materials_of(scene, is_connected),
            color: source.constant_color(),
            interior,
            split: split_rule(settings, is_body),
            sampler: FilmSampler::new(settings.samples),
            segments: SEGMENTS,
        }
    }

    /// The constants of the particles' material.
    pub(super) fn particle_constants(&self) -> &WhittedMaterial {
        self.materials[usize::from(MaterialId::PARTICLES.0)].constants()
    }

    /// Renders all pixels of `tile`. None once `stop` is raised, which is looked at for each packet.
    pub(super) fn render_tile(
        &self,
        tile: &mut FilmTile<'_>,
        stop: &dyn Stop,
        scratch: &mut Scratch,
    ) -> Option<RayCounts> {
        scratch.counts = RayCounts::default();
        let most = (GROUP / self.settings.samples).max(1) as usize;
        let mut pixels = pixels_of(tile).peekable();
        while pixels.peek().is_some() {
            let group = pixels.by_ref().take(most);
            self.generate(tile, group, scratch);
            self.trace(stop, scratch)?;
            self.accumulate(tile, scratch);
        }
        Some(scratch.counts)
    }

    /// Places the samples of a group of pixels on the film, pixel by pixel.
    fn generate(
        &self,
        tile: &FilmTile<'_>,
        group: impl Iterator<Item = (u32, u32)>,
        scratch: &mut Scratch,
    ) {
        scratch.clear();
        for (column, row) in group {
            let (x, y) = (tile.left + column, tile.top + row);
            scratch.pixels.push(Pixel {
                column,
                row,
                path: PathSeed::of_pixel(x, y),
                data: DataSample::MISS,
            });
            let (across, down) = self.sampler.points(x, y);
            for (across, down) in across.iter().zip(down) {
                scratch.place(x as f32 + across, y as f32 + down);
            }
        }
    }

    /// Traces all samples of a group, in batches whose rays fit into memory.
    fn trace(&self, stop: &dyn Stop, scratch: &mut Scratch) -> Option<()> {
        let packets = scratch.film.len();
        scratch.radiance.resize(packets, [splat(0.0); 3]);
        scratch.coverage.resize(packets, splat(0.0));
        scratch.counts.primary += scratch.samples as u64;
        let is_transmissive = self.interior != Interior::Opaque;
        let paths = most_paths(&self.split, self.settings, is_transmissive);
        let step = batch(self.segments, paths) / LANES;
        for first in (0..packets).step_by(step) {
            let end = packets.min(first + step);
            scratch.next.clear();
            self.trace_camera_rays(first..end, stop, scratch)?;
            for number in 2..=self.settings.max_depth {
                std::mem::swap(&mut scratch.now, &mut scratch.next);
                if scratch.now.is_empty() {
                    break;
                }
                self.trace_depth(number, stop, scratch)?;
            }
        }
        Some(())
    }

    fn trace_camera_rays(
        &self,
        packets: std::ops::Range<usize>,
        stop: &dyn Stop,
        scratch: &mut Scratch,
    ) -> Option<()> {
        let depth = Depth {
            number: 1,
            coherence: Coherence::Coherent,
            sees_background: !self.settings.transparent_background,
        };
        let mut segments = std::mem::take(&mut scratch.packet.camera);
        for number in packets {
            if stop.is_raised() {
                return None;
            }
            let first = number * LANES;
            self.camera_segments(scratch, number, &mut segments);
            let packet = &mut scratch.packet;
            let inside = segments.inside;
            self.intersect(&mut segments.rays, depth, inside, &mut packet.hits);
            self.gather_data(&segments.rays, first, packet, &mut scratch.pixels);
            scratch.coverage[number] = self.coverage(&packet.hits);
            packet.radiance = [splat(0.0); 3];
            let counts = &mut scratch.counts;
            self.shade(&segments, depth, packet, &mut scratch.next, counts);
            scratch.radiance[number] = packet.radiance;
        }
        scratch.packet.camera = segments;
        Some(())
    }

    /// The camera rays of packet `number` of a group.
    fn camera_segments(&self, scratch: &Scratch, number: usize, segments: &mut SegmentPacket) {
        let [x, y] = &scratch.film[number];
        camera_rays(self.simd, &self.camera, x, y, &mut segments.rays);
        let first = number * LANES;
        let len = LANES.min(scratch.samples - first);
        segments.rays.set_len(len);
        segments.throughput = [splat(1.0); 3];
        #[expect(clippy::cast_possible_truncation, reason = "groups are small")]
        let sample = std::array::from_fn(|lane| (first + lane) as u32);
        segments.sample = sample;
        segments.inside = if self.is_eye_inside {
            first_lanes(len)
        } else {
            0
        };
        if self.interior != Interior::Opaque {
            let samples = self.settings.samples as usize;
            for (lane, path) in segments.path.iter_mut().enumerate().take(len) {
                *path = scratch.pixels[(first + lane) / samples].path;
            }
        }
    }

    fn trace_depth(&self, number: u32, stop: &dyn Stop, scratch: &mut Scratch) -> Option<()> {
        let depth = Depth {
            number,
            coherence: Coherence::Incoherent,
            sees_background: true,
        };
        let Scratch {
            now,
            next,
            packet,
            radiance,
            counts,
            ..
        } = scratch;
        next.clear();
        counts.reflection += now.reflected.len() as u64;
        counts.refraction += now.refracted.len() as u64;
        for segments in now
            .reflected
            .packets()
            .iter()
            .chain(now.refracted.packets())
        {
            if stop.is_raised() {
                return None;
            }
            let mut rays = segments.rays;
            self.intersect(&mut rays, depth, segments.inside, &mut packet.hits);
            packet.radiance = [splat(0.0); 3];
            self.shade(segments, depth, packet, next, counts);
            // In order, as several rays of a packet may belong to one sample.
            for lane in lanes_in(segments.lanes()) {
                let sample = segments.sample[lane] as usize;
                let sum = &mut radiance[sample / LANES];
                for (sum, radiance) in sum.iter_mut().zip(&packet.radiance) {
                    sum[sample % LANES] += radiance[lane];
                }
            }
        }
        Some(())
    }

    /// Finds the nearest intersection of each ray with the shapes of the scene, and ends the ray there.
    fn intersect(&self, rays: &mut RayPacket, depth: Depth, inside: u32, hits: &mut Intersections) {
        hits.clear();
        for shape in &self.shapes {
            shape.intersect(rays, depth.coherence, inside, hits);
        }
    }

    /// Sums the samples of each pixel of a group and stores the pixels.
    fn accumulate(&self, tile: &mut FilmTile<'_>, scratch: &mut Scratch) {
        let samples = self.settings.samples as usize;
        let share = 1.0 / self.settings.samples as f32;
        for (number, pixel) in scratch.pixels.iter().enumerate() {
            let range = number * samples..(number + 1) * samples;
            let sum = pixel_sum(&scratch.radiance, &scratch.coverage, range);
            tile.set_color(pixel.column, pixel.row, sum.map(|v| v * share));
            tile.set_data(pixel.column, pixel.row, &pixel.data);
        }
    }
}

impl Scratch {
    /// Forgets a group.
    fn clear(&mut self) {
        self.pixels.clear();
        self.film.clear();
        self.radiance.clear();
        self.samples = 0;
    }

    /// Adds a sample at a place on the film, pixels.
    fn place(&mut self, x: f32, y: f32) {
        let lane = self.samples % LANES;
        if lane == 0 {
            self.film.push([splat(0.0); 2]);
        }
        if let Some(film) = self.film.last_mut() {
            film[0][lane] = x;
            film[1][lane] = y;
        }
        self.samples += 1;
    }
}

/// The sum of the samples in `range`: by whole packets where a pixel has such, else one after the other. Either way
/// it does not depend on where in a batch the pixel lies.
fn pixel_sum(radiance: &[Lanes3], coverage: &[Lanes], range: std::ops::Range<usize>) -> [f32; 4] {
    let mut sum = [0.0; 4];
    if range.len().is_multiple_of(LANES) {
        for packet in range.start / LANES..range.end / LANES {
            for axis in 0..3 {
                sum[axis] += sum_of_lanes(radiance[packet][axis]);
            }
            sum[3] += sum_of_lanes(coverage[packet]);
        }
        return sum;
    }
    for sample in range {
        let (packet, lane) = (sample / LANES, sample % LANES);
        for axis in 0..3 {
            sum[axis] += radiance[packet][axis][lane];
        }
        sum[3] += coverage[packet][lane];
    }
    sum
}

#[cfg(test)]
impl WhittedIntegrator<'_> {
    /// What the segments of a packet see at depth 1, and the rays that they leave.
    pub(super) fn shaded(&self, segments: &SegmentPacket) -> (Lanes3, NextRays) {
        let depth = Depth {
            number: 1,
            coherence: Coherence::Incoherent,
            sees_background: true,
        };
        let mut packet = PacketScratch::default();
        let mut segments = segments.clone();
        let inside = segments.inside;
        self.intersect(&mut segments.rays, depth, inside, &mut packet.hits);
        let (mut next, mut counts) = (NextRays::default(), RayCounts::default());
        self.shade(&segments, depth, &mut packet, &mut next, &mut counts);
        (packet.radiance, next)
    }

    /// The radiance at places on the film, 0 to 1 on both axes.
    pub(super) fn radiance_at(&self, films: &[Vec2]) -> (Vec<Vec3>, RayCounts) {
        let mut scratch = Scratch::default();
        for film in films {
            let (x, y) = (
                film.x * self.settings.width as f32,
                film.y * self.settings.height as f32,
            );
            scratch.place(x, y);
            scratch.pixels.push(Pixel {
                column: 0,
                row: 0,
                path: PathSeed::of_pixel(film.x.to_bits(), film.y.to_bits()),
                data: DataSample::MISS,
            });
        }
        let never = std::sync::atomic::AtomicBool::new(false);
        self.trace(&never, &mut scratch).unwrap();
        let radiance =
            |sample| crate::math::lane3(&scratch.radiance[sample / LANES], sample % LANES);
        ((0..films.len()).map(radiance).collect(), scratch.counts)
    }
}
