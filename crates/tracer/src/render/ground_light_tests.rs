//! Caustics and the light of the environment on the ground, against paths that start there and values computed by hand.

use std::f32::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use glam::{DVec3, Vec3};

use super::{
    brute::Balls,
    path_tests::{GLASS, covered, floor_from_above, image, settings, statistics, white},
    solid::Solid,
    *,
};
use crate::scene::{
    Camera, CameraView, Environment, EnvironmentAxes, Ground, Light, LightKind, RadianceMap,
    WetGround,
};

/// Rows of the bright cap around the zenith, of 256.
const CAP_ROWS: usize = 9;

/// A white floor below particles of glass.
fn floor(environment: Environment) -> Scene {
    floor_below(GLASS, environment)
}

/// A white floor below particles of `material`, seen from above. The image shows about 5 by 5 units of it.
pub(super) fn floor_below(material: Material, environment: Environment) -> Scene {
    let mut scene = floor_from_above(environment, Vec3::ONE);
    let view = CameraView {
        eye: DVec3::new(0.0, 0.0, 10.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        fov: 28.0,
    };
    scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    *scene.particle_material_mut() = material;
    if let Some(ground) = &mut scene.ground {
        (ground.fade_start, ground.lit_range) = (12.0, 12.0);
    }
    scene
}

pub(super) fn dark() -> Environment {
    Environment::constant(Vec3::ZERO)
}

pub(super) fn sun(half_angle: f64, irradiance: Vec3) -> Light {
    Light {
        kind: LightKind::Sun { to_light: Vec3::Z, half_angle },
        radiance: irradiance,
        casts_shadow: true,
        is_visible: false,
        group: 0,
    }
}

fn with_photons(photons: u32, samples: u32) -> RenderSettings {
    RenderSettings { photons, max_depth: 8, ..settings(32, samples, 0) }
}

/// Means of the red parts of squares of four by four pixels.
pub(super) fn blocks(film: &Film) -> Vec<f32> {
    let pixel = |x: usize, y: usize| film.color[32 * y + x][0];
    let mean = |block: usize| {
        let [x, y] = [block % 8, block / 8].map(|i| 4 * i);
        (0..16).map(|i| pixel(x + i % 4, y + i / 4)).sum::<f32>() / 16.0
    };
    (0..64).map(mean).collect()
}

/// A large sun at the zenith, as an environment that paths find, with half its angle in radians.
pub(super) fn large_sun() -> (Environment, f64) {
    let mut pixels = vec![Vec3::ZERO; 512 * 256];
    pixels[..512 * CAP_ROWS].fill(Vec3::splat(100.0));
    let map = RadianceMap::new(512, 256, pixels).unwrap();
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let half_angle = std::f64::consts::PI * CAP_ROWS as f64 / 256.0;
    (Environment::from_map(axes, &map, Vec3::ONE), half_angle)
}

/// The pixels in the middle.
fn middle(film: &Film) -> Vec<Vec3> {
    (0..1024)
        .filter(|i| (12..20).contains(&(i % 32)) && (12..20).contains(&(i / 32)))
        .map(|i| Vec3::from_slice(&film.color[i][..3]))
        .collect()
}

#[test]
fn the_caustic_of_a_glass_ball_is_that_of_path_tracing() {
    // The sun as an environment, and as a light
    let (environment, half_angle) = large_sun();
    let irradiance = environment.irradiance(Vec3::Z);
    let ball = Solid::ball_at(Vec3::new(0.0, 0.0, 1.6), 1.0);
    let expected = image(&ball, &floor(environment), Vec3::ONE, &with_photons(0, 1024));
    let mut scene = floor(dark());
    scene.lights = vec![sun(half_angle, irradiance)];
    let found = image(&ball, &scene, Vec3::ONE, &with_photons(2_000_000, 64));
    // The whole light, and where it is
    let [expected, found] = [expected, found].map(|film| blocks(&film));
    let sum = |blocks: &[f32]| blocks.iter().sum::<f32>();
    let ratio = sum(&found) / sum(&expected);
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    let brightest = expected.iter().fold(0.0_f32, |a, b| a.max(*b));
    assert!(brightest > 4.0 * irradiance.x / PI, "{brightest}: no caustic");
    for (number, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let limit = 0.05 * expected + 0.01 * brightest;
        assert!((found - expected).abs() < limit, "{number}: {found} {expected}");
    }
}

#[test]
fn light_below_a_slab_is_what_it_transmits() {
    let mut scene = floor(dark());
    scene.lights = vec![sun(0.01, Vec3::splat(PI))];
    let film = image(&Solid::slab(0.5, 0.7), &scene, Vec3::ONE, &with_photons(400_000, 256));
    // Of repeated reflections between both surfaces remains (1 - r) / (1 + r), and again from the floor to the camera
    let transmitted = 0.96 / 1.04_f32;
    let (mean, deviation) = statistics(&middle(&film));
    let expected = transmitted * transmitted;
    assert!((mean / expected - 1.0).abs() < 0.01, "{mean} {expected}");
    assert!(deviation < 0.05 * mean, "{deviation}");
}

#[test]
fn a_floor_inside_a_slab_is_darker_by_the_square_of_the_index() {
    let mut scene = floor(dark());
    scene.lights = vec![sun(0.01, Vec3::splat(PI))];
    let film = image(&Solid::slab(-0.5, 0.7), &scene, Vec3::ONE, &with_photons(400_000, 256));
    // The light enters the slab once and leaves it once, into a larger solid angle
    let expected = 0.96 * 0.96 / (GLASS.ior * GLASS.ior);
    let (mean, deviation) = statistics(&middle(&film));
    assert!((mean / expected - 1.0).abs() < 0.01, "{mean} {expected}");
    assert!(deviation < 0.05 * mean, "{deviation}");
}

#[test]
fn a_white_floor_below_glass_is_white() {
    let balls = Balls::one(Vec3::new(0.0, 0.0, 1.2), 1.0);
    let settings = RenderSettings { max_depth: 24, bounces: 1000, ..with_photons(1000, 16) };
    for shape in [&balls as &dyn Shape, &Solid::ball_at(Vec3::new(0.0, 0.0, 1.2), 1.0)] {
        let film = image(shape, &floor(white()), Vec3::ONE, &settings);
        let (mean, deviation) = statistics(&covered(&film));
        assert!((mean - 1.0).abs() < 0.01 && deviation < 0.02, "{mean} {deviation}");
    }
}

#[test]
fn without_particles_the_floor_is_lit_as_without_photons() {
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let mut scene = floor(crate::scene::environment::studio(axes, Vec3::ONE));
    scene.lights =
        vec![sun(0.01, Vec3::ONE), Light::directional(Vec3::NEG_Z, Vec3::splat(0.5)).unwrap()];
    let wanted = (scene.environment.as_ref().unwrap().irradiance(Vec3::Z) + 1.5) / PI;
    let film = image(&Balls(Vec::new()), &scene, Vec3::ONE, &with_photons(1000, 16));
    for pixel in covered(&film) {
        // The paths of the environment are few, and vary
        assert!((pixel / wanted - 1.0).abs().max_element() < 0.05, "{pixel} {wanted}");
    }
}

// 30,000 photons on one thread and on three: few photons would be those of one thread.
#[test]
fn photons_are_the_same_on_any_number_of_threads_and_can_be_stopped() {
    let mut scene = floor(white());
    scene.lights = vec![sun(0.02, Vec3::ONE)];
    scene.ground = scene.ground.map(|ground| Ground { color: Vec3::new(0.3, 0.5, 0.2), ..ground });
    let source = ParticleShading::constant(Vec3::ONE);
    let settings = with_photons(30_000, 4);
    let ball = Solid::ball_at(Vec3::new(0.3, 0.0, 1.2), 1.0);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let never = AtomicBool::new(false);
        let draw = || render(&[&ball], &scene, &source, &settings, &never).unwrap();
        pool.build().unwrap().install(draw)
    };
    assert_eq!(on(1), on(3));
    let always = AtomicBool::new(true);
    let stopped = render(&[&ball], &scene, &source, &settings, &always);
    assert_eq!(stopped.unwrap_err(), RenderError::Interrupted);
    // Photons that meet nothing change nothing
    scene.environment = Some(Arc::new(dark()));
    let light =
        |photons| image(&Balls(Vec::new()), &scene, Vec3::ONE, &with_photons(photons, 4)).color;
    assert_eq!(light(10), light(20_000));
}

