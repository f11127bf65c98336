//! `report.json`: the job so far, from its ledger.

use std::fs;
use std::io;
use std::path::Path;

use serde_json::{Value, json};
use spherule_jobs::{Entry, FrameState, JobState, publish};

use super::frame::FrameReport;
use crate::accel::simd::SimdLevel;
use crate::manifest::Manifest;

/// Name of the report beside the images.
pub const FILE: &str = "report.json";

/// Writes the report of the job in `dir`, unless it stands there already.
///
/// # Errors
/// It cannot be written.
pub fn write(dir: &Path, state: &JobState, manifest: &Manifest) -> io::Result<()> {
    let path = dir.join(FILE);
    let text = format!("{:#}\n", of(state, manifest));
    if fs::read_to_string(&path).is_ok_and(|old| old == text) {
        return Ok(());
    }
    publish(&path, text.as_bytes())
}

/// The report as JSON.
pub fn of(state: &JobState, manifest: &Manifest) -> Value {
    let frames: Vec<Value> = state
        .plan()
        .frames()
        .iter()
        .map(|planned| {
            let mut frame = json!({
                "frame": planned.number,
                "image": planned.outputs.first(),
                "status": status(state, planned.number),
            });
            if let (Some(entry), Some(into)) =
                (word_on(state, planned.number), frame.as_object_mut())
            {
                if let Some(reason) = &entry.reason {
                    into.insert("reason".into(), json!(reason));
                }
                if let Value::Object(details) = &entry.details {
                    into.extend(details.clone());
                }
            }
            frame
        })
        .collect();
    let settings: serde_json::Map<String, Value> = manifest
        .settings()
        .into_iter()
        .map(|(k, v)| (k, json!(v)))
        .collect();
    json!({
        "frames": frames,
        "totals": totals(state),
        "settings": settings,
        "machine": {
            "threads": rayon::current_num_threads(),
            "simd": SimdLevel::best().name(),
            "os": std::env::consts::OS,
            "arch": std::env::consts::ARCH,
            "spherule": env!("CARGO_PKG_VERSION"),
        },
    })
}

/// A lost image is still to be made.
fn status(state: &JobState, frame: i64) -> &'static str {
    match state.frame_state(frame) {
        Some(FrameState::Done) => "done",
        Some(FrameState::Failed) => "failed",
        Some(FrameState::Pending | FrameState::Lost) | None => "pending",
    }
}

/// The ledger's word on a frame, if it still holds.
fn word_on(state: &JobState, frame: i64) -> Option<&Entry> {
    match state.frame_state(frame)? {
        FrameState::Done | FrameState::Failed => state.ledger().entry(frame),
        FrameState::Pending | FrameState::Lost => None,
    }
}

/// Sums over the frames that are done.
fn totals(state: &JobState) -> Value {
    let summary = state.summary();
    let mut sums = FrameReport::default();
    let done = |entry: &&Entry| state.frame_state(entry.frame) == Some(FrameState::Done);
    for entry in state.ledger().entries().filter(done) {
        let Ok(frame) = serde_json::from_value::<FrameReport>(entry.details.clone()) else {
            continue;
        };
        sums.particles += frame.particles;
        sums.dropped += frame.dropped;
        sums.clamped_radii += frame.clamped_radii;
        sums.clamped_pixels += frame.clamped_pixels;
        sums.seconds.read += frame.seconds.read;
        sums.seconds.build += frame.seconds.build;
        sums.seconds.trace += frame.seconds.trace;
        sums.seconds.encode += frame.seconds.encode;
        sums.rays.primary += frame.rays.primary;
        sums.rays.shadow += frame.rays.shadow;
        sums.rays.reflection += frame.rays.reflection;
        sums.rays.refraction += frame.rays.refraction;
        sums.rss.anonymous_peak = sums.rss.anonymous_peak.max(frame.rss.anonymous_peak);
        sums.rss.file_peak = sums.rss.file_peak.max(frame.rss.file_peak);
        sums.rss.total_peak = sums.rss.total_peak.max(frame.rss.total_peak);
    }
    json!({
        "frames": summary.total,
        "done": summary.done,
        "failed": summary.failed,
        "pending": summary.pending,
        "particles": sums.particles,
        "dropped": sums.dropped,
        "clamped_radii": sums.clamped_radii,
        "clamped_pixels": sums.clamped_pixels,
        "seconds": sums.seconds,
        "rays": sums.rays,
        "rss": sums.rss,
    })
}
