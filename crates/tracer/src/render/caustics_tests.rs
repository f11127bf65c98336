//! Caustics on meshes and shadow catchers, and from all kinds of lights, against values computed by hand and the
//! caustics on a visible ground.

use std::f32::consts::PI;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};

use super::{
    integrator::testing,
    path_tests::{GLASS, floor_from_above, settings},
    solid::Solid,
    *,
};
use crate::scene::{
    Background, Camera, CameraView, Environment, Falloff, Finish, Ground, Light, LightKind,
    Material,
};
use spherule_surface::MaterialId;
use spherule_surface::mesh::{MeshNormals, MeshSurface, MeshTree, TriangleMesh, VisibleFaces};
use spherule_tree::math::{SimdLevel, Supported};

const SIDE: u32 = 32;

fn matte(albedo: f32) -> Material {
    Material::matte(Vec3::splat(albedo))
}

/// Glass around a dark world, seen from `eye`.
fn scene(eye: DVec3, look_at: DVec3, lights: Vec<Light>) -> Scene {
    let view = CameraView { eye, look_at, up: DVec3::Y, fov: 28.0 };
    let mut scene = floor_from_above(Environment::constant(Vec3::ZERO), Vec3::ONE);
    scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    *scene.particle_material_mut() = GLASS;
    scene.lights = lights;
    scene
}

/// The white floor at height 0, 5 by 5 units of it.
fn floor(lights: Vec<Light>) -> Scene {
    let mut scene = scene(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO, lights);
    if let Some(ground) = &mut scene.ground {
        (ground.fade_start, ground.lit_range) = (12.0, 12.0);
    }
    scene
}

/// The same floor as a square mesh, above a ground that nothing reaches.
fn mesh_floor(lights: Vec<Light>) -> (Scene, MeshTree) {
    let mut scene = floor(lights);
    scene.ground = None;
    scene.add(matte(1.0)).unwrap();
    (scene, square(Vec3::ZERO, 6.0 * Vec3::X, 6.0 * Vec3::Y))
}

fn light(kind: LightKind, radiance: f32) -> Light {
    Light { kind, radiance: Vec3::splat(radiance), casts_shadow: true, is_visible: false, group: 0 }
}

fn sun(to_light: Vec3, half_angle: f64, irradiance: f32) -> Light {
    let to_light = to_light.normalize();
    light(LightKind::Sun { to_light, half_angle }, irradiance)
}

fn square(center: Vec3, u: Vec3, v: Vec3) -> MeshTree {
    let corners = vec![center - u - v, center + u - v, center + u + v, center - u + v];
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    MeshTree::new(TriangleMesh::new(corners, triangles, MeshNormals::Flat).unwrap())
}

fn with_photons(photons: u32, samples: u32, bounces: u32) -> RenderSettings {
    RenderSettings { photons, max_depth: 8, ..settings(SIDE, samples, bounces) }
}

fn image(body: &dyn Shape, meshes: &[MeshTree], scene: &Scene, settings: &RenderSettings) -> Film {
    let meshes = surfaces(meshes);
    let mut shapes = vec![body];
    shapes.extend(meshes.iter().map(|mesh| mesh as &dyn Shape));
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    render(&shapes, scene, &source, settings, &never).unwrap().0
}

fn surfaces(meshes: &[MeshTree]) -> Vec<MeshSurface<'_>> {
    let surface = |(i, tree)| {
        MeshSurface::new(tree, VisibleFaces::Both, MaterialId::at(MaterialId::BASIC + i).unwrap())
    };
    meshes.iter().enumerate().map(surface).collect()
}

/// Means of the red parts of squares of four by four pixels.
fn blocks(film: &Film) -> Vec<f32> {
    let pixel = |x: usize, y: usize| film.color[SIDE as usize * y + x][0];
    let mean = |block: usize| {
        let [x, y] = [block % 8, block / 8].map(|i| 4 * i);
        (0..16).map(|i| pixel(x + i % 4, y + i / 4)).sum::<f32>() / 16.0
    };
    (0..64).map(mean).collect()
}

/// Distance from the middle of the picture beyond which no block shows the ball of
/// [`every_kind_of_light_makes_caustics`]. The ball magnifies what is below it, and the error of single kernels with
/// it.
const SILHOUETTE: f32 = 1.65;

