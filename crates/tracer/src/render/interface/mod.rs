//! Interfaces: surfaces that reflect and refract rays, smooth or rough, of mirroring and transmissive particles. Both
//! integrators use them.
//!
//! To add one, add a file with an [`Interface`] here and a line in [`interface_of`].

use crate::render::bsdf::SurfacePoints;
use crate::render::stream::ScatteredRays;
use crate::scene::Material;
use spherule_surface::Intersections;
use spherule_tree::math::{Lanes, Supported};
use spherule_tree::ray::RayPacket;

mod body;
mod boundaries;
mod dielectric;
mod rough;
mod spheres;

use body::BodyInterface;
pub(super) use boundaries::BoundaryTable;
pub(super) use dielectric::{Dielectric, attenuate, cross_straight, leaving};
use rough::RoughInterface;
pub use rough::rough_glass_table;
use spheres::SphereInterface;

/// The rays that leave the intersections of a packet.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(super) struct LeavingRays {
    pub(super) reflected: ScatteredRays,
    /// Only for transmissive materials.
    pub(super) refracted: ScatteredRays,
}

/// A surface that reflects and refracts rays.
pub(super) trait Interface: Sync {
    /// Its constants.
    fn dielectric(&self) -> &Dielectric;

    /// Whether the rays depend on random numbers.
    fn is_random(&self) -> bool {
        false
    }

    /// Computes the rays that leave intersections; rays of `inside` come from inside a connected body. `u` is uniform in
    /// the unit square. Changes the shading normals and the origins of shadow rays in `points` if the surface has its
    /// own.
    #[expect(clippy::too_many_arguments, reason = "arrays that do not overlap; see `lane_kernel!`")]
    fn leave(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        u: &[Lanes; 2],
        points: &mut SurfacePoints,
        leaving: &mut LeavingRays,
    );
}

/// The smooth interface of particles of a `material`. `is_connected`: they bound one body.
pub(super) fn smooth_interface_of(material: &Material, is_connected: bool) -> Box<dyn Interface> {
    let dielectric = Dielectric::new(material);
    if is_connected && dielectric.transmission > 0.0 {
        Box::new(BodyInterface(dielectric))
    } else {
        Box::new(SphereInterface(dielectric))
    }
}

/// The same, or a rough one for path tracing.
pub(super) fn interface_of(material: &Material, is_connected: bool) -> Box<dyn Interface> {
    match RoughInterface::of(material, is_connected) {
        Some(rough) => Box::new(rough),
        None => smooth_interface_of(material, is_connected),
    }
}
