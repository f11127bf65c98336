//! Panes and holdouts in images, against values computed by hand.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{brute::Balls, solid::Solid, *};
use crate::scene::material::pane_reflectance;
use crate::scene::{
    Background, Camera, CameraView, Environment, Finish, Ground, Light, LightKind, Material,
};
use spherule_surface::mesh::{MeshNormals, MeshSurface, MeshTree, TriangleMesh, VisibleFaces};
use spherule_surface::{MaterialId, OwnedBody};

const CLEAR: Material = Material { finish: Finish::Pane, ..Material::matte(Vec3::ONE) };

const BROWN: Vec3 = Vec3::new(0.5, 0.25, 0.125);

const MATTE: Material = Material::matte(BROWN);

/// Looks along +y from a distance of 10, in front of `background`, in a constant environment.
fn scene(background: Vec3, environment: Vec3, meshes: &[Material]) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 2.0,
    };
    let mut scene = Scene {
        background: Background::Constant(background),
        environment: Some(Arc::new(Environment::constant(environment))),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    for mesh in meshes {
        scene.add(*mesh).unwrap();
    }
    scene
}

/// A square of side 2 around `center`, spanned by two unit vectors; its front is the side of `u` x `v`.
fn square(center: Vec3, u: Vec3, v: Vec3) -> MeshTree {
    let corners = vec![center - u - v, center + u - v, center + u + v, center - u + v];
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    MeshTree::new(TriangleMesh::new(corners, triangles, MeshNormals::Flat).unwrap())
}

/// A wall across the view at `y`.
fn wall(y: f32) -> MeshTree {
    square(Vec3::new(0.0, y, 0.0), Vec3::X, Vec3::Z)
}

/// A closed box from -2 to 2.
fn closed_box() -> MeshTree {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for (u, v) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)] {
        for side in [-1.0, 1.0] {
            let (center, first) = (side * u.cross(v), u32::try_from(vertices.len()).unwrap());
            let u = side * u;
            let corners = [center - u - v, center + u - v, center + u + v, center - u + v];
            vertices.extend(corners.map(|corner| 2.0 * corner));
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|i| first + i)));
        }
    }
    MeshTree::new(TriangleMesh::new(vertices, triangles, MeshNormals::Flat).unwrap())
}

fn settings(samples: u32, bounces: u32) -> RenderSettings {
    RenderSettings {
        samples,
        bounces,
        integrator: IntegratorKind::Path,
        channels: Channels::ALL,
        ..RenderSettings::new(8, 8)
    }
}

/// The image of `balls` of this albedo and of meshes with the materials of `scene`.
fn image(
    meshes: &[&MeshTree],
    balls: &Balls,
    albedo: f32,
    scene: &Scene,
    settings: &RenderSettings,
) -> Film {
    let meshes: Vec<MeshSurface<'_>> = (meshes.iter().enumerate())
        .map(|(i, tree)| {
            MeshSurface::new(
                tree,
                VisibleFaces::Both,
                MaterialId::at(MaterialId::BASIC + i).unwrap(),
            )
        })
        .collect();
    let mut shapes: Vec<&dyn Shape> = vec![balls];
    shapes.extend(meshes.iter().map(|mesh| mesh as &dyn Shape));
    let source = ParticleShading::constant(Vec3::splat(albedo));
    let never = AtomicBool::new(false);
    render(&shapes, scene, &source, settings, &never).unwrap().0
}

fn nothing() -> Balls {
    Balls(Vec::new())
}

fn mean(film: &Film) -> [f32; 4] {
    let pixels = film.color.len() as f32;
    std::array::from_fn(|i| film.color.iter().map(|c| c[i]).sum::<f32>() / pixels)
}

#[track_caller]
fn near(found: [f32; 4], wanted: [f32; 4], tolerance: f32) {
    let far = |(a, b): (&f32, &f32)| (a - b).abs() > tolerance;
    assert!(!found.iter().zip(&wanted).any(far), "{found:?} {wanted:?}");
}

