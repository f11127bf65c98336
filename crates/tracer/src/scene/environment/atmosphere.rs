//! The air along straight paths: molecules, aerosols and ozone around a spherical earth, without refraction.
//!
//! Densities of molecules and aerosols are exponential in the height. The air above a point on a slanted path is their
//! Chapman function, in the closed form for a scale height that is small beside the earth (Rishbeth and Garriott,
//! "Introduction to Ionospheric Physics", 1969). Ozone has the layer of Bruneton, "Precomputed Atmospheric Scattering: a
//! New Implementation", 2017.

use glam::Vec3;
use spherule_tree::math::functions::exp;
use spherule_tree::math::narrow;

use super::spectrum::{BANDS, OpticalDepths, Spectrum, sunlight};

/// Radius of the earth, km.
pub(super) const EARTH: f64 = 6371.0;

/// Height above which there is no air, km.
pub(super) const TOP: f64 = 100.0;

/// Scale height of the molecules, km.
const MOLECULES: f64 = 8.0;

/// Scale height of the aerosols, km.
const AEROSOLS: f64 = 1.2;

/// Heights of the lower end, the maximum and the upper end of the ozone, km. It is linear between them.
const OZONE: [f64; 3] = [10.0, 25.0, 40.0];

/// The part of the extinction by aerosols that is scattering. Bird and Riordan, "Simple Solar Spectral Model", 1986, have
/// 0.945 at 400 nm and 0.91 at 750 nm.
const ALBEDO_OF_AEROSOLS: f32 = 0.93;

/// Half of the apparent diameter of the sun, radians.
const SUN_RADIUS: f64 = 0.004_65;

/// Air along a path, in parts of the air on a vertical path from the ground; or densities, the same per km.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Air {
    pub(super) molecules: f64,
    pub(super) aerosols: f64,
    pub(super) ozone: f64,
}

impl Air {
    /// The densities at a `height` in km.
    pub(super) fn density(height: f64) -> Self {
        Self {
            molecules: libm::exp(-height / MOLECULES) / MOLECULES,
            aerosols: libm::exp(-height / AEROSOLS) / AEROSOLS,
            ozone: ozone_density(height),
        }
    }

    /// The air from `point` to space. The path may pass below the horizon, but not through the earth.
    pub(super) fn above(point: Point) -> Self {
        Self {
            molecules: exponential(point, MOLECULES),
            aerosols: exponential(point, AEROSOLS),
            ozone: ozone(point),
        }
    }

    /// The air between two points of a path.
    pub(super) fn between(first: Point, last: Point) -> Self {
        if last.rise < 0.0 {
            let [first, last] = [first, last].map(|point| Self::above(point.reversed()));
            last.minus(first)
        } else {
            Self::above(first).minus(Self::above(last))
        }
    }

    fn minus(self, other: Self) -> Self {
        Self {
            molecules: (self.molecules - other.molecules).max(0.0),
            aerosols: (self.aerosols - other.aerosols).max(0.0),
            ozone: (self.ozone - other.ozone).max(0.0),
        }
    }
}

/// Optical depths on a vertical path, by what they do to light.
#[derive(Debug, Clone)]
pub(super) struct Coefficients {
    /// Scattering by molecules.
    pub(super) rayleigh: Spectrum,
    /// Scattering by aerosols that counts as such.
    pub(super) wide: Spectrum,
    /// Forward scattering by aerosols, which does not.
    pub(super) forward: Spectrum,
    /// Absorption by aerosols, and scattering that counts as such.
    aerosols: Spectrum,
    /// Absorption by ozone.
    ozone: Spectrum,
}

impl Coefficients {
    /// Those of some optical depths, if a part `forward` of the light that aerosols scatter counts as not scattered.
    pub(super) fn new(depths: &[OpticalDepths; BANDS], forward: f32) -> Self {
        let aerosols = depths.each_ref().map(|depths| narrow(depths.aerosols));
        Self {
            rayleigh: depths.each_ref().map(|depths| narrow(depths.rayleigh)),
            wide: aerosols.map(|depth| (1.0 - forward) * ALBEDO_OF_AEROSOLS * depth),
            forward: aerosols.map(|depth| forward * ALBEDO_OF_AEROSOLS * depth),
            aerosols: aerosols.map(|depth| (1.0 - forward * ALBEDO_OF_AEROSOLS) * depth),
            ozone: depths.each_ref().map(|depths| narrow(depths.ozone)),
        }
    }

    /// What `air` leaves of light.
    #[inline(always)]
    pub(super) fn transmittance(&self, air: Air) -> Spectrum {
        let [molecules, aerosols, ozone] = [air.molecules, air.aerosols, air.ozone].map(narrow);
        std::array::from_fn(|band| {
            let depth = self.rayleigh[band] * molecules
                + self.aerosols[band] * aerosols
                + self.ozone[band] * ozone;
            exp(-depth)
        })
    }
}

