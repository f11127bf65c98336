//! Ellipsoids: unit spheres in coordinates of their own, tested with 16 rays at once in f32.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::instance::{Instance, Motion};
use super::rays::LocalRays;
use super::walk::GrainTest;
use crate::Intersections;
use spherule_tree::math::{LANES, Lanes, Lanes3, lane_kernel, larger};

/// A ray in the unit coordinates of a grain.
#[derive(Clone, Copy)]
pub(super) struct UnitRay {
    /// Squared length of its direction.
    pub(super) length2: f32,
    /// Distance of its point closest to the centre.
    pub(super) middle: f32,
    /// The square of that point's distance from the centre.
    pub(super) distance2: f32,
}

impl UnitRay {
    /// The ray in lane `l`, at its own time if the grain moves.
    #[inline(always)]
    pub(super) fn new(
        rays: &LocalRays,
        l: usize,
        grain: &Instance,
        motion: Option<&Motion>,
    ) -> Self {
        let origin = [rays.origin[0][l], rays.origin[1][l], rays.origin[2][l]];
        let direction = [rays.direction[0][l], rays.direction[1][l], rays.direction[2][l]];
        let [origin, direction] = grain.in_middle(motion, rays.time[l], origin, direction);
        let (o, d) = (grain.unit(origin), grain.unit(direction));
        let length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let middle = -(o[0] * d[0] + o[1] * d[1] + o[2] * d[2]) / length2;
        // Squares only of the components that are left, for distant grains
        let p = [o[0] + middle * d[0], o[1] + middle * d[1], o[2] + middle * d[2]];
        Self { length2, middle, distance2: p[0] * p[0] + p[1] * p[1] + p[2] * p[2] }
    }

    /// The first distance from `from` on at which it crosses the unit sphere; infinite if there is none.
    #[inline(always)]
    fn cross_sphere(&self, from: f32) -> f32 {
        // NaN if the line misses the sphere
        let half = ((1.0 - self.distance2) / self.length2).sqrt();
        let (near, far) = (self.middle - half, self.middle + half);
        let leaving = if far >= from { far } else { f32::INFINITY };
        if near >= from { near } else { leaving }
    }
}

/// Ellipsoids in tree order.
pub(super) struct Ellipsoids<'a> {
    pub(super) grains: &'a [Instance],
    /// Empty if nothing moves.
    pub(super) motions: &'a [Motion],
}

impl GrainTest for Ellipsoids<'_> {
    #[inline(always)]
    fn distances(&self, rays: &LocalRays, slot: usize, _lanes: u32, _limits: &Lanes) -> Lanes {
        let (grain, motion) = (self.grains[slot], self.motions.get(slot).copied());
        let mut t = [f32::INFINITY; LANES];
        match motion {
            None => {
                for l in 0..LANES {
                    t[l] = UnitRay::new(rays, l, &grain, None).cross_sphere(rays.from[l]);
                }
            }
            Some(motion) => {
                for l in 0..LANES {
                    let ray = UnitRay::new(rays, l, &grain, Some(&motion));
                    t[l] = ray.cross_sphere(rays.from[l]);
                }
            }
        }
        t
    }

    #[inline(always)]
    fn distance(&self, rays: &LocalRays, slot: usize, lane: usize, _limit: f32) -> f32 {
        let ray = UnitRay::new(rays, lane, &self.grains[slot], self.motions.get(slot));
        ray.cross_sphere(rays.from[lane])
    }
}

/// Step off the surface, as a part of the distance of the tangent plane from the centre: larger than the rounding of a
/// point that was projected onto the surface, and too small to be visible.
pub(super) const OFFSET_OF_SIZE: f32 = 1e-4;
/// Step off the surface in units of the rounding of the largest coordinate.
pub(super) const OFFSET_OF_ROUNDING: f32 = 8.0 * f32::EPSILON;

/// The ellipsoid that each ray has found.
pub(super) struct FoundEllipsoids {
    center: Lanes3,
    rows: [Lanes3; 3],
    displacement: Lanes3,
    turn: Lanes3,
}

impl FoundEllipsoids {
    /// Unit spheres at the centre.
    pub(super) const NONE: Self = Self {
        center: [[0.0; LANES]; 3],
        rows: [
            [[1.0; LANES], [0.0; LANES], [0.0; LANES]],
            [[0.0; LANES], [1.0; LANES], [0.0; LANES]],
            [[0.0; LANES], [0.0; LANES], [1.0; LANES]],
        ],
        displacement: [[0.0; LANES]; 3],
        turn: [[0.0; LANES]; 3],
    };

