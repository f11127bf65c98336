//! Grains of all shapes but ellipsoids: each ray that passes near a grain is intersected with it in f64.

use super::body::Hit;
use super::ellipsoid::UnitRay;
use super::rays::LocalRays;
use super::tree::GrainTree;
use super::walk::GrainTest;
use spherule_tree::math::{LANES, Lanes, lanes_in, narrow};

/// Rounding of the distance between a ray and a grain in f32, as a part of the distance of its origin.
const ROUNDING: f32 = 16.0 * f32::EPSILON;

/// Grains of a tree.
pub(super) struct Solids<'a>(pub(super) &'a GrainTree);

impl Solids<'_> {
    /// The first crossing of the ray in `lane` with the grain in `slot`.
    pub(super) fn first(&self, rays: &LocalRays, lane: usize, slot: usize) -> Option<Hit> {
        let pose = self.0.pose(slot, rays.time[lane]);
        let origin = pose.unit_point(rays.double_origin(lane));
        let direction = pose.unit_direction(rays.double_direction(lane));
        self.0.body(slot).first(origin, direction, f64::from(rays.from[lane]))
    }
}

/// Whether a ray passes through the sphere of `radius` around the body, from `from` to its `limit`.
#[inline(always)]
fn is_near(ray: &UnitRay, radius: f32, from: f32, limit: f32) -> bool {
    let rounding = ROUNDING * ray.middle.abs();
    let reach = radius + rounding * ray.length2.sqrt();
    // NaN if the line misses the sphere
    let half = ((reach * reach - ray.distance2) / ray.length2).sqrt();
    ray.middle - half - rounding <= limit && ray.middle + half + rounding >= from
}

impl GrainTest for Solids<'_> {
    #[inline(always)]
    fn distances(&self, rays: &LocalRays, slot: usize, lanes: u32, limits: &Lanes) -> Lanes {
        let (grain, motion) = self.0.grain(slot);
        let radius = narrow(self.0.body(slot).radius_squared()).sqrt();
        // Find the rays that pass near the body
        let mut near = 0;
        for (l, limit) in limits.iter().enumerate() {
            let ray = UnitRay::new(rays, l, grain, motion);
            near |= u32::from(is_near(&ray, radius, rays.from[l], *limit)) << l;
        }
        // Intersect each of them
        let mut t = [f32::INFINITY; LANES];
        for lane in lanes_in(near & lanes) {
            if let Some(hit) = self.first(rays, lane, slot) {
                t[lane] = narrow(hit.t);
            }
        }
        t
    }

    #[inline(always)]
    fn distance(&self, rays: &LocalRays, slot: usize, lane: usize, limit: f32) -> f32 {
        let (grain, motion) = self.0.grain(slot);
        let radius = narrow(self.0.body(slot).radius_squared()).sqrt();
        let ray = UnitRay::new(rays, lane, grain, motion);
        if !is_near(&ray, radius, rays.from[lane], limit) {
            return f32::INFINITY;
        }
        self.first(rays, lane, slot).map_or(f32::INFINITY, |hit| narrow(hit.t))
    }
}