/// Whether the middle of a block is farther than `distance` from that of the picture.
fn is_beyond(distance: f32, block: usize) -> bool {
    let [x, y] = [block % 8, block / 8].map(|i| (i as f32 - 3.5) * 0.62);
    x.hypot(y) > distance
}

/// Checks that two pictures have the same light in the same places farther than `distance` from the middle.
#[track_caller]
fn compare(found: &Film, expected: &Film, distance: f32, tolerance: f32, what: &str) {
    let [found, expected] = [found, expected].map(blocks);
    let sum = |blocks: &[f32]| blocks.iter().sum::<f32>();
    let ratio = sum(&found) / sum(&expected);
    assert!((ratio - 1.0).abs() < 0.02, "{what}: {ratio}");
    let brightest = expected.iter().fold(0.0_f32, |a, b| a.max(*b));
    for (number, (found, expected)) in found.iter().zip(&expected).enumerate() {
        if !is_beyond(distance, number) {
            continue;
        }
        let limit = tolerance * (expected + 0.2 * brightest);
        assert!((found - expected).abs() < limit, "{what} {number}: {found} {expected}");
    }
}

#[test]
fn a_slope_in_water_has_the_irradiance_of_refracted_light() {
    for (tilt, sun_angle) in [(0.0, 0.0), (0.5, 0.7), (-0.6, 0.7), (0.3, 1.2)] {
        // The light is refracted at the flat surface of water that has no other surface near
        let (tilt, sun_angle): (f32, f32) = (tilt, sun_angle);
        let to_sun = Vec3::new(sun_angle.sin(), 0.0, sun_angle.cos());
        let inner = (sun_angle.sin() / GLASS.ior).asin();
        let to_refracted = Vec3::new(inner.sin(), 0.0, inner.cos());
        let normal = Vec3::new(tilt.sin(), 0.0, tilt.cos());
        let reflected = crate::scene::material::dielectric(sun_angle.cos(), 1.0 / GLASS.ior);
        let irradiance =
            3.0 * (1.0 - reflected) * sun_angle.cos() / inner.cos() * normal.dot(to_refracted);
        // The camera is in the water, in front of the slope. Paths leave out that radiance in water is larger by the
        // square of the index
        let eye = (0.7 * normal).as_dvec3();
        let mut scene = scene(eye, DVec3::ZERO, vec![sun(to_sun, 0.001, 3.0)]);
        scene.ground = None;
        scene.add(matte(0.5)).unwrap();
        let along = Vec3::new(tilt.cos(), 0.0, -tilt.sin());
        let slope = square(Vec3::ZERO, 0.8 * along, 0.8 * Vec3::Y);
        let water = Solid::slab(-50.0, 1.0);
        let film = image(&water, &[slope], &scene, &with_photons(400_000, 4, 0));
        let expected = 0.5 * irradiance / (PI * GLASS.ior * GLASS.ior);
        let light: Vec<f32> = film.color.iter().map(|pixel| pixel[0]).collect();
        let mean = light.iter().sum::<f32>() / light.len() as f32;
        assert!((mean / expected - 1.0).abs() < 0.03, "{tilt} {sun_angle}: {mean} {expected}");
        let is_even = |value: &&f32| (*value / expected - 1.0).abs() < 0.35;
        assert!(light.iter().all(|value| is_even(&value)), "{tilt} {sun_angle}");
    }
}

#[test]
fn light_that_enters_water_straight_has_the_irradiance_of_refracted_light() {
    // Without photons. A flat interface keeps the flux through each horizontal area
    for sun_angle in [0.0_f32, 0.7, 1.2] {
        let to_sun = Vec3::new(sun_angle.sin(), 0.0, sun_angle.cos());
        let scene = {
            let (eye, lights) = (DVec3::new(0.0, 0.0, 0.7), vec![sun(to_sun, 1e-4, 3.0)]);
            let mut scene = scene(eye, DVec3::ZERO, lights);
            scene.ground = None;
            scene.add(matte(0.5)).unwrap();
            scene
        };
        let bottom = square(Vec3::ZERO, 2.0 * Vec3::X, 2.0 * Vec3::Y);
        let water = Solid::slab(-50.0, 1.0);
        let film = image(&water, &[bottom], &scene, &with_photons(0, 4, 0));
        let reflected = crate::scene::material::dielectric(sun_angle.cos(), 1.0 / GLASS.ior);
        let irradiance = 3.0 * sun_angle.cos() * (1.0 - reflected);
        let expected = 0.5 * irradiance / (PI * GLASS.ior * GLASS.ior);
        for pixel in &film.color {
            let error = pixel[0] / expected - 1.0;
            assert!(error.abs() < 1e-3, "{sun_angle}: {error}");
        }
    }
}

