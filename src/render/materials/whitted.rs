//! Eq. 4.1 and 4.3 for surfaces that are opaque or bound spheres, each a body of its own.
//!
//! Normals face the ray that sees them, as the thesis's `faceforward` turns them, so that a surface seen from inside
//! is lit from inside. Under total internal reflection `r` is 1.

use glam::Vec3;

use super::{Material, ShadingPoints};
use crate::math::{LANES, Supported, lane_kernel};
use crate::ray::RayPacket;
use crate::scene::material::{dielectric, schlick};
use crate::scene::{self, Fresnel};
use crate::surface::Intersections;

/// The constants of eq. 4.1 to 4.3, settled for a scene.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct WhittedMaterial {
    /// `Ka` times the ambient light, linear RGB.
    pub(in crate::render) ambient: Vec3,
    pub(in crate::render) diffuse: f32,
    pub(in crate::render) specular: f32,
    pub(in crate::render) shininess: f32,
    /// Highlights up to this part of the light are left out.
    pub(in crate::render) darkest_highlight: f32,
    pub(super) ior: f32,
    r0: f32,
    is_exact: bool,
    /// Weight of the reflected ray.
    pub(in crate::render) reflection: f32,
    /// Weight of the refracted ray.
    pub(in crate::render) transmission: f32,
    /// What is taken of light inside, per length, linear RGB.
    pub(in crate::render) extinction: Vec3,
}

impl WhittedMaterial {
    pub(in crate::render) fn new(material: &scene::Material, ambient_light: Vec3) -> Self {
        Self {
            ambient: material.ambient * ambient_light,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            darkest_highlight: 0.0,
            ior: material.ior,
            r0: material.r0(),
            is_exact: material.fresnel == Fresnel::Exact,
            reflection: material.reflection,
            transmission: material.transmission,
            extinction: material.extinction,
        }
    }

    /// Whether its base colour is seen.
    pub(in crate::render) fn has_color(&self) -> bool {
        self.ambient != Vec3::ZERO || self.diffuse > 0.0
    }

    /// Whether it scatters the light of lights.
    pub(in crate::render) fn scatters(&self) -> bool {
        self.diffuse > 0.0 || self.specular > 0.0
    }

    /// The part that is reflected at an absolute `cosine` with the normal, and the squared sine of the refracted ray,
    /// which is 1 or more under total reflection. `ratio` is the index of refraction before the surface over the one
    /// behind it.
    #[inline(always)]
    pub(super) fn fresnel(&self, cosine: f32, ratio: f32) -> (f32, f32) {
        let rest = 1.0 - cosine * cosine;
        let sin2_out = ratio * ratio * if rest > 0.0 { rest } else { 0.0 };
        let r = self.reflected_part(cosine, ratio);
        (if sin2_out >= 1.0 { 1.0 } else { r }, sin2_out)
    }

    /// What a ray to a light keeps where it goes straight through the surface, at an absolute `cosine` with the normal:
    /// as seen from outside, from wherever it comes.
    #[inline(always)]
    pub(in crate::render) fn passed_straight(&self, cosine: f32) -> f32 {
        self.transmission * (1.0 - self.reflected_part(cosine, 1.0 / self.ior))
    }

    #[inline(always)]
    fn reflected_part(&self, cosine: f32, ratio: f32) -> f32 {
        if self.is_exact {
            dielectric(cosine, ratio)
        } else {
            schlick(self.r0, cosine)
        }
    }

    /// An opaque material that only scatters.
    pub(in crate::render) fn matte(ambient: f32, diffuse: f32, ambient_light: Vec3) -> Self {
        let material = scene::Material {
            ambient,
            diffuse,
            specular: 0.0,
            reflection: 0.0,
            ..scene::Material::DEFAULT
        };
        Self::new(&material, ambient_light)
    }
}

impl Material for WhittedMaterial {
    fn constants(&self) -> &WhittedMaterial {
        self
    }

    fn shading_points(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        _inside: u32,
        points: &mut ShadingPoints,
    ) {
        reflected_rays(simd, self, rays, hits, points);
        if self.transmission > 0.0 {
            refracted_rays(simd, self, rays, hits, points);
        }
    }
}

