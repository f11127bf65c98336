//! Meshes that the camera does not see as opaque surfaces: thin panes of glass, and holdouts.
//!
//! Rays pass panes in a straight line, so a pane is no intersection: [`RenderContext::pass_panes`] multiplies the
//! throughput, and the data of a pixel are those of what is behind. In path tracing, a ray is reflected instead with
//! the probability of its reflectance, and its intersection is the pane. Shadow rays pass panes, too, so light sources
//! and the environment behind a pane are sampled as without it; the density of a ray that passes stays the same.

use super::{
    body_set::BodySet,
    context::RenderContext,
    dimensions::{PANE, REFLECTED},
    lights::LightSamples,
    sampler::get_1d_lanes,
    scratch::PacketScratch,
    settings::IntegratorKind,
    stream::{Continuation, RayStreams, SegmentPacket},
};
use crate::scene::Material;
use crate::scene::material::pane_reflectance;
use crate::surface::{Intersection, Intersections, MaterialId};
use glam::Vec3;
use spherule_tree::math::{lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::Ray;

/// Maximum number of panes along a ray; further ones are not there.
const MAX_PANES: usize = 64;

/// A ray at a pane.
struct PaneCrossing {
    hit: Intersection,
    material: MaterialId,
    /// Part of the light that is reflected.
    reflectance: f32,
    /// Part of the light that passes, linear RGB.
    transmittance: Vec3,
}

impl RenderContext<'_> {
    /// The next pane on `ray`, the first in the scene at equal distances.
    fn next_pane(&self, ray: &Ray) -> Option<PaneCrossing> {
        let mut rest = *ray;
        let mut found = None;
        for pane in &self.shapes.panes {
            if rest.t_max > rest.t_min
                && let Some(hit) = pane.nearest(&rest)
            {
                rest.t_max = hit.t;
                found = Some((hit, pane.material()));
            }
        }
        let (hit, material) = found?;
        let reflectance = pane_reflectance(hit.normal.dot(ray.direction).abs());
        let color = self.scene.material(material).color.unwrap_or(Vec3::ONE);
        Some(PaneCrossing {
            hit,
            material,
            reflectance,
            transmittance: (1.0 - reflectance) * color,
        })
    }

    /// Multiplies the throughput of `packet` by the transmittance of the panes up to its intersections. In path
    /// tracing, ends some of the rays at a pane that reflects them.
    pub(super) fn pass_panes(&self, segments: &mut SegmentPacket, packet: &mut PacketScratch) {
        if self.shapes.panes.is_empty() {
            return;
        }
        // Whitted rays keep only what passes; paths choose at random whether a pane reflects them
        let is_path = self.settings.integrator == IntegratorKind::Path;
        let mut u = splat(1.0);
        if is_path {
            let sample = segments.sample.map(|s| s % self.settings.samples);
            get_1d_lanes(self.simd, &segments.path, PANE, &sample, &mut u);
        }
        packet.first_pane = splat(f32::INFINITY);
        packet.behind.clear();
        // Follow each ray from pane to pane
        for lane in lanes_in(segments.lanes()) {
            let mut u = u[lane];
            let mut throughput = lane3(&packet.throughput, lane);
            let mut rest = segments.rays.ray(lane);
            for _ in 0..MAX_PANES {
                let Some(pane) = self.next_pane(&rest) else {
                    break;
                };
                // The pane takes some of the light, or is the intersection of the path
                packet.first_pane[lane] = packet.first_pane[lane].min(pane.hit.t);
                if !is_path {
                    throughput *= pane.transmittance;
                } else if let Some(rest) = pane.choose(&mut throughput, u) {
                    u = rest;
                } else {
                    self.keep_behind(lane, packet);
                    packet.hits.set(lane, &pane.hit, pane.material);
                    segments.rays.t_max[lane] = pane.hit.t;
                    break;
                }
                rest.t_min = pane.hit.t + pane.hit.offset;
            }
            set_lane3(&mut packet.throughput, lane, throughput);
        }
    }

    /// Keeps the intersection behind a pane that reflects the ray in `lane`, for the data of the pixel.
    fn keep_behind(&self, lane: usize, packet: &mut PacketScratch) {
        let (hit, material) = (packet.hits.get(lane), packet.hits.material[lane]);
        let is_hidden = material == MaterialId::GROUND && self.catches_shadows();
        if packet.hits.mask >> lane & 1 == 1 && !is_hidden {
            packet.behind.set(lane, &hit, material);
        }
    }

    /// Replaces the intersections of rays that panes reflect by those behind the panes.
    pub(super) fn restore_behind(&self, packet: &mut PacketScratch) {
        for lane in lanes_in(self.pane_lanes(&packet.hits)) {
            if packet.behind.mask >> lane & 1 == 1 {
                let (hit, material) = (packet.behind.get(lane), packet.behind.material[lane]);
                packet.hits.set(lane, &hit, material);
            } else {
                packet.hits.mask &= !(1 << lane);
            }
        }
    }

    /// Multiplies the radiance of light samples by the transmittance of the panes on their shadow rays.
    pub(super) fn attenuate_by_panes(&self, samples: &mut LightSamples) {
        if self.shapes.panes.is_empty() {
            return;
        }
        for lane in lanes_in(samples.lanes) {
            let mut radiance = lane3(&samples.radiance, lane);
            let mut rest = samples.rays.ray(lane);
            for _ in 0..MAX_PANES {
                let Some(pane) = self.next_pane(&rest) else {
                    break;
                };
                radiance *= pane.transmittance;
                rest.t_min = pane.hit.t + pane.hit.offset;
            }
            set_lane3(&mut samples.radiance, lane, radiance);
        }
    }

    /// The lanes of rays that panes reflect.
    pub(super) fn pane_lanes(&self, hits: &Intersections) -> u32 {
        if self.shapes.panes.is_empty() { 0 } else { self.lanes_where(hits, Material::is_pane) }
    }

    /// The lanes of camera rays that end at meshes which only hide what is behind them.
    pub(super) fn holdout_lanes(&self, depth: u32, hits: &Intersections) -> u32 {
        if depth == 1 && self.has_holdouts {
            self.lanes_where(hits, |material| material.is_holdout)
        } else {
            0
        }
    }

    /// The lanes of intersections with a material for which `holds`.
    fn lanes_where(&self, hits: &Intersections, holds: impl Fn(&Material) -> bool) -> u32 {
        let is_found = |lane: usize| holds(self.scene.material(hits.material[lane]));
        lanes_in(hits.mask).fold(0, |lanes, lane| lanes | u32::from(is_found(lane)) << lane)
    }

    /// Reflects the rays of `lanes` at the panes where they end. Rays of `last` are only prepared in
    /// `packet.leaving.reflected`, all others are appended to `next`.
    pub(super) fn reflect_at_panes(
        &self,
        segments: &SegmentPacket,
        lanes: u32,
        last: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let rays = &mut packet.leaving.reflected;
        for lane in lanes_in(lanes) {
            let hit = packet.hits.get(lane);
            let direction = lane3(&segments.rays.direction, lane);
            let side = if direction.dot(hit.normal) < 0.0 { 1.0 } else { -1.0 };
            let geometric = side * hit.normal;
            let mirrored = |normal: Vec3| {
                (direction - 2.0 * direction.dot(normal) * normal).normalize_or(geometric)
            };
            // A smooth normal may reflect to the other side of the surface
            let smooth = mirrored(hit.shading);
            let reflected = if smooth.dot(geometric) > 0.0 { smooth } else { mirrored(geometric) };
            set_lane3(&mut rays.origin, lane, hit.anchor + hit.offset * geometric);
            set_lane3(&mut rays.direction, lane, reflected);
            set_lane3(&mut rays.throughput, lane, lane3(&packet.throughput, lane));
        }
        let how =
            Continuation { inside: segments.inside, crossed: BodySet::EMPTY, branch: REFLECTED };
        next.reflected.push(lanes & !last, rays, segments, how);
    }
}

impl PaneCrossing {
    /// Chooses with the random number `u` whether a ray passes, and weights its throughput. Returns a random number
    /// for further panes if it does, and None if it is reflected.
    fn choose(&self, throughput: &mut Vec3, u: f32) -> Option<f32> {
        let passing = self.transmittance.max_element();
        let chance = self.reflectance / (self.reflectance + passing);
        if u < chance {
            *throughput *= self.reflectance / chance;
            return None;
        }
        *throughput *= self.transmittance / (1.0 - chance);
        Some((u - chance) / (1.0 - chance))
    }
}
