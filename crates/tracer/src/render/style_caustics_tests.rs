//! The light of photons on opaque particles beside transmissive ones, against path tracing and values computed by hand.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{
    brute::{Ball, Balls},
    path_tests::{GLASS, settings},
    *,
};
use crate::scene::{
    Background, Camera, CameraView, Environment, EnvironmentAxes, Light, LightKind, RadianceMap,
};
use spherule_surface::{MaterialId, OwnedBody};

/// Rows of the bright cap around the zenith, of 256.
const CAP_ROWS: usize = 9;

/// A ball at this height: one of glass is above an opaque one, which is white.
fn ball(z: f32) -> Balls {
    Balls(vec![Ball { center: z * Vec3::Z, radius: 0.6 }])
}

/// The opaque ball from the side.
fn scene(environment: Environment, lights: Vec<Light>) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -8.0, 3.0),
        look_at: 0.2 * DVec3::Z,
        up: DVec3::Z,
        fov: 10.0,
    };
    let mut scene = Scene {
        background: Background::Constant(Vec3::ZERO),
        environment: Some(Arc::new(environment)),
        materials: Scene::basic_materials(GLASS),
        lights,
        particles: [Vec3::new(-0.6, -0.6, -0.6), Vec3::new(0.6, 0.6, 1.9)],
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    scene.add_style(Material::DEFAULT).unwrap();
    scene
}

fn sun(half_angle: f64, irradiance: f32) -> Light {
    Light {
        kind: LightKind::Sun { to_light: Vec3::Z, half_angle },
        radiance: Vec3::splat(irradiance),
        casts_shadow: true,
        is_visible: false,
        group: 0,
    }
}

fn image(scene: &Scene, photons: u32, samples: u32) -> Film {
    let settings = RenderSettings { photons, max_depth: 8, ..settings(32, samples, 0) };
    let material = MaterialId::at(MaterialId::BASIC).unwrap();
    let style = StyleShading {
        first: 1,
        material,
        colors: Colors::Constant(Vec3::ONE),
        opacities: Opacities::Constant(1.0),
    };
    let source = ParticleShading { styles: vec![style], ..ParticleShading::constant(Vec3::ONE) };
    let opaque = OwnedBody::new(Box::new(ball(0.0)), material, 1);
    let never = AtomicBool::new(false);
    render(&[&ball(1.3), &opaque], scene, &source, &settings, &never).unwrap().0
}

/// Means of the red parts of squares of four by four pixels.
fn blocks(film: &Film) -> Vec<f32> {
    let pixel = |x: usize, y: usize| film.color[32 * y + x][0];
    let mean = |block: usize| {
        let [x, y] = [block % 8, block / 8].map(|i| 4 * i);
        (0..16).map(|i| pixel(x + i % 4, y + i / 4)).sum::<f32>() / 16.0
    };
    (0..64).map(mean).collect()
}

// 1,000,000 photons, and paths with 1,024 samples a pixel: the noise of both has to be small.
#[test]
fn an_opaque_particle_has_the_caustic_of_path_tracing() {
    // A large sun at the zenith, as an environment that paths find, and as a light
    let mut pixels = vec![Vec3::ZERO; 512 * 256];
    pixels[..512 * CAP_ROWS].fill(Vec3::splat(100.0));
    let map = RadianceMap::new(512, 256, pixels).unwrap();
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let environment = Environment::from_map(axes, &map, Vec3::ONE);
    let irradiance = environment.irradiance(Vec3::Z).x;
    let half_angle = std::f64::consts::PI * CAP_ROWS as f64 / 256.0;
    let dark = || Environment::constant(Vec3::ZERO);
    let expected = image(&scene(environment, Vec::new()), 0, 1024);
    let lit = scene(dark(), vec![sun(half_angle, irradiance)]);
    let found = image(&lit, 1_000_000, 64);
    let straight = image(&lit, 0, 64);
    let [expected, found, straight] = [&expected, &found, &straight].map(blocks);
    let [brightest, of_straight] =
        [&expected, &straight].map(|blocks| blocks.iter().fold(0.0_f32, |a, b| a.max(*b)));
    let focused = brightest / of_straight;
    assert!(focused > 2.5, "{focused}: no caustic");
    let sum = |blocks: &[f32]| blocks.iter().sum::<f32>();
    let ratio = sum(&found) / sum(&expected);
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    for (number, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let limit = 0.05 * expected + 0.02 * brightest;
        assert!((found - expected).abs() < limit, "{number}: {found} {expected}");
    }
}
