//! Renders one image, with no other frame in memory.

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
use crate::failure::{catch_panic, is_output_unavailable};
use crate::metrics::MemoryPeaks;
use crate::output::encode_preview;
use crate::report::FrameReport;

/// Reasons why there is no image.
#[derive(Debug)]
pub enum ImageError {
    /// This frame failed, for this reason.
    Frame(String),
    /// The output cannot be written, so further images would fail too: the file, and the error of the system.
    OutputUnavailable(PathBuf, io::Error),
}

/// The file format of a picture outside a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureKind {
    /// OpenEXR, like the images of a job.
    Exr,
    /// PNG, like the previews of a job.
    Png,
}

/// Renders the image of `task` with its preview. Passes notes for the user to `note`.
///
/// # Errors
/// See [`ImageError`]. No file is left behind.
pub fn make_image(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    note: impl FnMut(&str),
) -> Result<FrameReport, ImageError> {
    let traced = trace_single(setup, sequence, task, note)?;
    write_guarded(|| write_exr(setup, traced))
}

/// Renders only the image of `task`, in a file of this `kind`. Passes notes for the user to `note`.
///
/// # Errors
/// See [`ImageError`]. No file is left behind.
pub fn make_picture(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    kind: PictureKind,
    note: impl FnMut(&str),
) -> Result<FrameReport, ImageError> {
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
) -> Result<TracedFrame, ImageError> {
    let traced = catch_panic(|| {
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
    traced.map_err(ImageError::Frame)
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
) -> Result<FrameReport, ImageError> {
    match catch_panic(|| Ok(write())).map_err(ImageError::Frame)? {
        Ok(report) => Ok(report),
        Err(WriteError::Io { path, source }) if is_output_unavailable(&source) => {
            Err(ImageError::OutputUnavailable(path, source))
        }
        Err(error) => Err(ImageError::Frame(error.to_string())),
    }
}
