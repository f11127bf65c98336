//! The light of the environment on the ground, from paths that start there.

use glam::Vec3;
use rayon::prelude::*;

use super::super::{PathIntegrator, Surface};
use super::sky_noise::{self, NoisyMap, remove_noise};
use super::{Map, Square};
use crate::render::{
    bsdf::surface_points,
    integrator::trace_batches,
    layers::Layers,
    ray_counts::RayCounts,
    sampler::PathSeed,
    scratch::{PacketScratch, Scratch},
    settings::RenderSettings,
    stop::Stop,
    stream::{RayStreams, SegmentPacket},
};
use spherule_surface::{MaterialId, Side};
use spherule_tree::math::{LANES, first_lanes, lane3, splat, splat3};
use spherule_tree::ray::Ray;

/// Texels along an edge of the map.
const SIDE: usize = 128;

/// Paths of each texel for each sample of a pixel: with a small light in the environment, fewer leave blotches that no
/// number of samples removes.
const PATHS_OF_SAMPLE: usize = 4;
const MIN_PATHS: usize = 16;
const MAX_PATHS: usize = 512;

/// Paths of each texel, in steps of [`MIN_PATHS`].
fn path_count(settings: &RenderSettings) -> usize {
    let paths = PATHS_OF_SAMPLE * settings.samples as usize;
    paths.next_multiple_of(MIN_PATHS).min(MAX_PATHS)
}

/// Height above the ground from which rays find it, as a fraction of the edge of the map.
const START: f32 = 1e-5;

/// Memory for the map before and after it is smoothed, and for the paths of a row on each of up to 64 threads.
pub(super) fn bytes(settings: &RenderSettings) -> u64 {
    let rows = (SIDE * (6 * SIDE + 64 * path_count(settings)) * size_of::<Vec3>()) as u64;
    rows + (SIDE * SIDE * sky_noise::BYTES) as u64
}

/// Memory of a map.
pub(super) const MAP_BYTES: u64 = (SIDE * SIDE * size_of::<Vec3>()) as u64;

/// Random numbers of texels; no pixel has these rows.
const TEXELS: u32 = u32::MAX - 1;

/// The radiance of a white ground.
pub(super) struct SkyMaps {
    pub(super) all: Map,
    /// By light group; empty if the film has no layers for groups.
    pub(super) groups: Vec<Map>,
}

/// Texels of a map, and of the map of each light group.
type Texels = (NoisyMap, Vec<Vec<Vec3>>);

/// The radiance of a white ground in the light of the environment.
pub(super) fn sky(
    integrator: &PathIntegrator<'_>,
    square: &Square,
    stop: &dyn Stop,
) -> Option<(SkyMaps, RayCounts)> {
    let rows: Option<Vec<_>> =
        (0..SIDE).into_par_iter().map(|row| trace_row(integrator, square, row, stop)).collect();
    let empty = || Vec::with_capacity(SIDE * SIDE);
    let mut all = NoisyMap { texels: empty(), differences: empty() };
    let mut counts = RayCounts::default();
    let count = usize::from(integrator.context.settings.channels.layers.light_groups);
    let mut groups = vec![empty(); count];
    for ((row, row_of_groups), of_row) in rows? {
        all.texels.extend(row.texels);
        all.differences.extend(row.differences);
        for (texels, row) in groups.iter_mut().zip(row_of_groups) {
            texels.extend(row);
        }
        counts = counts + of_row;
    }
    let texels = remove_noise(all, &mut groups, SIDE);
    let map = |texels| smoothed(&Map { side: SIDE, texels });
    let maps = SkyMaps { all: map(texels), groups: groups.into_iter().map(map).collect() };
    Some((maps, counts))
}

/// The texels of a row. `None` if `stop` is raised.
fn trace_row(
    integrator: &PathIntegrator<'_>,
    square: &Square,
    row: usize,
    stop: &dyn Stop,
) -> Option<(Texels, RayCounts)> {
    // Make the paths of all texels of the row
    let mut scratch = Scratch::default();
    let layers = Layers {
        light_groups: integrator.context.settings.channels.layers.light_groups,
        ..Layers::NONE
    };
    scratch.group.layers.layers = layers;
    let paths = path_count(integrator.context.settings);
    for _ in 0..SIDE * paths {
        scratch.group.push(0.0, 0.0);
    }
    // Trace them from the ground
    trace_batches(integrator, stop, &mut scratch, &|packets, scratch| {
        for number in packets {
            let (packet, segments) = (&mut *scratch.packet, &mut *scratch.camera);
            aim(integrator, square, row, (number, paths), segments);
            packet.groups.start(&layers);
            reflect(integrator, segments, paths, packet, &mut scratch.next);
            scratch.group.radiance[number] = packet.radiance;
            let (split, groups) = (&packet.split, &packet.groups);
            scratch.group.layers.store(number, split, groups);
        }
        Some(())
    })?;
    // Average the paths of each texel
    let radiance = |i: usize| lane3(&scratch.group.radiance[i / LANES], i % LANES);
    let [even, odd] = [0, 1].map(|first| means(paths, first, 2, &radiance));
    let halves = || even.iter().zip(&odd);
    let all = NoisyMap {
        texels: halves().map(|(even, odd)| 0.5 * (*even + *odd)).collect(),
        differences: halves().map(|(even, odd)| *even - *odd).collect(),
    };
    let of_group =
        |group| means(paths, 0, 1, &|path| scratch.group.layers.light_of_group(group, path));
    let groups = (0..usize::from(layers.light_groups)).map(of_group);
    Some(((all, groups.collect()), scratch.packet.counts))
}