#[test]
fn panes_attenuate_and_reflect() {
    let tint = Vec3::new(1.0, 0.5, 0.25);
    let tinted = Material { color: Some(tint), ..CLEAR };
    let (background, environment) = (Vec3::new(0.2, 0.4, 0.8), Vec3::splat(3.0));
    let scene = scene(background, environment, &[CLEAR, tinted]);
    let r = pane_reflectance(1.0);
    // Of two panes, the second is seen through the first. Light between them is lost after `max_depth` reflections
    let one = [0, 1, 2].map(|i| r * environment[i] + (1.0 - r) * background[i]);
    let film = image(&[&wall(0.0)], &nothing(), 0.5, &scene, &settings(1024, 0));
    near(mean(&film), [one[0], one[1], one[2], 1.0 * r], 2e-3);
    let two = [0, 1, 2].map(|i| {
        let (t, tinted) = (1.0 - r, tint[i]);
        let behind = (t * tinted) * background[i] + r * t * environment[i];
        r * environment[i] + t * behind
    });
    let walls = [&wall(0.0), &wall(1.0)];
    let film = image(&walls, &nothing(), 0.5, &scene, &settings(1024, 0));
    near(
        mean(&film)[..3].try_into().map(|[a, b, c]: [f32; 3]| [a, b, c, 0.0]).unwrap(),
        [two[0], two[1], two[2], 0.0],
        0.02,
    );
    // Whitted: without reflections, and without noise
    let whitted = RenderSettings { integrator: IntegratorKind::Whitted, ..settings(1, 0) };
    let film = image(&walls, &nothing(), 0.5, &scene, &whitted);
    let t = (1.0 - r) * (1.0 - r) * background * tint;
    near(mean(&film), [t.x, t.y, t.z, 0.0], 1e-4);
}

#[test]
fn clear_panes_neither_gain_nor_lose_light() {
    let mut scene = scene(Vec3::ZERO, Vec3::ONE, &[CLEAR, CLEAR]);
    scene.is_environment_visible = true;
    let film = image(&[&closed_box()], &nothing(), 0.5, &scene, &settings(64, 0));
    assert!(film.color.iter().all(|c| (c[0] - 1.0).abs() < 1e-5));
    // A white ball in the box: shadow rays and rays of its BSDF pass the panes, and both are weighted alike
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let film = image(&[&closed_box()], &ball, 1.0, &scene, &settings(1024, 200));
    near(mean(&film), [1.0, 1.0, 1.0, 1.0], 0.01);
}

#[test]
fn data_are_of_what_is_behind_a_pane() {
    let scene = scene(Vec3::ZERO, Vec3::ONE, &[CLEAR]);
    let ball = Balls::one(Vec3::ZERO, 1.0);
    let [without, with] = [vec![], vec![&closed_box()]]
        .map(|meshes| image(&meshes, &ball, 0.5, &scene, &settings(16, 0)));
    assert_eq!(with.plane::<u32>(FilmPlane::Id), without.plane::<u32>(FilmPlane::Id));
    assert_eq!(
        with.plane::<Vec3>(FilmPlane::Normal).unwrap().len(),
        without.plane::<Vec3>(FilmPlane::Normal).unwrap().len()
    );
    let (with, without) = (
        with.plane::<f32>(FilmPlane::Depth).unwrap(),
        without.plane::<f32>(FilmPlane::Depth).unwrap(),
    );
    let far = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-3;
    assert!(!with.iter().zip(without).any(far), "{with:?} {without:?}");
}

/// A matte wall at y = 2, lit from the side of the camera.
fn lit(meshes: &[Material]) -> Scene {
    let mut scene = scene(Vec3::ONE, Vec3::ZERO, meshes);
    scene.lights = vec![Light {
        kind: LightKind::Directional { to_light: Vec3::new(0.6, -0.8, 0.0) },
        radiance: Vec3::ONE,
        casts_shadow: true,
        is_visible: false,
        group: 0,
    }];
    scene
}

