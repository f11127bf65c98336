//! The ground: an infinite plane that fades into the background, and is visible from above only.

use super::shape::crossing_of_packet;
use super::{Intersection, Intersections, MaterialId, Shape, Side};
use glam::Vec3;
use spherule_tree::accel::Coherence;
use spherule_tree::math::{LANES, Supported, first_lanes, lane_kernel, larger};
use spherule_tree::ray::{Ray, RayPacket};

/// Where a ground plane `dot(up, x) = height` is, and where it fades.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneSettings {
    /// Unit normal.
    pub up: Vec3,
    /// Distance of the plane from the origin of coordinates along `up`.
    pub height: f32,
    /// Centre of the fading.
    pub center: Vec3,
    /// Half the size of a box around `center` from which the distances of the fading count; zero for the centre itself.
    pub base: Vec3,
    /// Distance from the box up to which the plane is opaque.
    pub fade_start: f32,
    /// Distance from which on nothing of it is visible.
    pub fade_end: f32,
}

/// A ground plane as a shape.
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    settings: PlaneSettings,
    simd: Supported,
}

impl Plane {
    /// The plane with these `settings`.
    pub fn new(settings: PlaneSettings) -> Self {
        Self { settings, simd: Supported::default() }
    }
}

impl Shape for Plane {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn material(&self) -> MaterialId {
        MaterialId::GROUND
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        _coherence: Coherence,
        _inside: u32,
        hits: &mut Intersections,
    ) {
        intersect_plane(self.simd, &self.settings, rays, first_lanes(rays.len()), hits);
    }

    /// The whole plane occludes, including the faded part: everything below the horizon is in shadow.
    fn occluded(&self, rays: &RayPacket, _coherence: Coherence, lanes: u32) -> u32 {
        occluded_by_plane(self.simd, &self.settings, rays) & lanes
    }
}

/// Intersects rays with a ground plane from above.
#[inline(always)]
fn intersect_plane_body(
    plane: &PlaneSettings,
    rays: &mut RayPacket,
    lanes: u32,
    hits: &mut Intersections,
) {
    let up = plane.up;
    let span = plane.fade_end - plane.fade_start;
    let span = if span > f32::MIN_POSITIVE { span } else { f32::MIN_POSITIVE };
    let mut hit_lanes = 0;
    for l in 0..LANES {
        let o = [rays.origin[0][l], rays.origin[1][l], rays.origin[2][l]];
        let d = [rays.direction[0][l], rays.direction[1][l], rays.direction[2][l]];
        // Intersect the ray with the plane
        let slope = d[0] * up.x + d[1] * up.y + d[2] * up.z;
        let height = o[0] * up.x + o[1] * up.y + o[2] * up.z;
        let t = (plane.height - height) / slope;
        let p = [o[0] + d[0] * t, o[1] + d[1] * t, o[2] + d[2] * t];
        // Compute the opacity from the distance to the middle of the scene
        let outside =
            |axis: usize| larger((p[axis] - plane.center[axis]).abs() - plane.base[axis], 0.0);
        let c = [outside(0), outside(1), outside(2)];
        let distance = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).sqrt();
        let x = (plane.fade_end - distance) / span;
        let x = if x < 0.0 { 0.0 } else { x };
        let x = if x > 1.0 { 1.0 } else { x };
        let opacity = x * x * (3.0 - 2.0 * x);
        // Accept hits from above, within the ray and before the plane has faded out
        let is_ahead = slope < 0.0 && t >= rays.t_min[l] && t < rays.t_max[l] && t < f32::INFINITY;
        let is_hit = is_ahead && opacity > 0.0 && lanes >> l & 1 == 1;
        hit_lanes |= u32::from(is_hit) << l;
        // Compute an offset above the rounding of the point
        let largest = larger(larger(larger(p[0].abs(), p[1].abs()), p[2].abs()), t);
        let largest = larger(largest, plane.height.abs());
        let offset = larger(8.0 * f32::EPSILON * largest, f32::MIN_POSITIVE);
        // Store the hit, and end the ray there
        for axis in 0..3 {
            let select = |new: f32, old: f32| if is_hit { new } else { old };
            hits.point[axis][l] = select(p[axis], hits.point[axis][l]);
            hits.anchor[axis][l] = select(p[axis], hits.anchor[axis][l]);
            hits.normal[axis][l] = select(up[axis], hits.normal[axis][l]);
            hits.shading_normal[axis][l] = select(up[axis], hits.shading_normal[axis][l]);
        }
        hits.t[l] = if is_hit { t } else { hits.t[l] };
        rays.t_max[l] = if is_hit { t } else { rays.t_max[l] };
        hits.offset[l] = if is_hit { offset } else { hits.offset[l] };
        hits.lift[l] = if is_hit { 0.0 } else { hits.lift[l] };
        hits.radius[l] = if is_hit { f32::INFINITY } else { hits.radius[l] };
        hits.opacity[l] = if is_hit { opacity } else { hits.opacity[l] };
    }
    for lane in 0..LANES {
        if hit_lanes >> lane & 1 == 1 {
            hits.material[lane] = MaterialId::GROUND;
        }
    }
    hits.mask |= hit_lanes;
}

