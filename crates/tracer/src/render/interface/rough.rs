//! Rough interfaces of transmissive particles: reflection and refraction at microfacets (Walter et al., "Microfacet
//! Models for Refraction through Rough Surfaces", 2007).
//!
//! A visible microfacet normal is sampled (Heitz and d'Eon, "Importance Sampling Microfacet-Based BSDFs using the
//! Distribution of Visible Normals", 2014), and takes the place of the surface normal in the laws of Fresnel and Snell.
//! What remains of the BSDF over its density is the part of the light that other microfacets do not block on its way
//! out. Light that they block meets further microfacets; it is added in proportion to the light that leaves at once
//! (Turquin, "Practical Multiple Scattering Compensation for Microfacet Models", 2019). That loses no light, but is
//! only reciprocal without it.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::{Dielectric, Interface, LeavingRays};
use crate::render::bsdf::SurfacePoints;
use crate::render::bsdf::microfacet::{
    Albedo, Ggx, direction_at, dot, mean_over_square, mirror, normalized,
};
use crate::render::shading::{tangents, to_world};
use crate::scene::Material;
use spherule_surface::Intersections;
use spherule_tree::math::{LANES, Lanes, Supported, lane_kernel, larger};
use spherule_tree::ray::RayPacket;

/// Least cosine of the direction towards the origin of a ray: shading normals may face away from it.
const MIN_COSINE: f32 = 1e-3;

/// The rough interface of transmissive particles, see the module.
#[derive(Debug, Clone)]
pub(super) struct RoughInterface {
    dielectric: Dielectric,
    ggx: Ggx,
    /// The part of the light that leaves after one microfacet, for rays from outside and from inside.
    passing: [Albedo; 2],
    /// Whether the particles bound one body, which has shading normals, and whose rays are on one side of it.
    is_connected: bool,
}

impl RoughInterface {
    /// The interface of `material`, unless it is smooth.
    pub(super) fn of(material: &Material, is_connected: bool) -> Option<Self> {
        if material.interface_roughness <= 0.0 {
            return None;
        }
        let (dielectric, ggx) = (Dielectric::new(material), Ggx::new(material.interface_roughness));
        let passing = [1.0 / material.ior, material.ior].map(|ratio| {
            Albedo::tabulated(|cosine| {
                let out = direction_at(cosine);
                mean_over_square(|u| leave(&ggx, &dielectric, out, ratio, u).weights.iter().sum())
            })
        });
        Some(Self { dielectric, ggx, passing, is_connected })
    }
}

/// Width of the microfacets of separate spheres of a transmissive `material`, and the fractions of light that leave their
/// surface after one of them, for cosines from 0 to 1, evenly spaced, with their mean: for light from outside, then for
/// light from inside. None if they are smooth.
pub fn rough_glass_table(material: &Material) -> Option<(f32, Vec<f32>)> {
    let interface = RoughInterface::of(material, false)?;
    let numbers = interface.passing.iter().flat_map(Albedo::table).collect();
    Some((interface.ggx.width(), numbers))
}

impl Interface for RoughInterface {
    fn dielectric(&self) -> &Dielectric {
        &self.dielectric
    }

    fn is_random(&self) -> bool {
        true
    }

    fn leave(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        u: &[Lanes; 2],
        _points: &mut SurfacePoints,
        leaving: &mut LeavingRays,
    ) {
        rough_rays(simd, self, rays, hits, inside, u, leaving);
    }
}

/// The rays that leave a microfacet.
#[derive(Debug, Clone, Copy)]
struct MicrofacetRays {
    reflected: [f32; 3],
    refracted: [f32; 3],
    /// Weights of both: Fresnel's, times the part that other microfacets do not block.
    weights: [f32; 2],
}

