//! Properties that every BSDF has: reciprocity, conservation of energy, and a density that matches its samples.

use super::*;
use glam::Vec3;
use spherule_tree::accel::simd::tested_levels::tested_levels;
use spherule_tree::math::{splat, splat3};
use spherule_tree::ray::Ray;

const FINISHES: [Finish; 8] = [
    Finish::Matte,
    Finish::Plastic { roughness: 0.2 },
    Finish::Plastic { roughness: 0.55 },
    Finish::Plastic { roughness: 1.0 },
    Finish::Metal { roughness: 0.1 },
    Finish::Metal { roughness: 0.4 },
    Finish::Metal { roughness: 0.7 },
    Finish::Metal { roughness: 1.0 },
];

/// Whether its lobe is wide compared with the cells of an integral.
fn is_integrable(finish: &Finish) -> bool {
    match finish {
        Finish::Matte | Finish::Pane | Finish::Foam => true,
        Finish::Plastic { roughness } | Finish::Metal { roughness } => *roughness > 0.3,
    }
}

/// Outgoing directions by their angle from the normal in degrees.
const ANGLES: [f32; 4] = [0.0, 30.0, 60.0, 82.0];

/// A surface point whose normal is z, seen from `out`.
struct Point {
    rays: RayPacket,
    points: SurfacePoints,
}

impl Point {
    fn new(out: Vec3, albedo: Vec3) -> Self {
        let mut rays = RayPacket::default();
        for _ in 0..LANES {
            rays.push(&Ray::new(out, -out));
        }
        Self {
            rays,
            points: SurfacePoints {
                normal: splat3(Vec3::Z),
                geometric: splat3(Vec3::Z),
                start: splat3(Vec3::ZERO),
                albedo: splat3(albedo),
            },
        }
    }

    /// The values for 16 directions.
    fn eval(&self, simd: Supported, bsdf: &dyn Bsdf, into: &Lanes3) -> BsdfValues {
        let mut values = BsdfValues::default();
        bsdf.eval(simd, &self.rays, &self.points, into, 0xffff, &mut values);
        values
    }

    fn value(&self, bsdf: &dyn Bsdf, into: Vec3) -> Vec3 {
        let values = self.eval(Supported::default(), bsdf, &splat3(into));
        spherule_tree::math::lane3(&values.value, 0)
    }

    /// Samples by `numbers`: directions, weights and densities.
    fn samples(
        &self,
        simd: Supported,
        bsdf: &dyn Bsdf,
        numbers: &[[f32; 2]],
    ) -> Vec<(Vec3, Vec3, f32)> {
        let mut found = Vec::new();
        for chunk in numbers.chunks(LANES) {
            let mut u = [splat(0.0); 2];
            for (lane, number) in chunk.iter().enumerate() {
                (u[0][lane], u[1][lane]) = (number[0], number[1]);
            }
            let mut samples = BsdfSamples::default();
            bsdf.sample(simd, &self.rays, &self.points, &u, 0xffff, &mut samples);
            for lane in 0..chunk.len() {
                let vector = |lanes| spherule_tree::math::lane3(lanes, lane);
                found.push((
                    vector(&samples.direction),
                    vector(&samples.weight),
                    samples.pdf[lane],
                ));
            }
        }
        found
    }
}

/// The centres of the cells of a grid.
fn grid(side: u16) -> Vec<[f32; 2]> {
    let center = |k: u16| (f32::from(k) + 0.5) / f32::from(side);
    let cells = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
    cells.map(|(i, j)| [center(i), center(j)]).collect()
}

/// Pseudo-random points.
fn random(count: usize) -> Vec<[f32; 2]> {
    let mut state = 1_u64;
    let mut next = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    (0..count).map(|_| [next(), next()]).collect()
}

fn direction(degrees: f32, azimuth: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (y, x) = azimuth.to_radians().sin_cos();
    Vec3::new(sin * x, sin * y, cos)
}

