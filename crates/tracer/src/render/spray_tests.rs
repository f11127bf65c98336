//! Soft spray in images, against values computed by hand.

use std::f32::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};

use super::{
    brute::{Ball, Balls},
    integrator::testing,
    path_tests::{GLASS, floor_from_above, settings, white},
    solid::Solid,
    *,
};
use crate::scene::{Background, Camera, CameraView, Environment, Light};
use spherule_surface::{Intersection, MaterialId, Side};
use spherule_tree::math::{SimdLevel, Supported};
use spherule_tree::ray::Ray;

const SIDE: u32 = 33;

/// Optical depth of a drop through its centre.
const DEPTH: f32 = 2.5;

/// Drops of spray.
struct Drops(Balls);

impl Shape for Drops {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        self.0.crossing(ray, side)
    }

    fn material(&self) -> MaterialId {
        MaterialId::SPRAY
    }
}

fn drop_at(height: f32) -> Drops {
    Drops(Balls::one(height * Vec3::Z, 1.0))
}

/// A cloud of drops that overlap.
fn cloud() -> Drops {
    let ball = |i: u16| Ball {
        center: Vec3::new(
            f32::from(i % 5) - 2.0,
            f32::from(i / 5 % 5) - 2.0,
            0.4 * f32::from(i % 7) - 1.0,
        ) * 0.3,
        radius: 0.2 + 0.05 * f32::from(i % 4),
    };
    Drops(Balls((0..40).map(ball).collect()))
}

/// The plane z = 0 from above, 2.6 units of it.
fn scene(environment: Environment) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, 0.0, 100.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        fov: 1.5,
    };
    let mut scene = Scene {
        background: Background::Constant(Vec3::ONE),
        environment: Some(Arc::new(environment)),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    scene.set_spray_soft(true);
    scene
}

fn image(shapes: &[&dyn Shape], scene: &Scene, settings: &RenderSettings) -> Film {
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    render(shapes, scene, &source, settings, &never).unwrap().0
}

/// Distance of the centre of a pixel in the middle row from the middle of the image, for a view of this width.
fn distance(column: usize, width: f32) -> f32 {
    ((column as f32 + 0.5) / SIDE as f32 - 0.5).abs() * width
}

/// The middle row of a component of the pixels.
fn middle_row(film: &Film, component: usize) -> Vec<f32> {
    let row = (SIDE / 2 * SIDE) as usize;
    film.color[row..row + SIDE as usize].iter().map(|pixel| pixel[component]).collect()
}

#[test]
fn drops_fade_out_towards_their_silhouettes() {
    let settings = RenderSettings { transparent_background: true, ..settings(SIDE, 1024, 0) };
    let film = image(&[&drop_at(0.0)], &scene(white()), &settings);
    let width = 2.0 * 99.0 * (0.75_f32).to_radians().tan();
    for (column, coverage) in middle_row(&film, 3).iter().enumerate() {
        let x = distance(column, width).min(1.0);
        let expected = 1.0 - (-DEPTH * (1.0 - x * x).powf(1.5)).exp();
        assert!((coverage - expected).abs() < 0.05, "{x}: {coverage} {expected}");
    }
    // Without path tracing, and if it is not soft, spray is opaque
    let mut hard = scene(white());
    hard.set_spray_soft(false);
    let film = image(&[&drop_at(0.0)], &hard, &settings);
    assert_eq!(film.color[(SIDE / 2 * SIDE + 2) as usize][3], 0.0);
    assert_eq!(film.color[(SIDE / 2 * SIDE + SIDE / 2) as usize][3], 1.0);
    let whitted = RenderSettings { integrator: IntegratorKind::Whitted, ..settings };
    let film = image(&[&drop_at(0.0)], &scene(white()), &whitted);
    assert_eq!(film.color[(SIDE / 2 * SIDE + SIDE / 2) as usize][3], 1.0);
}

#[test]
fn a_drop_in_white_surroundings_has_its_albedo() {
    let film = image(&[&drop_at(0.0)], &scene(white()), &settings(SIDE, 1024, 0));
    let width = 2.0 * 99.0 * (0.75_f32).to_radians().tan();
    for (column, value) in middle_row(&film, 0).iter().enumerate() {
        let x = distance(column, width).min(1.0);
        let opacity = 1.0 - (-DEPTH * (1.0 - x * x).powf(1.5)).exp();
        let expected = 1.0 - 0.1 * opacity;
        assert!((value - expected).abs() < 0.02, "{x}: {value} {expected}");
    }
}

#[test]
fn shadows_of_drops_are_soft_and_add_up() {
    // A floor that only the light reaches, seen past the drops by a camera below them
    for drops in [vec![2.0], vec![2.0, 5.0]] {
        let mut scene = floor_from_above(Environment::constant(Vec3::ZERO), Vec3::ONE);
        let view = CameraView {
            eye: DVec3::new(0.0, 0.0, 0.9),
            look_at: DVec3::ZERO,
            up: DVec3::Y,
            fov: 106.0,
        };
        scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
        scene.set_spray_soft(true);
        scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::splat(PI)).unwrap()];
        let balls = drops.iter().map(|height| Ball { center: *height * Vec3::Z, radius: 1.0 });
        let cloud = Drops(Balls(balls.collect()));
        let film = image(&[&cloud], &scene, &settings(SIDE, 1, 0));
        let width = 2.0 * 0.9 * 53.0_f32.to_radians().tan();
        for (column, value) in middle_row(&film, 0).iter().enumerate() {
            let x = distance(column, width).min(1.0);
            let depth = DEPTH * drops.len() as f32 * (1.0 - x * x).powf(1.5);
            let expected = (-depth).exp();
            assert!((value - expected).abs() < 1e-3, "{x}: {value} {expected}");
        }
    }
}

#[test]
fn a_thick_cloud_is_white_and_creates_no_light() {
    let film = image(&[&cloud()], &scene(white()), &settings(SIDE, 64, 20));
    let mean = |film: &Film| film.color.iter().map(|p| p[0]).sum::<f32>() / film.color.len() as f32;
    assert!(film.color.iter().all(|pixel| pixel[0] < 1.1 && pixel[0] > 0.5));
    assert!((0.75..0.98).contains(&mean(&film)), "{}", mean(&film));
}

#[test]
fn spray_is_the_same_on_any_number_of_threads_and_for_all_instruction_sets() {
    let mut scene = scene(white());
    *scene.particle_material_mut() = GLASS;
    scene.lights = vec![Light::directional(Vec3::new(0.3, 0.2, -1.0), Vec3::ONE).unwrap()];
    let (cloud, body) = (cloud(), Solid::ball_at(Vec3::new(0.4, 0.0, -0.6), 0.7));
    let shapes: [&dyn Shape; 2] = [&body, &cloud];
    let settings = settings(SIDE, 4, 3);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| image(&shapes, &scene, &settings))
    };
    assert_eq!(on(1), on(3));
    let films: Vec<Vec2> =
        (0..48_u8).map(|i| Vec2::new(f32::from(i % 7) / 7.0, f32::from(i) / 48.0)).collect();
    let source = ParticleShading::constant(Vec3::ONE);
    let by = |level: SimdLevel| {
        let mut context = RenderContext::new(shapes.to_vec(), &scene, &source, &settings);
        context.simd = Supported::or_best(level);
        testing::radiance_at(&PathIntegrator::new(context), &films)
    };
    let portable = by(SimdLevel::Portable);
    for level in [SimdLevel::Avx2, SimdLevel::Avx512, SimdLevel::Neon] {
        assert!(by(level) == portable, "{level:?}");
    }
}
