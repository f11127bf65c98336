//! One connected body against optics computed by hand.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};

use super::{
    brute::{Ball, Balls},
    integrator::testing,
    solid::Solid,
    *,
};
use crate::scene::{
    Background, Camera, CameraView, Fresnel, Ground, Light, Material, ground,
    material::{dielectric, extinction},
};
use spherule_surface::{Intersection, MaterialId, Side};
use spherule_tree::ray::Ray;

const CLEAR: Material = Material {
    ambient: 0.0,
    diffuse: 0.0,
    specular: 0.0,
    ior: 1.5,
    transmission: 1.0,
    fresnel: Fresnel::Exact,
    ..Material::DEFAULT
};

/// Reflectance of a surface of [`CLEAR`] at normal incidence.
const R: f32 = 0.04;

fn scene(eye: DVec3, look_at: DVec3, material: Material) -> Scene {
    let view = CameraView { eye, look_at, up: DVec3::X, fov: 20.0 };
    Scene {
        materials: Scene::basic_materials(material),
        background: Background::Constant(Vec3::ONE),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

/// Looks straight down from `height`.
fn from_above(height: f64, material: Material) -> Scene {
    scene(DVec3::new(0.0, 0.0, height), DVec3::new(0.0, 0.0, height - 1.0), material)
}

fn with_loss(color: Vec3, length: f32) -> Material {
    Material { extinction: extinction(color, length), ..CLEAR }
}

/// An infinite grey ground.
pub(super) fn floor(height: f32) -> Ground {
    Ground {
        up: Vec3::Z,
        height,
        color: Vec3::splat(0.5),
        center: Vec3::Z * height,
        base: Vec3::ZERO,
        fade_start: 1e4,
        fade_end: 2e4,
        lit_range: 1e4,
        pattern: ground::Pattern::Plain,
        shadow_catcher: None,
    }
}

fn depth(max_depth: u32) -> RenderSettings {
    RenderSettings { max_depth, ..RenderSettings::new(1, 1) }
}

/// The radiance at positions on the film; `split` is the weight from which both rays are traced.
fn radiance_at(
    films: &[Vec2],
    split: f32,
    shapes: &[&dyn Shape],
    scene: &Scene,
    settings: &RenderSettings,
) -> (Vec<Vec3>, RayCounts) {
    let source = ParticleShading::constant(Vec3::ONE);
    let plane = scene.ground.as_ref().map(Ground::shape);
    let floor = plane.iter().map(|plane| plane as &dyn Shape);
    let shapes = floor.chain(shapes.iter().copied()).collect();
    let mut integrator =
        WhittedIntegrator::new(RenderContext::new(shapes, scene, &source, settings));
    integrator.split.least = split;
    testing::radiance_at(&integrator, films)
}

/// The centre of the film, with every ray traced.
pub(super) fn middle_of(shapes: &[&dyn Shape], scene: &Scene, max_depth: u32) -> (Vec3, RayCounts) {
    let films = [Vec2::splat(0.5)];
    let (colors, counts) = radiance_at(&films, 0.0, shapes, scene, &depth(max_depth));
    (colors[0], counts)
}

fn middle(solid: &Solid, scene: &Scene, max_depth: u32) -> Vec3 {
    middle_of(&[solid], scene, max_depth).0
}

/// White opaque balls.
struct Drops(Balls);

impl Shape for Drops {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        self.0.crossing(ray, side)
    }

    fn material(&self) -> MaterialId {
        MaterialId::SPRAY
    }
}

#[track_caller]
fn assert_within(limit: f32, value: Vec3, expected: Vec3) {
    let error = (value - expected).abs().max_element();
    assert!(error < limit, "{value} is not {expected}");
}

fn film(solid: &Solid, scene: &Scene, settings: &RenderSettings) -> Film {
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    render(&[solid], scene, &source, settings, &never).unwrap().0
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "surfaces answer in f32")]
fn a_glass_ball_refracts_at_the_known_angles() {
    // A ray that hits the ball at angle a is refracted by a - b with sin b = sin a / 1.5, leaves after a turn of 2 (a
    // - b), and is reflected at its entry by pi - 2 a. The reflection at the far wall ends the path at depth 2,
    // inside: it has turned by a - b and by pi - 2 b.
    for offset in [0.1_f64, 0.5, 0.8, 0.95] {
        let eye = DVec3::new(0.0, offset, 10.0);
        let mut scene = scene(eye, eye - DVec3::Z, CLEAR);
        // Brightness encodes the angle from straight down: 1 there, 0 straight up.
        scene.background = Background::Gradient { bottom: Vec3::ONE, top: Vec3::ZERO, up: Vec3::Z };
        let (a, b) = (offset.asin(), (offset / 1.5).asin());
        let sky = |turned: f64| {
            let turned = turned.rem_euclid(2.0 * PI);
            1.0 - turned.min(2.0 * PI - turned) / PI
        };
        let r = f64::from(dielectric(a.cos() as f32, 1.0 / 1.5));
        let out = sky(2.0 * (a - b));
        let back = sky((a - b) + PI - 2.0 * b);
        let expected = r * sky(PI - 2.0 * a) + (1.0 - r) * ((1.0 - r) * out + r * back);
        let value = middle(&Solid::ball(1.0), &scene, 2);
        // The offset from the surface shifts the path by the same length.
        assert_within(5e-4, value, Vec3::splat(expected as f32));
    }
}

