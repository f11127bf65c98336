//! The thin lens of a camera: size of the aperture, and the distance that is in focus.
//!
//! A point at distance `z` along the view axis is seen through the whole aperture, of diameter `a`. On the plane in
//! focus, at distance `f`, its image is a disc of the diameter `a |z - f| / z`, the circle of confusion (Potmesil and
//! Chakravarty, "A lens and aperture camera model for synthetic image generation", 1981). The field of view does not
//! depend on the focus.

use glam::DVec3;

use super::camera::{CameraError, CameraView, Lens};

/// Default width of the sensor: that of a 35 mm film still, if lengths are in metres.
pub const DEFAULT_SENSOR_WIDTH: f64 = 0.036;

/// The lens of a sequence of images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensSettings {
    /// Size of the aperture.
    pub aperture: Aperture,
    /// What is in focus.
    pub focus: Focus,
}

/// Size of an aperture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aperture {
    /// The diameter is the focal length divided by the f-number.
    FStop {
        /// The f-number, above 0.
        f_stop: f64,
        /// Width of the sensor in scene units; gives the focal length of a field of view.
        sensor_width: f64,
    },
    /// The diameter in scene units.
    Diameter(f64),
}

/// What a lens focuses on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Focus {
    /// The point that the camera looks at.
    Target,
    /// A distance along the view axis in scene units.
    Distance(f64),
    /// The particle with this id.
    Particle(u32),
}

impl LensSettings {
    /// The lens of a camera at `view`, for images with `aspect` = width / height. `particle` is the position of the
    /// particle in focus, in world units; without one, the target is in focus instead.
    ///
    /// # Errors
    /// If the focus is not in front of the camera, or if a length is out of range in single precision.
    pub fn lens(
        &self,
        view: &CameraView,
        aspect: f64,
        particle: Option<DVec3>,
    ) -> Result<Lens, CameraError> {
        // Find the distance of the plane in focus
        let focus = match (self.focus, particle) {
            (Focus::Distance(distance), _) => distance,
            (Focus::Particle(_), Some(point)) => {
                (view.look_at - view.eye).normalize_or_zero().dot(point - view.eye)
            }
            (Focus::Target | Focus::Particle(_), _) => (view.look_at - view.eye).length(),
        };
        // Find the radius of the lens, and check both
        let radius = 0.5 * self.aperture.diameter(view.fov, aspect);
        #[expect(clippy::cast_possible_truncation, reason = "the renderer works in f32")]
        let [radius, focus] = [radius as f32, focus as f32];
        if !(focus > 0.0 && focus.is_finite()) {
            return Err(CameraError::Focus);
        }
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(CameraError::Aperture);
        }
        Ok(Lens { radius, focus })
    }

    /// The particle in focus.
    pub const fn particle(&self) -> Option<u32> {
        match self.focus {
            Focus::Particle(id) => Some(id),
            Focus::Target | Focus::Distance(_) => None,
        }
    }
}

impl Aperture {
    /// The diameter in scene units for a vertical field of view of `fov` degrees.
    fn diameter(self, fov: f64, aspect: f64) -> f64 {
        match self {
            Self::Diameter(diameter) => diameter,
            Self::FStop { f_stop, sensor_width } => {
                let sensor_height = sensor_width / aspect;
                let focal_length = 0.5 * sensor_height / libm::tan(0.5 * fov.to_radians());
                focal_length / f_stop
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> CameraView {
        CameraView {
            eye: DVec3::new(0.0, -10.0, 0.0),
            look_at: DVec3::new(0.0, -4.0, 0.0),
            up: DVec3::Z,
            fov: 53.130_102,
        }
    }

    #[test]
    fn an_f_number_is_the_focal_length_in_diameters() {
        let settings = LensSettings {
            aperture: Aperture::FStop { f_stop: 2.0, sensor_width: 0.036 },
            focus: Focus::Target,
        };
        // The sensor is 24 mm high, and the tangent of half the field of view is 1/2: the focal length is 24 mm.
        let lens = settings.lens(&view(), 1.5, None).unwrap();
        assert!((lens.radius - 0.006).abs() < 1e-7, "{lens:?}");
        assert_eq!(lens.focus, 6.0);
    }

    #[test]
    fn focus_is_measured_along_the_view() {
        let lens = |focus, particle| {
            let aperture = Aperture::Diameter(0.5);
            LensSettings { aperture, focus }.lens(&view(), 1.0, particle)
        };
        assert_eq!(lens(Focus::Distance(3.0), None).unwrap().focus, 3.0);
        let beside = DVec3::new(7.0, -2.0, 1.0);
        let followed = lens(Focus::Particle(4), Some(beside)).unwrap();
        assert_eq!((followed.radius, followed.focus), (0.25, 8.0));
        let behind = DVec3::new(0.0, -11.0, 0.0);
        let error = lens(Focus::Particle(4), Some(behind)).unwrap_err();
        assert_eq!(error, CameraError::Focus);
        let huge = LensSettings { aperture: Aperture::Diameter(1e300), focus: Focus::Target };
        assert_eq!(huge.lens(&view(), 1.0, None).unwrap_err(), CameraError::Aperture);
    }
}
