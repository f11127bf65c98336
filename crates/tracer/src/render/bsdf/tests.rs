//! Every BSDF against the laws of reflection, and its samples against its density.

use std::f32::consts::PI;

use glam::Vec3;

use super::*;
use spherule_tree::math::{lane3, set_lane3, splat, splat3};
use spherule_tree::ray::Ray;

const ALBEDO: Vec3 = Vec3::new(0.9, 0.5, 0.1);

/// Points with a shading normal and a geometric normal.
fn points(normal: Vec3, geometric: Vec3) -> SurfacePoints {
    SurfacePoints {
        normal: splat3(normal),
        geometric: splat3(geometric),
        start: [splat(0.0); 3],
        albedo: splat3(ALBEDO),
    }
}

fn rays_along(direction: Vec3) -> RayPacket {
    let mut rays = RayPacket::default();
    for _ in 0..LANES {
        rays.push(&Ray::new(-direction, direction));
    }
    rays
}

/// Values for light from the `directions` of a packet that leaves towards `outgoing`.
fn eval(
    bsdf: &dyn Bsdf,
    points: &SurfacePoints,
    outgoing: Vec3,
    directions: &[Vec3; LANES],
) -> BsdfValues {
    let mut lanes = [splat(0.0); 3];
    for (lane, direction) in directions.iter().enumerate() {
        set_lane3(&mut lanes, lane, *direction);
    }
    let mut values = BsdfValues::default();
    let rays = rays_along(-outgoing);
    bsdf.eval(Supported::default(), &rays, points, &lanes, 0xffff, &mut values);
    values
}

/// Independent numbers in 0..1 (xorshift, Marsaglia 2003).
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as f32 / 16_777_216.0
    }

    /// A unit vector, uniform over the sphere.
    fn direction(&mut self) -> Vec3 {
        let z = 1.0 - 2.0 * self.next();
        let level = (1.0 - z * z).sqrt();
        let (sin, cos) = (2.0 * PI * self.next()).sin_cos();
        Vec3::new(level * cos, level * sin, z)
    }
}

/// Matte surfaces and foam.
fn bsdfs() -> Vec<Box<dyn Bsdf>> {
    [Finish::Matte, Finish::Foam, Finish::Matte].map(bsdf_of).into()
}

/// Normals, and a direction in which light leaves.
fn cases() -> [[Vec3; 2]; 3] {
    let normals = [Vec3::Z, Vec3::new(0.36, 0.48, -0.8), Vec3::new(-0.6, 0.8, 0.0)];
    normals.map(|normal| [normal, (normal + 0.7 * Vec3::X).normalize()])
}

#[test]
fn densities_integrate_to_one_and_no_light_is_created() {
    for (bsdf, [normal, outgoing]) in bsdfs().iter().zip(cases()) {
        let (mut random, packets) = (Random(7), 20_000_u16);
        let (mut density, mut reflected) = (0.0, Vec3::ZERO);
        for _ in 0..packets {
            let directions = std::array::from_fn(|_| random.direction());
            let values = eval(&**bsdf, &points(normal, normal), outgoing, &directions);
            density += values.pdf.iter().sum::<f32>();
            for lane in 0..LANES {
                reflected += lane3(&values.value, lane);
            }
        }
        let share = 4.0 * PI / (f32::from(packets) * LANES as f32);
        // The standard error of both is 0.003
        assert!((density * share - 1.0).abs() < 0.015, "{}", density * share);
        let reflected = share * reflected;
        assert!((reflected / ALBEDO - 1.0).abs().max_element() < 0.015, "{reflected}");
    }
}

#[test]
fn reflection_is_reciprocal() {
    let mut random = Random(99);
    for (bsdf, [normal, _]) in cases().map(|case| (bsdf_of(Finish::Matte), case)) {
        let above = |random: &mut Random| {
            let direction = random.direction();
            direction * direction.dot(normal).signum()
        };
        for _ in 0..200 {
            let (a, b) = (above(&mut random), above(&mut random));
            let reflectance = |from: Vec3, to: Vec3| {
                let values = eval(&*bsdf, &points(normal, normal), to, &[from; LANES]);
                lane3(&values.value, 3) / from.dot(normal)
            };
            let [forth, back] = [reflectance(a, b), reflectance(b, a)];
            assert!((forth - back).abs().max_element() < 1e-5, "{forth} {back}");
        }
    }
}

