//! The light of the sun below the atmosphere.
//!
//! Its spectrum above the air, and what molecules, aerosols and ozone leave of it: Preetham, Shirley and Smits, "A
//! Practical Analytic Model for Daylight", 1999, appendix 1. Colours are those of the CIE observer of 1931, by the fit of
//! Wyman, Sloan and Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions", 2013.

use glam::{DMat3, DVec3, Vec3};

/// Wavelength of the first row of the tables, micrometres.
const FIRST: f64 = 0.38;

/// The step between rows, micrometres.
const STEP: f64 = 0.01;

/// Radiance of the sun above the air, 100 W/(m2 nm sr).
const RADIANCE: [f64; 38] = [
    165.5, 162.3, 211.2, 258.8, 258.2, 242.3, 267.6, 296.6, 305.4, 300.6, 306.6, 288.3, 287.1,
    278.2, 271.0, 272.3, 263.6, 255.0, 250.6, 253.1, 253.5, 251.3, 246.3, 241.7, 236.8, 232.1,
    228.2, 223.4, 219.7, 215.3, 211.0, 207.3, 202.4, 198.7, 194.3, 190.7, 186.3, 182.6,
];

/// Solid angle of the sun, steradians.
const SOLID_ANGLE: f64 = 6.807e-5;

/// Absorption of ozone from row [`OZONE_FIRST`] on, per cm.
const OZONE: [f64; 31] = [
    0.003, 0.006, 0.009, 0.014, 0.021, 0.03, 0.04, 0.048, 0.063, 0.075, 0.085, 0.103, 0.12, 0.12,
    0.115, 0.125, 0.12, 0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036, 0.028, 0.023, 0.018, 0.014,
    0.011, 0.010, 0.009,
];

/// The row of 450 nm.
const OZONE_FIRST: usize = 7;

/// Thickness of the ozone, cm.
const OZONE_CM: f64 = 0.35;

/// From XYZ to linear RGB (Rec. 709).
const RGB_OF_XYZ: DMat3 = DMat3::from_cols_array(&[
    3.240_454_2,
    -0.969_266_0,
    0.055_643_4, //
    -1.537_138_5,
    1.876_010_8,
    -0.204_025_9, //
    -0.498_531_4,
    0.041_556_0,
    1.057_225_2,
]);

/// Irradiance (linear RGB, W/m2 of light that is weighted as the eye does) on a surface that faces the sun, whose elevation
/// has the sine `height`, through air of a `turbidity`. It has the unit of the model of the sky.
pub(super) fn sun_irradiance(height: f32, turbidity: f32) -> Vec3 {
    // The way of the light through the air, in thicknesses of the atmosphere (Kasten, 1965)
    let elevation = libm::asin(f64::from(height).clamp(0.0, 1.0)).to_degrees();
    let mass =
        1.0 / (libm::sin(elevation.to_radians()) + 0.15 * libm::pow(elevation + 3.885, -1.253));
    let haze = (0.04608 * f64::from(turbidity) - 0.04586).max(0.0);
    let mut xyz = DVec3::ZERO;
    for (row, radiance) in RADIANCE.iter().enumerate() {
        let micrometres = FIRST + row as f64 * STEP;
        let ozone = row.checked_sub(OZONE_FIRST).map_or(0.0, |row| OZONE[row]);
        let depth = 0.008_735 * libm::pow(micrometres, -4.08)
            + haze * libm::pow(micrometres, -1.3)
            + OZONE_CM * ozone;
        let irradiance = 100.0 * SOLID_ANGLE * radiance * libm::exp(-depth * mass);
        xyz += 1e3 * STEP * irradiance * observed(1e3 * micrometres);
    }
    (RGB_OF_XYZ * xyz).max(DVec3::ZERO).as_vec3()
}

/// The colour matching functions at a wavelength in nm.
fn observed(wavelength: f64) -> DVec3 {
    let lobe = |peak: f64, [below, above]: [f64; 2]| {
        let width = if wavelength < peak { below } else { above };
        let t = (wavelength - peak) / width;
        libm::exp(-0.5 * t * t)
    };
    DVec3::new(
        1.056 * lobe(599.8, [37.9, 31.0]) + 0.362 * lobe(442.0, [16.0, 26.7])
            - 0.065 * lobe(501.1, [20.4, 26.2]),
        0.821 * lobe(568.8, [46.9, 40.5]) + 0.286 * lobe(530.9, [16.3, 31.1]),
        1.217 * lobe(437.0, [11.8, 36.0]) + 0.681 * lobe(459.0, [26.0, 13.8]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::environment::LUMINANCE;
    use spherule_tree::math::narrow;

    /// Lumens per W of light that is weighted as the eye does.
    const LUMENS: f32 = 683.0;

    fn illuminance(elevation: f64, turbidity: f32) -> f32 {
        let height = narrow(libm::sin(elevation.to_radians()));
        LUMENS * sun_irradiance(height, turbidity).dot(LUMINANCE)
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
    }

    #[test]
    fn a_low_sun_is_red() {
        let ratio = |elevation: f64| {
            let [red, _, blue] =
                sun_irradiance(narrow(libm::sin(elevation.to_radians())), 2.5).to_array();
            red / blue
        };
        let [high, low, dusk] = [60.0, 10.0, 2.0].map(ratio);
        assert!((1.0..1.6).contains(&high), "{high}");
        assert!(low > 1.6 * high && dusk > 3.0 * low, "{high} {low} {dusk}");
    }

    /// The observer sees light of equal energy as white of the chromaticity 1/3, 1/3.
    #[test]
    fn the_observer_is_normalised() {
        let sum: DVec3 = (360..830).map(|nm| observed(f64::from(nm))).sum();
        assert!((sum / sum.y - 1.0).abs().max_element() < 0.02, "{sum}");
        assert!((sum.y - 106.9).abs() < 1.0, "{sum}");
    }
}
