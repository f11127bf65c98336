//! A hierarchy of boxes around primitives that are intersected one at a time, in f64: triangles.
//!
//! It is a compressed wide BVH of the crate `obvhs`. Results do not depend on it: at equal distances, the primitive
//! with the lower index wins.

use std::time::Duration;

use glam::{DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::RayHit;
use rayon::prelude::*;

use spherule_tree::ray::Ray;

/// Distance by which boxes are larger than their primitives, as a fraction of the size of all, so that the rounding of
/// the traversal never loses one.
const PADDING: f32 = 8.0 * f32::EPSILON;

/// Distance before the box of all primitives at which rays start, as a fraction of its size. `obvhs` ignores boxes in
/// the first 1e-4 of a ray.
const LEAD: f64 = 1e-3;

/// Memory of `obvhs` for a box while a hierarchy is built, with its share of the hierarchy, bytes. Measured on triangles,
/// as the remainder of what they hold themselves.
pub(super) const BUILT_BYTES: u64 = 296;

/// `value` in single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounds")]
pub(super) const fn single(value: f64) -> f32 {
    value as f32
}

/// Boxes around numbered primitives.
pub(super) struct Hierarchy {
    bvh: CwBvh,
    space: Space,
}

impl Hierarchy {
    /// The hierarchy of `count` primitives in the boxes `box_of`: lowest and highest corner.
    pub(super) fn new(count: u32, box_of: impl Fn(u32) -> [DVec3; 2] + Sync) -> Self {
        let nothing = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let all = (0..count).into_par_iter().map(&box_of);
        let [min, max] = all.reduce(nothing, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let space = Space::new(min, max);
        let padding = Vec3::splat(PADDING);
        let padded = |primitive: u32| {
            let [min, max] = box_of(primitive).map(|corner| space.point(corner));
            Aabb::new((min - padding).into(), (max + padding).into())
        };
        let boxes: Vec<Aabb> = (0..count).into_par_iter().map(padded).collect();
        let bvh = if boxes.is_empty() {
            CwBvh::default()
        } else {
            build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
        };
        Self { bvh, space }
    }

    /// The box of all primitives; None without any.
    pub(super) fn bounds(&self) -> Option<[Vec3; 2]> {
        let Space { center, half, .. } = self.space;
        let corners = [center - half, center + half].map(|corner| corner.as_vec3());
        (!self.bvh.primitive_indices.is_empty()).then_some(corners)
    }

    /// Memory, bytes.
    pub(super) const fn bytes(&self) -> usize {
        size_of_val(self.bvh.nodes.as_slice()) + size_of_val(self.bvh.primitive_indices.as_slice())
    }

    /// The nearest of the intersections that `hit` finds with single primitives, as distance and further data, and its
    /// primitive.
    pub(super) fn nearest<H>(
        &self,
        ray: &Ray,
        mut hit: impl FnMut(u32) -> Option<(f64, H)>,
    ) -> Option<(u32, H)> {
        let (traversal, start) = self.traversal(ray)?;
        let mut best: Option<(f32, u32, H)> = None;
        self.bvh.ray_traverse(traversal, &mut RayHit::none(), |_, slot| {
            let primitive = self.bvh.primitive_indices[slot];
            let Some((t, found)) = hit(primitive) else {
                return f32::INFINITY;
            };
            let place = (single(t), primitive);
            let is_nearer = |(t, index, _): &(f32, u32, H)| place < (*t, *index);
            if best.as_ref().is_none_or(is_nearer) {
                best = Some((place.0, primitive, found));
            }
            self.space.distance(t, start)
        });
        best.map(|(_, primitive, found)| (primitive, found))
    }

    /// Whether the ray hits any primitive, according to `is_hit`.
    pub(super) fn is_hit(&self, ray: &Ray, is_hit: impl Fn(u32) -> bool) -> bool {
        let Some((traversal, _)) = self.traversal(ray) else {
            return false;
        };
        !self.bvh.ray_traverse_miss(traversal, |_, slot| {
            if is_hit(self.bvh.primitive_indices[slot]) { 0.0 } else { f32::INFINITY }
        })
    }

    /// The ray to traverse, and the distance at which it starts.
    fn traversal(&self, ray: &Ray) -> Option<(obvhs::ray::Ray, f64)> {
        let is_empty = self.bvh.primitive_indices.is_empty();
        if is_empty { None } else { self.space.ray(ray) }
    }
}

/// The distances at which `ray` enters and leaves the box around `center`, which reaches `half` its size and `padding` in
/// each direction; None if it misses the box.
pub(super) fn range_in_box(
    ray: &Ray,
    center: DVec3,
    half: DVec3,
    padding: f64,
) -> Option<[f64; 2]> {
    let (origin, direction) = (ray.origin.as_dvec3() - center, ray.direction.as_dvec3());
    let mut range = [f64::from(ray.t_min), f64::from(ray.t_max)];
    for axis in 0..3 {
        let half = half[axis] + padding;
        let slab = [-half - origin[axis], half - origin[axis]];
        if direction[axis] == 0.0 {
            if slab[0] > 0.0 || slab[1] < 0.0 {
                return None;
            }
            continue;
        }
        let [a, b] = slab.map(|x| x / direction[axis]);
        range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
    }
    (range[0] <= range[1]).then_some(range)
}

/// The coordinates of the hierarchy: the box of all primitives is centred, and its longest side is 2.
struct Space {
    center: DVec3,
    /// Half the size of the box.
    half: DVec3,
    scale: f64,
}

impl Space {
    fn new(min: DVec3, max: DVec3) -> Self {
        let half = 0.5 * (max - min);
        let size = half.max_element();
        Self { center: 0.5 * (min + max), half, scale: if size > 0.0 { 1.0 / size } else { 1.0 } }
    }

    fn point(&self, point: DVec3) -> Vec3 {
        ((point - self.center) * self.scale).as_vec3()
    }

    /// The ray in these coordinates. It starts close to the box of all primitives, since its rounding grows with the
    /// distance from its origin. The second value is the distance at which it starts.
    fn ray(&self, ray: &Ray) -> Option<(obvhs::ray::Ray, f64)> {
        if !(ray.origin.is_finite() && ray.direction.is_finite()) {
            return None;
        }
        let padding = f64::from(PADDING) / self.scale;
        let [start, end] = range_in_box(ray, self.center, self.half, padding)?;
        let start = start - LEAD / self.scale;
        let origin = self.point(ray.origin.as_dvec3() + ray.direction.as_dvec3() * start);
        // Without negative zeros, whose reciprocal has the wrong sign for `obvhs`
        let direction = ray.direction + Vec3::ZERO;
        let length = single((end - start) * self.scale);
        let t_max = length + PADDING * (1.0 + length);
        Some((obvhs::ray::Ray::new(origin.into(), direction.into(), 0.0, t_max), start))
    }

    /// The distance `t` along a ray as a distance along the ray of the hierarchy that starts at `start`. It is
    /// slightly larger, so that boxes at the same distance are still entered: they may contain a primitive with a
    /// lower index.
    fn distance(&self, t: f64, start: f64) -> f32 {
        let t = single((t - start) * self.scale);
        t + 2.0 * PADDING * (1.0 + t)
    }
}
