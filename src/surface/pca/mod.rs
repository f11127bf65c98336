//! Normals by principal components of the particles about a place: where they lie flat, the direction in
//! which they spread least (Xiao, Zhang and Yang 2017, "Real-time high-quality surface rendering for large
//! scale particle-based fluids"). Spheres shaded by them look like one smooth surface.
//!
//! The components are taken where a ray hits, of weights that fade out at the end of the support. So they
//! change smoothly from place to place, and nothing is kept of them for particles that nobody sees. Sums
//! are in fixed point: they are the same to the bit in whatever order a structure has the neighbours.

use glam::{DVec3, Vec3};

use super::Intersection;
use super::neighbours::{UNIT, each_neighbour, fixed};
use crate::accel::view::TreeView;
use crate::ray::Ray;

mod eigen;

use eigen::{SymmetricMatrix, least_component};

/// Sums of weights between which normals turn from the sphere's own to those of the neighbours. A particle
/// alone has 0.9, a pair 1.4, a flat surface of particles a diameter apart 4 to 6.
const LONELY: [f64; 2] = [1.5, 3.5];
/// Distances of the neighbours' mean, in supports, between which it tells which way is out.
const ONE_SIDED: [f64; 2] = [0.02, 0.1];
/// What shadow rays pass over, in radii: spheres a radius above the groove that is seen, and as much again where it is
/// deep. By eye, on the dam break of 24 thousand particles.
const LIFT: f32 = 2.0;
/// How much smaller than the second the least component is, as a part of the second, between which it is
/// believed. Of half a ball it is 0.7 smaller, at the corner of a box not at all.
const FLAT: [f64; 2] = [0.1, 0.5];

/// Normals for shading the spheres of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PcaNormals {
    /// Reach of the neighbourhood, in radii of the sphere that is hit.
    support: f32,
}

impl PcaNormals {
    /// Of neighbours within `support` times the radius of the sphere that is hit.
    #[must_use]
    pub const fn new(support: f32) -> Self {
        Self { support }
    }

    /// `hit`, which a `ray` found on a sphere of `radius` in `tree`, with the normal to shade it by: of unit
    /// length and on the side of the hit's own, as the ray sees it.
    pub(super) fn shade(
        &self,
        tree: &TreeView,
        ray: &Ray,
        hit: Intersection,
        radius: f32,
    ) -> Intersection {
        let reach = self.support * radius;
        let moments = Moments::about(tree, hit.point, reach);
        let Some((smooth, smoothed)) = moments.and_then(|m| m.outward(hit.normal.as_dvec3()))
        else {
            return hit;
        };
        Intersection {
            shading: towards_viewer(smooth, hit.normal, ray.direction),
            lift: LIFT * radius * smoothed,
            ..hit
        }
    }
}

/// `smooth`, or the nearest direction to it that is seen from the same side as `normal`.
pub(super) fn towards_viewer(smooth: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    /// Cosine that is left to a normal that points away.
    const LEAST: f32 = 1e-3;
    let side = LEAST.copysign(normal.dot(direction));
    let cosine = smooth.dot(direction);
    if cosine * side > 0.0 {
        return smooth;
    }
    (smooth - direction * (cosine - side))
        .try_normalize()
        .unwrap_or(normal)
}

/// Sums over the neighbours of a place, in units of 2^-40; lengths are in supports.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    weight: i64,
    /// x, y, z.
    first: [i64; 3],
    /// xx, yy, zz, xy, xz, yz.
    second: [i64; 6],
}

impl Moments {
    /// Of the particles within `reach` of `point`; None if there are too many.
    fn about(tree: &TreeView, point: Vec3, reach: f32) -> Option<Self> {
        let mut sums = Self::default();
        each_neighbour(tree, point, reach, |at| sums.add(at)).then_some(sums)
    }

    fn add(&mut self, at: Vec3) {
        let fading = (1.0 - at.length_squared()).max(0.0);
        let weight = fading * fading;
        self.weight += fixed(weight);
        for (sum, value) in self.first.iter_mut().zip(at.to_array()) {
            *sum += fixed(weight * value);
        }
        let Vec3 { x, y, z } = at;
        let products = [x * x, y * y, z * z, x * y, x * z, y * z];
        for (sum, value) in self.second.iter_mut().zip(products) {
            *sum += fixed(weight * value);
        }
    }

    /// The way out of what is about: the least component, turned away from the mean. `own` is the sphere's
    /// normal, from which it departs as far as there are neighbours; how far, from 0 to 1, comes second. None
    /// where there are none.
    fn outward(&self, own: DVec3) -> Option<(Vec3, f32)> {
        if self.weight <= 0 {
            return None;
        }
        let total = self.weight as f64;
        let mean = DVec3::from_array(self.first.map(|sum| sum as f64 / total));
        let away = -mean.normalize_or(-own);
        let base = own.lerp(away, smoothstep(ONE_SIDED, mean.length()));
        let base = base.normalize_or(own);
        let spread = SymmetricMatrix(self.second.map(|sum| sum as f64 / total)) - mean;
        let flat = match least_component(&spread) {
            Some(least) => {
                let out = least.direction * 1.0_f64.copysign(least.direction.dot(base));
                base.lerp(out, smoothstep(FLAT, least.gap))
            }
            None => base,
        };
        let weight = total / f64::from(UNIT);
        let smoothed = smoothstep(LONELY, weight);
        let normal = own.lerp(flat.normalize_or(own), smoothed);
        #[expect(clippy::cast_possible_truncation, reason = "surfaces answer in f32")]
        Some((normal.normalize_or(own).as_vec3(), smoothed as f32))
    }
}

/// From 0 at the first of `ends` to 1 at the second.
fn smoothstep(ends: [f64; 2], value: f64) -> f64 {
    let t = ((value - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests;
