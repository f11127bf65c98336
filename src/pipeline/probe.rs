//! How long a job will take, from a small measurement: one frame is read and built as it will be,
//! and traced at a fraction of its pixels.
//!
//! An estimate. A coarse image's rays are less alike than a fine one's, so it rather takes too long;
//! other frames are taken in proportion to their files; the machine is taken to be as busy as it is
//! now. Tracing has a time box: what is not done by its end gives a lower bound.

use std::time::{Duration, Instant};

use serde::Serialize;
use spherule_formats::sequence::Sequence;

use super::{FrameSize, ImageTask, Overlap, Setup, TraceError, load_frame, renderer_of};
use crate::output::{encode_exr, encode_preview};
use crate::render::{Deadline, Film, RenderError};

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
    /// Whether the time for the measurement was over before the smallest image was traced, so that tracing takes
    /// longer than estimated.
    pub is_lower_bound: bool,
}

/// A small image that was tried.
struct Trial {
    film: Film,
    seconds: f64,
    /// Whether it was given up.
    is_cut_off: bool,
}

/// Measures the frame of `task`.
///
/// # Errors
/// Why it cannot be rendered.
pub fn probe(setup: &Setup, sequence: &Sequence, task: &ImageTask) -> Result<Probe, String> {
    probe_for(Probe::TIME_BOX, setup, sequence, task)
}

/// As [`probe`], with no more than `time_box` to trace in.
pub(super) fn probe_for(
    time_box: Duration,
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
) -> Result<Probe, String> {
    let loaded = load_frame(setup, sequence, task).map_err(|e| e.to_string())?;
    let read = loaded.read_time.as_secs_f64();
    let mut tracer = renderer_of(setup.picture.renderer);
    let frame = tracer.prepare(setup, loaded).map_err(|e| e.to_string())?;
    let deadline = Deadline(Instant::now() + time_box);
    let full = &setup.picture.render;
    let rays = |width: u32, height: u32| f64::from(width) * f64::from(height);
    let mut last: Option<Trial> = None;
    let mut width = FIRST_WIDTH.min(full.width);
    loop {
        let mut small = setup.clone();
        small.picture.render.width = width;
        small.picture.render.height = (full.height / (full.width / width)).max(1);
        small.picture.render.samples = 1;
        let start = Instant::now();
        let traced = tracer.image(&small, &frame, &deadline);
        let seconds = start.elapsed().as_secs_f64();
        let trial = match (traced, last.take()) {
            (Ok((film, _)), _) => Trial {
                film,
                seconds,
                is_cut_off: false,
            },
            // The image before, a quarter of this one, tells enough.
            (Err(TraceError::Render(RenderError::Interrupted)), Some(whole)) => whole,
            (Err(TraceError::Render(RenderError::Interrupted)), None) => Trial {
                film: Film::new(
                    small.picture.render.width,
                    small.picture.render.height,
                    small.picture.render.channels,
                ),
                seconds,
                is_cut_off: true,
            },
            (Err(error), _) => return Err(error.to_string()),
        };
        let is_whole = !trial.is_cut_off && trial.film.width == width;
        if is_whole && trial.seconds < ENOUGH && 2 * width <= full.width {
            last = Some(trial);
            width *= 2;
            continue;
        }
        let Trial {
            film,
            seconds: trace,
            is_cut_off,
        } = trial;
        let start = Instant::now();
        let exr = encode_exr(&film, &small.picture.exr).map_err(|e| e.to_string())?;
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
            traced_part: if is_cut_off {
                0.0
            } else {
                1.0 / (pixels * samples)
            },
            is_lower_bound: is_cut_off,
        });
    }
}

impl Probe {
    /// Tracing on trial takes no longer than this.
    pub const TIME_BOX: Duration = Duration::from_secs(3);

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

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use spherule_formats::SequenceInput;

    use super::*;

    #[test]
    fn no_time_to_trace_gives_a_lower_bound() {
        let example = "examples/dam-break/ParticleData_Fluid_1.bgeo";
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(example);
        let sequence = Sequence::open(&SequenceInput::from_path(&file)).expect("a frame");
        let manifest = crate::manifest::Manifest::new("in");
        let question = crate::resolve::question(&manifest);
        let survey = crate::survey::Survey::of(&sequence, question).expect("readable");
        let setup = crate::resolve::setup(&manifest, &survey).expect("pictures");
        let task = ImageTask {
            frame: 1,
            index: 0,
            image: PathBuf::new(),
            preview: None,
            refused: None,
        };
        let cut_off = probe_for(Duration::ZERO, &setup, &sequence, &task).expect("a probe");
        assert!(cut_off.is_lower_bound && cut_off.traced_part == 0.0);
        assert!(cut_off.particles > 0 && cut_off.trace > 0.0);
        let whole = probe_for(Duration::from_secs(3600), &setup, &sequence, &task);
        assert!(whole.is_ok_and(|probe| !probe.is_lower_bound && probe.traced_part > 0.0));
    }
}