    /// Sets the ellipsoid in `lane`.
    pub(super) fn set(&mut self, lane: usize, grain: &Instance, motion: Option<&Motion>) {
        for axis in 0..3 {
            self.center[axis][lane] = grain.center[axis];
            for row in 0..3 {
                self.rows[row][axis][lane] = grain.rows[row][axis];
            }
            if let Some(motion) = motion {
                self.displacement[axis][lane] = motion.displacement[axis];
                self.turn[axis][lane] = motion.turn[axis];
            }
        }
    }

    /// The ellipsoid in lane `l`.
    #[inline(always)]
    fn grain(&self, l: usize) -> (Instance, Motion) {
        let vector = |v: &Lanes3| [v[0][l], v[1][l], v[2][l]];
        let rows = [vector(&self.rows[0]), vector(&self.rows[1]), vector(&self.rows[2])];
        let (displacement, turn) = (vector(&self.displacement), vector(&self.turn));
        (Instance { center: vector(&self.center), index: 0, rows }, Motion { displacement, turn })
    }
}

/// Points and normals of the lanes in `hit_lanes`, at distances `t` along `rays`. `space` is the centre of the tree and
/// the largest coordinate of its box.
#[inline(always)]
fn intersections_body(
    rays: &LocalRays,
    t: &Lanes,
    found: &FoundEllipsoids,
    is_moving: bool,
    space: ([f32; 3], f32),
    hit_lanes: u32,
    hits: &mut Intersections,
) {
    let (tree_center, extent) = space;
    for l in 0..LANES {
        let (grain, motion) = found.grain(l);
        let o = [rays.origin[0][l], rays.origin[1][l], rays.origin[2][l]];
        let d = [rays.direction[0][l], rays.direction[1][l], rays.direction[2][l]];
        // Project the point onto the surface, along the line through the centre
        let motion = if is_moving { Some(&motion) } else { None };
        let [from_center, direction] = grain.in_middle(motion, rays.time[l], o, d);
        let v = [
            from_center[0] + t[l] * direction[0],
            from_center[1] + t[l] * direction[1],
            from_center[2] + t[l] * direction[2],
        ];
        let u = grain.unit(v);
        let scale = 1.0 / (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]).sqrt();
        let mut v = [v[0] * scale, v[1] * scale, v[2] * scale];
        // The normal is the gradient of the squared distance in unit coordinates
        let m = &grain.rows;
        let g = [
            m[0][0] * u[0] + m[1][0] * u[1] + m[2][0] * u[2],
            m[0][1] * u[0] + m[1][1] * u[1] + m[2][1] * u[2],
            m[0][2] * u[0] + m[1][2] * u[1] + m[2][2] * u[2],
        ];
        let inverse = 1.0 / (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt();
        let has_normal = inverse > 0.0 && inverse < f32::INFINITY;
        let mut n = [g[0] * inverse, g[1] * inverse, g[2] * inverse];
        for axis in 0..3 {
            n[axis] = if has_normal { n[axis] } else { -direction[axis] };
        }
        let height = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        let offset = larger(OFFSET_OF_SIZE * height, OFFSET_OF_ROUNDING * extent);
        // Rotate both as the grain is at the time of the ray
        let mut center = grain.center;
        if let Some(motion) = motion {
            let rotation = motion.rotation(rays.time[l]);
            (v, n) = (rotation.apply(v), rotation.apply(n));
            for axis in 0..3 {
                center[axis] += rays.time[l] * motion.displacement[axis];
            }
        }
        // Store the hit
        let is_hit = hit_lanes >> l & 1 == 1;
        let select = |new: f32, old: f32| if is_hit { new } else { old };
        for axis in 0..3 {
            let point = tree_center[axis] + (center[axis] + v[axis]);
            hits.point[axis][l] = select(point, hits.point[axis][l]);
            hits.anchor[axis][l] = select(point, hits.anchor[axis][l]);
            hits.normal[axis][l] = select(n[axis], hits.normal[axis][l]);
            hits.shading_normal[axis][l] = select(n[axis], hits.shading_normal[axis][l]);
        }
        hits.offset[l] = select(offset, hits.offset[l]);
        hits.lift[l] = select(0.0, hits.lift[l]);
        hits.radius[l] = select(f32::INFINITY, hits.radius[l]);
        hits.opacity[l] = select(1.0, hits.opacity[l]);
    }
}

lane_kernel! {
    pub(super) fn intersections(
        rays: &LocalRays,
        t: &Lanes,
        found: &FoundEllipsoids,
        is_moving: bool,
        space: ([f32; 3], f32),
        hit_lanes: u32,
        hits: &mut Intersections,
    ) = intersections_body;
}
