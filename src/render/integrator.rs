//! Whitted ray tracing over streams of rays: eq. 4.1 of the thesis for opaque surfaces, one depth after the other.
//!
//! A tile is sampled in batches. The camera rays of a batch go through `generate -> intersect -> shade -> occlude ->
//! accumulate` packet by packet; what they reflect is appended to a stream without gaps, which is the next depth.
//! A sample's radiance is summed in an order that depends on the sample alone: by depth, then by light. Nothing
//! depends on threads, on the tile's size or on which rays share a packet.

use glam::Vec3;

use super::{
    RayCounts, RenderSettings, ShadeSource, Stop,
    aov::DataSample,
    film::FilmTile,
    sampler::PixelSampler,
    shading::{
        BackgroundLanes, CameraLanes, LightLanes, LightSamples, ShadingPoints, WhittedLanes, add,
        add_background, camera_rays, intersect_ground, occluded_by_ground, product, sample_light,
        scale, shading_points,
    },
    stream::{RayStream, SegmentPacket, sum_of_lanes},
    tile::pixels_of,
};
use crate::accel::Coherence;
use crate::math::{LANES, Lanes, Lanes3, Supported, first_lanes, lanes_in, splat};
use crate::ray::RayPacket;
use crate::scene::{Ground, Scene, ground};
use crate::surface::{Intersections, MaterialId, Surface};

/// Colour of foam and spray, linear RGB.
pub(super) const SPRAY: Vec3 = Vec3::splat(0.9);

/// Samples that are traced together, at most: their rays and radiance take about half a mebibyte.
const BATCH: u32 = 4096;

/// Bytes of the [`Scratch`] of one thread, rounded up: two streams of rays, and what is gathered for samples.
pub(super) const SCRATCH_BYTES: u64 = (BATCH as u64 / LANES as u64 + 2)
    * (2 * size_of::<SegmentPacket>() + 6 * size_of::<Lanes>()) as u64
    + 65_536;

/// Renders tiles by Whitted's method over streams.
pub(super) struct WhittedIntegrator<'a, S, C> {
    pub(super) surface: &'a S,
    pub(super) source: &'a C,
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a RenderSettings,
    pub(super) simd: Supported,
    pub(super) camera: CameraLanes,
    background: BackgroundLanes,
    lights: Vec<LightLanes>,
    /// By [`MaterialId`].
    materials: [WhittedLanes; MaterialId::COUNT],
    /// Base colour of all particles, if it is one.
    pub(super) color: Option<Vec3>,
}

/// The pixels of a batch and what is gathered for them.
pub(super) struct Pixel {
    pub(super) column: u32,
    pub(super) row: u32,
    pub(super) data: DataSample,
}

/// Memory for the samples of a batch; it lives on from tile to tile.
#[derive(Default)]
pub(super) struct Scratch {
    /// Where samples lie on the film, pixels.
    film: Vec<[Lanes; 2]>,
    /// Radiance of each sample.
    radiance: Vec<Lanes3>,
    /// What of each sample surfaces cover.
    coverage: Vec<Lanes>,
    pixels: Vec<Pixel>,
    /// The depth that is traced, and the one after it.
    now: RayStream,
    next: RayStream,
    /// What one packet takes.
    packet: Box<PacketScratch>,
    counts: RayCounts,
}

/// Memory for one packet.
#[derive(Default)]
pub(super) struct PacketScratch {
    pub(super) camera: SegmentPacket,
    pub(super) hits: Intersections,
    pub(super) points: ShadingPoints,
    pub(super) light: LightSamples,
    pub(super) base: Lanes3,
    pub(super) weight: Lanes3,
    pub(super) radiance: Lanes3,
    /// Particles that a place between them takes its colour from.
    pub(super) blend: Vec<(u32, f32)>,
}

/// What is the same for all segments of a depth.
#[derive(Clone, Copy)]
struct Depth {
    /// 1 for camera rays.
    number: u32,
    coherence: Coherence,
    /// Whether rays that meet nothing see the background.
    sees_background: bool,
}

impl<'a, S: Surface, C: ShadeSource> WhittedIntegrator<'a, S, C> {
    pub(super) fn new(
        surface: &'a S,
        scene: &'a Scene,
        source: &'a C,
        settings: &'a RenderSettings,
    ) -> Self {
        let ambient = scene.ambient_light;
        let matte = WhittedLanes::matte(ground::AMBIENT, ground::DIFFUSE, ambient);
        Self {
            surface,
            source,
            scene,
            settings,
            simd: Supported::default(),
            camera: CameraLanes::new(&scene.camera, settings.width, settings.height),
            background: BackgroundLanes::from(&scene.background),
            lights: scene.lights.iter().map(LightLanes::from).collect(),
            materials: [WhittedLanes::new(&scene.material, ambient), matte, matte],
            color: source.constant_color(),
        }
    }

