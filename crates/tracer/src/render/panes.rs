//! Shapes that the camera does not see as opaque surfaces: thin panes of glass, and holdouts.
//!
//! A pane is a mesh or a connected body. A surface of a mesh stands for a whole wall, with both of its sides; the surface of
//! a body is one side of a wall.
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
use crate::scene::material::{pane_reflectance, surface_reflectance};
use glam::Vec3;
use spherule_surface::{Intersection, Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::RayPacket;

/// Maximum number of panes in a scene, and along a ray; further ones are not there.
const MAX_PANES: usize = 64;

/// A ray at a pane.
pub(super) struct PaneCrossing {
    pub(super) hit: Intersection,
    material: MaterialId,
    /// Part of the light that is reflected.
    pub(super) reflectance: f32,
    /// Part of the light that passes, linear RGB.
    pub(super) transmittance: Vec3,
}

impl RenderContext<'_> {
    /// Calls `visit` with those of `panes` on the rays of `lanes`, from the origin on, until it returns false or the ray
    /// ends. At equal distances, the first pane comes first.
    pub(super) fn walk_panes(
        &self,
        panes: &[&dyn Shape],
        mut rays: RayPacket,
        lanes: u32,
        coherence: Coherence,
        mut visit: impl FnMut(usize, PaneCrossing) -> bool,
    ) {
        let panes = &panes[..panes.len().min(MAX_PANES)];
        // The lanes that are inside panes that are connected bodies
        let mut inside = [0; MAX_PANES];
        for (inside, pane) in inside.iter_mut().zip(panes).filter(|(_, p)| p.is_connected()) {
            *inside = lanes_inside(*pane, &rays, lanes);
        }
        let far = rays.t_max;
        let mut alive = lanes;
        let mut hits = Intersections::default();
        for _ in 0..MAX_PANES {
            rays.keep_only(alive);
            hits.clear();
            for (pane, inside) in panes.iter().zip(&inside) {
                pane.intersect(&mut rays, coherence, inside & alive, &mut hits);
            }
            alive &= hits.mask;
            for lane in lanes_in(alive) {
                let (hit, material) = (hits.get(lane), hits.material[lane]);
                let is_hit = |pane: &&dyn Shape| pane.material() == material;
                let Some(index) = panes.iter().position(is_hit) else {
                    continue;
                };
                // Light that leaves a body crosses one side of the wall, and at a mesh both of them
                let cosine = hit.normal.dot(lane3(&rays.direction, lane)).abs();
                let reflectance = if panes[index].is_connected() {
                    inside[index] ^= 1 << lane;
                    surface_reflectance(cosine)
                } else {
                    pane_reflectance(cosine)
                };
                let color = self.scene.material(material).color.unwrap_or(Vec3::ONE);
                let transmittance = (1.0 - reflectance) * color;
                if !visit(lane, PaneCrossing { hit, material, reflectance, transmittance }) {
                    alive &= !(1 << lane);
                }
            }
            if alive == 0 {
                break;
            }
            hits.continue_rays(&mut rays, alive, &far);
        }
    }

    /// Multiplies the throughput of `packet` by the transmittance of the panes up to its intersections. In path
    /// tracing, ends some of the rays at a pane that reflects them.
    pub(super) fn pass_panes(
        &self,
        segments: &mut SegmentPacket,
        coherence: Coherence,
        packet: &mut PacketScratch,
    ) {
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
        // Follow the rays from pane to pane
        let panes = &self.shapes.panes;
        self.walk_panes(panes, segments.rays, segments.lanes(), coherence, |lane, pane| {
            // The pane takes some of the light, or is the intersection of the path
            packet.first_pane[lane] = packet.first_pane[lane].min(pane.hit.t);
            let mut throughput = lane3(&packet.throughput, lane);
            let passes = if !is_path {
                throughput *= pane.transmittance;
                true
            } else if let Some(rest) = pane.choose(&mut throughput, u[lane]) {
                u[lane] = rest;
                true
            } else {
                self.keep_behind(lane, packet);
                packet.hits.set(lane, &pane.hit, pane.material);
                segments.rays.t_max[lane] = pane.hit.t;
                false
            };
            set_lane3(&mut packet.throughput, lane, throughput);
            passes
        });
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
    pub(super) fn attenuate_by_panes(&self, samples: &mut LightSamples, coherence: Coherence) {
        if self.shapes.panes.is_empty() {
            return;
        }
        let (panes, radiance) = (&self.shapes.panes, &mut samples.radiance);
        self.walk_panes(panes, samples.rays, samples.lanes, coherence, |lane, pane| {
            set_lane3(radiance, lane, lane3(radiance, lane) * pane.transmittance);
            true
        });
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
        lanes_in(hits.mask).mask_where(is_found)
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
            let (geometric, reflected) = reflected(direction, &hit);
            set_lane3(&mut rays.origin, lane, hit.anchor + hit.offset * geometric);
            set_lane3(&mut rays.direction, lane, reflected);
            set_lane3(&mut rays.throughput, lane, lane3(&packet.throughput, lane));
        }
        let how =
            Continuation { inside: segments.inside, crossed: BodySet::EMPTY, branch: REFLECTED };
        next.reflected.push(lanes & !last, rays, segments, how);
    }
}

/// The normal of a pane on the side of a ray that hits it with this `direction`, and the direction of the reflected ray.
pub(super) fn reflected(direction: Vec3, hit: &Intersection) -> (Vec3, Vec3) {
    let side = if direction.dot(hit.normal) < 0.0 { 1.0 } else { -1.0 };
    let geometric = side * hit.normal;
    let mirrored =
        |normal: Vec3| (direction - 2.0 * direction.dot(normal) * normal).normalize_or(geometric);
    // A smooth normal may reflect to the other side of the surface
    let smooth = mirrored(hit.shading);
    (geometric, if smooth.dot(geometric) > 0.0 { smooth } else { mirrored(geometric) })
}

/// The lanes of `lanes` whose rays start inside a body.
fn lanes_inside(body: &dyn Shape, rays: &RayPacket, lanes: u32) -> u32 {
    let is_inside = |lane: usize| {
        let ray = rays.ray(lane);
        body.side_of(ray.at(ray.t_min)) == Side::Inside
    };
    lanes_in(lanes).mask_where(is_inside)
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
