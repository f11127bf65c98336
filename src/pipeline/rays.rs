//! Estimates the number of rays of an image, as needed to choose a tree.

use crate::render::{IntegratorKind, RenderSettings};
use crate::scene::Scene;

/// Assumed fraction of rays that hit a particle; in the thesis's picture it is 0.3 of the primary and 0.6 of the
/// reflected rays.
const HIT_FRACTION: f64 = 0.4;

/// Number of diffuse reflections after which few paths remain.
const MAX_BOUNCES: u32 = 4;

/// Estimated number of rays of one image.
pub(super) fn expected_rays(image: &RenderSettings, scene: &Scene) -> f64 {
    let paths = f64::from(image.width) * f64::from(image.height) * f64::from(image.samples);
    if image.integrator == IntegratorKind::Path {
        let lights = scene.lights.len() + usize::from(scene.environment.is_some());
        return paths * rays_per_path(lights, 1, 1 + image.traced_bounces().min(MAX_BOUNCES));
    }
    let material = scene.particle_material();
    let branches =
        [material.reflection, material.transmission].iter().filter(|weight| **weight > 0.0).count();
    paths * rays_per_path(scene.lights.len(), branches, image.max_depth)
}

/// Number of rays per path up to `depth` levels: a ray, and for each hit a shadow ray per light and `branches`
/// further rays.
fn rays_per_path(lights: usize, branches: usize, depth: u32) -> f64 {
    let mut below = 0.0;
    for _ in 0..depth {
        below = 1.0 + HIT_FRACTION * (lights as f64 + branches as f64 * below);
    }
    below
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_grow_with_lights_branches_and_depth() {
        assert_eq!(rays_per_path(0, 0, 3), 1.0);
        assert_eq!(rays_per_path(2, 0, 3), 1.8);
        assert_eq!(rays_per_path(1, 1, 1), 1.4);
        assert_eq!(rays_per_path(1, 1, 2), 1.0 + 0.4 * (1.0 + 1.4));
        assert!(rays_per_path(1, 2, 3) > rays_per_path(1, 1, 3));
    }
}
