//! How long a job will take, from a small measurement: one frame is read and built as it will be,
//! and traced at a fraction of its pixels.
//!
//! An estimate. A coarse image's rays are less alike than a fine one's, so it rather takes too long;
//! other frames are taken in proportion to their files; the machine is taken to be as busy as it is
//! now.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use serde::Serialize;
use spherule_formats::sequence::Sequence;

use super::{FrameSize, FrameTracer, ImageTask, Overlap, Setup, load_frame};
use crate::output::{encode_exr, encode_preview};

/// Pixels across of the first image that is tried; each further has twice as many.
const FIRST_WIDTH: u32 = 96;
/// Tracing that takes so many seconds tells enough.
const ENOUGH: f64 = 0.2;

/// What one frame takes, seconds; bytes of its image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Probe {
    /// The frame.
    pub frame: i64,
    /// Its particles.
    pub particles: u64,
    /// Reading it, measured.
    pub read: f64,
    /// Building the tree and the surface, measured.
    pub build: f64,
    /// Tracing, estimated.
    pub trace: f64,
    /// Encoding, estimated.
    pub encode: f64,
    /// Bytes of its images, estimated.
    pub image_bytes: f64,
    /// The part of the camera's rays that were traced.
    pub traced_part: f64,
}

/// Measures the frame of `task`.
///
/// # Errors
/// Why it cannot be rendered.
pub fn probe(setup: &Setup, sequence: &Sequence, task: &ImageTask) -> Result<Probe, String> {
    let loaded = load_frame(setup, sequence, task).map_err(|e| e.to_string())?;
    let read = loaded.read_time.as_secs_f64();
    let mut tracer = FrameTracer::new();
    let frame = tracer.build(setup, loaded).map_err(|e| e.to_string())?;
    let full = &setup.render;
    let rays = |width: u32, height: u32| f64::from(width) * f64::from(height);
    let mut width = FIRST_WIDTH.min(full.width);
    loop {
        let mut small = setup.clone();
        small.render.width = width;
        small.render.height = (full.height / (full.width / width)).max(1);
        small.render.samples = 1;
        let start = Instant::now();
        let traced = tracer.image(&small, &frame, &AtomicBool::new(false));
        let (film, _) = traced.map_err(|e| e.to_string())?;
        let trace = start.elapsed().as_secs_f64();
        if trace < ENOUGH && 2 * width <= full.width {
            width *= 2;
            continue;
        }
        let start = Instant::now();
        let exr = encode_exr(&film, &small.exr).map_err(|e| e.to_string())?;
        let mut bytes = exr.bytes.len();
        if task.preview.is_some() {
            let camera = small.camera_at(task.frame).map_err(|e| e.to_string())?;
            let options = small.preview_from(&camera);
            let png = encode_preview(&film, &options).map_err(|e| e.to_string())?;
            bytes += png.len();
        }
        let encode = start.elapsed().as_secs_f64();
        let pixels = rays(full.width, full.height) / rays(film.width, film.height);
        let samples = f64::from(full.samples);
        return Ok(Probe {
            frame: task.frame,
            particles: frame.report.particles,
            read,
            build: frame.report.seconds.build + frame.report.seconds.surface,
            trace: trace * pixels * samples,
            encode: encode * pixels,
            image_bytes: bytes as f64 * pixels,
            traced_part: 1.0 / (pixels * samples),
        });
    }
}

impl Probe {
    /// Seconds for frames of these sizes, of which `probed` is the one that was measured. Tracing and
    /// encoding share the processors; reading goes beside them where frames overlap.
    pub fn seconds_for(&self, frames: &[FrameSize], probed: &FrameSize, overlap: Overlap) -> f64 {
        let seconds = |frame: &FrameSize| {
            let part = frame.raw as f64 / probed.raw.max(1) as f64;
            let (read, build) = (self.read * part, self.build * part);
            let image = self.trace + self.encode;
            build
                + match overlap {
                    Overlap::Stages => image.max(read),
                    Overlap::None => image + read,
                }
        };
        frames.iter().map(seconds).sum()
    }
}
