//! Pixel filters: the picture of an edge against the convolution with the filter.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};

use super::{solid::Solid, *};
use crate::scene::{Background, Camera, CameraView};

const SIDE: u32 = 16;

/// Coverage of the pixels of each row by the half-space below row 8 of the film.
fn coverage(filter: PixelFilter, samples: u32) -> Vec<f64> {
    let view = CameraView {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 40.0,
    };
    let scene = Scene {
        background: Background::Constant(Vec3::ZERO),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    };
    let settings = RenderSettings { samples, filter, ..RenderSettings::new(SIDE, SIDE) };
    let source = ParticleShading::constant(Vec3::ONE);
    let never = AtomicBool::new(false);
    let slab = Solid::slab(-100.0, 0.0);
    let film = render(&[&slab], &scene, &source, &settings, &never);
    let rows = film.unwrap().0.color;
    let rows = rows.chunks(SIDE as usize);
    rows.map(|row| row.iter().map(|c| f64::from(c[3])).sum::<f64>() / f64::from(SIDE)).collect()
}

/// The integral of the filter from its lower end to `to` pixels from its centre, relative to its whole integral.
fn integral(filter: PixelFilter, to: f64) -> f64 {
    let half = 0.5 * f64::from(filter.width);
    let count = 20_000;
    let (mut below, mut total) = (0.0, 0.0);
    for number in 0..count {
        let x = half * (2.0 * (f64::from(number) + 0.5) / f64::from(count) - 1.0);
        // Written out, to check the densities as well
        let scaled = std::f64::consts::TAU * x / f64::from(filter.width);
        let value = match filter.kind {
            FilterKind::Box => 1.0,
            FilterKind::Gaussian => (-0.5 * (x / (0.5 * half)).powi(2)).exp(),
            FilterKind::BlackmanHarris => {
                0.358_75
                    + 0.488_29 * scaled.cos()
                    + 0.141_28 * (2.0 * scaled).cos()
                    + 0.011_68 * (3.0 * scaled).cos()
            }
        };
        total += value;
        if x < to {
            below += value;
        }
    }
    below / total
}

#[test]
fn an_edge_is_convolved_with_the_filter() {
    for (kind, width) in [
        (FilterKind::Box, 1.0),
        (FilterKind::Box, 3.0),
        (FilterKind::Gaussian, 2.0),
        (FilterKind::Gaussian, 5.0),
        (FilterKind::BlackmanHarris, 3.0),
    ] {
        let filter = PixelFilter { kind, width };
        let found = coverage(filter, 64);
        for (row, found) in found.iter().enumerate() {
            // The edge is between rows 7 and 8
            let expected = integral(filter, row as f64 + 0.5 - 8.0);
            assert!((found - expected).abs() < 0.01, "{filter:?} {row}: {found} {expected}");
        }
    }
}

#[test]
fn a_single_sample_is_at_the_centre() {
    let filter = PixelFilter { kind: FilterKind::Gaussian, width: 8.0 };
    let found = coverage(filter, 1);
    assert!(found[..8].iter().all(|c| *c == 0.0) && found[8..].iter().all(|c| *c == 1.0));
}
