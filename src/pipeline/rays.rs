//! How many rays an image will take, before it is traced: enough to choose a tree by.

use crate::render::RenderSettings;
use crate::scene::Scene;

/// Part of the rays that is taken to meet a particle; in the thesis's picture it is 0.3 of the
/// primary and 0.6 of the mirrored rays.
const HIT_PART: f64 = 0.4;

/// Rays of one image.
pub(super) fn expected_rays(image: &RenderSettings, scene: &Scene) -> f64 {
    let paths = f64::from(image.width) * f64::from(image.height) * f64::from(image.samples);
    let material = &scene.material;
    let branches = [material.reflection, material.transmission]
        .iter()
        .filter(|weight| **weight > 0.0)
        .count();
    paths * rays_per_path(scene.lights.len(), branches, image.max_depth)
}

/// A ray, and where it hits a shadow ray for each light and `branches` rays that go on, to `depth`
/// levels.
fn rays_per_path(lights: usize, branches: usize, depth: u32) -> f64 {
    let mut below = 0.0;
    for _ in 0..depth {
        below = 1.0 + HIT_PART * (lights as f64 + branches as f64 * below);
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
