use glam::Mat4;

use super::*;

/// The thesis's camera: eye at the origin, looking at (5, 5, 0), z up.
fn thesis_view() -> CameraView {
    CameraView {
        eye: DVec3::ZERO,
        look_at: DVec3::new(5.0, 5.0, 0.0),
        up: DVec3::Z,
        fov: 90.0,
    }
}

#[track_caller]
fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).length() < 1e-6, "{a} is not {b}");
}

#[test]
fn centre_and_corners() {
    let camera = Camera::new(&thesis_view(), 2.0, DVec3::ZERO).unwrap();
    let half = 0.5_f32.sqrt();
    assert_near(
        camera.ray(Vec2::splat(0.5)).direction,
        Vec3::new(half, half, 0.0),
    );
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
    assert_eq!(
        with(|v| v.up = DVec3::new(-2.0, -2.0, 0.0)),
        CameraError::NoUp
    );
    assert_eq!(with(|v| v.fov = 180.0), CameraError::FieldOfView);
    assert_eq!(with(|v| v.fov = f64::NAN), CameraError::FieldOfView);
    assert_eq!(with(|v| v.eye.x = f64::NAN), CameraError::NotFinite);
    assert_eq!(with(|v| v.eye.x = -1e308), CameraError::TooFar);
    assert_eq!(with(|v| v.look_at.z = 1e39), CameraError::TooFar);
    let flat = Camera::new(&thesis_view(), 0.0, DVec3::ZERO).unwrap_err();
    assert_eq!(flat, CameraError::Aspect);
}

/// Film coordinates of a world point, -1 to 1.
fn project(view: &CameraView, aspect: f64, point: DVec3) -> DVec2 {
    let camera = Camera::new(view, aspect, DVec3::ZERO).unwrap();
    let p = camera.camera_from_world.transform_point3(point);
    assert!(p.z > 0.0, "{point} is behind the camera");
    DVec2::new(p.x, p.y) / (p.z * camera.half_extent.as_dvec2())
}

#[test]
fn framing_fits_every_corner_and_wastes_nothing() {
    let boxes = [
        (DVec3::new(3.0, 5.0, -2.0), DVec3::new(7.0, 8.0, 2.0)),
        (
            DVec3::new(-1e4, 1e5, 0.0),
            DVec3::new(-1e4 + 1e-3, 1e5 + 1.0, 0.01),
        ),
        (DVec3::ZERO, DVec3::new(1.0, 0.0, 0.0)),
    ];
    for (min, max) in boxes {
        for up in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 2.0, 3.0)] {
            for aspect in [0.5, 1.0, 16.0 / 9.0] {
                for azimuth in [0.0, 30.0, 200.0] {
                    let bounds = Bounds { min, max };
                    let framing = Framing {
                        azimuth,
                        ..Framing::three_quarter(up, aspect)
                    };
                    let view = Camera::framing(&bounds, &framing);
                    let projected = bounds.corners().map(|c| project(&view, aspect, c).abs());
                    let far = projected.iter().fold(DVec2::ZERO, |a, b| a.max(*b));
                    let limit = 1.0 - FRAMING_MARGIN;
                    assert!(
                        (far.max_element() - limit).abs() < 1e-4,
                        "{far} {framing:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn framing_looks_down_with_up_on_top() {
    let bounds = Bounds {
        min: DVec3::ZERO,
        max: DVec3::ONE,
    };
    for up in [DVec3::Y, DVec3::Z] {
        let view = Camera::framing(&bounds, &Framing::three_quarter(up, 1.0));
        assert!((view.eye - view.look_at).dot(up) > 0.0);
        let low = project(&view, 1.0, bounds.center());
        let high = project(&view, 1.0, bounds.center() + 0.5 * up);
        assert!(high.y > low.y && (high.x - low.x).abs() < 0.05);
    }
    // A front view with z up looks along +y, with x to the right.
    let front = Framing {
        azimuth: 0.0,
        elevation: 0.0,
        ..Framing::three_quarter(DVec3::Z, 1.0)
    };
    let view = Camera::framing(&bounds, &front);
    assert!((view.look_at - view.eye).normalize().y > 0.999_999);
    assert!(project(&view, 1.0, DVec3::ONE).x > 0.0);
}

#[test]
fn framing_a_point_gives_a_camera() {
    for at in [DVec3::ZERO, DVec3::splat(1e7)] {
        let bounds = Bounds { min: at, max: at };
        let view = Camera::framing(&bounds, &Framing::three_quarter(DVec3::Z, 1.0));
        assert!(Camera::new(&view, 1.0, at).is_ok());
    }
}
