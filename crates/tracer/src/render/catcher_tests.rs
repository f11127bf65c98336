//! Shadow catchers against a rendered floor, and lights with an extent in images.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{brute::Balls, *};
use crate::scene::environment::studio;
use crate::scene::{
    Background, Camera, CameraView, Environment, EnvironmentAxes, Finish, Ground, Light, LightKind,
    RadianceMap, Scene,
};

/// A floor at height 0, seen at an angle.
fn scene(environment: Environment) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -6.0, 5.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 40.0,
    };
    Scene {
        background: Background::Constant(Vec3::ONE),
        ground: Some(Ground {
            up: Vec3::Z,
            height: 0.0,
            color: Vec3::splat(0.5),
            center: Vec3::ZERO,
            base: Vec3::ZERO,
            fade_start: 1e3,
            fade_end: 2e3,
            lit_range: 1e3,
            pattern: crate::scene::ground::Pattern::Plain,
            shadow_catcher: None,
        }),
        environment: Some(Arc::new(environment)),
        particles: [Vec3::splat(-2.0), Vec3::splat(2.0)],
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

fn with_catcher(mut scene: Scene, strength: f32) -> Scene {
    if let Some(ground) = &mut scene.ground {
        ground.shadow_catcher = Some(strength);
    }
    scene
}

fn studio_light() -> Environment {
    studio(EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0), Vec3::ONE)
}

fn sun(irradiance: Vec3) -> Light {
    Light {
        kind: LightKind::Directional { to_light: Vec3::Z },
        radiance: irradiance,
        casts_shadow: true,
        is_visible: false,
        group: 0,
    }
}

fn settings(side: u32, samples: u32, bounces: u32) -> RenderSettings {
    RenderSettings {
        samples,
        bounces,
        integrator: IntegratorKind::Path,
        ..RenderSettings::new(side, side)
    }
}

fn image(shape: &dyn Shape, scene: &Scene, settings: &RenderSettings) -> Film {
    let source = ParticleShading::constant(Vec3::splat(0.7));
    let never = AtomicBool::new(false);
    let rendered = render(&[shape], scene, &source, settings, &never);
    rendered.unwrap().0
}

fn ball() -> Balls {
    Balls::one(Vec3::new(0.5, 0.3, 0.8), 0.8)
}

fn nothing() -> Balls {
    Balls(Vec::new())
}

#[test]
fn where_nothing_is_in_the_way_the_background_is_exact() {
    for background in
        [Background::Constant(Vec3::new(0.3, 0.6, 0.9)), Background::Studio { up: Vec3::Z }]
    {
        let mut open = scene(studio_light());
        open.background = background;
        open.lights = vec![sun(Vec3::ONE)];
        let caught = image(&nothing(), &with_catcher(open.clone(), 1.0), &settings(12, 5, 2));
        open.ground = None;
        assert_eq!(caught.color, image(&nothing(), &open, &settings(12, 5, 2)).color);
    }
    // Outside the shadow of a light without extent, and inside it
    for strength in [1.0, 0.25] {
        let mut scene = with_catcher(scene(Environment::constant(Vec3::ZERO)), strength);
        scene.lights = vec![sun(Vec3::new(2.0, 1.0, 0.5))];
        let film = image(&ball(), &scene, &settings(32, 1, 0));
        let floor = film.color.iter().filter(|c| c[3] == 0.0);
        let (dark, bright): (Vec<&[f32; 4]>, Vec<&[f32; 4]>) = floor.partition(|c| c[0] < 1.0);
        assert!(dark.len() > 10 && bright.len() > 400, "{} {}", dark.len(), bright.len());
        assert!(bright.iter().all(|c| **c == [1.0, 1.0, 1.0, 0.0]));
        let shadow = |c: &[f32; 4]| (c[0] - (1.0 - strength)).abs() < 1e-6;
        assert!(dark.iter().all(|c| shadow(c)), "{strength}: {:?}", dark[0]);
    }
}