lane_kernel! {
    fn intersect_plane(
        plane: &PlaneSettings,
        rays: &mut RayPacket,
        lanes: u32,
        hits: &mut Intersections,
    ) = intersect_plane_body;
}

/// The lanes of rays that hit the ground plane, faded or not.
#[inline(always)]
fn occluded_by_plane_body(plane: &PlaneSettings, rays: &RayPacket) -> u32 {
    let up = plane.up;
    let mut hit_lanes = 0;
    for l in 0..LANES {
        let slope =
            rays.direction[0][l] * up.x + rays.direction[1][l] * up.y + rays.direction[2][l] * up.z;
        let height = rays.origin[0][l] * up.x + rays.origin[1][l] * up.y + rays.origin[2][l] * up.z;
        let t = (plane.height - height) / slope;
        let is_hit = slope < 0.0 && t >= rays.t_min[l] && t < rays.t_max[l] && t < f32::INFINITY;
        hit_lanes |= u32::from(is_hit) << l;
    }
    hit_lanes
}

lane_kernel! {
    fn occluded_by_plane(plane: &PlaneSettings, rays: &RayPacket) -> u32 = occluded_by_plane_body;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> PlaneSettings {
        PlaneSettings {
            up: Vec3::Z,
            height: 1.0,
            center: Vec3::Z,
            base: Vec3::ZERO,
            fade_start: 5.0,
            fade_end: 21.0,
        }
    }

    #[test]
    fn is_hit_only_from_above_and_within_range() {
        let settings = settings();
        let distance = |ray: &Ray| {
            let mut packet = RayPacket::default();
            packet.push(ray);
            let hit = Plane::new(settings).crossing(ray, Side::Outside);
            let occluded = Plane::new(settings).occluded(&packet, Coherence::Coherent, 1);
            assert_eq!(occluded == 1, hit.is_some());
            hit.map(|hit| hit.t)
        };
        let down = Ray::new(Vec3::new(3.0, 4.0, 11.0), Vec3::NEG_Z);
        assert_eq!(distance(&down), Some(10.0));
        assert_eq!(distance(&Ray { t_max: 9.9, ..down }), None);
        assert_eq!(distance(&Ray::new(Vec3::ZERO, Vec3::Z)), None);
        assert_eq!(distance(&Ray::new(Vec3::ZERO, Vec3::NEG_Z)), None);
        assert_eq!(distance(&Ray::new(Vec3::splat(5.0), Vec3::X)), None);
    }

    #[test]
    fn fades_smoothly() {
        let settings = settings();
        let opacity = |settings: PlaneSettings, distance: f32| {
            let mut packet = RayPacket::default();
            let above = settings.center + Vec3::new(0.0, distance, 1.0);
            packet.push(&Ray::new(above, Vec3::NEG_Z));
            let mut hits = Intersections::default();
            Plane::new(settings).intersect(&mut packet, Coherence::Coherent, 0, &mut hits);
            (hits.mask == 1).then(|| hits.opacity[0])
        };
        assert_eq!(opacity(settings, 0.0), Some(1.0));
        let middle = 0.5 * (settings.fade_start + settings.fade_end);
        assert!((opacity(settings, middle).expect("half of it") - 0.5).abs() < 1e-4);
        assert_eq!(opacity(settings, 1.01 * settings.fade_end), None);
        // Around a box, distances are those from its sides
        let wide = PlaneSettings { base: Vec3::new(1.0, 7.0, 3.0), ..settings };
        assert_eq!(opacity(wide, 6.0), Some(1.0));
        assert!((opacity(wide, 7.0 + middle).expect("half of it") - 0.5).abs() < 1e-4);
    }
}
