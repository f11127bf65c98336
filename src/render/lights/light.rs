//! The interface between lights and integrators.

use crate::math::{Lanes, Lanes3, Supported};
use crate::ray::RayPacket;

/// A light.
pub(in crate::render) trait Light: Sync {
    /// Samples the unoccluded light at `start`, the shading points of a packet.
    fn sample_li(&self, simd: Supported, start: &Lanes3, samples: &mut LightSamples);

    /// Whether other objects occlude the light. A light without shadows needs no shadow rays.
    fn casts_shadow(&self) -> bool;
}

/// A sample of a light for each shading point of a packet.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(in crate::render) struct LightSamples {
    /// Rays to the light.
    pub(in crate::render) rays: RayPacket,
    /// Radiance that arrives along each ray; after `Material::reflect`, the radiance that arrives at the sample of
    /// the image.
    pub(in crate::render) radiance: Lanes3,
    /// Probability density of each direction, per steradian; infinite for lights without extent. Only used by path
    /// tracing.
    pub(in crate::render) pdf: Lanes,
    /// Lanes that the light reaches.
    pub(in crate::render) lanes: u32,
}
