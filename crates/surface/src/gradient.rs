//! Normals from the gradient of the SPH colour field, with neighbours found in the tree that rays use: the negated
//! gradient of `sum_j W(x - x_j)` with the cubic spline (Monaghan 1992) and equal weights for all particles (Müller,
//! Charypar and Gross 2003, eq. 16). Used for surfaces of spheres; the smooth surface has a field of its own.

use super::Intersection;
use super::field::kernel::slope;
use super::neighbours::{each_neighbour, fixed};
use super::pca::towards_viewer;
use spherule_tree::accel::view::TreeView;
use spherule_tree::ray::Ray;

/// Distance in smoothing lengths below which rounding dominates the slope.
const NO_DISTANCE: f32 = 1e-4;

/// Normals from the gradient of the field around the spheres of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GradientNormals {
    /// Radius of the kernel, in radii of the sphere that is hit.
    support: f32,
}

impl GradientNormals {
    /// Normals with a kernel of `support` times the radius of the sphere that is hit.
    #[must_use]
    pub const fn new(support: f32) -> Self {
        Self { support }
    }

    /// `hit`, the intersection of `ray` with a sphere of `radius` in `tree`, with its shading normal.
    pub(super) fn shade(
        &self,
        tree: &TreeView,
        ray: &Ray,
        hit: Intersection,
        radius: f32,
    ) -> Intersection {
        // Sum the negated gradient over the neighbours in fixed point
        let mut sum = [0_i64; 3];
        let is_whole = each_neighbour(tree, hit.point, self.support * radius, |at| {
            let pull = -at * steepness(2.0 * at.length());
            for (sum, value) in sum.iter_mut().zip(pull.to_array()) {
                *sum += fixed(value);
            }
        });
        // Use it as the shading normal, unless there are too many neighbours or they cancel out
        let outward = glam::DVec3::from_array(sum.map(|sum| sum as f64)).try_normalize();
        match outward {
            Some(outward) if is_whole => Intersection {
                shading: towards_viewer(outward.as_vec3(), hit.normal, ray.direction),
                ..hit
            },
            _ => hit,
        }
    }
}

/// Negated derivative of the cubic spline divided by the distance, up to a constant factor; `q` is the distance in
/// smoothing lengths.
fn steepness(q: f32) -> f32 {
    // The limit at the centre, where both vanish.
    if q < NO_DISTANCE {
        return 1.0;
    }
    -slope(0.5 * q) / (6.0 * q)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steepness_is_that_of_the_spline() {
        let spline = |q: f32| {
            if q < 1.0 { 1.0 - 1.5 * q * q + 0.75 * q * q * q } else { 0.25 * (2.0 - q).powi(3) }
        };
        for q in [0.1, 0.5, 0.9, 1.1, 1.5, 1.9] {
            let slope = (spline(q + 1e-2) - spline(q - 1e-2)) / 2e-2;
            assert!((3.0 * q * steepness(q) + slope).abs() < 1e-3, "{q}");
        }
        assert!(steepness(2.0).abs() < 1e-6 && steepness(2.5).abs() < 1e-6);
    }
}
