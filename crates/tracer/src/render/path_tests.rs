//! Path tracing against energy conservation and values computed by hand.

use std::f32::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};

use super::{
    brute::{Ball, Balls},
    integrator::testing,
    solid::Solid,
    *,
};
use crate::scene::environment::studio;
use crate::scene::{
    Background, Camera, CameraView, Environment, EnvironmentAxes, Falloff, Fresnel, Ground, Light,
    LightKind, Material,
};
use spherule_tree::math::{SimdLevel, Supported};

/// Looks along +y from a distance of 10.
fn scene(environment: Environment) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 12.0,
    };
    Scene {
        background: Background::Constant(Vec3::new(0.1, 0.2, 0.3)),
        environment: Some(Arc::new(environment)),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

pub(super) fn white() -> Environment {
    Environment::constant(Vec3::ONE)
}

pub(super) fn settings(side: u32, samples: u32, bounces: u32) -> RenderSettings {
    RenderSettings {
        samples,
        bounces,
        integrator: IntegratorKind::Path,
        ..RenderSettings::new(side, side)
    }
}

pub(super) fn image(
    shape: &dyn Shape,
    scene: &Scene,
    albedo: Vec3,
    settings: &RenderSettings,
) -> Film {
    let source = ParticleShading::constant(albedo);
    let never = AtomicBool::new(false);
    render(&[shape], scene, &source, settings, &never).unwrap().0
}

/// The pixels that the shape covers, as colours.
pub(super) fn covered(film: &Film) -> Vec<Vec3> {
    let inside = film.color.iter().filter(|c| c[3] == 1.0);
    inside.map(|c| Vec3::from_slice(&c[..3])).collect()
}

/// Mean and standard deviation of pixels, over all components.
pub(super) fn statistics(pixels: &[Vec3]) -> (f32, f32) {
    let count = pixels.len() as f32;
    let mean = pixels.iter().map(|p| p.element_sum() / 3.0).sum::<f32>() / count;
    let square = pixels.iter().map(|p| (*p - mean).length_squared() / 3.0).sum::<f32>() / count;
    (mean, square.sqrt())
}

/// A heap of balls that touch and overlap.
pub(super) fn heap() -> Balls {
    let ball = |i: u16| Ball {
        center: Vec3::new(
            f32::from(i % 4) - 1.5,
            f32::from(i / 4 % 3) - 1.0,
            f32::from(i / 12) - 1.0,
        ) * 0.5
            + Vec3::splat(0.03 * f32::from(i % 5)),
        radius: 0.3,
    };
    Balls((0..36).map(ball).collect())
}

#[test]
fn a_convex_body_in_white_surroundings_has_its_albedo() {
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let scene = scene(white());
    for (albedo, bounces) in [(0.5, 0), (0.5, 6), (1.0, 0), (0.0, 3)] {
        let film = image(&ball, &scene, Vec3::splat(albedo), &settings(24, 64, bounces));
        let pixels = covered(&film);
        let (mean, deviation) = statistics(&pixels);
        assert!(pixels.len() > 200);
        assert!((mean - albedo).abs() < 1.5e-3, "{albedo} {bounces}: {mean}");
        assert!(deviation < 0.03, "{albedo} {bounces}: {deviation}");
    }
}

#[test]
fn white_bodies_in_white_surroundings_are_white() {
    let heap = heap();
    let film = image(&heap, &scene(white()), Vec3::ONE, &settings(24, 64, 1000));
    let pixels = covered(&film);
    let (mean, deviation) = statistics(&pixels);
    assert!(pixels.len() > 200);
    assert!((mean - 1.0).abs() < 4e-3, "{mean}");
    assert!(deviation < 0.12, "{deviation}");
    // Without diffuse reflections, gaps are dark.
    let film = image(&heap, &scene(white()), Vec3::ONE, &settings(24, 16, 0));
    assert!(statistics(&covered(&film)).0 < 0.9);
    // Colours above white do not create light.
    let film = image(&heap, &scene(white()), Vec3::splat(7.0), &settings(24, 16, 1000));
    assert!(statistics(&covered(&film)).0 < 1.02);
}

#[test]
fn light_inside_a_ball_is_a_geometric_series() {
    // The camera and a light in the middle of a hollow ball of radius 20, which is lit evenly.
    let ball = Balls::one(Vec3::ZERO, 20.0);
    let mut scene = scene(Environment::constant(Vec3::ZERO));
    let intensity = Vec3::splat(800.0);
    let light = Light::point_with(DVec3::ZERO, DVec3::ZERO, intensity, Falloff::InverseSquare);
    scene.lights = vec![light];
    let albedo = 0.6_f32;
    let direct = albedo / PI * 800.0 / 400.0;
    // Rays start at a small distance from the wall, which is nearer to the light
    for (bounces, limit) in [(0, 4e-4), (1, 4e-4), (2, 4e-4), (9, 0.02)] {
        let settings = settings(8, 256, bounces);
        let film = image(&ball, &scene, Vec3::splat(albedo), &settings);
        let (mean, _) = statistics(&covered(&film));
        let series: f32 = (0..=bounces).map(|n| albedo.powi(i32::try_from(n).unwrap())).sum();
        let wanted = direct * series;
        assert!((mean / wanted - 1.0).abs() < limit, "{bounces}: {mean} {wanted}");
    }
}

/// A floor seen straight from above.
pub(super) fn floor_from_above(environment: Environment, color: Vec3) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, 0.0, 10.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        fov: 12.0,
    };
    Scene {
        camera: Camera::new(&view, 1.0, DVec3::ZERO).unwrap(),
        ground: Some(Ground { color, ..body_tests::floor(0.0) }),
        particles: [Vec3::splat(-2.0), Vec3::splat(2.0)],
        ..scene(environment)
    }
}

