//! Colours of particles as absorption, against integrals by hand and against one coefficient.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use crate::render::body_tests::floor;
use crate::render::path_tests::white;
use crate::render::solid::Solid;
use crate::render::*;
use crate::scene::{
    Background, Camera, CameraView, Fresnel, Light, Material, Scene, material::extinction,
};
use spherule_surface::{Intersection, MaterialId, OwnedBody, Shape, Side};
use spherule_tree::ray::Ray;

/// The length over which light takes the colours.
const LENGTH: f32 = 1.5;

/// A body with two particles whose weights vary linearly with the height, from `low` to `high`.
struct Graded {
    solid: Solid,
    low: f32,
    high: f32,
}

impl Graded {
    fn slab(low: f32, high: f32) -> Self {
        Self { solid: Solid::slab(low, high), low, high }
    }
}

impl Shape for Graded {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        self.solid.crossing(ray, side)
    }

    fn is_connected(&self) -> bool {
        true
    }

    fn side_of(&self, point: Vec3) -> Side {
        self.solid.side_of(point)
    }

    fn blend_at(&self, point: Vec3, _time: f32, each: &mut dyn FnMut(u32, f32)) {
        let part = ((point.z - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        each(0, 1.0 - part);
        each(1, part);
    }
}

/// Particles whose extinction coefficients over [`LENGTH`] are blended, so that they vary linearly in space.
struct Coefficients([Vec3; 2]);

impl ShadeSource for Coefficients {
    fn color(&self, index: u32) -> Vec3 {
        (-LENGTH * self.0[(index % 10) as usize]).exp()
    }

    fn blended_color(&self, parts: &[(u32, f32)]) -> Vec3 {
        (-LENGTH * mean(parts, |index| self.0[(index % 10) as usize])).exp()
    }

    fn id(&self, index: u32) -> u32 {
        index
    }

    fn velocity(&self, _index: u32) -> Vec3 {
        Vec3::ZERO
    }
}

/// Light passes it straight and unattenuated, apart from absorption.
const AIR: Material = Material {
    ambient: 0.0,
    diffuse: 0.0,
    specular: 0.0,
    ior: 1.0,
    transmission: 1.0,
    fresnel: Fresnel::Exact,
    ..Material::DEFAULT
};

/// Whether the body is that of the particles, or that of a style.
const PLACES: [bool; 2] = [false, true];

fn scene(eye: DVec3, look_at: DVec3, material: Material, is_style: bool) -> Scene {
    let view = CameraView { eye, look_at, up: DVec3::X, fov: 30.0 };
    let first = if is_style { Material::DEFAULT } else { material };
    let mut scene = Scene {
        materials: Scene::basic_materials(first),
        background: Background::Constant(Vec3::ONE),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    if is_style {
        scene.add_style(material).unwrap();
    }
    scene
}

/// The film of a body; that of a style has its particles from index 10 on.
fn film(
    body: Graded,
    is_style: bool,
    scene: &Scene,
    source: &dyn ShadeSource,
    settings: &RenderSettings,
) -> Vec<Vec3> {
    let body: Box<dyn Shape> = if is_style {
        Box::new(OwnedBody::new(Box::new(body), MaterialId::at(MaterialId::BASIC).unwrap(), 10))
    } else {
        Box::new(body)
    };
    let plane = scene.ground.as_ref().map(crate::scene::Ground::shape);
    let mut shapes: Vec<&dyn Shape> = vec![&*body];
    shapes.extend(plane.iter().map(|plane| plane as &dyn Shape));
    let never = AtomicBool::new(false);
    let film = render(&shapes, scene, source, settings, &never).unwrap().0;
    film.color.iter().map(|[r, g, b, _]| Vec3::new(*r, *g, *b)).collect()
}

#[test]
fn a_linear_coefficient_is_integrated_exactly() {
    // From 0.1 to 0.9 per length in red, over the height of the slab
    let source = Coefficients([Vec3::new(0.1, 0.6, 0.0), Vec3::new(0.9, 0.2, 0.0)]);
    let material = Material { color_length: Some(LENGTH), ..AIR };
    // Straight down, and at 45 degrees, where the path is longer by the root of 2; and from inside, at a quarter of the
    // height, upwards: the mean of 0.3 and 0.9 over a length of 1.5
    let looks = [
        (DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO, 2.0, [0.5, 0.4]),
        (DVec3::new(0.0, -9.0, 9.0), DVec3::ZERO, 2.0 * 2.0_f32.sqrt(), [0.5, 0.4]),
        (DVec3::new(0.0, 0.0, -0.5), DVec3::Z, 1.5, [0.6, 0.35]),
    ];
    for (eye, look_at, length, [red, green]) in looks {
        for is_style in PLACES {
            for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
                let mut scene = scene(eye, look_at, material, is_style);
                scene.environment = Some(Arc::new(white()));
                let settings = RenderSettings { integrator, ..RenderSettings::new(1, 1) };
                let body = Graded::slab(-1.0, 1.0);
                let found = film(body, is_style, &scene, &source, &settings)[0];
                let expected = (-length * Vec3::new(red, green, 0.0)).exp();
                let error = (found - expected).abs().max_element();
                assert!(error < 1e-4, "{eye} {is_style} {integrator:?}: {found} {expected}");
            }
        }
    }
}

#[test]
fn shadow_rays_lose_the_same_light() {
    // The ground below a slab, seen from between them, with a light straight above
    let source = Coefficients([Vec3::splat(0.1), Vec3::splat(0.9)]);
    let light = |material: Material, is_style: bool| {
        let eye = DVec3::new(0.0, 0.0, 1.0);
        let mut scene = scene(eye, DVec3::ZERO, material, is_style);
        scene.ground = Some(floor(0.0));
        scene.ambient_light = Vec3::ZERO;
        scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
        film(Graded::slab(2.0, 4.0), is_style, &scene, &source, &RenderSettings::new(1, 1))[0].x
    };
    for is_style in PLACES {
        let bare = light(AIR, is_style);
        let found = light(Material { color_length: Some(LENGTH), ..AIR }, is_style);
        assert!(bare > 0.1 && (found / bare - (-1.0_f32).exp()).abs() < 1e-4, "{found} {bare}");
    }
}

#[test]
fn one_colour_is_one_coefficient() {
    let color = Vec3::new(0.3, 0.6, 0.9);
    let glass = Material { ior: 1.5, ..AIR };
    let source = ParticleShading::constant(color);
    for is_style in PLACES {
        for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
            let rendered = |material: Material| {
                let eye = DVec3::new(0.4, -6.0, 3.0);
                let mut scene = scene(eye, DVec3::ZERO, material, is_style);
                scene.background = Background::default_for(Vec3::Z);
                scene.ground = Some(floor(-1.2));
                let sun = Light::directional(Vec3::new(1.0, 0.5, -1.0), Vec3::ONE).unwrap();
                scene.lights = vec![sun];
                let base = RenderSettings::new(24, 24);
                let settings = RenderSettings { samples: 4, integrator, bounces: 1, ..base };
                let body = Graded { solid: Solid::ball(1.0), low: -1.0, high: 1.0 };
                film(body, is_style, &scene, &source, &settings)
            };
            let by_color = rendered(Material { color_length: Some(LENGTH), ..glass });
            let constant = rendered(Material { extinction: extinction(color, LENGTH), ..glass });
            for (a, b) in by_color.iter().zip(&constant) {
                assert!((*a - *b).abs().max_element() < 1e-5, "{is_style} {integrator:?}: {a} {b}");
            }
            let clear = rendered(glass);
            let differing = clear.iter().zip(&by_color).filter(|(a, b)| a.x > b.x + 0.05);
            assert!(differing.count() > 30, "{is_style} {integrator:?}");
        }
    }
}
