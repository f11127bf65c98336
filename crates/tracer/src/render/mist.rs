//! Mist above the ground: the parts of rays in the air that are in it, and what it leaves of the light along shadow rays
//! and photons.
//!
//! At a height `h` above the base, the density is `exp(-h / H)` with the scale height `H`. Along a ray, it is therefore an
//! exponential function of the distance (`density_profile.rs`; Wenzel, "Real-time atmospheric effects in games", 2006).
//! There is no mist below the base, which is the height of the ground, and none inside bodies.

use super::{
    body_set::BodySet,
    context::RenderContext,
    density_profile::DensityProfile,
    free_path::MediumPart,
    interface::leaving,
    lights::LightSamples,
    scene_shapes::Interior,
    scratch::PacketScratch,
    settings::{IntegratorKind, RenderSettings},
    stream::SegmentPacket,
};
use crate::scene::{Mist, Scene};
use spherule_surface::MaterialId;
use spherule_tree::math::functions::exp;
use spherule_tree::math::{Lanes3, lane3, lanes_in, set_lane3};
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
    fn push_parts(
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

impl RenderContext<'_> {
    /// Appends the parts of the ray in `lane` that are in air, between two distances, to those in `parts`.
    pub(super) fn push_air(
        &self,
        segments: &SegmentPacket,
        lane: usize,
        ends: [f32; 2],
        crossed: BodySet,
        parts: &mut Vec<MediumPart>,
    ) {
        match &self.mist {
            Some(mist) => mist.push_parts(&segments.rays.ray(lane), ends, crossed, parts),
            None if ends[1] < f32::INFINITY => {
                parts.push(MediumPart { crossed, ..MediumPart::air(ends[1]) });
            }
            None => {}
        }
    }

    /// Finds the mist along the rays outside all bodies. The parts of those inside are known.
    pub(super) fn find_mist(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        if self.mist.is_none() {
            return;
        }
        let PacketScratch { media, hits, .. } = packet;
        for lane in lanes_in(segments.lanes() & !segments.inside) {
            // A ray that leaves a separate sphere has passed through its medium
            if media.parts[lane].is_empty() {
                let is_hit = hits.mask >> lane & 1 == 1;
                let end = if is_hit { hits.t[lane] } else { f32::INFINITY };
                let parts = &mut media.parts[lane];
                self.push_air(segments, lane, [0.0, end], BodySet::EMPTY, parts);
            }
        }
    }

    /// Multiplies the throughput of photons outside all bodies by what the mist leaves of them up to their intersections.
    pub(super) fn attenuate_photons(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        let Some(mist) = &self.mist else {
            return;
        };
        let PacketScratch { hits, throughput, .. } = packet;
        let mut lanes = hits.mask & !segments.inside;
        if self.shapes.interior == Interior::Spheres {
            let inside = leaving(self.simd, &segments.rays, hits);
            lanes &= !(hits.lanes_of(MaterialId::PARTICLES) & inside);
        }
        for lane in lanes_in(lanes) {
            let passing = mist.transmittance(&segments.rays.ray(lane), [0.0, hits.t[lane]]);
            set_lane3(throughput, lane, lane3(throughput, lane) * passing);
        }
    }

    /// Multiplies the radiance of light samples by what the mist leaves of it along their whole shadow rays, which start
    /// outside all bodies unless the rays of `segments` are inside.
    pub(super) fn attenuate_by_mist(&self, segments: &SegmentPacket, samples: &mut LightSamples) {
        let Some(mist) = self.mist.as_ref().filter(|_| !samples.ignores_mist) else {
            return;
        };
        for lane in lanes_in(samples.lanes & !segments.inside) {
            let ends = [samples.rays.t_min[lane], samples.rays.t_max[lane]];
            let passing = mist.transmittance(&samples.rays.ray(lane), ends);
            let radiance = lane3(&samples.radiance, lane) * passing;
            set_lane3(&mut samples.radiance, lane, radiance);
        }
    }

    /// Multiplies `transmittance` by that of the mist on the part of a shadow ray between two distances, which is outside
    /// all bodies.
    pub(super) fn attenuate_outside(
        &self,
        samples: &LightSamples,
        lane: usize,
        ends: [f32; 2],
        transmittance: &mut Lanes3,
    ) {
        if let Some(mist) = self.mist.as_ref().filter(|_| !samples.ignores_mist) {
            let passing = mist.transmittance(&samples.rays.ray(lane), ends);
            set_lane3(transmittance, lane, lane3(transmittance, lane) * passing);
        }
    }
}

#[cfg(test)]
#[path = "mist_tests.rs"]
mod tests;
