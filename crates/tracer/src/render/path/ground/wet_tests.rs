use glam::Vec3;
use std::sync::atomic::AtomicBool;

use super::*;
use crate::render::solid::Solid;

const EDGE: f32 = 12.0;

fn map(body: &dyn Shape, margin: f32) -> WetMap {
    let square =
        Square { center: Vec3::ZERO, axes: [Vec3::X, Vec3::Y], normal: Vec3::Z, edge: EDGE };
    let scene = WetScene {
        bodies: vec![body],
        wet: &WetGround { strength: 1.0, margin },
        square: &square,
        particles: [Vec3::new(-2.0, -2.0, -0.1), Vec3::new(2.0, 2.0, 3.0)],
        ior: 1.333,
    };
    scene.map(&AtomicBool::new(false)).unwrap()
}

#[test]
fn the_ground_is_wet_up_to_a_margin_around_the_fluid() {
    // A ball that the ground cuts in its middle
    let margin = 0.2;
    let map = map(&Solid::ball_at(Vec3::ZERO, 1.0), margin);
    let at = |x: f32| map.at(Vec3::new(x, 0.0, 0.0));
    assert_eq!(at(0.0), [1.0, 0.0]);
    assert_eq!(at(0.9), [1.0, 0.0]);
    assert_eq!(at(1.06), [1.0, 1.0]);
    assert_eq!(at(1.4), [0.0; 2]);
    assert_eq!(at(5.9), [0.0; 2]);
    assert_eq!(at(7.0), [0.0; 2]);
    // It dries smoothly, and the same in all directions
    let steps: Vec<f32> = (0..60).map(|i| at(1.05 + 0.005 * i as f32)[0]).collect();
    for pair in steps.windows(2) {
        assert!(pair[1] <= pair[0] && pair[0] - pair[1] < 0.1, "{pair:?}");
    }
    assert!((steps[30] - 0.5).abs() < 0.2, "{}", steps[30]);
    let half = at(1.2)[0];
    for angle in [0.5_f32, 2.0, 4.0] {
        let there = map.at(1.2 * Vec3::new(angle.cos(), angle.sin(), 0.0))[0];
        assert!((there - half).abs() < 0.15, "{angle}: {there} {half}");
    }
}

#[test]
fn fluid_wets_the_ground_from_a_small_height_only() {
    let middle = |low: f32| map(&Solid::slab(low, 2.0), 0.2).at(Vec3::ZERO);
    assert_eq!(middle(-1.0), [1.0, 0.0]);
    assert_eq!(middle(0.05), [1.0, 1.0]);
    let between = middle(0.15)[0];
    assert!((between - 0.5).abs() < 0.01, "{between}");
    assert_eq!(middle(0.25), [0.0; 2]);
}

#[test]
fn wet_sand_is_darker() {
    let film = Film::new(1.333, 1.0);
    // Reflectance of water for diffuse light: 0.066 outside, 0.47 inside
    assert!((film.outer - 0.0665).abs() < 0.001, "{}", film.outer);
    assert!((film.inner - 0.475).abs() < 0.002, "{}", film.inner);
    // By hand for 0.36: absorbed 0.64 * (0.36 * 1.077 + 0.64) = 0.6577, so 0.9335 * 0.3423 * 0.525 / 0.8374
    assert!((film.wet(0.36) - 0.2003).abs() < 0.004, "{}", film.wet(0.36));
    assert_eq!(film.wet(0.0), 0.0);
    for i in 1..=20_u8 {
        let albedo = f32::from(i) / 20.0;
        let wet = film.albedo(Vec3::splat(albedo), 1.0).x;
        assert!(wet <= albedo && wet > 0.3 * albedo, "{albedo}: {wet}");
        assert_eq!(film.albedo(Vec3::splat(albedo), 0.0).x, albedo);
    }
    // Water that is like the grains, and media that are thinner than air
    for ior in [1.0, 1.5, 2.4, 0.8] {
        let wet = Film::new(ior, 1.0).wet(0.5);
        assert!((0.0..=0.55).contains(&wet), "{ior}: {wet}");
    }
}
