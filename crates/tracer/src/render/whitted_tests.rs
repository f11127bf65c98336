//! The recursion against values computed by hand.
#![expect(clippy::cast_possible_truncation, reason = "hand values are f64")]

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{
    brute::{Ball, Balls},
    *,
};
use crate::scene::{Background, Camera, CameraView, Ground, Light, Material, material::schlick};

/// `1 - ((1.5-1)/(1.5+1))^2` and its complement, at normal incidence.
const R: f32 = 0.04;

/// Looks along +y at the origin from a distance of 10, with a narrow field of view.
fn scene(material: Material) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 20.0,
    };
    Scene {
        ambient_light: Vec3::ZERO,
        materials: Scene::basic_materials(material),
        background: Background::Constant(Vec3::ONE),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

const fn glass() -> Material {
    Material { ambient: 1.0, ior: 1.5, transmission: 1.0, ..Material::DEFAULT }
}

/// The centre pixel of `scene`.
fn middle(surface: &Balls, scene: &Scene, max_depth: u32) -> (Vec3, RayCounts) {
    let settings = RenderSettings { max_depth, ..RenderSettings::new(1, 1) };
    let source = ParticleShading::constant(Vec3::ONE);
    let (film, counts) =
        render(&[surface], scene, &source, &settings, &AtomicBool::new(false)).unwrap();
    (Vec3::from_slice(&film.color[0][..3]), counts)
}

fn image(surface: &Balls, scene: &Scene, settings: &RenderSettings) -> Film {
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    render(&[surface], scene, &source, settings, &never).unwrap().0
}

#[track_caller]
fn assert_near(value: Vec3, expected: f32) {
    assert_within(1e-5, value, expected);
}

#[track_caller]
fn assert_within(limit: f32, value: Vec3, expected: f32) {
    let error = (value - expected).abs().max_element();
    assert!(error < limit, "{value} is not {expected}");
}

/// A background that is `front` along +y and `back` along -y.
fn front_and_back(front: f32, back: f32) -> Background {
    Background::Gradient { bottom: Vec3::splat(back), top: Vec3::splat(front), up: Vec3::Y }
}

#[test]
fn equation_4_1_through_the_middle_of_a_glass_ball() {
    let (ambient, front, back) = (0.25, 0.5, 2.0);
    let mut scene = scene(glass());
    scene.ambient_light = Vec3::splat(ambient);
    scene.background = front_and_back(front, back);
    let ball = Balls::one(Vec3::ZERO, 1.0);

    // Depth 1: both directions see the background.
    let (one, counts) = middle(&ball, &scene, 1);
    assert_near(one, ambient + R * back + (1.0 - R) * front);
    assert_eq!(counts.total(), 1);

    // Depth 2: the refracted ray hits the far wall, and its two rays see the background.
    let far_wall = ambient + R * back + (1.0 - R) * front;
    let (two, counts) = middle(&ball, &scene, 2);
    assert_near(two, ambient + R * back + (1.0 - R) * far_wall);
    assert_eq!((counts.reflection, counts.refraction), (1, 1));

    // Depth 3: the ray reflected at the far wall hits the near one from inside; from there it is reflected to the
    // front and refracted to the back.
    let near_wall = ambient + R * front + (1.0 - R) * back;
    let far_wall = ambient + R * near_wall + (1.0 - R) * front;
    let (three, counts) = middle(&ball, &scene, 3);
    assert_near(three, ambient + R * back + (1.0 - R) * far_wall);
    assert_eq!((counts.reflection, counts.refraction), (2, 2));
}

#[test]
fn the_weights_scale_their_rays_and_zero_traces_none() {
    let mut scene = scene(Material { reflection: 0.5, transmission: 0.25, ..glass() });
    scene.background = front_and_back(0.5, 2.0);
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let (value, _) = middle(&ball, &scene, 1);
    assert_near(value, 0.5 * R * 2.0 + 0.25 * (1.0 - R) * 0.5);
    scene.particle_material_mut().reflection = 0.0;
    scene.particle_material_mut().transmission = 0.0;
    let (value, counts) = middle(&ball, &scene, 5);
    assert_near(value, 0.0);
    assert_eq!(counts.total(), 1);
}

#[test]
fn refraction_through_a_ball_leaves_at_the_known_angle() {
    // A ray that hits the ball at angle a leaves after a turn of 2 (a - b), sin b = sin a / 1.5.
    for offset in [0.1_f64, 0.5, 0.8] {
        let view = CameraView {
            eye: DVec3::new(offset, -10.0, 0.0),
            look_at: DVec3::new(offset, 0.0, 0.0),
            up: DVec3::Z,
            fov: 20.0,
        };
        let mut scene = scene(Material { reflection: 0.0, ..glass() });
        scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
        // Brightness encodes the angle to +y.
        scene.background = front_and_back(1.0, 0.0);
        let (value, counts) = middle(&Balls::one(Vec3::ZERO, 1.0), &scene, 3);
        assert_eq!(counts.refraction, 2);
        let (a, b) = (offset.asin(), (offset / 1.5).asin());
        let turned = 2.0 * (a - b);
        let sky = 1.0 - turned / std::f64::consts::PI;
        // Schlick's approximation with the cosine of the ray: a outside, b inside.
        let passed = |angle: f64| 1.0 - f64::from(schlick(R, angle.cos() as f32));
        // The offset of 1e-4 from the surface shifts the path by the same length.
        assert_within(1e-4, value, (passed(a) * passed(b) * sky) as f32);
    }
}

#[test]
fn total_internal_reflection_keeps_everything_inside() {
    // The eye is inside, 0.9 from the centre, looking sideways: sin = 0.9 is beyond 1/1.5.
    let view = CameraView {
        eye: DVec3::new(0.9, 0.0, 0.0),
        look_at: DVec3::new(0.9, 1.0, 0.0),
        up: DVec3::Z,
        fov: 20.0,
    };
    let mut scene = scene(glass());
    scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    scene.ambient_light = Vec3::splat(0.125);
    let (value, counts) = middle(&Balls::one(Vec3::ZERO, 1.0), &scene, 4);
    assert_eq!((counts.refraction, counts.reflection), (0, 3));
    assert_near(value, 4.0 * 0.125 + 1.0);
    // The maximum recursion depth fits into the stack.
    let (deep, _) = middle(&Balls::one(Vec3::ZERO, 1.0), &scene, MAX_DEPTH);
    assert_within(1e-3, deep, MAX_DEPTH as f32 * 0.125 + 1.0);
}

#[test]
fn shadows_are_opaque_or_attenuated_per_interface() {
    let up_front = [Ball { center: Vec3::new(0.0, -5.0, 5.0), radius: 0.5 }];
    let beyond = [Ball { center: Vec3::new(0.0, -12.0, 12.0), radius: 0.5 }];
    let lit = |material: Material, between: &[Ball]| {
        let mut scene =
            scene(Material { diffuse: 1.0, specular: 0.0, reflection: 0.0, ..material });
        scene.background = Background::Constant(Vec3::ZERO);
        // In line with the point (0, -1, 0) and the centres of the balls, at 45 degrees.
        let light = Light::point(DVec3::new(0.0, -10.0, 9.0), DVec3::ZERO, Vec3::ONE);
        scene.lights = vec![light];
        let mut balls = vec![Ball { center: Vec3::ZERO, radius: 1.0 }];
        balls.extend(
            between.iter().map(|b| Ball { center: b.center + Vec3::new(0.0, 0.0, -1.0), ..*b }),
        );
        middle(&Balls(balls), &scene, 1)
    };
    let cosine = 0.5_f32.sqrt();
    let opaque = Material::DEFAULT;
    let (free, counts) = lit(opaque, &[]);
    assert_near(free, cosine);
    assert_eq!(counts.shadow, 1);
    assert_near(lit(opaque, &up_front).0, 0.0);
    // Behind the light.
    assert_near(lit(opaque, &beyond).0, cosine);

    // Through the centre of a ball: two crossings at normal incidence.
    let clear = Material { transmission: 0.5, ior: 1.5, ..Material::DEFAULT };
    let through = 0.5 * (1.0 - R);
    assert_near(lit(clear, &up_front).0, cosine * through * through);
    assert_near(lit(clear, &beyond).0, cosine);
}

#[test]
fn blinn_phong_by_hand() {
    // Light and eye 60 degrees apart around the normal -y: eye on it, half vector at 30 degrees.
    let mut scene = scene(Material {
        ambient: 0.1,
        diffuse: 0.6,
        specular: 0.3,
        shininess: 8.0,
        reflection: 0.0,
        ..Material::DEFAULT
    });
    scene.ambient_light = Vec3::splat(0.5);
    let to_light = Vec3::new(0.0, -0.5, 0.75_f32.sqrt());
    scene.lights = vec![Light::directional(-to_light, Vec3::splat(2.0)).unwrap()];
    let (value, _) = middle(&Balls::one(Vec3::ZERO, 1.0), &scene, 1);
    let highlight = 0.3 * 0.75_f32.powi(4);
    assert_near(value, 0.05 + 2.0 * (0.6 * 0.5 + highlight));
}

#[test]
fn energy_never_grows() {
    // White background without other light: at most white, for any weights and any depth.
    let balls = Balls(
        (0..27_u8)
            .map(|i| Ball {
                center: Vec3::new(f32::from(i % 3), f32::from(i / 3 % 3), f32::from(i / 9)) - 1.0,
                radius: 0.6,
            })
            .collect(),
    );
    for (reflection, transmission) in [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.7, 0.6)] {
        for ior in [0.7, 1.0, 1.33, 2.4] {
            let scene = scene(Material { reflection, transmission, ior, ..Material::DEFAULT });
            let settings =
                RenderSettings { max_depth: 6, samples: 3, ..RenderSettings::new(24, 24) };
            let film = image(&balls, &scene, &settings);
            let values = film.color.iter().flatten();
            let worst = values.copied().fold(0.0, f32::max);
            assert!(worst <= 1.0 + 1e-5, "{worst}");
            // No light is lost if both weights are 1.
            if reflection == 1.0 && transmission == 1.0 {
                let least = film.color.iter().map(|c| c[0]).fold(1.0, f32::min);
                assert!(least > 1.0 - 1e-5, "{least}");
            }
        }
    }
}

