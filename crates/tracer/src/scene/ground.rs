//! An optional ground: an infinite, opaque, diffuse plane that receives shadows and fades into the background, so
//! that there is no hard horizon.
//!
//! It is visible and casts shadows from above only: a camera below it sees through it.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::sand::Lattice;
use super::texture::{Beyond, Footprint, Texture};
use super::{Bounds, sand};
use spherule_surface::{Plane, PlaneSettings};
use spherule_tree::math::{Lanes3, Supported, lanes_in, set_lane3, splat};
use spherule_tree::ray::Ray;

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

/// Distance at which a ground that reaches the horizon has faded out, in distances over which it fades otherwise: at the
/// height of the particles it is a hundredth of a degree below the horizon.
const HORIZON: f32 = 1000.0;

/// The part of the distance at which a far ground has faded out over which it does not fade.
const HAZELESS: f32 = 0.02;

/// Least cosine between a ray and the normal for the length of its cut with the ground.
const MIN_COSINE: f32 = 1e-3;

/// Colour in which a shadow catcher reflects light to the particles.
const CATCHER_COLOR: Vec3 = Vec3::splat(0.55);

/// A plane `dot(up, x) = height`.
#[derive(Debug, Clone, PartialEq)]
pub struct Ground {
    /// Unit normal.
    pub up: Vec3,
    /// Distance of the plane from the scene's origin along `up`.
    pub height: f32,
    /// Diffuse colour, linear RGB.
    pub color: Vec3,
    /// Centre of the fading.
    pub center: Vec3,
    /// Half the size of a box around `center` from which the distances of the fading count; zero for the centre itself.
    pub base: Vec3,
    /// Distance from the box up to which the ground is opaque.
    pub fade_start: f32,
    /// Distance from which on only the background is visible.
    pub fade_end: f32,
    /// Distance from the box within which the particles change the light on it.
    pub lit_range: f32,
    /// Pattern of the colour.
    pub pattern: Pattern,
    /// Strength of the shadows, 0 to 1, if camera rays see nothing but shadows on the ground: a shadow catcher. Only
    /// for path tracing.
    pub shadow_catcher: Option<f32>,
}

/// A pattern on the ground. Lengths are positive.
#[derive(Debug, Clone, PartialEq)]
pub enum Pattern {
    /// One colour.
    Plain,
    /// A checkerboard. Four corners meet at the centre of the ground.
    Checker {
        /// Edge of a square.
        tile: f32,
    },
    /// Sand: slightly lighter and darker spots of many sizes.
    Sand {
        /// Distance between the largest spots.
        tile: f32,
    },
    /// A picture.
    Image(GroundImage),
}

/// A picture on the ground. Seen from above, it is not mirrored: without a rotation, its rows run along the first of
/// [`Ground::axes`], and its columns, from the bottom up, along the second.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundImage {
    /// Its colours.
    pub texture: Arc<Texture>,
    /// Its width; the height follows from the shape of its pixels.
    pub width: f32,
    /// A point above its centre.
    pub center: Vec3,
    /// Rotation, counterclockwise as seen from above, radians.
    pub rotation: f32,
    /// Whether it is repeated; otherwise the plain colour of the ground is around it.
    pub repeats: bool,
}

/// What a ray sees of a ground: a point, and the part of the ground around it that it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundSample {
    /// The point.
    pub point: Vec3,
    /// Unit direction of the ray.
    pub direction: Vec3,
    /// Width of the ray at the point.
    pub width: f32,
}

/// Ground that fluid makes darker and glossy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WetGround {
    /// 0 is dry, 1 is physical.
    pub strength: f32,
    /// Distance from the fluid within which the ground is wet, about the radius of a particle. Positive.
    pub margin: f32,
}

impl Ground {
    /// A ground just below `bounds`, relative to `origin`.
    pub fn under(bounds: &Bounds, up: Vec3, origin: glam::DVec3) -> Self {
        let up = up.normalize_or(Vec3::Z);
        let relative = bounds.corners().map(|c| (c - origin).as_vec3());
        let height = relative.iter().map(|c| c.dot(up)).fold(f32::INFINITY, f32::min);
        let diagonal = (bounds.max - bounds.min).as_vec3().length();
        let center = (bounds.center() - origin).as_vec3();
        Self {
            up,
            height,
            color: DEFAULT_COLOR,
            center: center + (height - center.dot(up)) * up,
            base: Vec3::ZERO,
            fade_start: FADE_START * diagonal,
            fade_end: FADE_END * diagonal,
            lit_range: FADE_START * diagonal,
            pattern: Pattern::Plain,
            shadow_catcher: None,
        }
    }

    /// The shape that rays intersect.
    pub fn shape(&self) -> Plane {
        Plane::new(PlaneSettings {
            up: self.up,
            height: self.height,
            center: self.center,
            base: self.base,
            fade_start: self.fade_start,
            fade_end: self.fade_end,
        })
    }

