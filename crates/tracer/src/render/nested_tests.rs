//! Several transmissive bodies against optics computed by hand, and against one body.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{
    body_tests::{floor, middle_of},
    path_tests::{settings as path_settings, statistics, white},
    solid::Solid,
    *,
};
use crate::scene::{
    Background, Camera, CameraView, Environment, Fresnel, Ground, Light, LightKind, Material,
    ground,
    material::{dielectric, extinction},
};
use spherule_surface::{MaterialId, OwnedBody, union::UnionSurface};
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};

const WATER: Material = Material {
    ambient: 0.0,
    diffuse: 0.0,
    specular: 0.0,
    ior: 1.33,
    transmission: 1.0,
    fresnel: Fresnel::Exact,
    ..Material::DEFAULT
};
const OIL: Material = Material { ior: 1.47, ..WATER };

/// A scene with bodies of these materials: the first is that of the particles, the others are of styles.
fn scene(eye: DVec3, look_at: DVec3, materials: &[Material]) -> Scene {
    let view = CameraView { eye, look_at, up: DVec3::X, fov: 20.0 };
    let mut scene = Scene {
        materials: Scene::basic_materials(materials[0]),
        background: Background::Constant(Vec3::ONE),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    for material in &materials[1..] {
        scene.add_style(*material).unwrap();
    }
    scene
}

/// The bodies of the materials of a [`scene`]. Each style has 10 particles.
fn bodies<'a>(shapes: impl IntoIterator<Item = Box<dyn Shape + 'a>>) -> Vec<Box<dyn Shape + 'a>> {
    let own = |(index, body)| match index {
        0 => body,
        _ => {
            let id = MaterialId::at(MaterialId::BASIC + index - 1).unwrap();
            let first = 10 * u32::try_from(index).unwrap();
            Box::new(OwnedBody::new(body, id, first)) as Box<dyn Shape + 'a>
        }
    };
    shapes.into_iter().enumerate().map(own).collect()
}

fn solids(shapes: impl IntoIterator<Item = Solid>) -> Vec<Box<dyn Shape>> {
    bodies(shapes.into_iter().map(|solid| Box::new(solid) as Box<dyn Shape>))
}

fn slabs(heights: &[[f32; 2]]) -> Vec<Box<dyn Shape>> {
    solids(heights.iter().map(|[low, high]| Solid::slab(*low, *high)))
}

