//! Shading points: what materials make of intersections.

use crate::math::Lanes3;
use crate::render::stream::ScatteredRays;

/// Where the rays of a packet meet surfaces, as light and further rays see it.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(in crate::render) struct ShadingPoints {
    /// Unit normal to shade by, on the side that the ray comes from.
    pub(in crate::render) normal: Lanes3,
    /// Where rays to lights start.
    pub(in crate::render) start: Lanes3,
    /// Reflected rays.
    pub(in crate::render) reflected: ScatteredRays,
    /// Refracted rays, of transmissive materials alone.
    pub(in crate::render) refracted: ScatteredRays,
}
