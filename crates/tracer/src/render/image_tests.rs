//! Whole images: same bytes on any number of threads, data planes, edges, interruption.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{
    brute::{Ball, Balls},
    *,
};
use crate::scene::{
    Background, Bounds, Camera, CameraView, Framed, Framing, Ground, Material, default_lights,
};
use spherule_surface::{Intersection, Side, spheres::SphereSurface};
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
use spherule_tree::math::{Lanes, lanes_in};
use spherule_tree::ray::{Ray, RayPacket};

/// A heap of balls, some overlapping, all different.
fn heap(count: u32) -> Balls {
    let unit = |seed: u32| {
        let mixed = seed.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
        let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b);
        ((mixed ^ (mixed >> 13)) >> 8) as f32 / 16_777_216.0
    };
    let ball = |i: u32| Ball {
        center: Vec3::new(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)) * 4.0,
        radius: 0.1 + 0.3 * unit(i + 7_000_000),
    };
    Balls((0..count).map(ball).collect())
}

fn heap_scene(transmission: f32) -> Scene {
    let bounds = Bounds { min: DVec3::splat(-0.4), max: DVec3::splat(4.4) };
    let framing = Framing::three_quarter(DVec3::Z, 1.5);
    let view = Framed::corners(&bounds).view(&framing);
    Scene {
        lights: default_lights(&bounds, DVec3::Z, &view),
        materials: Scene::basic_materials(Material { transmission, ..Material::DEFAULT }),
        background: Background::default_for(Vec3::Z),
        ground: Some(Ground::under(&bounds, Vec3::Z, DVec3::ZERO)),
        ..Scene::new(Camera::new(&view, 1.5, DVec3::ZERO).unwrap())
    }
}

fn settings() -> RenderSettings {
    RenderSettings {
        samples: 5,
        channels: Channels::ALL,
        // Not a multiple of the tile's side in either direction.
        ..RenderSettings::new(75, 50)
    }
}

#[test]
fn a_mosaic_has_tiles_of_the_whole_image() {
    let heap = heap(60);
    let source = ParticleShading::constant(Vec3::new(0.3, 0.5, 0.8));
    let scene = heap_scene(0.8);
    let image = |settings: &RenderSettings| {
        let never = AtomicBool::new(false);
        render(&[&heap], &scene, &source, settings, &never).unwrap().0
    };
    let whole = image(&settings());
    // Shares of 25 columns and of 50 rows; the last column of tiles is cut.
    let mosaic =
        image(&RenderSettings { width: 40, height: 16, mosaic_of: Some([75, 50]), ..settings() });
    for (x, y) in (0..16).flat_map(|y| (0..40).map(move |x| (x, y))) {
        let (left, top) = ([4, 29, 54][x / 16], 17);
        let (here, there) = (40 * y + x, 75 * (top + y) + left + x % 16);
        assert_eq!(mosaic.color[here], whole.color[there], "{x} {y}");
        let [of_mosaic, of_whole] =
            [&mosaic, &whole].map(|film| film.plane::<u32>(FilmPlane::Id).unwrap());
        assert_eq!(of_mosaic[here], of_whole[there]);
    }
    // A mosaic of all tiles is the image itself.
    let all = RenderSettings { width: 64, height: 48, ..settings() };
    let mosaic = RenderSettings { mosaic_of: Some([64, 48]), ..all };
    assert!(image(&mosaic) == image(&all));
}

#[test]
fn a_part_of_the_image_has_the_pixels_of_the_whole() {
    let heap = heap(60);
    let source = ParticleShading::constant(Vec3::new(0.3, 0.5, 0.8));
    let scene = heap_scene(0.8);
    for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
        let image = |left: i32, top: i32, width: u32, height: u32| {
            let never = AtomicBool::new(false);
            let settings = RenderSettings {
                width,
                height,
                integrator,
                window: Some(DataWindow { left, top, image: [75, 50] }),
                ..settings()
            };
            let rendered = render(&[&heap], &scene, &source, &settings, &never);
            rendered.unwrap().0
        };
        // The whole, a part that no tile begins with, and the whole with margins
        let whole = image(0, 0, 75, 50);
        let plain = RenderSettings { integrator, ..settings() };
        let never = AtomicBool::new(false);
        let (film, _) = render(&[&heap], &scene, &source, &plain, &never).unwrap();
        assert!(film == whole);
        let (part, wide) = (image(13, 7, 37, 30), image(-9, -5, 75 + 18, 50 + 10));
        for (x, y) in (0..50).flat_map(|y| (0..75).map(move |x| (x, y))) {
            let at = 75 * y + x;
            let in_wide = 93 * (y + 5) + x + 9;
            assert_eq!(wide.color[in_wide], whole.color[at], "{x} {y}");
            if (13..50).contains(&x) && (7..37).contains(&y) {
                let in_part = 37 * (y - 7) + x - 13;
                assert_eq!(part.color[in_part], whole.color[at], "{x} {y}");
                let depths =
                    [&part, &whole].map(|film| film.plane::<f32>(FilmPlane::Depth).unwrap());
                assert_eq!(depths[0][in_part], depths[1][at], "{x} {y}");
            }
        }
    }
}

