//! Crossing and normal straight from the particles.

use super::layout::Layout;
use crate::ray::Ray;
use crate::surface::Intersection;
use crate::surface::field::FieldParticles;

/// Newton steps; they gain twice as many digits each.
const STEPS: usize = 4;
/// The way from the grid's surface to the field's is no longer than this, in voxels.
const FARTHEST: f32 = 0.75;
/// The search ends this close to the surface, in voxels.
const CLOSE: f32 = 1e-3;

/// `hit` of the grid moved along the field's gradient onto its surface. Secondary rays still start from the
/// grid's, which is what they meet.
pub(super) fn refined(
    field: &FieldParticles,
    layout: &Layout,
    ray: &Ray,
    hit: Intersection,
) -> Intersection {
    let mut point = hit.point;
    let mut gradient = None;
    for _ in 0..STEPS {
        let sample = field.sample(point);
        let steepness = sample.gradient.length_squared();
        if steepness <= 0.0 {
            return hit;
        }
        gradient = Some(sample.gradient);
        let step = (layout.threshold - sample.value) / steepness * sample.gradient;
        if step.length_squared() < (CLOSE * layout.voxel).powi(2) {
            break;
        }
        point += step;
        if point.distance_squared(hit.point) > (FARTHEST * layout.voxel).powi(2) {
            // Another sheet of the surface; the gradient at the grid's is as good as any.
            point = hit.point;
            gradient = Some(field.sample(point).gradient);
            break;
        }
    }
    let normal = gradient.and_then(|gradient| (-gradient).try_normalize());
    let normal = normal.unwrap_or(hit.normal);
    Intersection {
        t: hit.t + (point - hit.point).dot(ray.direction),
        point,
        normal,
        shading: normal,
        ..hit
    }
}
