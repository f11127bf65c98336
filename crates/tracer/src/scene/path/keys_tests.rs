use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::scene::{Camera, CameraPath};

fn view(eye: [f64; 3]) -> CameraView {
    CameraView { eye: DVec3::from_array(eye), look_at: DVec3::ZERO, up: DVec3::Z, fov: 40.0 }
}

fn key(frame: i64, eye: [f64; 3]) -> CameraKey {
    CameraKey { frame, view: view(eye) }
}

/// A path with the given x of the eye at the given frames.
fn through(points: &[(i64, f64)]) -> CameraPath {
    let keys = points.iter().map(|(frame, x)| key(*frame, [*x, 5.0, 0.0]));
    CameraPath::through(keys.collect()).unwrap()
}

fn x(path: &CameraPath, frame: i64) -> f64 {
    path.view(frame).eye.x
}

#[test]
fn two_keys_ease_in_and_out() {
    let path = through(&[(10, 2.0), (20, 6.0)]);
    assert_eq!((x(&path, 10), x(&path, 20)), (2.0, 6.0));
    assert_eq!(x(&path, 15), 4.0);
    // 3t^2 - 2t^3 at 0.2 is 0.104.
    assert!((x(&path, 12) - 2.416).abs() < 1e-12);
    for frame in [i64::MIN, -5, 9] {
        assert_eq!(path.view(frame), path.view(10), "{frame}");
    }
    for frame in [21, i64::MAX] {
        assert_eq!(path.view(frame), path.view(20), "{frame}");
    }
    assert_eq!(path.moving(), ["eye"]);
}

#[test]
fn equal_steps_have_constant_speed_between_the_ends() {
    let path = through(&[(0, 0.0), (10, 1.0), (20, 2.0), (30, 3.0)]);
    for frame in 10..=20 {
        let even = f64::from(i32::try_from(frame).unwrap()) / 10.0;
        assert!((x(&path, frame) - even).abs() < 1e-12, "{frame}");
    }
}

#[test]
fn slopes_are_those_of_the_paper() {
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} is not {b}");
    // The parabola through (0, 0), (1, 1), (2, 3) rises by 1.5 at 1.
    near(slope(1.0, 2.0, [1.0, 1.0]), 1.5);
    // Through (0, 0), (1, 1), (4, 7): 1 + (2 - 1) * 1/4.
    near(slope(1.0, 2.0, [1.0, 3.0]), 1.25);
    // Limited to twice the flatter side.
    near(slope(-0.25, -9.0, [1.0, 1.0]), -0.5);
    for (before, after) in [(1.0, -1.0), (-2.0, 1.0), (0.0, 3.0), (3.0, 0.0)] {
        assert_eq!(slope(before, after, [1.0, 1.0]), 0.0);
    }
}

#[test]
fn one_key_is_a_view() {
    let only = key(7, [1.0, 2.0, 3.0]);
    let path = CameraPath::through(vec![only]).unwrap();
    for frame in [i64::MIN, -1, 7, 8, i64::MAX] {
        assert_eq!(path.view(frame), only.view);
    }
    assert!(path.moving().is_empty());
}

#[test]
fn invalid_keys() {
    let twice = vec![key(3, [1.0; 3]), key(1, [1.0; 3]), key(3, [2.0; 3])];
    assert_eq!(CameraPath::through(Vec::new()), Err(PathError::NoKeys));
    assert_eq!(CameraPath::through(twice), Err(PathError::SameFrame(3)));
    let mut over = [key(4, [1.0; 3]), key(1, [1.0; 3])];
    over[0].view.up = DVec3::new(0.0, 0.0, -7.0);
    let error = CameraPath::through(over.to_vec()).unwrap_err();
    assert_eq!(error, PathError::OppositeUps([1, 4]));
}

#[test]
fn keys_at_the_ends_of_frame_numbers() {
    let path = through(&[(i64::MIN, -1.0), (i64::MAX, 1.0)]);
    assert_eq!((x(&path, i64::MIN), x(&path, i64::MAX)), (-1.0, 1.0));
    assert!(x(&path, 0).abs() < 1e-15);
    assert!(x(&path, i64::MIN + 1) >= -1.0 && x(&path, i64::MAX - 1) <= 1.0);
    let path = through(&[(i64::MIN, 0.0), (i64::MIN + 1, 1.0), (i64::MAX, 2.0)]);
    assert_eq!(x(&path, i64::MIN + 1), 1.0);
    assert!(x(&path, 0) > 1.0 && x(&path, 0) < 2.0);
}

