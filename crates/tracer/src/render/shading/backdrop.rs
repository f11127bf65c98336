//! The backdrop of a studio behind camera rays without an intersection: a vertical gradient over the image that is
//! darker towards the corners.

use super::camera::CameraLanes;
use crate::scene::background::studio_on_film;
use spherule_tree::math::{LANES, Lanes3, lane_kernel};
use spherule_tree::ray::RayPacket;

/// Adds the radiance of the backdrop along camera rays times `weight` to `radiance`, only for `lanes`.
#[inline(always)]
fn add_backdrop_body(
    camera: &CameraLanes,
    rays: &RayPacket,
    weight: &Lanes3,
    lanes: u32,
    radiance: &mut Lanes3,
) {
    for l in 0..LANES {
        let (origin, direction) = (&rays.origin, &rays.direction);
        let color = studio_on_film(camera.film_position(
            [origin[0][l], origin[1][l], origin[2][l]],
            [direction[0][l], direction[1][l], direction[2][l]],
        ));
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let sum = radiance[axis][l] + weight[axis][l] * color[axis];
            radiance[axis][l] = if is_chosen { sum } else { radiance[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn add_backdrop(
        camera: &CameraLanes,
        rays: &RayPacket,
        weight: &Lanes3,
        lanes: u32,
        radiance: &mut Lanes3,
    ) = add_backdrop_body;
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec2, Vec3};

    use super::*;
    use crate::render::shading::lens_rays;
    use crate::scene::background::{STUDIO_BOTTOM, STUDIO_TOP};
    use crate::scene::{Camera, CameraView, Lens};
    use spherule_tree::math::{Supported, lane3, set_lane3, splat};

    /// The colour at a position of the film.
    fn backdrop(film: Vec2, lens: Option<Vec2>) -> Vec3 {
        let view = CameraView {
            eye: DVec3::new(3.0, -10.0, 4.0),
            look_at: DVec3::ZERO,
            up: DVec3::Z,
            fov: 60.0,
        };
        let camera = Camera::new(&view, 1.6, DVec3::ZERO).unwrap();
        let camera =
            camera.with_lens(Lens { radius: if lens.is_some() { 0.5 } else { 0.0 }, focus: 4.0 });
        let (mut rays, mut radiance) = (RayPacket::default(), [splat(0.0); 3]);
        let ray = camera.ray(film);
        set_lane3(&mut rays.origin, 2, ray.origin);
        set_lane3(&mut rays.direction, 2, ray.direction);
        let camera = CameraLanes::new(&camera, 160, 100);
        let weight = [splat(1.0); 3];
        let simd = Supported::default();
        if let Some(u) = lens {
            lens_rays(simd, &camera, &u.to_array().map(splat), &mut rays);
            assert_ne!(lane3(&rays.direction, 2), ray.direction);
        }
        add_backdrop(simd, &camera, &rays, &weight, 0b100, &mut radiance);
        lane3(&radiance, 2)
    }

    #[test]
    fn is_brightest_near_the_centre_and_depends_on_the_film_only() {
        for (x, y) in [(0.5, 0.45), (0.0, 0.0), (1.0, 1.0), (0.2, 0.9)] {
            let squared = (1.15 * (x - 0.5_f32)).powi(2) + (y - 0.45_f32).powi(2);
            let wanted = STUDIO_BOTTOM.lerp(STUDIO_TOP, 1.0 - y);
            let wanted = wanted * (1.0 - 0.25 * (1.6 * squared).min(1.0));
            for lens in [None, Some(Vec2::new(0.9, 0.3))] {
                let found = backdrop(Vec2::new(x, y), lens);
                assert!((found - wanted).abs().max_element() < 1e-5, "{x} {y}");
            }
        }
    }
}
