//! The interface of integrators, and the wavefront loop that they share (modelled on the wavefront integrator of
//! pbrt-v4).
//!
//! A tile is sampled in groups of pixels, and each group is traced in batches with rays that fit into memory. A batch
//! passes through `intersect` and [`Integrator::shade`] depth by depth and packet by packet; rays that leave surfaces
//! are appended without gaps to the streams of the next depth. The radiance of a sample is summed in an order that
//! depends only on the sample: by depth, then reflected rays before refracted ones, each in the order of their parent
//! rays. Nothing depends on threads, on the size of tiles or batches, or on the assignment of rays to packets.

use std::ops::Range;

use super::{
    context::RenderContext,
    film::FilmTile,
    ray_counts::RayCounts,
    roulette::SplitRule,
    scene_shapes::Interior,
    scratch::{GROUP, PacketScratch, Scratch, batch_len},
    settings::{IntegratorKind, RenderSettings},
    stop::Stop,
    stream::{RayStreams, SegmentPacket},
    tile::pixels_of,
};
use spherule_tree::math::{LANES, splat};

/// A method to compute the radiance along rays.
pub(super) trait Integrator: Sync {
    /// The scene and the settings.
    fn context(&self) -> &RenderContext<'_>;

    /// Maximum number of path segments of one sample at any depth.
    fn max_paths(&self) -> usize {
        let context = self.context();
        max_paths(context.settings, context.shapes.interior)
    }

    /// Maximum number of path segments one after the other.
    fn max_depth(&self) -> u32 {
        max_depth(self.context().settings)
    }

    /// Whether paths use random numbers, so that segments need a [`PathSeed`](super::sampler::PathSeed).
    fn is_stochastic(&self) -> bool;

    /// Adds the radiance along `segments` to `packet.radiance`, and appends the rays that leave their intersections,
    /// `packet.hits`, to `next`. `packet.throughput` is the throughput up to the intersections. Camera rays have
    /// depth 1.
    fn shade(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    );

    /// Renders all pixels of `tile`. Returns `None` if `stop` is raised, which is checked for each packet.
    fn render_tile(
        &self,
        tile: &mut FilmTile<'_>,
        stop: &dyn Stop,
        scratch: &mut Scratch,
    ) -> Option<RayCounts> {
        let context = self.context();
        let samples = context.settings.samples;
        // Render the pixels in groups of samples that fit into the cache
        let group_len = (GROUP / samples).max(1) as usize;
        let slices = context.scene.exposure.map_or(1, |exposure| exposure.slices.max(1));
        scratch.current.set_slices(slices);
        scratch.next.set_slices(slices);
        scratch.packet.counts = RayCounts::default();
        // Maps of the light on the ground have no limit: they are smooth already
        scratch.packet.clamp.limit = context.settings.clamp;
        let mut pixels = pixels_of(tile).peekable();
        while pixels.peek().is_some() {
            let group = pixels.by_ref().take(group_len);
            context.place_samples(tile, group, &mut scratch.group);
            trace_group(self, stop, scratch)?;
            let is_bounded = context.catches_shadows();
            scratch.group.accumulate(samples, is_bounded, tile);
            context.store_attributes(&scratch.group.pixels, tile);
        }
        Some(scratch.packet.counts)
    }
}

/// Maximum number of path segments of one sample at any depth.
pub(super) fn max_paths(settings: &RenderSettings, interior: Interior) -> usize {
    SplitRule::new(settings, interior).max_paths(max_depth(settings))
}

/// Maximum number of path segments one after the other: reflections and refractions, and diffuse reflections with the
/// last segment to the environment.
pub(super) fn max_depth(settings: &RenderSettings) -> u32 {
    match settings.integrator {
        IntegratorKind::Whitted => settings.max_depth,
        IntegratorKind::Path => settings.max_depth + settings.traced_bounces() + 1,
    }
}

/// Traces all samples of a group, batch by batch.
fn trace_group<I: Integrator + ?Sized>(
    integrator: &I,
    stop: &dyn Stop,
    scratch: &mut Scratch,
) -> Option<()> {
    trace_batches(integrator, stop, scratch, &|packets, scratch| {
        trace_camera_rays(integrator, packets, stop, scratch)
    })
}

/// Traces all samples of a group, batch by batch. `start` traces the segments of depth 1 of the packets that it is
/// given.
pub(super) fn trace_batches<I: Integrator + ?Sized>(
    integrator: &I,
    stop: &dyn Stop,
    scratch: &mut Scratch,
    start: &dyn Fn(Range<usize>, &mut Scratch) -> Option<()>,
) -> Option<()> {
    let context = integrator.context();
    let packets = scratch.group.film.len();
    // Trace batches with a bounded number of path segments
    let step = batch_len(context.max_segments, integrator.max_paths()) / LANES;
    for first in (0..packets).step_by(step) {
        // Trace the first segments of the batch
        scratch.next.clear();
        start(first..packets.min(first + step), scratch)?;
        // Trace depth by depth, until no rays are left
        for depth in 2..=integrator.max_depth() {
            std::mem::swap(&mut scratch.current, &mut scratch.next);
            if scratch.current.is_empty() {
                break;
            }
            trace_depth(integrator, depth, stop, scratch)?;
        }
    }
    Some(())
}