/// Bins of the sine of the elevation, and of the azimuth around the normal.
const BINS: [usize; 2] = [8, 16];

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..bins")]
fn bin_of(direction: Vec3, normal: Vec3) -> Option<usize> {
    let [s, t] = crate::render::shading::tangents(normal.to_array()).map(Vec3::from_array);
    let height = direction.dot(normal);
    let turns = direction.dot(t).atan2(direction.dot(s)) / (2.0 * PI) + 0.5;
    let row = ((height * BINS[0] as f32) as usize).min(BINS[0] - 1);
    let column = ((turns * BINS[1] as f32) as usize).min(BINS[1] - 1);
    (height > 0.0).then_some(row * BINS[1] + column)
}

#[test]
fn samples_have_their_density() {
    for (bsdf, [normal, outgoing]) in bsdfs().iter().zip(cases()) {
        let (points, packets) = (points(normal, normal), 8192_u16);
        let mut random = Random(3);
        // Count samples, and check each against the values for its direction
        let mut counts = [0_u32; BINS[0] * BINS[1]];
        let mut samples = BsdfSamples::default();
        let rays = rays_along(-outgoing);
        for _ in 0..packets {
            let u = [0, 1].map(|_| std::array::from_fn(|_| random.next()));
            bsdf.sample(Supported::default(), &rays, &points, &u, 0xffff, &mut samples);
            let directions = std::array::from_fn(|lane| lane3(&samples.direction, lane));
            let values = eval(&**bsdf, &points, outgoing, &directions);
            for (lane, direction) in directions.iter().enumerate() {
                assert!((direction.length() - 1.0).abs() < 1e-5);
                let pdf = samples.pdf[lane];
                assert!((pdf - values.pdf[lane]).abs() < 1e-4, "{direction}");
                let value = lane3(&samples.weight, lane) * pdf;
                assert!((value - lane3(&values.value, lane)).abs().max_element() < 1e-4);
                if let Some(bin) = bin_of(*direction, normal) {
                    counts[bin] += 1;
                }
            }
        }
        // Integrate the density over each bin
        let (mut expected, trials) = ([0.0_f64; BINS[0] * BINS[1]], 60_000_u32);
        let total = f64::from(packets) * LANES as f64;
        for _ in 0..trials {
            let directions = std::array::from_fn(|_| random.direction());
            let values = eval(&**bsdf, &points, outgoing, &directions);
            for (lane, direction) in directions.iter().enumerate() {
                if let Some(bin) = bin_of(*direction, normal) {
                    let solid_angle =
                        4.0 * std::f64::consts::PI / (f64::from(trials) * LANES as f64);
                    expected[bin] += total * solid_angle * f64::from(values.pdf[lane]);
                }
            }
        }
        // Chi-square test: 127 degrees of freedom, and the variance of the integral adds about a quarter
        let chi2: f64 = counts
            .iter()
            .zip(&expected)
            .map(|(count, expected)| (f64::from(*count) - expected).powi(2) / expected)
            .sum();
        assert!(chi2 < 260.0, "{chi2}");
    }
}

#[test]
fn nothing_is_reflected_below_the_surface() {
    let (normal, geometric) = (Vec3::new(0.8, 0.0, 0.6), Vec3::Z);
    let below = Vec3::new(0.9, 0.0, -0.2).normalize();
    let (mut random, mut samples) = (Random(5), BsdfSamples::default());
    let bsdf = bsdf_of(Finish::Matte);
    let points = points(normal, geometric);
    let values = eval(&*bsdf, &points, normal, &[below; LANES]);
    assert_eq!((values.pdf[0], lane3(&values.value, 0)), (0.0, Vec3::ZERO));
    let mut dropped = 0;
    for _ in 0..64 {
        let u = [0, 1].map(|_| std::array::from_fn(|_| random.next()));
        let rays = rays_along(-normal);
        bsdf.sample(Supported::default(), &rays, &points, &u, 0xffff, &mut samples);
        for lane in 0..LANES {
            let is_below = lane3(&samples.direction, lane).z <= 0.0;
            assert_eq!(samples.pdf[lane] == 0.0, is_below);
            dropped += u32::from(is_below);
        }
    }
    assert!(dropped > 20, "{dropped}");
}
