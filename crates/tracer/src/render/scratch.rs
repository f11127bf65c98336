//! Memory that a thread reuses from tile to tile: the samples of a group of pixels, the rays of two depths, and the
//! buffers of one packet.

use super::{
    aov::DataSample,
    bodies::StraightCrossing,
    bsdf::{BsdfSamples, BsdfValues, SurfacePoints},
    channels::Channels,
    clamp::IndirectClamp,
    entries::Entries,
    film_join::TilePass,
    free_path::MediaAlong,
    interface::LeavingRays,
    layers::LightClass,
    light_groups::GroupLight,
    light_split::LightSplit,
    lights::LightSamples,
    near_photons::{NEIGHBOURS, NearPhoton, NearPhotons, Neighbour},
    noise::TileNoise,
    ray_counts::RayCounts,
    sample_layers::SampleLayers,
    sampler::PathSeed,
    stream::{RayStreams, SegmentPacket},
    tile::SIDE,
};

use spherule_surface::Intersections;
use spherule_tree::math::{LANES, Lanes, Lanes3, lanes_in, splat};

/// Maximum number of samples in a group of pixels, except for a single pixel with more samples.
pub(super) const GROUP: u32 = 4096;

/// Maximum number of path segments of one depth, except for batches of a single packet of samples.
pub(super) const SEGMENTS: usize = 16_384;

/// The memory of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) group: SampleGroup,
    pub(super) camera: Box<SegmentPacket>,
    /// The current depth.
    pub(super) current: RayStreams,
    /// The next depth.
    pub(super) next: RayStreams,
    pub(super) packet: Box<PacketScratch>,
    /// The passes of a tile before this one.
    pub(super) earlier: Option<TilePass>,
}

/// The samples of a group of pixels, pixel by pixel.
#[derive(Default)]
pub(super) struct SampleGroup {
    pub(super) pixels: Vec<Pixel>,
    /// Number of samples in the group.
    pub(super) len: usize,
    /// Position of each sample on the film, in pixels.
    pub(super) film: Vec<[Lanes; 2]>,
    /// Radiance that arrives at each sample, linear RGB.
    pub(super) radiance: Vec<Lanes3>,
    /// Fraction of each sample that surfaces cover.
    pub(super) coverage: Vec<Lanes>,
    /// Contributions to the layers of the film.
    pub(super) layers: SampleLayers,
    /// Passes of the tile before this one, with other random numbers.
    pub(super) pass: u32,
    /// The noise of the tile, if it is measured.
    pub(super) noise: Option<TileNoise>,
}

/// A pixel of a group, and its data.
pub(super) struct Pixel {
    pub(super) column: u32,
    pub(super) row: u32,
    /// The eye that sees it: -1 is the left one, 1 the right one, 0 the only one.
    pub(super) side: f32,
    pub(super) path: PathSeed,
    pub(super) data: DataSample,
}

/// Buffers for the stages of one packet.
#[derive(Default)]
pub(super) struct PacketScratch {
    /// The nearest intersections.
    pub(super) hits: Intersections,
    /// Path throughput from the samples to the intersections.
    pub(super) throughput: Lanes3,
    /// Distance of each ray to the first pane that it passes or that reflects it; only set if there are panes.
    pub(super) first_pane: Lanes,
    /// Intersections behind panes that reflect rays.
    pub(super) behind: Intersections,
    /// Radiance that arrives at the samples, the result.
    pub(super) radiance: Lanes3,
    /// Base colours of the surfaces.
    pub(super) base: Lanes3,
    pub(super) leaving: LeavingRays,
    /// Points on opaque surfaces, for path tracing.
    pub(super) surface: SurfacePoints,
    pub(super) bsdf: BsdfValues,
    pub(super) bounce: BsdfSamples,
    pub(super) light: LightSamples,
    /// Intersections of shadow rays with transmissive surfaces.
    pub(super) crossings: Intersections,
    /// Surfaces between equal media that rays have passed, in the order of their distance for each ray.
    pub(super) straight: Vec<StraightCrossing>,
    /// Media along the rays, if any scatters light.
    pub(super) media: MediaAlong,
    /// Spheres that are not fully opaque along each ray.
    pub(super) entries: [Entries; LANES],
    pub(super) weight: Lanes3,
    /// Coverage of samples by what leaves no intersection: visible lights, and underlays and shadows on a transparent
    /// background.
    pub(super) coverage: Lanes,
    /// Particles that contribute to the colour of a point, with weights.
    pub(super) blend: Vec<(u32, f32)>,
    /// Photons near the point in each lane.
    pub(super) near: [NearPhotons; LANES],
    /// Memory for the search for them.
    pub(super) found: Vec<Neighbour>,
    /// Light by its first interaction.
    pub(super) split: LightSplit,
    /// Light by its source.
    pub(super) groups: GroupLight,
    /// The limit of indirect light.
    pub(super) clamp: IndirectClamp,
    /// Rays traced for the tile.
    pub(super) counts: RayCounts,
}