#[test]
fn no_acne_and_no_leaks_at_any_scale() {
    // A ball with a light at the camera: every visible point faces the light, so nothing may be in shadow. With a
    // second ball around the first one, nothing may be lit. Also off centre.
    for scale in [1e-4_f32, 1e-2, 1.0, 1e2, 1e4] {
        for shift in [0.0, 30.0] {
            let center = Vec3::splat(shift * scale);
            let from = |y: f32| (center + Vec3::Y * y * scale).as_dvec3();
            let view = CameraView {
                eye: from(-10.0),
                look_at: center.as_dvec3(),
                up: DVec3::Z,
                fov: 11.0,
            };
            let mut scene = scene(Material {
                ambient: 0.0,
                diffuse: 1.0,
                specular: 0.0,
                reflection: 0.0,
                ..Material::DEFAULT
            });
            scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
            scene.background = Background::Constant(Vec3::ZERO);
            scene.lights = vec![Light::point(from(-10.0), DVec3::ZERO, Vec3::ONE)];
            let ball = Balls::one(center, scale);
            let settings =
                RenderSettings { channels: Channels::ALL, ..RenderSettings::new(48, 48) };
            let film = image(&ball, &scene, &settings);
            let normals = film.plane::<Vec3>(FilmPlane::Normal).unwrap();
            let mut hits = 0;
            for ((color, normal), position) in
                film.color.iter().zip(normals).zip(film.plane::<Vec3>(FilmPlane::Position).unwrap())
            {
                if color[3] == 1.0 {
                    hits += 1;
                    let to_light = (from(-10.0).as_vec3() - position).normalize();
                    let cosine = normal.dot(to_light);
                    // Cosines near 0 may have either sign.
                    assert!((color[0] - cosine).abs() < 2e-3, "{scale}: {color:?} {cosine}");
                }
            }
            assert!(hits > 1000, "{hits}");

            // The light is inside a second ball that contains neither the camera nor the first ball.
            let shade = Ball { center: center + Vec3::new(0.0, -10.0, 5.0) * scale, radius: scale };
            scene.lights = vec![Light::point(shade.center.as_dvec3(), DVec3::ZERO, Vec3::ONE)];
            let both = Balls(vec![ball.0[0], shade]);
            let film = image(&both, &scene, &settings);
            assert!(film.color.iter().all(|c| c[0] == 0.0), "{scale}");
        }
    }
}

