//! Spheres that are not fully opaque, against values computed by hand.

use std::f32::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};

use super::{
    brute::{Ball, Balls},
    integrator::testing,
    path_tests::{floor_from_above, settings, white},
    *,
};
use crate::scene::{Background, Camera, CameraView, Environment, Light};
use spherule_surface::{Intersection, Side, spheres::SphereSurface};
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use spherule_tree::math::{SimdLevel, Supported};
use spherule_tree::ray::Ray;

const SIDE: u32 = 16;

/// Balls of radius 1 above each other, the highest first.
fn tower(count: u16) -> Balls {
    let ball = |i: u16| Ball { center: 3.0 * f32::from(count - i) * Vec3::Z, radius: 1.0 };
    Balls((0..count).map(ball).collect())
}

/// The middle of the balls from above, 0.5 units of it.
fn scene() -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, 0.0, 100.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        fov: 0.3,
    };
    Scene {
        background: Background::Constant(Vec3::ONE),
        environment: Some(Arc::new(white())),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

fn translucent(opacity: f32) -> ParticleShading<'static> {
    ParticleShading {
        opacities: Opacities::Constant(opacity),
        ..ParticleShading::constant(Vec3::ONE)
    }
}

fn image(
    balls: &Balls,
    scene: &Scene,
    source: &ParticleShading<'_>,
    settings: &RenderSettings,
) -> Film {
    let never = AtomicBool::new(false);
    render(&[balls], scene, source, settings, &never).unwrap().0
}

/// The mean of a component of all pixels.
fn mean(film: &Film, component: usize) -> f32 {
    film.color.iter().map(|pixel| pixel[component]).sum::<f32>() / film.color.len() as f32
}

// 18 images with 64 samples a pixel: their noise has to be less than the tolerance.
#[test]
fn layers_cover_what_they_leave_of_each_other() {
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let settings =
            RenderSettings { transparent_background: true, integrator, ..settings(SIDE, 64, 0) };
        let coverage = |count: u16, source: &ParticleShading<'_>| {
            mean(&image(&tower(count), &scene(), source, &settings), 3)
        };
        for (count, opacity) in [(1, 0.3), (2, 0.3), (5, 0.3), (6, 0.05)] {
            let found = coverage(count, &translucent(opacity));
            let expected = 1.0 - (1.0 - opacity).powi(count.into());
            let error = (found - expected).abs();
            assert!(error < 1.6e-2, "{integrator:?} {count}: {found} {expected}");
        }
        assert_eq!(coverage(3, &translucent(0.0)), 0.0);
        assert_eq!(coverage(3, &translucent(1.0)), 1.0);
        // A value of each ball: the opacities are 0.5, 0, 0.25 and, outside of the range, 1 and 0
        for (values, expected) in [
            ([-2.0, 0.0, -1.0], 1.0 - 0.5 * 0.75),
            ([f32::NAN, -1.0, 3.0], 0.25),
            ([-2.0, -9.0, 3.0], 1.0),
        ] {
            let source = ParticleShading {
                opacities: Opacities::Mapped { values: &values, range: [0.0, -4.0] },
                ..ParticleShading::constant(Vec3::ONE)
            };
            let found = coverage(3, &source);
            assert!((found - expected).abs() < 1.6e-2, "{found} {expected}");
        }
    }
}

#[test]
fn shapes_cover_what_they_leave_of_each_other() {
    let settings = RenderSettings { transparent_background: true, ..settings(SIDE, 64, 0) };
    let [near, far] = [0, 1].map(|index| Balls(vec![tower(2).0[index]]));
    let source = translucent(0.3);
    for shapes in [[&near as &dyn Shape, &far], [&far, &near]] {
        let never = AtomicBool::new(false);
        let film = render(&shapes, &scene(), &source, &settings, &never).unwrap().0;
        let (found, expected) = (mean(&film, 3), 1.0 - 0.7_f32.powi(2));
        assert!((found - expected).abs() < 1.6e-2, "{found} {expected}");
    }
}

#[test]
fn the_order_of_particles_does_not_matter() {
    let settings = settings(SIDE, 16, 2);
    let tower = tower(4);
    let mut turned = tower.0.clone();
    turned.reverse();
    let of = |balls: &Balls| image(balls, &scene(), &translucent(0.4), &settings).color;
    assert_eq!(of(&tower), of(&Balls(turned)));
}

#[test]
fn white_layers_in_white_surroundings_are_white() {
    let film = image(&tower(1), &scene(), &translucent(0.4), &settings(SIDE, 256, 0));
    assert!((mean(&film, 0) - 1.0).abs() < 4e-3, "{}", mean(&film, 0));
    // Light that the balls keep from each other is missing, and none is added
    let film = image(&tower(4), &scene(), &translucent(0.4), &settings(SIDE, 256, 4));
    assert!((0.9..1.01).contains(&mean(&film, 0)), "{}", mean(&film, 0));
}

