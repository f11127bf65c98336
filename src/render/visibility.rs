//! What stands between shading points and lights.
//!
//! Rays to lights go straight on through transmissive bodies, so there are no caustics. They keep
//! `transmission*(1-r)` at each crossing of a surface, with `r` for the angle outside on both sides of it (a ray
//! that was bent there would have come from such an angle, and is never reflected totally), and what one connected body
//! does not absorb.

use super::{
    integrator::{Interior, WhittedIntegrator},
    lights::LightSamples,
    materials::{attenuate, passed_straight},
    shading::product,
};
use crate::accel::Coherence;
use crate::math::{Lanes3, first_lanes, lane3, lanes_in, splat};
use crate::ray::RayPacket;
use crate::surface::{Intersections, MaterialId, Shape};

/// Most crossings of one body that a ray to a light is followed through.
const MAX_CROSSINGS: u32 = 64;

/// Light below this part is dark.
const DARK: f32 = 1.0 / 4096.0;

impl WhittedIntegrator<'_> {
    /// The lanes that a light reaches. Its contribution is dimmed by what it comes through; shading points in `inside`
    /// lie in one connected body.
    pub(super) fn visible(
        &self,
        samples: &mut LightSamples,
        coherence: Coherence,
        inside: u32,
        crossings: &mut Intersections,
    ) -> u32 {
        let rays = &samples.rays;
        // Rays that an opaque shape stops need not be traced on.
        let mut lanes = samples.lanes;
        for shape in &self.shapes {
            let is_opaque =
                self.interior == Interior::Opaque || shape.material() != MaterialId::PARTICLES;
            if is_opaque && lanes != 0 {
                lanes &= !shape.occluded(rays, coherence, lanes);
            }
        }
        let Some(particles) = self.particles.filter(|_| self.interior != Interior::Opaque) else {
            return lanes;
        };
        if lanes == 0 {
            return 0;
        }
        let mut kept = [splat(1.0); 3];
        let reached = match self.interior {
            Interior::Body => self.through_body(
                particles, rays, coherence, lanes, inside, crossings, &mut kept,
            ),
            _ => self.through_spheres(particles, rays, lanes, &mut kept),
        };
        let arriving = samples.radiance;
        product(self.simd, &arriving, &kept, &mut samples.radiance);
        reached
    }

    /// What rays keep on their way through spheres that are bodies of their own. The lanes where that is anything.
    fn through_spheres(
        &self,
        spheres: &dyn Shape,
        rays: &RayPacket,
        lanes: u32,
        kept: &mut Lanes3,
    ) -> u32 {
        let material = self.particle_constants();
        let passed = |cosine: f32| material.passed_straight(cosine);
        spheres.transmittance(rays, lanes, &passed, &mut kept[0]);
        kept[1] = kept[0];
        kept[2] = kept[0];
        let is_lit = |lane: usize| u32::from(kept[0][lane] > 0.0) << lane;
        lanes_in(lanes).fold(0, |reached, lane| reached | is_lit(lane))
    }

    /// What rays keep on their way through one connected body, crossing after crossing of all rays at once. The lanes
    /// where that is anything.
    #[expect(
        clippy::too_many_arguments,
        reason = "what rays carry, and where results go"
    )]
    fn through_body(
        &self,
        body: &dyn Shape,
        rays: &RayPacket,
        mut coherence: Coherence,
        lanes: u32,
        mut inside: u32,
        hits: &mut Intersections,
        kept: &mut Lanes3,
    ) -> u32 {
        let material = self.particle_constants();
        let mut ahead = *rays;
        let mut reached = lanes;
        let mut alive = lanes;
        // Where the way since the last crossing begins.
        let mut from = rays.t_min;
        for _ in 0..MAX_CROSSINGS {
            for lane in lanes_in(!alive & first_lanes(rays.len())) {
                ahead.t_max[lane] = -1.0;
            }
            hits.clear();
            body.intersect(&mut ahead, coherence, inside & alive, hits);
            let met = hits.mask & alive;
            // The way inside, to a crossing or to the light; one without an end is a crack in the surface.
            let mut length = splat(0.0);
            for lane in lanes_in(alive & inside) {
                let end = if met >> lane & 1 == 1 {
                    hits.t[lane]
                } else {
                    rays.t_max[lane]
                };
                length[lane] = if end.is_finite() {
                    end - from[lane]
                } else {
                    0.0
                };
            }
            attenuate(
                self.simd,
                &material.extinction,
                &length,
                alive & inside,
                kept,
            );
            passed_straight(self.simd, material, rays, hits, met, kept);
            let is_dark = |lane: usize| lane3(kept, lane).max_element() < DARK;
            let dark = lanes_in(met).fold(0, |dark, lane| dark | u32::from(is_dark(lane)) << lane);
            reached &= !dark;
            alive = met & !dark;
            if alive == 0 {
                break;
            }
            for lane in lanes_in(alive) {
                from[lane] = hits.t[lane];
                ahead.t_min[lane] = hits.t[lane] + hits.offset[lane];
                ahead.t_max[lane] = rays.t_max[lane];
            }
            inside ^= alive;
            coherence = Coherence::Incoherent;
        }
        reached
    }
}
