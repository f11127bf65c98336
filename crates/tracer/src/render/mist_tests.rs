//! Mist, against numerical integrals, conservation of energy, and media that are known already.

use std::f32::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::MistLayer;
use crate::render::body_set::BodySet;
use crate::render::brute::{Ball, Balls};
use crate::render::free_path::{MediumPart, free_path};
use crate::render::ground_light_tests::{dark, floor_below, sun};
use crate::render::layers::LightClass;
use crate::render::path_tests::{image, settings, statistics, white};
use crate::render::phase::henyey_greenstein;
use crate::render::solid::Solid;
use crate::render::*;
use crate::scene::{
    Background, Camera, CameraView, Environment, EnvironmentAxes, Fresnel, Ground, Light, Material,
    Mist, RadianceMap, Scene,
};
use spherule_surface::{OwnedBody, Shape};
use spherule_tree::ray::Ray;

/// Mist above the plane z = 0 that scatters all light.
const MIST: Mist = Mist {
    up: Vec3::Z,
    base: 0.0,
    scale_height: 0.8,
    extinction: 0.5,
    albedo: Vec3::ONE,
    anisotropy: 0.0,
};

/// A body without a surface that refracts.
const HOLLOW: Material =
    Material { ior: 1.0, transmission: 1.0, fresnel: Fresnel::Exact, ..Material::DEFAULT };

