//! The diffuse and the glossy part of reflections, for light channels.

use super::{PathIntegrator, Surface};
use crate::render::bsdf::SurfacePoints;
use crate::render::scratch::PacketScratch;
use spherule_surface::Intersections;
use spherule_tree::math::Lanes3;

impl PathIntegrator<'_> {
    /// Finds the diffuse part of the reflection of `packet.light`.
    pub(super) fn divide_samples(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        if packet.split.is_active {
            let direction = packet.light.rays.direction;
            self.divide(surface, &direction, packet);
        }
    }

    /// Finds the diffuse part of the reflection of light from `direction`.
    pub(super) fn divide(
        &self,
        surface: &Surface<'_>,
        direction: &Lanes3,
        packet: &mut PacketScratch,
    ) {
        let PacketScratch { hits, surface: points, split, .. } = packet;
        self.diffuse_part(surface, direction, (hits, points), &mut split.diffuse);
    }

    /// Stores the diffuse part of the reflection of light from `direction` at `points`.
    pub(super) fn diffuse_part(
        &self,
        surface: &Surface<'_>,
        direction: &Lanes3,
        (hits, points): (&Intersections, &SurfacePoints),
        part: &mut Lanes3,
    ) {
        for (material, lanes) in hits.materials_of(surface.lanes) {
            let bsdf = &self.bsdfs[material.index()];
            bsdf.diffuse_part(&surface.segments.rays, points, direction, lanes, part);
        }
    }
}
