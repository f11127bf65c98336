//! References: boxes around parts of spheres, and how planes cut them.
//!
//! After a cut, the box of a part can be smaller than the cut box, because a sphere does not reach the corners. The
//! boxes computed here are as tight as spheres allow. All rounding is away from the sphere.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A};

use super::super::{Aabb, SphereRadius, Spheres};

/// A sphere or a part of it, which lies in the cell between some planes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Reference {
    min: Vec3,
    max: Vec3,
    /// Index in the frame.
    pub(super) particle: u32,
}

impl Reference {
    pub(super) fn new(bounds: Bounds, particle: u32) -> Self {
        Self { min: bounds.min.into(), max: bounds.max.into(), particle }
    }

    #[inline(always)]
    pub(super) fn bounds(&self) -> Bounds {
        Bounds { min: self.min.into(), max: self.max.into() }
    }
}

/// A box in two SIMD registers, for the inner loops of the split rules.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) min: Vec3A,
    pub(super) max: Vec3A,
}

impl Bounds {
    pub(super) const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    /// All of space.
    pub(super) const ALL: Self = Self { min: Vec3A::NEG_INFINITY, max: Vec3A::INFINITY };

    /// Bounding box of `references`.
    pub(super) fn around(references: &[Reference]) -> Self {
        let bounds = references.iter().map(Reference::bounds);
        bounds.fold(Self::EMPTY, Self::union)
    }

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline(always)]
    pub(super) fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    #[inline(always)]
    pub(super) fn extend(self, point: Vec3A) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Twice the centre: the same order, without a multiplication.
    #[inline(always)]
    pub(super) fn doubled_center(self) -> Vec3A {
        self.min + self.max
    }

    /// Surface area, 0 if empty. In f64, because squares of f32 cannot overflow there.
    #[inline(always)]
    pub(super) fn area(self) -> f64 {
        let size = (self.max - self.min).max(Vec3A::ZERO).as_dvec3();
        2.0 * (size.x * (size.y + size.z) + size.y * size.z)
    }

    pub(super) fn to_aabb(self) -> Aabb {
        Aabb { min: self.min.into(), max: self.max.into() }
    }
}

/// A sphere prepared for clipping.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sphere {
    center: Vec3A,
    /// Slightly more than the squared radius, to compensate for rounding.
    squared: f32,
}

/// Larger than the relative error of a few consecutive operations.
const ROUNDING: f32 = 1e-6;

impl Sphere {
    pub(super) fn new(center: Vec3, radius: f32) -> Self {
        Self { center: center.into(), squared: radius * radius * (1.0 + ROUNDING) }
    }

    /// The part of `bounds` around the sphere: the tightest box around their intersection, except for rounding. The
    /// extent of the intersection on an axis is the extent of the sphere at the point that is nearest to its centre
    /// in the rectangle of the other two axes.
    #[inline(always)]
    pub(super) fn clip(&self, bounds: Bounds) -> Bounds {
        // Compute the squared distance from the centre to the box, per axis
        let outside = (bounds.min - self.center).max(self.center - bounds.max).max(Vec3A::ZERO);
        let squares = outside * outside;
        // Compute the extent of the sphere along each axis, at the nearest point of the other two
        let others = Vec3A::splat(squares.element_sum()) - squares;
        let reach = (Vec3A::splat(self.squared) - others).max(Vec3A::ZERO).sqrt();
        let common = bounds.intersection(self.rounded_out(reach));
        // Rounding can leave nothing if the box only touches the sphere; keep the box then.
        if common.min.cmpgt(common.max).any() { bounds } else { common }
    }

    /// Prepares the sphere for clipping to slabs of `bounds`.
    #[inline(always)]
    pub(super) fn in_slabs(self, bounds: Bounds) -> SlabClip {
        let outside = (bounds.min - self.center).max(self.center - bounds.max).max(Vec3A::ZERO);
        SlabClip {
            sphere: self,
            bounds,
            center: self.center.to_array(),
            squares: outside * outside,
        }
    }

    /// The box that extends by `reach` from the centre, rounded outwards.
    #[inline(always)]
    fn rounded_out(&self, reach: Vec3A) -> Bounds {
        let (min, max) = (self.center - reach, self.center + reach);
        Bounds { min: min - min.abs() * f32::EPSILON, max: max + max.abs() * f32::EPSILON }
    }
}

/// A part of a sphere, prepared for cuts into slabs. A slab changes the nearest point only on its own axis, and does
/// not change the extent along it, because the box is already tight.
#[derive(Debug, Clone, Copy)]
pub(super) struct SlabClip {
    sphere: Sphere,
    bounds: Bounds,
    center: [f32; 3],
    /// Squared distance from the centre to the box, per axis.
    squares: Vec3A,
}

impl SlabClip {
    /// Squared extent on the two axes other than `axis`, before the distance of the slab is subtracted; infinite on
    /// `axis` itself.
    #[inline(always)]
    pub(super) fn reach_beside(&self, axis: usize) -> Vec3A {
        let squares = self.squares.to_array();
        let [x, y, z] = squares.map(|square| self.sphere.squared - square);
        match axis {
            0 => Vec3A::new(f32::INFINITY, z, y),
            1 => Vec3A::new(z, f32::INFINITY, x),
            _ => Vec3A::new(y, x, f32::INFINITY),
        }
    }