#[test]
fn shadows_are_those_of_a_rendered_floor() {
    for light in [None, Some(sun(Vec3::splat(2.0)))] {
        let environment = studio_light();
        let irradiance = environment.irradiance(Vec3::Z)
            + light.as_ref().map_or(Vec3::ZERO, |light| light.radiance);
        let mut floor = scene(environment);
        floor.lights.extend(light);
        let settings = settings(24, 256, 0);
        let rendered = image(&ball(), &floor, &settings);
        let caught = image(&ball(), &with_catcher(floor, 1.0), &settings);
        let (mut sums, mut count, mut worst) = ([Vec3::ZERO; 2], 0, 0.0_f32);
        for (rendered, caught) in rendered.color.iter().zip(&caught.color) {
            if caught[3] != 0.0 {
                continue;
            }
            let open = 0.5 * irradiance * std::f32::consts::FRAC_1_PI;
            let wanted = Vec3::from_slice(&rendered[..3]) / open;
            let found = Vec3::from_slice(&caught[..3]);
            sums = [sums[0] + wanted, sums[1] + found];
            worst = worst.max((wanted - found).abs().max_element());
            count += 1;
        }
        let [wanted, found] = sums.map(|sum| sum / f32::from(u16::try_from(count).unwrap()));
        assert!(count > 300 && wanted.x < 0.97, "{count} {wanted}");
        assert!((wanted - found).abs().max_element() < 4e-3, "{wanted} {found}");
        assert!(worst < 0.12, "{worst}");
    }
}

#[test]
fn in_transparent_images_shadows_are_coverage() {
    let scene = with_catcher(scene(Environment::constant(Vec3::ONE)), 0.8);
    let opaque = settings(24, 64, 0);
    let transparent = RenderSettings { transparent_background: true, ..opaque };
    let (behind, above) = (image(&ball(), &scene, &opaque), image(&ball(), &scene, &transparent));
    let mut darkest = 0.0_f32;
    for (behind, above) in behind.color.iter().zip(&above.color) {
        assert!(above.iter().all(|v| *v >= 0.0) && above[3] <= 1.0);
        // Over the same background
        let over = above[0] + (1.0 - above[3]);
        assert!((over - behind[0]).abs() < 1e-4, "{over} {behind:?}");
        if behind[3] == 0.0 {
            assert_eq!(above[..3], [0.0; 3]);
            darkest = darkest.max(above[3]);
        }
    }
    assert!(darkest > 0.4, "{darkest}");
}

#[test]
fn a_shadow_catcher_has_no_data_and_fades_out() {
    let mut scene = with_catcher(scene(studio_light()), 1.0);
    let all = RenderSettings {
        channels: Channels::from_names(["Z", "N"]).unwrap(),
        ..settings(16, 4, 0)
    };
    let film = image(&nothing(), &scene, &all);
    assert!(film.plane::<f32>(FilmPlane::Depth).unwrap().iter().all(|z| *z == f32::INFINITY));
    if let Some(ground) = &mut scene.ground {
        (ground.fade_start, ground.fade_end) = (0.1, 0.2);
    }
    let film = image(&ball(), &scene, &settings(24, 16, 0));
    let floor = film.color.iter().filter(|c| c[3] == 0.0);
    let shadows = floor.clone().filter(|c| c[0] < 1.0).count();
    assert!(floor.count() > 300 && shadows < 20, "{shadows}");
}

#[test]
fn a_light_with_an_extent_lights_a_floor() {
    // Straight below a disc, and a sphere; the floor is too small to vary.
    let view = CameraView {
        eye: DVec3::new(0.0, -7.0, 7.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 0.5,
    };
    let disc = LightKind::Disc { center: Vec3::Z * 3.0, normal: Vec3::NEG_Z, radius: 1.5 };
    let sphere = LightKind::Sphere { center: Vec3::Z * 3.0, radius: 1.5 };
    let rectangle = LightKind::Rectangle {
        center: Vec3::Z * 3.0,
        axes: [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z],
        half: [20.0, 20.0],
    };
    // Irradiance over pi for a radiance of 1
    let corner = {
        let (side, height) = (20.0_f32, 3.0_f32);
        let root = (height * height + side * side).sqrt();
        4.0 * (side / root) * (side / root).atan() / std::f32::consts::PI
    };
    for (kind, wanted) in [(disc, 2.25 / 11.25), (sphere, 2.25 / 9.0), (rectangle, corner)] {
        let mut scene = scene(Environment::constant(Vec3::ZERO));
        scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
        scene.lights = vec![Light {
            kind,
            radiance: Vec3::splat(4.0),
            casts_shadow: true,
            is_visible: false,
            group: 0,
        }];
        for bounces in [0, 3] {
            let film = image(&nothing(), &scene, &settings(4, 256, bounces));
            let mean = film.color.iter().map(|c| c[1]).sum::<f32>() / 16.0;
            let wanted = 0.5 * 4.0 * wanted;
            assert!((mean / wanted - 1.0).abs() < 0.01, "{kind:?} {bounces}: {mean} {wanted}");
        }
    }
}

#[test]
fn the_camera_sees_visible_lights_only() {
    for (is_visible, wanted) in [(true, [5.0, 5.0, 5.0, 1.0]), (false, [1.0, 1.0, 1.0, 0.0])] {
        let mut scene = scene(Environment::constant(Vec3::ZERO));
        scene.ground = None;
        scene.lights = vec![Light {
            kind: LightKind::Sphere { center: Vec3::ZERO, radius: 1.0 },
            radiance: Vec3::splat(5.0),
            casts_shadow: true,
            is_visible,
            group: 0,
        }];
        let film = image(&nothing(), &scene, &settings(9, 1, 0));
        assert_eq!(film.color[40], wanted);
        assert_eq!(film.color[0], [1.0, 1.0, 1.0, 0.0]);
        // A body in front of it hides it
        let film = image(&Balls::one(Vec3::new(0.0, -2.4, 2.0), 0.5), &scene, &settings(9, 1, 0));
        assert!(film.color[40][0] < 4.0 && film.color[40][3] == 1.0);
    }
}

/// The environment of [`two_halves`] above and below the horizon.
const HALVES: [Vec3; 2] = [Vec3::new(0.2, 0.4, 0.8), Vec3::new(0.9, 0.3, 0.1)];

fn two_halves() -> Environment {
    let rows = (0..256).map(|row| if row < 128 { HALVES[0] } else { HALVES[1] });
    let pixels = rows.flat_map(|color| std::iter::repeat_n(color, 512)).collect();
    let map = RadianceMap::new(512, 256, pixels).unwrap();
    Environment::from_map(EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0), &map, Vec3::ONE)
}

