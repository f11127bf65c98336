//! Nothing of a frame outlives it but its entry in the ledger.

use std::fs;

use super::AWAY;
use crate::harness::{Workshop, npy};

/// Bytes that each frame may take for good: the job keeps what the report will say of it, as text of
/// over a kibibyte; 2 to 6 KiB a frame were measured, pieces that the allocator keeps included. The
/// smallest image or particles here are larger.
const MAX: f64 = 8192.0;

/// Frames of which only the smallest value counts: others are caught with pieces in flight.
const WINDOW: usize = 10;

/// Renders 200 frames in one process and takes the growth of the anonymous memory after each, the
/// first fifty left out.
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
    let report = workshop.report("out");
    let frames = report["frames"].as_array().expect("frames");
    let after: Vec<f64> = frames
        .iter()
        .map(|f| f["rss"]["anonymous"].as_f64())
        .collect::<Option<_>>()
        .expect("bytes");
    assert_eq!(after.len(), 200);
    let growth = growth(&after[50..]);
    assert!(growth < MAX, "{growth} bytes a frame: {after:?}");
}

/// Median growth a frame from window to window. What leaks does so in each window; a thread that
/// gets an arena of its own from the allocator makes one step of a mebibyte, once, and moves a line
/// fitted to all by 9 KiB a frame.
fn growth(values: &[f64]) -> f64 {
    let smallest = |window: &[f64]| window.iter().copied().fold(f64::INFINITY, f64::min);
    let smallest: Vec<f64> = values.chunks_exact(WINDOW).map(smallest).collect();
    let mut steps: Vec<f64> = smallest.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2] / WINDOW as f64
}

#[test]
fn one_step_is_not_growth() {
    let frames = 0..150;
    let leak: Vec<f64> = frames.clone().map(|f| 3.0 * f64::from(f)).collect();
    assert_eq!(growth(&leak), 3.0);
    let step: Vec<f64> = frames.map(|f| if f < 70 { 0.0 } else { 1e6 }).collect();
    assert_eq!(growth(&step), 0.0);
}

#[test]
fn two_hundred_small_frames() {
    let small = ["--width", "32", "--height", "18", "--set", "output.preview=false"];
    flat(1000, &[&small[..], &AWAY].concat());
}

#[test]
#[ignore = "takes a minute"]
fn two_hundred_frames_of_a_hundred_thousand() {
    flat(100_000, &["--width", "320", "--height", "180"]);
}
