//! Projections and stereo pairs against rays and intersections that are computed by hand in f64.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::shading::CameraLanes;
use super::*;
use crate::scene::{
    Background, Camera, CameraView, Convergence, Material, Projection, StereoSettings,
};
use spherule_surface::spheres::SphereSurface;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};

/// Size of the image of an eye.
const SIZE: [u32; 2] = [60, 40];
const RADIUS: f32 = 0.25;

const EYE: DVec3 = DVec3::new(1.0, -6.0, 0.5);
const LOOK_AT: DVec3 = DVec3::new(0.5, 0.0, 0.0);
const ORTHOGRAPHIC: Projection = Projection::Orthographic { height: 5.0 };

fn view() -> CameraView {
    CameraView { eye: EYE, look_at: LOOK_AT, up: DVec3::Z, fov: 50.0 }
}

fn camera(projection: Projection, stereo: Option<StereoSettings>) -> Camera {
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let camera = Camera::projected(&view(), projection, aspect, DVec3::ZERO).unwrap();
    camera.with_stereo(stereo.map(|stereo| stereo.stereo(&view()).unwrap()))
}

/// Origin and unit direction of the ray through a position of the film of an eye, from the definitions. `side` is -1
/// for the left eye, 1 for the right one.
fn ray_by_hand(
    projection: Projection,
    stereo: Option<StereoSettings>,
    side: f64,
    film: DVec2,
) -> [DVec3; 2] {
    let forward = (LOOK_AT - EYE).normalize();
    let right = forward.cross(DVec3::Z).normalize();
    let up = right.cross(forward);
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let (x, y) = (2.0 * film.x - 1.0, 1.0 - 2.0 * film.y);
    let half = stereo
        .map_or(0.0, |stereo| 0.5 * stereo.eye_distance.unwrap_or((LOOK_AT - EYE).length() / 30.0));
    match projection {
        Projection::Perspective => {
            let tangent = 25.0_f64.to_radians().tan();
            let through = forward + x * aspect * tangent * right + y * tangent * up;
            let eye = EYE + side * half * right;
            let direction = match stereo.map(|stereo| stereo.convergence) {
                None | Some(Convergence::Parallel) => through,
                // Both eyes see the same point at this distance along the axis
                Some(Convergence::Target) => EYE + (LOOK_AT - EYE).length() * through - eye,
                Some(Convergence::Distance(distance)) => EYE + distance * through - eye,
            };
            [eye, direction.normalize()]
        }
        Projection::Orthographic { height } => {
            let origin = EYE + 0.5 * height * (x * aspect * right + y * up);
            [origin, forward]
        }
        Projection::Equirectangular => {
            let level = DVec3::new(forward.x, forward.y, 0.0).normalize();
            let (longitude, latitude) = (PI * x, 0.5 * PI * y);
            let ahead = longitude.cos() * level + longitude.sin() * right;
            let beside = longitude.cos() * right - longitude.sin() * level;
            let direction = latitude.cos() * ahead + latitude.sin() * DVec3::Z;
            [EYE + side * half * beside, direction]
        }
    }
}

/// Cameras of all kinds.
fn cameras() -> Vec<(Projection, Option<StereoSettings>)> {
    let stereo = |eye_distance, convergence| Some(StereoSettings { eye_distance, convergence });
    vec![
        (Projection::Perspective, None),
        (ORTHOGRAPHIC, None),
        (Projection::Equirectangular, None),
        (Projection::Perspective, stereo(None, Convergence::Target)),
        (Projection::Perspective, stereo(Some(0.5), Convergence::Parallel)),
        (Projection::Perspective, stereo(Some(0.4), Convergence::Distance(4.0))),
        (Projection::Equirectangular, stereo(Some(0.5), Convergence::Parallel)),
    ]
}

#[test]
fn rays_of_single_points_are_those_by_hand() {
    for projection in [Projection::Perspective, ORTHOGRAPHIC, Projection::Equirectangular] {
        let camera = camera(projection, None);
        for (x, y) in [(0.0, 0.0), (0.1, 0.9), (0.5, 0.5), (0.77, 0.3), (1.0, 1.0)] {
            let ray = camera.ray(Vec2::new(x, y));
            let film = DVec2::new(f64::from(x), f64::from(y));
            let [origin, direction] = ray_by_hand(projection, None, 0.0, film);
            assert!(ray.origin.as_dvec3().distance(origin) < 1e-5, "{projection:?} {film}");
            assert!(ray.direction.as_dvec3().distance(direction) < 1e-5, "{projection:?} {film}");
        }
    }
}

