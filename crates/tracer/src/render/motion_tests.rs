//! Motion blur: the coverage of a moving disc, and shadows at the time of their camera ray.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::*;
use crate::scene::{Background, Camera, CameraView, Exposure, Light, Material};
use spherule_surface::moving::MovingSpheres;
use spherule_surface::slices::SlicedSurface;
use spherule_surface::spheres::SphereSurface;
use spherule_tree::accel::moving::MovingTree;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};

const SIDE: u32 = 32;
/// Length of a pixel at distance 100.
const PIXEL: f32 = 0.25;
const SAMPLES: u32 = 256;

/// Looks along +y from a distance of 100.
fn scene() -> Scene {
    scene_from(0.0)
}

/// The same from a camera at `x`.
fn scene_from(x: f32) -> Scene {
    let x = f64::from(x);
    let half = f64::from(0.5 * SIDE as f32 * PIXEL / 100.0);
    let view = CameraView {
        eye: DVec3::new(x, -100.0, 0.0),
        look_at: DVec3::new(x, 0.0, 0.0),
        up: DVec3::Z,
        fov: 2.0 * half.atan().to_degrees(),
    };
    Scene {
        background: Background::Constant(Vec3::ZERO),
        materials: Scene::basic_materials(Material {
            ambient: 0.0,
            specular: 0.0,
            reflection: 0.0,
            ..Material::DEFAULT
        }),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

#[expect(clippy::unnecessary_wraps, reason = "a field of a scene")]
fn exposure(cameras: [Camera; 2], slices: u32) -> Option<Exposure> {
    Some(Exposure { cameras, slices })
}

/// Spheres in a static tree.
fn tree(centers: &[Vec3], radii: &[f32]) -> TreeBuilder {
    let spheres = Spheres { centers, radius: SphereRadius::Each(radii) };
    let mut builder = TreeBuilder::new();
    let build = BuildSettings { keep_indices: true, ..BuildSettings::default() };
    builder.build(&spheres, &build);
    builder
}

/// A moving tree over spheres that all move from `centers` by `displacement`.
fn moving(centers: &[Vec3], radii: &[f32], displacement: Vec3) -> MovingTree {
    let middles: Vec<Vec3> = centers.iter().map(|c| *c + 0.5 * displacement).collect();
    let mut moving = MovingTree::default();
    let displacements = vec![displacement; centers.len()];
    moving.build(&tree(&middles, radii).tree().view(), &displacements);
    moving
}

/// The film of `shape` in `scene`.
fn film(shape: &dyn Shape, scene: &Scene, integrator: IntegratorKind) -> Film {
    let settings = RenderSettings {
        samples: SAMPLES,
        integrator,
        channels: Channels::ALL,
        ..RenderSettings::new(SIDE, SIDE)
    };
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    render(&[shape], scene, &source, &settings, &never).unwrap().0
}

/// Coverage of the pixel in column `x` and row `y` by a disc of `radius` whose centre moves from `start` by `length`
/// along the rows, all in pixels.
fn coverage(x: u32, y: u32, radius: f32, start: [f32; 2], length: f32) -> f32 {
    let parts = 32_u8;
    let mut sum = 0.0;
    for (i, j) in (0..parts).flat_map(|j| (0..parts).map(move |i| (i, j))) {
        let inside = |i: u8| (f32::from(i) + 0.5) / f32::from(parts);
        let across = x as f32 + inside(i) - start[0];
        let down = y as f32 + inside(j) - start[1];
        let half = (radius * radius - down * down).max(0.0).sqrt();
        // The part of the way on which the disc covers the point
        let (from, to) = ((across - half).max(0.0), (across + half).min(length));
        sum += (to - from).max(0.0) / length;
    }
    sum / f32::from(parts).powi(2)
}

/// Checks that the alpha of `film` is the coverage by a disc on its way, see [`coverage`].
#[track_caller]
fn check_coverage(film: &Film, radius: f32, start: [f32; 2], length: f32) {
    let mut total = 0.0;
    for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
        let found = film.color[(y * SIDE + x) as usize][3];
        let expected = coverage(x, y, radius, start, length);
        let noise = (expected * (1.0 - expected) / SAMPLES as f32).sqrt();
        let error = (found - expected).abs();
        assert!(error < 4.0 * noise + 0.02, "{x} {y}: {found} {expected}");
        total += found;
    }
    // The area of the disc
    let area = std::f32::consts::PI * radius * radius;
    assert!((total / area - 1.0).abs() < 0.01, "{total} {area}");
}

const RADIUS: f32 = 3.0;
const LENGTH: f32 = 14.0;
const START: [f32; 2] = [9.0, 17.0];
/// The centre of the disc at `START`.
const CENTER: Vec3 = Vec3::new((START[0] - 16.0) * PIXEL, 0.0, (16.0 - START[1]) * PIXEL);

#[test]
fn a_moving_ball_covers_the_way_of_its_disc() {
    let displacement = Vec3::new(LENGTH * PIXEL, 0.0, 0.0);
    let moving = moving(&[CENTER], &[RADIUS * PIXEL], displacement);
    let mut scene = scene();
    scene.exposure = exposure([scene.camera; 2], 1);
    for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
        let film = film(&MovingSpheres::new(&moving), &scene, integrator);
        check_coverage(&film, RADIUS, START, LENGTH);
    }
}

