//! Rough interfaces against the densities of Walter et al., reciprocity, and the smooth interface.

use std::f64::consts::PI;

use glam::Vec3;

use super::*;
use crate::render::interface::BodyInterface;
use crate::scene::Fresnel;
use spherule_tree::accel::simd::tested_levels::tested_levels;
use spherule_tree::math::{lane3, splat, splat3};
use spherule_tree::ray::Ray;

const IOR: f32 = 1.5;

fn glass(roughness: f32) -> Material {
    Material {
        reflection: 1.0,
        transmission: 1.0,
        ior: IOR,
        fresnel: Fresnel::Exact,
        interface_roughness: roughness,
        ..Material::DEFAULT
    }
}

fn rough(roughness: f32) -> RoughInterface {
    RoughInterface::of(&glass(roughness), true).expect("it is rough")
}

/// Outgoing directions by their angle from the normal in degrees.
const ANGLES: [f32; 4] = [5.0, 30.0, 60.0, 80.0];

fn towards(degrees: f32) -> [f32; 3] {
    let (sin, cos) = degrees.to_radians().sin_cos();
    [0.6 * sin, -0.8 * sin, cos]
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

    fn pair(&mut self) -> [f32; 2] {
        [self.next(), self.next()]
    }
}

fn dot64(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit64(v: [f64; 3]) -> [f64; 3] {
    let length = dot64(v, v).sqrt();
    v.map(|c| c / length)
}

/// The density of visible microfacet normals `h` as seen from `out`, by the definition in f64.
fn visible_density(alpha: f64, out: [f64; 3], h: [f64; 3]) -> f64 {
    let x = h[2] * h[2] * (alpha * alpha - 1.0) + 1.0;
    let density = alpha * alpha / (PI * x * x);
    let tan2 = (1.0 - out[2] * out[2]).max(0.0) / (out[2] * out[2]);
    let masking = 2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt());
    masking * density * dot64(out, h).max(0.0) / out[2]
}

/// The density per steradian with which a direction `into` is sampled before Fresnel's choice: of reflection above the
/// surface, of refraction below. `ratio` is the index of refraction above over that below. Jacobians of equations 14
/// and 17 of Walter et al.
fn direction_density(alpha: f64, ratio: f64, out: [f64; 3], into: [f64; 3]) -> f64 {
    if into[2] > 0.0 {
        let h = unit64([0, 1, 2].map(|i| out[i] + into[i]));
        return visible_density(alpha, out, h) / (4.0 * dot64(out, h).abs());
    }
    // Both sides divided by the index below
    let h = unit64([0, 1, 2].map(|i| -(ratio * out[i] + into[i])));
    let h = if h[2] < 0.0 { h.map(|c| -c) } else { h };
    let (a, b) = (dot64(out, h), dot64(into, h));
    if a <= 0.0 || b >= 0.0 {
        return 0.0;
    }
    let denominator = ratio * a + b;
    visible_density(alpha, out, h) * b.abs() / (denominator * denominator)
}

/// Bins of the height, and of the azimuth.
const BINS: [usize; 2] = [12, 16];

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..bins")]
fn bin_of(direction: [f64; 3]) -> usize {
    let turns = direction[1].atan2(direction[0]) / (2.0 * PI) + 0.5;
    let row = ((0.5 * (direction[2] + 1.0) * BINS[0] as f64) as usize).min(BINS[0] - 1);
    let column = ((turns * BINS[1] as f64) as usize).min(BINS[1] - 1);
    row * BINS[1] + column
}