    /// Renders all pixels of `tile`. None once `stop` is raised, which is looked at for each packet.
    pub(super) fn render_tile(
        &self,
        tile: &mut FilmTile<'_>,
        stop: &dyn Stop,
        scratch: &mut Scratch,
    ) -> Option<RayCounts> {
        scratch.counts = RayCounts::default();
        let mut sampler = PixelSampler::new(self.settings.samples);
        let most = (BATCH / self.settings.samples).max(1) as usize;
        let mut pixels = pixels_of(tile).peekable();
        while pixels.peek().is_some() {
            let batch = pixels.by_ref().take(most);
            self.generate(tile, batch, &mut sampler, scratch);
            self.trace_camera_rays(stop, scratch)?;
            for number in 2..=self.settings.max_depth {
                std::mem::swap(&mut scratch.now, &mut scratch.next);
                if scratch.now.len() == 0 {
                    break;
                }
                self.trace_reflections(number, stop, scratch)?;
            }
            self.accumulate(tile, scratch);
        }
        Some(scratch.counts)
    }

    /// Places the samples of a batch on the film, pixel by pixel.
    fn generate(
        &self,
        tile: &FilmTile<'_>,
        batch: impl Iterator<Item = (u32, u32)>,
        sampler: &mut PixelSampler,
        scratch: &mut Scratch,
    ) {
        scratch.pixels.clear();
        scratch.film.clear();
        let mut count = 0;
        for (column, row) in batch {
            scratch.pixels.push(Pixel {
                column,
                row,
                data: DataSample::MISS,
            });
            let (x, y) = (tile.left + column, tile.top + row);
            sampler.for_each(x, y, |point| {
                if count % LANES == 0 {
                    scratch.film.push([splat(0.0); 2]);
                }
                if let Some(film) = scratch.film.last_mut() {
                    film[0][count % LANES] = x as f32 + point.x;
                    film[1][count % LANES] = y as f32 + point.y;
                }
                count += 1;
            });
        }
        scratch.counts.primary += count as u64;
        let packets = scratch.film.len();
        scratch.radiance.clear();
        scratch.radiance.resize(packets, [splat(0.0); 3]);
        scratch.coverage.resize(packets, splat(0.0));
        scratch.next.clear();
    }

    fn trace_camera_rays(&self, stop: &dyn Stop, scratch: &mut Scratch) -> Option<()> {
        let depth = Depth {
            number: 1,
            coherence: Coherence::Coherent,
            sees_background: !self.settings.transparent_background,
        };
        let total = scratch.pixels.len() * self.settings.samples as usize;
        let mut packet = std::mem::take(&mut scratch.packet);
        for number in 0..scratch.film.len() {
            if stop.is_raised() {
                return None;
            }
            let first = number * LANES;
            let [x, y] = &scratch.film[number];
            camera_rays(self.simd, &self.camera, x, y, &mut packet.camera.rays);
            packet.camera.rays.set_len(LANES.min(total - first));
            packet.camera.throughput = [splat(1.0); 3];
            #[expect(clippy::cast_possible_truncation, reason = "batches are small")]
            let sample = std::array::from_fn(|lane| (first + lane) as u32);
            packet.camera.sample = sample;
            let mut segments = std::mem::take(&mut packet.camera);
            self.intersect(&mut segments.rays, depth, &mut packet.hits);
            self.gather_data(&segments.rays, first, &mut packet, &mut scratch.pixels);
            scratch.coverage[number] = self.coverage(&packet.hits);
            packet.radiance = [splat(0.0); 3];
            self.shade(
                &segments,
                depth,
                &mut packet,
                &mut scratch.next,
                &mut scratch.counts,
            );
            scratch.radiance[number] = packet.radiance;
            packet.camera = segments;
        }
        scratch.packet = packet;
        Some(())
    }

    fn trace_reflections(&self, number: u32, stop: &dyn Stop, scratch: &mut Scratch) -> Option<()> {
        let depth = Depth {
            number,
            coherence: Coherence::Incoherent,
            sees_background: true,
        };
        scratch.next.clear();
        scratch.counts.reflection += scratch.now.len() as u64;
        let mut packet = std::mem::take(&mut scratch.packet);
        for segments in scratch.now.packets() {
            if stop.is_raised() {
                return None;
            }
            let mut rays = segments.rays;
            self.intersect(&mut rays, depth, &mut packet.hits);
            packet.radiance = [splat(0.0); 3];
            self.shade(
                segments,
                depth,
                &mut packet,
                &mut scratch.next,
                &mut scratch.counts,
            );
            // No two rays of a depth belong to one sample.
            for lane in lanes_in(segments.lanes()) {
                let sample = segments.sample[lane] as usize;
                let sum = &mut scratch.radiance[sample / LANES];
                for (sum, radiance) in sum.iter_mut().zip(&packet.radiance) {
                    sum[sample % LANES] += radiance[lane];
                }
            }
        }
        scratch.packet = packet;
        Some(())
    }

