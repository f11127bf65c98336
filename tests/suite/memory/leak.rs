//! Nothing of a frame outlives it but its entry in the ledger.

use std::fs;

use super::{AWAY, report};
use crate::harness::{Workshop, npy};

/// Bytes that each frame may take for good: the job keeps what the report will say of it, as text of
/// over a kibibyte; 2 to 6 KiB a frame were measured, pieces that the allocator keeps included. The
/// smallest image or particles here are larger.
const MOST: f64 = 8192.0;

/// Renders 200 frames in one process and fits a line to the anonymous memory after each, the first
/// fifty left out.
#[track_caller]
fn flat(particles: usize, options: &[&str]) {
    let workshop = Workshop::new();
    let first = workshop.join("in/f_1.npy");
    npy(&first, particles, 1, glam::Vec3::ZERO);
    for frame in 2..=200 {
        fs::hard_link(&first, workshop.join(format!("in/f_{frame}.npy"))).expect("a link");
    }
    let common = ["render", "in", "-o", "out/f.####.exr", "--samples", "1"];
    workshop.run(&[&common[..], options].concat()).expect(0);
    let report = report(&workshop);
    let frames = report["frames"].as_array().expect("frames");
    let after = frames.iter().map(|f| f["rss"]["anonymous"].as_f64());
    let after: Vec<f64> = after.collect::<Option<_>>().expect("bytes");
    assert_eq!(after.len(), 200);
    let slope = slope(&after[50..]);
    assert!(slope < MOST, "{slope} bytes a frame: {after:?}");
}

/// Of the line through `values` at 0, 1, 2... by least squares.
fn slope(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let middle = (count - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / count;
    let (mut above, mut below) = (0.0, 0.0);
    for (place, value) in values.iter().enumerate() {
        let along = place as f64 - middle;
        above += along * (value - mean);
        below += along * along;
    }
    above / below
}

#[test]
fn a_line_is_fitted() {
    assert_eq!(slope(&[1.0, 3.0, 5.0, 7.0]), 2.0);
    assert_eq!(slope(&[5.0; 9]), 0.0);
}

#[test]
fn two_hundred_small_frames() {
    let small = [
        "--width",
        "32",
        "--height",
        "18",
        "--set",
        "output.preview=false",
    ];
    flat(1000, &[&small[..], &AWAY].concat());
}

#[test]
#[ignore = "takes a minute"]
fn two_hundred_frames_of_a_hundred_thousand() {
    flat(100_000, &["--width", "320", "--height", "180"]);
}
