//! Grains of all shapes but ellipsoids: each ray that passes near a grain is intersected with it in f64.

use super::body::{Body, Hit};
use super::ellipsoid::UnitRays;
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

/// The rays that pass through a sphere around the body before their limits.
#[inline(always)]
fn lanes_near(rays: &LocalRays, unit: &UnitRays, body: &Body<'_>, limits: &Lanes) -> u32 {
    let radius = narrow(body.radius_squared()).sqrt();
    let mut near = [0_u32; LANES];
    for l in 0..LANES {
        let [length2, middle, distance2] = unit.closest(l);
        let rounding = ROUNDING * middle.abs();
        let reach = radius + rounding * length2.sqrt();
        let half = ((reach * reach - distance2) / length2).sqrt();
        // False for NaN: the line misses the sphere
        let is_near =
            middle - half - rounding <= limits[l] && middle + half + rounding >= rays.from[l];
        near[l] = u32::from(is_near);
    }
    (0..LANES).fold(0, |lanes, l| lanes | near[l] << l)
}

impl GrainTest for Solids<'_> {
    #[inline(always)]
    fn distances(&self, rays: &LocalRays, slot: usize, lanes: u32, limits: &Lanes) -> Lanes {
        let (grain, motion) = self.0.grain(slot);
        let unit = UnitRays::new(rays, grain, motion);
        let mut t = [f32::INFINITY; LANES];
        for lane in lanes_in(lanes_near(rays, &unit, &self.0.body(slot), limits) & lanes) {
            if let Some(hit) = self.first(rays, lane, slot) {
                t[lane] = narrow(hit.t);
            }
        }
        t
    }
}
