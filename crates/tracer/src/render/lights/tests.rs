//! Lights with an extent against their analytic irradiance, and against the rays that hit them.

use std::f32::consts::PI;

use glam::Vec3;

use super::*;
use spherule_tree::math::{LANES, Lanes, Supported, lane3, splat3};
use spherule_tree::ray::{Ray, RayPacket};

const LIGHT: f32 = 3.0;

fn light(kind: LightKind) -> Box<dyn Light> {
    light_of(&scene::Light {
        kind,
        radiance: Vec3::splat(LIGHT),
        casts_shadow: true,
        is_visible: true,
        group: 0,
    })
}

fn sphere(center: Vec3, radius: f32) -> Box<dyn Light> {
    light(LightKind::Sphere { center, radius })
}

/// Shines down from `height` above the origin.
fn rectangle(height: f32, half: [f32; 2]) -> Box<dyn Light> {
    light(LightKind::Rectangle {
        center: Vec3::Z * height,
        axes: [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z],
        half,
    })
}

fn disc_light(height: f32, radius: f32) -> Box<dyn Light> {
    light(LightKind::Disc { center: Vec3::Z * height, normal: Vec3::NEG_Z, radius })
}

fn sun(to_light: Vec3, degrees: f64) -> Box<dyn Light> {
    light(LightKind::Sun { to_light, half_angle: degrees.to_radians() })
}

/// Points in the unit square, evenly spread (Roberts, 2018).
fn points() -> impl Iterator<Item = [Lanes; 2]> {
    let unit =
        |i: u32, step: u32| (step.wrapping_mul(i).wrapping_add(1 << 31) >> 8) as f32 / 16_777_216.0;
    (0..4096_u32).map(move |packet| {
        let index = |lane: usize| packet * 16 + u32::try_from(lane).unwrap();
        [
            std::array::from_fn(|lane| unit(index(lane), 3_242_174_889)),
            std::array::from_fn(|lane| unit(index(lane), 2_447_445_414)),
        ]
    })
}

/// Irradiance at `point` on a surface with `normal`, by sampling.
fn irradiance(light: &dyn Light, point: Vec3, normal: Vec3) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    let mut samples = LightSamples::default();
    for u in points() {
        light.sample_li(Supported::default(), &splat3(point), &u, &mut samples);
        for lane in 0..LANES {
            let cosine = lane3(&samples.rays.direction, lane).dot(normal).max(0.0);
            let pdf = if samples.pdf[lane].is_finite() { samples.pdf[lane] } else { 1.0 };
            sum += f64::from(samples.radiance[1][lane] * cosine / pdf);
            count += 1.0;
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "a mean of f32")]
    let mean = (sum / count) as f32;
    mean
}

#[track_caller]
fn check(light: &dyn Light, point: Vec3, normal: Vec3, wanted: f32) {
    let found = irradiance(light, point, normal);
    assert!((found - wanted).abs() <= 2e-3 * wanted + 1e-6, "{found} {wanted}");
}

#[test]
fn spheres_have_their_irradiance() {
    let tilted = Vec3::new(0.6, 0.0, 0.8);
    for (distance, radius) in [(2.0, 1.0), (1.01, 1.0), (100.0, 0.5), (3e4, 1.0)] {
        let light = sphere(Vec3::Z * distance, radius);
        let full = PI * LIGHT * (radius / distance).powi(2);
        check(&*light, Vec3::ZERO, Vec3::Z, full);
        if distance > 1.5 {
            check(&*light, Vec3::ZERO, tilted, 0.8 * full);
        }
    }
    // From inside it is everywhere.
    check(&*sphere(Vec3::ZERO, 2.0), Vec3::new(0.5, 0.2, 0.1), tilted, PI * LIGHT);
}

/// Configuration factor times pi of a rectangle from a corner, parallel to the surface.
fn corner(width: f32, length: f32, height: f32) -> f32 {
    let (a, b) = (width / height, length / height);
    let part = |a: f32, b: f32| {
        let root = (1.0 + a * a).sqrt();
        a / root * (b / root).atan()
    };
    0.5 * (part(a, b) + part(b, a))
}

#[test]
fn rectangles_have_their_irradiance() {
    // Large ones are sampled in solid angle, small ones in area.
    for (height, half) in
        [(1.0, [1.0, 2.0]), (0.1, [1.0, 3.0]), (2.0, [0.1, 0.2]), (50.0, [1.0, 1.0])]
    {
        let light = rectangle(height, half);
        let wanted = 4.0 * LIGHT * corner(half[0], half[1], height);
        check(&*light, Vec3::ZERO, Vec3::Z, wanted);
        // Below a corner, where a quarter of a rectangle of twice the size would be.
        let below = Vec3::new(half[0], half[1], 0.0);
        let wanted = LIGHT * corner(2.0 * half[0], 2.0 * half[1], height);
        check(&*light, below, Vec3::Z, wanted);
        // Behind it there is no light.
        check(&*light, Vec3::Z * (height + 1.0), Vec3::NEG_Z, 0.0);
    }
}

