//! Materials of styles against images in which all particles have the material of one style.

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
use spherule_surface::{MaterialId, OwnedBody, Shape};

/// The colours of the two particles.
const COLORS: [Vec3; 2] = [Vec3::new(0.2, 0.7, 0.3), Vec3::new(0.8, 0.4, 0.1)];

/// Two balls beside each other.
const PAIR: [Ball; 2] = [ball(-1.0), ball(1.0)];

const fn ball(x: f32) -> Ball {
    Ball { center: Vec3::new(x, 0.0, 0.0), radius: 0.9 }
}

/// The colours of a style.
type Own = Colors<'static>;

/// A scene of the balls. If there are fewer colours than balls, the last balls have the styles.
struct Styled {
    scene: Scene,
    colors: Vec<Own>,
}

/// Looks along +y from a distance of 10.
fn styled(material: Material, styles: &[(Finish, Own)]) -> Styled {
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
    for (finish, _) in styles {
        scene.add_style(opaque(*finish)).unwrap();
    }
    Styled { scene, colors: styles.iter().map(|(_, colors)| *colors).collect() }
}

fn opaque(finish: Finish) -> Material {
    Material { finish, ..Material::DEFAULT }
}

fn glass() -> Material {
    Material { transmission: 1.0, fresnel: Fresnel::Exact, ior: 1.5, ..Material::DEFAULT }
}

fn style_id(style: usize) -> MaterialId {
    MaterialId::at(MaterialId::BASIC + style).unwrap()
}

/// An image of both balls as one shape, or as two beside a clear one.
fn image(Styled { scene, colors }: &Styled, bounces: u32) -> Film {
    let settings = RenderSettings {
        samples: 16,
        bounces,
        integrator: IntegratorKind::Path,
        ..RenderSettings::new(32, 32)
    };
    let first = PAIR.len() - colors.len();
    let styles = colors.iter().enumerate().map(|(style, colors)| StyleShading {
        first: u32::try_from(first + style).unwrap(),
        material: style_id(style),
        colors: *colors,
        opacities: Opacities::Constant(1.0),
    });
    let source = ParticleShading {
        colors: Colors::PerParticle(&COLORS),
        styles: styles.collect(),
        ..ParticleShading::constant(Vec3::ZERO)
    };
    let never = AtomicBool::new(false);
    let is_clear = scene.particle_material().transmission > 0.0;
    let together = if is_clear { first } else { PAIR.len() };
    let particles = Balls(PAIR[..together].to_vec());
    let alone = (together..PAIR.len()).map(|i| {
        let body = Box::new(Balls(vec![PAIR[i]]));
        OwnedBody::new(body, style_id(i - first), u32::try_from(i).unwrap())
    });
    let alone: Vec<OwnedBody<'_>> = alone.collect();
    let shapes: Vec<&dyn Shape> =
        std::iter::once(&particles as &dyn Shape).chain(alone.iter().map(|b| b as _)).collect();
    render(&shapes, scene, &source, &settings, &never).unwrap().0
}

/// The left or the right half of an image.
fn half(film: &Film, right: bool) -> Vec<[f32; 4]> {
    let pixels = film.color.iter().enumerate();
    pixels.filter(|(i, _)| (i % 32 >= 16) == right).map(|(_, color)| *color).collect()
}

const METAL: Finish = Finish::Metal { roughness: 0.3 };
const PLASTIC: Finish = Finish::Plastic { roughness: 0.4 };
const USUAL: Own = Colors::PerParticle(&COLORS);

#[test]
fn each_style_looks_as_if_all_particles_had_its_material() {
    // Without bounces, the material of one particle does not change the light on the other
    let all = |finish| image(&styled(opaque(finish), &[]), 0);
    let (matte, metal, plastic) = (all(Finish::Matte), all(METAL), all(PLASTIC));
    assert_ne!(half(&matte, true), half(&metal, true));
    let with = |styles: &[(Finish, Own)]| image(&styled(opaque(Finish::Matte), styles), 0);
    let mixed = with(&[(METAL, USUAL)]);
    assert_eq!(half(&mixed, false), half(&matte, false));
    assert_eq!(half(&mixed, true), half(&metal, true));
    let both = with(&[(PLASTIC, USUAL), (METAL, USUAL)]);
    assert_eq!(half(&both, false), half(&plastic, false));
    assert_eq!(half(&both, true), half(&metal, true));
}

#[test]
fn a_style_may_have_its_own_colour() {
    let plain = image(&styled(opaque(Finish::Matte), &[]), 0);
    let own = [(Finish::Matte, Colors::Constant(COLORS[0]))];
    let found = image(&styled(opaque(Finish::Matte), &own), 0);
    assert_eq!(half(&found, false), half(&plain, false));
    assert_ne!(half(&found, true), half(&plain, true));
    let usual = [(Finish::Matte, Colors::Constant(COLORS[1]))];
    assert_eq!(image(&styled(opaque(Finish::Matte), &usual), 0).color, plain.color);
}

#[test]
fn light_bounces_between_styles() {
    let metal = styled(opaque(Finish::Matte), &[(METAL, USUAL)]);
    let (direct, more) = (image(&metal, 0), image(&metal, 4));
    let sum = |film: &Film| film.color.iter().map(|c| c[0]).sum::<f32>();
    assert!(sum(&more) > 1.01 * sum(&direct));
}

#[test]
fn opaque_styles_are_among_transmissive_spheres() {
    // The opaque ball is that of an opaque scene, but for the light that passes the other ball
    let mixed = image(&styled(glass(), &[(Finish::Matte, USUAL)]), 0);
    let clear = image(&styled(glass(), &[]), 0);
    let solid = image(&styled(opaque(Finish::Matte), &[]), 0);
    let mean = |pixels: &[[f32; 4]]| pixels.iter().map(|c| c[1]).sum::<f32>() / pixels.len() as f32;
    let [mixed_right, solid_right] = [&mixed, &solid].map(|film| mean(&half(film, true)));
    assert!((mixed_right / solid_right - 1.0).abs() < 0.15, "{mixed_right} {solid_right}");
    assert_ne!(half(&clear, true), half(&mixed, true));
    assert_ne!(half(&mixed, false), half(&solid, false));
}

#[test]
fn opaque_styles_throw_full_shadows() {
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
    let shadows = |styles: &[(Finish, Own)]| {
        let mut balls = styled(glass(), styles);
        let scene = &mut balls.scene;
        scene.ground = Some(Ground::under(&bounds, Vec3::Z, DVec3::ZERO));
        scene.environment = None;
        scene.lights = vec![light];
        scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
        let camera = shading::CameraLanes::new(&scene.camera, 32, 32);
        let film = image(&balls, 0);
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
    let [left, right] = shadows(&[]);
    assert!(left > 0.01 && right > 0.01, "{left} {right}");
    let [left, right] = shadows(&[(Finish::Matte, USUAL)]);
    assert!(left > 0.01 && right == 0.0, "{left} {right}");
}
