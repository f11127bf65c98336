//! The branches that are traced at transmissive spheres: both, as in equation 4.1, or one in place of both.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};

use super::{
    brute::{Ball, Balls},
    integrator::testing::radiance_at,
    solid::Solid,
    *,
};
use crate::scene::{
    Background, Camera, CameraView,
    material::{reflect, refract, schlick},
};
use spherule_surface::{Shape, spheres::SphereSurface};
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
use spherule_tree::ray::Ray;

const AMBIENT: f32 = 0.125;

fn unit(seed: u32) -> f32 {
    let mixed = seed.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b);
    ((mixed ^ (mixed >> 13)) >> 8) as f32 / 16_777_216.0
}

/// Balls in a cube of edge 2 around the origin; nearly all of them overlap others.
fn heap(count: u32) -> Vec<Ball> {
    let ball = |i: u32| Ball {
        center: Vec3::new(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)) * 2.0 - 1.0,
        radius: 0.25,
    };
    (0..count).map(ball).collect()
}

fn glass_scene() -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -6.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 20.0,
    };
    Scene {
        ambient_light: Vec3::splat(AMBIENT),
        materials: Scene::basic_materials(Material {
            ambient: 1.0,
            ior: 1.5,
            transmission: 1.0,
            ..Material::DEFAULT
        }),
        background: Background::Gradient {
            bottom: Vec3::ZERO,
            top: Vec3::ONE,
            up: Vec3::new(0.6, 0.0, 0.8),
        },
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

fn trace(surface: &dyn Shape, scene: &Scene, settings: &RenderSettings) -> (Film, RayCounts) {
    let source = ParticleShading::constant(Vec3::ONE);
    render(&[surface], scene, &source, settings, &AtomicBool::new(false)).unwrap()
}

/// Equation 4.1 with ambient light only, and always both branches.
fn equation_4_1(surface: &Balls, scene: &Scene, ray: &Ray, levels: u32) -> Vec3 {
    let hit = (levels > 0).then(|| surface.nearest(ray)).flatten();
    let Some(hit) = hit else {
        return scene.background.color(ray.direction);
    };
    let enters = ray.direction.dot(hit.normal) < 0.0;
    let ior = scene.particle_material().ior;
    let (normal, ratio) = if enters { (hit.normal, 1.0 / ior) } else { (-hit.normal, ior) };
    let step = hit.offset * normal;
    let below = |from, to| equation_4_1(surface, scene, &Ray::new(from, to), levels - 1);
    let mirrored = below(hit.anchor + step, reflect(ray.direction, normal));
    let Some(onward) = refract(ray.direction, normal, ratio) else {
        return AMBIENT + mirrored;
    };
    let r = schlick(scene.particle_material().r0(), -ray.direction.dot(normal));
    AMBIENT + r * mirrored + (1.0 - r) * below(hit.anchor - step, onward)
}

#[test]
fn min_weight_0_is_equation_4_1() {
    let balls = Balls(heap(40));
    let scene = glass_scene();
    let settings = RenderSettings { max_depth: 6, min_weight: 0.0, ..RenderSettings::new(12, 12) };
    let (film, _) = trace(&balls, &scene, &settings);
    for (pixel, color) in film.color.iter().enumerate() {
        let (x, y) = (pixel % 12, pixel / 12);
        let place = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / 12.0;
        let expected = equation_4_1(&balls, &scene, &scene.camera.ray(place), 6);
        let error = (Vec3::from_slice(&color[..3]) - expected).abs().max_element();
        assert!(error < 1e-5, "{pixel}: {color:?} {expected}");
    }
}

#[test]
fn one_random_branch_has_the_mean_of_both() {
    let balls = heap(60);
    let centers: Vec<Vec3> = balls.iter().map(|ball| ball.center).collect();
    let mut builder = TreeBuilder::new();
    let radius = SphereRadius::Common(0.25);
    let centers = &centers;
    builder.build(&Spheres { centers, radius }, &BuildSettings::default());
    let surface = SphereSurface::new(builder.tree().view());
    let scene = glass_scene();
    let image = |min_weight: f32| {
        let settings =
            RenderSettings { max_depth: 6, min_weight, samples: 1024, ..RenderSettings::new(4, 4) };
        trace(&surface, &scene, &settings)
    };
    let (literal, all) = image(0.0);
    // The larger the weight, the more choices are random: at 1 there is one path per sample.
    for (min_weight, limit) in [(DEFAULT_MIN_WEIGHT, 0.001), (0.05, 0.01), (1.0, 0.03)] {
        let (drawn, counts) = image(min_weight);
        assert!(counts.total() < all.total(), "{min_weight}");
        let mut mean = Vec3::ZERO;
        for (a, b) in literal.color.iter().zip(&drawn.color) {
            let difference = Vec3::from_slice(&b[..3]) - Vec3::from_slice(&a[..3]);
            let worst = difference.abs().max_element();
            assert!(worst < limit, "{min_weight}: {worst}");
            mean += difference / literal.color.len() as f32;
        }
        // The mean of sixteen pixels has a quarter of the standard error.
        let bias = mean.abs().max_element();
        assert!(bias < limit / 4.0, "{min_weight}: {bias}");
    }
}

#[test]
fn the_deepest_recursion_has_a_bounded_number_of_rays() {
    let balls = heap(300);
    let centers: Vec<Vec3> = balls.iter().map(|ball| ball.center).collect();
    let mut builder = TreeBuilder::new();
    let radius = SphereRadius::Common(0.25);
    let centers = &centers;
    builder.build(&Spheres { centers, radius }, &BuildSettings::default());
    let surface = SphereSurface::new(builder.tree().view());
    let scene = glass_scene();
    let rays = |max_depth: u32| {
        let settings = RenderSettings { max_depth, ..RenderSettings::new(16, 16) };
        let (_, counts) = trace(&surface, &scene, &settings);
        (counts.reflection + counts.refraction) as f64 / counts.primary as f64
    };
    // At most 1024 paths at each level; few of them leave glass this dense early. Without a limit there are a million
    // at level 20.
    let [middle, deep] = [MAX_DEPTH / 2, MAX_DEPTH].map(rays);
    assert!(deep < 10_000.0 && deep < 5.0 * middle, "{middle} {deep}");
}

#[test]
fn opaque_spheres_do_not_depend_on_the_weight() {
    let balls = Balls(heap(60));
    let mut scene = glass_scene();
    for (reflection, transmission) in [(1.0, 0.0), (0.0, 1.0)] {
        scene.particle_material_mut().reflection = reflection;
        scene.particle_material_mut().transmission = transmission;
        let image = |min_weight: f32| {
            let settings =
                RenderSettings { max_depth: MAX_DEPTH, min_weight, ..RenderSettings::new(24, 24) };
            trace(&balls, &scene, &settings)
        };
        assert!(image(0.0) == image(1.0), "{reflection} {transmission}");
    }
}

#[test]
fn unbounded_settings_are_rejected() {
    let balls = Balls(heap(2));
    let source = ParticleShading::constant(Vec3::ONE);
    let refused = |scene: &Scene, max_depth: u32, min_weight: f32| {
        let settings = RenderSettings { max_depth, min_weight, ..RenderSettings::new(2, 2) };
        render(&[&balls], scene, &source, &settings, &AtomicBool::new(false)).err()
    };
    let mut scene = glass_scene();
    assert_eq!(refused(&scene, MAX_LITERAL_DEPTH, 0.0), None);
    let too_many = RenderError::TooManyBranches { max_depth: 9 };
    assert_eq!(refused(&scene, 9, 0.0), Some(too_many));
    assert_eq!(refused(&scene, 9, 1e-5), None);
    assert_eq!(refused(&scene, 3, 1e-6), Some(RenderError::MinWeight(1e-6)));
    assert!(refused(&scene, 3, f32::NAN).is_some());
    scene.particle_material_mut().transmission = 0.0;
    assert_eq!(refused(&scene, 9, 0.0), None);
}

#[test]
fn radiance_does_not_depend_on_packet_neighbours() {
    let balls = Balls(heap(60));
    let solid = Solid::ball(1.0);
    let shapes: [&dyn Shape; 2] = [&balls, &solid];
    let films: Vec<Vec2> =
        (0..400).map(|i| Vec2::new((i % 20) as f32, (i / 20) as f32) / 20.0).collect();
    let scene = glass_scene();
    let source = ParticleShading::constant(Vec3::ONE);
    let settings = RenderSettings { max_depth: 7, min_weight: 0.01, ..RenderSettings::new(20, 20) };
    for shape in shapes {
        let of = |films: &[Vec2], segments: usize| {
            let mut integrator =
                WhittedIntegrator::new(RenderContext::new(vec![shape], &scene, &source, &settings));
            integrator.context.max_segments = segments;
            let (colors, counts) = radiance_at(&integrator, films);
            let bits = |color: Vec3| color.to_array().map(f32::to_bits);
            (colors.into_iter().map(bits).collect::<Vec<_>>(), counts)
        };
        let (whole, counts) = of(&films, 1 << 16);
        assert!(counts.refraction > 100);
        for segments in [1, 300, 5000] {
            assert_eq!(of(&films, segments), (whole.clone(), counts));
        }
        for first in [1, 7, 15] {
            assert_eq!(of(&films[first..], 5000).0, whole[first..]);
        }
    }
}
