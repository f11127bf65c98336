//! The smooth interface of a transmissive medium, and absorption inside it.

use glam::Vec3;

use crate::scene::material::{dielectric, schlick};
use crate::scene::{self, Fresnel};
use spherule_surface::Intersections;
use spherule_tree::math::functions::exp;
use spherule_tree::math::{LANES, Lanes, Lanes3, lane_kernel};
use spherule_tree::ray::RayPacket;

/// The constants of an interface, and of the medium inside.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Dielectric {
    /// Weight of the reflected ray; 0 if the surface does not mirror.
    pub(in crate::render) reflection: f32,
    /// Relative index of refraction: inside over outside.
    pub(super) ior: f32,
    /// Index of refraction on the side of a shadow ray over that on the other side, see
    /// [`Self::straight_transmittance`].
    straight_ratio: f32,
    r0: f32,
    is_exact: bool,
    /// Weight of the refracted ray; 0 if opaque.
    pub(in crate::render) transmission: f32,
}

impl Dielectric {
    pub(in crate::render) fn new(material: &scene::Material) -> Self {
        Self {
            reflection: material.reflection,
            ior: material.ior,
            straight_ratio: 1.0 / material.ior,
            r0: material.r0(),
            is_exact: material.fresnel == Fresnel::Exact,
            transmission: material.transmission,
        }
    }

    /// The constants for shadow rays between two media. Either may refract more; light is never totally reflected.
    pub(super) fn for_straight_rays(material: &scene::Material) -> Self {
        let straight_ratio = material.ior.min(1.0 / material.ior);
        Self { straight_ratio, ..Self::new(material) }
    }

    /// The Fresnel reflectance at the absolute `cosine` between ray and normal, and the squared sine of the refracted
    /// ray, which is 1 or more under total internal reflection. `ratio` is the index of refraction on the side of the
    /// ray over that on the other side.
    #[inline(always)]
    pub(super) fn fresnel(&self, cosine: f32, ratio: f32) -> (f32, f32) {
        let rest = 1.0 - cosine * cosine;
        let sin2_out = ratio * ratio * if rest > 0.0 { rest } else { 0.0 };
        let r = self.reflectance(cosine, ratio);
        (if sin2_out >= 1.0 { 1.0 } else { r }, sin2_out)
    }

    /// Transmittance of a shadow ray that crosses the interface without refraction, at the absolute `cosine` with the
    /// normal. It is that of a ray from outside, whatever side the shadow ray comes from.
    #[inline(always)]
    pub(in crate::render) fn straight_transmittance(&self, cosine: f32) -> f32 {
        self.transmission * (1.0 - self.reflectance(cosine, self.straight_ratio))
    }

    #[inline(always)]
    fn reflectance(&self, cosine: f32, ratio: f32) -> f32 {
        if self.is_exact { dielectric(cosine, ratio) } else { schlick(self.r0, cosine) }
    }
}

/// Multiplies `throughput` by the transmittance of a medium over `length` (Beer-Lambert law), only for `lanes`.
#[inline(always)]
fn attenuate_body(extinction: &Vec3, length: &Lanes, lanes: u32, throughput: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            let length = if length[l] > 0.0 { length[l] } else { 0.0 };
            let attenuated = throughput[axis][l] * exp(-length * extinction[axis]);
            let is_inside = lanes >> l & 1 == 1;
            throughput[axis][l] = if is_inside { attenuated } else { throughput[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn attenuate(
        extinction: &Vec3,
        length: &Lanes,
        lanes: u32,
        throughput: &mut Lanes3,
    ) = attenuate_body;
}

/// The lanes of rays that leave a sphere at their intersection.
#[inline(always)]
fn leaving_body(rays: &RayPacket, hits: &Intersections) -> u32 {
    let (d, n) = (&rays.direction, &hits.normal);
    let mut leaving = 0;
    for l in 0..LANES {
        let along = d[0][l] * n[0][l] + d[1][l] * n[1][l] + d[2][l] * n[2][l];
        leaving |= u32::from(along >= 0.0) << l;
    }
    leaving
}

lane_kernel! {
    pub(in crate::render) fn leaving(rays: &RayPacket, hits: &Intersections) -> u32 = leaving_body;
}

/// Multiplies `transmittance` by that of the interface that shadow rays cross, only for `lanes`.
#[inline(always)]
fn cross_straight_body(
    boundary: &Dielectric,
    rays: &RayPacket,
    hits: &Intersections,
    lanes: u32,
    transmittance: &mut Lanes3,
) {
    let (d, n) = (&rays.direction, &hits.normal);
    for l in 0..LANES {
        let along = d[0][l] * n[0][l] + d[1][l] * n[1][l] + d[2][l] * n[2][l];
        let fresnel_transmittance = boundary.straight_transmittance(along.abs());
        let fresnel_transmittance = if lanes >> l & 1 == 1 { fresnel_transmittance } else { 1.0 };
        for transmittance in &mut *transmittance {
            transmittance[l] *= fresnel_transmittance;
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn cross_straight(
        boundary: &Dielectric,
        rays: &RayPacket,
        hits: &Intersections,
        lanes: u32,
        transmittance: &mut Lanes3,
    ) = cross_straight_body;
}
