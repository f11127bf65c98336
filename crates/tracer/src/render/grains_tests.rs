//! Grains in images, beside spheres.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::*;
use crate::scene::{Background, Camera, CameraView, Environment, MaterialId};
use spherule_surface::Shape;
use spherule_surface::grains::{GrainShape, GrainSizes, GrainSurface, GrainTree, Grains};
use spherule_surface::spheres::SphereSurface;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};

const COLORS: [Vec3; 3] =
    [Vec3::new(0.8, 0.1, 0.05), Vec3::new(0.1, 0.2, 0.7), Vec3::new(0.2, 0.6, 0.1)];

/// Looks along +y at particles with [`COLORS`].
fn film(shapes: &[&dyn Shape], integrator: IntegratorKind) -> Film {
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 24.0,
    };
    let scene = Scene {
        background: Background::Constant(Vec3::ZERO),
        environment: Some(Arc::new(Environment::constant(Vec3::ONE))),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    let settings = RenderSettings {
        samples: 4,
        integrator,
        channels: Channels::COLOR.with(&[FilmPlane::Albedo]),
        ..RenderSettings::new(32, 32)
    };
    let source = ParticleShading {
        colors: Colors::PerParticle(&COLORS),
        ..ParticleShading::constant(Vec3::ONE)
    };
    render(shapes, &scene, &source, &settings, &AtomicBool::new(false)).unwrap().0
}

fn spheres(centers: &[Vec3], radius: f32) -> TreeBuilder {
    let mut builder = TreeBuilder::new();
    let spheres = Spheres { centers, radius: SphereRadius::Common(radius) };
    let settings = BuildSettings { keep_indices: true, ..BuildSettings::default() };
    builder.build(&spheres, &settings);
    builder
}

#[test]
fn grains_have_the_attributes_of_their_particles() {
    // A sphere on the left, then a cuboid and a capsule, each a particle of the frame
    let left = spheres(&[Vec3::new(-1.5, 0.0, 0.0)], 0.6);
    let grain = |center: Vec3, shape| {
        let centers = [center];
        let grains = Grains::new(&centers, GrainSizes::Common(Vec3::new(0.5, 0.5, 0.9)));
        GrainTree::new(&grains, shape).unwrap()
    };
    let middle = grain(Vec3::ZERO, GrainShape::Cuboid);
    let right = grain(1.5 * Vec3::X, GrainShape::Capsule);
    let shapes: [&dyn Shape; 3] = [
        &SphereSurface::new(left.tree().view()),
        &GrainSurface::new(&middle).of(MaterialId::PARTICLES, 1),
        &GrainSurface::new(&right).of(MaterialId::PARTICLES, 2),
    ];
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let film = film(&shapes, integrator);
        let albedo = film.plane::<Vec3>(FilmPlane::Albedo).unwrap();
        let found = [5, 16, 27].map(|column| albedo[16 * 32 + column]);
        assert_eq!(found, COLORS);
    }
}

/// Ellipsoids of equal semi-axes give the picture of spheres.
#[test]
fn round_grains_are_drawn_as_spheres() {
    let centers = [Vec3::new(-1.0, 0.0, 0.3), Vec3::ZERO, Vec3::new(0.9, 1.0, -0.4)];
    let builder = spheres(&centers, 0.7);
    let grains = Grains::new(&centers, GrainSizes::Common(Vec3::splat(0.7)));
    let tree = GrainTree::new(&grains, GrainShape::Ellipsoid).unwrap();
    let a = film(&[&SphereSurface::new(builder.tree().view())], IntegratorKind::Path);
    let b = film(&[&GrainSurface::new(&tree)], IntegratorKind::Path);
    let differs = |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|i| (a[i] - b[i]).abs() > 1e-2);
    let differing = a.color.iter().zip(&b.color).filter(differs).count();
    assert!(differing < 8, "{differing} pixels differ");
}
