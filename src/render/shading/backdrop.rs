//! The backdrop of a studio behind camera rays without an intersection: a vertical gradient over the image that is
//! darker towards the corners.

use super::camera::CameraLanes;
use crate::math::{LANES, Lanes3, lane_kernel};
use crate::scene::background::{STUDIO_BOTTOM, STUDIO_CENTER, STUDIO_TOP};

/// Fraction by which the corners are darkened at most.
const VIGNETTE: f32 = 0.25;

/// Growth of the darkening with the squared distance from the centre.
const FALLOFF: f32 = 1.6;

/// Factor on horizontal distances from the centre.
const STRETCH: f32 = 1.15;

/// Adds the radiance of the backdrop along `direction` times `weight` to `radiance`, only for `lanes`.
#[inline(always)]
fn add_backdrop_body(
    camera: &CameraLanes,
    direction: &Lanes3,
    weight: &Lanes3,
    lanes: u32,
    radiance: &mut Lanes3,
) {
    let (bottom, top) = (STUDIO_BOTTOM.to_array(), STUDIO_TOP.to_array());
    for l in 0..LANES {
        let [x, y] = camera.film_position([direction[0][l], direction[1][l], direction[2][l]]);
        let across = STRETCH * (x - STUDIO_CENTER[0]);
        let down = y - STUDIO_CENTER[1];
        let darkening = FALLOFF * (across * across + down * down);
        let darkening = if darkening < 1.0 { darkening } else { 1.0 };
        let brightness = 1.0 - VIGNETTE * darkening;
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let color = brightness * (top[axis] * (1.0 - y) + bottom[axis] * y);
            let sum = radiance[axis][l] + weight[axis][l] * color;
            radiance[axis][l] = if is_chosen { sum } else { radiance[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn add_backdrop(
        camera: &CameraLanes,
        direction: &Lanes3,
        weight: &Lanes3,
        lanes: u32,
        radiance: &mut Lanes3,
    ) = add_backdrop_body;
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec2, Vec3};

    use super::*;
    use crate::math::{Supported, lane3, set_lane3, splat};
    use crate::scene::{Camera, CameraView};

    /// The colour at a position of the film.
    fn backdrop(film: Vec2) -> Vec3 {
        let view = CameraView {
            eye: DVec3::new(3.0, -10.0, 4.0),
            look_at: DVec3::ZERO,
            up: DVec3::Z,
            fov: 60.0,
        };
        let camera = Camera::new(&view, 1.6, DVec3::ZERO).unwrap();
        let (mut direction, mut radiance) = ([splat(0.0); 3], [splat(0.0); 3]);
        set_lane3(&mut direction, 2, camera.ray(film).direction);
        let camera = CameraLanes::new(&camera, 160, 100);
        let weight = [splat(1.0); 3];
        let simd = Supported::default();
        add_backdrop(simd, &camera, &direction, &weight, 0b100, &mut radiance);
        lane3(&radiance, 2)
    }

    #[test]
    fn is_brightest_near_the_centre_and_depends_on_the_film_only() {
        for (x, y) in [(0.5, 0.45), (0.0, 0.0), (1.0, 1.0), (0.2, 0.9)] {
            let squared = (1.15 * (x - 0.5_f32)).powi(2) + (y - 0.45_f32).powi(2);
            let wanted = STUDIO_BOTTOM.lerp(STUDIO_TOP, 1.0 - y);
            let wanted = wanted * (1.0 - 0.25 * (1.6 * squared).min(1.0));
            let found = backdrop(Vec2::new(x, y));
            assert!((found - wanted).abs().max_element() < 1e-5, "{x} {y}");
        }
    }
}