/// A point of a straight path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    /// Distance from the centre of the earth, km.
    pub(super) radius: f64,
    /// Sine of the elevation of the path there.
    pub(super) rise: f64,
}

impl Point {
    /// The point of a path through the ground, at the given sine of its elevation.
    pub(super) const fn on_ground(rise: f64) -> Self {
        Self { radius: EARTH, rise }
    }

    /// The point at a `distance` along the path.
    pub(super) fn further(self, distance: f64) -> Self {
        let Self { radius, rise } = self;
        let square = radius * radius + distance * (2.0 * radius * rise + distance);
        let far = square.sqrt();
        Self { radius: far, rise: (radius * rise + distance) / far }
    }

    /// The distance along the path to where it leaves the sphere of a `radius`, which is not smaller.
    pub(super) fn distance_to(self, radius: f64) -> f64 {
        let along = self.radius * self.rise;
        let square = (radius * radius - self.radius * self.radius + along * along).max(0.0);
        square.sqrt() - along
    }

    /// The distance along the path to the ground, if it meets that.
    pub(super) fn distance_to_ground(self) -> Option<f64> {
        let along = self.radius * self.rise;
        let square = EARTH * EARTH - self.radius * self.radius + along * along;
        (along < 0.0 && square > 0.0).then(|| -along - square.sqrt())
    }

    /// Height above the ground, km.
    pub(super) fn height(self) -> f64 {
        self.radius - EARTH
    }

    /// The same point of the path in the other direction.
    fn reversed(self) -> Self {
        Self { rise: -self.rise, ..self }
    }

    /// The distance of the path from the centre of the earth, km. Those through the earth count as touching it.
    fn perigee(self) -> f64 {
        (self.radius * (1.0 - self.rise * self.rise).max(0.0).sqrt()).max(EARTH)
    }

