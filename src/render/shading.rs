//! Arithmetic of shading for the 16 lanes of a packet: eq. 4.1 to 4.3 of the thesis, lights, background and floor.
//!
//! Every function here is compiled for each instruction set by [`lane_kernel!`]; see `math` for what that asks of the
//! bodies. A lane whose numbers are infinite or not numbers never touches another lane: results are selected, not
//! multiplied by zero.
#![expect(
    clippy::needless_range_loop,
    reason = "one index for the lanes of many arrays"
)]

use glam::Vec3;

use super::stream::ScatteredRays;
use crate::math::functions::{asin, pow};
use crate::math::{LANES, Lanes, Lanes3, lane_kernel, splat};
use crate::ray::RayPacket;
use crate::scene::{Background, Camera, Falloff, Fresnel, Ground, Light, LightKind, Material};
use crate::surface::{Intersections, MaterialId};

/// A camera as lanes see it.
#[derive(Debug, Clone, Copy)]
pub(super) struct CameraLanes {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Tangents of half the field of view.
    half_extent: [f32; 2],
    /// Pixels of the image.
    size: [f32; 2],
}

impl CameraLanes {
    pub(super) fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let [right, up, forward] = camera.axes();
        Self {
            eye: camera.eye(),
            right,
            up,
            forward,
            half_extent: camera.half_extent().to_array(),
            size: [width as f32, height as f32],
        }
    }
}

/// Rays through points of the film, in pixels from its top left corner.
#[inline(always)]
fn camera_rays_body(camera: &CameraLanes, x: &Lanes, y: &Lanes, rays: &mut RayPacket) {
    let (r, u, f) = (camera.right, camera.up, camera.forward);
    for l in 0..LANES {
        let a = (2.0 * (x[l] / camera.size[0]) - 1.0) * camera.half_extent[0];
        let b = (1.0 - 2.0 * (y[l] / camera.size[1])) * camera.half_extent[1];
        let d = [
            f.x + a * r.x + b * u.x,
            f.y + a * r.y + b * u.y,
            f.z + a * r.z + b * u.z,
        ];
        let inverse = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        for axis in 0..3 {
            rays.direction[axis][l] = d[axis] * inverse;
            rays.origin[axis][l] = camera.eye[axis];
        }
        rays.t_min[l] = 0.0;
        rays.t_max[l] = f32::INFINITY;
    }
}

lane_kernel! {
    pub(super) fn camera_rays(camera: &CameraLanes, x: &Lanes, y: &Lanes, rays: &mut RayPacket) = camera_rays_body;
}

/// Distance along the view axis of what camera rays meet; infinite where they meet nothing.
#[inline(always)]
fn depths_body(camera: &CameraLanes, rays: &RayPacket, hits: &Intersections, z: &mut Lanes) {
    let f = camera.forward;
    let d = &rays.direction;
    for l in 0..LANES {
        let along = d[0][l] * f.x + d[1][l] * f.y + d[2][l] * f.z;
        let is_hit = hits.mask >> l & 1 == 1;
        z[l] = if is_hit {
            hits.t[l] * along
        } else {
            f32::INFINITY
        };
    }
}

lane_kernel! {
    pub(super) fn depths(
        camera: &CameraLanes,
        rays: &RayPacket,
        hits: &Intersections,
        z: &mut Lanes,
    ) = depths_body;
}

/// A background as lanes see it: from `bottom` to `top` along `up`.
#[derive(Debug, Clone, Copy)]
pub(super) struct BackgroundLanes {
    bottom: Vec3,
    top: Vec3,
    up: Vec3,
    is_constant: bool,
}

impl From<&Background> for BackgroundLanes {
    fn from(background: &Background) -> Self {
        match *background {
            Background::Constant(color) => Self {
                bottom: color,
                top: color,
                up: Vec3::Z,
                is_constant: true,
            },
            Background::Gradient { bottom, top, up } => Self {
                bottom,
                top,
                up,
                is_constant: false,
            },
        }
    }
}

/// Adds the background's radiance along `direction` to `radiance`, by `weight` and for the `lanes` alone.
#[inline(always)]
fn add_background_body(
    background: &BackgroundLanes,
    direction: &Lanes3,
    weight: &Lanes3,
    lanes: u32,
    radiance: &mut Lanes3,
) {
    let up = background.up;
    let mut part = splat(0.0);
    if !background.is_constant {
        for l in 0..LANES {
            let d = [direction[0][l], direction[1][l], direction[2][l]];
            let height = d[0] * up.x + d[1] * up.y + d[2] * up.z;
            let height = if height < -1.0 { -1.0 } else { height };
            let height = if height > 1.0 { 1.0 } else { height };
            part[l] = 0.5 + asin(height) * std::f32::consts::FRAC_1_PI;
        }
    }
    for axis in 0..3 {
        let (bottom, top) = (background.bottom[axis], background.top[axis]);
        for l in 0..LANES {
            let color = bottom * (1.0 - part[l]) + top * part[l];
            let color = if background.is_constant {
                bottom
            } else {
                color
            };
            let sum = radiance[axis][l] + weight[axis][l] * color;
            radiance[axis][l] = if lanes >> l & 1 == 1 {
                sum
            } else {
                radiance[axis][l]
            };
        }
    }
}