/// From intersections to shading points with reflected rays.
#[inline(always)]
fn reflected_rays_body(
    material: &WhittedMaterial,
    rays: &RayPacket,
    hits: &Intersections,
    points: &mut ShadingPoints,
) {
    for l in 0..LANES {
        let d = [
            rays.direction[0][l],
            rays.direction[1][l],
            rays.direction[2][l],
        ];
        let n = [hits.normal[0][l], hits.normal[1][l], hits.normal[2][l]];
        let s = [
            hits.shading_normal[0][l],
            hits.shading_normal[1][l],
            hits.shading_normal[2][l],
        ];
        let along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
        let is_entering = along < 0.0;
        let side = if is_entering { 1.0 } else { -1.0 };
        let cosine = if is_entering { -along } else { along };
        let shading_along = d[0] * s[0] + d[1] * s[1] + d[2] * s[2];
        let shading_side = if shading_along < 0.0 { 1.0 } else { -1.0 };
        // The reflected part, 1 under total reflection.
        let ratio = if is_entering {
            1.0 / material.ior
        } else {
            material.ior
        };
        let (r, _) = material.fresnel(cosine, ratio);
        // The mirrored direction, normalised so that errors do not add up over a path.
        let twice = 2.0 * -cosine;
        let m = [
            d[0] - twice * (n[0] * side),
            d[1] - twice * (n[1] * side),
            d[2] - twice * (n[2] * side),
        ];
        let inverse = 1.0 / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt();
        for axis in 0..3 {
            let start = hits.anchor[axis][l] + hits.offset[l] * (n[axis] * side);
            let normal = s[axis] * shading_side;
            points.normal[axis][l] = normal;
            points.start[axis][l] = start + hits.lift[l] * normal;
            points.reflected.origin[axis][l] = start;
            points.reflected.direction[axis][l] = m[axis] * inverse;
        }
        points.reflected.weight[l] = material.reflection * r;
    }
}

lane_kernel! {
    fn reflected_rays(
        material: &WhittedMaterial,
        rays: &RayPacket,
        hits: &Intersections,
        points: &mut ShadingPoints,
    ) = reflected_rays_body;
}

/// The refracted rays at the shading points of spheres that are bodies of their own.
#[inline(always)]
fn refracted_rays_body(
    material: &WhittedMaterial,
    rays: &RayPacket,
    hits: &Intersections,
    points: &mut ShadingPoints,
) {
    for l in 0..LANES {
        let mut d = [0.0; 3];
        let mut n = [0.0; 3];
        for axis in 0..3 {
            d[axis] = rays.direction[axis][l];
            n[axis] = hits.normal[axis][l];
        }
        let along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
        let is_entering = along < 0.0;
        let side = if is_entering { 1.0 } else { -1.0 };
        let cosine = if is_entering { -along } else { along };
        let ratio = if is_entering {
            1.0 / material.ior
        } else {
            material.ior
        };
        let (r, sin2_out) = material.fresnel(cosine, ratio);
        let is_total = sin2_out >= 1.0;
        let along_normal = ratio * cosine - (1.0 - if is_total { 1.0 } else { sin2_out }).sqrt();
        let mut onward = [0.0; 3];
        for axis in 0..3 {
            onward[axis] = ratio * d[axis] + along_normal * (n[axis] * side);
        }
        // Normalised so that errors do not add up over a path.
        let length2 = onward[0] * onward[0] + onward[1] * onward[1] + onward[2] * onward[2];
        let inverse = 1.0 / length2.sqrt();
        for axis in 0..3 {
            let step = hits.offset[l] * (n[axis] * side);
            points.refracted.origin[axis][l] = hits.anchor[axis][l] - step;
            points.refracted.direction[axis][l] = onward[axis] * inverse;
        }
        let weight = material.transmission * (1.0 - r);
        points.refracted.weight[l] = if is_total { 0.0 } else { weight };
    }
}

lane_kernel! {
    fn refracted_rays(
        material: &WhittedMaterial,
        rays: &RayPacket,
        hits: &Intersections,
        points: &mut ShadingPoints,
    ) = refracted_rays_body;
}