#[test]
fn up_vector_rotates_at_constant_length() {
    let mut keys = vec![key(0, [9.0, 0.0, 0.0]), key(4, [9.0, 0.0, 0.0])];
    keys[0].view.up = DVec3::new(0.0, 0.0, 8.0);
    keys[1].view.up = DVec3::new(0.0, 0.5, 0.0);
    let path = CameraPath::through(keys).unwrap();
    let half = 0.5_f64.sqrt();
    assert!((path.view(2).up - DVec3::new(0.0, half, half)).length() < 1e-12);
    for frame in -1..6 {
        assert!((path.view(frame).up.length() - 1.0).abs() < 1e-12);
    }
    assert_eq!(path.view(4).up, DVec3::Y);
    assert_eq!(path.moving(), ["up"]);
}

#[test]
fn an_up_that_passes_through_zero_is_zero() {
    // Nearly opposite, so that halfway little more than rounding is left.
    let mut keys = vec![key(0, [9.0, 0.0, 0.0]), key(4, [9.0, 0.0, 0.0])];
    keys[1].view.up = DVec3::new(0.0, 1.5e-9, -1.0);
    let path = CameraPath::through(keys).unwrap();
    assert_eq!(path.view(2).up, DVec3::ZERO);
    assert!(Camera::new(&path.view(2), 1.0, DVec3::ZERO).is_err());
}

#[test]
fn neighbouring_keys_of_a_frame() {
    let CameraPath::Keys(path) = through(&[(5, 0.0), (8, 1.0)]) else {
        panic!("no keys");
    };
    assert_eq!(path.around(6), Some([5, 8]));
    for frame in [i64::MIN, 4, 5, 8, 9] {
        assert_eq!(path.around(frame), None, "{frame}");
    }
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![-10.0..10.0, Just(0.0), Just(1.0), -1e6..1e6, -1e-6..1e-6]
}

/// Values at frames that are far apart, so that a frame is a small step.
fn points() -> impl Strategy<Value = Vec<(i64, f64)>> {
    let gaps = prop::collection::vec((1_000_000_i64..4_000_000, number()), 1..8);
    gaps.prop_map(|gaps| {
        let mut frame = -5_000_000;
        let place = |(gap, value)| {
            frame += gap;
            (frame, value)
        };
        gaps.into_iter().map(place).collect()
    })
}

proptest! {
    #[test]
    fn keys_are_reached_without_overshoot(
        points in prop::collection::btree_map(any::<i64>(), number(), 1..8),
        tries in prop::collection::vec(any::<i64>(), 16),
    ) {
        let points: Vec<_> = points.into_iter().collect();
        let path = through(&points);
        for (frame, value) in &points {
            prop_assert_eq!(x(&path, *frame), *value);
        }
        for frame in tries {
            let next = points.partition_point(|p| p.0 <= frame);
            let before = points[next.saturating_sub(1)].1;
            let after = points[next.min(points.len() - 1)].1;
            let at = x(&path, frame);
            prop_assert!(at >= before.min(after) && at <= before.max(after), "{frame}: {at}");
        }
    }

    /// Between two keys a coordinate is monotone.
    #[test]
    fn pieces_are_monotone(points in points(), steps in 2_i64..40) {
        let path = through(&points);
        for pair in points.windows(2) {
            let length = pair[1].0 - pair[0].0;
            let values: Vec<f64> = (0..=steps)
                .map(|i| x(&path, pair[0].0 + i * length / steps))
                .collect();
            let rounding = 1e-12 * pair[0].1.abs().max(pair[1].1.abs());
            let rises = pair[1].1 >= pair[0].1;
            for step in values.windows(2) {
                let rise = if rises { step[1] - step[0] } else { step[0] - step[1] };
                prop_assert!(rise >= -rounding, "{pair:?} {values:?}");
            }
        }
    }

    /// The steps before and after a key are equal, except for the curvature over a millionth of the segment.
    #[test]
    fn speed_is_continuous(points in points()) {
        let path = through(&points);
        let largest = points.iter().fold(0.0_f64, |a, p| a.max(p.1.abs()));
        for (frame, value) in &points {
            let bend = (x(&path, frame + 1) - value) - (value - x(&path, frame - 1));
            // The second derivative of a cubic with slopes up to three times its line's is at most 18
            // of its rise over the squared length.
            let most = 36.0 * largest / 1e12 + 1e-15 * largest;
            prop_assert!(bend.abs() <= most, "{frame}: {bend} {most}");
        }
    }

    #[test]
    fn the_order_of_keys_does_not_matter(points in points(), turn in 0_usize..8) {
        let path = through(&points);
        let mut turned = points.clone();
        turned.rotate_left(turn % points.len());
        prop_assert_eq!(&through(&turned), &path);
        turned.reverse();
        prop_assert_eq!(&through(&turned), &path);
    }
}
