//! Shots of particles that make one body.

use std::f32::consts::TAU;

use glam::{DVec3, Quat, Vec2, Vec3};
use spherule::scene::ground::Pattern;
use spherule::scene::{Ground, Material};
use spherule::surface::{NormalKind, SurfaceKind};

use super::{MATT, SUNSET, Shot, floor, glass};

const WIDTH: u32 = 160;

/// Overlapping balls of blue glass on a chequered floor: nothing is seen of the spheres' surfaces within the body.
pub(in super::super) fn union() -> Shot {
    let balls = [
        (Vec3::new(-1.5, 0.4, 1.0), 0.9),
        (Vec3::new(-0.3, -0.3, 1.2), 1.1),
        (Vec3::new(1.0, 0.1, 1.0), 0.9),
        (Vec3::new(1.7, 0.5, 1.7), 0.6),
    ];
    let (centers, radii): (Vec<Vec3>, Vec<f32>) = balls.into_iter().unzip();
    let mut shot = Shot::new(centers, 1.0, DVec3::new(0.0, -6.5, 2.6), DVec3::new(0.0, 0.0, 1.05))
        .sized(WIDTH);
    shot.radii = radii;
    shot.surface.kind = SurfaceKind::Union;
    *shot.scene.particle_material_mut() =
        Material { extinction: Vec3::new(0.6, 0.2, 0.06), ..glass(1.33) };
    shot.scene.background = SUNSET;
    shot.scene.ground = Some(Ground {
        pattern: Pattern::Checker { tile: 1.0 },
        shadow_catcher: None,
        ..floor(0.0)
    });
    shot.settings.max_depth = 6;
    // Paths are chosen at random where a body is entered or left.
    shot.settings.samples = 32;
    shot.painted(&[Vec3::ZERO; 4])
}

/// Distance of neighbours in a ring.
const SPACING: f32 = 0.12;

/// `count` angles all around.
fn turn(count: u16) -> impl Iterator<Item = f32> {
    (0..count).map(move |i| TAU * f32::from(i) / f32::from(count))
}

/// Particles of a tube around the z axis, layer upon layer.
fn tube() -> impl Iterator<Item = Vec3> {
    let layer = |i: u16| {
        turn((6 * i).max(1)).map(move |angle| SPACING * f32::from(i) * Vec2::from_angle(angle))
    };
    let section = move || (0..4).flat_map(layer).map(|p| Vec3::new(1.4 + p.x, 0.0, p.y));
    turn(72).flat_map(move |angle| section().map(move |p| Quat::from_rotation_z(angle) * p))
}

/// Particles of a ball, layer upon layer, in spirals of the golden angle.
fn ball(center: Vec3) -> impl Iterator<Item = Vec3> {
    let layer = move |i: u16| {
        let count = (12 * i * i).max(1);
        (0..count).map(move |k| {
            let z = 1.0 - (2.0 * f32::from(k) + 1.0) / f32::from(count);
            let around = Vec2::from_angle(2.399_963 * f32::from(k)) * (1.0 - z * z).sqrt();
            center + SPACING * f32::from(i) * around.extend(z)
        })
    };
    (0..5).flat_map(layer)
}

/// A ring, a ball that touches it, and three drops, seen from above.
fn ring() -> Shot {
    let drops = [(-0.5, 0.1, 0.3), (-0.1, -0.3, 0.5), (0.3, 0.2, 0.4)].map(Vec3::from);
    let all = tube().chain(ball(Vec3::new(0.8, -0.9, 0.6))).chain(drops);
    // Sines differ in the last bit from system to system.
    let centers = all.map(|p| (p * 1024.0).round() / 1024.0).collect();
    let mut shot =
        Shot::new(centers, 0.5 * SPACING, DVec3::new(0.0, -4.2, 4.2), DVec3::new(0.0, -0.1, 0.0))
            .sized(WIDTH);
    *shot.scene.particle_material_mut() = Material { specular: 0.5, shininess: 40.0, ..MATT };
    shot
}

/// Without the bumps of particles, but with the drops.
pub(in super::super) fn smooth() -> Shot {
    let mut shot = ring();
    shot.surface.kind = SurfaceKind::Smooth;
    shot
}

/// Overlapping spheres, shaded as if they were one smooth surface.
pub(in super::super) fn pca_normals() -> Shot {
    let mut shot = ring();
    shot.radii = vec![SPACING];
    shot.surface.normals = NormalKind::Pca;
    shot
}