#[test]
fn points_are_projected_onto_their_rays() {
    for projection in [Projection::Perspective, ORTHOGRAPHIC, Projection::Equirectangular] {
        let camera = camera(projection, None);
        let lanes = CameraLanes::new(&camera, SIZE[0], SIZE[1]);
        for (x, y) in [(0.2, 0.3), (0.5, 0.5), (0.93, 0.71), (0.05, 0.9)] {
            let film = Vec2::new(x, y);
            let ray = camera.ray(film);
            for distance in [0.5, 7.0] {
                let point = ray.origin + distance * ray.direction;
                let found = camera.film_of(point).unwrap();
                assert!(found.distance(film) < 1e-5, "{projection:?}: {film} {found}");
                let pixel = Vec2::from(lanes.pixel_of(point).unwrap());
                let wanted = film * Vec2::new(SIZE[0] as f32, SIZE[1] as f32);
                assert!(pixel.distance(wanted) < 1e-3, "{projection:?}: {wanted} {pixel}");
            }
        }
        // Only a panorama shows what is behind the camera
        let behind = EYE.as_vec3() - (LOOK_AT - EYE).as_vec3();
        assert_eq!(camera.film_of(behind).is_some(), projection.is_panorama());
    }
}

/// Small spheres around the cameras.
fn centers() -> Vec<Vec3> {
    let unit = |i: u32| (i.wrapping_mul(0x9e37_79b9) >> 8) as f32 / 16_777_216.0;
    let center = |i: u32| {
        let (a, b, c) = (unit(3 * i + 1), unit(7 * i + 5), unit(11 * i + 3));
        Vec3::new(6.0 * a - 2.5, 14.0 * b - 12.0, 5.0 * c - 2.5)
    };
    let all = (0..250).map(center);
    all.filter(|center| center.distance(EYE.as_vec3()) > 1.0).collect()
}

/// The nearest sphere by brute force, its distance along the ray, and whether rounding may decide which one it is.
fn nearest(centers: &[Vec3], [origin, direction]: [DVec3; 2]) -> (Option<(usize, f64)>, bool) {
    let (mut best, mut is_close) = (None, false);
    for (index, center) in centers.iter().enumerate() {
        let to_center = center.as_dvec3() - origin;
        let middle = to_center.dot(direction);
        let away = (to_center - middle * direction).length();
        let radius = f64::from(RADIUS);
        is_close |= (away - radius).abs() < 1e-4;
        if away >= radius {
            continue;
        }
        // A ray that starts in a sphere leaves it
        let half = (radius * radius - away * away).sqrt();
        let entry = middle - half;
        let t = if entry >= 0.0 { entry } else { middle + half };
        is_close |= entry.abs() < 1e-4;
        if t >= 0.0 && best.is_none_or(|(_, nearest)| t < nearest) {
            is_close |= best.is_some_and(|(_, nearest): (usize, f64)| nearest - t < 1e-4);
            best = Some((index, t));
        }
    }
    (best, is_close)
}

fn film(
    camera: Camera,
    shape: &dyn Shape,
    ids: &[u32],
    change: impl Fn(&mut RenderSettings),
) -> Film {
    let [columns, rows] = camera.eyes();
    let mut settings = RenderSettings {
        channels: Channels::ALL,
        ..RenderSettings::new(columns * SIZE[0], rows * SIZE[1])
    };
    change(&mut settings);
    let scene = Scene {
        materials: Scene::basic_materials(Material {
            ambient: 1.0,
            diffuse: 0.0,
            specular: 0.0,
            reflection: 0.0,
            ..Material::DEFAULT
        }),
        background: Background::Studio { up: Vec3::Z },
        environment: Some(std::sync::Arc::new(crate::scene::Environment::constant(Vec3::ONE))),
        ..Scene::new(camera)
    };
    let source = ParticleShading { ids: Some(ids), ..ParticleShading::constant(Vec3::ONE) };
    let never = AtomicBool::new(false);
    let rendered = render(&[shape], &scene, &source, &settings, &never);
    rendered.unwrap().0
}

/// Calls `check` with a tree over [`centers`].
fn with_tree(check: impl Fn(&dyn Shape, &[u32], &[Vec3])) {
    let centers = centers();
    let spheres = Spheres { centers: &centers, radius: SphereRadius::Common(RADIUS) };
    let mut builder = TreeBuilder::new();
    let settings = BuildSettings { keep_indices: true, ..BuildSettings::default() };
    builder.build(&spheres, &settings);
    let ids: Vec<u32> = (0..).map(|i| 3 * i + 7).take(centers.len()).collect();
    check(&SphereSurface::new(builder.tree().view()), &ids, &centers);
}

