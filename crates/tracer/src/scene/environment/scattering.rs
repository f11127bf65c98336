//! The light that the air of a clear day scatters towards a point on the ground.
//!
//! Rays are marched through the air for a dozen wavelengths. At each point they gather the light of the sun that is
//! scattered once, with the phase functions of molecules and aerosols, and the light that has been scattered before
//! (`multiple.rs`), which is scattered evenly.
//!
//! A part of the light that aerosols scatter goes on in nearly the same direction. It counts as not scattered for what comes
//! after it (Joseph, Wiscombe and Weinman, "The Delta-Eddington Approximation for Radiative Flux Transfer", 1976). Beside
//! the light that is scattered once, rays gather what was scattered forward before, with a wider phase function.

use std::f32::consts::PI;

use glam::Vec3;
use spherule_tree::math::functions::exp;
use spherule_tree::math::narrow;

use super::atmosphere::{Air, Coefficients, EARTH, Point, TOP};
use super::multiple::{ScatteredBefore, steps};
use super::spectrum::{BANDS, Bands, Spectrum};

/// Weights and asymmetries of the lobes of the phase function of aerosols (Henyey and Greenstein, 1941). They are fitted to
/// Mie scattering by spheres of 0.02 to 10 micrometres, in numbers `r^-4.3` (Junge's distribution for the exponent of the
/// optical depth, 1.3), of refractive index `1.5 + 0.007i`, at 550 nm: within 15 % from 1.5 to 178 degrees.
const LOBES: [(f32, f32); 3] = [(0.037, 0.943), (0.936, 0.637), (0.027, -0.575)];

/// The part of the light scattered by aerosols that counts as not scattered. With this one and [`WIDE`], the radiance of
/// the sky is within 10 % of that of a Monte Carlo simulation for a turbidity of 2.5, and 30 % for one of 6.
const FORWARD: f32 = 0.2;

/// Asymmetry of the scattering of light that has been scattered forward.
const WIDE: f32 = 0.5;

/// Points of a ray.
const STEPS: usize = 32;

/// Light from a direction.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Scattered {
    /// Radiance, linear RGB.
    pub(super) even: Vec3,
    /// Radiance to be multiplied by [`halo`], linear RGB.
    pub(super) halo: Vec3,
}

/// The air of a day, and the sun.
#[derive(Debug)]
pub(super) struct Scattering {
    bands: Bands,
    coefficients: Coefficients,
    before: ScatteredBefore,
    /// Sine of the elevation of the sun.
    rise: f64,
}

/// A ray from the ground, with what does not depend on its angle from the sun.
pub(super) struct SkyRay {
    points: Vec<RayPoint>,
}

/// A point of a ray.
struct RayPoint {
    /// From the ground, km.
    distance: f64,
    point: Point,
    /// The air between it and the ground.
    air: Air,
    /// Scattering at the point, and what comes to the ground of it: by molecules.
    molecules: Spectrum,
    /// By aerosols.
    aerosols: Spectrum,
}

impl Scattering {
    /// The air of a `turbidity` above ground of an `albedo`, with the sun at an `elevation` in radians.
    pub(super) fn new(elevation: f64, turbidity: f32, albedo: f32) -> Self {
        let bands = Bands::new(turbidity);
        Self {
            coefficients: Coefficients::new(&bands.depths, FORWARD),
            before: ScatteredBefore::new(&bands.depths, elevation, albedo),
            rise: libm::sin(elevation),
            bands,
        }
    }

    /// The ray from the ground at the sine of an elevation.
    pub(super) fn ray(&self, rise: f64) -> SkyRay {
        let start = Point::on_ground(rise);
        let Coefficients { rayleigh, wide, .. } = &self.coefficients;
        let points = steps(start.distance_to(EARTH + TOP), STEPS).map(|[distance, length]| {
            let point = start.further(distance);
            let air = Air::between(start, point);
            let left = self.coefficients.transmittance(air);
            let density = Air::density(point.height());
            let [molecules, aerosols] =
                [density.molecules, density.aerosols].map(|density| narrow(density * length));
            RayPoint {
                distance,
                point,
                air,
                molecules: std::array::from_fn(|i| left[i] * rayleigh[i] * molecules),
                aerosols: std::array::from_fn(|i| left[i] * wide[i] * aerosols),
            }
        });
        SkyRay { points: points.collect() }
    }

    /// The light that comes along a `ray`, if the cosine of its angle from the sun is `cosine`.
    pub(super) fn scattered(&self, ray: &SkyRay, cosine: f64) -> Scattered {
        let (mut even, mut halo) = ([0.0; BANDS], [0.0; BANDS]);
        for at in &ray.points {
            let rise = (EARTH * self.rise + at.distance * cosine) / at.point.radius;
            let before = self.before.logarithm(at.point.height(), rise);
            for i in 0..BANDS {
                even[i] += (at.molecules[i] + at.aerosols[i]) * exp(before[i]);
            }
            let to_sun = Point { rise, ..at.point };
            let visible = narrow(to_sun.visible_sun());
            if visible > 0.0 {
                self.add_sunlight(
                    at,
                    Air::above(to_sun),
                    visible,
                    narrow(cosine),
                    [&mut even, &mut halo],
                );
            }
        }
        Scattered { even: self.bands.rgb(&even), halo: self.bands.rgb(&halo) }
    }

    /// Adds the light of the sun that is scattered at a point of a ray, below some `air`, to the spectra of [`Scattered`].
    #[inline(always)]
    fn add_sunlight(
        &self,
        at: &RayPoint,
        air: Air,
        visible: f32,
        cosine: f32,
        [even, halo]: [&mut Spectrum; 2],
    ) {
        let by_molecules = 0.1875 / PI * (1.0 + cosine * cosine);
        let by_aerosols = 0.25 / PI * lobe(WIDE, cosine);
        let left = self.coefficients.transmittance(air);
        let aerosols = narrow(air.aerosols + at.air.aerosols);
        for i in 0..BANDS {
            let sun = visible * left[i];
            // The part that has not been scattered, and the same with what is scattered forward at this point or before
            let forward = (self.coefficients.forward[i] * aerosols).max(1e-3);
            let straight = sun * exp(-forward);
            let with_forward = FORWARD * (sun - straight) / forward + (1.0 - FORWARD) * sun;
            let per_aerosols = at.aerosols[i] / (1.0 - FORWARD);
            even[i] += sun * at.molecules[i] * by_molecules
                + (with_forward - straight) * per_aerosols * by_aerosols;
            halo[i] += straight * per_aerosols;
        }
    }
}

/// The phase function of aerosols at the cosine of an angle, per steradian.
#[inline(always)]
pub(super) fn halo(cosine: f32) -> f32 {
    let lobes = LOBES.map(|(weight, asymmetry)| weight * lobe(asymmetry, cosine));
    0.25 / PI * lobes.iter().sum::<f32>()
}

/// The phase function of Henyey and Greenstein, with a mean of 1.
#[inline(always)]
fn lobe(asymmetry: f32, cosine: f32) -> f32 {
    let square = asymmetry * asymmetry;
    let distance = 1.0 + square - 2.0 * asymmetry * cosine;
    (1.0 - square) / (distance * distance.sqrt())
}

#[cfg(test)]
#[path = "scattering_tests.rs"]
mod tests;