    /// A shadow catcher with shadows of a `strength` from 0 to 1, in place of this ground.
    #[must_use]
    pub fn into_shadow_catcher(self, strength: f32) -> Self {
        Self {
            color: CATCHER_COLOR,
            pattern: Pattern::Plain,
            shadow_catcher: Some(strength),
            ..self
        }
    }

    /// Distance of a point of the ground from the box around its centre.
    fn distance(&self, point: Vec3) -> f32 {
        ((point - self.center).abs() - self.base).max(Vec3::ZERO).length()
    }

    /// Edge of a square around the centre, for what is computed on the ground near the particles.
    pub fn map_edge(&self) -> f32 {
        self.lit_range + 2.0 * self.base.max_element()
    }

    /// The same ground, which reaches the horizon, or fades out at the distance `haze`.
    #[must_use]
    pub fn reaching(self, haze: Option<f32>) -> Self {
        let horizon = HORIZON * (self.fade_end - self.fade_start);
        let fade_end = haze.unwrap_or(horizon).max(f32::MIN_POSITIVE);
        Self { fade_start: HAZELESS * fade_end, fade_end, ..self }
    }

    /// Whether a ray meets the ground where it has not begun to fade.
    pub fn is_opaque_at(&self, ray: &Ray) -> bool {
        let along = ray.direction.dot(self.up);
        let distance = (self.height - ray.origin.dot(self.up)) / along;
        let point = ray.origin + distance * ray.direction;
        distance > 0.0 && self.distance(point) <= self.fade_start
    }

    /// The colour at a `point` of the ground.
    pub fn color_at(&self, point: Vec3) -> Vec3 {
        let (direction, width) = (-self.up, 0.0);
        self.color(&GroundSample { point, direction, width })
    }

    /// The colour that a ray sees; only pictures are filtered.
    #[inline]
    pub fn color(&self, sample: &GroundSample) -> Vec3 {
        let point = sample.point;
        let place = |tile: f32| {
            let from_middle = (point - self.center) / tile;
            self.axes().map(|axis| from_middle.dot(axis))
        };
        match &self.pattern {
            Pattern::Image(image) => self.image_color(image, sample),
            Pattern::Plain => self.color,
            Pattern::Checker { tile } => {
                let [x, y] = place(*tile).map(floor);
                match (x ^ y) & 1 {
                    0 => self.color,
                    _ => DARKER_PART * self.color,
                }
            }
            Pattern::Sand { tile } => sand::shade(place(*tile)) * self.color,
        }
    }

    /// Sets the `colors` of `lanes` at the `points` of a ground of sand. Returns these lanes; none for other patterns.
    pub(crate) fn sand_colors(
        &self,
        simd: Supported,
        points: &Lanes3,
        lanes: u32,
        colors: &mut Lanes3,
    ) -> u32 {
        let tile = match self.pattern {
            Pattern::Sand { tile } if lanes != 0 => tile,
            _ => return 0,
        };
        let [across, along] = self.axes();
        let lattice = Lattice { center: self.center, tile, across, along };
        let mut shades = splat(0.0);
        sand::shades(simd, &lattice, points, &mut shades);
        for lane in lanes_in(lanes) {
            set_lane3(colors, lane, shades[lane] * self.color);
        }
        lanes
    }

    /// The colour of a picture on the ground.
    fn image_color(&self, image: &GroundImage, sample: &GroundSample) -> Vec3 {
        let [across, along] = self.axes();
        let (sin, cos) = (libm::sinf(image.rotation), libm::cosf(image.rotation));
        let [across, along] = [cos * across + sin * along, cos * along - sin * across];
        // In widths and heights from the top left corner
        let aspect = image.texture.aspect();
        let on_image = |v: Vec3| Vec2::new(v.dot(across), -v.dot(along) / aspect) / image.width;
        let position = on_image(sample.point - image.center) + 0.5;
        // The ground cuts a slanted ray at a greater length
        let cosine = sample.direction.dot(self.up);
        let forward = (sample.direction - cosine * self.up).normalize_or_zero();
        let length = sample.width / cosine.abs().max(MIN_COSINE);
        let footprint =
            Footprint { long: on_image(length * forward), short: sample.width / image.width };
        let beyond = if image.repeats { Beyond::Repeat } else { Beyond::Plain(self.color) };
        image.texture.color(position, &footprint, beyond)
    }