    /// The part of the sun that the earth does not hide, if the path leads to the centre of the sun. It is smooth.
    pub(super) fn visible_sun(self) -> f64 {
        let ratio = (EARTH / self.radius).min(1.0);
        let horizon = -(1.0 - ratio * ratio).sqrt();
        let t = (0.5 + 0.5 * (self.rise - horizon) / SUN_RADIUS).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}

/// The air with an exponential density from a point to space.
fn exponential(point: Point, scale: f64) -> f64 {
    let rising = |radius: f64, rise: f64| {
        let x = 0.5 * radius / scale;
        let chapman = (std::f64::consts::PI * x).sqrt() * scaled_erfc(x.sqrt() * rise);
        libm::exp((EARTH - radius) / scale) * chapman
    };
    if point.rise >= 0.0 {
        rising(point.radius, point.rise)
    } else {
        2.0 * rising(point.perigee(), 0.0) - rising(point.radius, -point.rise)
    }
}

/// `exp(x^2) erfc(x)` for positive `x`, relative error 2e-7: the fit of Press and others, "Numerical Recipes", section 6.2.
fn scaled_erfc(x: f64) -> f64 {
    const FIT: [f64; 10] = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    let t = 1.0 / (1.0 + 0.5 * x);
    t * libm::exp(FIT.iter().rev().fold(0.0, |sum, term| sum * t + term))
}

/// Density of the ozone at a height in km. Its integral is 1.
fn ozone_density(height: f64) -> f64 {
    let [bottom, middle, top] = OZONE;
    let part = if height < middle {
        (height - bottom) / (middle - bottom)
    } else {
        (top - height) / (top - middle)
    };
    part.max(0.0) * 2.0 / (top - bottom)
}

/// The ozone from a point to space.
fn ozone(point: Point) -> f64 {
    if point.rise >= 0.0 {
        return rising_ozone(point);
    }
    let perigee = Point { radius: point.perigee(), rise: 0.0 };
    2.0 * rising_ozone(perigee) - rising_ozone(point.reversed())
}

/// The ozone on a rising path to space, by Simpson's rule on each side of the maximum.
fn rising_ozone(point: Point) -> f64 {
    let [_, middle, top] = OZONE;
    let mut sum = 0.0;
    let mut from = point.distance_to(EARTH + OZONE[0].max(point.height()));
    for end in [middle, top] {
        if point.height() < end {
            let to = point.distance_to(EARTH + end);
            let density = |distance| ozone_density(point.further(distance).height());
            sum += (to - from) / 6.0
                * (density(from) + 4.0 * density(0.5 * (from + to)) + density(to));
            from = to;
        }
    }
    sum
}

/// Irradiance (linear RGB, W/m2 of light that is weighted as the eye does) on a surface that faces the sun, whose elevation
/// has the sine `rise`, through air of a `turbidity`. A sun whose whole disc is below the horizon has none.
pub(super) fn sun_irradiance(rise: f64, turbidity: f32) -> Vec3 {
    let point = Point::on_ground(rise);
    let visible = point.visible_sun();
    if visible == 0.0 {
        return Vec3::ZERO;
    }
    let air = Air::above(point);
    let transmittance = |depths: &OpticalDepths| {
        let OpticalDepths { rayleigh, aerosols, ozone } = depths;
        let depth = rayleigh * air.molecules + aerosols * air.aerosols + ozone * air.ozone;
        visible * libm::exp(-depth)
    };
    sunlight(turbidity, transmittance).max(Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::environment::LUMINANCE;
    use crate::scene::environment::spectrum::Bands;

    /// Lumens per W of light that is weighted as the eye does.
    const LUMENS: f32 = 683.0;

    fn sine(elevation: f64) -> f64 {
        libm::sin(elevation.to_radians())
    }

    /// Closed forms against sums over many steps, with a path that passes below the horizon.
    #[test]
    fn the_air_on_a_path_is_the_integral_of_its_density() {
        for (height, elevation) in [
            (0.0, 90.0),
            (0.0, 20.0),
            (0.0, 3.0),
            (0.0, 0.0),
            (3.0, -1.5),
            (20.0, -4.0),
            (30.0, 10.0),
        ] {
            let start = Point { radius: EARTH + height, rise: sine(elevation) };
            let found = Air::above(start);
            let count = 100_000;
            let step = start.distance_to(EARTH + TOP) / f64::from(count);
            let sum = |of: fn(Air) -> f64| {
                let at = |i: u32| start.further((f64::from(i) + 0.5) * step).height();
                (0..count).map(|i| step * of(Air::density(at(i)))).sum::<f64>()
            };
            for (found, expected) in [
                (found.molecules, sum(|air| air.molecules)),
                (found.aerosols, sum(|air| air.aerosols)),
                (found.ozone, sum(|air| air.ozone)),
            ] {
                assert!(
                    (found - expected).abs() < 4e-3 * expected,
                    "{height} {elevation}: {found} {expected}"
                );
            }
        }
        assert!((Air::above(Point::on_ground(1.0)).ozone - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_air_between_two_points_is_a_difference() {
        // Down through the perigee, and up again
        let start = Point { radius: EARTH + 12.0, rise: sine(-3.0) };
        let way = start.distance_to(EARTH + TOP);
        for part in [0.1, 0.3, 0.7] {
            let middle = start.further(part * way);
            let [first, last] = [Air::between(start, middle), Air::above(middle)];
            let all = Air::above(start);
            for (first, last, all) in [
                (first.molecules, last.molecules, all.molecules),
                (first.aerosols, last.aerosols, all.aerosols),
                (first.ozone, last.ozone, all.ozone),
            ] {
                assert!((first + last - all).abs() < 5e-3 * all, "{part}: {first} {last} {all}");
            }
        }
    }

    /// What a vertical path leaves of light: the optical depths of Preetham and others for a turbidity of 2.5.
    #[test]
    fn transmittance_to_the_zenith_is_that_of_the_optical_depths() {
        let bands = Bands::new(2.5);
        let found =
            Coefficients::new(&bands.depths, 0.0).transmittance(Air::above(Point::on_ground(1.0)));
        // 420, 540 and 690 nm: molecules, aerosols and ozone
        for (band, depth) in [
            (1, 0.3009 + 0.2148 + 0.0),
            (5, 0.1080 + 0.1549 + 0.0263),
            (10, 0.0397 + 0.1123 + 0.0098),
        ] {
            let expected = libm::exp(-depth);
            assert!((f64::from(found[band]) - expected).abs() < 2e-3, "{band}: {found:?}");
        }
    }

    fn illuminance(elevation: f64, turbidity: f32) -> f32 {
        LUMENS * sun_irradiance(sine(elevation), turbidity).dot(LUMINANCE)
    }

    /// Direct light of clear days on a surface that faces the sun: about 100 klx with a high sun, 90 at 40 degrees, a third of
    /// that at 10, about one klx at 2.
    #[test]
    fn the_sun_is_as_bright_as_outdoors() {
        for (elevation, range) in
            [(80.0, 95e3..110e3), (42.0, 82e3..98e3), (10.0, 20e3..50e3), (2.0, 0.4e3..4e3)]
        {
            let found = illuminance(elevation, 2.5);
            assert!(range.contains(&found), "{elevation}: {found}");
        }
        assert!(illuminance(42.0, 8.0) < 0.6 * illuminance(42.0, 2.5));
        assert_eq!(illuminance(-0.3, 2.5), 0.0);
    }

    #[test]
    fn a_low_sun_is_red() {
        let ratio = |elevation: f64| {
            let [red, _, blue] = sun_irradiance(sine(elevation), 2.5).to_array();
            red / blue.max(1e-9)
        };
        let [high, low, dusk] = [60.0, 10.0, 2.0].map(ratio);
        assert!((1.0..1.6).contains(&high), "{high}");
        assert!(low > 1.6 * high && dusk > 3.0 * low, "{high} {low} {dusk}");
    }
}
