//! Light groups against images with the lights of one group only.
//!
//! Each case is rendered seven times: with all groups, without their layers, and with each of five groups alone.

use std::sync::Arc;

use glam::Vec3;

use super::layers::Layers;
use super::path_tests::{GLASS, floor_from_above, heap, image, settings};
use super::{brute::Balls, solid::Solid, *};
use crate::scene::{Background, Environment, Falloff, Light, LightKind};

/// Groups of the environment, and of the lights of [`lights`].
const ENVIRONMENT: u8 = 2;
const GROUPS: [u8; 4] = [1, 3, 1, 4];
/// With that of light without a group.
const COUNT: u8 = 5;

fn lights() -> Vec<Light> {
    let sun =
        |x: f32| LightKind::Sun { to_light: Vec3::new(x, 0.3, 1.0).normalize(), half_angle: 0.02 };
    let kinds = [
        LightKind::Point { position: Vec3::new(2.0, 1.0, 5.0), falloff: Falloff::InverseSquare },
        LightKind::Sphere { center: Vec3::new(0.6, 0.5, 2.5), radius: 0.3 },
        sun(0.5),
        sun(-0.2),
    ];
    let light = |(kind, group): (LightKind, u8)| Light {
        kind,
        radiance: Vec3::new(1.0 + f32::from(group), 2.0, 3.0),
        casts_shadow: true,
        is_visible: true,
        group,
    };
    kinds.into_iter().zip(GROUPS).map(light).collect()
}

/// The light of all sources that are in `groups`.
fn lit(scene: &Scene, groups: &[u8]) -> Scene {
    let mut scene = scene.clone();
    for light in &mut scene.lights {
        if !groups.contains(&light.group) {
            light.radiance = Vec3::ZERO;
        }
    }
    if !groups.contains(&scene.environment_group) {
        scene.environment = Some(Arc::new(Environment::constant(Vec3::ZERO)));
    }
    if !groups.contains(&0) {
        scene.background = Background::Constant(Vec3::ZERO);
        scene.ambient_light = Vec3::ZERO;
    }
    scene
}

fn grouped(settings: &RenderSettings) -> RenderSettings {
    let mut grouped = *settings;
    grouped.channels.layers = Layers { light_groups: COUNT, ..Layers::NONE };
    grouped
}

/// The light of `group` in each pixel.
fn of_group(film: &Film, group: u8) -> Vec<Vec3> {
    let lights = film.plane::<Vec3>(FilmPlane::LightGroups).unwrap();
    lights.chunks(usize::from(COUNT)).map(|groups| groups[usize::from(group)]).collect()
}

fn colors(film: &Film) -> Vec<Vec3> {
    let pixels = film.color.iter();
    pixels.map(|color| Vec3::from_slice(&color[..3])).collect()
}

/// Checks that the groups add up to the colour, and that layers for them do not change it. Returns the film.
#[track_caller]
fn check_sum(shape: &dyn Shape, scene: &Scene, settings: &RenderSettings) -> Film {
    let albedo = Vec3::new(0.8, 0.6, 0.3);
    let film = image(shape, scene, albedo, &grouped(settings));
    let plain = image(shape, scene, albedo, settings);
    assert_eq!(film.color, plain.color);
    let groups: Vec<Vec<Vec3>> = (0..COUNT).map(|group| of_group(&film, group)).collect();
    for (pixel, color) in colors(&film).into_iter().enumerate() {
        let sum: Vec3 = groups.iter().map(|group| group[pixel]).sum();
        let size: Vec3 = groups.iter().map(|group| group[pixel].abs()).sum();
        let difference = (sum - color).abs();
        assert!(difference.cmple(1e-5 * size + 1e-6).all(), "{pixel}: {sum} of {color}");
    }
    film
}

/// Checks each group against an image with its lights only, too. `empty`: the groups without light.
#[track_caller]
fn check(shape: &dyn Shape, scene: &Scene, settings: &RenderSettings, empty: &[u8]) {
    let film = check_sum(shape, scene, settings);
    for group in 0..COUNT {
        let found = of_group(&film, group);
        let only = lit(scene, &[group]);
        let expected = image(shape, &only, Vec3::new(0.8, 0.6, 0.3), settings);
        let expected = colors(&expected);
        match settings.photons {
            0 => assert_eq!(found, expected, "group {group}"),
            // Lights share the photons, so that each has fewer and wider ones than alone
            _ => {
                let sum = |light: &[Vec3]| light.iter().map(|l| l.element_sum()).sum::<f32>();
                let (found, expected) = (sum(&found), sum(&expected));
                let error = (found - expected).abs();
                assert!(error <= 0.15 * expected, "group {group}: {found} {expected}");
            }
        }
        let is_empty = found.iter().all(|light| *light == Vec3::ZERO);
        assert_eq!(is_empty, empty.contains(&group), "group {group}");
    }
}

