//! Absorption inside transmissive bodies by the Beer-Lambert law.
//!
//! The extinction coefficient of a medium is that of its material, and may have in addition absorption that follows from
//! the colours of the particles. In that case, a segment of a ray has the mean of the coefficients at its ends (trapezoidal
//! rule). That is exact where the coefficient varies linearly along the segment; colours between the ends are not seen.

use glam::Vec3;

use super::{bodies::TransmissiveBody, context::RenderContext, interface::attenuate};
use crate::scene::material::extinction;
use spherule_surface::Shape;
use spherule_tree::math::functions::exp;
use spherule_tree::math::{Lanes, Lanes3, lanes_in};
use spherule_tree::ray::RayPacket;

/// How far from the ends of a segment its colours are, as a part of its length: rounding may put the ends themselves outside
/// of a body. The mean of a linear coefficient stays the same.
const INSET: f32 = 1.0 / 1024.0;

/// The parts of rays that are inside a medium.
#[derive(Clone, Copy)]
pub(super) struct InsideSegments<'a> {
    pub(super) rays: &'a RayPacket,
    /// Distances along the rays at which the parts begin.
    pub(super) from: &'a Lanes,
    /// Their lengths.
    pub(super) length: &'a Lanes,
    pub(super) lanes: u32,
}

impl RenderContext<'_> {
    /// Multiplies `throughput` by the transmittance of the medium of `body` along `segments`.
    pub(super) fn absorb_in(
        &self,
        body: &TransmissiveBody<'_>,
        segments: InsideSegments<'_>,
        throughput: &mut Lanes3,
    ) {
        let InsideSegments { rays, from, length, lanes } = segments;
        if body.material.color_length.is_none() {
            attenuate(self.simd, &body.material.extinction, length, lanes, throughput);
            return;
        }
        for lane in lanes_in(lanes) {
            let ends = [from[lane], from[lane] + length[lane]];
            let coefficient = self.mean_extinction(body, rays, lane, ends);
            for axis in 0..3 {
                throughput[axis][lane] *= exp(-length[lane] * coefficient[axis]);
            }
        }
    }

    /// The mean extinction coefficient of the medium of `body` along the ray in `lane` between two distances.
    pub(super) fn mean_extinction(
        &self,
        body: &TransmissiveBody<'_>,
        rays: &RayPacket,
        lane: usize,
        ends: [f32; 2],
    ) -> Vec3 {
        let Some(length) = body.material.color_length else {
            return body.material.extinction;
        };
        let ray = rays.ray(lane);
        let at = |t: f32| {
            let color = self.color_inside(body.shape, ray.at(t), rays.time[lane]);
            color.map(|color| body.material.extinction + extinction(color, length))
        };
        let [from, to] = ends;
        let inset = INSET * (to - from);
        match [from + inset, to - inset].map(at) {
            [Some(first), Some(last)] => 0.5 * (first + last),
            // There is no particle where a ray has left through a crack in the surface, and deep inside a body
            [found, None] | [None, found] => found.unwrap_or(body.material.extinction),
        }
    }

    /// The extinction coefficient of the medium of the separate sphere of a `particle`.
    pub(super) fn sphere_extinction(&self, particle: u32) -> Vec3 {
        let material = self.scene.particle_material();
        match material.color_length {
            None => material.extinction,
            // Each sphere has one colour
            Some(length) => material.extinction + extinction(self.source.color(particle), length),
        }
    }

    /// The blended colour of the particles of a connected `body` around a point inside; None if there are none.
    fn color_inside(&self, body: &dyn Shape, point: Vec3, time: f32) -> Option<Vec3> {
        let mut parts = Vec::new();
        body.blend_at(point, time, &mut |particle, weight| parts.push((particle, weight)));
        (!parts.is_empty()).then(|| self.source.blended_color(&parts))
    }
}

#[cfg(test)]
#[path = "absorption_tests.rs"]
mod tests;
