//! Shading points, which materials compute from intersections.

use crate::render::stream::ScatteredRays;
use spherule_tree::math::Lanes3;

/// The intersections of a packet, prepared for direct light and for further rays.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(in crate::render) struct ShadingPoints {
    /// Unit shading normal, on the side of the ray.
    pub(in crate::render) normal: Lanes3,
    /// Origins of shadow rays.
    pub(in crate::render) start: Lanes3,
    /// Reflected rays.
    pub(in crate::render) reflected: ScatteredRays,
    /// Refracted rays, only for transmissive materials.
    pub(in crate::render) refracted: ScatteredRays,
}
