//! The clamp of indirect light: what it takes, and what it leaves.

use std::sync::atomic::AtomicBool;

use glam::Vec3;

use super::layers::Layers;
use super::path_tests::{GLASS, floor_from_above, settings};
use super::{brute::Balls, solid::Solid, *};
use crate::scene::{Environment, Finish, Light, LightKind, Material};

/// A metal ball under a sun in a grey sky: the floor has fireflies, samples that meet the sun in the metal.
pub(super) fn fireflies(finish: Finish) -> Scene {
    let mut scene = floor_from_above(Environment::constant(Vec3::splat(0.2)), Vec3::splat(0.5));
    scene.particle_material_mut().finish = finish;
    scene.lights = vec![Light {
        kind: LightKind::Sun { to_light: Vec3::new(1.0, 0.3, 1.0).normalize(), half_angle: 0.02 },
        radiance: Vec3::splat(3.0),
        casts_shadow: true,
        is_visible: true,
        group: 1,
    }];
    scene
}

pub(super) const METAL: Finish = Finish::Metal { roughness: 0.2 };

fn ball() -> Balls {
    Balls::one(Vec3::new(0.0, 0.0, 0.8), 0.6)
}

fn clamped(shape: &dyn Shape, scene: &Scene, settings: &RenderSettings) -> (Film, LostLight) {
    let source = ParticleShading::constant(Vec3::splat(0.8));
    let never = AtomicBool::new(false);
    let (film, counts) = render(&[shape], scene, &source, settings, &never).unwrap();
    (film, counts.lost)
}

fn sum(film: &Film) -> f64 {
    film.color.iter().map(|[r, g, b, _]| f64::from(r + g + b)).sum()
}

#[test]
fn what_is_lost_is_counted() {
    let scene = fireflies(METAL);
    let settings = settings(32, 16, 6);
    let (free, none) = clamped(&ball(), &scene, &settings);
    assert_eq!(none, LostLight::NONE);
    let (film, lost) = clamped(&ball(), &scene, &RenderSettings { clamp: Some(2.0), ..settings });
    let expected = 1.0 - sum(&film) / sum(&free);
    let part = lost.part(&film.color, settings.samples);
    assert!(expected > 1e-4 && (part / expected - 1.0).abs() < 0.01, "{part} {expected}");
    // No pixel is brighter than before, and the spread over the floor is smaller
    let brighter = free.color.iter().zip(&film.color).filter(|(a, b)| b[0] > a[0] + 1e-6);
    assert_eq!(brighter.count(), 0);
    // A limit that nothing reaches changes no bit
    let (film, lost) = clamped(&ball(), &scene, &RenderSettings { clamp: Some(1e6), ..settings });
    assert_eq!((film.color, lost), (free.color, LostLight::NONE));
}

/// What the first surface reflects of lights and of the environment has no limit, in any material.
#[test]
fn direct_light_has_no_limit() {
    let glossy = Finish::Plastic { roughness: 0.1 };
    for finish in [Finish::Metal { roughness: 0.0 }, METAL, glossy, Finish::Matte] {
        let mut scene = fireflies(finish);
        scene.ground = None;
        let settings = settings(24, 8, 6);
        // One convex body alone receives no other light
        let free = clamped(&ball(), &scene, &settings).0;
        let limit = RenderSettings { clamp: Some(1e-3), ..settings };
        let (film, lost) = clamped(&ball(), &scene, &limit);
        assert_eq!((film.color, lost), (free.color, LostLight::NONE), "{finish:?}");
    }
}

#[test]
fn light_groups_lose_the_same_part() {
    let metal = Material { finish: METAL, ..Material::DEFAULT };
    let murky = GLASS.with_scattering(Vec3::new(1.0, 0.7, 0.4), 0.3, 0.4);
    let body = Solid::ball(0.6);
    for (material, shape) in [(metal, &ball() as &dyn Shape), (GLASS, &body), (murky, &body)] {
        let mut scene = fireflies(METAL);
        *scene.particle_material_mut() = material;
        let mut settings = RenderSettings { clamp: Some(0.5), max_depth: 8, ..settings(24, 16, 6) };
        let plain = clamped(shape, &scene, &settings);
        settings.channels.layers = Layers { light_groups: 2, ..Layers::NONE };
        let (film, lost) = clamped(shape, &scene, &settings);
        assert_eq!((&film.color, lost), (&plain.0.color, plain.1));
        let groups = film.plane::<Vec3>(FilmPlane::LightGroups).unwrap();
        for (color, groups) in film.color.iter().zip(groups.chunks(2)) {
            let all = Vec3::from_slice(color);
            let difference = (groups[0] + groups[1] - all).abs().max_element();
            assert!(difference <= 1e-4 * (1.0 + all.max_element()), "{color:?} {groups:?}");
        }
    }
}

#[test]
fn limits_out_of_range_are_refused() {
    for limit in [0.0, -1.0, 1e7, f32::INFINITY, f32::NAN] {
        let settings = RenderSettings { clamp: Some(limit), ..settings(2, 1, 0) };
        assert!(matches!(settings.validate(), Err(RenderError::Clamp(_))), "{limit}");
    }
}
