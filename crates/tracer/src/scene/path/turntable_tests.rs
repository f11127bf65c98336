use glam::{DVec2, DVec3};
use proptest::prelude::*;

use super::*;
use crate::scene::framing::BOX_MARGIN;
use crate::scene::{Bounds, Camera, CameraPath};

const BOX: Bounds = Bounds { min: DVec3::new(3.0, 5.0, -2.0), max: DVec3::new(7.0, 8.0, 2.0) };

#[test]
fn frame_0_of_a_turntable_is_at_its_azimuth() {
    let framing = Framing { azimuth: 0.0, elevation: 0.0, ..Framing::three_quarter(DVec3::Z, 1.0) };
    let path = CameraPath::turntable(&Framed::corners(&BOX), &framing, 90.0);
    let toward = |frame| {
        let view = path.view(frame);
        assert_eq!(view.look_at, DVec3::new(5.0, 6.5, 0.0));
        (view.look_at - view.eye).normalize()
    };
    let near = |a: DVec3, b: DVec3| assert!(a.distance(b) < 1e-12, "{a} is not {b}");
    near(toward(0), DVec3::Y);
    near(toward(1), DVec3::NEG_X);
    near(toward(2), DVec3::NEG_Y);
    near(toward(-1), DVec3::X);
    near(toward(401), DVec3::NEG_X);
    // 2^63 quarters are whole turns.
    near(toward(i64::MIN), DVec3::Y);
    assert_eq!(path.start(), path.view(0));
    // Equal to the automatic camera with that azimuth.
    let auto = Framed::corners(&BOX).view(&Framing { azimuth: 90.0, ..framing });
    near(toward(1), (auto.look_at - auto.eye).normalize());
}

#[test]
fn distant_frame_numbers_rotate_alike() {
    let framing = Framing::three_quarter(DVec3::Y, 1.5);
    let path = CameraPath::turntable(&Framed::corners(&BOX), &framing, 0.703125);
    for frame in [0, 1, -77, 300] {
        // 512 frames are a turn, exactly.
        let far = frame + 512 * (1 << 53);
        assert_eq!(path.view(far), path.view(frame), "{frame}");
    }
    for degrees in [1e300, -1e300, 1e-300, 359.999] {
        let path = CameraPath::turntable(&Framed::corners(&BOX), &framing, degrees);
        for frame in [i64::MIN, -1, 1, i64::MAX] {
            assert!(path.view(frame).eye.is_finite(), "{degrees} {frame}");
        }
    }
    assert!(CameraPath::turntable(&Framed::corners(&BOX), &framing, -720.0).moving().is_empty());
}

/// Film coordinates of a world point, -1 to 1, computed independently.
fn project(view: &CameraView, aspect: f64, point: DVec3) -> DVec2 {
    let forward = (view.look_at - view.eye).normalize();
    let right = forward.cross(view.up).normalize();
    let up = right.cross(forward);
    let offset = point - view.eye;
    let depth = offset.dot(forward);
    assert!(depth > 0.0, "{point} is behind the camera");
    let half = (0.5 * view.fov.to_radians()).tan();
    DVec2::new(offset.dot(right) / aspect, offset.dot(up)) / (depth * half)
}

/// The outermost position of a corner in all pictures of a turn.
fn outermost(path: &CameraPath, bounds: &Bounds, aspect: f64, frames: i64) -> f64 {
    let mut most = 0.0_f64;
    for frame in 0..frames {
        for corner in bounds.corners() {
            let at = project(&path.view(frame), aspect, corner).abs();
            most = most.max(at.max_element());
        }
    }
    most
}

#[test]
fn turntable_distance_is_minimal() {
    for up in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 2.0, 3.0)] {
        for (elevation, aspect) in [(20.0, 1.5), (-35.0, 0.5), (80.0, 1.0), (0.0, 4.0)] {
            let framing = Framing { elevation, ..Framing::three_quarter(up, aspect) };
            let path = CameraPath::turntable(&Framed::corners(&BOX), &framing, 0.25);
            let most = outermost(&path, &BOX, aspect, 1440);
            let limit = 1.0 - BOX_MARGIN;
            assert!((most - limit).abs() < 1e-4, "{most} {framing:?}");
        }
    }
}

#[test]
fn turntable_around_a_point_or_a_line_is_valid() {
    for (min, max) in [
        (DVec3::ZERO, DVec3::ZERO),
        (DVec3::splat(1e7), DVec3::splat(1e7)),
        (DVec3::ZERO, DVec3::new(0.0, 0.0, 4.0)),
        (DVec3::ZERO, DVec3::new(0.0, 3.0, 0.0)),
    ] {
        let bounds = Bounds { min, max };
        for elevation in [-90.0, -60.0, 0.0, 75.0, 90.0] {
            let framing = Framing { elevation, ..Framing::three_quarter(DVec3::Z, 1.0) };
            let path = CameraPath::turntable(&Framed::corners(&bounds), &framing, 10.0);
            for frame in 0..36 {
                let camera = Camera::new(&path.view(frame), 1.0, min);
                assert!(camera.is_ok(), "{bounds:?} {elevation}");
            }
        }
    }
}

proptest! {
    #[test]
    fn a_turntable_shows_everything_from_one_distance(
        min in prop::array::uniform3(-50.0..50.0),
        size in prop::array::uniform3(0.0..20.0),
        up in prop::array::uniform3(-1.0..1.0),
        azimuth in -400.0..400.0,
        elevation in -90.0..=90.0,
        (fov, aspect) in (1.0..170.0, 0.1..10.0),
        degrees in -400.0..400.0,
        frames in prop::collection::vec(any::<i64>(), 12),
    ) {
        let min = DVec3::from_array(min);
        let bounds = Bounds { min, max: min + DVec3::from_array(size) };
        let up = DVec3::from_array(up);
        prop_assume!(up.length() > 1e-3 && bounds.diagonal() > 1e-3);
        let framing = Framing { up, azimuth, elevation, fov, aspect };
        let path = CameraPath::turntable(&Framed::corners(&bounds), &framing, degrees);
        let start = path.start();
        let distance = start.eye.distance(start.look_at);
        for frame in frames {
            let view = path.view(frame);
            prop_assert_eq!(view.look_at, start.look_at);
            let moved = (view.eye.distance(view.look_at) - distance).abs();
            prop_assert!(moved <= 1e-12 * (distance + view.eye.length()));
            for corner in bounds.corners() {
                let at = project(&view, aspect, corner).abs().max_element();
                prop_assert!(at <= 1.0 - BOX_MARGIN + 1e-9, "{at}");
            }
        }
    }
}
