//! Rods with a colour for each half in images.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::*;
use crate::scene::{Background, Camera, CameraView, Environment, Material};
use spherule_surface::rods::{Caps, Rod, RodSurface, RodTree};

const RED: Vec3 = Vec3::new(0.8, 0.1, 0.05);
const BLUE: Vec3 = Vec3::new(0.1, 0.2, 0.7);
const GREY: Vec3 = Vec3::splat(0.4);

/// Looks along +y; `integrator` with the albedo of each pixel.
fn albedo(tree: &RodTree, integrator: IntegratorKind) -> Vec<Vec3> {
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 24.0,
    };
    let mut scene = Scene {
        background: Background::Constant(Vec3::ZERO),
        environment: Some(Arc::new(Environment::constant(Vec3::ONE))),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    let material = scene.add(Material::matte(GREY)).unwrap();
    let settings = RenderSettings {
        samples: 4,
        integrator,
        channels: Channels::COLOR.with(&[FilmPlane::Albedo]),
        ..RenderSettings::new(32, 32)
    };
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    let surface = RodSurface::new(tree, material);
    let rendered = render(&[&surface], &scene, &source, &settings, &never);
    rendered.unwrap().0.plane(FilmPlane::Albedo).unwrap().to_vec()
}

/// A thick rod across the view.
fn rod(particles: [u32; 2]) -> Rod {
    Rod { particles, ..Rod::line([Vec3::new(-2.5, 0.0, 0.0), Vec3::new(2.5, 0.0, 0.0)], 1.0) }
}

#[test]
fn halves_of_rods_have_colors() {
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        // The middle row of the picture; a column on each side of its centre
        let found = |tree: &RodTree| {
            let all = albedo(tree, integrator);
            [16 * 32 + 8, 16 * 32 + 15, 16 * 32 + 16, 16 * 32 + 24].map(|pixel| all[pixel])
        };
        let tree = |colors| RodTree::new(vec![rod([1, 0])], Caps::Flat).with_colors(colors);
        assert_eq!(found(&tree(vec![RED, BLUE])), [BLUE, BLUE, RED, RED]);
        // Without a colour, that of the material
        assert_eq!(found(&tree(vec![RED])), [GREY, GREY, RED, RED]);
        assert_eq!(found(&tree(Vec::new())), [GREY; 4]);
    }
}
