//! Memory: predictions match measurements, limits hold, memory is freed, and `check` reports it.

use std::fs;
use std::path::Path;

use glam::Vec3;
use serde_json::Value;
use spherule_formats::generate::{BoxSettings, fill_box};
use spherule_formats::{Attribute, AttributeData, write};

use crate::harness::Ran;

#[cfg(target_os = "linux")]
mod bombs;
mod check;
#[cfg(target_os = "linux")]
mod generate;
#[cfg(target_os = "linux")]
mod leak;
mod limit;
#[cfg(target_os = "linux")]
mod predicted;

/// A camera that sees nothing but the background: tracing takes no time.
const AWAY: [&str; 8] = [
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0.0,0.0,-100.0]",
    "--set",
    "camera.look_at=[0.0,0.0,-200.0]",
    "--set",
    "camera.up=[0.0,1.0,0.0]",
];

/// Particles of the thesis's box.
fn particles(count: usize) -> Vec<Vec3> {
    fill_box(&BoxSettings::thesis(count, 1))
}

/// A legacy VTK file of them, with a velocity and an id on request.
fn vtk(path: &Path, count: usize, with_attributes: bool) {
    fs::create_dir_all(path.parent().expect("a file in a directory")).expect("a directory");
    let velocity = Attribute {
        name: "velocity".into(),
        components: 3,
        data: AttributeData::F32(vec![0.5; 3 * count]),
    };
    let id = Attribute {
        name: "id".into(),
        components: 1,
        data: AttributeData::I32((0..).take(count).collect()),
    };
    let attributes = if with_attributes { vec![velocity, id] } else { Vec::new() };
    write::vtk::write(path, &particles(count), &attributes).expect("a file");
}

/// The output of `check --json`.
#[track_caller]
fn answer(ran: &Ran) -> Value {
    serde_json::from_str(&ran.text()).unwrap_or_else(|e| panic!("{e}: {}", ran.text()))
}