/// A floor that only the light reaches, seen by a camera below the balls.
fn floor() -> Scene {
    let mut scene = floor_from_above(Environment::constant(Vec3::ZERO), Vec3::ONE);
    let view = CameraView {
        eye: DVec3::new(0.0, 0.0, 0.9),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        fov: 20.0,
    };
    scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::splat(PI)).unwrap()];
    scene
}

#[test]
fn shadows_are_attenuated_by_all_layers() {
    for (count, opacity) in [(0, 0.3), (1, 0.3), (4, 0.3), (3, 1.0)] {
        let film = image(&tower(count), &floor(), &translucent(opacity), &settings(SIDE, 1, 0));
        let expected = (1.0 - opacity).powi(count.into());
        for pixel in &film.color {
            assert!((pixel[0] - expected).abs() < 1e-3, "{count}: {pixel:?} {expected}");
        }
    }
    // The ambient light of Whitted's model casts no shadows
    let settings = RenderSettings { integrator: IntegratorKind::Whitted, ..settings(SIDE, 1, 0) };
    let of = |count| mean(&image(&tower(count), &floor(), &translucent(0.5), &settings), 0);
    let (first, second) = (of(0) - of(1), of(1) - of(2));
    assert!(second > 0.01 && (first / second - 2.0).abs() < 1e-3, "{first} {second}");
}

#[test]
fn opacities_are_the_same_on_any_number_of_threads_and_for_all_instruction_sets() {
    let (scene, settings, source) = (scene(), settings(SIDE, 4, 3), translucent(0.3));
    let balls = tower(5);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| image(&balls, &scene, &source, &settings))
    };
    assert_eq!(on(1), on(3));
    let films: Vec<Vec2> =
        (0..48_u8).map(|i| Vec2::new(f32::from(i % 7) / 7.0, f32::from(i) / 48.0)).collect();
    let by = |level: SimdLevel| {
        let mut context = RenderContext::new(vec![&balls], &scene, &source, &settings);
        context.simd = Supported::or_best(level);
        testing::radiance_at(&PathIntegrator::new(context), &films)
    };
    let portable = by(SimdLevel::Portable);
    for level in [SimdLevel::Avx2, SimdLevel::Avx512, SimdLevel::Neon] {
        assert!(by(level) == portable, "{level:?}");
    }
}

/// Spheres that are found one after the other along a ray.
struct StepByStep<'a>(SphereSurface<'a>);

impl Shape for StepByStep<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        self.0.crossing(ray, side)
    }
}

/// A cloud of overlapping balls around the origin.
fn cloud(count: u32) -> Vec<Vec3> {
    let part = |i: u32, step: u32| (i.wrapping_mul(step) >> 8) as f32 / 16_777_216.0 - 0.5;
    let center =
        |i: u32| Vec3::new(part(i, 3_430_631_191), part(i, 2_739_110_765), part(i, 2_186_918_459));
    (0..count).map(center).collect()
}

#[test]
fn entries_in_any_order_give_the_picture_of_steps_along_the_ray() {
    let centers = cloud(400);
    let values: Vec<f32> = (0..400_u16).map(|i| f32::from(i % 10) / 9.0).collect();
    let mapped = ParticleShading {
        opacities: Opacities::Mapped { values: &values, range: [0.0, 1.0] },
        ..ParticleShading::constant(Vec3::ONE)
    };
    let settings = RenderSettings { transparent_background: true, ..settings(SIDE, 4, 3) };
    let view = CameraView {
        eye: DVec3::new(0.0, 0.0, 3.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        fov: 12.0,
    };
    let mut scene = scene();
    scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    scene.lights = vec![Light::directional(Vec3::new(-0.4, 0.3, -1.0), Vec3::splat(PI)).unwrap()];
    let (mut builder, never) = (TreeBuilder::new(), AtomicBool::new(false));
    for structure in [Structure::Kdtree, Structure::Sbvh] {
        let spheres = Spheres { centers: &centers, radius: SphereRadius::Common(0.05) };
        builder.build(
            &spheres,
            &BuildSettings { structure, keep_indices: true, ..BuildSettings::default() },
        );
        let surface = SphereSurface::new(builder.tree().view());
        for source in [&translucent(0.02), &translucent(0.5), &mapped] {
            let of = |shape: &dyn Shape| render(&[shape], &scene, source, &settings, &never);
            let (packets, steps) = (of(&surface).unwrap().0, of(&StepByStep(surface)).unwrap().0);
            assert!(mean(&packets, 3) > 0.03);
            // Steps leave out spheres that a ray enters just behind the end of another one
            let pixels = packets.color.iter().zip(&steps.color);
            let differs = |(a, b): &(&[f32; 4], &[f32; 4])| {
                a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 1e-4)
            };
            let different = pixels.filter(differs).count();
            assert!(different < 6, "{structure:?}: {different} of {} pixels", SIDE * SIDE);
        }
    }
}
