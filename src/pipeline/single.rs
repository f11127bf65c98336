//! Renders a single image; no other frame is in memory.

use std::io;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use spherule_formats::Sequence;
use spherule_jobs::publish;

use super::ImageTask;
use super::encode::{WriteError, write_frame};
use super::load::load_frame;
use super::renderer::TracedFrame;
use super::setup::Setup;
use super::trace::renderer_of;
use crate::metrics::MemoryPeaks;
use crate::mishap::{guarded, is_place_at_fault};
use crate::output::encode_preview;
use crate::report::FrameReport;

/// Reasons why there is no image.
#[derive(Debug)]
pub enum SingleFault {
    /// The frame is at fault, with the reason.
    Frame(String),
    /// Further images would fail as well: the file that was being written, and the error of the system.
    Place(PathBuf, io::Error),
}

/// File format of a picture outside a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureKind {
    /// OpenEXR, as a job writes it.
    Exr,
    /// PNG, as the previews of a job.
    Png,
}

/// Renders the image of `task` with its preview; notes for the user go to `note`.
///
/// # Errors
/// See [`SingleFault`]; no files remain then.
pub fn make_image(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    note: impl FnMut(&str),
) -> Result<FrameReport, SingleFault> {
    let traced = trace_single(setup, sequence, task, note)?;
    write_guarded(|| write_exr(setup, traced))
}

/// Renders only the image of `task`, to a file of this `kind`; notes for the user go to `note`.
///
/// # Errors
/// See [`SingleFault`]; no files remain then.
pub fn make_picture(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    kind: PictureKind,
    note: impl FnMut(&str),
) -> Result<FrameReport, SingleFault> {
    let traced = trace_single(setup, sequence, task, note)?;
    write_guarded(|| match kind {
        PictureKind::Exr => write_exr(setup, traced),
        PictureKind::Png => write_png(setup, &traced),
    })
}

fn trace_single(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    mut note: impl FnMut(&str),
) -> Result<TracedFrame, SingleFault> {
    let traced = guarded(|| {
        // Read the frame
        let mut frame = load_frame(setup, sequence, task).map_err(|e| e.to_string())?;
        std::mem::take(&mut frame.notes)
            .iter()
            .for_each(|n| note(n));
        // Build its tree, and trace the image
        let mut tracer = renderer_of(setup.picture.renderer);
        let mut built = tracer.prepare(setup, frame).map_err(|e| e.to_string())?;
        std::mem::take(&mut built.notes)
            .iter()
            .for_each(|n| note(n));
        let stop = AtomicBool::new(false);
        tracer
            .render(setup, built, &stop)
            .map_err(|e| e.to_string())
    });
    traced.map_err(SingleFault::Frame)
}

fn write_exr(setup: &Setup, frame: TracedFrame) -> Result<FrameReport, WriteError> {
    write_frame(setup, frame, &mut MemoryPeaks::default()).map(|(report, _)| report)
}

/// Writes the preview of `frame` in place of its image.
fn write_png(setup: &Setup, frame: &TracedFrame) -> Result<FrameReport, WriteError> {
    let start = Instant::now();
    let png = encode_preview(&frame.film, &setup.preview_from(&frame.camera))?;
    let path = frame.task.image.clone();
    publish(&path, &png).map_err(|source| WriteError::Io { path, source })?;
    let mut report = frame.report.clone();
    report.seconds.encode = start.elapsed().as_secs_f64();
    Ok(report)
}

fn write_guarded(
    write: impl FnOnce() -> Result<FrameReport, WriteError>,
) -> Result<FrameReport, SingleFault> {
    match guarded(|| Ok(write())).map_err(SingleFault::Frame)? {
        Ok(report) => Ok(report),
        Err(WriteError::Io { path, source }) if is_place_at_fault(&source) => {
            Err(SingleFault::Place(path, source))
        }
        Err(error) => Err(SingleFault::Frame(error.to_string())),
    }
}