#[test]
fn meshes_are_lit_and_panes_attenuate_shadow_rays() {
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let settings = RenderSettings { integrator, ..settings(1, 0) };
        let scene = lit(&[MATTE, CLEAR]);
        // The light falls at 36.9 degrees; Whitted adds ambient light
        let matte = match integrator {
            IntegratorKind::Path => 0.8 * FRAC_1_PI * BROWN,
            IntegratorKind::Whitted => (0.2 + 0.7 * 0.8) * BROWN,
        };
        let film = image(&[&wall(2.0)], &nothing(), 0.5, &scene, &settings);
        near(mean(&film), [matte.x, matte.y, matte.z, 1.0], 1e-4);
        assert!(film.plane::<u32>(FilmPlane::Id).unwrap().iter().all(|id| *id == NO_ID));
        assert!(
            film.plane::<f32>(FilmPlane::Depth).unwrap().iter().all(|z| (z - 12.0).abs() < 1e-4)
        );
        assert!(
            film.plane::<Vec3>(FilmPlane::Normal)
                .unwrap()
                .iter()
                .all(|n| (*n - Vec3::NEG_Y).length() < 1e-6)
        );
        // Beside the view: only the light passes it
        let beside = square(Vec3::new(1.5, 0.0, 0.0), Vec3::X, Vec3::Z);
        let film = image(&[&wall(2.0), &beside], &nothing(), 0.5, &scene, &settings);
        let t = 1.0 - pane_reflectance(0.8);
        let ambient = match integrator {
            IntegratorKind::Path => Vec3::ZERO,
            IntegratorKind::Whitted => 0.2 * BROWN,
        };
        let matte = ambient + t * (matte - ambient);
        near(mean(&film), [matte.x, matte.y, matte.z, 1.0], 1e-4);
        // An opaque mesh there throws a shadow
        let scene = lit(&[MATTE, MATTE]);
        let film = image(&[&wall(2.0), &beside], &nothing(), 0.5, &scene, &settings);
        near(mean(&film), [ambient.x, ambient.y, ambient.z, 1.0], 1e-4);
    }
}

#[test]
fn holdouts_are_holes_that_throw_shadows() {
    let holdout = Material { is_holdout: true, ..MATTE };
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let settings = RenderSettings { integrator, ..settings(4, 1) };
        // It hides the wall and the ball behind it, and the background
        let ball = Balls::one(Vec3::Y, 0.5);
        let scene = lit(&[MATTE, holdout]);
        let film = image(&[&wall(2.0), &wall(0.0)], &ball, 0.5, &scene, &settings);
        assert!(film.color.iter().all(|c| *c == [0.0; 4]));
        assert!(
            film.plane::<f32>(FilmPlane::Depth).unwrap().iter().all(|z| (z - 10.0).abs() < 1e-4)
        );
        // Beside the view, it does what an opaque mesh does
        let beside = square(Vec3::new(1.5, 0.0, 0.0), Vec3::X, Vec3::Z);
        let [held, shown] = [lit(&[MATTE, holdout]), lit(&[MATTE, MATTE])]
            .map(|scene| image(&[&wall(2.0), &beside], &nothing(), 0.5, &scene, &settings));
        assert_eq!(held.color, shown.color);
        assert!(held.color.iter().all(|c| c[3] == 1.0));
    }
}

/// A shadow catcher across the view at y = 5.
fn catcher() -> Ground {
    Ground {
        up: Vec3::NEG_Y,
        height: -5.0,
        color: Vec3::splat(0.5),
        center: Vec3::new(0.0, 5.0, 0.0),
        base: Vec3::ZERO,
        fade_start: 1e3,
        fade_end: 2e3,
        lit_range: 1e3,
        pattern: crate::scene::ground::Pattern::Plain,
        shadow_catcher: Some(1.0),
    }
}

#[test]
fn a_shadow_catcher_is_seen_through_panes() {
    let mut scene = scene(Vec3::ONE, Vec3::ZERO, &[CLEAR]);
    scene.ground = Some(catcher());
    let film = image(&[&wall(0.0)], &nothing(), 0.5, &scene, &settings(1024, 0));
    let t = 1.0 - pane_reflectance(1.0);
    near(mean(&film), [t, t, t, 1.0 - t], 2e-3);
}