/// The mean radiance of every `step`th of the `count` paths of each texel of a row.
fn means(count: usize, first: usize, step: usize, radiance: &dyn Fn(usize) -> Vec3) -> Vec<Vec3> {
    let texel = |texel: usize| {
        let paths = (texel * count + first..(texel + 1) * count).step_by(step);
        paths.map(radiance).sum::<Vec3>() * step as f32 / count as f32
    };
    (0..SIDE).map(texel).collect()
}

/// Short rays straight down to the texel of packet `number` of a row whose texels have so many `paths` each.
#[expect(clippy::cast_possible_truncation, reason = "maps are small")]
fn aim(
    integrator: &PathIntegrator<'_>,
    square: &Square,
    row: usize,
    (number, paths): (usize, usize),
    segments: &mut SegmentPacket,
) {
    const { assert!(MIN_PATHS.is_multiple_of(LANES), "a packet has one texel") };
    let texel = number * LANES / paths;
    let center = square.point([texel, row].map(|i| (i as f32 + 0.5) / SIDE as f32));
    let above = center + START * square.edge * square.normal;
    segments.rays.reset();
    for _ in 0..LANES {
        segments.rays.push(&Ray::new(above, -square.normal));
    }
    let seed = PathSeed::of_pixel((row * SIDE + texel) as u32, TEXELS);
    segments.path = [seed.in_sequence(integrator.context.settings.seed); LANES];
    segments.sample = std::array::from_fn(|lane| (number * LANES + lane) as u32);
    // The ground may cut through a body
    let body = integrator.context.shapes.connected_particles();
    let is_inside = body.is_some_and(|body| body.side_of(above) == Side::Inside);
    segments.inside = if is_inside { first_lanes(LANES) } else { 0 };
    if let Some(nested) = &integrator.context.shapes.nested {
        let bodies = nested.at(above);
        segments.bodies = [bodies; LANES];
        segments.inside = if bodies.is_empty() { 0 } else { first_lanes(LANES) };
    }
    segments.throughput = [splat(1.0); 3];
    segments.pdf = splat(f32::INFINITY);
    segments.bounces = [0; LANES];
}

/// Samples the light of the environment where the rays of `segments` hit the ground, as if it were white, and appends
/// the rays that it reflects to `next`. Texels have so many `paths` each.
#[expect(clippy::cast_possible_truncation, reason = "there are few paths")]
fn reflect(
    integrator: &PathIntegrator<'_>,
    segments: &mut SegmentPacket,
    paths: usize,
    packet: &mut PacketScratch,
    next: &mut RayStreams,
) {
    let context = &integrator.context;
    // These rays only aim at the ground, also where it is inside a medium
    packet.media.only_attenuate = true;
    context.intersect(segments, 1, packet);
    packet.media.only_attenuate = false;
    packet.radiance = [splat(0.0); 3];
    let surface = Surface {
        segments,
        depth: 1,
        lanes: packet.hits.lanes_of(MaterialId::GROUND),
        sample: segments.sample.map(|sample| sample % paths as u32),
    };
    let white = splat3(Vec3::ONE);
    (packet.base, packet.weight) = (white, white);
    let points = &mut packet.surface;
    surface_points(context.simd, &segments.rays, &packet.hits, &white, points);
    integrator.add_environment_light(&surface, packet);
    integrator.bounce(&surface, packet, next);
}

/// Means of each texel and its neighbours with binomial weights.
fn smoothed(map: &Map) -> Map {
    let pass = |texels: &[Vec3], step: usize, position: fn(usize) -> usize| -> Vec<Vec3> {
        let mean = |i: usize| {
            let before = if position(i) > 0 { i - step } else { i };
            let after = if position(i) + 1 < SIDE { i + step } else { i };
            0.25 * (texels[before] + texels[after]) + 0.5 * texels[i]
        };
        (0..texels.len()).map(mean).collect()
    };
    let across = pass(&map.texels, 1, |i| i % SIDE);
    Map { side: map.side, texels: pass(&across, SIDE, |i| i / SIDE) }
}