/// Sampled directions against their density: one of the two rays of each sample, by `take`.
#[track_caller]
fn check_density(roughness: f32, degrees: f32, ratio: f32, reflected: bool) {
    let interface = rough(roughness);
    let (out, alpha) = (towards(degrees), f64::from(roughness * roughness));
    let (mut random, samples) = (Random(7), 100_000_u32);
    let mut counts = [0_u32; BINS[0] * BINS[1]];
    for _ in 0..samples {
        let rays = leave(&interface.ggx, &interface.dielectric, out, ratio, random.pair());
        let [of_reflected, of_refracted] = rays.weights;
        let (direction, weight) =
            if reflected { (rays.reflected, of_reflected) } else { (rays.refracted, of_refracted) };
        // Rays without weight are not traced
        if weight > 0.0 {
            counts[bin_of(direction.map(f64::from))] += 1;
        }
    }
    // Integrate the density over each bin by a grid
    let (out, ratio) = (out.map(f64::from), f64::from(ratio));
    let mut expected = [0.0; BINS[0] * BINS[1]];
    let [rows, columns] = [12_000_u32, 80];
    for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
        let z = 2.0 * (f64::from(i) + 0.5) / f64::from(rows) - 1.0;
        if (z > 0.0) != reflected {
            continue;
        }
        let level = (1.0 - z * z).sqrt();
        let (sin, cos) = (2.0 * PI * (f64::from(j) + 0.5) / f64::from(columns)).sin_cos();
        let direction = [level * cos, level * sin, z];
        let solid_angle = 4.0 * PI / f64::from(rows * columns);
        let density = direction_density(alpha, ratio, out, direction);
        expected[bin_of(direction)] += f64::from(samples) * solid_angle * density;
    }
    // Chi-square test over bins with enough samples
    let bins = counts.iter().zip(expected).filter(|(_, e)| *e > 20.0);
    let (mut chi2, mut freedom) = (0.0, 0.0);
    for (count, expected) in bins {
        chi2 += (f64::from(*count) - expected).powi(2) / expected;
        freedom += 1.0;
    }
    // Five standard deviations
    let limit = freedom + 5.0 * f64::sqrt(2.0 * freedom);
    assert!(freedom > 3.0, "{roughness} {degrees} {ratio}: {freedom} bins");
    assert!(chi2 < limit, "{roughness} {degrees} {ratio} {reflected}: {chi2} of {limit}");
    let [found, wanted] =
        [counts.iter().map(|c| f64::from(*c)).sum::<f64>(), expected.iter().sum::<f64>()];
    assert!((found / wanted - 1.0).abs() < 0.02, "{found} {wanted}");
}

// 100,000 samples in each case: a chi-square test of 192 bins needs many in each.
#[test]
fn directions_have_the_densities_of_the_paper() {
    for roughness in [0.45, 0.7, 1.0] {
        for degrees in ANGLES {
            // All microfacets reflect, and from outside all refract
            check_density(roughness, degrees, 1.0 / IOR, true);
            check_density(roughness, degrees, 1.0 / IOR, false);
        }
        // From inside, those under total reflection do not
        check_density(roughness, 20.0, IOR, false);
        check_density(roughness, 20.0, IOR, true);
    }
}

/// The BSDF without its cosine, from samples' weights by their density: `f = weight * density / |cosine|`.
fn bsdf(interface: &RoughInterface, ratio: f64, out: [f64; 3], into: [f64; 3]) -> f64 {
    let alpha = f64::from(interface.ggx.width());
    let h = if into[2] > 0.0 {
        unit64([0, 1, 2].map(|i| out[i] + into[i]))
    } else {
        unit64([0, 1, 2].map(|i| -(ratio * out[i] + into[i])))
    };
    let h = if h[2] < 0.0 { h.map(|c| -c) } else { h };
    #[expect(clippy::cast_possible_truncation, reason = "the functions under test are f32")]
    let (cosine, small, up, down) =
        (dot64(out, h) as f32, ratio as f32, out[2] as f32, into[2].abs() as f32);
    let (r, _) = interface.dielectric.fresnel(cosine, small);
    let fresnel = if into[2] > 0.0 { r } else { 1.0 - r };
    let weight = f64::from(fresnel * passed(&interface.ggx, up, down));
    weight * direction_density(alpha, ratio, out, into) / into[2].abs()
}

