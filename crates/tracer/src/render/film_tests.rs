//! Whoever renders sets every pixel of every plane: films are never cleared before.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::super::brute::Balls;
use super::super::{IntegratorKind, ParticleShading, RenderSettings, render_into};
use super::{Channels, Film, FilmPlane};
use crate::render::layers::LightClass;
use crate::scene::{Background, Bounds, Camera, Framed, Framing, Ground, Scene, default_lights};

/// Bits that no renderer makes: of a float, a NaN with a payload.
const POISON: u32 = 0x7fad_beef;

fn poisoned(width: u32, height: u32, channels: Channels) -> Film {
    let mut film = Film::new(width, height, channels);
    film.color.fill([f32::from_bits(POISON); 4]);
    film.planes.iter_mut().for_each(|words| words.fill(POISON));
    film
}

/// All numbers of all planes.
fn bits(film: &Film) -> Vec<u32> {
    let colors = film.color.iter().flatten().map(|value| value.to_bits());
    colors.chain(film.planes.iter().flatten().copied()).collect()
}

/// A ball in the middle of nothing, or of a plane.
fn scene(has_ground: bool) -> Scene {
    let bounds = Bounds { min: DVec3::NEG_ONE, max: DVec3::ONE };
    let view = Framed::corners(&bounds).view(&Framing::three_quarter(DVec3::Z, 1.5));
    Scene {
        lights: default_lights(&bounds, DVec3::Z, &view),
        background: Background::default_for(Vec3::Z),
        ground: has_ground.then(|| Ground::under(&bounds, Vec3::Z, DVec3::ZERO)),
        ..Scene::new(Camera::new(&view, 1.5, DVec3::ZERO).unwrap())
    }
}

/// Renders into new planes and into poisoned ones, and compares.
#[track_caller]
fn check(settings: &RenderSettings, scene: &Scene) {
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let source = ParticleShading::constant(Vec3::new(0.3, 0.5, 0.8));
    let never = AtomicBool::new(false);
    let (width, height, channels) = (settings.width, settings.height, settings.channels);
    let what = (width, height, settings.samples, channels);
    let into = |mut film: Film| {
        render_into(&mut film, &[&ball], scene, &source, settings, &never).unwrap();
        film
    };
    let poisoned = poisoned(width, height, channels);
    let memory = poisoned.color.as_ptr();
    let film = into(poisoned);
    assert_eq!(film.color.as_ptr(), memory, "{what:?}");
    let bits = bits(&film);
    assert!(!bits.contains(&POISON), "{what:?}");
    assert!(bits == self::bits(&into(Film::default())), "{what:?}");
    assert_eq!(film.channels(), channels);
}

#[test]
fn every_set_of_planes_is_written_whole() {
    for bits in 0..64_u32 {
        let is_given = |plane: &FilmPlane| bits >> *plane as u32 & 1 == 1;
        let planes: Vec<_> = FilmPlane::all().filter(is_given).collect();
        let settings = RenderSettings {
            channels: Channels::COLOR.with(&planes),
            ..RenderSettings::new(19, 18)
        };
        check(&settings, &scene(bits % 3 == 0));
    }
}

#[test]
fn every_layer_is_written_whole() {
    for names in [&["lights"][..], &["shadow", "crypto_part"], &LAYERS] {
        for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
            let mut channels = Channels::from_names(names.iter().copied()).unwrap();
            channels.layers.attributes = 2;
            let settings =
                RenderSettings { channels, integrator, samples: 3, ..RenderSettings::new(19, 18) };
            check(&settings, &scene(true));
            check(&settings, &scene(false));
        }
    }
}

#[test]
fn light_channels_add_up_to_the_color() {
    let source = ParticleShading::constant(Vec3::new(0.3, 0.5, 0.8));
    let never = AtomicBool::new(false);
    for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
        for (has_ground, transmission) in [(false, 0.0), (true, 0.0), (true, 0.7)] {
            let mut scene = scene(has_ground);
            scene.particle_material_mut().transmission = transmission;
            scene.particle_material_mut().reflection = 0.5;
            let settings = RenderSettings {
                channels: Channels::from_names(["lights"]).unwrap(),
                integrator,
                samples: 5,
                ..RenderSettings::new(40, 30)
            };
            let ball = Balls::one(Vec3::ZERO, 1.0);
            let mut film = Film::default();
            render_into(&mut film, &[&ball], &scene, &source, &settings, &never).unwrap();
            let light = |class: LightClass| film.plane::<Vec3>(class.plane()).unwrap();
            let lights = LightClass::ALL.map(light);
            for (pixel, color) in film.color.iter().enumerate() {
                for (axis, expected) in color[..3].iter().enumerate() {
                    let sum: f32 = lights.iter().map(|light| light[pixel][axis]).sum();
                    let limit = 1e-5 * expected.max(1.0);
                    assert!((sum - expected).abs() < limit, "{sum} of {expected}");
                }
            }
        }
    }
}

const LAYERS: [&str; 5] = ["lights", "noisy", "shadow", "motion", "cryptomatte"];

#[test]
fn tiles_of_every_shape_are_written_whole() {
    let sizes = [
        (1, 1),
        (2, 1),
        (1, 40),
        (15, 15),
        (16, 16),
        (17, 17),
        (31, 33),
        (48, 16),
        (16, 49),
        (65, 3),
    ];
    for (width, height) in sizes {
        for samples in [1, 3, 16] {
            for has_ground in [false, true] {
                let settings = RenderSettings {
                    samples,
                    channels: Channels::ALL,
                    ..RenderSettings::new(width, height)
                };
                check(&settings, &scene(has_ground));
            }
        }
    }
}
