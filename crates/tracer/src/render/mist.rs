//! Mist above the ground: the part of a ray that is in it, and what it leaves of the light there. `mist_rays.rs` has it
//! along the rays of packets.
//!
//! At a height `h` above the base, the density is `exp(-h / H)` with the scale height `H`. Along a ray, it is therefore
//! an exponential function of the distance (`density_profile.rs`; Wenzel, "Real-time atmospheric effects in games", 2006).
//! There is no mist below the base, which is the height of the ground, and none inside bodies.

use super::{
    body_set::BodySet,
    density_profile::DensityProfile,
    free_path::MediumPart,
    settings::{IntegratorKind, RenderSettings},
};
use crate::scene::{Mist, Scene};
use spherule_tree::math::functions::exp;
use spherule_tree::ray::Ray;

/// Height at which the mist ends, in scale heights: densities stay normal numbers, and what is above is nothing.
const TOP: f32 = 64.0;

/// The mist of a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct MistLayer {
    mist: Mist,
    /// Height of its upper end above its base.
    top: f32,
}

/// The part of a ray that is in mist.
#[derive(Debug, Clone, Copy)]
struct InMist {
    start: f32,
    end: f32,
    profile: DensityProfile,
}

impl MistLayer {
    /// The mist of `scene`, which only paths see.
    pub(super) fn of(scene: &Scene, settings: &RenderSettings) -> Option<Self> {
        let mist = scene.mist.filter(|_| settings.integrator == IntegratorKind::Path)?;
        Some(Self { mist, top: (TOP * mist.scale_height).min(f32::MAX) })
    }

    /// The part of `ray` between the distances `from` and `to` that is in the mist.
    fn along(&self, ray: &Ray, [from, to]: [f32; 2]) -> Option<InMist> {
        let Mist { up, base, scale_height, .. } = self.mist;
        let (height, slope) = (ray.origin.dot(up) - base, ray.direction.dot(up));
        // Find the interval between base and top
        let (start, end) = if slope == 0.0 {
            let is_inside = (0.0..self.top).contains(&height);
            (from, if is_inside { to } else { from })
        } else {
            let (at_base, at_top) = (-height / slope, (self.top - height) / slope);
            (from.max(at_base.min(at_top)), to.min(at_base.max(at_top)))
        };
        // Find the density there; NaN counts as outside
        let entered = (height + slope * start).clamp(0.0, self.top);
        let density = exp(-(entered / scale_height).min(TOP));
        let rate = (slope / scale_height).clamp(-f32::MAX, f32::MAX);
        (start < end).then_some(InMist { start, end, profile: DensityProfile { density, rate } })
    }

    /// The part of the light along `ray` that the mist leaves between two distances.
    pub(super) fn transmittance(&self, ray: &Ray, ends: [f32; 2]) -> f32 {
        let depth = self.along(ray, ends).map_or(0.0, |found| {
            self.mist.extinction * found.profile.equal_length(found.end - found.start)
        });
        exp(-depth)
    }

    /// Appends the parts of `ray` between the distances `from` and `to`, of air with and without mist, to `parts`. The
    /// ray passes the surface of the body in `crossed` at the end.
    pub(super) fn push_parts(
        &self,
        ray: &Ray,
        [from, to]: [f32; 2],
        crossed: BodySet,
        parts: &mut Vec<MediumPart>,
    ) {
        if let Some(InMist { start, end, profile }) = self.along(ray, [from, to]) {
            if start > from {
                parts.push(MediumPart::air(start));
            }
            let Mist { extinction, albedo, anisotropy, .. } = self.mist;
            parts.push(MediumPart::of_mist(extinction, albedo, anisotropy, profile, end));
        }
        // Nothing follows where the ray ends nowhere
        if to < f32::INFINITY {
            parts.push(MediumPart { crossed, ..MediumPart::air(to) });
        }
    }
}

#[cfg(test)]
#[path = "mist_tests.rs"]
mod tests;