impl PacketScratch {
    /// Counts what was added to the radiance since the last call as light of `class`.
    pub(super) fn take_light(&mut self, class: LightClass) {
        self.split.take(class, &self.radiance);
    }

    /// The light samples before their shadow rays are traced, if shadows are measured.
    pub(super) fn unoccluded(&self) -> Option<(u32, Lanes3)> {
        let has_shadow = self.split.has_shadow;
        has_shadow.then_some((self.light.lanes, self.light.radiance))
    }
}

impl SampleGroup {
    /// Removes all pixels and samples.
    pub(super) fn clear(&mut self) {
        self.pixels.clear();
        self.len = 0;
        self.film.clear();
        self.radiance.clear();
        self.coverage.clear();
        self.layers.clear();
    }

    /// Adds samples at the given offsets, in x and y, from the corner of a pixel.
    pub(super) fn push_pixel(&mut self, x: f32, y: f32, (across, down): (&[f32], &[f32])) {
        if !self.len.is_multiple_of(LANES) || !across.len().is_multiple_of(LANES) {
            for (across, down) in across.iter().zip(down) {
                self.push(x + across, y + down);
            }
            return;
        }
        let (across, down) = (across.as_chunks().0, down.as_chunks().0);
        for (across, down) in across.iter().zip(down) {
            self.push_packet([across.map(|offset| x + offset), down.map(|offset| y + offset)]);
            self.len += LANES;
        }
    }

    fn push_packet(&mut self, film: [Lanes; 2]) {
        self.film.push(film);
        self.radiance.push([splat(0.0); 3]);
        self.coverage.push(splat(0.0));
        self.layers.push_packet();
    }

    /// Adds a sample at a position on the film, in pixels.
    pub(super) fn push(&mut self, x: f32, y: f32) {
        let lane = self.len % LANES;
        if lane == 0 {
            self.push_packet([splat(0.0); 2]);
        }
        if let Some(film) = self.film.last_mut() {
            film[0][lane] = x;
            film[1][lane] = y;
        }
        self.len += 1;
    }

    /// Adds `radiance` to the samples of `segments`, in order, because several rays of a packet may belong to one
    /// sample.
    pub(super) fn add(&mut self, segments: &SegmentPacket, radiance: &Lanes3) {
        for lane in lanes_in(segments.lanes()) {
            let sample = segments.sample[lane] as usize;
            let sum = &mut self.radiance[sample / LANES];
            for (sum, radiance) in sum.iter_mut().zip(radiance) {
                sum[sample % LANES] += radiance[lane];
            }
        }
    }
}

/// Number of samples in a batch (whole packets) such that there are at most `segments` path segments, if each sample
/// has up to `max_paths` of them at one depth.
pub(super) fn batch_len(segments: usize, max_paths: usize) -> usize {
    (segments / max_paths).min(GROUP as usize).max(LANES) / LANES * LANES
}

/// Bytes of the [`Scratch`] of one thread, rounded up, if each sample has up to `max_paths` path segments at one depth.
/// `samples` is the number per pixel, `channels` are those of the film.
pub(super) fn scratch_bytes(
    samples: u32,
    max_depth: u32,
    max_paths: usize,
    channels: &Channels,
) -> u64 {
    let tile = (SIDE * SIDE) as usize * samples as usize;
    let sample_count = tile.min(GROUP.max(samples) as usize);
    let rays = match max_depth {
        1 => 0,
        _ => batch_len(SEGMENTS, max_paths).min(sample_count) * max_paths,
    };
    let samples = sample_count.div_ceil(LANES) * 6 * size_of::<Lanes>();
    let segments = (rays.div_ceil(LANES) + 4) * 2 * size_of::<SegmentPacket>();
    // Vectors of photons grow by doubling
    let near = LANES * 2 * NEIGHBOURS * size_of::<NearPhoton>();
    let packet = size_of::<PacketScratch>() + size_of::<SegmentPacket>() + near;
    let layers = SampleLayers::bytes(channels, sample_count);
    (samples + segments + packet + layers) as u64 + 32_768
}