#[test]
fn the_same_film_on_any_number_of_threads() {
    let heap = heap(60);
    let source = ParticleShading::constant(Vec3::new(0.3, 0.5, 0.8));
    for transmission in [0.0, 0.8] {
        let scene = heap_scene(transmission);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let never = AtomicBool::new(false);
            pool.install(|| render(&[&heap], &scene, &source, &settings(), &never).unwrap())
        };
        let (film, counts) = on(1);
        assert!(film.color.iter().flatten().all(|v| v.is_finite()));
        assert_eq!(counts.primary, 75 * 50 * 5);
        assert!(counts.shadow > 0 && counts.reflection > 0);
        assert_eq!(counts.refraction > 0, transmission > 0.0);
        assert_eq!((film.clone(), counts), on(2));
        assert_eq!((film, counts), on(7));
    }
}

#[test]
fn reused_film_is_cleared() {
    let source = ParticleShading::constant(Vec3::new(0.3, 0.5, 0.8));
    let never = AtomicBool::new(false);
    let scene = heap_scene(0.0);
    let mut bare = heap_scene(0.0);
    bare.ground = None;
    for channels in [Channels::ALL, Channels::COLOR] {
        let settings = RenderSettings { channels, ..settings() };
        // Rays with and without intersections.
        for (balls, scene) in [(heap(60), &scene), (Balls(Vec::new()), &bare)] {
            let into = |film: &mut Film| {
                render_into(film, &[&balls], scene, &source, &settings, &never).unwrap()
            };
            let mut fresh = Film::default();
            let counts = into(&mut fresh);
            let mut used = filled(settings.width, settings.height, channels);
            let memory = used.color.as_ptr();
            assert_eq!(into(&mut used), counts);
            assert_eq!(used, fresh);
            assert_eq!(used.color.as_ptr(), memory);
            // Films of other sizes or channels are reallocated.
            for mut other in [
                filled(settings.height, settings.width, channels),
                filled(settings.width, settings.height, Channels::ALL),
            ] {
                assert_eq!(into(&mut other), counts);
                assert_eq!(other, fresh);
            }
        }
    }
}

/// A film with nonzero values in every plane.
fn filled(width: u32, height: u32, channels: Channels) -> Film {
    let mut film = Film::new(width, height, channels);
    film.color.fill([7.0; 4]);
    for words in &mut film.planes {
        words.fill(7.0_f32.to_bits());
    }
    film
}

#[test]
fn data_planes_hold_the_nearest_sample() {
    let view = CameraView {
        eye: DVec3::new(100.0, 200.0, -5.0),
        look_at: DVec3::new(100.0, 200.0, 0.0),
        up: DVec3::Y,
        fov: 40.0,
    };
    let origin = DVec3::new(100.0, 200.0, 0.0);
    let mut scene = heap_scene(0.0);
    scene.origin = origin;
    scene.camera = Camera::new(&view, 1.0, origin).unwrap();
    scene.ground = None;
    let velocities = [Vec3::new(1.0, 2.0, 3.0)];
    let source = ParticleShading {
        ids: Some(&[77]),
        velocities: Some(&velocities),
        ..ParticleShading::constant(Vec3::new(0.1, 0.2, 0.3))
    };
    let settings = RenderSettings { channels: Channels::ALL, ..RenderSettings::new(33, 33) };
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let never = AtomicBool::new(false);
    let (film, _) = render(&[&ball], &scene, &source, &settings, &never).unwrap();
    let middle = 16 * 33 + 16;
    assert!((film.plane::<f32>(FilmPlane::Depth).unwrap()[middle] - 4.0).abs() < 1e-5);
    assert!((film.plane::<Vec3>(FilmPlane::Normal).unwrap()[middle] - Vec3::NEG_Z).length() < 1e-5);
    let expected = Vec3::new(100.0, 200.0, -1.0);
    assert!((film.plane::<Vec3>(FilmPlane::Position).unwrap()[middle] - expected).length() < 1e-4);
    assert_eq!(film.plane::<Vec3>(FilmPlane::Velocity).unwrap()[middle], velocities[0]);
    assert_eq!(film.plane::<Vec3>(FilmPlane::Albedo).unwrap()[middle].z, 0.3);
    assert_eq!(film.plane::<u32>(FilmPlane::Id).unwrap()[middle], 77);
    // A corner has no intersection.
    assert_eq!(film.plane::<f32>(FilmPlane::Depth).unwrap()[0], f32::INFINITY);
    assert_eq!(film.plane::<Vec3>(FilmPlane::Normal).unwrap()[0], Vec3::ZERO);
    assert_eq!(film.plane::<u32>(FilmPlane::Id).unwrap()[0], NO_ID);
    assert_eq!(film.color[0][3], 0.0);
}