/// The integral of `of` over the hemisphere, by cells of equal solid angle.
fn integral(of: impl Fn(&Lanes3) -> Lanes) -> f64 {
    const ROWS: usize = 400;
    const COLUMNS: usize = 800;
    let mut sum = 0.0;
    for row in 0..ROWS {
        let z = (row as f32 + 0.5) / ROWS as f32;
        let level = (1.0 - z * z).sqrt();
        for first in (0..COLUMNS).step_by(LANES) {
            let angle = |l: usize| (first + l) as f32 * std::f32::consts::TAU / COLUMNS as f32;
            let into = [
                std::array::from_fn(|l| level * angle(l).cos()),
                std::array::from_fn(|l| level * angle(l).sin()),
                splat(z),
            ];
            sum += of(&into).iter().map(|v| f64::from(*v)).sum::<f64>();
        }
    }
    sum * std::f64::consts::TAU / (ROWS * COLUMNS) as f64
}

#[test]
fn directions_can_be_exchanged() {
    let albedo = Vec3::new(0.9, 0.4, 0.1);
    for finish in FINISHES {
        let bsdf = bsdf_of(finish);
        for (a, b) in [(10.0, 50.0), (0.0, 80.0), (45.0, 45.0), (85.0, 20.0)] {
            let (a, b) = (direction(a, 10.0), direction(b, 130.0));
            // The value contains the cosine of the second direction
            let there = Point::new(a, albedo).value(&*bsdf, b) / b.z;
            let back = Point::new(b, albedo).value(&*bsdf, a) / a.z;
            let error = (there - back).abs().max_element();
            assert!(error <= 1e-4 * there.max_element(), "{finish:?}: {there} {back}");
        }
    }
}

/// In a white furnace, a white surface is as bright as its surroundings, and a dark one never brighter.
#[test]
fn energy_is_kept() {
    for finish in FINISHES {
        let bsdf = bsdf_of(finish);
        for angle in ANGLES {
            for (albedo, range) in [(1.0, 0.985..1.01), (0.3, 0.0..1.0)] {
                let point = Point::new(direction(angle, 0.0), Vec3::splat(albedo));
                let samples = point.samples(Supported::default(), &*bsdf, &grid(256));
                let sum: f64 = samples.iter().map(|(_, weight, _)| f64::from(weight.y)).sum();
                let reflected = sum / samples.len() as f64;
                assert!(
                    range.contains(&reflected),
                    "{finish:?} at {angle}, albedo {albedo}: {reflected}"
                );
            }
        }
    }
}

/// The density integrates to the fraction of samples that leave the surface, and the weight of samples is that of
/// the values.
#[test]
fn densities_are_those_of_the_samples() {
    for finish in FINISHES.into_iter().filter(is_integrable) {
        let bsdf = bsdf_of(finish);
        for angle in ANGLES {
            let point = Point::new(direction(angle, 20.0), Vec3::new(0.8, 0.5, 0.2));
            let simd = Supported::default();
            let samples = point.samples(simd, &*bsdf, &grid(256));
            let total = integral(|into| point.eval(simd, &*bsdf, into).pdf);
            let left = samples.iter().filter(|(_, _, pdf)| *pdf > 0.0).count();
            let left = left as f64 / samples.len() as f64;
            assert!((total - left).abs() < 0.01, "{finish:?} at {angle}: {total} {left}");
            for (into, weight, pdf) in samples.iter().step_by(97).filter(|(_, _, pdf)| *pdf > 0.0) {
                let values = point.eval(simd, &*bsdf, &splat3(*into));
                assert!(
                    (values.pdf[0] - pdf).abs() <= 2e-3 * pdf,
                    "{finish:?}: {} {pdf}",
                    values.pdf[0]
                );
                let expected = values.value[1][0] / values.pdf[0];
                assert!((expected - weight.y).abs() <= 2e-3 * expected.max(0.01));
            }
        }
    }
}

