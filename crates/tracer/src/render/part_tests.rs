//! Materials of parts against images in which all particles have the material of one part.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{
    brute::{Ball, Balls},
    *,
};
use crate::scene::environment::studio;
use crate::scene::{
    Background, Camera, CameraView, EnvironmentAxes, Finish, Fresnel, Ground, Light, LightKind,
    Material,
};

/// The colours of the two particles.
const COLORS: [Vec3; 2] = [Vec3::new(0.2, 0.7, 0.3), Vec3::new(0.8, 0.4, 0.1)];

/// Two balls beside each other, of the parts 5 and -1.
fn pair() -> Balls {
    let ball = |x: f32| Ball { center: Vec3::new(x, 0.0, 0.0), radius: 0.9 };
    Balls(vec![ball(-1.0), ball(1.0)])
}

/// Looks along +y from a distance of 10.
fn scene(material: Material, parts: Vec<Part>) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 24.0,
    };
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let mut scene = Scene {
        background: Background::Constant(Vec3::ZERO),
        environment: Some(Arc::new(studio(axes, Vec3::ONE))),
        materials: Scene::basic_materials(material),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    for (parts, material) in parts {
        scene.add_part(&parts, material).unwrap();
    }
    scene
}

fn opaque(finish: Finish) -> Material {
    Material { finish, ..Material::DEFAULT }
}

fn glass() -> Material {
    Material { transmission: 1.0, fresnel: Fresnel::Exact, ior: 1.5, ..Material::DEFAULT }
}

/// Parts, and their material.
type Part = (Vec<i32>, Material);

fn part(parts: &[i32], finish: Finish, color: Option<Vec3>) -> Part {
    (parts.to_vec(), Material { finish, color, ..Material::DEFAULT })
}

fn image(scene: &Scene, bounces: u32, colors: &[Vec3]) -> Film {
    let settings = RenderSettings {
        samples: 16,
        bounces,
        integrator: IntegratorKind::Path,
        ..RenderSettings::new(32, 32)
    };
    let source = ParticleShading {
        colors: Colors::PerParticle(colors),
        parts: Some(("part", &[5, -1])),
        ..ParticleShading::constant(Vec3::ZERO)
    };
    let never = AtomicBool::new(false);
    let rendered = render(&[&pair()], scene, &source, &settings, &never);
    rendered.unwrap().0
}

/// The left or the right half of an image.
fn half(film: &Film, right: bool) -> Vec<[f32; 4]> {
    let pixels = film.color.iter().enumerate();
    pixels.filter(|(i, _)| (i % 32 >= 16) == right).map(|(_, color)| *color).collect()
}

const METAL: Finish = Finish::Metal { roughness: 0.3 };
const PLASTIC: Finish = Finish::Plastic { roughness: 0.4 };

#[test]
fn each_part_looks_as_if_all_particles_had_its_material() {
    // Without bounces, the material of one particle does not change the light on the other
    let all = |finish| image(&scene(opaque(finish), Vec::new()), 0, &COLORS);
    let (matte, metal, plastic) = (all(Finish::Matte), all(METAL), all(PLASTIC));
    assert_ne!(half(&matte, true), half(&metal, true));
    let parts = |parts| image(&scene(opaque(Finish::Matte), parts), 0, &COLORS);
    let mixed = parts(vec![part(&[3, -1], METAL, None)]);
    assert_eq!(half(&mixed, false), half(&matte, false));
    assert_eq!(half(&mixed, true), half(&metal, true));
    let both = parts(vec![part(&[-1], METAL, None), part(&[5], PLASTIC, None)]);
    assert_eq!(half(&both, false), half(&plastic, false));
    assert_eq!(half(&both, true), half(&metal, true));
}

#[test]
fn a_part_may_have_its_own_colour() {
    let blue = Vec3::new(0.1, 0.2, 0.9);
    let plain = scene(opaque(Finish::Matte), Vec::new());
    let expected = image(&plain, 0, &[COLORS[0], blue]);
    let parts = vec![part(&[-1], Finish::Matte, Some(blue))];
    let found = image(&scene(opaque(Finish::Matte), parts), 0, &COLORS);
    assert_eq!(found.color, expected.color);
}

#[test]
fn light_bounces_between_parts() {
    let white = |parts| scene(opaque(Finish::Matte), parts);
    let direct = image(&white(vec![part(&[-1], METAL, None)]), 0, &COLORS);
    let more = image(&white(vec![part(&[-1], METAL, None)]), 4, &COLORS);
    let sum = |film: &Film| film.color.iter().map(|c| c[0]).sum::<f32>();
    assert!(sum(&more) > 1.01 * sum(&direct));
}

#[test]
fn opaque_parts_are_among_transmissive_spheres() {
    // The opaque ball is that of an opaque scene, but for the light that passes the other ball
    let matte = part(&[-1], Finish::Matte, None);
    let mixed = image(&scene(glass(), vec![matte]), 0, &COLORS);
    let clear = image(&scene(glass(), Vec::new()), 0, &COLORS);
    let solid = image(&scene(opaque(Finish::Matte), Vec::new()), 0, &COLORS);
    let mean = |pixels: &[[f32; 4]]| pixels.iter().map(|c| c[1]).sum::<f32>() / pixels.len() as f32;
    let [mixed_right, solid_right] = [&mixed, &solid].map(|film| mean(&half(film, true)));
    assert!((mixed_right / solid_right - 1.0).abs() < 0.15, "{mixed_right} {solid_right}");
    assert_ne!(half(&clear, true), half(&mixed, true));
    assert_ne!(half(&mixed, false), half(&solid, false));
}

#[test]
fn opaque_parts_throw_full_shadows() {
    // A light above, a ground below: only the shadow of the opaque ball is black
    let light = Light {
        kind: LightKind::Directional { to_light: Vec3::Z },
        radiance: Vec3::ONE,
        casts_shadow: true,
        is_visible: false,
        group: 0,
    };
    let view = CameraView {
        eye: DVec3::new(0.0, -3.0, 6.0),
        look_at: DVec3::new(0.0, 0.0, -1.9),
        up: DVec3::Z,
        fov: 40.0,
    };
    let bounds = crate::scene::Bounds { min: DVec3::splat(-1.9), max: DVec3::splat(1.9) };
    // The pixels of points in both shadows
    let shadows = |parts: Vec<Part>| {
        let mut scene = scene(glass(), parts);
        scene.ground = Some(Ground::under(&bounds, Vec3::Z, DVec3::ZERO));
        scene.environment = None;
        scene.lights = vec![light];
        scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
        let film = image(&scene, 0, &COLORS);
        let camera = shading::CameraLanes::new(&scene.camera, 32, 32);
        [-1.0, 1.0].map(|x| {
            let [column, row] = camera.pixel_of(Vec3::new(x, -0.6, -1.9)).unwrap();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "inside the image"
            )]
            let pixel = row as usize * 32 + column as usize;
            film.color[pixel][1]
        })
    };
    let [left, right] = shadows(Vec::new());
    assert!(left > 0.01 && right > 0.01, "{left} {right}");
    let [left, right] = shadows(vec![part(&[-1], Finish::Matte, None)]);
    assert!(left > 0.01 && right == 0.0, "{left} {right}");
}