#[test]
fn row_zero_is_the_top() {
    let mut scene = heap_scene(0.0);
    scene.ground = None;
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 20.0,
    };
    scene.camera = Camera::new(&view, 1.0, DVec3::ZERO).unwrap();
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    // Above and to the right of the centre.
    let ball = Balls::one(Vec3::new(1.0, 0.0, 1.0), 0.3);
    let (film, _) = render(&[&ball], &scene, &source, &RenderSettings::new(8, 8), &never).unwrap();
    let covered = |x: usize, y: usize| film.color[y * 8 + x][3] == 1.0;
    assert!(covered(6, 1) && !covered(6, 6) && !covered(1, 1));
}

#[test]
fn transparent_background_is_left_out() {
    let mut scene = heap_scene(0.0);
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    let settings = RenderSettings { transparent_background: true, ..settings() };
    let nothing = Balls(Vec::new());
    scene.ground = None;
    let (film, counts) = render(&[&nothing], &scene, &source, &settings, &never).unwrap();
    assert!(film.color.iter().all(|c| *c == [0.0; 4]));
    assert_eq!(counts.total(), counts.primary);
    let opaque = RenderSettings { transparent_background: false, ..settings };
    let (film, _) = render(&[&nothing], &scene, &source, &opaque, &never).unwrap();
    assert!(film.color.iter().all(|c| c[0] > 0.0 && c[3] == 0.0));
}

#[test]
fn interruption_and_bad_settings_are_errors() {
    let scene = heap_scene(0.0);
    let source = ParticleShading::constant(Vec3::ONE);
    let nothing = Balls(Vec::new());
    let raised = AtomicBool::new(true);
    let result = render(&[&nothing], &scene, &source, &settings(), &raised);
    assert_eq!(result.unwrap_err(), RenderError::Interrupted);
    let never = AtomicBool::new(false);
    for bad in [
        RenderSettings::new(0, 5),
        RenderSettings::new(5, MAX_SIDE + 1),
        RenderSettings { samples: 0, ..settings() },
        RenderSettings { max_depth: MAX_DEPTH + 1, ..settings() },
    ] {
        let result = render(&[&nothing], &scene, &source, &bad, &never);
        assert!(matches!(result, Err(RenderError::OutOfRange { .. })));
    }
    let mut wild = scene;
    wild.particle_material_mut().transmission = 2.0;
    let result = render(&[&nothing], &wild, &source, &settings(), &never);
    assert!(matches!(result, Err(RenderError::Material(_))));
}

/// A surface without its own packet methods.
struct OneByOne<'a>(SphereSurface<'a>);

impl Shape for OneByOne<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        self.0.crossing(ray, side)
    }

    fn transmittance(
        &self,
        rays: &RayPacket,
        lanes: u32,
        passed: &dyn Fn(f32, u32) -> f32,
        kept: &mut Lanes,
    ) {
        for lane in lanes_in(lanes) {
            self.0.transmittance(rays, 1 << lane, passed, kept);
        }
    }
}

#[test]
fn packets_make_the_same_film_as_single_rays() {
    let heap = heap(3000);
    let centers: Vec<Vec3> = heap.0.iter().map(|ball| ball.center).collect();
    let radii: Vec<f32> = heap.0.iter().map(|ball| 0.2 * ball.radius).collect();
    let source = ParticleShading::constant(Vec3::new(0.3, 0.5, 0.8));
    let never = AtomicBool::new(false);
    let mut builder = TreeBuilder::new();
    for radius in [SphereRadius::Common(0.05), SphereRadius::Each(&radii)] {
        let spheres = Spheres { centers: &centers, radius };
        builder.build(&spheres, &BuildSettings::default());
        let surface = SphereSurface::new(builder.tree().view());
        for (samples, transmission) in [(1, 0.0), (5, 0.0), (16, 0.0), (2, 0.8)] {
            let scene = heap_scene(transmission);
            let settings = RenderSettings { samples, ..settings() };
            let packets = render(&[&surface], &scene, &source, &settings, &never).unwrap();
            let single = OneByOne(surface);
            let singles = render(&[&single], &scene, &source, &settings, &never).unwrap();
            assert!(packets.1.shadow > 0 && packets.1.primary == 75 * 50 * u64::from(samples));
            assert_eq!(packets, singles, "{samples} samples, {transmission}");
        }
    }
}