lane_kernel! {
    pub(super) fn add_background(
        background: &BackgroundLanes,
        direction: &Lanes3,
        weight: &Lanes3,
        lanes: u32,
        radiance: &mut Lanes3,
    ) = add_background_body;
}

/// Intersects rays with a floor, which is met from above only.
#[inline(always)]
fn intersect_ground_body(
    ground: &Ground,
    rays: &mut RayPacket,
    lanes: u32,
    hits: &mut Intersections,
) {
    let up = ground.up;
    let span = ground.fade_end - ground.fade_start;
    let span = if span > f32::MIN_POSITIVE {
        span
    } else {
        f32::MIN_POSITIVE
    };
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    let mut met = 0;
    for l in 0..LANES {
        let o = [rays.origin[0][l], rays.origin[1][l], rays.origin[2][l]];
        let d = [
            rays.direction[0][l],
            rays.direction[1][l],
            rays.direction[2][l],
        ];
        let slope = d[0] * up.x + d[1] * up.y + d[2] * up.z;
        let height = o[0] * up.x + o[1] * up.y + o[2] * up.z;
        let t = (ground.height - height) / slope;
        let p = [o[0] + d[0] * t, o[1] + d[1] * t, o[2] + d[2] * t];
        // How much of the floor is left, by the distance from its middle.
        let c = [
            p[0] - ground.center.x,
            p[1] - ground.center.y,
            p[2] - ground.center.z,
        ];
        let distance = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).sqrt();
        let x = (ground.fade_end - distance) / span;
        let x = if x < 0.0 { 0.0 } else { x };
        let x = if x > 1.0 { 1.0 } else { x };
        let presence = x * x * (3.0 - 2.0 * x);
        let is_ahead = slope < 0.0 && t >= rays.t_min[l] && t < rays.t_max[l] && t < f32::INFINITY;
        let is_met = is_ahead && presence > 0.0 && lanes >> l & 1 == 1;
        met |= u32::from(is_met) << l;
        let largest = larger(larger(larger(p[0].abs(), p[1].abs()), p[2].abs()), t);
        let largest = larger(largest, ground.height.abs());
        let offset = larger(8.0 * f32::EPSILON * largest, f32::MIN_POSITIVE);
        for axis in 0..3 {
            let keep = |new: f32, old: f32| if is_met { new } else { old };
            hits.point[axis][l] = keep(p[axis], hits.point[axis][l]);
            hits.anchor[axis][l] = keep(p[axis], hits.anchor[axis][l]);
            hits.normal[axis][l] = keep(up[axis], hits.normal[axis][l]);
            hits.shading_normal[axis][l] = keep(up[axis], hits.shading_normal[axis][l]);
        }
        hits.t[l] = if is_met { t } else { hits.t[l] };
        rays.t_max[l] = if is_met { t } else { rays.t_max[l] };
        hits.offset[l] = if is_met { offset } else { hits.offset[l] };
        hits.lift[l] = if is_met { 0.0 } else { hits.lift[l] };
        hits.opacity[l] = if is_met { presence } else { hits.opacity[l] };
    }
    for lane in 0..LANES {
        if met >> lane & 1 == 1 {
            hits.material[lane] = MaterialId::GROUND;
        }
    }
    hits.mask |= met;
}

lane_kernel! {
    pub(super) fn intersect_ground(
        ground: &Ground,
        rays: &mut RayPacket,
        lanes: u32,
        hits: &mut Intersections,
    ) = intersect_ground_body;
}

/// The lanes whose rays a floor stops, whole or faded.
#[inline(always)]
fn occluded_by_ground_body(ground: &Ground, rays: &RayPacket) -> u32 {
    let up = ground.up;
    let mut met = 0;
    for l in 0..LANES {
        let slope =
            rays.direction[0][l] * up.x + rays.direction[1][l] * up.y + rays.direction[2][l] * up.z;
        let height = rays.origin[0][l] * up.x + rays.origin[1][l] * up.y + rays.origin[2][l] * up.z;
        let t = (ground.height - height) / slope;
        let is_met = slope < 0.0 && t >= rays.t_min[l] && t < rays.t_max[l] && t < f32::INFINITY;
        met |= u32::from(is_met) << l;
    }
    met
}

