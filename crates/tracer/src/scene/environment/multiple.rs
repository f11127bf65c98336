//! The light in the air of a clear day that has been scattered before or comes from the ground, as a mean over all
//! directions (Hillaire, "A Scalable and Production Ready Sky and Atmosphere Rendering Technique", 2020).
//!
//! It is a table over the height and the elevation of the sun. Light that was scattered once is an integral over paths.
//! Each later order follows from the one before (Bruneton and Neyret, "Precomputed Atmospheric Scattering", 2008), where
//! heights send light to each other.

use std::f32::consts::PI;

use spherule_tree::math::functions::ln;
use spherule_tree::math::narrow;

use super::atmosphere::{Air, Coefficients, EARTH, Point, TOP};
use super::spectrum::{BANDS, OpticalDepths, Spectrum};

/// The part of the light scattered by aerosols that counts as not scattered. With their asymmetry, 0.62, a low sun gives a
/// sky that is 0.005 too yellow in x beside a Monte Carlo simulation: aerosols keep the yellow light of the horizon there,
/// while even scattering would send it to the ground. The value is fitted to the simulation for turbidities of 2.5 and 6.
const FORWARD: f32 = 0.95;

/// Number of heights in the table. They are dense near the ground.
const HEIGHTS: usize = 16;

/// The table has elevations of the sun up to this distance from that on the ground, radians: 13.6 degrees. Paths from the
/// ground end less than 11 degrees away.
const REACH: f64 = 0.238;

/// Number of elevations for a low sun, and for one above [`HIGH`], where they matter less.
const ELEVATIONS: [usize; 2] = [11, 3];

/// The elevation of a high sun, radians: 20 degrees.
const HIGH: f64 = 0.35;

/// Points of a path.
const STEPS: usize = 14;

/// Sines of the elevations of paths with their weights (Gauss and Legendre, for the upper half).
const SINES: [(f64, f64); 5] = [
    (0.046_910_077, 0.118_463_443),
    (0.230_765_345, 0.239_314_335),
    (0.5, 0.284_444_444),
    (0.769_234_655, 0.239_314_335),
    (0.953_089_923, 0.118_463_443),
];

/// Azimuths of paths in half a turn.
const AZIMUTHS: usize = 3;

/// Orders of scattering after the first two.
const ORDERS: usize = 12;

/// The table.
#[derive(Debug)]
pub(super) struct ScatteredBefore {
    /// Elevations of the sun, radians.
    elevations: Vec<f64>,
    /// For each height and elevation, the logarithm of the light in parts of the irradiance of the sun above the air.
    logarithms: Vec<Spectrum>,
}

impl ScatteredBefore {
    /// The table for air of some optical depths above ground of an `albedo`, with the sun at an `elevation` in radians.
    pub(super) fn new(depths: &[OpticalDepths; BANDS], elevation: f64, albedo: f32) -> Self {
        let count = ELEVATIONS[usize::from(elevation > HIGH)];
        let place = |i: usize| 2.0 * i as f64 / (count - 1) as f64 - 1.0;
        let elevations: Vec<f64> = (0..count).map(|i| elevation + REACH * place(i)).collect();
        let air = Surroundings { coefficients: Coefficients::new(depths, FORWARD), albedo };
        let heights = (0..HEIGHTS).map(|row| TOP * cube(row as f64 / (HEIGHTS - 1) as f64));
        let gathered: Vec<Gathered> =
            heights.map(|height| air.gathered(height, &elevations)).collect();
        Self { elevations, logarithms: all_orders(&gathered) }
    }

    /// The logarithm of the light at a `height` in km that has been scattered, where the sine of the elevation of the sun is
    /// `rise`.
    pub(super) fn logarithm(&self, height: f64, rise: f64) -> Spectrum {
        let count = self.elevations.len();
        let (row, down) = row_at(height);
        let turned = (libm::asin(rise.clamp(-1.0, 1.0)) - self.elevations[0]) / (2.0 * REACH);
        let (column, across) = cell(turned * (count - 1) as f64, count);
        let at = |row: usize, column: usize| &self.logarithms[row * count + column];
        let [a, b, c, d] =
            [at(row, column), at(row, column + 1), at(row + 1, column), at(row + 1, column + 1)];
        std::array::from_fn(|i| {
            let above = a[i] + across * (b[i] - a[i]);
            let below = c[i] + across * (d[i] - c[i]);
            above + down * (below - above)
        })
    }
}

/// The air and the ground.
struct Surroundings {
    coefficients: Coefficients,
    albedo: f32,
}

/// A place that sends light back along a path: air, or the ground at its end.
struct Source {
    distance: f64,
    point: Point,
    is_ground: bool,
    /// The part of the light there that arrives at the start, if it comes evenly from everywhere.
    strength: Spectrum,
}

impl Surroundings {
    /// The light that comes to a `height` in km, for some elevations of the sun in radians.
    fn gathered(&self, height: f64, elevations: &[f64]) -> Gathered {
        let mut once = vec![[0.0; BANDS]; elevations.len()];
        let mut again = [[0.0; BANDS]; HEIGHTS];
        let both = SINES.iter().flat_map(|(sine, weight)| [(*sine, *weight), (-sine, *weight)]);
        for (rise, weight) in both {
            let start = Point { radius: EARTH + height, rise };
            let weight = 0.5 * narrow(weight);
            for source in self.sources(start) {
                let (row, part) = row_at(source.point.height());
                add(&mut again[row], weight * (1.0 - part), &source.strength);
                add(&mut again[row + 1], weight * part, &source.strength);
                for (sum, elevation) in once.iter_mut().zip(elevations) {
                    let light = self.mean_sunlight(start, &source, *elevation);
                    let returned = std::array::from_fn(|i| source.strength[i] * light[i]);
                    add(sum, weight, &returned);
                }
            }
        }
        Gathered { once, again }
    }

