//! Depth of field: the size of the disc of confusion, what stays sharp, and equality with a pinhole.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};

use super::{
    brute::{Ball, Balls},
    *,
};
use crate::scene::{Background, Camera, CameraView, Lens, Material};
use spherule_surface::spheres::SphereSurface;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};

const SIDE: u32 = 64;
/// Tangent of half the field of view.
const TANGENT: f32 = 0.25;
const RADIUS: f32 = 0.15;

/// Looks along +y from the origin. Spheres have one colour, whatever the direction of their normal.
fn scene(lens: Option<Lens>) -> Scene {
    let view = CameraView {
        eye: DVec3::ZERO,
        look_at: DVec3::Y,
        up: DVec3::Z,
        fov: 2.0 * f64::from(TANGENT).atan().to_degrees(),
    };
    let pinhole = Lens { radius: 0.0, focus: 1.0 };
    let camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    Scene {
        materials: Scene::basic_materials(Material {
            ambient: 1.0,
            diffuse: 0.0,
            specular: 0.0,
            reflection: 0.0,
            ..Material::DEFAULT
        }),
        background: Background::Constant(Vec3::ZERO),
        ..Scene::new(camera.with_lens(lens.unwrap_or(pinhole)))
    }
}

fn film(shape: &dyn Shape, lens: Option<Lens>, change: impl Fn(&mut RenderSettings)) -> Film {
    let mut settings =
        RenderSettings { samples: 256, channels: Channels::ALL, ..RenderSettings::new(SIDE, SIDE) };
    change(&mut settings);
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    let mut scene = scene(lens);
    if settings.integrator == IntegratorKind::Path {
        let white = crate::scene::Environment::constant(Vec3::ONE);
        scene.environment = Some(std::sync::Arc::new(white));
    }
    let rendered = render(&[shape], &scene, &source, &settings, &never);
    rendered.unwrap().0
}

/// A ball on the view axis.
fn ball(distance: f32) -> Balls {
    Balls::one(Vec3::new(0.0, distance, 0.0), RADIUS)
}

/// Coverage of a film: its sum, its second moment about the centre, and its largest distance from the centre, in
/// pixels.
fn moments(film: &Film) -> [f32; 3] {
    let [mut sum, mut square, mut reach] = [0.0, 0.0, 0.0_f32];
    for (index, color) in (0..).zip(&film.color) {
        let pixel = Vec2::new((index % SIDE) as f32, (index / SIDE) as f32) + 0.5;
        let distance = pixel.distance(Vec2::splat(0.5 * SIDE as f32));
        sum += color[3];
        square += color[3] * distance * distance;
        if color[3] > 0.0 {
            reach = reach.max(distance);
        }
    }
    [sum, square / sum, reach]
}

#[test]
fn a_ball_out_of_focus_covers_its_disc_of_confusion() {
    // Near and far of the focus. The disc has the diameter a |z - f| / z on the plane in focus.
    for (focus, distance, radius) in
        [(5.0_f32, 8.0_f32, 0.5_f32), (5.0, 3.0, 0.25), (2.0, 4.0, 0.2)]
    {
        let pixels = |length: f32, z: f32| 0.5 * SIDE as f32 * length / (z * TANGENT);
        let blur = pixels(radius * (distance - focus).abs() / distance, focus);
        let sharp = pixels(RADIUS, distance);
        for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
            let lens = Some(Lens { radius, focus });
            let film = film(&ball(distance), lens, |s| s.integrator = integrator);
            let [sum, square, reach] = moments(&film);
            // Light is spread, not lost: the area is that of the ball
            let area = std::f32::consts::PI * sharp * sharp;
            assert!((sum / area - 1.0).abs() < 0.03, "{sum} {area}");
            // The squared radii of discs add up in a convolution; a pixel adds 1/6
            let expected = 0.5 * (blur * blur + sharp * sharp) + 1.0 / 6.0;
            assert!((square / expected - 1.0).abs() < 0.02, "{square} {expected}");
            let edge = blur + sharp;
            assert!(reach > edge - 1.5 && reach < edge + 1.5, "{reach} {edge}");
            // The disc has the same brightness everywhere
            let inside = (sharp / blur).powi(2).min(1.0);
            let middle = film.color[(SIDE / 2 * SIDE + SIDE / 2) as usize];
            let noise = 4.0 * (inside * (1.0 - inside) / 256.0).sqrt();
            assert!((middle[3] - inside).abs() <= noise, "{middle:?} {inside}");
            // Path tracing has noise
            assert!((middle[0] - middle[3]).abs() < 0.02, "{middle:?}");
        }
    }
}