#[test]
fn a_mesh_has_the_caustic_of_a_floor() {
    let ball = Solid::ball_at(0.7 * Vec3::Z, 0.6);
    let lights = || vec![sun(Vec3::new(1.0, 0.0, 0.8), 0.05, PI)];
    let settings = with_photons(1_000_000, 16, 0);
    let expected = image(&ball, &[], &floor(lights()), &settings);
    let brightest = blocks(&expected).iter().fold(0.0_f32, |a, b| a.max(*b));
    assert!(brightest > 0.8, "{brightest}: no caustic");
    let (scene, mesh) = mesh_floor(lights());
    let found = image(&ball, &[mesh], &scene, &settings);
    compare(&found, &expected, 0.0, 0.05, "mesh");
}

// Six images with 1,500,000 photons each: their noise has to be less than the tolerance.
#[test]
fn every_kind_of_light_makes_caustics() {
    // Lights as large and bright as a sun, seen from the scene
    let (half_angle, distance) = (0.03_f64, 300.0_f32);
    #[expect(clippy::cast_possible_truncation, reason = "a test")]
    let radius = distance * half_angle.sin() as f32;
    let to_light = Vec3::new(0.4, 0.0, 1.0).normalize();
    let position = distance * to_light;
    let radiance = PI / (PI * (radius / distance).powi(2));
    let across = to_light.cross(Vec3::Y).normalize();
    let axes = [across, across.cross(to_light), -to_light];
    let side = 0.5 * radius * PI.sqrt();
    let kinds = [
        ("sphere", LightKind::Sphere { center: position, radius }, radiance),
        ("disc", LightKind::Disc { center: position, normal: -to_light, radius }, radiance),
        ("rectangle", LightKind::Rectangle { center: position, axes, half: [side; 2] }, radiance),
        (
            "point",
            LightKind::Point { position, falloff: Falloff::InverseSquare },
            PI * distance * distance,
        ),
    ];
    let ball = Solid::ball_at(Vec3::new(0.0, 0.0, 1.6), 1.0);
    let settings = with_photons(1_500_000, 16, 0);
    let expected = image(&ball, &[], &floor(vec![sun(to_light, half_angle, PI)]), &settings);
    for (name, kind, radiance) in kinds {
        let lights = vec![light(kind, radiance)];
        let found = image(&ball, &[], &floor(lights), &settings);
        // A point has sharper shadows and caustics
        let tolerance = if name == "point" { 0.3 } else { 0.15 };
        compare(&found, &expected, SILHOUETTE, tolerance, name);
    }
    // Two lights share the photons by their power
    let halves = [0.25 * PI, 0.75 * PI].map(|part| sun(to_light, half_angle, part));
    let found = image(&ball, &[], &floor(halves.to_vec()), &settings);
    compare(&found, &expected, SILHOUETTE, 0.15, "two suns");
}

#[test]
fn a_shadow_catcher_is_brighter_in_caustics() {
    let ball = Solid::ball_at(0.7 * Vec3::Z, 0.6);
    let lights = || vec![sun(Vec3::new(1.0, 0.0, 0.8), 0.05, PI)];
    let settings = with_photons(400_000, 64, 0);
    let expected = image(&ball, &[], &floor(lights()), &settings);
    let open = lights()[0].kind;
    let LightKind::Sun { to_light, .. } = open else {
        unreachable!("a sun");
    };
    let mut scene = floor(lights());
    scene.ground = scene.ground.map(|ground| Ground { shadow_catcher: Some(1.0), ..ground });
    scene.background = Background::Constant(Vec3::splat(to_light.z));
    let found = image(&ball, &[], &scene, &settings);
    // Beside the ball, the background is multiplied by the light of the floor over that without the ball
    let [found, expected] = [&found, &expected].map(blocks);
    let mut brightest = 0.0_f32;
    for number in (0..64).filter(|number| is_beyond(0.95, *number)) {
        let (found, expected) = (found[number], expected[number]);
        brightest = brightest.max(found);
        assert!((found - expected).abs() < 0.03 + 0.03 * expected, "{number}: {found} {expected}");
    }
    assert!(brightest > 1.2 * to_light.z, "{brightest}: no caustic");
    // Light is no coverage
    let settings = RenderSettings { transparent_background: true, ..settings };
    let film = image(&ball, &[], &scene, &settings);
    assert!(film.color.iter().flatten().all(|v| (0.0..=1.001).contains(v)));
    assert!(film.color.iter().any(|pixel| pixel[3] > 0.5));
}

