//! Refines intersections and normals with the field of the particles.

use super::layout::Layout;
use crate::Intersection;
use crate::field::FieldParticles;
use spherule_tree::ray::Ray;

/// Newton steps; each doubles the number of exact digits.
const STEPS: usize = 4;
/// Maximum distance between the surface of the grid and that of the field, in voxels.
const MAX_DISTANCE: f32 = 0.75;
/// The iteration ends at this distance from the surface, in voxels.
const TOLERANCE: f32 = 1e-3;

/// `hit` moved from the surface of the grid to that of the field, along the gradient. Secondary rays still start from
/// the surface of the grid, because they are traced against it.
pub(super) fn refine(
    field: &FieldParticles,
    layout: &Layout,
    ray: &Ray,
    hit: Intersection,
) -> Intersection {
    let mut point = hit.point;
    let mut gradient = None;
    for _ in 0..STEPS {
        // Take a Newton step along the gradient
        let sample = field.sample(point);
        let steepness = sample.gradient.length_squared();
        if steepness <= 0.0 {
            return hit;
        }
        gradient = Some(sample.gradient);
        let step = (layout.threshold - sample.value) / steepness * sample.gradient;
        if step.length_squared() < (TOLERANCE * layout.voxel).powi(2) {
            break;
        }
        point += step;
        if point.distance_squared(hit.point) > (MAX_DISTANCE * layout.voxel).powi(2) {
            // The point is on another sheet of the surface: keep the original point, with the gradient there
            point = hit.point;
            gradient = Some(field.sample(point).gradient);
            break;
        }
    }
    // Use the gradient of the field as the normal
    let found = gradient.and_then(|gradient| (-gradient).try_normalize());
    let normal = found.unwrap_or(hit.normal);
    Intersection {
        t: hit.t + (point - hit.point).dot(ray.direction),
        point,
        normal,
        shading: normal,
        ..hit
    }
}