    /// Finds the nearest intersection of each ray with the shapes of the scene, and ends the ray there.
    fn intersect(&self, rays: &mut RayPacket, depth: Depth, hits: &mut Intersections) {
        hits.clear();
        if let Some(ground) = &self.scene.ground {
            intersect_ground(self.simd, ground, rays, first_lanes(rays.len()), hits);
        }
        self.surface.intersect(rays, depth.coherence, 0, hits);
    }

    /// Adds to the radiance of a packet what its segments see, and appends what they reflect to `next`.
    fn shade(
        &self,
        segments: &SegmentPacket,
        depth: Depth,
        packet: &mut PacketScratch,
        next: &mut RayStream,
        counts: &mut RayCounts,
    ) {
        let rays = &segments.rays;
        // The background, where nothing is met and through what is only partly there.
        let faded = packet.hits.lanes_of(MaterialId::GROUND);
        let missed = segments.lanes() & !packet.hits.mask;
        if depth.sees_background && (missed | faded) != 0 {
            let opacity = |lane: usize| {
                let is_met = packet.hits.mask >> lane & 1 == 1;
                1.0 - if is_met {
                    packet.hits.opacity[lane]
                } else {
                    0.0
                }
            };
            let seen = std::array::from_fn(opacity);
            scale(self.simd, &segments.throughput, &seen, &mut packet.weight);
            let lanes = missed | faded;
            let sum = &mut packet.radiance;
            add_background(
                self.simd,
                &self.background,
                &rays.direction,
                &packet.weight,
                lanes,
                sum,
            );
        }
        if packet.hits.mask == 0 {
            return;
        }
        self.base_colors(packet);
        for (number, material) in (0..).zip(&self.materials) {
            let id = MaterialId(number);
            let lanes = packet.hits.lanes_of(id);
            if lanes != 0 {
                self.shade_material(segments, material, lanes, depth, packet, next, counts);
            }
        }
    }

    /// Eq. 4.1 for the `lanes` of a packet that meet one material.
    #[expect(
        clippy::too_many_arguments,
        reason = "one stage; all of them are needed"
    )]
    fn shade_material(
        &self,
        segments: &SegmentPacket,
        material: &WhittedLanes,
        lanes: u32,
        depth: Depth,
        packet: &mut PacketScratch,
        next: &mut RayStream,
        counts: &mut RayCounts,
    ) {
        let rays = &segments.rays;
        let PacketScratch {
            hits,
            points,
            light,
            base,
            weight,
            radiance,
            ..
        } = packet;
        scale(self.simd, &segments.throughput, &hits.opacity, weight);
        shading_points(self.simd, material, rays, hits, weight, points);
        // Ambient light.
        let mut colored = [splat(0.0); 3];
        product(self.simd, base, weight, &mut colored);
        add(self.simd, &colored, &material.ambient, lanes, radiance);
        // Lights.
        for lamp in &self.lights {
            sample_light(
                self.simd, lamp, material, rays, points, base, weight, lanes, light,
            );
            if light.lanes == 0 {
                continue;
            }
            let mut visible = light.lanes;
            if lamp.casts_shadow {
                light.shadow_rays.set_len(rays.len());
                counts.shadow += u64::from(light.lanes.count_ones());
                visible &= !self.occluded(&light.shadow_rays, light.lanes, depth);
            }
            add(
                self.simd,
                &light.contribution,
                &Vec3::ONE,
                visible,
                radiance,
            );
        }
        // Reflection; where the recursion ends, it sees the background.
        if material.reflection > 0.0 {
            let reflected = &points.reflected;
            if depth.number < self.settings.max_depth {
                next.push(lanes, reflected, &segments.sample);
            } else {
                let (direction, weight) = (&reflected.direction, &reflected.throughput);
                add_background(
                    self.simd,
                    &self.background,
                    direction,
                    weight,
                    lanes,
                    radiance,
                );
            }
        }
    }

    /// The `lanes` whose rays to a light meet anything.
    fn occluded(&self, rays: &RayPacket, lanes: u32, depth: Depth) -> u32 {
        let ground = self.scene.ground.as_ref();
        let by_ground = |ground: &Ground| occluded_by_ground(self.simd, ground, rays) & lanes;
        let blocked = ground.map_or(0, by_ground);
        let rest = lanes & !blocked;
        if rest == 0 {
            return blocked;
        }
        // Rays that the floor stops need not be traced; those that are not lit end before they start.
        let others = first_lanes(rays.len()) & !blocked;
        blocked | self.surface.occluded_lanes(rays, depth.coherence, others)
    }

    /// Sums the samples of each pixel of a batch and stores the pixels.
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
