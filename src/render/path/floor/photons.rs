//! Traces photons of distant lights through transmissive particles to the ground (Jensen, "Global illumination using
//! photon maps", 1996). Photons that reach the ground without passing a particle are left out.
//!
//! Photons have fixed numbers and random numbers, and their flux is added in their order: the map does not depend on
//! threads.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::super::PathIntegrator;
use super::density::Cells;
use super::{Map, Square};
use crate::math::{LANES, lane3, lanes_in, splat, splat3};
use crate::ray::Ray;
use crate::render::{
    lights::{Beam, light_of},
    ray_counts::RayCounts,
    sampler::PathSeed,
    scratch::PacketScratch,
    shading::tangents,
    stop::Stop,
    stream::{RayStreams, SegmentPacket},
};
use crate::scene::Scene;
use crate::surface::MaterialId;

/// Photons that are traced as one task.
const TASK: u32 = 4096;

/// Tasks whose photons are kept until they are added to the map.
const ROUND: usize = 64;

/// Depth of the photons of a light. They count as reflected once, so that none splits at the first surface.
const FIRST_DEPTH: u32 = 2;

/// Dimensions of the random numbers of all photons: position and direction.
const POSITION: u32 = 0;
const DIRECTION: u32 = 1;

/// Random numbers of photons; no pixel has this row.
const PHOTONS: u32 = u32::MAX;

/// Memory for photons on the ground, with space to grow.
pub(super) const BYTES: u64 = 2 * TASK as u64 * (ROUND * size_of::<Landed>()) as u64;

/// A photon on the ground.
struct Landed {
    position: [f32; 2],
    flux: Vec3,
}

/// Parallel light that covers the particles.
struct Emitter {
    beam: Beam,
    /// Centre of the particles.
    center: Vec3,
    /// Half the edges of a rectangle that faces the light and covers the particles.
    sides: [Vec3; 2],
    /// Distance between that rectangle and the origin of the photons.
    distance: f32,
    photons: u32,
    /// Flux of each photon.
    flux: Vec3,
    seed: PathSeed,
}

/// The radiance of a white ground in the light of photons.
pub(super) struct CausticMaps {
    pub(super) all: Arc<Map>,
    /// Of each light group with photons; empty if the film has no layers for groups.
    pub(super) groups: Vec<(usize, Arc<Map>)>,
}

/// The light groups of `scene` that have photons, each once.
pub(super) fn groups(scene: &Scene) -> BTreeSet<usize> {
    let lights = scene.lights.iter();
    let lights = lights.filter(|light| light_of(light).beam().is_some());
    lights.map(|light| usize::from(light.group)).collect()
}

/// The radiance of a white ground in the light of the photons of all lights.
pub(super) fn caustics(
    integrator: &PathIntegrator<'_>,
    square: &Square,
    stop: &dyn Stop,
) -> Option<(CausticMaps, RayCounts)> {
    let context = &integrator.context;
    let lights = context.lights.iter().enumerate();
    let beams =
        lights.filter_map(|(index, light)| Some((context.light_group(index), light.beam()?)));
    let beams: Vec<(usize, Beam)> = beams.collect();
    let (mut cells, mut counts) = (Cells::new(), RayCounts::default());
    // A single group has the light of all photons
    let groups = match context.settings.channels.layers.light_groups {
        0 => BTreeSet::new(),
        _ => groups(context.scene),
    };
    let mut of_groups: Vec<(usize, Cells)> = match groups.len() {
        0 | 1 => Vec::new(),
        _ => groups.iter().map(|group| (*group, Cells::new())).collect(),
    };
    let lights = u32::try_from(beams.len()).unwrap_or(u32::MAX).max(1);
    let photons = context.settings.photons.div_ceil(lights);
    for (number, (group, beam)) in (0..).zip(beams) {
        let emitter = Emitter::new(beam, square.particles, photons, number);
        let mut land = |photon: &Landed| {
            cells.add(photon.position, photon.flux);
            for (other, cells) in &mut of_groups {
                // The filters of a group are those of all photons
                let flux = if *other == group {
                    photon.flux
                } else {
                    Vec3::ZERO
                };
                cells.add(photon.position, flux);
            }
        };
        counts = counts + emitter.emit(integrator, square, &mut land, stop)?;
    }
    let all = Arc::new(cells.radiance(square));
    let mut maps: Vec<(usize, Arc<Map>)> = Vec::new();
    for (group, cells) in of_groups {
        maps.push((group, Arc::new(cells.radiance(square))));
    }
    if let (true, Some(group)) = (maps.is_empty(), groups.first()) {
        maps.push((*group, Arc::clone(&all)));
    }
    Some((CausticMaps { all, groups: maps }, counts))
}