    /// The box between `from` and `to` on `axis`, tight around the sphere on the other axes.
    #[inline(always)]
    pub(super) fn slab(&self, axis: usize, reach_beside: Vec3A, from: f32, to: f32) -> Bounds {
        let center = self.center[axis];
        let distance = (from - center).max(center - to).max(0.0);
        let reach = (reach_beside - distance * distance).max(Vec3A::ZERO).sqrt();
        self.bounds.intersection(self.sphere.rounded_out(reach))
    }
}

/// The spheres that references are parts of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts<'a> {
    spheres: Spheres<'a>,
}

impl<'a> Parts<'a> {
    pub(super) fn of(spheres: Spheres<'a>) -> Self {
        Self { spheres }
    }

    #[inline(always)]
    pub(super) fn sphere(&self, particle: u32) -> Sphere {
        let index = particle as usize;
        Sphere::new(self.spheres.centers[index], self.radius(index))
    }

    #[inline(always)]
    fn radius(&self, index: usize) -> f32 {
        match self.spheres.radius {
            SphereRadius::Common(radius) => radius,
            SphereRadius::Each(radii) => radii[index],
        }
    }

    /// A reference to an entire sphere.
    pub(super) fn whole(&self, particle: u32) -> Reference {
        let index = particle as usize;
        let reach = Vec3A::splat(self.radius(index));
        // Rays hit nothing beyond the range of f32, and areas of infinite boxes cannot be compared.
        let range = Bounds { min: Vec3A::splat(f32::MIN), max: Vec3A::splat(f32::MAX) };
        let bounds = self.sphere(particle).rounded_out(reach);
        Reference::new(bounds.intersection(range), particle)
    }

    /// The parts of `reference` below and above `plane` on `axis`.
    #[inline(always)]
    pub(super) fn cut(&self, reference: &Reference, axis: usize, plane: f32) -> [Bounds; 2] {
        let bounds = reference.bounds();
        let sphere = self.sphere(reference.particle);
        let plane = plane.clamp(bounds.min[axis], bounds.max[axis]);
        let (mut below, mut above) = (bounds, bounds);
        below.max[axis] = plane;
        above.min[axis] = plane;
        [sphere.clip(below), sphere.clip(above)]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn unit_sphere() -> (Sphere, Bounds) {
        let center = Vec3::new(1.0, 2.0, 3.0);
        let centers = [center];
        let parts = Parts::of(Spheres { centers: &centers, radius: SphereRadius::Common(1.0) });
        (Sphere::new(center, 1.0), parts.whole(0).bounds())
    }

    #[test]
    fn clipped_cap_is_smaller_than_the_clipped_box() {
        let (sphere, mut cap) = unit_sphere();
        // The cap from 0.6 of the radius on: its rim has radius 0.8.
        cap.min.x = 1.6;
        let tight = sphere.clip(cap);
        assert!((tight.min - Vec3A::new(1.6, 1.2, 2.2)).length() < 1e-5);
        assert!((tight.max - Vec3A::new(2.0, 2.8, 3.8)).length() < 1e-5);
    }

    #[test]
    fn half_with_the_centre_has_the_full_width() {
        let (sphere, mut half) = unit_sphere();
        half.min.x = 0.5;
        let tight = sphere.clip(half);
        assert!((tight.min - Vec3A::new(0.5, 1.0, 2.0)).length() < 1e-5);
    }

    proptest! {
        /// Points of the sphere in the cell are in its part after any number of cuts.
        #[test]
        fn parts_contain_the_sphere_inside_their_cells(
            center in prop::array::uniform3(-1e3_f32..1e3),
            radius in prop::sample::select(vec![1e-3_f32, 1.0, 100.0]),
            cuts in prop::collection::vec((0_usize..3, -1.0_f32..1.0, any::<bool>()), 1..6),
            directions in prop::collection::vec(prop::array::uniform3(-1.0_f64..1.0), 64),
        ) {
            let centers = [Vec3::from_array(center)];
            let spheres = Spheres { centers: &centers, radius: SphereRadius::Common(radius) };
            let parts = Parts::of(spheres);
            let mut reference = parts.whole(0);
            let mut points: Vec<glam::DVec3> = directions
                .iter()
                .map(|d| {
                    let direction = glam::DVec3::from_array(*d).normalize_or(glam::DVec3::X);
                    centers[0].as_dvec3() + direction * f64::from(radius)
                })
                .collect();
            for (axis, place, keep_above) in cuts {
                let plane = center[axis] + place * radius;
                let kept = parts.cut(&reference, axis, plane)[usize::from(keep_above)];
                let at = f64::from(plane);
                points.retain(|p| if keep_above { p[axis] >= at } else { p[axis] <= at });
                reference = Reference::new(kept, 0);
                let own = reference.bounds();
                for point in &points {
                    prop_assert!(
                        point.cmpge(own.min.as_dvec3()).all() && point.cmple(own.max.as_dvec3()).all(),
                        "{point} is outside {own:?}"
                    );
                }
            }
        }
    }
}
