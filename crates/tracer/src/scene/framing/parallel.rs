//! Views that show all particles in orthographic projection and in panoramas.
//!
//! Without perspective, the size of the image follows from the extents of the spheres across the view.

use glam::DVec3;

use super::{Framed, Framing, ViewAxes, view_direction};
use crate::scene::camera::CameraView;

impl Framed {
    /// The orthographic view with all spheres in the middle of the image, and the height of the image in scene units.
    /// Nothing is behind the eye.
    pub fn parallel_view(&self, framing: &Framing) -> (CameraView, f64) {
        let axes = ViewAxes::new(framing);
        let screen_up = axes.right.cross(axes.direction);
        let center = self.bounds().center();
        let [[left, right], [bottom, top]] =
            [axes.right, screen_up].map(|axis| self.extent(center, axis));
        let look_at = center + 0.5 * ((left + right) * axes.right + (bottom + top) * screen_up);
        let view = CameraView {
            eye: look_at - self.far() * axes.direction,
            look_at,
            up: axes.up,
            fov: framing.fov,
        };
        let height = (top - bottom).max((right - left) / framing.aspect);
        (view, self.with_margin(height))
    }

    /// The height in scene units of an orthographic image from `view` that shows all spheres.
    pub fn height_around(&self, view: &CameraView, aspect: f64) -> f64 {
        let direction = (view.look_at - view.eye).normalize_or(DVec3::Y);
        let right = direction.cross(view.up).normalize_or(DVec3::X);
        let reach = |axis: DVec3| {
            let [low, high] = self.extent(view.look_at, axis);
            high.max(-low)
        };
        let half = reach(right.cross(direction)).max(reach(right) / aspect);
        self.with_margin(2.0 * half)
    }

    /// The view of a panorama from the centre of the particles.
    pub fn panorama(&self, framing: &Framing) -> CameraView {
        let up = framing.up.try_normalize().unwrap_or(DVec3::Z);
        let eye = self.bounds().center();
        CameraView {
            eye,
            look_at: eye + self.far() * view_direction(up, framing.azimuth, 0.0),
            up,
            fov: framing.fov,
        }
    }

    /// A distance from the centre of the particles at which there are none, in the order of their extent.
    pub(in crate::scene) fn far(&self) -> f64 {
        (self.bounds().diagonal() + 4.0 * self.radius).max(self.min_distance())
    }

    /// Height of the image of particles that turn around the up direction, in scene units, and height of its middle
    /// above their centre. `slant` is sine and cosine of the elevation.
    pub(in crate::scene) fn turning_height(&self, framing: &Framing, slant: [f64; 2]) -> [f64; 2] {
        let ([sin, cos], center) = (slant, self.bounds().center());
        let (mut low, mut high, mut half_width) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
        for point in self.points() {
            // The circle of a point is an ellipse in the image
            let relative = *point - center;
            let height = relative.dot(framing.up) * cos;
            let radius = relative.cross(framing.up).length();
            half_width = half_width.max(radius + self.radius);
            low = low.min(height - radius * sin.abs() - self.radius);
            high = high.max(height + radius * sin.abs() + self.radius);
        }
        let height = (high - low).max(2.0 * half_width / framing.aspect);
        [self.with_margin(height), 0.5 * (low + high) / cos]
    }

    /// The lowest and the highest position of a sphere along `axis`, from `center`.
    fn extent(&self, center: DVec3, axis: DVec3) -> [f64; 2] {
        let along = self.points.iter().map(|p| (*p - center).dot(axis));
        let [low, high] = along
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        [low - self.radius, high + self.radius]
    }