/// The image of a ball of radius 2 around the origin whose surface is a pane of this colour.
fn image_of_body(color: Vec3, scene: &mut Scene, settings: &RenderSettings) -> Film {
    let material = scene.add(Material { finish: Finish::Pane, ..Material::matte(color) }).unwrap();
    let body = OwnedBody::new(Box::new(Solid::ball(2.0)), material, 0);
    let balls = nothing();
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    render(&[&balls, &body], scene, &source, settings, &never).unwrap().0
}

#[test]
fn light_passes_both_sides_of_a_body_of_thin_glass() {
    let mut scene = scene(Vec3::ONE, Vec3::ZERO, &[]);
    let settings = RenderSettings { integrator: IntegratorKind::Whitted, ..settings(1, 0) };
    let mean = mean(&image_of_body(BROWN, &mut scene, &settings));
    // One side reflects 4 %
    let expected = (0.96 * BROWN).powf(2.0);
    assert!((Vec3::from_slice(&mean[..3]) - expected).abs().max_element() < 1e-3, "{mean:?}");
}

#[test]
fn a_body_of_thin_glass_loses_no_light() {
    let mut scene = scene(Vec3::ONE, Vec3::ONE, &[]);
    // Light between the two sides is reflected from inside
    let mean = mean(&image_of_body(Vec3::ONE, &mut scene, &settings(64, 16)));
    assert!(mean[..3].iter().all(|light| (light - 1.0).abs() < 1e-3), "{mean:?}");
}

/// Clear glass behind everything else.
const UNDERLAY: Material = Material { is_underlay: true, ..CLEAR };

#[test]
fn underlays_leave_other_things_as_they_are() {
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let settings = RenderSettings { integrator, ..settings(4, 2) };
        let [with, without] = [lit(&[UNDERLAY]), lit(&[])].map(|mut scene| {
            scene.environment = Some(Arc::new(Environment::constant(Vec3::ONE)));
            let glass = closed_box();
            let glass = if scene.materials.len() > MaterialId::BASIC { &[&glass][..] } else { &[] };
            // The ball covers the picture, in front of one side of the box and behind the other
            image(glass, &Balls::one(Vec3::ZERO, 1.0), 0.5, &scene, &settings)
        });
        assert_eq!(with.color, without.color);
        assert!(with.color.iter().all(|c| c[0] > 0.0 && c[3] == 1.0));
        let depth = |film: &Film| film.plane::<f32>(FilmPlane::Depth).unwrap().to_vec();
        assert_eq!(depth(&with), depth(&without));
    }
}

#[test]
fn underlays_attenuate_and_reflect_without_noise() {
    let tint = Vec3::new(1.0, 0.5, 0.25);
    let (background, light) = (Vec3::new(0.2, 0.4, 0.8), Vec3::splat(3.0));
    let scene = scene(background, light, &[UNDERLAY, Material { color: Some(tint), ..UNDERLAY }]);
    let r = pane_reflectance(1.0);
    let reflected = r * light + (1.0 - r) * r * light;
    let transmittance = (1.0 - r) * (1.0 - r) * tint;
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let reflected = match integrator {
            IntegratorKind::Path => reflected,
            IntegratorKind::Whitted => Vec3::ZERO,
        };
        for transparent_background in [false, true] {
            let settings = RenderSettings { integrator, transparent_background, ..settings(1, 0) };
            let film = image(&[&wall(0.0), &wall(1.0)], &nothing(), 0.5, &scene, &settings);
            let passing = transmittance.dot(Vec3::new(0.2126, 0.7152, 0.0722));
            let (seen, alpha) = if transparent_background {
                (reflected, 1.0 - passing)
            } else {
                (reflected + transmittance * background, 0.0)
            };
            near(mean(&film), [seen.x, seen.y, seen.z, alpha], 2e-4);
        }
    }
}

#[test]
fn underlays_are_in_front_of_a_shadow_catcher() {
    let mut scene = scene(Vec3::ONE, Vec3::ZERO, &[UNDERLAY, UNDERLAY]);
    scene.ground = Some(catcher());
    // The second one is behind it
    let film = image(&[&wall(0.0), &wall(6.0)], &nothing(), 0.5, &scene, &settings(1, 0));
    let t = 1.0 - pane_reflectance(1.0);
    near(mean(&film), [t, t, t, 0.0], 2e-4);
}