/// A scene in which the camera sees the `environment`, from `eye` along `direction`.
fn scene(mist: Mist, environment: Environment, eye: Vec3, direction: Vec3, fov: f64) -> Scene {
    let up = if direction.z.abs() > 0.9 { DVec3::Y } else { DVec3::Z };
    let look_at = (eye + direction).as_dvec3();
    let view = CameraView { eye: eye.as_dvec3(), look_at, up, fov };
    Scene {
        background: Background::Constant(Vec3::ZERO),
        environment: Some(Arc::new(environment)),
        is_environment_visible: true,
        mist: Some(mist),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

/// A ground at z = 0 of one colour, which does not fade near the origin.
fn ground(color: Vec3) -> Ground {
    let mut ground = floor_below(Material::DEFAULT, dark()).ground.unwrap();
    (ground.height, ground.center, ground.color) = (0.0, Vec3::ZERO, color);
    ground
}

/// A ball that no ray of these tests meets.
fn nothing() -> Balls {
    Balls::one(Vec3::new(0.0, 0.0, -100.0), 1.0)
}

fn mean(film: &Film) -> Vec3 {
    let colors = film.color.iter().map(|c| Vec3::from_slice(&c[..3]));
    colors.sum::<Vec3>() / film.color.len() as f32
}

#[track_caller]
fn assert_near(found: Vec3, expected: Vec3, limit: f32) {
    let error = (found - expected).abs().max_element();
    assert!(error < limit, "{found} is not {expected}");
}

/// The optical depth of `mist` along `ray` between two distances, by the midpoint rule in double precision.
fn depth_by_hand(mist: &Mist, ray: &Ray, [from, to]: [f32; 2]) -> f64 {
    let (steps, [from, to]) = (200_000, [from, to].map(f64::from));
    let step = (to - from) / f64::from(steps);
    let [origin, direction, up] = [ray.origin, ray.direction, mist.up].map(|v| v.as_dvec3());
    let density = |i: i32| {
        let t = from + (f64::from(i) + 0.5) * step;
        let height = (origin + t * direction).dot(up) - f64::from(mist.base);
        if height < 0.0 { 0.0 } else { (-height / f64::from(mist.scale_height)).exp() }
    };
    (0..steps).map(density).sum::<f64>() * step * f64::from(mist.extinction)
}

/// Rays up, down, almost horizontal and horizontal, from inside the mist, above and below it.
fn rays() -> impl Iterator<Item = Ray> {
    let directions = [
        Vec3::Z,
        Vec3::NEG_Z,
        Vec3::X,
        Vec3::new(1.0, 0.0, 1e-6),
        Vec3::new(1.0, 0.0, -1e-6),
        Vec3::new(1.0, 2.0, 0.01),
        Vec3::new(1.0, 2.0, -0.3),
        Vec3::new(0.0, -1.0, 2.0),
    ];
    let heights = [-1.0, 0.0, 0.1, 1.5, 12.0, 80.0];
    directions.into_iter().flat_map(move |direction| {
        heights.map(|height| Ray::new(Vec3::new(0.3, 0.0, height), direction.normalize()))
    })
}

const TILTED: Mist = Mist { up: Vec3::new(0.6, 0.0, 0.8), base: -0.4, ..MIST };

#[test]
fn transmittance_is_that_of_the_integral() {
    for mist in [MIST, TILTED] {
        let layer = MistLayer { mist, top: 64.0 * mist.scale_height };
        for ray in rays() {
            for ends in [[0.0, 2.0], [0.5, 1.0], [0.0, 40.0]] {
                let found = layer.transmittance(&ray, ends);
                #[expect(clippy::cast_possible_truncation, reason = "at most 1")]
                let expected = (-depth_by_hand(&mist, &ray, ends)).exp() as f32;
                assert!((found - expected).abs() < 1e-4, "{ray:?} {ends:?}: {found} {expected}");
            }
        }
    }
    // To infinity: up to a finite depth, and along the ground to none
    let layer = MistLayer { mist: MIST, top: 51.2 };
    let through = |direction: Vec3| {
        layer.transmittance(&Ray::new(Vec3::new(0.0, 0.0, 0.4), direction), [0.0, f32::INFINITY])
    };
    let expected = (-0.4_f32 * (-0.5_f32).exp()).exp();
    assert!((through(Vec3::Z) - expected).abs() < 1e-6);
    assert_eq!(through(Vec3::X), 0.0);
}

#[test]
fn free_paths_end_as_the_transmittance_falls() {
    for mist in [MIST, TILTED] {
        let layer = MistLayer { mist, top: 64.0 * mist.scale_height };
        for ray in rays() {
            let mut parts: Vec<MediumPart> = Vec::new();
            layer.push_parts(&ray, [0.0, 30.0], BodySet::EMPTY, &mut parts);
            let count = 4096_u16;
            let lengths = (0..count).map(|i| {
                let u = (f32::from(i) + 0.5) / f32::from(count);
                free_path(&parts, 1, u)
            });
            let lengths: Vec<f32> = lengths.collect();
            for distance in [0.2, 1.0, 3.0, 30.0] {
                let passed = lengths.iter().filter(|length| **length >= distance).count();
                #[expect(clippy::cast_precision_loss, reason = "a small count")]
                let found = passed as f32 / f32::from(count);
                let expected = layer.transmittance(&ray, [0.0, distance]);
                assert!((found - expected).abs() < 1e-3, "{ray:?} {distance}: {found} {expected}");
            }
        }
    }
}

#[test]
fn what_scatters_all_light_is_invisible_in_white_surroundings() {
    let balls = Balls(vec![
        Ball { center: Vec3::new(0.0, 0.0, 0.7), radius: 0.6 },
        Ball { center: Vec3::new(1.0, 0.3, 0.3), radius: 0.3 },
    ]);
    let settings = RenderSettings { max_depth: 24, photons: 2000, ..settings(12, 32, 1000) };
    let (eye, along) = (Vec3::new(0.0, -4.0, 1.0), Vec3::new(0.0, 1.0, -0.15).normalize());
    for anisotropy in [0.0, 0.7] {
        let mist = Mist { anisotropy, ..MIST };
        for material in [Material::matte(Vec3::ONE), Material { ior: 1.3, ..HOLLOW }] {
            for floor in 0..3 {
                let mut scene = scene(mist, white(), eye, along, 40.0);
                *scene.particle_material_mut() = material;
                scene.particles = [Vec3::new(-1.3, -1.3, 0.0), Vec3::splat(1.3)];
                scene.ground = match floor {
                    0 => None,
                    1 => Some(ground(Vec3::ONE)),
                    _ => Some(Ground { shadow_catcher: Some(1.0), ..ground(Vec3::ONE) }),
                };
                // What mist takes is no shadow on a catcher
                let nothing = nothing();
                let shape: &dyn Shape = if floor == 2 { &nothing } else { &balls };
                let film = image(shape, &scene, Vec3::ONE, &settings);
                let colors = film.color.iter().map(|c| Vec3::from_slice(&c[..3]));
                let (found, _) = statistics(&colors.collect::<Vec<_>>());
                assert!((found - 1.0).abs() < 0.015, "{anisotropy} {floor}: {found}");
            }
        }
    }
}

#[test]
fn mist_attenuates_what_is_behind_it() {
    // Mist that only absorbs, and mist whose rays end at free paths but scatter almost nothing
    for albedo in [0.0, 1e-6] {
        let mist = Mist { albedo: Vec3::splat(albedo), ..MIST };
        for direction in [Vec3::Z, Vec3::new(0.0, 1.0, 0.5).normalize()] {
            let eye = Vec3::new(0.0, 0.0, 0.4);
            let scene = scene(mist, white(), eye, direction, 0.1);
            let found = mean(&image(&nothing(), &scene, Vec3::ONE, &settings(8, 4096, 0)));
            let depth = depth_by_hand(&mist, &Ray::new(eye, direction), [0.0, 60.0]);
            #[expect(clippy::cast_possible_truncation, reason = "at most 1")]
            let expected = (-depth).exp() as f32;
            assert_near(found, Vec3::splat(expected), 3e-3);
        }
    }
}

/// Bodies without a surface that refracts keep mist out: rays of paths and shadow rays pass less of it.
#[test]
fn there_is_no_mist_inside_bodies() {
    let mist = Mist { albedo: Vec3::ZERO, ..MIST };
    let above = Vec3::new(0.0, 0.0, 9.0);
    let down = Ray::new(above, Vec3::NEG_Z);
    let [outside, inside] = [[0.0, 9.0], [7.0, 8.5]].map(|ends| depth_by_hand(&mist, &down, ends));
    #[expect(clippy::cast_possible_truncation, reason = "at most 1")]
    let expected = (-2.0 * (outside - inside)).exp() as f32 / PI;
    // From z = 0.5 to z = 2
    let center = Vec3::new(0.0, 0.0, 1.25);
    for place in 0..3 {
        let mut scene = scene(mist, dark(), above, Vec3::NEG_Z, 0.1);
        scene.ground = Some(ground(Vec3::ONE));
        scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
        *scene.particle_material_mut() = HOLLOW;
        let shape: Box<dyn Shape> = match place {
            0 => Box::new(Balls::one(center, 0.75)),
            1 => Box::new(Solid::ball_at(center, 0.75)),
            _ => {
                *scene.particle_material_mut() = Material::DEFAULT;
                let id = scene.add_style(Material { priority: 1, ..HOLLOW }).unwrap();
                Box::new(OwnedBody::new(Box::new(Solid::ball_at(center, 0.75)), id, 0))
            }
        };
        let settings = RenderSettings { photons: 0, max_depth: 6, ..settings(4, 16, 0) };
        let found = mean(&image(&*shape, &scene, Vec3::ONE, &settings));
        assert_near(found / expected, Vec3::ONE, 0.01);
    }
}

/// The light that `mist` scatters once from a directional light with irradiance 1 into `ray`, of white mist.
fn single_scattering(mist: &Mist, ray: &Ray, length: f32, to_light: Vec3) -> f32 {
    let layer = MistLayer { mist: *mist, top: 64.0 * mist.scale_height };
    let phase = henyey_greenstein(mist.anisotropy, ray.direction.dot(to_light));
    let steps = 4000_u16;
    let step = length / f32::from(steps);
    let at = |i: u16| {
        let t = (f32::from(i) + 0.5) * step;
        let point = ray.at(t);
        let height = (point.dot(mist.up) - mist.base).max(0.0);
        let density = mist.extinction * (-height / mist.scale_height).exp();
        let lit = layer.transmittance(&Ray::new(point, to_light), [0.0, f32::INFINITY]);
        layer.transmittance(ray, [0.0, t]) * density * phase * lit * step
    };
    (0..steps).map(at).sum()
}

#[test]
fn single_scattering_is_the_integral_along_the_ray() {
    let eye = Vec3::new(0.0, 0.0, 0.6);
    let to_light = Vec3::new(0.3, 0.8, 0.4).normalize();
    for (direction, length) in [
        (Vec3::new(0.0, 1.0, -0.2).normalize(), None),
        (Vec3::new(0.2, 1.0, 0.3).normalize(), Some(40.0)),
        (Vec3::new(0.2, -1.0, 0.1).normalize(), Some(80.0)),
    ] {
        for anisotropy in [0.0, 0.7, -0.3] {
            let albedo = Vec3::new(1.0, 0.8, 0.5);
            let mist = Mist { anisotropy, albedo, ..MIST };
            let mut scene = scene(mist, dark(), eye, direction, 0.1);
            scene.ground = Some(ground(Vec3::ZERO));
            scene.lights = vec![Light::directional(-to_light, Vec3::ONE).unwrap()];
            let found = mean(&image(&nothing(), &scene, Vec3::ONE, &settings(8, 1024, 0)));
            let ray = Ray::new(eye, direction);
            let length = length.unwrap_or(-eye.z / direction.z);
            let expected = albedo * single_scattering(&mist, &ray, length, to_light);
            let error = (found / expected - 1.0).abs().max_element();
            assert!(error < 0.03, "{direction} {anisotropy}: {found} {expected}");
        }
    }
}

#[test]
fn spheres_throw_shadows_into_mist() {
    let eye = Vec3::new(0.0, -6.0, 0.5);
    let mut scene = scene(MIST, dark(), eye, Vec3::Y, 4.0);
    scene.ground = Some(ground(Vec3::ZERO));
    scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
    let settings = settings(8, 64, 0);
    // A ball above the middle of the picture, and one as large where its shadow falls elsewhere
    let ball = |x: f32| Balls::one(Vec3::new(x, 0.0, 4.0), 1.5);
    let [shaded, lit] = [0.0, 20.0].map(|x| mean(&image(&ball(x), &scene, Vec3::ONE, &settings)).x);
    // The shadow is half as long as the free path, and far from the camera
    assert!(shaded < 0.93 * lit && shaded > 0.5 * lit, "{shaded} {lit}");
}

/// Light with an extent and a bright part of the environment are found in two ways.
#[test]
fn lights_and_the_environment_light_mist_alike() {
    // A sun with a fifteenth of the sky, as an environment and as a light
    let (rows, mut pixels) = (40, vec![Vec3::ZERO; 512 * 256]);
    pixels[..512 * rows].fill(Vec3::splat(5.0));
    let map = RadianceMap::new(512, 256, pixels).unwrap();
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let environment = Environment::from_map(axes, &map, Vec3::ONE);
    let half_angle = std::f64::consts::PI * 40.0 / 256.0;
    let irradiance = environment.irradiance(Vec3::Z);
    let mist = Mist { anisotropy: 0.6, albedo: Vec3::new(0.9, 0.7, 0.5), ..MIST };
    let of = |environment: Environment, lights: Vec<Light>, samples: u32| {
        let eye = Vec3::new(0.0, -3.0, 0.5);
        let mut scene = scene(mist, environment, eye, Vec3::Y, 20.0);
        scene.is_environment_visible = false;
        scene.lights = lights;
        mean(&image(&nothing(), &scene, Vec3::ONE, &settings(16, samples, 8)))
    };
    let expected = of(environment, Vec::new(), 512);
    let found = of(dark(), vec![sun(half_angle, irradiance)], 512);
    assert_near(found / expected, Vec3::ONE, 0.03);
}

#[test]
fn photons_bring_no_light_twice() {
    // Without photons, light passes the body straight, which is the same where nothing refracts
    let mist = Mist { albedo: Vec3::splat(0.9), anisotropy: 0.5, ..MIST };
    let center = Vec3::new(0.0, 0.0, 1.2);
    let balls = Balls::one(center, 1.0);
    let body = Solid::ball_at(center, 1.0);
    for shape in [&balls as &dyn Shape, &body] {
        let of = |photons: u32| {
            let mut scene = floor_below(HOLLOW, Environment::constant(Vec3::splat(0.2)));
            scene.lights = vec![sun(0.01, Vec3::splat(PI))];
            scene.mist = Some(Mist { base: scene.ground.as_ref().unwrap().height, ..mist });
            let settings = RenderSettings { photons, max_depth: 16, ..settings(16, 64, 20) };
            mean(&image(shape, &scene, Vec3::ONE, &settings))
        };
        assert_near(of(100_000) / of(0), Vec3::ONE, 0.02);
    }
}

#[test]
fn mist_covers_what_is_behind_it() {
    let eye = Vec3::new(0.0, 0.0, 0.4);
    let mut scene = scene(MIST, white(), eye, Vec3::Z, 0.1);
    let settings = RenderSettings {
        transparent_background: true,
        channels: Channels::ALL,
        ..settings(8, 4096, 4)
    };
    let expected = 1.0 - (-0.4_f32 * (-0.5_f32).exp()).exp();
    let alpha = |scene: &Scene, shape: &dyn Shape| {
        let film = image(shape, scene, Vec3::ONE, &settings);
        film.color.iter().map(|c| c[3]).sum::<f32>() / 64.0
    };
    assert!((alpha(&scene, &nothing()) - expected).abs() < 3e-3);
    // A holdout leaves the mist in front of it, and a ball has the data of clear air
    let ball = Balls::one(Vec3::new(0.0, 0.0, 60.0), 2.0);
    assert_eq!(alpha(&scene, &ball), 1.0);
    let film = image(&ball, &scene, Vec3::ONE, &settings);
    scene.mist = None;
    let clear = image(&ball, &scene, Vec3::ONE, &settings);
    assert_ne!(film.color, clear.color);
    for plane in [FilmPlane::Depth, FilmPlane::Normal, FilmPlane::Position] {
        assert_eq!(film.plane::<f32>(plane), clear.plane::<f32>(plane), "{plane:?}");
    }
    assert_eq!(film.plane::<u32>(FilmPlane::Id), clear.plane::<u32>(FilmPlane::Id));
    scene.mist = Some(MIST);
    scene.particle_material_mut().is_holdout = true;
    assert!((alpha(&scene, &ball) - expected).abs() < 3e-3);
}

#[test]
fn pictures_do_not_depend_on_threads_and_classes_of_light_add_up() {
    let mist = Mist { albedo: Vec3::new(0.9, 0.8, 0.7), anisotropy: 0.7, ..MIST };
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
    for material in [Material::DEFAULT, Material { ior: 1.3, ..HOLLOW }] {
        let mut scene = floor_below(material, Environment::constant(Vec3::splat(0.3)));
        scene.mist = Some(mist);
        scene.lights = vec![sun(0.1, Vec3::ONE)];
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

#[test]
fn extreme_mist_is_finite() {
    for (extinction, scale_height) in
        [(1e-38, 1.0), (1e30, 1.0), (1.0, 1e-30), (1.0, 1e30), (1e30, 1e30), (f32::MAX, 1e-37)]
    {
        let mist = Mist { extinction, scale_height, ..MIST };
        for direction in [Vec3::Y, Vec3::new(0.0, 1.0, -0.2), Vec3::Z] {
            let eye = Vec3::new(0.0, -6.0, 0.5);
            let mut scene = scene(mist, white(), eye, direction.normalize(), 30.0);
            scene.ground = Some(ground(Vec3::ONE));
            scene.lights = vec![sun(0.1, Vec3::ONE)];
            let film = image(&nothing(), &scene, Vec3::ONE, &settings(8, 4, 4));
            assert!(film.color.iter().flatten().all(|v| v.is_finite()), "{mist:?}");
        }
    }
    for mist in [
        Mist { extinction: 0.0, ..MIST },
        Mist { scale_height: f32::NAN, ..MIST },
        Mist { albedo: Vec3::splat(1.1), ..MIST },
        Mist { anisotropy: 1.0, ..MIST },
        Mist { base: f32::INFINITY, ..MIST },
        Mist { up: Vec3::splat(1.0), ..MIST },
    ] {
        assert!(mist.validate().is_err(), "{mist:?}");
    }
    MIST.validate().unwrap();
}