fn opaque() -> Scene {
    let mut scene = floor_from_above(Environment::constant(Vec3::ONE), Vec3::splat(0.5));
    if let Some(ground) = &mut scene.ground {
        // The floor ends within the picture
        (ground.fade_start, ground.fade_end) = (0.4, 0.9);
    }
    scene.lights = lights();
    scene.environment_group = ENVIRONMENT;
    scene
}

#[test]
fn a_group_is_the_image_of_its_lights_alone() {
    let settings = RenderSettings { max_depth: 4, ..settings(20, 5, 4) };
    check(&heap(), &opaque(), &settings, &[]);
    // The last segment of a path is a shadow ray, if no light has an extent
    let mut scene = opaque();
    scene.lights.truncate(1);
    let direct = RenderSettings { bounces: 0, ..settings };
    check(&heap(), &scene, &direct, &[3, 4]);
    // A visible environment is in its own group
    scene.is_environment_visible = true;
    check(&heap(), &scene, &settings, &[0, 3, 4]);
}

#[test]
fn groups_are_known_behind_refraction_and_in_caustics() {
    let mut scene = opaque();
    *scene.particle_material_mut() = GLASS;
    let ball = Solid::ball_at(Vec3::new(0.0, 0.0, 0.8), 0.5);
    for photons in [0, 20_000] {
        let settings = RenderSettings { photons, max_depth: 5, ..settings(20, 4, 2) };
        check(&ball, &scene, &settings, &[]);
    }
    // Media scatter light of all groups
    let murky = GLASS.with_scattering(Vec3::new(1.0, 0.7, 0.4), 0.3, 0.4);
    *scene.particle_material_mut() = murky;
    for shape in [&ball as &dyn Shape, &Balls::one(Vec3::new(0.0, 0.0, 0.8), 0.5)] {
        let settings = RenderSettings { photons: 0, max_depth: 5, ..settings(20, 4, 3) };
        check(shape, &scene, &settings, &[]);
    }
    *scene.particle_material_mut() = GLASS;
    // All photons in one group
    scene.lights[3].group = 1;
    let settings = RenderSettings { photons: 20_000, ..settings(20, 4, 2) };
    check(&ball, &scene, &settings, &[4]);
}

#[test]
fn groups_of_a_shadow_catcher_add_up() {
    let mut scene = opaque();
    if let Some(ground) = &mut scene.ground {
        ground.shadow_catcher = Some(1.0);
    }
    let film = check_sum(&heap(), &scene, &settings(24, 4, 3));
    assert!(of_group(&film, 0).iter().any(|light| *light != Vec3::ZERO));
}

#[test]
fn groups_of_the_whitted_integrator_are_images_of_their_lights() {
    let mut scene = opaque();
    scene.lights.retain(|light| !light.kind.has_extent());
    scene.lights.push(Light {
        group: 3,
        ..Light::directional(Vec3::new(0.2, 0.4, -1.0), Vec3::ONE).unwrap()
    });
    let settings = RenderSettings { integrator: IntegratorKind::Whitted, ..settings(20, 4, 0) };
    check(&heap(), &scene, &settings, &[2, 4]);
    *scene.particle_material_mut() = GLASS;
    let ball = Solid::ball_at(Vec3::new(0.0, 0.0, 0.8), 0.5);
    check(&ball, &scene, &settings, &[2, 4]);
}

#[test]
fn a_group_without_a_layer_is_refused() {
    let mut scene = opaque();
    scene.lights[0].group = COUNT;
    let source = ParticleShading::constant(Vec3::ONE);
    let never = std::sync::atomic::AtomicBool::new(false);
    let draw = |settings: &RenderSettings| render(&[&heap()], &scene, &source, settings, &never);
    let error = draw(&grouped(&settings(4, 1, 0))).unwrap_err();
    assert!(matches!(error, RenderError::LightGroup { group: 5, count: 5 }));
    assert!(draw(&settings(4, 1, 0)).is_ok());
}