#[test]
fn a_moving_camera_blurs_what_is_still() {
    let tree = tree(&[CENTER], &[RADIUS * PIXEL]);
    let mut scene = scene();
    // The camera moves the other way
    let close = scene_from(-LENGTH * PIXEL).camera;
    scene.exposure = exposure([scene.camera, close], 1);
    let film = film(&SphereSurface::new(tree.tree().view()), &scene, IntegratorKind::Path);
    check_coverage(&film, RADIUS, START, LENGTH);
}

#[test]
fn slices_are_seen_at_their_times() {
    // Two slices: a ball on the left, and one on the right
    let trees = [-2.0, 2.0].map(|x| tree(&[Vec3::new(x, 0.0, 0.0)], &[1.0]));
    let surfaces = trees.iter().map(|trees| SphereSurface::new(trees.tree().view()));
    let sliced = SlicedSurface::new(surfaces.collect(), false);
    let mut scene = scene();
    scene.exposure = exposure([scene.camera; 2], 2);
    scene.lights.push(Light::directional(Vec3::Y, Vec3::ONE).unwrap());
    let film = film(&sliced, &scene, IntegratorKind::Whitted);
    let pixel = |x: u32| film.color[(16 * SIDE + x) as usize];
    for x in [8, 23] {
        assert!((pixel(x)[3] - 0.5).abs() < 0.02, "{:?}", pixel(x));
        // Half of the time it is lit: no ball casts a shadow on itself at another time
        assert!((pixel(x)[0] - 0.5 * 0.7).abs() < 0.05, "{:?}", pixel(x));
    }
    assert_eq!(pixel(16)[3], 0.0);
}

#[test]
fn shadows_move_with_their_spheres() {
    // The left ball always keeps the light from the left off the right one, which is smaller. At any other time than
    // its own, it would let light pass
    let centers = [Vec3::new(-1.5, 0.0, -1.5), Vec3::new(0.5, 0.0, -1.5)];
    let moving = moving(&centers, &[0.5, 0.4], Vec3::new(0.0, 0.0, 3.0));
    let mut scene = scene();
    scene.exposure = exposure([scene.camera; 2], 1);
    scene.lights.push(Light::directional(Vec3::X, Vec3::ONE).unwrap());
    for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
        let film = film(&MovingSpheres::new(&moving), &scene, integrator);
        let (mut left, mut right) = (0.0, 0.0);
        for (index, color) in (0..).zip(&film.color) {
            let is_right = index % SIDE >= 14;
            *(if is_right { &mut right } else { &mut left }) += color[0];
        }
        assert!(left > 0.2 && right < 1e-3 * left, "{left} {right}");
    }
}
