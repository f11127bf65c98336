use glam::Mat4;

use super::*;

/// The thesis's camera: eye at the origin, looking at (5, 5, 0), z up.
fn thesis_view() -> CameraView {
    CameraView { eye: DVec3::ZERO, look_at: DVec3::new(5.0, 5.0, 0.0), up: DVec3::Z, fov: 90.0 }
}

#[track_caller]
fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).length() < 1e-6, "{a} is not {b}");
}

#[test]
fn centre_and_corners() {
    let camera = Camera::new(&thesis_view(), 2.0, DVec3::ZERO).unwrap();
    let half = 0.5_f32.sqrt();
    assert_near(camera.ray(Vec2::splat(0.5)).direction, Vec3::new(half, half, 0.0));
    // fov 90 and aspect 2: corners at forward +- 2 right +- 1 up, right = (1, -1, 0) / sqrt 2.
    let (forward, right) = (Vec3::new(half, half, 0.0), Vec3::new(half, -half, 0.0));
    for (film, x, y) in [
        (Vec2::new(0.0, 0.0), -2.0, 1.0),
        (Vec2::new(1.0, 0.0), 2.0, 1.0),
        (Vec2::new(0.0, 1.0), -2.0, -1.0),
        (Vec2::new(1.0, 1.0), 2.0, -1.0),
    ] {
        let expected = (forward + x * right + y * Vec3::Z).normalize();
        assert_near(camera.ray(film).direction, expected);
    }
}

#[test]
fn far_from_zero_keeps_precision_and_the_matrix_is_in_world_units() {
    let far = DVec3::new(1e6, -2e6, 3e6);
    let view = CameraView {
        eye: far + DVec3::new(0.25, 0.0, 0.0),
        look_at: far + DVec3::new(0.25, 1.0, 0.0),
        ..thesis_view()
    };
    let camera = Camera::new(&view, 1.0, far).unwrap();
    assert_eq!(camera.eye(), Vec3::new(0.25, 0.0, 0.0));

    let near = CameraView {
        eye: DVec3::new(1.0, 2.0, 3.0),
        look_at: DVec3::new(1.0, 7.0, 3.0),
        ..thesis_view()
    };
    let matrix = Camera::new(&near, 1.0, far).unwrap().world_to_camera();
    // Looks along +y: x stays right, world z is up, depth is y - 2.
    let camera_point = Mat4::from_cols_array(&matrix).transform_point3(Vec3::new(2.0, 12.0, 7.0));
    assert_near(camera_point, Vec3::new(1.0, 4.0, 10.0));
    assert_eq!(&matrix[12..], &[-1.0, -3.0, -2.0, 1.0]);
}

#[test]
fn invalid_views_are_rejected() {
    let with = |change: fn(&mut CameraView)| {
        let mut view = thesis_view();
        change(&mut view);
        Camera::new(&view, 1.0, DVec3::ZERO).unwrap_err()
    };
    assert_eq!(with(|v| v.look_at = v.eye), CameraError::NoDirection);
    assert_eq!(with(|v| v.up = DVec3::ZERO), CameraError::NoUp);
    assert_eq!(with(|v| v.up = DVec3::new(-2.0, -2.0, 0.0)), CameraError::NoUp);
    assert_eq!(with(|v| v.fov = 180.0), CameraError::FieldOfView);
    assert_eq!(with(|v| v.fov = f64::NAN), CameraError::FieldOfView);
    assert_eq!(with(|v| v.eye.x = f64::NAN), CameraError::NotFinite);
    assert_eq!(with(|v| v.eye.x = -1e308), CameraError::TooFar);
    assert_eq!(with(|v| v.look_at.z = 1e39), CameraError::TooFar);
    let flat = Camera::new(&thesis_view(), 0.0, DVec3::ZERO).unwrap_err();
    assert_eq!(flat, CameraError::Aspect);
}

/// OpenEXR's matrices multiply row vectors from the right.
fn transformed(point: DVec3, matrix: [f32; 16]) -> DVec3 {
    let column = |c: usize| {
        let m = |r: usize| f64::from(matrix[4 * r + c]);
        point.x * m(0) + point.y * m(1) + point.z * m(2) + m(3)
    };
    DVec3::new(column(0), column(1), column(2)) / column(3)
}

#[test]
fn world_to_ndc_is_the_position_on_the_film() {
    let view = CameraView {
        eye: DVec3::new(3.0, -5.0, 2.0),
        look_at: DVec3::new(0.2, 0.1, 0.3),
        up: DVec3::Z,
        fov: 35.0,
    };
    for projection in [Projection::Perspective, Projection::Orthographic { height: 3.0 }] {
        let camera = Camera::projected(&view, projection, 1.5, DVec3::ZERO).unwrap();
        let matrix = camera.world_to_ndc().unwrap();
        for point in [DVec3::ZERO, DVec3::new(0.7, 0.4, -0.2), DVec3::new(-1.0, 2.0, 1.0)] {
            let on_film = camera.film_of(point.as_vec3()).unwrap().as_dvec2();
            let ndc = transformed(point, matrix);
            let expected = DVec3::new(2.0 * on_film.x - 1.0, 1.0 - 2.0 * on_film.y, ndc.z);
            assert!((ndc - expected).length() < 1e-5, "{ndc} {expected}");
            let depth = f64::from(camera.depth_of(point.as_vec3()));
            let z = if projection == Projection::Perspective { 1.0 - 1.0 / depth } else { depth };
            assert!((ndc.z - z).abs() < 1e-5, "{ndc} {z}");
        }
    }
    // The vertical field of view is that of the view; the width follows from the aspect
    let camera = Camera::new(&view, 1.5, DVec3::ZERO).unwrap();
    let [horizontal, vertical] = camera.field_of_view().unwrap();
    assert!((vertical - 35.0).abs() < 1e-4, "{vertical}");
    let tangent = |degrees: f32| (0.5 * degrees.to_radians()).tan();
    assert!((tangent(horizontal) / tangent(vertical) - 1.5).abs() < 1e-5);
    assert!((camera.screen_window_width().unwrap() - 2.0 * tangent(horizontal)).abs() < 1e-6);
    // A panorama and a pair of eyes have no such matrix
    let panorama = Camera::projected(&view, Projection::Equirectangular, 2.0, DVec3::ZERO).unwrap();
    let eyes = Stereo { half_distance: 0.1, convergence: 5.0 };
    for camera in [panorama, camera.with_stereo(Some(eyes))] {
        assert_eq!(camera.world_to_ndc(), None);
        assert_eq!((camera.field_of_view(), camera.screen_window_width()), (None, None));
    }
}