/// The rays that leave a microfacet, in the frame of the surface. `out` is the direction against the arriving ray,
/// `ratio` the index of refraction on its side over that on the other side.
#[inline(always)]
fn leave(
    ggx: &Ggx,
    dielectric: &Dielectric,
    out: [f32; 3],
    ratio: f32,
    u: [f32; 2],
) -> MicrofacetRays {
    let h = ggx.sample_normal(out, u);
    // Reflect and refract the ray at the microfacet
    let cosine = larger(dot(out, h), 0.0);
    let (r, sin2_out) = dielectric.fresnel(cosine, ratio);
    let along = ratio * cosine - larger(1.0 - sin2_out, 0.0).sqrt();
    let reflected = mirror(out, h);
    let refracted = [0, 1, 2].map(|axis| along * h[axis] - ratio * out[axis]);
    // A reflected ray that goes down, and a refracted one that goes up, meet another microfacet
    let of_reflected = if reflected[2] > 0.0 { r } else { 0.0 };
    let of_refracted = if refracted[2] < 0.0 { 1.0 - r } else { 0.0 };
    MicrofacetRays {
        reflected,
        refracted,
        weights: [
            of_reflected * passed(ggx, out[2], reflected[2].abs()),
            of_refracted * passed(ggx, out[2], refracted[2].abs()),
        ],
    }
}

/// The part of the light that leaves with the cosine `into`, if it has reached a microfacet with the cosine `out`.
#[inline(always)]
fn passed(ggx: &Ggx, out: f32, into: f32) -> f32 {
    ggx.shadowing(out, larger(into, 1e-6)) / ggx.masking(out)
}

/// See [`Interface::leave`].
#[inline(always)]
fn rough_rays_body(
    interface: &RoughInterface,
    rays: &RayPacket,
    hits: &Intersections,
    inside: u32,
    u: &[Lanes; 2],
    leaving: &mut LeavingRays,
) {
    let dielectric = &interface.dielectric;
    for l in 0..LANES {
        let mut out = [0.0; 3];
        let mut n = [0.0; 3];
        for axis in 0..3 {
            out[axis] = -rays.direction[axis][l];
            n[axis] = hits.normal[axis][l];
        }
        // Find the side of the ray, and turn the normals to it
        let is_leaving = dot(out, n) <= 0.0;
        let is_inside = if interface.is_connected { inside >> l & 1 == 1 } else { is_leaving };
        let side = if is_inside { -1.0 } else { 1.0 };
        let mut normal = [0.0; 3];
        for axis in 0..3 {
            let shading = hits.shading_normal[axis][l];
            normal[axis] = side * if interface.is_connected { shading } else { n[axis] };
        }
        // Sample the rays in the frame of the normal
        let [s, t] = tangents(normal);
        let up = larger(dot(out, normal), MIN_COSINE);
        let local = normalized([dot(out, s), dot(out, t), up]);
        let ratio = if is_inside { dielectric.ior } else { 1.0 / dielectric.ior };
        let found = leave(&interface.ggx, dielectric, local, ratio, [u[0][l], u[1][l]]);
        // Add the light that leaves after several microfacets
        let [outside, inside] = &interface.passing;
        let passing = [outside.at(local[2]), inside.at(local[2])];
        let more = 1.0 / if is_inside { passing[1] } else { passing[0] };
        let reflected = to_world(found.reflected, normal);
        let refracted = to_world(found.refracted, normal);
        for axis in 0..3 {
            let step = hits.offset[l] * (n[axis] * side);
            leaving.reflected.origin[axis][l] = hits.anchor[axis][l] + step;
            leaving.reflected.direction[axis][l] = reflected[axis];
            leaving.refracted.origin[axis][l] = hits.anchor[axis][l] - step;
            leaving.refracted.direction[axis][l] = refracted[axis];
        }
        leaving.reflected.weight[l] = dielectric.reflection * found.weights[0] * more;
        let transmission = dielectric.transmission;
        leaving.refracted.weight[l] = transmission * found.weights[1] * more;
    }
}

lane_kernel! {
    fn rough_rays(
        interface: &RoughInterface,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        u: &[Lanes; 2],
        leaving: &mut LeavingRays,
    ) = rough_rays_body;
}

#[cfg(test)]
#[path = "rough_tests.rs"]
mod tests;