#[test]
fn light_can_go_both_ways() {
    let (ior, mut random) = (f64::from(IOR), Random(5));
    let mut direction = |above: bool| {
        let [a, b] = random.pair().map(f64::from);
        let (z, turn) = (0.1 + 0.9 * a, 2.0 * PI * b);
        let level = (1.0 - z * z).sqrt();
        [level * turn.cos(), level * turn.sin(), if above { z } else { -z }]
    };
    for roughness in [0.3, 0.6, 1.0] {
        let interface = rough(roughness);
        let (mut reflections, mut refractions) = (0, 0);
        for _ in 0..2000 {
            let (a, b, c) = (direction(true), direction(true), direction(false));
            let [forth, back] = [(a, b), (b, a)].map(|(o, i)| bsdf(&interface, 1.0 / ior, o, i));
            assert!((forth - back).abs() <= 1e-4 * forth.max(back) + 1e-9, "{forth} {back}");
            reflections += u32::from(forth > 0.0);
            // Radiance grows by the square of the index, which paths leave out on both ways
            let turned = |v: [f64; 3]| v.map(|c| -c);
            let into = bsdf(&interface, 1.0 / ior, a, c) / (ior * ior);
            let out = bsdf(&interface, ior, turned(c), turned(a));
            assert!((into - out).abs() <= 1e-3 * into.max(out) + 1e-5, "{into} {out}");
            refractions += u32::from(into > 0.0);
        }
        assert!(reflections > 1000 && refractions > 100, "{reflections} {refractions}");
    }
}

/// The part of the light that leaves after one microfacet.
fn leaving(interface: &RoughInterface, degrees: f32, ratio: f32) -> f64 {
    let (mut random, out, samples) = (Random(11), towards(degrees), 20_000_u32);
    let weights = (0..samples).map(|_| {
        let rays = leave(&interface.ggx, &interface.dielectric, out, ratio, random.pair());
        assert!(rays.weights.iter().all(|weight| (0.0..=1.0).contains(weight)));
        f64::from(rays.weights.iter().sum::<f32>())
    });
    weights.sum::<f64>() / f64::from(samples)
}

#[test]
fn single_microfacets_lose_light_which_the_tables_add() {
    for (roughness, most) in [(0.2, 0.02), (0.4, 0.1), (0.6, 0.3), (1.0, 0.6)] {
        let interface = rough(roughness);
        for degrees in ANGLES {
            for (ratio, table) in [1.0 / IOR, IOR].into_iter().zip(&interface.passing) {
                let found = leaving(&interface, degrees, ratio);
                let known = f64::from(table.at(towards(degrees)[2]));
                assert!(
                    (found / known - 1.0).abs() < 0.03,
                    "{roughness} {degrees}: {found} {known}"
                );
                assert!(found <= 1.0 && (degrees > 70.0 || 1.0 - found < most), "{found}");
            }
        }
    }
}

/// A packet of rays onto a surface with the normal z.
fn packet(direction: Vec3) -> (RayPacket, Intersections) {
    let mut rays = RayPacket::default();
    for _ in 0..LANES {
        rays.push(&Ray::new(-direction, direction));
    }
    let hits = Intersections {
        normal: splat3(Vec3::Z),
        shading_normal: splat3(Vec3::Z),
        offset: splat(0.01),
        mask: 0xffff,
        ..Intersections::default()
    };
    (rays, hits)
}

#[test]
fn a_slight_roughness_is_nearly_smooth() {
    let material = glass(0.05);
    let smooth = BodyInterface(Dielectric::new(&material));
    let mut random = Random(3);
    for is_connected in [false, true] {
        let rough = RoughInterface::of(&material, is_connected).unwrap();
        for (direction, inside) in
            [(Vec3::new(0.6, 0.0, -0.8), 0), (Vec3::new(0.3, 0.2, 0.9).normalize(), 0xffff)]
        {
            let (rays, hits) = packet(direction);
            let [mut expected, mut found] = [LeavingRays::default(), LeavingRays::default()];
            let mut points = SurfacePoints::default();
            for simd in tested_levels().into_iter().map(Supported::or_best) {
                let u = [0, 1].map(|_| std::array::from_fn(|_| 0.9 * random.next()));
                smooth.leave(simd, &rays, &hits, inside, &u, &mut points, &mut expected);
                rough.leave(simd, &rays, &hits, inside, &u, &mut points, &mut found);
                for (found, expected) in [
                    (&found.reflected, &expected.reflected),
                    (&found.refracted, &expected.refracted),
                ] {
                    for lane in 0..LANES {
                        let vectors =
                            |lanes| [lane3(lanes, lane), lane3(&expected.direction, lane)];
                        let [a, b] = vectors(&found.direction);
                        assert!((a - b).length() < 0.03, "{a} {b}");
                        assert!((found.weight[lane] - expected.weight[lane]).abs() < 0.02);
                        let origins = [&found.origin, &expected.origin].map(|o| lane3(o, lane));
                        assert_eq!(origins[0], origins[1]);
                    }
                }
            }
        }
    }
}