#[test]
fn what_is_in_focus_stays_sharp() {
    let balls = Balls(vec![
        Ball { center: Vec3::new(-0.5, 4.0, 0.3), radius: 0.2 },
        Ball { center: Vec3::new(0.4, 4.0, -0.2), radius: 0.1 },
    ]);
    let lens = Lens { radius: 0.2, focus: 4.0 };
    let (sharp, blurred) = (film(&balls, None, |_| {}), film(&balls, Some(lens), |_| {}));
    for (index, (a, b)) in sharp.color.iter().zip(&blurred.color).enumerate() {
        // Only the outline is seen from different points
        assert!((a[3] - b[3]).abs() < 0.35, "{index}: {a:?} {b:?}");
        if a[3] == 0.0 || a[3] == 1.0 {
            assert!((a[3] - b[3]).abs() < 0.1, "{index}: {a:?} {b:?}");
        }
    }
    let far = Lens { focus: 8.0, ..lens };
    let far = film(&balls, Some(far), |_| {});
    let difference = |other: &Film| {
        let pixels = sharp.color.iter().zip(&other.color);
        pixels.map(|(a, b)| (a[3] - b[3]).abs()).sum::<f32>()
    };
    assert!(difference(&far) > 20.0 * difference(&blurred));
}

#[test]
fn depth_is_measured_along_the_view_axis() {
    let lens = Lens { radius: 0.5, focus: 5.0 };
    let film = film(&ball(8.0), Some(lens), |_| {});
    let mut count = 0;
    for (z, color) in film.plane::<f32>(FilmPlane::Depth).unwrap().iter().zip(&film.color) {
        if color[3] > 0.0 {
            assert!((8.0 - RADIUS - 1e-4..8.0 + 0.2 * RADIUS).contains(z), "{z}");
            count += 1;
        }
    }
    assert!(count > 100, "{count}");
}

#[test]
fn a_tree_gives_the_same_blur_as_single_spheres() {
    let unit = |i: u32| (i.wrapping_mul(0x9e37_79b9) >> 8) as f32 / 16_777_216.0;
    let center = |i: u32| {
        let across = 2.0 * Vec2::new(unit(3 * i + 1), unit(7 * i + 5)) - 1.0;
        Vec3::new(across.x, 3.0 + 4.0 * unit(11 * i + 3), across.y)
    };
    let balls = (0..90).map(|i| Ball { center: center(i), radius: 0.125 });
    let balls = Balls(balls.collect());
    let centers: Vec<Vec3> = balls.0.iter().map(|ball| ball.center).collect();
    let spheres = Spheres { centers: &centers, radius: SphereRadius::Common(0.125) };
    let mut builder = TreeBuilder::new();
    builder.build(&spheres, &BuildSettings { keep_indices: true, ..BuildSettings::default() });
    let tree = SphereSurface::new(builder.tree().view());
    let lens = Lens { radius: 0.3, focus: 5.0 };
    let (one, other) =
        (film(&balls, Some(lens), |s| s.samples = 5), film(&tree, Some(lens), |s| s.samples = 5));
    let pixels = one.color.iter().zip(&other.color);
    let different = pixels.filter(|(a, b)| a[3] != b[3]).count();
    assert!(different < 8, "{different}");
}