lane_kernel! {
    pub(super) fn occluded_by_ground(ground: &Ground, rays: &RayPacket) -> u32 = occluded_by_ground_body;
}

/// The constants of eq. 4.1 to 4.3, settled for a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct WhittedLanes {
    /// `Ka` times the ambient light, linear RGB.
    pub(super) ambient: Vec3,
    diffuse: f32,
    specular: f32,
    shininess: f32,
    ior: f32,
    r0: f32,
    is_exact: bool,
    /// Weight of the reflected ray.
    pub(super) reflection: f32,
}

impl WhittedLanes {
    pub(super) fn new(material: &Material, ambient_light: Vec3) -> Self {
        Self {
            ambient: material.ambient * ambient_light,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            ior: material.ior,
            r0: material.r0(),
            is_exact: material.fresnel == Fresnel::Exact,
            reflection: material.reflection,
        }
    }

    /// An opaque material that only scatters.
    pub(super) fn matte(ambient: f32, diffuse: f32, ambient_light: Vec3) -> Self {
        let material = Material {
            ambient,
            diffuse,
            specular: 0.0,
            reflection: 0.0,
            ..Material::DEFAULT
        };
        Self::new(&material, ambient_light)
    }
}

/// Where the rays of a packet meet surfaces, as light and further rays see it.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct ShadingPoints {
    /// Unit normal to shade by, on the side that the ray comes from.
    normal: Lanes3,
    /// Where rays to lights start.
    start: Lanes3,
    /// Reflected rays; their throughput is the weight of eq. 4.1 times that of the path.
    pub(super) reflected: ScatteredRays,
}

impl Default for ShadingPoints {
    fn default() -> Self {
        let zero = [splat(0.0); 3];
        Self {
            normal: zero,
            start: zero,
            reflected: ScatteredRays::default(),
        }
    }
}

/// Fresnel's equations (see [`crate::scene::material::dielectric`]).
#[inline(always)]
fn dielectric(cosine: f32, ratio: f32) -> f32 {
    let c = if cosine > 1.0 { 1.0 } else { cosine };
    let sin2_out = ratio * ratio * (1.0 - c * c);
    let is_total = sin2_out >= 1.0;
    let cos_out = (1.0 - if is_total { 1.0 } else { sin2_out }).sqrt();
    let across = (ratio * c - cos_out) / (ratio * c + cos_out);
    let along = (c - ratio * cos_out) / (c + ratio * cos_out);
    let mean = 0.5 * (across * across + along * along);
    if is_total { 1.0 } else { mean }
}

/// From intersections to shading points; `throughput` is that of the paths up to here.
#[inline(always)]
fn shading_points_body(
    material: &WhittedLanes,
    rays: &RayPacket,
    hits: &Intersections,
    throughput: &Lanes3,
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
        // Normals face the viewer, as the thesis's `faceforward` turns them.
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
        let rest = 1.0 - cosine * cosine;
        let sin2_out = ratio * ratio * if rest > 0.0 { rest } else { 0.0 };
        let x = 1.0 - cosine;
        let x = if x < 0.0 { 0.0 } else { x };
        let x = if x > 1.0 { 1.0 } else { x };
        let x2 = x * x;
        let schlick = material.r0 + (1.0 - material.r0) * (x2 * x2 * x);
        let r = if material.is_exact {
            dielectric(cosine, ratio)
        } else {
            schlick
        };
        let r = if sin2_out >= 1.0 { 1.0 } else { r };
        let weight = material.reflection * r;
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
            points.reflected.throughput[axis][l] = throughput[axis][l] * weight;
        }
    }
}

lane_kernel! {
    pub(super) fn shading_points(
        material: &WhittedLanes,
        rays: &RayPacket,
        hits: &Intersections,
        throughput: &Lanes3,
        points: &mut ShadingPoints,
    ) = shading_points_body;
}

/// A light as lanes see it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightLanes {
    /// Where a point light is; the direction to a directional one.
    at: Vec3,
    is_point: bool,
    has_falloff: bool,
    intensity: Vec3,
    pub(super) casts_shadow: bool,
}

impl From<&Light> for LightLanes {
    fn from(light: &Light) -> Self {
        let (at, is_point, has_falloff) = match light.kind {
            LightKind::Point { position, falloff } => {
                (position, true, falloff == Falloff::InverseSquare)
            }
            LightKind::Directional { to_light } => (to_light, false, false),
        };
        Self {
            at,
            is_point,
            has_falloff,
            intensity: light.radiance,
            casts_shadow: light.casts_shadow,
        }
    }
}

/// What a light gives to the shading points of a packet.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct LightSamples {
    /// Rays to the light; those of lanes that it does not shine on end before they start.
    pub(super) shadow_rays: RayPacket,
    /// Radiance that the light adds to each sample if nothing is in its way.
    pub(super) contribution: Lanes3,
    /// Lanes that it shines on.
    pub(super) lanes: u32,
}