    /// Two perpendicular directions of the plane; coordinate axes if `up` is one.
    pub fn axes(&self) -> [Vec3; 2] {
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
    use spherule_tree::math::{LANES, SimdLevel, lane3, splat3};

    fn floor() -> Ground {
        let bounds = Bounds { min: DVec3::new(9.0, 9.0, 5.0), max: DVec3::new(11.0, 11.0, 6.0) };
        Ground::under(&bounds, Vec3::Z, DVec3::new(10.0, 10.0, 4.0))
    }

    #[test]
    fn ground_is_below_the_box() {
        let floor = floor();
        assert!((floor.height - 1.0).abs() < 1e-6);
        assert!((floor.center - Vec3::new(0.0, 0.0, 1.0)).length() < 1e-6);
    }

    #[test]
    fn sand_varies_around_its_colour() {
        let ground = Ground { pattern: Pattern::Sand { tile: 0.7 }, ..floor() };
        let shade = |i: i32, j: i32| {
            let point = ground.center + 0.013 * Vec3::new(i as f32, j as f32, 0.0);
            ground.color_at(point).x / ground.color.x
        };
        let shades: Vec<f32> = (0..10_000).map(|i| shade(i / 100 - 50, i % 100 - 50)).collect();
        let mean = shades.iter().sum::<f32>() / 1e4;
        let largest = shades.iter().fold(0.0_f32, |most, shade| most.max((shade - 1.0).abs()));
        assert!((mean - 1.0).abs() < 0.05, "{mean}");
        assert!((0.05..=sand::CONTRAST).contains(&largest), "{largest}");
        // A packet has the same shades, to the bit
        let points: [Vec3; LANES] = std::array::from_fn(|i| {
            ground.center + Vec3::new(0.31 * i as f32 - 2.0, 0.17 * i as f32, 0.0)
        });
        let lanes = [0, 1, 2].map(|axis| points.map(|point| point[axis]));
        for level in SimdLevel::ALL {
            let mut colors = splat3(Vec3::ZERO);
            let simd = Supported::or_best(level);
            assert_eq!(ground.sand_colors(simd, &lanes, 0xffff, &mut colors), 0xffff);
            for (lane, point) in points.iter().enumerate() {
                assert_eq!(lane3(&colors, lane), ground.color_at(*point));
            }
        }
        // Neighbours are alike, even far from the centre
        let far = ground.color_at(ground.center + 1e7 * Vec3::X);
        assert!(far.is_finite());
        assert!(
            (shade(0, 0) - ground.color_at(ground.center + 1e-5).x / ground.color.x).abs() < 1e-2
        );
    }

    /// A picture of 2 by 2 texels: red and green above blue and white.
    fn picture(repeats: bool, rotation: f32) -> Pattern {
        let pixels = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        Pattern::Image(GroundImage {
            texture: Arc::new(Texture::new(2, 2, &pixels).unwrap()),
            width: 4.0,
            center: floor().center + Vec3::new(1.0, 0.0, 7.0),
            rotation,
            repeats,
        })
    }

    #[test]
    fn pictures_lie_on_the_ground_as_seen_from_above() {
        // x to the right and y up, as seen from above
        let right_angle = std::f32::consts::FRAC_PI_2;
        for (rotation, corners) in [
            (0.0, [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE]),
            // The top left corner turns to the bottom left
            (right_angle, [Vec3::Y, Vec3::ONE, Vec3::X, Vec3::Z]),
        ] {
            let ground = Ground { pattern: picture(false, rotation), ..floor() };
            assert_eq!(ground.axes(), [Vec3::X, Vec3::Y]);
            let at = |x: f32, y: f32| ground.color_at(ground.center + Vec3::new(1.0 + x, y, 0.0));
            let found = [at(-1.0, 1.0), at(1.0, 1.0), at(-1.0, -1.0), at(1.0, -1.0)];
            for (found, wanted) in found.iter().zip(corners) {
                assert!((found - wanted).length() < 1e-5, "{rotation}: {found} {wanted}");
            }
            assert_eq!(at(0.0, 2.5), ground.color);
            assert_eq!(at(-2.5, 0.0), ground.color);
        }
        let ground = Ground { pattern: picture(true, 0.0), ..floor() };
        let at = |x: f32, y: f32| ground.color_at(ground.center + Vec3::new(1.0 + x, y, 0.0));
        for tile in [-4.0, 0.0, 8.0] {
            assert!((at(tile - 1.0, 1.0 - tile) - Vec3::X).length() < 1e-5);
        }
    }

    #[test]
    fn distant_pictures_are_blurred_along_the_ray() {
        let ground = Ground { pattern: picture(true, 0.0), ..floor() };
        let color = |direction: Vec3, width: f32| {
            let point = ground.center + Vec3::new(0.0, 1.0, 0.0);
            let direction = direction.normalize();
            ground.color(&GroundSample { point, direction, width })
        };
        assert!((color(Vec3::NEG_Z, 0.0) - Vec3::X).length() < 1e-5);
        let mean = Vec3::splat(0.5);
        assert!((color(Vec3::NEG_Z, 50.0) - mean).length() < 1e-2);
        // A slanted ray along x sees the upper row only, both of its texels
        let slanted = color(Vec3::new(1.0, 0.0, -0.01), 0.04);
        assert!((slanted - Vec3::new(0.5, 0.5, 0.0)).length() < 0.1, "{slanted}");
    }

    #[test]
    fn squares_alternate_around_the_middle() {
        for up in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_Z, Vec3::ONE.normalize()] {
            let mut floor = Ground { up, ..floor() };
            assert_eq!(floor.color_at(floor.center), floor.color);
            floor.pattern = Pattern::Checker { tile: 0.5 };
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
