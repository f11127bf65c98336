use glam::DVec2;

use super::*;
use crate::scene::Camera;

/// Film coordinates of a world point, -1 to 1.
fn project(view: &CameraView, aspect: f64, point: DVec3) -> DVec2 {
    let forward = (view.look_at - view.eye).normalize();
    let right = forward.cross(view.up).normalize();
    let p = point - view.eye;
    assert!(p.dot(forward) > 0.0, "{point} is behind the camera");
    let half = libm::tan(0.5 * view.fov.to_radians());
    let on_film = DVec2::new(p.dot(right) / aspect, p.dot(right.cross(forward)));
    on_film / (half * p.dot(forward))
}

#[test]
fn framing_fits_every_corner_and_wastes_nothing() {
    let boxes = [
        (DVec3::new(3.0, 5.0, -2.0), DVec3::new(7.0, 8.0, 2.0)),
        (DVec3::new(-1e4, 1e5, 0.0), DVec3::new(-1e4 + 1e-3, 1e5 + 1.0, 0.01)),
        (DVec3::ZERO, DVec3::new(1.0, 0.0, 0.0)),
    ];
    for (min, max) in boxes {
        for up in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 2.0, 3.0)] {
            for aspect in [0.5, 1.0, 16.0 / 9.0] {
                for azimuth in [0.0, 30.0, 200.0] {
                    let bounds = Bounds { min, max };
                    let framing = Framing { azimuth, ..Framing::three_quarter(up, aspect) };
                    let view = Framed::corners(&bounds).view(&framing);
                    let projected = bounds.corners().map(|c| project(&view, aspect, c).abs());
                    let far = projected.iter().fold(DVec2::ZERO, |a, b| a.max(*b));
                    let limit = 1.0 - BOX_MARGIN;
                    assert!((far.max_element() - limit).abs() < 1e-4, "{far} {framing:?}");
                }
            }
        }
    }
}

#[test]
fn framing_looks_down_with_up_on_top() {
    let bounds = Bounds { min: DVec3::ZERO, max: DVec3::ONE };
    for up in [DVec3::Y, DVec3::Z] {
        let view = Framed::corners(&bounds).view(&Framing::three_quarter(up, 1.0));
        assert!((view.eye - view.look_at).dot(up) > 0.0);
        let low = project(&view, 1.0, bounds.center());
        let high = project(&view, 1.0, bounds.center() + 0.5 * up);
        assert!(high.y > low.y && (high.x - low.x).abs() < 0.05);
    }
    // A front view with z up looks along +y, with x to the right.
    let front = Framing { azimuth: 0.0, elevation: 0.0, ..Framing::three_quarter(DVec3::Z, 1.0) };
    let view = Framed::corners(&bounds).view(&front);
    assert!((view.look_at - view.eye).normalize().y > 0.999_999);
    assert!(project(&view, 1.0, DVec3::ONE).x > 0.0);
}

#[test]
fn framing_a_point_gives_a_camera() {
    for at in [DVec3::ZERO, DVec3::splat(1e7)] {
        let bounds = Bounds { min: at, max: at };
        let view = Framed::corners(&bounds).view(&Framing::three_quarter(DVec3::Z, 1.0));
        assert!(Camera::new(&view, 1.0, at).is_ok());
    }
}

#[test]
fn spheres_fit_and_their_image_is_centred() {
    let points: Vec<DVec3> = (0..40)
        .map(|i| {
            let t = f64::from(i);
            DVec3::new(libm::sin(t) * t, 0.3 * t, libm::cos(1.7 * t) * 9.0)
        })
        .collect();
    for (radius, aspect) in [(0.0, 1.5), (2.0, 1.5), (2.0, 0.4), (5.0, 3.0)] {
        let framing = Framing::three_quarter(DVec3::Z, aspect);
        let view = Framed::spheres(points.clone(), radius).view(&framing);
        // Points of the spheres that seem outermost, from each side
        let forward = (view.look_at - view.eye).normalize();
        let right = forward.cross(view.up).normalize();
        let axes = [right, right.cross(forward)];
        let sides = [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)].map(|(axis, sign)| {
            let seen = |center: &DVec3| {
                (0..3600).map(|i| f64::from(i) * std::f64::consts::TAU / 3600.0).fold(
                    -9.0,
                    |most: f64, angle| {
                        let around = libm::cos(angle) * axes[axis] + libm::sin(angle) * forward;
                        let on_film = project(&view, aspect, *center + radius * around);
                        most.max(sign * [on_film.x, on_film.y][axis])
                    },
                )
            };
            points.iter().map(seen).fold(-9.0, f64::max)
        });
        let limit = 1.0 - SPHERES_MARGIN;
        let most = sides.iter().copied().fold(0.0, f64::max);
        assert!((most - limit).abs() < 1e-3, "{radius} {aspect}: {sides:?}");
        // The margins are those of the centres with the radius added, which is all but the same
        for [a, b] in [[sides[0], sides[1]], [sides[2], sides[3]]] {
            assert!((a - b).abs() < 0.02, "{radius} {aspect}: {sides:?}");
        }
    }
}

#[test]
fn azimuths_toward_a_side_look_from_it() {
    for up in [DVec3::Z, DVec3::Y, DVec3::X, DVec3::new(1.0, 2.0, -1.0).normalize()] {
        for azimuth in [-150.0, -20.0, 0.0, 77.0, 170.0] {
            let side = -view_direction(up, azimuth, 25.0);
            assert!((azimuth_toward(up, side) - azimuth).abs() < 1e-9, "{up} {azimuth}");
        }
    }
}
