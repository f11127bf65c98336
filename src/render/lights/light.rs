//! The interface between lights and integrators.

use crate::math::{Lanes3, Supported};
use crate::ray::RayPacket;

/// A light.
pub(in crate::render) trait Light: Sync {
    /// Samples the light that arrives at `start`, the shading points of a packet, if nothing is in its way.
    fn sample_li(&self, simd: Supported, start: &Lanes3, samples: &mut LightSamples);

    /// Whether things stand in its way; without, it costs no ray.
    fn casts_shadow(&self) -> bool;
}

/// A sample of a light for each shading point of a packet.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(in crate::render) struct LightSamples {
    /// Rays to the light.
    pub(in crate::render) rays: RayPacket,
    /// Radiance that arrives along each ray; then what of it the surface sends on to the sample of the picture.
    pub(in crate::render) radiance: Lanes3,
    /// Lanes that the light shines on.
    pub(in crate::render) lanes: u32,
}
