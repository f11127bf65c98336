use super::*;
use crate::manifest::{CameraKey as Key, RadiusSetting, Side};
use crate::output::PreviewBackground;
use crate::pipeline::Setup;
use crate::render::IntegratorKind;
use crate::survey::Survey;

pub(in crate::resolve) fn survey() -> Survey {
    Survey {
        origin: DVec3::ZERO,
        min: DVec3::splat(-1.0),
        max: DVec3::splat(1.0),
        layers: None,
        is_flat: false,
        standing: None,
        bottom_standing: None,
        lowest: None,
        outline: None,
        cells: Vec::new(),
        radius: None,
        packed_radius: None,
        has_radii: false,
        reach: 0.0,
        styles: Vec::new(),
        color: None,
        rgb: None,
        points: Vec::new(),
        up: DVec3::Z,
        components: Vec::new(),
        frame_time: None,
        largest_time: None,
        frame_numbers: None,
        attributes: Vec::new(),
        labels: spherule_formats::Labels::new(),
        most_particles: 8,
        frames: 1,
        angstrom: 1.0,
        time_unit: None,
        weight: None,
        speed: None,
        surfaces: Vec::new(),
    }
}

fn key(frame: i64, eye: [f64; 3]) -> Key {
    Key { frame, eye: eye.into(), look_at: DVec3::ZERO, up: None, fov: None }
}

fn setup(change: impl FnOnce(&mut manifest::Camera)) -> Result<Setup, ResolveError> {
    let mut manifest = Manifest::new("in");
    manifest.render.integrator = Some(IntegratorKind::Whitted);
    manifest.input.radius = RadiusSetting::Length(0.1);
    manifest.image.width = Side::Pixels(64);
    manifest.image.height = Side::Pixels(36);
    manifest.output.transparent = true;
    change(&mut manifest.camera);
    super::super::setup(&manifest, &survey(), super::super::SceneInputs::default())
}

fn keyed_setup(keys: impl Into<Vec<Key>>) -> Result<Setup, ResolveError> {
    setup(|camera| {
        camera.mode = CameraMode::Keys;
        camera.keys = keys.into();
    })
}

#[test]
fn keys_inherit_missing_values_from_the_camera() {
    let setup = setup(|camera| {
        camera.mode = CameraMode::Keys;
        camera.up = Some(3.0 * DVec3::Y);
        camera.fov = 33.0;
        camera.keys = vec![key(1, [5.0, 0.0, 0.0]), key(2, [6.0, 0.0, 0.0])];
        camera.keys[1].up = Some(DVec3::Z);
        camera.keys[1].fov = Some(50.0);
    });
    let path = setup.unwrap().picture.view.path;
    assert_eq!((path.view(1).up, path.view(1).fov), (DVec3::Y, 33.0));
    assert_eq!((path.view(2).up, path.view(2).fov), (DVec3::Z, 50.0));
}

#[test]
fn each_frame_has_its_camera_and_all_have_the_same_light() {
    let setup = setup(|camera| {
        camera.mode = CameraMode::Turntable;
        camera.degrees_per_frame = 120.0;
    })
    .unwrap();
    check_views(&setup, [0, 1, 2, i64::MAX]).unwrap();
    let scenes = [0, 1].map(|frame| setup.scene_at(frame, None).unwrap());
    assert_eq!(scenes[0].camera, setup.picture.scene.camera);
    assert_ne!(scenes[1].camera, setup.picture.scene.camera);
    assert_eq!(scenes[1].camera, setup.camera_at(1).unwrap());
    assert_eq!(scenes[0].lights, scenes[1].lights);
    // The default lights depend on the camera of frame 0.
    let crate::scene::LightKind::Directional { to_light } = scenes[0].lights[0].kind else {
        panic!("the key light is directional");
    };
    let away = |frame: usize| -scenes[frame].camera.forward().dot(to_light);
    assert!(away(0) > 0.5 && away(1) < away(0));
}

#[test]
fn previews_of_older_jobs_have_a_background_that_follows_the_camera() {
    let keys = [key(1, [5.0, 0.0, -4.0]), key(2, [5.0, 0.0, 4.0])];
    let mut setup = keyed_setup(keys).unwrap();
    setup.picture.files.has_opaque_previews = true;
    let behind = |frame| {
        let camera = setup.camera_at(frame).unwrap();
        let shown = setup.preview_from(&camera).background;
        let color = setup.picture.scene.background.color(camera.forward());
        assert_eq!(shown, PreviewBackground::Color(color));
        shown
    };
    assert_ne!(behind(1), behind(2));
    setup.picture.files.has_opaque_previews = false;
    let camera = setup.camera_at(1).unwrap();
    let background = setup.preview_from(&camera).background;
    assert_eq!(background, PreviewBackground::Transparent);
}

#[test]
fn invalid_key_view_is_named() {
    let message = |keys: [Key; 2]| keyed_setup(keys).unwrap_err().to_string();
    assert_eq!(
        message([key(1, [5.0, 0.0, 0.0]), key(-7, [0.0, 0.0, 5.0])]),
        "camera.key: the key of frame -7: up is zero or points along the view; choose another camera.up"
    );
    assert_eq!(
        message([key(1, [5.0, 0.0, 0.0]), key(1, [6.0, 0.0, 5.0])]),
        "camera.key: two keys have frame 1; a frame has one view"
    );
    let mut over = [key(1, [5.0, 0.0, 0.0]), key(9, [5.0, 0.0, 0.0])];
    over[1].up = Some(DVec3::NEG_Z);
    let error = message(over);
    assert!(error.starts_with("camera.key: up turns upside down from frame 1 to frame 9"));
}

#[test]
fn invalid_frame_view_is_named() {
    // Paths through the point that the camera looks at, and vertically above it.
    for (eyes, what) in [
        ([[5.0, 0.0, 0.0], [-5.0, 0.0, 0.0]], "eye and look_at are the same point"),
        ([[5.0, 0.0, 5.0], [-5.0, 0.0, 5.0]], "up is zero or points along the view"),
    ] {
        let setup = keyed_setup([key(10, eyes[0]), key(20, eyes[1])]).unwrap();
        check_views(&setup, (0..15).chain(16..30)).unwrap();
        let error = check_views(&setup, 0..30).unwrap_err().to_string();
        let place = "camera.key: frame 15, between the keys of frames 10 and 20: ";
        assert!(error.starts_with(&[place, what].concat()), "{error}");
    }
}
