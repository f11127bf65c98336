//! Normals from principal components: if the particles around a point lie in a plane, the direction of their least
//! variance is the normal (Xiao, Zhang and Yang 2017, "Real-time high-quality surface rendering for large scale
//! particle-based fluids"). Spheres that are shaded with these normals look like one smooth surface.
//!
//! The components are computed at each hit point, with weights that fade out towards the end of the support. So they
//! vary smoothly along the surface, and need neither memory nor time for particles that no ray hits. Sums are in
//! fixed point: they are the same to the bit whatever the order of the neighbours in a structure.

use glam::{DVec3, Vec3};

use super::Intersection;
use super::neighbours::{UNIT, each_neighbour, fixed};
use spherule_tree::accel::view::TreeView;
use spherule_tree::ray::Ray;

mod eigen;

use eigen::{SymmetricMatrix, least_component};

/// Range of the sum of weights in which normals turn from that of the sphere to that of the neighbourhood. An
/// isolated particle has 0.9, a pair 1.4, a flat surface of particles a diameter apart 4 to 6.
const WEIGHT_RANGE: [f64; 2] = [1.5, 3.5];
/// Range of the distance between the point and the mean of its neighbours, in supports, in which that distance starts
/// to determine the outward direction.
const OFFSET_RANGE: [f64; 2] = [0.02, 0.1];
/// Height at which shadow rays start, in radii: spheres rise one radius above the visible groove between them, and
/// twice that where the groove is deep. Tuned by eye on the dam break of 24 thousand particles.
const SHADOW_LIFT: f32 = 2.0;
/// Range of the relative gap between the smallest and the second smallest component in which the smallest one starts
/// to count. Half a ball has a gap of 0.7, the corner of a box none.
const GAP_RANGE: [f64; 2] = [0.1, 0.5];

/// Shading normals for the spheres of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PcaNormals {
    /// Radius of the neighbourhood, in radii of the sphere that is hit.
    support: f32,
}

impl PcaNormals {
    /// Normals from neighbours within `support` times the radius of the sphere that is hit.
    #[must_use]
    pub const fn new(support: f32) -> Self {
        Self { support }
    }

    /// `hit`, the intersection of `ray` with a sphere of `radius` in `tree`, with its shading normal: a unit vector
    /// on the same side as the geometric normal, as seen by the ray.
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
            lift: SHADOW_LIFT * radius * smoothed,
            ..hit
        }
    }
}

/// `smooth`, or the direction nearest to it that is seen from the same side as `normal`.
pub(super) fn towards_viewer(smooth: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    /// Cosine of a normal that would otherwise face away from the ray.
    const MIN_COSINE: f32 = 1e-3;
    let side = MIN_COSINE.copysign(normal.dot(direction));
    let cosine = smooth.dot(direction);
    if cosine * side > 0.0 {
        return smooth;
    }
    (smooth - direction * (cosine - side)).try_normalize().unwrap_or(normal)
}

/// Weighted sums over the neighbours of a point, in units of 2^-40; lengths are in supports.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    weight: i64,
    /// x, y, z.
    first: [i64; 3],
    /// xx, yy, zz, xy, xz, yz.
    second: [i64; 6],
}

impl Moments {
    /// The sums over the particles within `reach` of `point`; None if there are too many.
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

    /// The outward direction of the neighbourhood: the smallest component, turned away from the mean. The result
    /// departs from `own`, the normal of the sphere, depending on the number of neighbours; the second value is the
    /// degree from 0 to 1. None without neighbours.
    fn outward(&self, own: DVec3) -> Option<(Vec3, f32)> {
        if self.weight <= 0 {
            return None;
        }
        // Find the outward side: away from the mean of the neighbours, if that is distinct
        let total = self.weight as f64;
        let mean = DVec3::from_array(self.first.map(|sum| sum as f64 / total));
        let away = -mean.normalize_or(-own);
        let base = own.lerp(away, smoothstep(OFFSET_RANGE, mean.length())).normalize_or(own);
        // Turn to the direction of least variance, if that is distinct
        let spread = SymmetricMatrix(self.second.map(|sum| sum as f64 / total)) - mean;
        let flat = match least_component(&spread) {
            Some(least) => {
                let out = least.direction * 1.0_f64.copysign(least.direction.dot(base));
                base.lerp(out, smoothstep(GAP_RANGE, least.gap))
            }
            None => base,
        };
        // Keep the normal of the sphere if there are few neighbours
        let weight = total / f64::from(UNIT);
        let smoothed = smoothstep(WEIGHT_RANGE, weight);
        let normal = own.lerp(flat.normalize_or(own), smoothed);
        #[expect(clippy::cast_possible_truncation, reason = "surfaces answer in f32")]
        Some((normal.normalize_or(own).as_vec3(), smoothed as f32))
    }
}

/// Smooth transition from 0 at the first of `ends` to 1 at the second.
fn smoothstep(ends: [f64; 2], value: f64) -> f64 {
    let t = ((value - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests;
