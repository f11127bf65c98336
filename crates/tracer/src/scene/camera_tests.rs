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
