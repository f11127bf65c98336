//! Camera rays, and the depth of their intersections along the view axis.

use glam::Vec3;

use super::frame::disc;
use crate::scene::{Camera, Lens, Projection, Stereo};
use spherule_surface::Intersections;
use spherule_tree::math::{LANES, Lanes, lane_kernel};
use spherule_tree::ray::RayPacket;

mod film_ray;

use film_ray::{FilmRay, Panorama, Parallel, Pinhole};

/// A camera in a form for packets.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct CameraLanes {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    projection: Projection,
    /// Half the width and the height of the film.
    half_extent: [f32; 2],
    /// Size of the image in pixels.
    size: [f32; 2],
    lens: Option<Lens>,
    stereo: Option<Stereo>,
}

impl CameraLanes {
    pub(in crate::render) fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let [right, up, forward] = camera.axes();
        Self {
            eye: camera.eye(),
            right,
            up,
            forward,
            projection: camera.projection(),
            half_extent: camera.half_extent().to_array(),
            size: [width as f32, height as f32],
            lens: camera.lens(),
            stereo: camera.stereo(),
        }
    }

    /// Whether camera rays start at random points.
    pub(in crate::render) const fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// Whether all camera rays start at the eye.
    pub(in crate::render) const fn has_one_origin(&self) -> bool {
        self.lens.is_none() && self.stereo.is_none() && self.projection.has_one_origin()
    }

    /// Whether there are images for two eyes.
    pub(in crate::render) const fn is_stereo(&self) -> bool {
        self.stereo.is_some()
    }

    /// Width of a pixel at the distance of `point` from the eye.
    pub(in crate::render) fn pixel_width(&self, point: Vec3) -> f32 {
        let width = 2.0 * self.half_extent[1] / self.size[1];
        match self.projection {
            Projection::Orthographic { .. } => width,
            _ => width * (point - self.eye).length(),
        }
    }

    /// The position of `point` on the film in pixels from its top left corner; None behind the camera.
    pub(in crate::render) fn pixel_of(&self, point: Vec3) -> Option<[f32; 2]> {
        let direction = point - self.eye;
        if self.projection != Projection::Perspective {
            let on_axes = [self.right, self.up, self.forward].map(|axis| direction.dot(axis));
            let [a, b] = self.projection.project(on_axes.into())?.to_array();
            let [width, height] = self.half_extent;
            let film = [0.5 + 0.5 * a / width, 0.5 - 0.5 * b / height];
            return Some([film[0] * self.size[0], film[1] * self.size[1]]);
        }
        if direction.dot(self.forward) <= 0.0 {
            return None;
        }
        let direction = direction.normalize().to_array();
        let [x, y] = self.film_position(self.eye.to_array(), direction);
        Some([x * self.size[0], y * self.size[1]])
    }

    /// Coordinates on the film of a point in pixels, to the right and upwards from the middle.
    #[inline(always)]
    fn on_film(&self, x: f32, y: f32) -> [f32; 2] {
        [
            (2.0 * (x / self.size[0]) - 1.0) * self.half_extent[0],
            (1.0 - 2.0 * (y / self.size[1])) * self.half_extent[1],
        ]
    }

    /// The position on the film of the camera ray from `origin` with unit direction `d`; (0, 0) is the top left corner,
    /// (1, 1) the bottom right one. Not for panoramas.
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
        // Divide by the depth, except in a parallel projection
        let depth = match self.projection {
            Projection::Orthographic { .. } => {
                for axis in 0..3 {
                    d[axis] = origin[axis] - self.eye[axis];
                }
                1.0
            }
            _ => d[0] * f.x + d[1] * f.y + d[2] * f.z,
        };
        // Scale to the film
        let across = (d[0] * r.x + d[1] * r.y + d[2] * r.z) / (depth * self.half_extent[0]);
        let along = (d[0] * u.x + d[1] * u.y + d[2] * u.z) / (depth * self.half_extent[1]);
        [0.5 + 0.5 * across, 0.5 - 0.5 * along]
    }
}

/// Camera rays through points of the film, which are in pixels from its top left corner.
#[inline(always)]
fn camera_rays_body(camera: &CameraLanes, x: &Lanes, y: &Lanes, rays: &mut RayPacket) {
    match camera.projection {
        Projection::Perspective => still_rays::<Pinhole>(camera, x, y, rays),
        Projection::Orthographic { .. } => still_rays::<Parallel>(camera, x, y, rays),
        Projection::Equirectangular => still_rays::<Panorama>(camera, x, y, rays),
    }
}