#[test]
fn energy_is_never_created() {
    let solids = [Solid::ball(1.0), Solid::slab(-0.3, 0.8)];
    let eye = DVec3::new(0.4, -6.0, 3.0);
    for (samples, solid) in [1, 16].iter().flat_map(|s| solids.iter().map(|b| (*s, b))) {
        let settings = RenderSettings { samples, max_depth: 8, ..RenderSettings::new(24, 24) };
        let furnace = scene(eye, DVec3::ZERO, CLEAR);
        for pixel in film(solid, &furnace, &settings).color {
            assert!(pixel[..3].iter().all(|c| (c - 1.0).abs() < 2e-6), "{pixel:?}");
        }
        let dim = scene(eye, DVec3::ZERO, with_loss(Vec3::new(0.5, 1.0, 0.0), 1.0));
        let film = film(solid, &dim, &settings);
        let mut least = [1.0_f32; 3];
        for pixel in film.color {
            for (channel, value) in least.iter_mut().zip(pixel) {
                assert!(value <= 1.0 + 2e-6, "{pixel:?}");
                *channel = channel.min(value);
            }
        }
        assert!(least[0] < 0.7 && least[2] < 0.2, "{least:?}");
        assert!((least[1] - 1.0).abs() < 2e-6, "{least:?}");
    }
}

#[test]
fn slab_absorbs_along_the_path_through_it() {
    let solid = Solid::slab(-2.0, 0.0);
    // Without refraction, at normal incidence and at 60 degrees, the paths inside have lengths 2 and 4.
    let tinted = Material { ior: 1.0, ..with_loss(Vec3::new(0.5, 0.25, 1.0), 2.0) };
    let down = middle(&solid, &from_above(5.0, tinted), 8);
    assert_within(1e-5, down, Vec3::new(0.5, 0.25, 1.0));
    let eye = DVec3::new(0.0, -3.0_f64.sqrt(), 1.0);
    let aslant = middle(&solid, &scene(eye, DVec3::ZERO, tinted), 8);
    assert_within(1e-5, aslant, Vec3::new(0.25, 0.0625, 1.0));
    // With refraction, the internal reflections form a geometric series.
    let glass = with_loss(Vec3::new(0.5, 0.25, 1.0), 2.0);
    let expected = [0.5_f32, 0.25, 1.0].map(|kept| {
        let inside = kept * (1.0 - R) / (1.0 - R * kept);
        R + (1.0 - R) * inside
    });
    let value = middle(&solid, &from_above(5.0, glass), 20);
    assert_within(1e-5, value, Vec3::from_array(expected));
}