#[test]
fn a_glass_ball_has_no_acne_inside() {
    // With weights 1 and a constant background every hit adds exactly its ambient light; a ray that hit the same wall
    // twice would add it once more.
    for scale in [1e-4_f32, 1.0, 1e4] {
        let mut scene = scene(Material { reflection: 0.0, ..glass() });
        let view = CameraView {
            eye: DVec3::new(0.0, -10.0, 0.0) * f64::from(scale),
            look_at: DVec3::ZERO,
            up: DVec3::Z,
            fov: 11.0,
        };
        scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
        let settings = RenderSettings { max_depth: 10, ..RenderSettings::new(40, 40) };
        let source = ParticleShading::constant(Vec3::ONE);
        let never = AtomicBool::new(false);
        let ball = Balls::one(Vec3::ZERO, scale);
        let (film, counts) = render(&[&ball], &scene, &source, &settings, &never).unwrap();
        let hits = film.color.iter().filter(|c| c[3] == 1.0).count() as u64;
        assert_eq!(counts.refraction, 2 * hits, "{scale}");
    }
}

#[test]
fn ground_receives_shadows_and_blocks_light_from_below() {
    let mut scene = scene(Material::DEFAULT);
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 5.0),
        look_at: DVec3::new(0.0, 0.0, -1.0),
        up: DVec3::Z,
        fov: 20.0,
    };
    scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    scene.ground = Some(Ground {
        up: Vec3::Z,
        height: -1.0,
        color: Vec3::splat(0.5),
        center: Vec3::new(0.0, 0.0, -1.0),
        base: Vec3::ZERO,
        fade_start: 100.0,
        fade_end: 200.0,
        lit_range: 100.0,
        pattern: crate::scene::ground::Pattern::Plain,
        shadow_catcher: None,
    });
    scene.lights = vec![Light::directional(Vec3::NEG_Z, Vec3::ONE).unwrap()];
    // The ball is above the point that the camera looks at, outside the picture.
    let above = Balls::one(Vec3::new(0.0, 0.0, 20.0), 1.0);
    let aside = Balls::one(Vec3::new(9.0, 0.0, 20.0), 1.0);
    assert_near(middle(&above, &scene, 1).0, 0.0);
    assert_near(middle(&aside, &scene, 1).0, 0.5 * 0.7);
    // Planes of a pixel on the ground.
    let settings = RenderSettings { channels: Channels::ALL, ..RenderSettings::new(1, 1) };
    let film = image(&aside, &scene, &settings);
    assert_eq!(film.color[0][3], 1.0);
    assert_eq!(film.plane::<u32>(FilmPlane::Id).unwrap()[0], NO_ID);
    assert_eq!(film.plane::<Vec3>(FilmPlane::Normal).unwrap()[0], Vec3::Z);
    assert!((film.plane::<f32>(FilmPlane::Depth).unwrap()[0] - 136.0_f32.sqrt()).abs() < 1e-4);
    assert!(
        (film.plane::<Vec3>(FilmPlane::Position).unwrap()[0] - Vec3::new(0.0, 0.0, -1.0)).length()
            < 1e-5
    );
    // Light from below the ground.
    scene.lights = vec![Light::directional(Vec3::Z, Vec3::ONE).unwrap()];
    scene.particle_material_mut().ambient = 0.0;
    scene.particle_material_mut().reflection = 0.0;
    let lowered = Balls::one(Vec3::new(0.0, -2.0, 0.1), 0.3);
    assert_near(middle(&lowered, &scene, 1).0, 0.0);
}