#[inline(always)]
fn still_rays<P: FilmRay>(camera: &CameraLanes, x: &Lanes, y: &Lanes, rays: &mut RayPacket) {
    for l in 0..LANES {
        let [origin, d] = P::ray(camera, camera.on_film(x[l], y[l]));
        let inverse = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        for axis in 0..3 {
            rays.direction[axis][l] = d[axis] * inverse;
            rays.origin[axis][l] = origin[axis];
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
    match open.projection {
        Projection::Perspective => moving_rays::<Pinhole>([open, close], x, y, rays),
        Projection::Orthographic { .. } => moving_rays::<Parallel>([open, close], x, y, rays),
        Projection::Equirectangular => moving_rays::<Panorama>([open, close], x, y, rays),
    }
}

#[inline(always)]
fn moving_rays<P: FilmRay>(
    [open, close]: [&CameraLanes; 2],
    x: &Lanes,
    y: &Lanes,
    rays: &mut RayPacket,
) {
    for l in 0..LANES {
        // Find the ray at both ends of the exposure
        let end = rays.time[l] + 0.5;
        let [from, d_open] = P::ray(open, open.on_film(x[l], y[l]));
        let [to, d_close] = P::ray(close, close.on_film(x[l], y[l]));
        // Mix them by the time of the ray
        let mut d = [0.0; 3];
        for axis in 0..3 {
            d[axis] = (1.0 - end) * d_open[axis] + end * d_close[axis];
        }
        let inverse = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        for axis in 0..3 {
            rays.direction[axis][l] = d[axis] * inverse;
            rays.origin[axis][l] = from[axis] + end * (to[axis] - from[axis]);
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
        // Choose a point of the lens
        let [a, b] = disc([u[0][l], u[1][l]]).map(|v| v * lens.radius);
        let d = &mut rays.direction;
        // Aim at the point in focus
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

/// Moves the origins of `rays`, camera rays from the eye, to the left or the right eye: `side` is -1 or 1. Rays of a
/// camera with a finite convergence still pass through the same points of the plane at this distance. Each direction of
/// a panorama has its own pair of eyes, beside each other as seen along it (Peleg, Ben-Ezra and Pritch, "Omnistereo:
/// panoramic stereo imaging", 2001).
#[inline(always)]
fn stereo_rays_body(camera: &CameraLanes, side: &Lanes, rays: &mut RayPacket) {
    let Some(stereo) = camera.stereo else {
        return;
    };
    let (r, f) = (camera.right, camera.forward);
    let is_panorama = camera.projection.is_panorama();
    let converges = stereo.convergence < f32::INFINITY;
    for l in 0..LANES {
        // Move the ray to its eye
        let shift = side[l] * stereo.half_distance;
        let d = &mut rays.direction;
        let along = d[0][l] * f.x + d[1][l] * f.y + d[2][l] * f.z;
        let across = d[0][l] * r.x + d[1][l] * r.y + d[2][l] * r.z;
        // The level direction to the right of the ray
        let level = (along * along + across * across).sqrt();
        let inverse = if level > 0.0 { 1.0 / level } else { 0.0 };
        let is_turned = is_panorama && level > 0.0;
        let (cos, sin) = if is_turned { (along * inverse, across * inverse) } else { (1.0, 0.0) };
        // Aim at the point where the views of both eyes meet
        let distance = stereo.convergence / along;
        let (mut turned, mut square) = ([0.0; 3], 0.0);
        for axis in 0..3 {
            let offset = shift * (cos * r[axis] - sin * f[axis]);
            rays.origin[axis][l] += offset;
            turned[axis] = distance * d[axis][l] - offset;
            square += turned[axis] * turned[axis];
        }
        let inverse = 1.0 / square.sqrt();
        for axis in 0..3 {
            let converged = turned[axis] * inverse;
            d[axis][l] = if converges { converged } else { d[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn stereo_rays(camera: &CameraLanes, side: &Lanes, rays: &mut RayPacket) = stereo_rays_body;
}

/// Distances of the intersections of camera rays along the view axis, or along the rays if these are parallel or those
/// of a panorama; infinite without an intersection.
#[inline(always)]
fn depths_body(camera: &CameraLanes, rays: &RayPacket, hits: &Intersections, z: &mut Lanes) {
    let f = camera.forward;
    let d = &rays.direction;
    let is_perspective = matches!(camera.projection, Projection::Perspective);
    for l in 0..LANES {
        let along = d[0][l] * f.x + d[1][l] * f.y + d[2][l] * f.z;
        let along = if is_perspective { along } else { 1.0 };
        let is_hit = hits.mask >> l & 1 == 1;
        z[l] = if is_hit { hits.t[l] * along } else { f32::INFINITY };
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
