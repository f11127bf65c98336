//! Rays in the coordinates of the tree.

use glam::DVec3;

use crate::hierarchy::{range_in_box, single};
use spherule_tree::math::{LANES, Lanes, Lanes3, lanes_in};
use spherule_tree::ray::RayPacket;

/// Distance of an origin from the centre of the tree, in units of half the size of the tree, up to which the ray starts
/// there. Other rays start at the box of the tree, so that rounding does not grow with the distance of the camera.
const MAX_DISTANCE: f32 = 4.0;

/// Rounding of a test of a ray and a grain, as a fraction of half the size of the tree: boxes are larger by that.
pub(super) const PADDING: f32 = 64.0 * f32::EPSILON;

/// The box of all grains.
#[derive(Debug, Clone, Copy)]
pub(super) struct Space {
    /// Its centre, relative to the origin of the sequence.
    pub(super) center: glam::Vec3,
    /// Half its size.
    pub(super) half: glam::Vec3,
}

impl Space {
    /// Rounding of a test of a ray and a grain, scene units.
    pub(super) fn padding(&self) -> f32 {
        PADDING * self.half.max_element()
    }
}

/// Rays relative to the centre of a tree.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct LocalRays {
    pub(super) origin: Lanes3,
    pub(super) direction: Lanes3,
    /// Distances between which they may hit, from zero on.
    pub(super) from: Lanes,
    pub(super) to: Lanes,
    pub(super) time: Lanes,
    /// Distances along the rays of the scene at which these rays start.
    pub(super) start: [f64; LANES],
    /// Lanes of the rays that may hit something.
    pub(super) lanes: u32,
}

impl LocalRays {
    /// The rays of `lanes` that may hit something in the box of the tree. All values of these rays are finite.
    pub(super) fn new(rays: &RayPacket, lanes: u32, space: &Space) -> Self {
        let mut local = Self {
            origin: rays.origin,
            direction: rays.direction,
            from: rays.t_min,
            to: rays.t_max,
            time: rays.time,
            start: [0.0; LANES],
            lanes: 0,
        };
        let mut largest = [0.0; LANES];
        let mut sum = [0.0; LANES];
        for axis in 0..3 {
            for l in 0..LANES {
                let origin = local.origin[axis][l] - space.center[axis];
                local.origin[axis][l] = origin;
                largest[l] = if origin.abs() > largest[l] { origin.abs() } else { largest[l] };
                // NaN if a value is not finite
                sum[l] += 0.0 * origin + 0.0 * local.direction[axis][l];
            }
        }
        let near = MAX_DISTANCE * space.half.max_element();
        for lane in lanes_in(lanes) {
            if !(sum[lane] == 0.0 && local.from[lane] < local.to[lane]) {
                continue;
            }
            let is_kept = (largest[lane] <= near && local.from[lane] >= 0.0)
                || local.move_to_box(rays, lane, space);
            local.lanes |= u32::from(is_kept) << lane;
        }
        local
    }

    /// Lets the ray in `lane` start at the box of the tree. Returns whether it enters the box.
    fn move_to_box(&mut self, rays: &RayPacket, lane: usize, space: &Space) -> bool {
        let (center, half) = (space.center.as_dvec3(), space.half.as_dvec3());
        let ray = rays.ray(lane);
        let Some([start, _]) = range_in_box(&ray, center, half, 2.0 * f64::from(space.padding()))
        else {
            return false;
        };
        let origin: DVec3 = ray.origin.as_dvec3() - center + start * ray.direction.as_dvec3();
        for axis in 0..3 {
            self.origin[axis][lane] = single(origin[axis]);
        }
        self.start[lane] = start;
        self.from[lane] = 0.0;
        self.to[lane] = single(f64::from(ray.t_max) - start);
        true
    }

    /// The origin of a ray.
    pub(super) fn double_origin(&self, lane: usize) -> DVec3 {
        DVec3::from_array(self.origin.map(|axis| f64::from(axis[lane])))
    }

    /// The direction of a ray.
    pub(super) fn double_direction(&self, lane: usize) -> DVec3 {
        DVec3::from_array(self.direction.map(|axis| f64::from(axis[lane])))
    }

    /// The distance `t` of the ray in `lane` along the ray of the scene, within the range of that ray.
    pub(super) fn distance(&self, t: f64, rays: &RayPacket, lane: usize) -> f32 {
        let t = single(self.start[lane] + t);
        t.max(rays.t_min[lane]).min(rays.t_max[lane].next_down())
    }
}