    /// The height of an image in which the particles have a height of `used`. A point alone has no size.
    fn with_margin(&self, used: f64) -> f64 {
        if used > 0.0 { used / self.used_part() } else { 2.0 * self.far() }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::framing::SPHERES_MARGIN;
    use crate::scene::{Camera, CameraPath, Projection};

    fn points() -> Vec<DVec3> {
        let point = |i: i32| {
            let t = f64::from(i);
            DVec3::new(libm::sin(t) * t, 0.3 * t, libm::cos(1.7 * t) * 9.0)
        };
        (0..40).map(point).collect()
    }

    /// Least and greatest position on the film of spheres, -1 to 1, across and upwards.
    fn extents(view: &CameraView, height: f64, aspect: f64, radius: f64) -> [[f64; 2]; 2] {
        let projection = Projection::Orthographic { height };
        let camera = Camera::projected(view, projection, aspect, DVec3::ZERO).unwrap();
        let forward = (view.look_at - view.eye).normalize();
        let right = forward.cross(view.up).normalize();
        let axes = [right / aspect, right.cross(forward)];
        axes.map(|axis| {
            let ends = points().into_iter().map(|point| {
                let along = (point - view.eye).dot(axis);
                let reach = radius * axis.length();
                assert!(camera.depth_of(point.as_vec3()) > 0.0);
                [along - reach, along + reach].map(|x| x / (0.5 * height))
            });
            ends.fold([9.0, -9.0], |[low, high]: [f64; 2], end| [low.min(end[0]), high.max(end[1])])
        })
    }

    #[test]
    fn orthographic_views_fit_and_are_centred() {
        let limit = 1.0 - SPHERES_MARGIN;
        for (radius, aspect) in [(0.0, 1.5), (2.0, 1.5), (2.0, 0.4), (5.0, 3.0)] {
            let framed = Framed::spheres(points(), radius);
            for elevation in [0.0, 20.0, 90.0, -90.0] {
                let framing = Framing { elevation, ..Framing::three_quarter(DVec3::Z, aspect) };
                let (view, height) = framed.parallel_view(&framing);
                let sides = extents(&view, height, aspect, radius);
                for [low, high] in sides {
                    assert!((low + high).abs() < 1e-9, "{framing:?}: {sides:?}");
                }
                let most = sides[0][1].max(sides[1][1]);
                assert!((most - limit).abs() < 1e-9, "{framing:?}: {sides:?}");
                // From the same direction, the size is the same
                let around = framed.height_around(&view, aspect);
                assert!((around / height - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn turntables_fit_from_all_sides() {
        let limit = 1.0 - SPHERES_MARGIN;
        for (elevation, aspect) in [(0.0, 1.5), (25.0, 0.6), (-40.0, 1.0)] {
            let framing = Framing { elevation, ..Framing::three_quarter(DVec3::Z, aspect) };
            let framed = Framed::spheres(points(), 0.5);
            let (path, height) = CameraPath::parallel_turntable(&framed, &framing, 1.0);
            let mut most = 0.0_f64;
            for frame in 0..360 {
                for [low, high] in extents(&path.view(frame), height, aspect, 0.5) {
                    most = most.max(high).max(-low);
                }
            }
            assert!(most < limit + 1e-9 && most > limit - 1e-3, "{framing:?}: {most}");
        }
    }

    /// Rounded components of the direction of a view, and of what is to the right in its image.
    fn axes(up: DVec3, angles: [f64; 2]) -> [[f64; 3]; 2] {
        let framing =
            Framing { azimuth: angles[0], elevation: angles[1], ..Framing::three_quarter(up, 1.0) };
        let (view, _) = Framed::spheres(points(), 1.0).parallel_view(&framing);
        let forward = (view.look_at - view.eye).normalize();
        let right = forward.cross(view.up).normalize();
        [forward, right].map(|axis| axis.to_array().map(|x| (1e3 * x).round() / 1e3 + 0.0))
    }

    #[test]
    fn views_along_axes_are_exact() {
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let minus = |axis: [f64; 3]| axis.map(|v| 0.0 - v);
        for (angles, forward, right) in [
            ([0.0, 0.0], y, x),
            ([180.0, 0.0], minus(y), minus(x)),
            ([90.0, 0.0], minus(x), y),
            ([-90.0, 0.0], x, minus(y)),
            ([0.0, 90.0], minus(z), x),
            ([0.0, -90.0], z, x),
        ] {
            assert_eq!(axes(DVec3::Z, angles), [forward, right], "{angles:?}");
        }
        assert_eq!(axes(DVec3::Y, [0.0, 0.0]), [minus(z), x]);
        assert_eq!(axes(DVec3::Y, [0.0, 90.0]), [minus(y), x]);
    }

    #[test]
    fn a_point_has_views_too() {
        for at in [DVec3::ZERO, DVec3::splat(1e7)] {
            let framed = Framed::spheres(vec![at], 0.0);
            let framing = Framing::three_quarter(DVec3::Z, 2.0);
            let (view, height) = framed.parallel_view(&framing);
            let projection = Projection::Orthographic { height };
            assert!(Camera::projected(&view, projection, 2.0, at).is_ok());
            let view = framed.panorama(&framing);
            assert!(Camera::projected(&view, Projection::Equirectangular, 2.0, at).is_ok());
            assert_eq!(view.eye, at);
        }
    }
}
