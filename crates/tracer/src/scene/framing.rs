//! Views that show all particles.
//!
//! The side planes of the view frustum must touch the particles on both sides. Let `x` and `d` be the position of a
//! point across and along the view, and `t` the half extent. Then `|x - c| <= t (D + d)` for all points has its minimum
//! `D` at `c` midway between the outermost `x - t d` and `x + t d`. A sphere of radius `r` needs `r sqrt(1 + t^2)` more
//! than its centre.

use glam::{DVec2, DVec3};

use super::Bounds;
use super::camera::{CameraView, DEFAULT_FOV};

mod parallel;

/// Margin around a box as a fraction of half the width and height of the image.
pub const BOX_MARGIN: f64 = 0.08;

/// Margin around spheres, the same: 6.5 % of the width or the height.
pub const SPHERES_MARGIN: f64 = 0.13;

/// Azimuth of the default view in degrees: shows two sides of a box in unequal proportions.
pub const DEFAULT_AZIMUTH: f64 = 30.0;

/// Elevation of the default view in degrees: high enough to show the top of the material.
pub const DEFAULT_ELEVATION: f64 = 20.0;

/// The direction of a view, and the shape of its image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    /// The up direction of the world.
    pub up: DVec3,
    /// Rotation about `up` in degrees; 0 looks along +y if `up` is z, along -z if `up` is y.
    pub azimuth: f64,
    /// Elevation above the horizon in degrees; 90 looks straight down.
    pub elevation: f64,
    /// Vertical field of view in degrees; only for perspective.
    pub fov: f64,
    /// Width of the image divided by its height.
    pub aspect: f64,
}

impl Framing {
    /// The default three-quarter view.
    pub const fn three_quarter(up: DVec3, aspect: f64) -> Self {
        Self {
            up,
            azimuth: DEFAULT_AZIMUTH,
            elevation: DEFAULT_ELEVATION,
            fov: DEFAULT_FOV,
            aspect,
        }
    }
}

/// What a view shows: spheres of one radius.
#[derive(Debug, Clone, PartialEq)]
pub struct Framed {
    /// Centres of the outermost spheres, world units.
    points: Vec<DVec3>,
    radius: f64,
    /// Whether the image of the points is centred, too; otherwise only the nearest view is used.
    is_centred: bool,
}

impl Framed {
    /// The corners of a box.
    pub fn corners(bounds: &Bounds) -> Self {
        Self { points: bounds.corners().to_vec(), radius: 0.0, is_centred: false }
    }

    /// Spheres of a `radius` around `points`, which are not empty. Their image has equal margins on opposite sides.
    pub fn spheres(points: Vec<DVec3>, radius: f64) -> Self {
        Self { points, radius, is_centred: true }
    }

    /// The box of the points.
    pub(super) fn bounds(&self) -> Bounds {
        let first = self.points.first().copied().unwrap_or_default();
        let points = self.points.iter();
        let (min, max) = points.fold((first, first), |(min, max), p| (min.min(*p), max.max(*p)));
        Bounds { min, max }
    }

    pub(super) fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// What a sphere needs more than its centre across the view, for a half extent of `t`.
    pub(super) fn reach(&self, t: f64) -> f64 {
        self.radius * libm::hypot(1.0, t)
    }

    /// The nearest view with all spheres in the image, with a margin of [`BOX_MARGIN`] or [`SPHERES_MARGIN`]. Also
    /// works for a single point, and for points in a plane.
    pub fn view(&self, framing: &Framing) -> CameraView {
        // Find the axes of the view
        let axes = ViewAxes::new(framing);
        let ViewAxes { right, direction, .. } = axes;
        let screen_up = right.cross(direction);
        let half = self.half_extent(framing);

        // Fit the spheres horizontally and vertically, and use the larger distance
        let bounds = self.bounds();
        let center = bounds.center();
        let along = |axis: DVec3| -> Vec<[f64; 2]> {
            let relative = self.points.iter().map(|p| *p - center);
            relative.map(|p| [p.dot(axis), p.dot(direction)]).collect()
        };
        let sides = [(along(right), half.x), (along(screen_up), half.y)];
        let fits = sides.each_ref().map(|(places, t)| fit(places, self.reach(*t), *t));
        let distance = fits[0].1.max(fits[1].1).max(self.min_distance());
        // Move to equal margins on both sides
        let mut shift = fits.map(|(shift, _)| shift);
        if self.is_centred {
            for (shift, (places, t)) in shift.iter_mut().zip(&sides) {
                *shift = centred(places, self.reach(*t), distance, *shift);
            }
        }
        let look_at = center + shift[0] * right + shift[1] * screen_up;
        CameraView { eye: look_at - distance * direction, look_at, up: axes.up, fov: framing.fov }
    }