#[test]
fn a_floor_shows_the_irradiance_of_the_environment() {
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 20.0);
    let environment = studio(axes, Vec3::new(1.0, 0.5, 2.0));
    let color = Vec3::new(0.2, 0.4, 0.6);
    let wanted = color * environment.irradiance(Vec3::Z) / PI;
    let scene = floor_from_above(environment, color);
    let film = image(&Balls(Vec::new()), &scene, Vec3::ONE, &settings(16, 256, 0));
    let pixels = covered(&film);
    let mean = pixels.iter().sum::<Vec3>() / pixels.len() as f32;
    assert_eq!(pixels.len(), 256);
    assert!((mean / wanted - 1.0).abs().max_element() < 5e-3, "{mean} {wanted}");
}

/// A clear material: no light is lost in it.
pub(super) const GLASS: Material =
    Material { ior: 1.5, transmission: 1.0, fresnel: Fresnel::Exact, ..Material::DEFAULT };

#[test]
fn glass_in_white_surroundings_is_invisible() {
    let shapes: [&dyn Shape; 2] = [&Balls::one(Vec3::ZERO, 1.0), &Solid::ball(1.0)];
    for shape in shapes {
        let mut scene = scene(white());
        *scene.particle_material_mut() = GLASS;
        for max_depth in [1, 2, 8] {
            let settings = RenderSettings { max_depth, ..settings(16, 16, 6) };
            let film = image(shape, &scene, Vec3::splat(0.3), &settings);
            for pixel in covered(&film) {
                assert!((pixel - 1.0).abs().max_element() < 1e-4, "{max_depth}: {pixel}");
            }
        }
    }
}

#[test]
fn a_white_floor_below_glass_is_white() {
    // Light that shadow rays do not bring through the glass, paths must bring, and none twice.
    let shapes: [&dyn Shape; 2] =
        [&Balls::one(Vec3::new(0.0, 0.0, 1.2), 1.0), &Solid::slab(0.5, 1.5)];
    for shape in shapes {
        let mut scene = floor_from_above(white(), Vec3::ONE);
        *scene.particle_material_mut() = GLASS;
        // Without diffuse reflections, light that the glass sends back to the floor is lost
        for (bounces, low, high) in [(1000, 0.99, 1.01), (0, 0.8, 0.97)] {
            let settings = RenderSettings { max_depth: 24, ..settings(16, 64, bounces) };
            let film = image(shape, &scene, Vec3::ONE, &settings);
            let (mean, _) = statistics(&covered(&film));
            assert!(mean > low && mean < high, "{bounces}: {mean}");
        }
    }
}

#[test]
fn lights_shine_straight_through_glass() {
    // At normal incidence a slab of glass transmits 0.96 at each surface.
    let mut scene = floor_from_above(Environment::constant(Vec3::ZERO), Vec3::splat(0.5));
    scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::splat(PI)).unwrap()];
    *scene.particle_material_mut() = GLASS;
    let settings = RenderSettings { max_depth: 8, ..settings(4, 64, 0) };
    let open = image(&Balls(Vec::new()), &scene, Vec3::ONE, &settings);
    let below = image(&Solid::slab(20.0, 30.0), &scene, Vec3::ONE, &settings);
    let [open, below] = [open, below].map(|film| statistics(&covered(&film)).0);
    assert!((open - 0.5).abs() < 1e-4, "{open}");
    assert!((below / open - 0.96 * 0.96).abs() < 1e-3, "{below} {open}");
}

