//! One image by itself, in a process of its own: nothing of another frame is there.

use std::io;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use spherule_formats::Sequence;

use super::ImageTask;
use super::encode::{WriteError, write_frame};
use super::load::load_frame;
use super::setup::Setup;
use super::trace::FrameTracer;
use crate::mishap::{guarded, is_place_at_fault};
use crate::report::{FrameReport, MemoryPeaks};

/// Why there is no image.
#[derive(Debug)]
pub enum SingleFault {
    /// The frame is at fault; the reason.
    Frame(String),
    /// Further images would fail, too: the file that was being written, and what the system said.
    Place(PathBuf, io::Error),
}

/// Makes the image of `task` with its preview; what the user should know goes to `note`.
///
/// # Errors
/// See [`SingleFault`]; nothing is left behind then.
pub fn make_image(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    mut note: impl FnMut(&str),
) -> Result<FrameReport, SingleFault> {
    let traced = guarded(|| {
        let mut frame = load_frame(setup, sequence, task).map_err(|e| e.to_string())?;
        std::mem::take(&mut frame.notes)
            .iter()
            .for_each(|n| note(n));
        let mut tracer = FrameTracer::new();
        let mut built = tracer.build(setup, frame).map_err(|e| e.to_string())?;
        std::mem::take(&mut built.notes)
            .iter()
            .for_each(|n| note(n));
        let stop = AtomicBool::new(false);
        tracer.trace(setup, built, &stop).map_err(|e| e.to_string())
    });
    let traced = traced.map_err(SingleFault::Frame)?;
    let mut peaks = MemoryPeaks::default();
    let written = guarded(|| Ok(write_frame(setup, traced, &mut peaks)));
    match written.map_err(SingleFault::Frame)? {
        Ok(report) => Ok(report),
        Err(WriteError::Io { path, source }) if is_place_at_fault(&source) => {
            Err(SingleFault::Place(path, source))
        }
        Err(error) => Err(SingleFault::Frame(error.to_string())),
    }
}
