//! An optional ground: an infinite, opaque, diffuse plane that receives shadows and fades into the background, so
//! that there is no hard horizon.
//!
//! It is visible and casts shadows from above only: a camera below it sees through it.

use glam::Vec3;

use super::Bounds;

/// Default colour of the ground (linear RGB): a dark grey that shows shadows and does not distract from the particles.
pub const DEFAULT_COLOR: Vec3 = Vec3::new(0.135, 0.140, 0.150);

/// Ambient reflectance of the ground. It is below everything, so it receives more of the sky than a particle inside a
/// cloud.
pub const AMBIENT: f32 = 0.2;

/// Diffuse reflectance of the ground, equal to the default `diffuse` of materials.
pub const DIFFUSE: f32 = 0.7;

/// Colour of the darker squares of a checkerboard, as a fraction of the colour of the ground.
const DARKER_PART: f32 = 0.35;

/// Default distance from the centre at which the ground starts to fade, in diagonals of the bounds.
const FADE_START: f32 = 1.5;

/// Default distance at which it has faded out.
const FADE_END: f32 = 6.0;

/// A plane `dot(up, x) = height`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Unit normal.
    pub up: Vec3,
    /// Distance of the plane from the scene's origin along `up`.
    pub height: f32,
    /// Diffuse colour, linear RGB.
    pub color: Vec3,
    /// Centre of the fading.
    pub center: Vec3,
    /// Distance from `center` up to which the ground is opaque.
    pub fade_start: f32,
    /// Distance from which on only the background is visible.
    pub fade_end: f32,
    /// Optional checkerboard.
    pub checker: Option<Checker>,
}

/// A checkerboard on the ground. Four corners meet at the centre of the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Checker {
    /// Edge of a square; positive.
    pub tile: f32,
}

impl Ground {
    /// A ground just below `bounds`, relative to `origin`.
    pub fn under(bounds: &Bounds, up: Vec3, origin: glam::DVec3) -> Self {
        let up = up.normalize_or(Vec3::Z);
        let relative = bounds.corners().map(|c| (c - origin).as_vec3());
        let height = relative
            .iter()
            .map(|c| c.dot(up))
            .fold(f32::INFINITY, f32::min);
        let diagonal = (bounds.max - bounds.min).as_vec3().length();
        let center = (bounds.center() - origin).as_vec3();
        Self {
            up,
            height,
            color: DEFAULT_COLOR,
            center: center + (height - center.dot(up)) * up,
            fade_start: FADE_START * diagonal,
            fade_end: FADE_END * diagonal,
            checker: None,
        }
    }

    /// The colour at a `point` of the ground.
    #[inline]
    pub fn color_at(&self, point: Vec3) -> Vec3 {
        let Some(checker) = self.checker else {
            return self.color;
        };
        let [across, along] = self.axes();
        let from_middle = (point - self.center) / checker.tile;
        let square = floor(from_middle.dot(across)) ^ floor(from_middle.dot(along));
        if square & 1 == 0 {
            self.color
        } else {
            DARKER_PART * self.color
        }
    }

    /// Two perpendicular directions of the plane; coordinate axes if `up` is one.
    fn axes(&self) -> [Vec3; 2] {
        let size = self.up.abs();
        let other_axis = if size.x >= size.y && size.x >= size.z {
            Vec3::Y
        } else if size.y >= size.z {
            Vec3::Z
        } else {
            Vec3::X
        };
        let across = (other_axis - other_axis.dot(self.up) * self.up).normalize();
        [across, self.up.cross(across)]
    }

    /// Moves the ground along `up`.
    pub fn raise(&mut self, by: f32) {
        self.center += by * self.up;
        self.height += by;
    }
}

/// The largest integer not above `value`; saturates. It avoids the function call that `floor` needs on machines
/// without such an instruction.
#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates, where squares are far smaller than rounding"
)]
fn floor(value: f32) -> i32 {
    let towards_zero = value as i32;
    towards_zero.saturating_sub(i32::from(value < towards_zero as f32))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn floor() -> Ground {
        let bounds = Bounds {
            min: DVec3::new(9.0, 9.0, 5.0),
            max: DVec3::new(11.0, 11.0, 6.0),
        };
        Ground::under(&bounds, Vec3::Z, DVec3::new(10.0, 10.0, 4.0))
    }

    #[test]
    fn lies_under_the_box_relative_to_the_origin() {
        let floor = floor();
        assert!((floor.height - 1.0).abs() < 1e-6);
        assert!((floor.center - Vec3::new(0.0, 0.0, 1.0)).length() < 1e-6);
    }

    #[test]
    fn squares_alternate_around_the_middle() {
        for up in [
            Vec3::X,
            Vec3::Y,
            Vec3::Z,
            Vec3::NEG_Z,
            Vec3::ONE.normalize(),
        ] {
            let mut floor = Ground { up, ..floor() };
            assert_eq!(floor.color_at(floor.center), floor.color);
            floor.checker = Some(Checker { tile: 0.5 });
            let [across, along] = floor.axes();
            let at = |x: f32, y: f32| floor.color_at(floor.center + x * across + y * along);
            let [light, dark] = [floor.color, DARKER_PART * floor.color];
            assert_eq!([at(0.1, 0.1), at(0.4, 0.3), at(-0.1, -0.4)], [light; 3]);
            assert_eq!([at(0.6, 0.1), at(-0.1, 0.2), at(0.3, -0.3)], [dark; 3]);
            assert_eq!(at(0.6, 0.7), light);
            assert!(across.dot(along).abs() < 1e-6 && across.dot(up).abs() < 1e-6);
        }
    }
}
