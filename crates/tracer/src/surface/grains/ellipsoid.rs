//! Ellipsoids: unit spheres in coordinates of their own, tested with 16 rays at once in f32.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::instance::{Instance, Motion, orientation_at, unit_rows};
use super::rays::LocalRays;
use super::walk::GrainTest;
use crate::surface::Intersections;
use spherule_tree::math::{LANES, Lanes, Lanes3, lane_kernel, larger};

/// Rays in the unit coordinates of a grain.
pub(super) struct UnitRays {
    pub(super) origin: Lanes3,
    pub(super) direction: Lanes3,
}

/// The product of a matrix and a vector.
#[inline(always)]
fn times(rows: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    let row = |r: &[f32; 3]| r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
    [row(&rows[0]), row(&rows[1]), row(&rows[2])]
}

impl UnitRays {
    /// The rays in the coordinates of a grain, each at its own time if the grain moves.
    #[inline(always)]
    pub(super) fn new(rays: &LocalRays, grain: &Instance, motion: Option<&Motion>) -> Self {
        match motion {
            None => Self::at_rest(rays, grain),
            Some(motion) => Self::in_motion(rays, grain, motion),
        }
    }

    #[inline(always)]
    fn at_rest(rays: &LocalRays, grain: &Instance) -> Self {
        let (rows, center) = (unit_rows(grain.orientation, grain.inverse), grain.center);
        let mut unit = Self { origin: [[0.0; LANES]; 3], direction: [[0.0; LANES]; 3] };
        for l in 0..LANES {
            let from_center = [0, 1, 2].map(|axis| rays.origin[axis][l] - center[axis]);
            let o = times(&rows, from_center);
            let d = times(&rows, [0, 1, 2].map(|axis| rays.direction[axis][l]));
            for axis in 0..3 {
                unit.origin[axis][l] = o[axis];
                unit.direction[axis][l] = d[axis];
            }
        }
        unit
    }

    #[inline(always)]
    fn in_motion(rays: &LocalRays, grain: &Instance, motion: &Motion) -> Self {
        let (center, displacement) = (grain.center, motion.displacement);
        let mut unit = Self { origin: [[0.0; LANES]; 3], direction: [[0.0; LANES]; 3] };
        for l in 0..LANES {
            let time = rays.time[l];
            let orientation = orientation_at(grain.orientation, motion.turn, time);
            let rows = unit_rows(orientation, grain.inverse);
            let from_center = [0, 1, 2]
                .map(|axis| rays.origin[axis][l] - (center[axis] + time * displacement[axis]));
            let o = times(&rows, from_center);
            let d = times(&rows, [0, 1, 2].map(|axis| rays.direction[axis][l]));
            for axis in 0..3 {
                unit.origin[axis][l] = o[axis];
                unit.direction[axis][l] = d[axis];
            }
        }
        unit
    }

    /// For the ray in lane `l`: the squared length of its direction, the distance of the point closest to the centre, and
    /// the square of that point's distance from the centre.
    #[inline(always)]
    pub(super) fn closest(&self, l: usize) -> [f32; 3] {
        let o = [self.origin[0][l], self.origin[1][l], self.origin[2][l]];
        let d = [self.direction[0][l], self.direction[1][l], self.direction[2][l]];
        let length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let middle = -(o[0] * d[0] + o[1] * d[1] + o[2] * d[2]) / length2;
        // Squares only of the components that are left, for distant grains
        let p = [o[0] + middle * d[0], o[1] + middle * d[1], o[2] + middle * d[2]];
        [length2, middle, p[0] * p[0] + p[1] * p[1] + p[2] * p[2]]
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
        let unit = UnitRays::new(rays, &self.grains[slot], self.motions.get(slot));
        let mut t = [f32::INFINITY; LANES];
        for l in 0..LANES {
            let [length2, middle, distance2] = unit.closest(l);
            // NaN if the line misses the sphere
            let half = ((1.0 - distance2) / length2).sqrt();
            let (near, far) = (middle - half, middle + half);
            let leaving = if far >= rays.from[l] { far } else { f32::INFINITY };
            t[l] = if near >= rays.from[l] { near } else { leaving };
        }
        t
    }
}

/// Step off the surface, as a part of the distance of the tangent plane from the centre: larger than the rounding of a
/// point that was projected onto the surface, and too small to be visible.
pub(super) const OFFSET_OF_SIZE: f32 = 1e-4;
/// Step off the surface in units of the rounding of the largest coordinate.
pub(super) const OFFSET_OF_ROUNDING: f32 = 8.0 * f32::EPSILON;

/// The ellipsoid that each ray has found.
pub(super) struct FoundEllipsoids {
    pub(super) center: Lanes3,
    pub(super) orientation: [Lanes; 4],
    pub(super) inverse: Lanes3,
    pub(super) displacement: Lanes3,
    pub(super) turn: Lanes3,
}

impl FoundEllipsoids {
    /// Unit spheres at the centre.
    pub(super) const NONE: Self = Self {
        center: [[0.0; LANES]; 3],
        orientation: [[0.0; LANES], [0.0; LANES], [0.0; LANES], [1.0; LANES]],
        inverse: [[1.0; LANES]; 3],
        displacement: [[0.0; LANES]; 3],
        turn: [[0.0; LANES]; 3],
    };

    /// Sets the ellipsoid in `lane`.
    pub(super) fn set(&mut self, lane: usize, grain: &Instance, motion: Option<&Motion>) {
        for axis in 0..3 {
            self.center[axis][lane] = grain.center[axis];
            self.inverse[axis][lane] = grain.inverse[axis];
        }
        for (component, orientation) in self.orientation.iter_mut().enumerate() {
            orientation[lane] = grain.orientation[component];
        }
        if let Some(motion) = motion {
            for axis in 0..3 {
                self.displacement[axis][lane] = motion.displacement[axis];
                self.turn[axis][lane] = motion.turn[axis];
            }
        }
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
        // The pose at the time of the ray
        let vector = |v: &Lanes3| [v[0][l], v[1][l], v[2][l]];
        let q = &found.orientation;
        let (mut center, mut orientation) =
            (vector(&found.center), [q[0][l], q[1][l], q[2][l], q[3][l]]);
        if is_moving {
            let (displacement, time) = (vector(&found.displacement), rays.time[l]);
            orientation = orientation_at(orientation, vector(&found.turn), time);
            for axis in 0..3 {
                center[axis] += time * displacement[axis];
            }
        }
        let rows = unit_rows(orientation, vector(&found.inverse));
        // Project the point onto the surface, along the line through the centre
        let (o, d) = (vector(&rays.origin), vector(&rays.direction));
        let from_center = [0, 1, 2].map(|axis| (o[axis] - center[axis]) + t[l] * d[axis]);
        let unit = times(&rows, from_center);
        let scale = 1.0 / (unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2]).sqrt();
        let v = from_center.map(|c| c * scale);
        // The normal is the gradient of the squared distance in unit coordinates
        let g = [0, 1, 2].map(|axis| {
            rows[0][axis] * unit[0] + rows[1][axis] * unit[1] + rows[2][axis] * unit[2]
        });
        let inverse = 1.0 / (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt();
        let has_normal = inverse > 0.0 && inverse < f32::INFINITY;
        let n = [0, 1, 2].map(|axis| if has_normal { g[axis] * inverse } else { -d[axis] });
        let height = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        let offset = larger(OFFSET_OF_SIZE * height, OFFSET_OF_ROUNDING * extent);
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