    /// Half the extent of the image at distance 1, horizontally and vertically, without the margin.
    pub(super) fn half_extent(&self, framing: &Framing) -> DVec2 {
        let half_height = libm::tan(0.5 * framing.fov.to_radians()) * self.used_part();
        DVec2::new(half_height * framing.aspect, half_height)
    }

    /// The part of the height or the width of the image that the particles may fill.
    fn used_part(&self) -> f64 {
        if self.is_centred { 1.0 - SPHERES_MARGIN } else { 1.0 - BOX_MARGIN }
    }

    /// Minimum distance for a single point, which would otherwise be fitted at distance 0.
    pub(super) fn min_distance(&self) -> f64 {
        let bounds = self.bounds();
        // A point has no scale except that of its coordinates.
        if bounds.diagonal() > 0.0 || self.radius > 0.0 {
            0.0
        } else {
            (1e-3 * bounds.center().length()).max(1.0)
        }
    }
}

/// Shift across the view and distance along it at which all `places` lie within the half extent `t`, with spheres that
/// need `reach` more. Places are positions across and along the view.
fn fit(places: &[[f64; 2]], reach: f64, t: f64) -> (f64, f64) {
    let mut high = f64::NEG_INFINITY;
    let mut low = f64::INFINITY;
    for [x, d] in places {
        high = high.max(x - t * d);
        low = low.min(x + t * d);
    }
    (0.5 * (high + low), (0.5 * (high - low) + reach) / t)
}

/// Number of halvings of an interval: more than the bits of a number.
const HALVINGS: usize = 64;

/// Shift across the view at which the image has equal margins on both sides, from a `distance`. `start` is a shift at
/// which all places are in the image.
fn centred(places: &[[f64; 2]], reach: f64, distance: f64, start: f64) -> f64 {
    // The difference of the image's outermost places falls with the shift
    let difference = |shift: f64| {
        let ends = places.iter().map(|[x, d]| {
            let depth = distance + d;
            [(x - reach - shift) / depth, (x + reach - shift) / depth]
        });
        let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], end| {
            [low.min(end[0]), high.max(end[1])]
        });
        low + high
    };
    let xs = places.iter().map(|[x, _]| *x);
    let (mut low, mut high) =
        xs.fold((start, start), |(low, high), x| (low.min(x - reach), high.max(x + reach)));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if difference(middle) > 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The axes of a view.
struct ViewAxes {
    right: DVec3,
    direction: DVec3,
    /// The direction that points up in the image: that of the framing, unless the view is along it.
    up: DVec3,
}

/// Elevation in degrees beyond which the up direction of a view is not that of the framing.
const STEEP: f64 = 89.5;

impl ViewAxes {
    fn new(framing: &Framing) -> Self {
        let Framing { azimuth, elevation, .. } = *framing;
        let up = framing.up.try_normalize().unwrap_or(DVec3::Z);
        if elevation.abs() < STEEP {
            let direction = view_direction(up, azimuth, elevation);
            let right = direction.cross(up).try_normalize().unwrap_or(DVec3::X);
            return Self { right, direction, up };
        }
        // The direction to the right does not depend on the elevation
        let right = view_direction(up, azimuth, 0.0).cross(up);
        let direction = -elevation.signum() * up;
        Self { right, direction, up: right.cross(direction) }
    }
}

/// View direction of a camera at `azimuth` and `elevation` (degrees) about `up`.
pub fn view_direction(up: DVec3, azimuth: f64, elevation: f64) -> DVec3 {
    let elevation = elevation.to_radians();
    let azimuth = azimuth.to_radians();
    let hint = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let right = (hint - hint.dot(up) * up).normalize();
    let front = right.cross(up);
    let level = libm::cos(azimuth) * front + libm::sin(azimuth) * right;
    -(libm::cos(elevation) * level + libm::sin(elevation) * up)
}

/// The azimuth in degrees, about `up`, of the side from which a camera looks against the direction `toward` it.
pub fn azimuth_toward(up: DVec3, toward: DVec3) -> f64 {
    let [front, right] = [0.0, 90.0].map(|azimuth| -view_direction(up, azimuth, 0.0));
    libm::atan2(toward.dot(right), toward.dot(front)).to_degrees()
}

#[cfg(test)]
#[path = "framing_tests.rs"]
mod tests;
