//! Rays through points of the film, for each projection of [`crate::scene::projection`].

use super::CameraLanes;
use spherule_tree::math::functions::sin_cos;

/// A projection in a form for packets.
pub(super) trait FilmRay {
    /// Origin and direction, which need not have unit length, of the ray through a point of the film.
    fn ray(camera: &CameraLanes, film: [f32; 2]) -> [[f32; 3]; 2];
}

/// Rays from the eye.
pub(super) struct Pinhole;

/// Rays along the view axis.
pub(super) struct Parallel;

/// Rays from the eye in all directions, by longitude and latitude.
pub(super) struct Panorama;

impl FilmRay for Pinhole {
    #[inline(always)]
    fn ray(camera: &CameraLanes, [a, b]: [f32; 2]) -> [[f32; 3]; 2] {
        let (r, u, f) = (camera.right, camera.up, camera.forward);
        let direction = [f.x + a * r.x + b * u.x, f.y + a * r.y + b * u.y, f.z + a * r.z + b * u.z];
        [[camera.eye.x, camera.eye.y, camera.eye.z], direction]
    }
}

impl FilmRay for Parallel {
    #[inline(always)]
    fn ray(camera: &CameraLanes, [a, b]: [f32; 2]) -> [[f32; 3]; 2] {
        let (e, r, u, f) = (camera.eye, camera.right, camera.up, camera.forward);
        let origin = [e.x + a * r.x + b * u.x, e.y + a * r.y + b * u.y, e.z + a * r.z + b * u.z];
        [origin, [f.x, f.y, f.z]]
    }
}

impl FilmRay for Panorama {
    #[inline(always)]
    fn ray(camera: &CameraLanes, [a, b]: [f32; 2]) -> [[f32; 3]; 2] {
        let (r, u, f) = (camera.right, camera.up, camera.forward);
        let ((sin_a, cos_a), (sin_b, cos_b)) = (sin_cos(a), sin_cos(b));
        let (x, z) = (cos_b * sin_a, cos_b * cos_a);
        let direction = [
            x * r.x + sin_b * u.x + z * f.x,
            x * r.y + sin_b * u.y + z * f.y,
            x * r.z + sin_b * u.z + z * f.z,
        ];
        [[camera.eye.x, camera.eye.y, camera.eye.z], direction]
    }
}
