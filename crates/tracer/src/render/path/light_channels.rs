//! The diffuse and the glossy part of reflections, for light channels.

use super::{PathIntegrator, Surface};
use crate::render::scratch::PacketScratch;
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
        for (material, lanes) in packet.hits.materials_of(surface.lanes) {
            let (rays, diffuse) = (&surface.segments.rays, &mut packet.split.diffuse);
            let bsdf = &self.bsdfs[material.index()];
            bsdf.diffuse_part(rays, &packet.surface, direction, lanes, diffuse);
        }
    }
}