#[test]
fn discs_have_their_irradiance() {
    for (height, radius) in [(1.0, 1.0_f32), (3.0, 0.5), (0.3, 1.0)] {
        let wanted = PI * LIGHT * radius.powi(2) / (radius.powi(2) + height * height);
        check(&*disc_light(height, radius), Vec3::ZERO, Vec3::Z, wanted);
        check(&*disc_light(height, radius), Vec3::Z * 9.0, Vec3::NEG_Z, 0.0);
    }
}

#[test]
fn distant_lights_have_their_irradiance() {
    let to_light = Vec3::new(0.48, -0.36, 0.8);
    for degrees in [0.01, 0.265, 5.0] {
        check(&*sun(to_light, degrees), Vec3::ONE, to_light, LIGHT);
        check(&*sun(to_light, degrees), Vec3::ONE, Vec3::Z, 0.8 * LIGHT);
    }
    check(&*light(LightKind::Directional { to_light }), Vec3::ONE, Vec3::Z, 0.8 * LIGHT);
    let kind = LightKind::Point { position: Vec3::Z * 2.0, falloff: scene::Falloff::InverseSquare };
    check(&*light(kind), Vec3::ZERO, Vec3::new(0.6, 0.0, 0.8), 0.8 * LIGHT / 4.0);
}

#[test]
fn rays_hit_lights_where_they_are_sampled() {
    let lights = [
        sphere(Vec3::new(1.0, 0.5, 2.0), 0.7),
        sphere(Vec3::new(0.0, 0.1, 0.0), 1.0),
        rectangle(1.0, [1.0, 2.0]),
        rectangle(20.0, [1.0, 2.0]),
        disc_light(1.5, 0.8),
        sun(Vec3::new(0.48, -0.36, 0.8), 3.0),
    ];
    let start = Vec3::new(0.1, 0.05, 0.0);
    for (number, light) in lights.iter().enumerate() {
        let (mut samples, mut emission) = (LightSamples::default(), Emission::default());
        let (mut hits, mut count) = (0, 0);
        for u in points().take(256) {
            light.sample_li(Supported::default(), &splat3(start), &u, &mut samples);
            samples.rays.set_len(LANES);
            light.intersect(Supported::default(), &samples.rays, &mut emission);
            for lane in 0..LANES {
                count += 1;
                if emission.lanes >> lane & 1 == 0 {
                    // Rounding at the outline
                    continue;
                }
                hits += 1;
                let (t, wanted) = (emission.t[lane], samples.rays.t_max[lane]);
                assert!(t == wanted || (t / wanted - 1.0).abs() < 5e-3, "{number}: {t} {wanted}");
                let (pdf, wanted) = (emission.pdf[lane], samples.pdf[lane]);
                assert!((pdf / wanted - 1.0).abs() < 2e-3, "{number}: {pdf} {wanted}");
                assert_eq!(emission.radiance.x, samples.radiance[0][lane]);
            }
        }
        assert!(hits * 1000 > count * 985, "{number}: {hits} of {count}");
        // Rays in the opposite direction miss all but the sphere around them.
        let mut rays = RayPacket::default();
        for lane in 0..LANES {
            rays.push(&Ray::new(start, -lane3(&samples.rays.direction, lane)));
        }
        light.intersect(Supported::default(), &rays, &mut emission);
        assert_eq!(emission.lanes != 0, number == 1, "{number}");
    }
}

#[test]
fn the_density_of_hits_is_that_of_uniform_directions() {
    // The integral of the density over the directions that hit the light is 1.
    let lights = [
        sphere(Vec3::new(1.0, 0.5, 2.0), 0.7),
        rectangle(1.0, [1.0, 2.0]),
        rectangle(4.0, [0.3, 0.4]),
        disc_light(1.5, 0.8),
        sun(Vec3::new(0.48, -0.36, 0.8), 9.0),
    ];
    for (number, light) in lights.iter().enumerate() {
        let (mut sum, mut count) = (0.0, 0.0);
        let mut emission = Emission::default();
        for u in points().chain(points().map(|[a, b]| [b, a])) {
            let mut rays = RayPacket::default();
            for (a, b) in u[0].iter().zip(&u[1]) {
                let z = 1.0 - 2.0 * a;
                let level = (1.0 - z * z).sqrt();
                let (sin, cos) = (2.0 * PI * b).sin_cos();
                rays.push(&Ray::new(Vec3::ZERO, Vec3::new(level * cos, level * sin, z)));
            }
            light.intersect(Supported::default(), &rays, &mut emission);
            for lane in 0..LANES {
                if emission.lanes >> lane & 1 == 1 {
                    sum += f64::from(emission.pdf[lane]);
                }
                count += 1.0;
            }
        }
        let integral = sum / count * 4.0 * std::f64::consts::PI;
        assert!((integral - 1.0).abs() < 0.02, "{number}: {integral}");
    }
}