impl Default for LightSamples {
    fn default() -> Self {
        Self {
            shadow_rays: RayPacket::default(),
            contribution: [splat(0.0); 3],
            lanes: 0,
        }
    }
}

/// Blinn and Phong's reflection (eq. 4.2) of one light at the shading points of `lanes`.
#[expect(
    clippy::too_many_arguments,
    reason = "arrays that do not overlap are parameters of their own; see `lane_kernel!`"
)]
#[inline(always)]
fn sample_light_body(
    light: &LightLanes,
    material: &WhittedLanes,
    rays: &RayPacket,
    points: &ShadingPoints,
    base: &Lanes3,
    throughput: &Lanes3,
    lanes: u32,
    samples: &mut LightSamples,
) {
    let mut lit = 0;
    for l in 0..LANES {
        let start = [points.start[0][l], points.start[1][l], points.start[2][l]];
        let n = [
            points.normal[0][l],
            points.normal[1][l],
            points.normal[2][l],
        ];
        // Direction and distance.
        let mut v = [light.at.x, light.at.y, light.at.z];
        let mut distance = f32::INFINITY;
        let mut falloff = 1.0;
        if light.is_point {
            for axis in 0..3 {
                v[axis] -= start[axis];
            }
            distance = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            let inverse = 1.0 / distance;
            for axis in 0..3 {
                v[axis] *= inverse;
            }
            if light.has_falloff {
                falloff = 1.0 / (distance * distance);
            }
        }
        // Not a number at the place of a point light, and then not lit.
        let cosine = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        let is_lit = cosine > 0.0 && lanes >> l & 1 == 1;
        lit |= u32::from(is_lit) << l;
        let mut highlight = 0.0;
        if material.specular > 0.0 {
            let h = [
                v[0] - rays.direction[0][l],
                v[1] - rays.direction[1][l],
                v[2] - rays.direction[2][l],
            ];
            let inverse = 1.0 / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let along = n[0] * (h[0] * inverse) + n[1] * (h[1] * inverse) + n[2] * (h[2] * inverse);
            // A light straight behind the surface has no half vector: the normal serves.
            let along = if inverse < f32::INFINITY { along } else { 1.0 };
            let along = if along > 0.0 { along } else { 0.0 };
            let along = if along < 1.0 { along } else { 1.0 };
            highlight = material.specular * pow(along, material.shininess);
        }
        let scattered = material.diffuse * cosine;
        for axis in 0..3 {
            let reflected = scattered * base[axis][l] + highlight;
            let arriving = falloff * light.intensity[axis];
            samples.contribution[axis][l] = throughput[axis][l] * (arriving * reflected);
            samples.shadow_rays.origin[axis][l] = start[axis];
            samples.shadow_rays.direction[axis][l] = v[axis];
        }
        samples.shadow_rays.t_min[l] = 0.0;
        samples.shadow_rays.t_max[l] = if is_lit { distance } else { -1.0 };
    }
    samples.lanes = lit;
}

lane_kernel! {
    pub(super) fn sample_light(
        light: &LightLanes,
        material: &WhittedLanes,
        rays: &RayPacket,
        points: &ShadingPoints,
        base: &Lanes3,
        throughput: &Lanes3,
        lanes: u32,
        samples: &mut LightSamples,
    ) = sample_light_body;
}

/// Adds `added`, linear RGB times `weight`, to `radiance` for `lanes` alone.
#[inline(always)]
fn add_body(added: &Lanes3, weight: &Vec3, lanes: u32, radiance: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            let sum = radiance[axis][l] + weight[axis] * added[axis][l];
            radiance[axis][l] = if lanes >> l & 1 == 1 {
                sum
            } else {
                radiance[axis][l]
            };
        }
    }
}

lane_kernel! {
    pub(super) fn add(added: &Lanes3, weight: &Vec3, lanes: u32, radiance: &mut Lanes3) = add_body;
}

/// `a * b`, component by component.
#[inline(always)]
fn product_body(a: &Lanes3, b: &Lanes3, product: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            product[axis][l] = a[axis][l] * b[axis][l];
        }
    }
}

lane_kernel! {
    pub(super) fn product(a: &Lanes3, b: &Lanes3, product: &mut Lanes3) = product_body;
}

/// `a * b`, one number for all components.
#[inline(always)]
fn scale_body(a: &Lanes3, b: &Lanes, scaled: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            scaled[axis][l] = a[axis][l] * b[l];
        }
    }
}

lane_kernel! {
    pub(super) fn scale(a: &Lanes3, b: &Lanes, scaled: &mut Lanes3) = scale_body;
}