/// What Whitted's model sees in the middle of the film, with every ray traced.
fn middle(shapes: &[Box<dyn Shape + '_>], scene: &Scene, max_depth: u32) -> (Vec3, RayCounts) {
    let shapes: Vec<&dyn Shape> = shapes.iter().map(|shape| &**shape).collect();
    middle_of(&shapes, scene, max_depth)
}

fn film(shapes: &[Box<dyn Shape + '_>], scene: &Scene, settings: &RenderSettings) -> Film {
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    let shapes: Vec<&dyn Shape> = shapes.iter().map(|shape| &**shape).collect();
    render(&shapes, scene, &source, settings, &never).unwrap().0
}

#[track_caller]
fn assert_within(limit: f32, value: Vec3, expected: Vec3) {
    let error = (value - expected).abs().max_element();
    assert!(error < limit, "{value} is not {expected}");
}

#[test]
fn oil_on_water_refracts_twice_however_they_overlap() {
    // A ray enters oil of height 1 at 45 degrees, and water of height 1 below it: by Snell's law it hits the ground
    // tan(asin(sin 45 / 1.47)) + tan(asin(sin 45 / 1.33)) = 0.54867 + 0.62774 beyond the entry
    let eye = DVec3::new(0.0, -2.0, 4.0);
    let materials = [WATER, OIL].map(|material| Material { reflection: 0.0, ..material });
    let mut scene = scene(eye, DVec3::new(0.0, 0.0, 2.0), &materials);
    let into_oil = dielectric(0.5_f32.sqrt(), 1.0 / 1.47);
    let in_oil = (1.0_f32 - 0.5 / (1.47 * 1.47)).sqrt();
    let into_water = dielectric(in_oil, 1.47 / 1.33);
    let light = (1.0 - into_oil) * (1.0 - into_water) * 0.5 * ground::AMBIENT;
    for overlap in [0.0, 1e-4, 0.1, 0.9, 3.0] {
        // Water has priority
        let shapes = slabs(&[[-5.0, 1.0], [1.0 - overlap, 2.0]]);
        for (tile, is_light) in [(1.18, true), (1.17, false)] {
            scene.ground = Some(Ground {
                pattern: ground::Pattern::Checker { tile },
                // The corner of four squares; the camera looks along y
                center: Vec3::new(-0.1, 0.0, 0.0),
                ..floor(0.0)
            });
            let (value, counts) = middle(&shapes, &scene, 8);
            let is_expected = (value.x - light).abs() < 1e-5;
            if overlap > 0.0 {
                assert_eq!(is_expected, is_light, "{overlap} {tile}: {value} {light}");
                assert_eq!(counts.refraction, 2, "{overlap}");
            }
            assert!(value.x > 0.0);
        }
    }
}

#[test]
fn each_medium_absorbs_on_its_own_part_of_the_way() {
    let tinted = |color: Vec3| Material { ior: 1.0, extinction: extinction(color, 1.0), ..WATER };
    let (red, blue) = (Vec3::new(1.0, 0.5, 0.25), Vec3::new(0.4, 0.8, 1.0));
    let materials = [tinted(red), tinted(blue)];
    // 2 of the first, 1 of the second; the first has priority
    let shapes = slabs(&[[-2.0, 0.0], [-0.5, 1.0]]);
    let down = scene(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, &materials);
    let (value, _) = middle(&shapes, &down, 8);
    // Steps off the surfaces shift the ways a little
    assert_within(3e-5, value, red * red * blue);
    // At 60 degrees from the normal, ways are twice as long
    let eye = DVec3::new(0.0, -2.0 * 3.0_f64.sqrt(), 3.0);
    let aslant = scene(eye, DVec3::new(0.0, 0.0, 1.0), &materials);
    let (value, _) = middle(&shapes, &aslant, 8);
    assert_within(3e-5, value, red.powf(4.0) * blue * blue);
    // A priority may put the second first
    let mut swapped = down.clone();
    swapped.materials[MaterialId::BASIC].priority = 1;
    let (value, _) = middle(&shapes, &swapped, 8);
    assert_within(3e-5, value, red.powf(1.5) * blue.powf(1.5));
    // Shadow rays are attenuated in the same way
    let mut lit = scene(DVec3::new(0.0, 0.0, -2.5), DVec3::new(0.0, 0.0, -4.0), &materials);
    lit.ground = Some(floor(-3.0));
    lit.ambient_light = Vec3::ZERO;
    lit.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
    let (value, _) = middle(&shapes, &lit, 8);
    assert_within(3e-5, value, 0.5 * ground::DIFFUSE * red * red * blue);
}

#[test]
fn three_bodies_in_each_other_have_six_interfaces() {
    // Balls whose radii and indices fall with their priority, seen along the axis
    let indices = [1.8_f32, 1.5, 1.2];
    let materials = indices.map(|ior| Material { ior, reflection: 0.0, ..WATER });
    let scene = scene(DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO, &materials);
    let shapes = solids([1.0, 2.0, 3.0].map(Solid::ball));
    let (value, counts) = middle(&shapes, &scene, 8);
    let passing = |[a, b]: [f32; 2]| 1.0 - ((a - b) / (a + b)).powi(2);
    let once: f32 = [[1.0, 1.2], [1.2, 1.5], [1.5, 1.8]].map(passing).iter().product();
    assert_within(1e-5, value, Vec3::splat(once * once));
    assert_eq!(counts.refraction, 6);
    // Those inside do not exist if the outer one has the highest priority
    let mut one = scene.clone();
    one.materials[MaterialId::BASIC + 1].priority = 1;
    let (value, counts) = middle(&shapes, &one, 8);
    assert_within(1e-5, value, Vec3::splat(passing([1.0, 1.2]).powi(2)));
    assert_eq!(counts.refraction, 2);
}

#[test]
fn a_camera_in_oil_sees_water_and_air() {
    let tinted = |material| Material { extinction: extinction(Vec3::splat(0.5), 1.0), ..material };
    let materials = [WATER, tinted(OIL)].map(|material| Material { reflection: 0.0, ..material });
    let shapes = slabs(&[[-1.0, 0.0], [-0.5, 2.0]]);
    let passing = |a: f32, b: f32| 1.0 - ((a - b) / (a + b)).powi(2);
    let eye = DVec3::new(0.0, 0.0, 1.0);
    let (down, _) = middle(&shapes, &scene(eye, DVec3::ZERO, &materials), 8);
    assert_within(1e-5, down, Vec3::splat(0.5 * passing(1.47, 1.33) * passing(1.33, 1.0)));
    let (up, _) = middle(&shapes, &scene(eye, 2.0 * eye, &materials), 8);
    assert_within(1e-5, up, Vec3::splat(0.5 * passing(1.47, 1.0)));
    // Where both overlap, the camera is in water
    let eye = DVec3::new(0.0, 0.0, -0.25);
    let (up, _) = middle(&shapes, &scene(eye, DVec3::ZERO, &materials), 8);
    let expected = 0.25 * passing(1.47, 1.33) * passing(1.47, 1.0);
    assert_within(1e-5, up, Vec3::splat(expected));
}

/// Trees of two clusters of spheres that overlap, and of both.
fn clusters() -> [TreeBuilder; 3] {
    let tree = |centers: &[Vec3]| {
        let mut tree = TreeBuilder::new();
        let spheres = Spheres { centers, radius: SphereRadius::Common(0.5) };
        tree.build(&spheres, &BuildSettings::default());
        tree
    };
    let place = |i: u16| {
        let [x, y, z] = [i % 4, i / 4 % 3, i / 12].map(f32::from);
        Vec3::new(x - 1.5, y - 1.0, z - 0.5) * 0.6 + 0.05 * Vec3::new(z, x, y)
    };
    let all: Vec<Vec3> = (0..24).map(place).collect();
    let (low, high): (Vec<Vec3>, Vec<Vec3>) = all.iter().partition(|center| center.x < 0.0);
    [tree(&low), tree(&high), tree(&all)]
}

fn lit_scene(materials: &[Material]) -> Scene {
    let mut scene = scene(DVec3::new(1.0, -6.0, 3.0), DVec3::ZERO, materials);
    scene.ground = Some(Ground { color: Vec3::new(0.7, 0.5, 0.3), ..floor(-1.2) });
    scene.background = Background::default_for(Vec3::Z);
    let to_light = Vec3::new(0.3, -0.5, 1.0).normalize();
    scene.lights = vec![Light {
        kind: LightKind::Sun { to_light, half_angle: 0.05 },
        radiance: Vec3::splat(2.0),
        casts_shadow: true,
        is_visible: false,
        group: 0,
    }];
    scene.particles = [Vec3::splat(-1.5), Vec3::splat(1.5)];
    scene
}

/// The union of two clusters as two bodies, and as one.
fn as_two_and_one(settings: &RenderSettings, glass: Material) -> [Film; 2] {
    let [low, high, all] = clusters();
    let of = |trees: &[&TreeBuilder], materials: &[Material]| {
        let unions = trees
            .iter()
            .map(|tree| Box::new(UnionSurface::new(tree.tree().view())) as Box<dyn Shape + '_>);
        film(&bodies(unions), &lit_scene(materials), settings)
    };
    [of(&[&low, &high], &[glass, glass]), of(&[&all], &[glass])]
}

#[test]
fn two_bodies_of_a_kind_look_like_one() {
    let tint = extinction(Vec3::new(0.4, 0.8, 0.9), 1.0);
    let glass = Material { specular: 0.3, extinction: tint, ..OIL };
    let settings = RenderSettings { samples: 4, max_depth: 8, ..RenderSettings::new(48, 48) };
    let [two, one] = as_two_and_one(&settings, glass);
    let differ = |a: &[f32; 4], b: &[f32; 4]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 2e-3);
    let count = two.color.iter().zip(&one.color).filter(|(a, b)| differ(a, b)).count();
    // Rounding decides some of the random choices
    assert!(count < 20, "{count} pixels differ");
    assert!(one.color.iter().filter(|pixel| pixel[0] < 0.5).count() > 100);
}

#[test]
fn paths_and_photons_pass_two_bodies_like_one() {
    for roughness in [0.0, 0.3] {
        let tint = extinction(Vec3::new(0.4, 0.8, 0.9), 1.0);
        let glass = Material { interface_roughness: roughness, extinction: tint, ..OIL };
        let settings = RenderSettings {
            max_depth: 8,
            photons: 100_000,
            channels: Channels::ALL,
            ..path_settings(24, 32, 2)
        };
        let [two, one] = as_two_and_one(&settings, glass);
        let colors = |film: &Film| -> Vec<Vec3> {
            film.color.iter().map(|pixel| Vec3::from_slice(&pixel[..3])).collect()
        };
        let (two, one) = (colors(&two), colors(&one));
        let (mean, _) = statistics(&one);
        let (error, deviation) =
            statistics(&one.iter().zip(&two).map(|(a, b)| *a - *b).collect::<Vec<_>>());
        assert!(error.abs() < 0.01 * mean, "{roughness}: {error} of {mean}");
        assert!(deviation < 0.15 * mean, "{roughness}: {deviation} of {mean}");
    }
}

#[test]
fn oil_and_water_in_white_surroundings_are_invisible() {
    let shapes = solids([
        Solid::ball_at(Vec3::new(-0.5, 0.0, 0.0), 1.0),
        Solid::ball_at(Vec3::new(0.5, 0.0, 0.2), 1.0),
        Solid::ball_at(Vec3::new(0.0, 0.0, -0.8), 0.8),
    ]);
    for roughness in [0.0, 0.4] {
        let rough = |ior: f32| Material { ior, interface_roughness: roughness, ..WATER };
        let materials = [1.33, 1.47, 1.6].map(rough);
        let mut scene = scene(DVec3::new(0.3, -8.0, 1.0), DVec3::ZERO, &materials);
        scene.environment = Some(std::sync::Arc::new(white()));
        scene.is_environment_visible = true;
        for max_depth in [2, 12] {
            let settings = RenderSettings { max_depth, ..path_settings(16, 16, 2) };
            let film = film(&shapes, &scene, &settings);
            let colors = film.color.iter().map(|pixel| Vec3::from_slice(&pixel[..3]));
            let (mean, deviation) = statistics(&colors.collect::<Vec<_>>());
            // Rough interfaces lose no light on average
            let limit = if roughness > 0.0 { 0.02 } else { 1e-4 };
            assert!((mean - 1.0).abs() < limit, "{roughness} {max_depth}: {mean} {deviation}");
        }
    }
}

#[test]
fn bodies_that_scatter_all_light_are_invisible_in_white_surroundings() {
    let shapes = solids([
        Solid::ball_at(Vec3::new(-0.5, 0.0, 0.0), 1.0),
        Solid::ball_at(Vec3::new(0.5, 0.0, 0.2), 1.0),
        Solid::ball_at(Vec3::new(0.0, 0.0, -0.8), 0.8),
    ]);
    let murky = |ior: f32, color: Vec3, anisotropy: f32| {
        Material { ior, ..WATER }.with_scattering(color, 0.5, anisotropy)
    };
    // The first two refract alike, so that rays pass from one medium to the other
    let materials = [
        murky(1.33, Vec3::new(0.2, 0.5, 1.0), 0.0),
        murky(1.33, Vec3::new(1.0, 0.1, 0.3), 0.6),
        Material { ior: 1.47, ..WATER },
    ];
    for eye in [DVec3::new(0.3, -8.0, 1.0), DVec3::new(0.3, -0.1, 0.1)] {
        let mut scene = scene(eye, DVec3::ZERO, &materials);
        scene.environment = Some(std::sync::Arc::new(white()));
        scene.is_environment_visible = true;
        let settings = RenderSettings { max_depth: 24, ..path_settings(16, 64, 1000) };
        let film = film(&shapes, &scene, &settings);
        let colors: Vec<Vec3> =
            film.color.iter().map(|pixel| Vec3::from_slice(&pixel[..3])).collect();
        let mean = colors.iter().sum::<Vec3>() / colors.len() as f32;
        assert!((mean - 1.0).abs().max_element() < 0.015, "{eye}: {mean}");
        let brighter = colors.iter().filter(|color| (**color - 1.0).abs().max_element() > 0.01);
        assert!(brighter.count() > 50, "{eye}: nothing scatters");
    }
}

#[test]
fn ids_and_points_are_those_of_the_visible_body() {
    let materials = [WATER, OIL];
    let scene = scene(DVec3::new(0.0, -8.0, 0.0), DVec3::ZERO, &materials);
    // The second ball is half inside the first one, nearer to the camera than its middle
    let centers = [Vec3::new(-0.6, 0.0, 0.0), Vec3::new(0.6, 0.0, 0.0)];
    let shapes = solids(centers.map(|center| Solid::ball_at(center, 1.0)));
    let settings =
        RenderSettings { channels: Channels::ALL, max_depth: 4, ..RenderSettings::new(64, 64) };
    let film = film(&shapes, &scene, &settings);
    let ids = film.plane::<u32>(FilmPlane::Id).unwrap();
    let points = film.plane::<[f32; 3]>(FilmPlane::Position).unwrap();
    let mut counts = [0; 2];
    for (id, point) in ids.iter().zip(points).filter(|(id, _)| **id != NO_ID) {
        let body = usize::from(*id == 10);
        assert!(*id == 0 || *id == 10, "{id}");
        let distance = (Vec3::from_array(*point) - centers[body]).length();
        assert!((distance - 1.0).abs() < 1e-4, "{id} {point:?}");
        // The nearest surface is seen
        let other = (Vec3::from_array(*point) - centers[1 - body]).length();
        assert!(other > 1.0 - 1e-4, "{id} {point:?}");
        counts[body] += 1;
    }
    assert!(counts.iter().all(|count| *count > 300), "{counts:?}");
}

#[test]
fn too_many_bodies_are_refused() {
    let balls = |count: u16| solids((0..count).map(|_| Solid::ball(1.0)));
    let rendered = |materials: &[Material], shapes: &[Box<dyn Shape>]| {
        let scene = scene(DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO, materials);
        let source = ParticleShading::constant(Vec3::ONE);
        let never = AtomicBool::new(false);
        let shapes: Vec<&dyn Shape> = shapes.iter().map(|shape| &**shape).collect();
        render(&shapes, &scene, &source, &RenderSettings::new(1, 1), &never)
    };
    assert!(rendered(&[WATER; 8], &balls(8)).is_ok());
    let error = rendered(&[WATER; 9], &balls(9)).unwrap_err();
    assert_eq!(error.to_string(), "9 bodies are transmissive, but at most 8 can be in one picture");
    let spheres: Box<dyn Shape> = Box::new(brute::Balls::one(Vec3::ZERO, 1.0));
    let ball: Box<dyn Shape> = Box::new(Solid::ball(1.0));
    let error = rendered(&[WATER; 2], &bodies([spheres, ball])).unwrap_err();
    assert!(error.to_string().contains("transmissive spheres beside"), "{error}");
}

#[test]
fn pictures_do_not_depend_on_threads() {
    let mut scene = lit_scene(&[WATER, OIL]);
    scene.environment = Some(std::sync::Arc::new(Environment::constant(Vec3::splat(0.5))));
    let shapes = solids([Solid::ball(1.0), Solid::ball_at(Vec3::new(0.8, 0.0, 0.3), 0.9)]);
    let settings = RenderSettings {
        photons: 20_000,
        max_depth: 8,
        channels: Channels::ALL,
        ..path_settings(20, 5, 2)
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| film(&shapes, &scene, &settings))
    };
    let one = on(1);
    assert!(one.color.iter().flatten().all(|value| value.is_finite()));
    assert_eq!(one, on(3));
}