#[test]
fn roulette_and_splitting_have_the_same_mean() {
    let eye = DVec3::new(0.4, -6.0, 3.0);
    let mut scene = scene(eye, DVec3::ZERO, with_loss(Vec3::new(0.7, 0.9, 1.0), 1.0));
    scene.background = Background::Gradient {
        bottom: Vec3::splat(0.1),
        top: Vec3::new(4.0, 2.0, 1.0),
        up: Vec3::Z,
    };
    let solid = Solid::ball(1.0);
    let films: Vec<Vec2> =
        (0..4096).map(|i| Vec2::new((i % 64) as f32, (i / 64) as f32) / 64.0).collect();
    let colors = |split: f32| {
        let (colors, counts) = radiance_at(&films, split, &[&solid], &scene, &depth(8));
        let red: Vec<f32> = colors.into_iter().map(|color| color.x).collect();
        (red, counts.total())
    };
    let (all, all_rays) = colors(0.0);
    let (drawn, drawn_rays) = colors(1.0);
    assert!(3 * drawn_rays < all_rays, "{drawn_rays} {all_rays}");
    let errors: Vec<f64> = all.iter().zip(&drawn).map(|(a, b)| f64::from(b - a)).collect();
    let count = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / count;
    let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count;
    let standard_error = (variance / count).sqrt();
    assert!(standard_error > 1e-4, "roulette draws: {standard_error}");
    assert!(mean.abs() < 4.0 * standard_error, "{mean} {standard_error}");
}

#[test]
fn more_samples_use_roulette_earlier() {
    let scene = from_above(5.0, CLEAR);
    let source = ParticleShading::constant(Vec3::ONE);
    let solid = Solid::ball(1.0);
    let split = |samples| {
        let settings = RenderSettings { samples, ..depth(8) };
        let shapes: Vec<&dyn Shape> = vec![&solid];
        let integrator =
            WhittedIntegrator::new(RenderContext::new(shapes, &scene, &source, &settings));
        integrator.split.least
    };
    assert_eq!([1, 16, 4096].map(split), [0.02, 0.2, 1.0]);
}

#[test]
fn camera_inside_has_total_reflection_and_wet_ground() {
    // From the middle of a slab, up at 60 degrees from the normal: total internal reflection to the ground inside the
    // slab, 0.5 below the eye. The path has length 2 * (1 + 1 + 0.5).
    let solid = Solid::slab(-3.0, 1.0);
    let eye = DVec3::ZERO;
    let up = DVec3::new(0.0, 3.0_f64.sqrt(), 1.0);
    let mut scene = scene(eye, up, with_loss(Vec3::new(0.5, 1.0, 0.25), 5.0));
    scene.ground = Some(floor(-0.5));
    let (value, counts) = middle_of(&[&solid], &scene, 8);
    let bare = 0.5 * ground::AMBIENT;
    assert_within(1e-5, value, bare * Vec3::new(0.5, 1.0, 0.25));
    assert_eq!((counts.reflection, counts.refraction), (1, 0));
    // Straight towards the ground.
    scene.camera = from_above(0.0, CLEAR).camera;
    let value = middle(&solid, &scene, 1);
    let kept = Vec3::new(0.5, 1.0, 0.25).powf(0.1);
    assert_within(1e-5, value, bare * kept);
    // Steeply up and out of the slab: the background at depth 1.
    scene.camera = super::body_tests::scene(eye, DVec3::Z, CLEAR).camera;
    let value = middle(&solid, &scene, 1);
    assert_within(1e-5, value, Vec3::new(0.5, 1.0, 0.25).powf(0.2));
}

#[test]
fn ground_is_refracted_through_a_slab() {
    // At 45 degrees into a slab of height 1: sin b = sin 45 / 1.5, so the ray hits the ground tan b = 0.5345 beyond
    // the entry at 0; without refraction it would be 1.
    let solid = Solid::slab(-5.0, 1.0);
    let eye = DVec3::new(0.0, -2.0, 3.0);
    let mut scene = scene(eye, DVec3::new(0.0, 0.0, 1.0), CLEAR);
    scene.particle_material_mut().reflection = 0.0;
    let r = dielectric(0.5_f32.sqrt(), 1.0 / 1.5);
    let light = (1.0 - r) * 0.5 * ground::AMBIENT;
    for (tile, is_light) in [(0.54, true), (0.53, false)] {
        scene.ground = Some(Ground {
            pattern: ground::Pattern::Checker { tile },
            shadow_catcher: None,
            // The corner of four squares; the camera looks along y.
            center: Vec3::new(-0.1, 0.0, 0.0),
            ..floor(0.0)
        });
        let value = middle(&solid, &scene, 8).x;
        assert_eq!((value - light).abs() < 1e-5, is_light, "{tile}: {value} {light}");
        assert!(value > 0.0);
    }
}

