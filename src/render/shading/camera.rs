//! Camera rays, and the depth of their intersections along the view axis.

#![expect(
    clippy::needless_range_loop,
    reason = "one index for the lanes of many arrays"
)]

use glam::Vec3;

use super::frame::disc;
use crate::math::{LANES, Lanes, lane_kernel};
use crate::ray::RayPacket;
use crate::scene::{Camera, Lens};
use crate::surface::Intersections;

/// A camera in a form for packets.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct CameraLanes {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Tangents of half the field of view.
    half_extent: [f32; 2],
    /// Size of the image in pixels.
    size: [f32; 2],
    lens: Option<Lens>,
}

impl CameraLanes {
    pub(in crate::render) fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let [right, up, forward] = camera.axes();
        Self {
            eye: camera.eye(),
            right,
            up,
            forward,
            half_extent: camera.half_extent().to_array(),
            size: [width as f32, height as f32],
            lens: camera.lens(),
        }
    }

    /// Whether camera rays start at different points.
    pub(in crate::render) const fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// Width of a pixel at the distance of `point` from the eye.
    pub(in crate::render) fn pixel_width(&self, point: Vec3) -> f32 {
        2.0 * self.half_extent[1] / self.size[1] * (point - self.eye).length()
    }

    /// The position of `point` on the film in pixels from its top left corner; None behind the camera.
    pub(in crate::render) fn pixel_of(&self, point: Vec3) -> Option<[f32; 2]> {
        let direction = point - self.eye;
        if direction.dot(self.forward) <= 0.0 {
            return None;
        }
        let direction = direction.normalize().to_array();
        let [x, y] = self.film_position(self.eye.to_array(), direction);
        Some([x * self.size[0], y * self.size[1]])
    }

    /// The position on the film of the camera ray from `origin` with unit direction `d`; (0, 0) is the top left corner,
    /// (1, 1) the bottom right one.
    #[inline(always)]
    pub(super) fn film_position(&self, origin: [f32; 3], mut d: [f32; 3]) -> [f32; 2] {
        let (r, u, f) = (self.right, self.up, self.forward);
        if let Some(lens) = self.lens {
            // The ray from the centre of the lens meets it on the plane in focus
            let distance = lens.focus / (d[0] * f.x + d[1] * f.y + d[2] * f.z);
            for axis in 0..3 {
                d[axis] = origin[axis] - self.eye[axis] + distance * d[axis];
            }
        }
        let depth = d[0] * f.x + d[1] * f.y + d[2] * f.z;
        let across = (d[0] * r.x + d[1] * r.y + d[2] * r.z) / (depth * self.half_extent[0]);
        let along = (d[0] * u.x + d[1] * u.y + d[2] * u.z) / (depth * self.half_extent[1]);
        [0.5 + 0.5 * across, 0.5 - 0.5 * along]
    }
}

/// Camera rays through points of the film, which are in pixels from its top left corner.
#[inline(always)]
fn camera_rays_body(camera: &CameraLanes, x: &Lanes, y: &Lanes, rays: &mut RayPacket) {
    let (r, u, f) = (camera.right, camera.up, camera.forward);
    for l in 0..LANES {
        let a = (2.0 * (x[l] / camera.size[0]) - 1.0) * camera.half_extent[0];
        let b = (1.0 - 2.0 * (y[l] / camera.size[1])) * camera.half_extent[1];
        let d = [
            f.x + a * r.x + b * u.x,
            f.y + a * r.y + b * u.y,
            f.z + a * r.z + b * u.z,
        ];
        let inverse = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        for axis in 0..3 {
            rays.direction[axis][l] = d[axis] * inverse;
            rays.origin[axis][l] = camera.eye[axis];
        }
        rays.t_min[l] = 0.0;
        rays.t_max[l] = f32::INFINITY;
    }
}

lane_kernel! {
    pub(in crate::render) fn camera_rays(camera: &CameraLanes, x: &Lanes, y: &Lanes, rays: &mut RayPacket) = camera_rays_body;
}

/// [`camera_rays`] of a camera that moves from `open`, at time -1/2, to `close`, at time 1/2: linearly, each ray at its
/// own time.
#[inline(always)]
fn moving_camera_rays_body(
    open: &CameraLanes,
    close: &CameraLanes,
    x: &Lanes,
    y: &Lanes,
    rays: &mut RayPacket,
) {
    for l in 0..LANES {
        let end = rays.time[l] + 0.5;
        let mut d = [0.0; 3];
        for (camera, part) in [(open, 1.0 - end), (close, end)] {
            let (r, u, f) = (camera.right, camera.up, camera.forward);
            let a = (2.0 * (x[l] / camera.size[0]) - 1.0) * camera.half_extent[0];
            let b = (1.0 - 2.0 * (y[l] / camera.size[1])) * camera.half_extent[1];
            for axis in 0..3 {
                d[axis] += part * (f[axis] + a * r[axis] + b * u[axis]);
            }
        }
        let inverse = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        for axis in 0..3 {
            rays.direction[axis][l] = d[axis] * inverse;
            rays.origin[axis][l] = open.eye[axis] + end * (close.eye[axis] - open.eye[axis]);
        }
        rays.t_min[l] = 0.0;
        rays.t_max[l] = f32::INFINITY;
    }
}

lane_kernel! {
    pub(in crate::render) fn moving_camera_rays(
        open: &CameraLanes,
        close: &CameraLanes,
        x: &Lanes,
        y: &Lanes,
        rays: &mut RayPacket,
    ) = moving_camera_rays_body;
}

/// Moves the origins of `rays`, camera rays through the centre of the lens, to the points of the lens that `u` in the
/// unit square chooses. The rays still pass through the same points of the plane in focus.
#[inline(always)]
fn lens_rays_body(camera: &CameraLanes, u: &[Lanes; 2], rays: &mut RayPacket) {
    let Some(lens) = camera.lens else {
        return;
    };
    let (right, up, f) = (camera.right, camera.up, camera.forward);
    for l in 0..LANES {
        let [a, b] = disc([u[0][l], u[1][l]]).map(|v| v * lens.radius);
        let d = &mut rays.direction;
        let along = d[0][l] * f.x + d[1][l] * f.y + d[2][l] * f.z;
        let distance = lens.focus / along;
        let (mut to_focus, mut square) = ([0.0; 3], 0.0);
        for axis in 0..3 {
            let offset = a * right[axis] + b * up[axis];
            rays.origin[axis][l] += offset;
            to_focus[axis] = distance * d[axis][l] - offset;
            square += to_focus[axis] * to_focus[axis];
        }
        let inverse = 1.0 / square.sqrt();
        for axis in 0..3 {
            d[axis][l] = to_focus[axis] * inverse;
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn lens_rays(camera: &CameraLanes, u: &[Lanes; 2], rays: &mut RayPacket) = lens_rays_body;
}

/// Distances of the intersections of camera rays along the view axis; infinite without an intersection.
#[inline(always)]
fn depths_body(camera: &CameraLanes, rays: &RayPacket, hits: &Intersections, z: &mut Lanes) {
    let f = camera.forward;
    let d = &rays.direction;
    for l in 0..LANES {
        let along = d[0][l] * f.x + d[1][l] * f.y + d[2][l] * f.z;
        let is_hit = hits.mask >> l & 1 == 1;
        z[l] = if is_hit {
            hits.t[l] * along
        } else {
            f32::INFINITY
        };
    }
}

lane_kernel! {
    pub(in crate::render) fn depths(
        camera: &CameraLanes,
        rays: &RayPacket,
        hits: &Intersections,
        z: &mut Lanes,
    ) = depths_body;
}