/// How often it was asked before pixels began, how often these began, and how many there were.
#[derive(Default)]
struct Phases {
    asked_before: AtomicU32,
    begun: AtomicU32,
    pixels: AtomicU32,
}

impl Stop for Phases {
    fn is_raised(&self) -> bool {
        if self.begun.load(Ordering::SeqCst) == 0 {
            self.asked_before.fetch_add(1, Ordering::SeqCst);
        }
        false
    }

    fn pixels_begin(&self) {
        assert_eq!(self.pixels.load(Ordering::SeqCst), 0);
        self.begun.fetch_add(1, Ordering::SeqCst);
    }

    fn pixels_done(&self, count: u32) {
        assert_eq!(self.begun.load(Ordering::SeqCst), 1);
        self.pixels.fetch_add(count, Ordering::SeqCst);
    }
}

#[test]
fn pixels_begin_after_the_light_on_the_ground() {
    let source = ParticleShading::constant(Vec3::ONE);
    let ball = Solid::ball_at(Vec3::new(0.0, 0.0, 1.2), 1.0);
    for photons in [0, 1000] {
        let phases = Phases::default();
        render(&[&ball], &floor(white()), &source, &with_photons(photons, 1), &phases).unwrap();
        let Phases { asked_before, begun, pixels } = phases;
        assert_eq!(asked_before.into_inner() > 0, photons > 0);
        assert_eq!([begun.into_inner(), pixels.into_inner()], [1, 32 * 32]);
    }
}