impl Emitter {
    /// The emitter number `number`, of `photons` photons, for particles in the box with these corners.
    fn new(beam: Beam, [min, max]: [Vec3; 2], photons: u32, number: u32) -> Self {
        let (center, half) = (0.5 * (min + max), 0.5 * (max - min));
        let distance = 2.0 * half.length();
        let spread = distance * beam.spread();
        // A box reaches as far along an axis as its half edges do together
        let reach = |axis: Vec3| axis.abs().dot(half) + spread;
        let sides = tangents(beam.to_light.to_array()).map(Vec3::from_array);
        let sides = sides.map(|axis| reach(axis) * axis);
        let area = 4.0 * sides[0].length() * sides[1].length();
        Self {
            flux: beam.irradiance * (area / photons as f32),
            beam,
            center,
            sides,
            distance,
            photons,
            seed: PathSeed::of_pixel(number, PHOTONS),
        }
    }

    /// Traces all photons, and calls `land` for those that reach the ground. `None` if `stop` is raised.
    fn emit(
        &self,
        integrator: &PathIntegrator<'_>,
        square: &Square,
        land: &mut dyn FnMut(&Landed),
        stop: &dyn Stop,
    ) -> Option<RayCounts> {
        let mut counts = RayCounts::default();
        let tasks: Vec<u32> = (0..self.photons).step_by(TASK as usize).collect();
        for round in tasks.chunks(ROUND) {
            let trace = |first: &u32| {
                let last = self.photons.min(first + TASK);
                trace(integrator, self, *first..last, square, stop)
            };
            let landed: Option<Vec<_>> = round.par_iter().map(trace).collect();
            for (photons, of_task) in landed? {
                counts = counts + of_task;
                photons.iter().for_each(&mut *land);
            }
        }
        Some(counts)
    }

    /// The ray of a photon.
    fn ray(&self, photon: u32) -> Ray {
        let [x, y] = self.seed.get_2d(POSITION, photon).map(|u| 2.0 * u - 1.0);
        let to_light = self.beam.direction(self.seed.get_2d(DIRECTION, photon));
        let target = self.center + x * self.sides[0] + y * self.sides[1];
        Ray::new(target + self.distance * to_light, -to_light)
    }

    /// A packet of photons from number `first` on.
    fn packet(&self, first: u32, end: u32, segments: &mut SegmentPacket) {
        segments.rays.reset();
        for photon in (first..end).take(LANES) {
            let lane = segments.rays.len();
            segments.rays.push(&self.ray(photon));
            segments.path[lane] = self.seed.child(photon);
        }
        segments.throughput = splat3(self.flux);
        segments.pdf = splat(f32::INFINITY);
        segments.bounces = [1; LANES];
        segments.sample = [0; LANES];
        segments.inside = 0;
    }
}

/// Traces the photons in `range`. `None` if `stop` is raised.
fn trace(
    integrator: &PathIntegrator<'_>,
    emitter: &Emitter,
    range: std::ops::Range<u32>,
    square: &Square,
    stop: &dyn Stop,
) -> Option<(Vec<Landed>, RayCounts)> {
    let mut landed = Vec::new();
    let mut packet = Box::<PacketScratch>::default();
    let (mut current, mut next) = (RayStreams::default(), RayStreams::default());
    // Emit the photons
    let mut segments = Box::<SegmentPacket>::default();
    for first in range.clone().step_by(LANES) {
        emitter.packet(first, range.end, &mut segments);
        packet.counts.shadow += segments.rays.len() as u64;
        step(
            integrator,
            &mut segments,
            FIRST_DEPTH,
            &mut packet,
            &mut next,
        );
    }
    // Light that enters a body has the square of its index times the radiance. Paths of the camera leave this factor
    // out, but the density of photons inside the body contains it
    let ior = integrator.context.scene.material.ior;
    // Follow them through the particles
    for depth in FIRST_DEPTH + 1.. {
        std::mem::swap(&mut current, &mut next);
        if current.is_empty() {
            break;
        }
        next.clear();
        packet.counts.reflection += current.reflected.len() as u64;
        packet.counts.refraction += current.refracted.len() as u64;
        for segments in current.packets_mut() {
            if stop.is_raised() {
                return None;
            }
            let lanes = step(integrator, segments, depth, &mut packet, &mut next);
            let index = |lane: usize| match segments.inside >> lane & 1 {
                0 => 1.0,
                _ => ior,
            };
            landed.extend(lanes_in(lanes).map(|lane| Landed {
                position: square.position(lane3(&packet.hits.point, lane)),
                flux: lane3(&packet.throughput, lane)
                    * (packet.hits.opacity[lane] / (index(lane) * index(lane))),
            }));
        }
    }
    Some((landed, packet.counts))
}

/// Moves photons to the next surface, and reflects or refracts those that hit particles. Returns those that hit the
/// ground.
fn step(
    integrator: &PathIntegrator<'_>,
    segments: &mut SegmentPacket,
    depth: u32,
    packet: &mut PacketScratch,
    next: &mut RayStreams,
) -> u32 {
    integrator.context.intersect(segments, depth, packet);
    let particles = packet.hits.lanes_of(MaterialId::PARTICLES);
    if particles != 0 {
        integrator.shade_transmissive(segments, depth, particles, packet, next);
    }
    packet.hits.lanes_of(MaterialId::GROUND)
}