#[test]
fn the_camera_sees_the_background_unless_the_environment_is_visible() {
    let nothing = Balls(Vec::new());
    let mut scene = scene(Environment::constant(Vec3::new(3.0, 2.0, 1.0)));
    let pixel = |scene: &Scene, transparent_background: bool| {
        let settings = RenderSettings { transparent_background, ..settings(1, 1, 1) };
        image(&nothing, scene, Vec3::ONE, &settings).color[0]
    };
    assert_eq!(pixel(&scene, false), [0.1, 0.2, 0.3, 0.0]);
    assert_eq!(pixel(&scene, true), [0.0; 4]);
    scene.is_environment_visible = true;
    let seen = pixel(&scene, false);
    assert!((Vec3::from_slice(&seen) - Vec3::new(3.0, 2.0, 1.0)).length() < 1e-5);
    assert_eq!(pixel(&scene, true), [0.0; 4]);
}

#[test]
fn the_same_bits_on_any_threads_and_instructions() {
    let heap = heap();
    let source = ParticleShading::constant(Vec3::new(0.8, 0.6, 0.3));
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    for (transmission, shadow_catcher) in
        [(0.0, None), (0.9, None), (0.0, Some(1.0)), (0.9, Some(1.0))]
    {
        let mut scene = floor_from_above(studio(axes, Vec3::ONE), Vec3::splat(0.5));
        scene.particle_material_mut().transmission = transmission;
        scene.background = Background::Studio { up: Vec3::Z };
        let kind = LightKind::Sphere { center: Vec3::new(1.0, 2.0, 2.0), radius: 0.5 };
        scene.lights = vec![Light {
            kind,
            radiance: Vec3::ONE,
            casts_shadow: true,
            is_visible: true,
            group: 0,
        }];
        if let Some(ground) = &mut scene.ground {
            ground.shadow_catcher = shadow_catcher;
        }
        let settings = settings(33, 5, 4);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let never = AtomicBool::new(false);
            let draw = || render(&[&heap], &scene, &source, &settings, &never).unwrap();
            pool.build().unwrap().install(draw)
        };
        let (film, counts) = on(1);
        assert!(film.color.iter().flatten().all(|v| v.is_finite()));
        assert!(
            counts.shadow > counts.primary / 4 && counts.reflection > 0,
            "{transmission}: {counts:?}"
        );
        assert_eq!((film.clone(), counts), on(2));
        assert_eq!((film, counts), on(5));
        // Instruction sets
        let films: Vec<Vec2> =
            (0..48_u8).map(|i| Vec2::new(f32::from(i % 7) / 7.0, f32::from(i) / 48.0)).collect();
        let by = |level: SimdLevel| {
            let plane = scene.ground.as_ref().map(Ground::shape);
            let mut shapes: Vec<&dyn Shape> = vec![&heap];
            shapes.extend(plane.iter().map(|plane| plane as &dyn Shape));
            let mut context = RenderContext::new(shapes, &scene, &source, &settings);
            context.simd = Supported::or_best(level);
            testing::radiance_at(&PathIntegrator::new(context), &films)
        };
        let portable = by(SimdLevel::Portable);
        for level in [SimdLevel::Avx2, SimdLevel::Avx512, SimdLevel::Neon] {
            assert!(by(level) == portable, "{level:?}");
        }
    }
}

fn with_ambient(settings: RenderSettings) -> RenderSettings {
    RenderSettings { indirect: IndirectLight::Ambient { radius: 0.3 }, ..settings }
}

#[test]
fn ambient_light_creates_none() {
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let settings = with_ambient(settings(24, 64, 6));
    let film = image(&ball, &scene(white()), Vec3::ONE, &settings);
    let (mean, deviation) = statistics(&covered(&film));
    assert!((mean - 1.0).abs() < 1.5e-3 && deviation < 0.03, "{mean}");
    // White bodies in white surroundings would be white
    let film = image(&heap(), &scene(white()), Vec3::ONE, &settings);
    let pixels = covered(&film);
    let (mean, _) = statistics(&pixels);
    assert!(mean > 0.75 && mean < 1.0, "{mean}");
    let brightest = pixels.iter().fold(0.0_f32, |most, p| most.max(p.max_element()));
    // But for noise
    assert!(brightest < 1.1, "{brightest}");
}