    /// What sends light to `start` along its path.
    fn sources(&self, start: Point) -> Vec<Source> {
        let ground = start.distance_to_ground();
        let length = ground.unwrap_or_else(|| start.distance_to(EARTH + TOP));
        let air = |[distance, length]: [f64; 2]| {
            let point = start.further(distance);
            let density = Air::density(point.height());
            let [molecules, aerosols] =
                [density.molecules, density.aerosols].map(|d| narrow(d * length));
            let left = self.coefficients.transmittance(Air::between(start, point));
            let Coefficients { rayleigh, wide, .. } = &self.coefficients;
            let scattered = |i| left[i] * (rayleigh[i] * molecules + wide[i] * aerosols);
            Source { distance, point, is_ground: false, strength: std::array::from_fn(scattered) }
        };
        // The air is dense near the lower end
        let places = steps(length, STEPS);
        if start.rise >= 0.0 {
            return places.map(air).collect();
        }
        let mut sources: Vec<Source> =
            places.map(|[distance, part]| air([length - distance, part])).collect();
        if ground.is_some() {
            let end = start.further(length);
            let left = self.coefficients.transmittance(Air::between(start, end));
            let strength = left.map(|left| self.albedo * left);
            sources.push(Source { distance: length, point: end, is_ground: true, strength });
        }
        sources
    }

    /// The radiance that air or ground of albedo 1 at a `source` has from the sun, the mean over all azimuths, if the sun has
    /// an `elevation` at the start.
    fn mean_sunlight(&self, start: Point, source: &Source, elevation: f64) -> Spectrum {
        let (sine, cosine) = (libm::sin(elevation), libm::cos(elevation));
        let level = cosine * (1.0 - start.rise * start.rise).max(0.0).sqrt();
        let mut sum = [0.0; BANDS];
        for azimuth in 0..AZIMUTHS {
            let turn = (azimuth as f64 + 0.5) / AZIMUTHS as f64 * std::f64::consts::PI;
            let angle = start.rise * sine + level * libm::cos(turn);
            let rise = (start.radius * sine + source.distance * angle) / source.point.radius;
            let part = if source.is_ground { rise.max(0.0) } else { 0.25 };
            let share = narrow(part) / (PI * AZIMUTHS as f32);
            let air = Air::above(Point { rise, ..source.point });
            let visible = narrow(Point { rise, ..source.point }.visible_sun());
            if share * visible > 0.0 {
                add(&mut sum, share * visible, &self.coefficients.transmittance(air));
            }
        }
        sum
    }
}

/// The light that comes to a height on all paths, the mean over their directions.
struct Gathered {
    /// Light that has been scattered or reflected once, for each elevation of the sun.
    once: Vec<Spectrum>,
    /// The parts that come from around each height of the table, if the light there is 1.
    again: [Spectrum; HEIGHTS],
}

/// The rows of [`ScatteredBefore`]: the light of all orders. From the second order on, it comes from air with the same
/// elevation of the sun.
fn all_orders(gathered: &[Gathered]) -> Vec<Spectrum> {
    let mut means: Vec<Vec<Spectrum>> = gathered.iter().map(|row| row.once.clone()).collect();
    for _ in 0..ORDERS {
        let before = means.clone();
        for (row, gathered) in means.iter_mut().zip(gathered) {
            for (column, sum) in row.iter_mut().enumerate() {
                *sum = gathered.once[column];
                for (before, again) in before.iter().zip(&gathered.again) {
                    for (band, sum) in sum.iter_mut().enumerate() {
                        *sum += again[band] * before[column][band];
                    }
                }
            }
        }
    }
    let logarithms = |mean: Spectrum| mean.map(|value| ln(value.max(f32::MIN_POSITIVE)));
    means.into_iter().flatten().map(logarithms).collect()
}

/// The row of the table below a `height` in km, and the part of the way to the next one.
fn row_at(height: f64) -> (usize, f32) {
    cell(libm::cbrt((height / TOP).max(0.0)) * (HEIGHTS - 1) as f64, HEIGHTS)
}

/// The cell of `count` values that contains a `place`, or the nearest one, and the part of the way to its end.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded, positive")]
pub(super) fn cell(place: f64, count: usize) -> (usize, f32) {
    let place = place.clamp(0.0, (count - 1) as f64);
    let first = (place as usize).min(count - 2);
    (first, narrow(place - first as f64))
}

fn add(sum: &mut Spectrum, weight: f32, terms: &Spectrum) {
    for (sum, term) in sum.iter_mut().zip(terms) {
        *sum += weight * term;
    }
}

/// Distances along a path of a `length` in km, and the lengths that they stand for: the midpoints of equal parts of the
/// cube root of the distance, so that they are dense near the start.
pub(super) fn steps(length: f64, count: usize) -> impl Iterator<Item = [f64; 2]> {
    let place = move |part: f64| length * cube(part / count as f64);
    (0..count).map(move |i| {
        let i = i as f64;
        [place(i + 0.5), place(i + 1.0) - place(i)]
    })
}

fn cube(value: f64) -> f64 {
    value * value * value
}