#[test]
fn a_glossy_mesh_reflects_caustics() {
    // Under flat water, the light of photons is the light of the sun from another direction
    let lights = vec![sun(Vec3::Z, 0.02, PI)];
    let (_, mesh) = mesh_floor(Vec::new());
    let mut scene = scene(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, lights);
    scene.ground = None;
    scene.add(matte(1.0)).unwrap();
    scene.materials[MaterialId::BASIC].finish = Finish::Plastic { roughness: 0.6 };
    let settings = with_photons(400_000, 64, 0);
    let above = image(&Solid::slab(5.0, 6.0), std::slice::from_ref(&mesh), &scene, &settings);
    // The same without water, attenuated by both surfaces and reflections between them
    *scene.particle_material_mut() = Material { transmission: 0.0, ..GLASS };
    let open = image(&Solid::slab(-21.0, -20.0), &[mesh], &scene, &settings);
    let mean = |film: &Film| film.color.iter().map(|pixel| pixel[0]).sum::<f32>() / 1024.0;
    let ratio = mean(&above) / mean(&open);
    assert!((ratio - 0.96 / 1.04).abs() < 0.015, "{ratio}");
}

#[test]
fn light_of_photons_is_the_same_on_any_number_of_threads_and_for_all_instruction_sets() {
    let ball = Solid::ball_at(Vec3::new(0.3, 0.0, 1.6), 1.0);
    let lights = vec![
        sun(Vec3::new(0.3, 0.2, 1.0), 0.05, PI),
        light(LightKind::Sphere { center: Vec3::new(3.0, 3.0, 5.0), radius: 0.4 }, 20.0),
    ];
    let (mut scene, mesh) = mesh_floor(lights);
    scene.materials[MaterialId::BASIC].finish = Finish::Plastic { roughness: 0.3 };
    let catcher =
        Ground { shadow_catcher: Some(0.8), height: -0.5, ..floor(Vec::new()).ground.unwrap() };
    scene.ground = Some(catcher);
    let settings = with_photons(40_000, 4, 3);
    let meshes = [mesh];
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| image(&ball, &meshes, &scene, &settings))
    };
    let film = on(1);
    assert!(film.color.iter().flatten().all(|v| v.is_finite()));
    assert_eq!(film, on(3));
    // Instruction sets
    let films: Vec<Vec2> =
        (0..48_u8).map(|i| Vec2::new(f32::from(i % 7) / 7.0, f32::from(i) / 48.0)).collect();
    let source = ParticleShading::constant(Vec3::ONE);
    let surfaces = surfaces(&meshes);
    let by = |level: SimdLevel| {
        let plane = scene.ground.as_ref().map(Ground::shape);
        let mut shapes: Vec<&dyn Shape> = vec![&ball];
        shapes.extend(plane.iter().map(|plane| plane as &dyn Shape));
        shapes.extend(surfaces.iter().map(|mesh| mesh as &dyn Shape));
        let mut context = RenderContext::new(shapes, &scene, &source, &settings);
        context.simd = Supported::or_best(level);
        let never = AtomicBool::new(false);
        let (integrator, _) = PathIntegrator::new(context).with_photons(&never).unwrap();
        testing::radiance_at(&integrator, &films)
    };
    let portable = by(SimdLevel::Portable);
    for level in [SimdLevel::Avx2, SimdLevel::Avx512, SimdLevel::Neon] {
        assert!(by(level) == portable, "{level:?}");
    }
}
