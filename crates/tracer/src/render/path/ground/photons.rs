//! Traces photons of lights through transmissive particles to the ground, meshes and opaque particles (Jensen, "Global
//! illumination using photon maps", 1996). Photons that get there without passing a particle are left out.
//!
//! Photons have fixed numbers and random numbers, and are stored in their order: the maps do not depend on threads.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::super::PathIntegrator;
use super::density::Cells;
use super::emitter::Emitter;
use super::photon_map::{Collector, Photon};
use super::{CausticMap, Map, Square};
use crate::render::{
    body_set::BodySet,
    mist::MistLayer,
    ray_counts::RayCounts,
    scratch::PacketScratch,
    stop::Stop,
    stream::{RayStreams, SegmentPacket},
};
use spherule_surface::MaterialId;
use spherule_tree::math::{LANES, lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::Ray;

/// Photons that are traced as one task.
const TASK: u32 = 4096;

/// Tasks whose photons are kept until they are added to the maps.
const ROUND: usize = 64;

/// Depth of the photons of a light. They count as reflected once, so that none splits at the first surface.
const FIRST_DEPTH: u32 = 2;

/// Memory for photons before they are in the maps: those on surfaces with space to grow, of those on the ground one for
/// each that is emitted.
pub(super) const fn bytes(has_surfaces: bool) -> u64 {
    let each = if has_surfaces { 2 * size_of::<Photon>() } else { size_of::<Landed>() };
    TASK as u64 * (ROUND * each) as u64
}

/// A photon on the ground.
struct Landed {
    position: [f32; 2],
    flux: Vec3,
}

/// Photons of a task.
#[derive(Default)]
struct Arrivals {
    ground: Vec<Landed>,
    surfaces: Vec<Photon>,
}

/// Where photons are stored.
pub(super) struct Targets<'a> {
    /// The ground and its map.
    pub(super) ground: Option<(&'a Square, &'a mut GroundCells)>,
    /// Meshes and opaque particles.
    pub(super) surfaces: Option<&'a mut Collector>,
}

/// Photons on the ground.
pub(super) struct GroundCells {
    all: Cells,
    /// By light group; empty if the film has no layers for groups, or all photons are of one group.
    groups: Vec<(usize, Cells)>,
    /// The group of all photons, if the film has layers for groups and there is only one.
    only_group: Option<usize>,
}

impl GroundCells {
    /// For photons of light groups, each once, if the film has layers for them.
    pub(super) fn new(groups: &BTreeSet<usize>) -> Self {
        let several = groups.iter().filter(|_| groups.len() > 1);
        Self {
            all: Cells::new(),
            groups: several.map(|group| (*group, Cells::new())).collect(),
            only_group: groups.first().copied().filter(|_| groups.len() == 1),
        }
    }

    fn add(&mut self, photon: &Landed, group: usize) {
        self.all.add(photon.position, photon.flux);
        for (other, cells) in &mut self.groups {
            // The filters of a group are those of all photons
            let flux = if *other == group { photon.flux } else { Vec3::ZERO };
            cells.add(photon.position, flux);
        }
    }

    /// The radiance of a white ground in the light of the photons.
    pub(super) fn into_map(self, square: Square) -> CausticMap {
        let all = Arc::new(self.all.radiance(&square));
        let of_groups = self.groups.into_iter();
        let mut groups: Vec<(usize, Arc<Map>)> =
            of_groups.map(|(group, cells)| (group, Arc::new(cells.radiance(&square)))).collect();
        groups.extend(self.only_group.map(|group| (group, Arc::clone(&all))));
        CausticMap { square, map: all, groups }
    }
}

/// Traces the photons of all emitters. `None` if `stop` is raised.
pub(super) fn trace_photons(
    integrator: &PathIntegrator<'_>,
    emitters: &[Emitter],
    targets: &mut Targets<'_>,
    stop: &dyn Stop,
) -> Option<RayCounts> {
    let mut counts = RayCounts::default();
    for emitter in emitters {
        // Trace tasks in parallel, a round at a time, so that few arrivals are in memory
        let tasks: Vec<u32> = (0..emitter.photons).step_by(TASK as usize).collect();
        for round in tasks.chunks(ROUND) {
            let square = targets.ground.as_ref().map(|(square, _)| *square);
            let has_surfaces = targets.surfaces.is_some();
            let trace = |first: &u32| {
                let last = emitter.photons.min(first + TASK);
                let task = Task { integrator, emitter, square, has_surfaces };
                task.trace(*first..last, stop)
            };
            let arrived: Option<Vec<_>> = round.par_iter().map(trace).collect();
            // Store them in their order, so that sums do not depend on threads
            for (arrivals, of_task) in arrived? {
                counts = counts + of_task;
                targets.store(&arrivals, emitter.group);
            }
        }
    }
    Some(counts)
}