/// A mirror sees the environment below the horizon, through the catcher, and in front of it the shadow of the ball.
#[test]
fn mirrors_see_the_environment_through_the_catcher() {
    let pixels = |finish, strength, transparent_background: bool| {
        let mut scene = with_catcher(scene(two_halves()), strength);
        scene.is_environment_visible = !transparent_background;
        scene.particle_material_mut().finish = finish;
        let channels = Channels::from_names(["RGBA", "Z"]).unwrap();
        let settings = RenderSettings { transparent_background, channels, ..settings(32, 64, 3) };
        let ball = Balls::one(Vec3::new(0.0, 0.0, 1.2), 1.0);
        let source = ParticleShading::constant(Vec3::ONE);
        let never = AtomicBool::new(false);
        let film = render(&[&ball as &dyn Shape], &scene, &source, &settings, &never).unwrap().0;
        // Shadows cover some of a transparent background, too
        let depth = film.plane::<f32>(FilmPlane::Depth).unwrap();
        let pixels = film.color.iter().zip(depth);
        let covered = pixels.filter(|(c, z)| c[3] == 1.0 && z.is_finite()).map(|(c, _)| c);
        covered.map(|color| Vec3::from_slice(color)).collect::<Vec<_>>()
    };
    for is_transparent in [false, true] {
        // Without a shadow, a white mirror has one of the two colours nearly everywhere
        let mirror = pixels(Finish::Metal { roughness: 0.0 }, 0.0, is_transparent);
        let near = |color: Vec3| mirror.iter().filter(|c| c.distance(color) < 0.02).count();
        let [above, below] = HALVES.map(near);
        assert!(above > 50 && below > 20, "{above} {below}");
        assert!((above + below) * 5 > mirror.len() * 4, "{above} {below} {}", mirror.len());
        // The shadow makes it darker where it is, and the matte ball has light from the ground as before
        let shadowed = pixels(Finish::Metal { roughness: 0.0 }, 1.0, is_transparent);
        let darker = mirror.iter().zip(&shadowed).filter(|(a, b)| b.x < a.x - 0.1).count();
        let brighter = mirror.iter().zip(&shadowed).filter(|(a, b)| b.x > a.x + 0.02).count();
        assert!(darker > 4 && brighter == 0, "{darker} {brighter}");
    }
    // In front of a backdrop, the mirror image of the ground is part of it
    let mut scene = with_catcher(scene(two_halves()), 1.0);
    scene.particle_material_mut().finish = Finish::Metal { roughness: 0.0 };
    assert!(!device::mirrors_see_through(&scene, &settings(32, 64, 3)));
    // The base of plastic is lit by the grey ground like a matte ball, its coat is not
    let mean = |finish| {
        let pixels = pixels(finish, 0.0, false);
        pixels.iter().sum::<Vec3>() / pixels.len() as f32
    };
    let (matte, plastic) = (mean(Finish::Matte), mean(Finish::Plastic { roughness: 0.0 }));
    assert!((plastic / matte - 1.0).abs().max_element() < 0.12, "{matte} {plastic}");
}