/// The ground under a slab, seen from between them, with a light straight above.
fn under_a_slab(material: Material, spray: Vec<Ball>) -> f32 {
    let (solid, drops) = (Solid::slab(2.0, 4.0), Drops(Balls(spray)));
    let mut scene = from_above(1.0, material);
    scene.ground = Some(floor(0.0));
    scene.ambient_light = Vec3::ZERO;
    scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
    middle_of(&[&solid, &drops], &scene, 4).0.x
}

#[test]
fn shadows_are_attenuated_by_interfaces_and_absorption() {
    let bare = 0.5 * ground::DIFFUSE;
    let air = Material { ior: 1.0, ..CLEAR };
    assert!((under_a_slab(air, Vec::new()) - bare).abs() < 1e-6);
    let crossed = bare * (1.0 - R) * (1.0 - R);
    assert!((under_a_slab(CLEAR, Vec::new()) - crossed).abs() < 1e-6);
    let half = with_loss(Vec3::splat(0.5), 2.0);
    assert!((under_a_slab(half, Vec::new()) - 0.5 * crossed).abs() < 1e-6);
    // A wet ground, seen through a body that extends below it: one crossing.
    let mut scene = from_above(5.0, Material { reflection: 0.0, ..half });
    scene.ground = Some(floor(0.0));
    scene.ambient_light = Vec3::ZERO;
    scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
    let wet = middle(&Solid::slab(-1.0, 2.0), &scene, 4).x;
    // To the ground and back.
    assert!((wet - 0.25 * crossed).abs() < 1e-5, "{wet} {crossed}");
}

#[test]
fn spray_is_white_and_stops_light() {
    let ball = |z: f32| Ball { center: Vec3::new(0.0, 0.0, z), radius: 0.5 };
    for height in [3.0, 10.0] {
        assert_eq!(under_a_slab(CLEAR, vec![ball(height)]), 0.0);
    }
    // In a slab, straight under its surface and under the light.
    let (solid, drops) = (Solid::slab(-5.0, 1.0), Drops(Balls(vec![ball(0.0)])));
    let half = Material { reflection: 0.0, ..with_loss(Vec3::splat(0.5), 0.5) };
    let mut scene = from_above(5.0, half);
    scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
    let lit = ground::AMBIENT + ground::DIFFUSE * 0.5 * (1.0 - R);
    let expected = 0.9 * lit * 0.5 * (1.0 - R);
    let (value, _) = middle_of(&[&solid, &drops], &scene, 4);
    assert_within(1e-4, value, Vec3::splat(expected));
}

#[test]
fn an_opaque_body_is_shaded_as_a_sphere() {
    let opaque = Material { transmission: 0.0, ..Material::DEFAULT };
    let mut scene = scene(DVec3::new(0.4, -6.0, 3.0), DVec3::ZERO, opaque);
    scene.lights = vec![Light::directional(Vec3::new(1.0, 0.5, -1.0), Vec3::ONE).unwrap()];
    scene.ground = Some(floor(-1.5));
    let settings = RenderSettings { samples: 4, ..RenderSettings::new(32, 32) };
    let source = ParticleShading::constant(Vec3::new(0.2, 0.4, 0.8));
    let never = AtomicBool::new(false);
    let body = render(&[&Solid::ball(1.0)], &scene, &source, &settings, &never).unwrap().0;
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let sphere = render(&[&ball], &scene, &source, &settings, &never).unwrap().0;
    for (body, sphere) in body.color.iter().flatten().zip(sphere.color.iter().flatten()) {
        assert!((body - sphere).abs() < 1e-3, "{body} {sphere}");
    }
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let mut scene =
        scene(DVec3::new(0.4, -6.0, 3.0), DVec3::ZERO, with_loss(Vec3::splat(0.6), 1.0));
    scene.particle_material_mut().specular = 0.5;
    scene.background = Background::default_for(Vec3::Z);
    scene.ground = Some(floor(-0.8));
    scene.lights = vec![Light::directional(Vec3::new(1.0, 0.5, -1.0), Vec3::ONE).unwrap()];
    let settings = RenderSettings {
        samples: 5,
        max_depth: 8,
        channels: Channels::ALL,
        ..RenderSettings::new(37, 21)
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| film(&Solid::ball(1.0), &scene, &settings))
    };
    let one = on(1);
    assert!(one.color.iter().flatten().all(|v| v.is_finite()));
    assert_eq!(one, on(5));
}