#[test]
fn ambient_light_needs_fewer_rays() {
    let (heap, source) = (heap(), ParticleShading::constant(Vec3::splat(0.8)));
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let mut scene = scene(studio(axes, Vec3::ONE));
    let sun = Light::directional(Vec3::new(0.3, 0.5, -1.0), Vec3::ONE).unwrap();
    scene.lights = vec![sun];
    let traced = |settings: RenderSettings| {
        let never = AtomicBool::new(false);
        let (film, counts) = render(&[&heap], &scene, &source, &settings, &never).unwrap();
        (film.color, counts)
    };
    let (_, full) = traced(settings(24, 16, 6));
    let (ambient, counts) = traced(with_ambient(settings(24, 16, 6)));
    assert_eq!(counts.primary, full.primary);
    assert!(counts.shadow < 4 * full.shadow / 5, "{counts:?} {full:?}");
    assert!(counts.reflection < 4 * full.reflection / 5, "{counts:?} {full:?}");
    // No path has more than one diffuse reflection
    assert_eq!((ambient, counts), traced(with_ambient(settings(24, 16, 1))));
    // Direct light needs no estimate
    assert_eq!(traced(settings(24, 16, 0)), traced(with_ambient(settings(24, 16, 0))));
}

#[test]
fn ambient_light_is_that_of_every_source() {
    let heap = heap();
    let mut lit = scene(Environment::constant(Vec3::ZERO));
    lit.lights = vec![Light::directional(Vec3::new(0.3, 0.5, -1.0), Vec3::ONE).unwrap()];
    for scene in [lit, scene(white())] {
        let mean = |settings: &RenderSettings| {
            let film = image(&heap, &scene, Vec3::splat(0.8), settings);
            statistics(&covered(&film)).0
        };
        let direct = mean(&settings(24, 64, 0));
        let (full, ambient) =
            (mean(&settings(24, 64, 6)), mean(&with_ambient(settings(24, 64, 6))));
        assert!(full > 1.02 * direct, "{direct} {full}");
        assert!(ambient > 1.02 * direct, "{direct} {ambient}");
        assert!((ambient / full - 1.0).abs() < 0.25, "{full} {ambient}");
    }
}

#[test]
fn ambient_light_is_the_same_on_any_threads_and_instructions() {
    let (heap, source) = (heap(), ParticleShading::constant(Vec3::new(0.8, 0.6, 0.3)));
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let scene = floor_from_above(studio(axes, Vec3::ONE), Vec3::splat(0.5));
    let settings = with_ambient(settings(33, 5, 4));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let never = AtomicBool::new(false);
        let draw = || render(&[&heap], &scene, &source, &settings, &never).unwrap();
        pool.build().unwrap().install(draw)
    };
    assert_eq!(on(1), on(4));
    let films: Vec<Vec2> =
        (0..48_u8).map(|i| Vec2::new(f32::from(i % 7) / 7.0, f32::from(i) / 48.0)).collect();
    let by = |level: SimdLevel| {
        let mut context = RenderContext::new(vec![&heap], &scene, &source, &settings);
        context.simd = Supported::or_best(level);
        testing::radiance_at(&PathIntegrator::new(context), &films)
    };
    let portable = by(SimdLevel::Portable);
    for level in [SimdLevel::Avx2, SimdLevel::Avx512, SimdLevel::Neon] {
        assert!(by(level) == portable, "{level:?}");
    }
}

#[test]
fn more_samples_converge_to_the_same_picture() {
    let heap = heap();
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let scene = scene(studio(axes, Vec3::ONE));
    let of = |samples| {
        // Without the background, which would hide differences
        let settings = RenderSettings { transparent_background: true, ..settings(12, samples, 6) };
        let film = image(&heap, &scene, Vec3::new(0.7, 0.5, 0.2), &settings);
        let pixels = film.color.iter().map(|c| Vec3::from_slice(&c[..3]));
        pixels.sum::<Vec3>()
    };
    let (few, many) = (of(16), of(1024));
    assert!((few / many - 1.0).abs().max_element() < 0.05, "{few} {many}");
}

#[test]
fn pictures_of_several_seeds_can_be_averaged() {
    let heap = heap();
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let scene = scene(studio(axes, Vec3::ONE));
    let of = |samples, seed| {
        let settings = RenderSettings { seed, ..settings(16, samples, 6) };
        let film = image(&heap, &scene, Vec3::new(0.7, 0.5, 0.2), &settings);
        film.color.iter().map(|c| Vec3::from_slice(&c[..3])).collect::<Vec<_>>()
    };
    let truth = of(1024, 9);
    let error = |picture: &[Vec3]| {
        let squares = picture.iter().zip(&truth).map(|(a, b)| a.distance_squared(*b));
        (squares.sum::<f32>() / truth.len() as f32).sqrt()
    };
    let pictures = [0, 1, 2, u32::MAX].map(|seed| of(4, seed));
    let mean: Vec<_> =
        (0..truth.len()).map(|i| pictures.iter().map(|p| p[i]).sum::<Vec3>() / 4.0).collect();
    // Equal noise would leave the error as it is, independent noise halves it
    let ratio = error(&mean) / (pictures.iter().map(|p| error(p)).sum::<f32>() / 4.0);
    assert!((0.4..0.6).contains(&ratio), "{ratio}");
}