/// The floor around a ball of water that it cuts in the middle, with an albedo, and a strength of its wetness.
fn around_water(environment: Environment, albedo: f32, strength: f32) -> Film {
    let mut scene = floor(environment);
    scene.particle_material_mut().ior = 1.333;
    scene.lights = vec![sun(0.01, Vec3::splat(PI))];
    if let Some(ground) = &mut scene.ground {
        ground.color = Vec3::splat(albedo);
    }
    scene.wet_ground = Some(WetGround { strength, margin: 0.4 });
    let ball = Solid::ball_at(Vec3::ZERO, 1.0);
    image(&ball, &scene, Vec3::ONE, &with_photons(20_000, 16))
}

#[test]
fn water_darkens_the_floor_below_and_beside_it() {
    let [wet, half, dry] = [1.0, 0.5, 0.0].map(|strength| around_water(dark(), 0.36, strength));
    // Pixels of 0.156 units, in a row from the middle
    let ratio = |film: &Film, distance: usize| {
        let pixel = 32 * 16 + 16 + distance;
        film.color[pixel][0] / dry.color[pixel][0]
    };
    // By hand: see the tests of the film
    for covered in [0, 2, 4] {
        assert!((ratio(&wet, covered) - 0.556).abs() < 0.01, "{covered}");
        assert!((ratio(&half, covered) - 0.778).abs() < 0.01, "{covered}");
    }
    assert!((ratio(&wet, 7) - 0.556).abs() < 0.03, "{}", ratio(&wet, 7));
    let edge = ratio(&wet, 8);
    assert!(edge > 0.56 && edge < 0.95, "{edge}");
    for far in [11, 13, 15] {
        assert_eq!(ratio(&wet, far), 1.0, "{far}");
    }
}

#[test]
fn a_wet_floor_beside_water_reflects_the_sky() {
    let mut lights = [0.0, 1.0].map(|strength| {
        let film = around_water(white(), 0.0, strength);
        [0, 7, 15].map(|distance| film.color[32 * 16 + 16 + distance][0])
    });
    let ([dry, wet], expected) = (&mut lights, (0.333_f32 / 2.333).powi(2));
    assert_eq!(dry[1], 0.0);
    assert!((wet[1] - expected).abs() < 0.2 * expected, "{}", wet[1]);
    // But not under water, or far from it
    assert_eq!(wet[0], dry[0]);
    assert_eq!(wet[2], 0.0);
}
