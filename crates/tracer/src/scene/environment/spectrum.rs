//! The spectrum of the sun, what the gases and aerosols of the atmosphere take of it, and its colour.
//!
//! The spectrum above the air and the optical depths are those of Preetham, Shirley and Smits, "A Practical Analytic Model
//! for Daylight", 1999, appendix 1. Colours are those of the CIE observer of 1931, by the fit of Wyman, Sloan and Shirley,
//! "Simple Analytic Approximations to the CIE XYZ Color Matching Functions", 2013.

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

/// Thickness of the ozone at normal pressure, cm.
const OZONE_CM: f64 = 0.35;

/// Exponent of the wavelength in the optical depth of aerosols (Angstrom).
const ANGSTROM: f64 = 1.3;

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

/// Number of wavelengths for which light is scattered, one every 30 nm from 390 nm on.
pub(super) const BANDS: usize = 12;

/// Rows of the tables per band. Band `i` is at row `1 + 3 i`.
const ROWS_PER_BAND: usize = 3;

/// A value for each band.
pub(super) type Spectrum = [f32; BANDS];

/// Optical depths of the whole atmosphere on a vertical path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OpticalDepths {
    /// Rayleigh scattering by molecules.
    pub(super) rayleigh: f64,
    /// Scattering and absorption by aerosols.
    pub(super) aerosols: f64,
    /// Absorption by ozone.
    pub(super) ozone: f64,
}

/// A wavelength, the irradiance of the sun above the air there, and the optical depths of the atmosphere.
struct Row {
    /// Of the sun, W/m2 in one step of the tables.
    irradiance: f64,
    /// The colour matching functions.
    observer: DVec3,
    depths: OpticalDepths,
}

/// The rows of the tables for air of a `turbidity`.
fn rows(turbidity: f64) -> impl Iterator<Item = Row> {
    let haze = (0.04608 * turbidity - 0.04586).max(0.0);
    RADIANCE.iter().enumerate().map(move |(row, radiance)| {
        let micrometres = FIRST + row as f64 * STEP;
        let ozone = row.checked_sub(OZONE_FIRST).map_or(0.0, |row| OZONE[row]);
        Row {
            irradiance: 100.0 * SOLID_ANGLE * radiance * 1e3 * STEP,
            observer: observed(1e3 * micrometres),
            depths: OpticalDepths {
                rayleigh: 0.008_735 * libm::pow(micrometres, -4.08),
                aerosols: haze * libm::pow(micrometres, -ANGSTROM),
                ozone: OZONE_CM * ozone,
            },
        }
    })
}

/// The bands for air of one turbidity.
#[derive(Debug, Clone)]
pub(super) struct Bands {
    /// Optical depths.
    pub(super) depths: [OpticalDepths; BANDS],
    /// Linear RGB of sunlight above the air in a band.
    rgb: [Vec3; BANDS],
}

impl Bands {
    /// The bands for air of a `turbidity`. A spectrum is linear between bands, and constant beyond the ends.
    pub(super) fn new(turbidity: f32) -> Self {
        let rows: Vec<Row> = rows(f64::from(turbidity)).collect();
        let mut xyz = [DVec3::ZERO; BANDS];
        for (index, row) in rows.iter().enumerate() {
            let place =
                (index.saturating_sub(1) as f64 / ROWS_PER_BAND as f64).min((BANDS - 1) as f64);
            let first = (index.saturating_sub(1) / ROWS_PER_BAND).min(BANDS - 2);
            let part = place - first as f64;
            let color = row.irradiance * row.observer;
            xyz[first] += (1.0 - part) * color;
            xyz[first + 1] += part * color;
        }
        Self {
            depths: std::array::from_fn(|band| rows[1 + ROWS_PER_BAND * band].depths),
            rgb: xyz.map(|xyz| (RGB_OF_XYZ * xyz).as_vec3()),
        }
    }

    /// Linear RGB of light, whose `spectrum` is a factor on that of the sun above the air. Components may be negative.
    pub(super) fn rgb(&self, spectrum: &Spectrum) -> Vec3 {
        spectrum.iter().zip(self.rgb).map(|(value, rgb)| *value * rgb).sum()
    }
}

/// Linear RGB (W/m2 of light that is weighted as the eye does) of the light of the sun above the air, after air of a
/// `turbidity` has left a part `transmittance` of it. Components may be negative.
pub(super) fn sunlight(turbidity: f32, transmittance: impl Fn(&OpticalDepths) -> f64) -> Vec3 {
    let terms = rows(f64::from(turbidity))
        .map(|row| transmittance(&row.depths) * row.irradiance * row.observer);
    (RGB_OF_XYZ * terms.sum::<DVec3>()).as_vec3()
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
    use spherule_tree::math::narrow;

    /// The observer sees light of equal energy as white of the chromaticity 1/3, 1/3.
    #[test]
    fn the_observer_is_normalised() {
        let sum: DVec3 = (360..830).map(|nm| observed(f64::from(nm))).sum();
        assert!((sum / sum.y - 1.0).abs().max_element() < 0.02, "{sum}");
        assert!((sum.y - 106.9).abs() < 1.0, "{sum}");
    }

    /// Bands have the colours of all rows, for white light and for that of a sun on the horizon, nearly all of it red.
    #[test]
    fn few_bands_have_the_colours_of_many() {
        for (turbidity, mass) in [(1.0, 0.0), (2.5, 1.0), (2.5, 10.0), (1.0, 38.0)] {
            let left = |depths: &OpticalDepths| {
                let OpticalDepths { rayleigh, aerosols, ozone } = depths;
                libm::exp(-mass * (rayleigh + aerosols + ozone))
            };
            let bands = Bands::new(turbidity);
            let found = bands.rgb(&bands.depths.map(|depths| narrow(left(&depths))));
            let expected = sunlight(turbidity, left);
            let error = (found - expected).abs().max_element();
            assert!(error < 0.06 * expected.max_element(), "{mass}: {found} {expected}");
        }
    }
}