// 100,000 samples for 128 cells, and the density at a million directions, for each finish and angle.
/// A chi-square test of the directions of samples against the integral of the density over cells.
#[test]
fn samples_follow_their_density() {
    const ROWS: usize = 8;
    const COLUMNS: usize = 16;
    for finish in FINISHES.into_iter().filter(is_integrable) {
        let bsdf = bsdf_of(finish);
        for angle in [0.0, 50.0] {
            let point = Point::new(direction(angle, 20.0), Vec3::splat(0.5));
            let simd = Supported::default();
            // Count samples
            let samples = point.samples(simd, &*bsdf, &random(100_000));
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "cells")]
            let cell = |v: Vec3| {
                let row = ((v.z * ROWS as f32) as usize).min(ROWS - 1);
                let turn = v.y.atan2(v.x) / std::f32::consts::TAU + 1.0;
                row * COLUMNS + ((turn * COLUMNS as f32) as usize % COLUMNS)
            };
            let mut counts = [0.0; ROWS * COLUMNS];
            for (into, _, _) in samples.iter().filter(|(_, _, pdf)| *pdf > 0.0) {
                counts[cell(*into)] += 1.0;
            }
            // Integrate the density over each cell
            let mut expected = [0.0; ROWS * COLUMNS];
            let (fine_rows, fine_columns) = (ROWS * 128, COLUMNS * 64);
            for row in 0..fine_rows {
                let z = (row as f32 + 0.5) / fine_rows as f32;
                let level = (1.0 - z * z).sqrt();
                for first in (0..fine_columns).step_by(LANES) {
                    let angle = |l: usize| {
                        (first as f32 + l as f32 + 0.5) * std::f32::consts::TAU
                            / fine_columns as f32
                    };
                    let into = [
                        std::array::from_fn(|l| level * angle(l).cos()),
                        std::array::from_fn(|l| level * angle(l).sin()),
                        splat(z),
                    ];
                    let values = point.eval(simd, &*bsdf, &into);
                    for lane in 0..LANES {
                        let at = spherule_tree::math::lane3(&into, lane);
                        expected[cell(at)] += f64::from(values.pdf[lane]);
                    }
                }
            }
            let share = std::f64::consts::TAU / (fine_rows * fine_columns) as f64;
            let mut statistic = 0.0;
            let mut cells = 0.0;
            for (count, density) in counts.iter().zip(expected) {
                let expected = density * share * samples.len() as f64;
                if expected < 5.0 {
                    assert!(
                        *count < 40.0,
                        "{finish:?}: {count} samples where {expected} are expected"
                    );
                    continue;
                }
                statistic += (count - expected) * (count - expected) / expected;
                cells += 1.0;
            }
            assert!(
                statistic < 1.5 * cells + 20.0,
                "{finish:?} at {angle}: {statistic} of {cells}"
            );
        }
    }
}

/// A shading normal may be turned so far that directions around it lead below the geometric surface.
#[test]
fn nothing_is_reflected_below_the_surface() {
    let normal = Vec3::new(0.8, 0.0, 0.6);
    let below = Vec3::new(0.9, 0.0, -0.2).normalize();
    for finish in FINISHES {
        let bsdf = bsdf_of(finish);
        let mut point = Point::new(normal, Vec3::splat(0.5));
        point.points.normal = splat3(normal);
        assert_eq!(point.value(&*bsdf, below), Vec3::ZERO, "{finish:?}");
        for (into, _, pdf) in point.samples(Supported::default(), &*bsdf, &grid(64)) {
            assert!(into.z > 0.0 || pdf == 0.0, "{finish:?}: {into}, {pdf}");
        }
    }
}

#[test]
fn instruction_sets_give_the_same_bits() {
    for finish in FINISHES {
        let bsdf = bsdf_of(finish);
        let point = Point::new(direction(40.0, 20.0), Vec3::new(0.8, 0.5, 0.2));
        let all: Vec<_> = tested_levels()
            .into_iter()
            .map(|level| point.samples(Supported::or_best(level), &*bsdf, &grid(32)))
            .collect();
        for others in &all[1..] {
            assert_eq!(&all[0], others, "{finish:?}");
        }
    }
}