impl Targets<'_> {
    /// Stores photons of a light group.
    fn store(&mut self, arrivals: &Arrivals, group: usize) {
        if let Some((_, cells)) = &mut self.ground {
            for photon in &arrivals.ground {
                cells.add(photon, group);
            }
        }
        if let Some(collector) = &mut self.surfaces {
            for photon in &arrivals.surfaces {
                collector.add(photon);
            }
        }
    }
}

/// A packet of photons from number `first` on, without those that `mist` takes in front of the origins of their rays.
fn emit(
    emitter: &Emitter,
    mist: Option<&MistLayer>,
    [first, end]: [u32; 2],
    segments: &mut SegmentPacket,
) {
    segments.rays.reset();
    for photon in (first..end).take(LANES) {
        if let Some((ray, flux)) = emitter.photon(photon) {
            let lane = segments.rays.len();
            segments.rays.push(&ray);
            segments.path[lane] = emitter.seed.child(photon);
            // Parallel light comes from infinitely far away
            let before = Ray::new(ray.origin, -ray.direction);
            let passing = mist
                .filter(|_| emitter.is_parallel())
                .map_or(1.0, |mist| mist.transmittance(&before, [0.0, f32::INFINITY]));
            set_lane3(&mut segments.throughput, lane, flux * passing);
        }
    }
    segments.pdf = splat(f32::INFINITY);
    segments.bounces = [1; LANES];
    segments.sample = [0; LANES];
    segments.inside = 0;
    segments.bodies = [BodySet::EMPTY; LANES];
}

/// Photons that are traced together.
struct Task<'a> {
    integrator: &'a PathIntegrator<'a>,
    emitter: &'a Emitter,
    square: Option<&'a Square>,
    has_surfaces: bool,
}

impl Task<'_> {
    /// Traces the photons in `range`. `None` if `stop` is raised.
    fn trace(&self, range: std::ops::Range<u32>, stop: &dyn Stop) -> Option<(Arrivals, RayCounts)> {
        let mut arrivals = Arrivals::default();
        let mut packet = Box::<PacketScratch>::default();
        // Photons that media scatter are left out: paths of the camera, or of the map of the sky, find that light
        packet.media.only_attenuate = true;
        let (mut current, mut next) = (RayStreams::default(), RayStreams::default());
        // Emit the photons
        let mut segments = Box::<SegmentPacket>::default();
        for first in range.clone().step_by(LANES) {
            let mist = self.integrator.context.mist.as_ref();
            emit(self.emitter, mist, [first, range.end], &mut segments);
            packet.counts.shadow += segments.rays.len() as u64;
            self.step(&mut segments, FIRST_DEPTH, &mut packet, &mut next);
        }
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
                self.step(segments, depth, &mut packet, &mut next);
                self.store(segments, &packet, &mut arrivals);
            }
        }
        Some((arrivals, packet.counts))
    }

    /// Moves photons to the next surface, and reflects or refracts those that hit particles.
    fn step(
        &self,
        segments: &mut SegmentPacket,
        depth: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        self.integrator.context.intersect(segments, depth, packet);
        let particles = self.integrator.context.shapes.transmissive_lanes(&packet.hits);
        if particles != 0 {
            (self.integrator).shade_transmissive(segments, depth, particles, packet, next);
        }
    }

    /// Stores the photons that have arrived at the ground, at meshes or at opaque particles.
    fn store(&self, segments: &SegmentPacket, packet: &PacketScratch, arrivals: &mut Arrivals) {
        let (hits, throughput) = (&packet.hits, &packet.throughput);
        // Light that enters a body has the square of its index times the radiance. Paths of the camera leave this
        // factor out, but the density of photons inside the body contains it
        let flux = |lane: usize| match segments.inside >> lane & 1 {
            0 => lane3(throughput, lane),
            _ => {
                let ior = self.integrator.context.ior_at(segments, lane);
                lane3(throughput, lane) / (ior * ior)
            }
        };
        // Store those on the ground with their place in the map
        if let Some(square) = self.square {
            let landed = |lane: usize| Landed {
                position: square.position(lane3(&hits.point, lane)),
                flux: flux(lane) * hits.opacity[lane],
            };
            let lanes = lanes_in(hits.lanes_of(MaterialId::GROUND));
            arrivals.ground.extend(lanes.map(landed));
        }
        if !self.has_surfaces {
            return;
        }
        // Store those at other surfaces, with normals on the side that they came from
        let panes = self.integrator.context.pane_lanes(hits);
        for lane in lanes_in(hits.mask & !panes) {
            if !self.integrator.takes_photons(hits.material[lane]) {
                continue;
            }
            let direction = lane3(&segments.rays.direction, lane);
            let normal = lane3(&hits.normal, lane);
            let against = normal.dot(direction) < 0.0;
            arrivals.surfaces.push(Photon {
                point: lane3(&hits.point, lane),
                normal: if against { normal } else { -normal },
                to_light: -direction,
                flux: flux(lane),
                group: u8::try_from(self.emitter.group).unwrap_or_default(),
            });
        }
    }
}
