//! The light of photons on opaque particles beside transmissive ones, against path tracing and values computed by hand.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{
    brute::{Ball, Balls},
    ground_light_tests::{blocks, dark, large_sun, sun},
    path_tests::{GLASS, settings},
    *,
};
use crate::scene::{Background, Camera, CameraView, Environment, Light};
use spherule_surface::{MaterialId, OwnedBody};

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

// 1,000,000 photons, and paths with 1,024 samples a pixel: the noise of both has to be small.
#[test]
fn an_opaque_particle_has_the_caustic_of_path_tracing() {
    // The sun as an environment, and as a light
    let (environment, half_angle) = large_sun();
    let irradiance = environment.irradiance(Vec3::Z);
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
