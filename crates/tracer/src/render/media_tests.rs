//! Media that scatter light, against conservation of energy, integrals by hand, and one way of lighting against another.

use std::f32::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use crate::render::brute::{Ball, Balls};
use crate::render::ground_light_tests::{dark, floor_below, sun};
use crate::render::layers::LightClass;
use crate::render::path_tests::{covered, floor_from_above, image, settings, statistics, white};
use crate::render::phase::henyey_greenstein;
use crate::render::solid::Solid;
use crate::render::*;
use crate::scene::Material;
use crate::scene::{
    Background, Camera, CameraView, Environment, EnvironmentAxes, Fresnel, Light, RadianceMap,
    Scene,
};
use spherule_surface::{OwnedBody, Shape};

/// A medium without a surface that refracts.
const FOG: Material =
    Material { ior: 1.0, transmission: 1.0, fresnel: Fresnel::Exact, ..Material::DEFAULT };

/// [`FOG`] with these coefficients of absorption and scattering.
fn fog(absorption: Vec3, scattering: Vec3, anisotropy: f32) -> Material {
    Material { extinction: absorption + scattering, scattering, anisotropy, ..FOG }
}

/// Looks at the origin from above, with all rays almost through the origin.
fn scene(material: Material, environment: Environment) -> Scene {
    let (eye, up) = (DVec3::new(0.0, 0.0, 9.0), DVec3::Y);
    let view = CameraView { eye, look_at: DVec3::ZERO, up, fov: 1.0 };
    Scene {
        materials: Scene::basic_materials(material),
        background: Background::Constant(Vec3::ZERO),
        environment: Some(Arc::new(environment)),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

/// Mean colour of the pixels in the middle.
fn middle(film: &Film, side: usize) -> Vec3 {
    let is_middle = |i: usize| [i % side, i / side].iter().all(|x| x.abs_diff(side / 2) < side / 4);
    let found = (0..side * side).filter(|i| is_middle(*i));
    let colors: Vec<Vec3> = found.map(|i| Vec3::from_slice(&film.color[i][..3])).collect();
    colors.iter().sum::<Vec3>() / colors.len() as f32
}

#[track_caller]
fn assert_near(found: Vec3, expected: Vec3, limit: f32) {
    let error = (found - expected).abs().max_element();
    assert!(error < limit, "{found} is not {expected}");
}

#[test]
fn what_scatters_all_light_is_invisible_in_white_surroundings() {
    let balls = Balls(vec![Ball { center: Vec3::ZERO, radius: 1.0 }]);
    let body = Solid::ball(1.0);
    let settings = RenderSettings { max_depth: 24, ..settings(12, 64, 1000) };
    for shape in [&balls as &dyn Shape, &body] {
        for (scattering, anisotropy, ior) in [
            (Vec3::splat(1.5), 0.0, 1.0),
            (Vec3::new(0.3, 1.0, 4.0), 0.6, 1.0),
            (Vec3::new(2.0, 0.0, 0.5), -0.5, 1.333),
        ] {
            let material = Material { ior, ..fog(Vec3::ZERO, scattering, anisotropy) };
            let film = image(shape, &scene(material, white()), Vec3::ONE, &settings);
            let pixels = covered(&film);
            let mean = pixels.iter().sum::<Vec3>() / pixels.len() as f32;
            assert_near(mean, Vec3::ONE, 0.015);
            // With absorption, some light is missing, and none if nothing scatters is there
            let murky = Vec3::new(0.2, 0.4, 0.1);
            let material = Material { ior, ..fog(murky, scattering, anisotropy) };
            let film = image(shape, &scene(material, white()), Vec3::ONE, &settings);
            let lossy = middle(&film, 12);
            let straight = (-2.0 * (murky + scattering)).exp();
            assert!(lossy.cmplt(Vec3::splat(0.97)).all(), "{lossy}");
            let scatters = scattering.cmpgt(Vec3::ZERO);
            assert!((lossy.cmpgt(straight * 1.05) | !scatters).all(), "{lossy} {straight}");
        }
    }
}

#[test]
fn media_attenuate_what_is_behind_them() {
    // Almost no light is scattered, but rays end by the extinction
    let absorption = Vec3::new(0.1, 0.7, 1.5);
    let film = |scattering: Vec3| {
        let scene = scene(fog(absorption, scattering, 0.0), white());
        image(&Solid::slab(-1.0, 1.0), &scene, Vec3::ONE, &settings(8, 4096, 0))
    };
    let expected = (-2.0 * absorption).exp();
    assert_near(middle(&film(Vec3::splat(1e-6)), 8), expected, 3e-3);
    assert_near(middle(&film(Vec3::ZERO), 8), expected, 1e-4);
}

#[test]
fn single_scattering_is_the_integral_along_the_ray() {
    let (absorption, scattering) = (Vec3::new(0.2, 0.1, 0.0), Vec3::new(0.1, 0.4, 0.8));
    let extinction = absorption + scattering;
    let thickness = 2.0;
    let irradiance = Vec3::new(3.0, 2.0, 1.0);
    for (anisotropy, ior) in [(0.0, 1.0), (0.6, 1.0), (-0.3, 1.0), (0.6, 1.4)] {
        // Nothing reflects, so that light passes the surface twice
        let material = Material { ior, reflection: 0.0, ..fog(absorption, scattering, anisotropy) };
        let passes = 1.0 - ((ior - 1.0) / (ior + 1.0)).powi(2);
        let entered = irradiance * passes * passes / (ior * ior);
        // From behind the camera, and towards it
        let back = (1.0 - (-2.0 * thickness * extinction).exp()) / (2.0 * extinction);
        let ahead = thickness * (-thickness * extinction).exp();
        for (direction, path, cosine) in [(Vec3::NEG_Z, back, -1.0), (Vec3::Z, ahead, 1.0)] {
            let expected = entered * scattering * path * henyey_greenstein(anisotropy, cosine);
            let mut scene = scene(material, dark());
            scene.lights = vec![Light::directional(direction, irradiance).unwrap()];
            for place in 0..3 {
                let (slab, ball) =
                    (Solid::slab(-1.0, 1.0), Balls::one(Vec3::ZERO, 0.5 * thickness));
                let shape: Box<dyn Shape> = match place {
                    0 => Box::new(slab),
                    1 => Box::new(ball),
                    _ => {
                        let mut style = material;
                        style.priority = 1;
                        *scene.particle_material_mut() = Material::DEFAULT;
                        let id = scene.add_style(style).unwrap();
                        Box::new(OwnedBody::new(Box::new(slab), id, 0))
                    }
                };
                let film = image(&*shape, &scene, Vec3::ONE, &settings(6, 2048, 0));
                let found = middle(&film, 6);
                let error = ((found - expected) / expected).abs().max_element();
                assert!(error < 0.03, "{place} {anisotropy} {ior} {direction}: {found} {expected}");
            }
        }
    }
}

/// Light loses a part in each of many spheres behind each other, whether these scatter light or not.
#[test]
fn shadow_rays_pass_many_spheres() {
    let center = |i: u16| Vec3::new(0.0, 0.0, 0.1 + 0.1 * f32::from(i));
    let column = || (0..60).map(|i| Ball { center: center(i), radius: 0.04 }).collect();
    let eye = DVec3::new(0.0, -9.0, 9.0);
    let view = CameraView { eye, look_at: DVec3::ZERO, up: DVec3::Z, fov: 0.05 };
    let brightness = |scattering: Vec3| {
        let material = Material { ior: 1.5, ..fog(Vec3::ZERO, scattering, 0.0) };
        let scene = Scene {
            camera: Camera::new(&view, 1.0, DVec3::ZERO).unwrap(),
            materials: Scene::basic_materials(material),
            lights: vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()],
            ..floor_from_above(dark(), Vec3::ONE)
        };
        let settings = RenderSettings { photons: 0, ..settings(8, 16, 0) };
        middle(&image(&Balls(column()), &scene, Vec3::ONE, &settings), 8)
    };
    // Each surface reflects 4 %
    let expected = Vec3::splat(0.96_f32.powi(120) / PI);
    for scattering in [Vec3::ZERO, Vec3::splat(1e-5)] {
        assert_near(brightness(scattering) / expected, Vec3::ONE, 0.05);
    }
}

/// A sun with a fifteenth of the sky, as an environment that paths find, with half its angle in radians.
fn wide_sun() -> (Environment, f64) {
    let rows = 40;
    let mut pixels = vec![Vec3::ZERO; 512 * 256];
    pixels[..512 * rows].fill(Vec3::splat(5.0));
    let map = RadianceMap::new(512, 256, pixels).unwrap();
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let half_angle = std::f64::consts::PI * f64::from(u32::try_from(rows).unwrap()) / 256.0;
    (Environment::from_map(axes, &map, Vec3::ONE), half_angle)
}

#[test]
fn lights_and_the_environment_light_media_alike() {
    // The sun as an environment, which paths find, and as a light, to which shadow rays lead
    let (environment, half_angle) = wide_sun();
    let irradiance = environment.irradiance(Vec3::Z);
    let material = fog(Vec3::new(0.1, 0.2, 0.3), Vec3::new(3.0, 1.0, 0.4), 0.4);
    let balls = Balls(vec![
        Ball { center: Vec3::new(-0.4, 0.0, 0.0), radius: 0.6 },
        Ball { center: Vec3::new(0.5, 0.1, 1.2), radius: 0.5 },
    ]);
    let body = Solid::ball(0.8);
    for shape in [&balls as &dyn Shape, &body] {
        let mean = |scene: &Scene, samples: u32| {
            let settings = RenderSettings { max_depth: 16, ..settings(24, samples, 30) };
            let pixels = covered(&image(shape, scene, Vec3::ONE, &settings));
            pixels.iter().sum::<Vec3>() / pixels.len() as f32
        };
        let wide = |environment: Environment| {
            let mut scene = scene(material, environment);
            let view = CameraView {
                eye: DVec3::new(0.0, -9.0, 2.0),
                look_at: DVec3::ZERO,
                up: DVec3::Z,
                fov: 20.0,
            };
            scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
            scene
        };
        let expected = mean(&wide(environment.clone()), 2048);
        let mut lit = wide(dark());
        lit.lights = vec![sun(half_angle, irradiance)];
        let found = mean(&lit, 256);
        let error = ((found - expected) / expected).abs().max_element();
        assert!(error < 0.03, "{found} {expected}");
    }
}

#[test]
fn photons_bring_no_light_twice() {
    // Without photons, light passes the body straight, which is the same where nothing refracts
    let material = fog(Vec3::splat(0.1), Vec3::new(0.4, 0.8, 1.6), 0.0);
    let center = Vec3::new(0.0, 0.0, 1.2);
    let balls = Balls::one(center, 1.0);
    let body = Solid::ball_at(center, 1.0);
    for shape in [&balls as &dyn Shape, &body] {
        let mean = |photons: u32| {
            let mut scene = floor_below(material, dark());
            scene.lights = vec![sun(0.01, Vec3::splat(PI))];
            let settings = RenderSettings { photons, max_depth: 16, ..settings(32, 64, 20) };
            let film = image(shape, &scene, Vec3::ONE, &settings);
            let colors = film.color.iter().map(|c| Vec3::from_slice(&c[..3]));
            (colors.sum::<Vec3>() / 1024.0, middle(&film, 32))
        };
        let (all, inner) = mean(0);
        let (all_by_photons, inner_by_photons) = mean(400_000);
        assert_near(all_by_photons / all, Vec3::ONE, 0.02);
        assert_near(inner_by_photons / inner, Vec3::ONE, 0.04);
    }
}

#[test]
fn a_white_floor_below_media_is_white() {
    let material = Material { ior: 1.2, ..fog(Vec3::ZERO, Vec3::new(0.3, 0.8, 1.5), 0.5) };
    let center = Vec3::new(0.0, 0.0, 1.2);
    let (balls, body) = (Balls::one(center, 1.0), Solid::ball_at(center, 1.0));
    let settings = RenderSettings { max_depth: 24, photons: 1000, ..settings(16, 32, 1000) };
    for shape in [&balls as &dyn Shape, &body] {
        let film = image(shape, &floor_below(material, white()), Vec3::ONE, &settings);
        let (mean, _) = statistics(&covered(&film));
        assert!((mean - 1.0).abs() < 0.01, "{mean}");
    }
}

#[test]
fn data_channels_are_those_of_clear_glass() {
    let murky = Material { ior: 1.3, ..fog(Vec3::ZERO, Vec3::splat(3.0), 0.0) };
    let clear = Material { extinction: Vec3::ZERO, scattering: Vec3::ZERO, ..murky };
    let settings = RenderSettings { channels: Channels::ALL, max_depth: 8, ..settings(16, 8, 4) };
    // From outside, and from inside the body
    for eye in [9.0, 0.3] {
        let film = |material: Material| {
            let mut scene = scene(material, white());
            let view = CameraView {
                eye: DVec3::new(0.0, 0.0, eye),
                look_at: DVec3::new(0.0, 0.0, eye - 1.0),
                up: DVec3::Y,
                fov: 12.0,
            };
            scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
            scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
            image(&Solid::ball(1.0), &scene, Vec3::ONE, &settings)
        };
        let (murky, clear) = (film(murky), film(clear));
        assert_ne!(murky.color, clear.color);
        for plane in [FilmPlane::Depth, FilmPlane::Normal, FilmPlane::Position] {
            assert_eq!(murky.plane::<f32>(plane), clear.plane::<f32>(plane), "{plane:?}");
        }
        assert_eq!(murky.plane::<u32>(FilmPlane::Id), clear.plane::<u32>(FilmPlane::Id));
        let coverage = |film: &Film| film.color.iter().map(|c| c[3]).collect::<Vec<f32>>();
        assert_eq!(coverage(&murky), coverage(&clear));
    }
}

#[test]
fn pictures_do_not_depend_on_threads_and_classes_of_light_add_up() {
    let material =
        Material { ior: 1.3, ..fog(Vec3::new(0.1, 0.2, 0.3), Vec3::new(3.0, 1.0, 0.4), 0.4) };
    let mut scene = floor_below(material, Environment::constant(Vec3::splat(0.3)));
    scene.lights = vec![sun(0.1, Vec3::ONE)];
    let settings = RenderSettings {
        channels: Channels::from_names(["lights", "direct", "indirect", "Z", "N", "id"]).unwrap(),
        max_depth: 8,
        photons: 20_000,
        ..settings(37, 5, 6)
    };
    let never = AtomicBool::new(false);
    let source = ParticleShading::constant(Vec3::ONE);
    let on = |threads: usize, scene: &Scene| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let ball = Solid::ball_at(Vec3::new(0.0, 0.0, 1.2), 1.0);
        pool.install(|| render(&[&ball], scene, &source, &settings, &never).unwrap().0)
    };
    // From outside, and from inside the body
    for eye in [10.0, 1.3] {
        let view = CameraView {
            eye: DVec3::new(0.0, 0.0, eye),
            look_at: DVec3::ZERO,
            up: DVec3::Y,
            fov: 28.0,
        };
        scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
        let one = on(1, &scene);
        assert!(one.color.iter().flatten().all(|v| v.is_finite()));
        assert_eq!(one, on(5, &scene));
        let light = |plane: FilmPlane| one.plane::<Vec3>(plane).unwrap();
        for (pixel, color) in one.color.iter().enumerate() {
            let color = Vec3::from_slice(&color[..3]);
            let classes: Vec3 =
                LightClass::ALL.map(|class| light(class.plane())[pixel]).iter().sum();
            let parts = light(FilmPlane::Direct)[pixel] + light(FilmPlane::Indirect)[pixel];
            assert_near(classes, color, 1e-4);
            assert_near(parts, color, 1e-4);
        }
    }
}