/// Traces the camera rays of the packets in `range` of a group.
fn trace_camera_rays<I: Integrator + ?Sized>(
    integrator: &I,
    range: Range<usize>,
    stop: &dyn Stop,
    scratch: &mut Scratch,
) -> Option<()> {
    let context = integrator.context();
    for number in range {
        // Generate and trace the rays of a packet
        let (group, packet) = (&mut scratch.group, &mut *scratch.packet);
        let segments = &mut *scratch.camera;
        context.camera_segments(group, number, integrator.is_stochastic(), segments);
        packet.counts.primary += segments.rays.len() as u64;
        trace_packet(integrator, segments, 1, stop, packet, &mut scratch.next)?;
        // Data channels are those of the surface behind a medium that scatters light
        packet.hits.mask |= packet.media.hidden;
        // Store radiance, coverage and data channels of the samples
        group.radiance[number] = packet.radiance;
        group.coverage[number] = context.coverage(&packet.hits, &packet.coverage);
        // The data of reflections at panes are of what is behind
        context.restore_behind(packet);
        context.gather_data(&segments.rays, number * LANES, packet, &mut group.pixels);
        packet.split.add_direct_radiance(&packet.radiance);
        group.layers.store(number, &packet.split, &packet.groups);
        context.gather_objects(&packet.hits, number, &mut group.layers);
    }
    Some(())
}

/// Traces the rays of a depth after the first.
fn trace_depth<I: Integrator + ?Sized>(
    integrator: &I,
    depth: u32,
    stop: &dyn Stop,
    scratch: &mut Scratch,
) -> Option<()> {
    let (current, next) = (&mut scratch.current, &mut scratch.next);
    let packet = &mut *scratch.packet;
    next.clear();
    packet.counts.reflection += current.reflected.len() as u64;
    packet.counts.refraction += current.refracted.len() as u64;
    for segments in current.packets_mut() {
        packet.clamp.start();
        trace_packet(integrator, segments, depth, stop, packet, next)?;
        let PacketScratch { clamp, radiance, groups, counts, .. } = &mut *packet;
        clamp.apply(segments, radiance, groups, &mut counts.lost);
        scratch.group.add(segments, &packet.radiance);
        let layers = &mut scratch.group.layers;
        layers.add(segments, &packet.radiance, &packet.split.direct_radiance);
        layers.add_groups(segments, &packet.groups);
    }
    Some(())
}

/// Computes the radiance along the rays of one packet.
fn trace_packet<I: Integrator + ?Sized>(
    integrator: &I,
    segments: &mut SegmentPacket,
    depth: u32,
    stop: &dyn Stop,
    packet: &mut PacketScratch,
    next: &mut RayStreams,
) -> Option<()> {
    if stop.is_raised() {
        return None;
    }
    integrator.context().intersect(segments, depth, packet);
    packet.radiance = [splat(0.0); 3];
    packet.coverage = splat(0.0);
    let channels = &integrator.context().settings.channels;
    packet.split.start(channels, depth);
    packet.groups.start(&channels.layers);
    integrator.shade(segments, depth, packet, next);
    Some(())
}

#[cfg(test)]
pub(super) mod testing {
    //! Integrators without a film.

    use std::sync::atomic::AtomicBool;

    use glam::{Vec2, Vec3};

    use super::*;
    use crate::render::{aov::DataSample, sampler::PathSeed, scratch::Pixel};
    use spherule_tree::math::{Lanes3, lane3};

    /// The radiance along the segments of a packet at `depth`, and the rays that they leave.
    pub(in crate::render) fn shaded(
        integrator: &dyn Integrator,
        segments: &SegmentPacket,
        depth: u32,
    ) -> (Lanes3, RayStreams) {
        let mut packet = PacketScratch::default();
        let mut next = RayStreams::default();
        let never = AtomicBool::new(false);
        let segments = &mut segments.clone();
        trace_packet(integrator, segments, depth, &never, &mut packet, &mut next).unwrap();
        (packet.radiance, next)
    }

    /// The radiance at positions on the film, 0 to 1 on both axes.
    pub(in crate::render) fn radiance_at(
        integrator: &dyn Integrator,
        films: &[Vec2],
    ) -> (Vec<Vec3>, RayCounts) {
        let mut scratch = Scratch::default();
        let settings = integrator.context().settings;
        let size = Vec2::new(settings.width as f32, settings.height as f32);
        // Make a sample for each position
        let group = &mut scratch.group;
        for film in films {
            group.push(film.x * size.x, film.y * size.y);
            group.pixels.push(Pixel {
                column: 0,
                row: 0,
                side: 0.0,
                path: PathSeed::of_pixel(film.x.to_bits(), film.y.to_bits()),
                data: DataSample::MISS,
            });
        }
        // Trace them like the samples of an image
        let never = AtomicBool::new(false);
        trace_group(integrator, &never, &mut scratch).unwrap();
        let radiance = |i| lane3(&scratch.group.radiance[i / LANES], i % LANES);
        let all = (0..films.len()).map(radiance).collect();
        (all, scratch.packet.counts)
    }
}