// 14 images: the ray of each pixel meets all spheres in f64.
#[test]
fn every_pixel_shows_the_sphere_that_its_ray_hits_in_f64() {
    with_tree(|tree, ids, centers| {
        let forward = (LOOK_AT - EYE).normalize();
        for (projection, stereo) in cameras() {
            for integrator in [IntegratorKind::Whitted, IntegratorKind::Path] {
                let camera = camera(projection, stereo);
                let [columns, _] = camera.eyes();
                let film = film(camera, tree, ids, |s| s.integrator = integrator);
                let (depth, id) = (
                    film.plane::<f32>(FilmPlane::Depth).unwrap(),
                    film.plane::<u32>(FilmPlane::Id).unwrap(),
                );
                let mut hits = [0; 2];
                for (index, (z, id)) in depth.iter().zip(id).enumerate() {
                    let width = (columns * SIZE[0]) as usize;
                    let (column, row) = (index % width, index / width);
                    let [w, h] = SIZE.map(|side| side as usize);
                    let eye = usize::from(column >= w || row >= h);
                    let side = match (stereo, eye) {
                        (None, _) => 0.0,
                        (Some(_), 0) => -1.0,
                        _ => 1.0,
                    };
                    let at = DVec2::new((column % w) as f64 + 0.5, (row % h) as f64 + 0.5);
                    let ray =
                        ray_by_hand(projection, stereo, side, at / DVec2::new(w as f64, h as f64));
                    let (wanted, is_close) = nearest(centers, ray);
                    if is_close {
                        continue;
                    }
                    let place = format!("{projection:?} {stereo:?}: {column} {row}");
                    let Some((particle, t)) = wanted else {
                        assert_eq!(*id, NO_ID, "{place}");
                        continue;
                    };
                    hits[eye] += 1;
                    assert_eq!(*id, ids[particle], "{place}");
                    let wanted_z = match projection {
                        Projection::Perspective => t * ray[1].dot(forward),
                        _ => t,
                    };
                    assert!((f64::from(*z) - wanted_z).abs() < 1e-3, "{place}: {z} {wanted_z}");
                }
                let eyes = 1 + usize::from(stereo.is_some());
                assert!(hits[..eyes].iter().all(|count| *count > 100), "{hits:?}");
            }
        }
    });
}

/// The left and the right image of a parallel pair are those of two cameras.
#[test]
fn a_stereo_pair_is_two_images() {
    with_tree(|tree, ids, _| {
        let settings =
            StereoSettings { eye_distance: Some(0.5), convergence: Convergence::Parallel };
        let pair = film(camera(Projection::Perspective, Some(settings)), tree, ids, |_| {});
        let right = (LOOK_AT - EYE).cross(DVec3::Z).normalize();
        for (eye, side) in [(0, -0.25), (1, 0.25)] {
            let shift = side * right;
            let view = CameraView { eye: EYE + shift, look_at: LOOK_AT + shift, ..view() };
            let one = Camera::new(&view, 1.5, DVec3::ZERO).unwrap();
            let one = film(one, tree, ids, |_| {});
            let (mut differing, width) = (0, SIZE[0] as usize);
            for (index, id) in one.plane::<u32>(FilmPlane::Id).unwrap().iter().enumerate() {
                let (column, row) = (index % width, index / width);
                let in_pair = row * 2 * width + eye * width + column;
                differing += usize::from(pair.plane::<u32>(FilmPlane::Id).unwrap()[in_pair] != *id);
                // The backdrop is infinitely far away, where both eyes see the same
                if pair.color[in_pair][3] == 0.0 && one.color[index][3] == 0.0 {
                    let (a, b) = (pair.color[in_pair], one.color[index]);
                    assert!((a[0] - b[0]).abs() < 1e-5, "{column} {row}: {a:?} {b:?}");
                }
            }
            // Rounding of the origin may decide at outlines
            assert!(differing < 4, "{differing}");
        }
    });
}

/// The part of a picture that crop and overscan select does not depend on the projection.
#[test]
fn parts_of_images_are_those_of_the_whole() {
    with_tree(|tree, ids, _| {
        for projection in [ORTHOGRAPHIC, Projection::Equirectangular] {
            let samples = |s: &mut RenderSettings| s.samples = 4;
            let whole = film(camera(projection, None), tree, ids, samples);
            let part = film(camera(projection, None), tree, ids, |s| {
                samples(s);
                (s.width, s.height) = (20, 10);
                s.window = Some(DataWindow { left: 17, top: 9, image: SIZE });
            });
            for (index, color) in part.color.iter().enumerate() {
                let (column, row) = (17 + index % 20, 9 + index / 20);
                assert_eq!(*color, whole.color[row * SIZE[0] as usize + column]);
            }
        }
    });
}
