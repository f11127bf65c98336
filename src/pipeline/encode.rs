//! Third stage: images are encoded, published under their final names, and recorded.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use std::time::Instant;

use serde_json::json;
use spherule_jobs::{Job, JobError, publish};

use super::setup::Setup;
use super::trace::TracedFrame;
use super::{Event, Passed, Stage, Watch};
use crate::output::{
    CustomAttribute, EncodedExr, ExrOptions, OutputError, encode_exr, encode_preview,
};
use crate::report::frame::RssSummary;
use crate::report::{FrameReport, MemoryUse};

/// Why an image is not there.
#[derive(Debug, thiserror::Error)]
pub(super) enum WriteError {
    /// It cannot be encoded.
    #[error(transparent)]
    Encode(#[from] OutputError),
    /// It cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The image.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}

/// Whether all further images would fail for the same reason.
fn is_disk_full(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    )
}

pub(super) fn write_stage(
    setup: &Setup,
    traced: Receiver<Passed<TracedFrame>>,
    job: &mut Job,
    watch: Watch,
) -> Result<(), JobError> {
    let mut peak = MemoryUse::default();
    let mut image_before = Instant::now();
    for passed in traced {
        match passed {
            Passed::Frame(frame) => {
                watch(Event::Entered(frame.task.frame, Stage::Write));
                let task = frame.task.clone();
                match write_frame(setup, frame, &mut peak) {
                    Ok(mut report) => {
                        report.seconds.wall = image_before.elapsed().as_secs_f64();
                        image_before = Instant::now();
                        let outputs: Vec<_> = std::iter::once(&task.image)
                            .chain(&task.preview)
                            .cloned()
                            .collect();
                        job.record_done(task.frame, &outputs, json!(report))?;
                        watch(Event::Done(&task, &report));
                    }
                    // Not the frame's fault: it stays to be done.
                    Err(WriteError::Io { path, source }) if is_disk_full(&source) => {
                        return Err(JobError::DiskFull { path, source });
                    }
                    Err(error) => {
                        let reason = error.to_string();
                        watch(Event::Failed(task.frame, &reason));
                        job.record_failed(task.frame, &reason, json!(null))?;
                    }
                }
            }
            Passed::Failed(task, reason) => {
                watch(Event::Failed(task.frame, &reason));
                job.record_failed(task.frame, &reason, json!(null))?;
            }
        }
    }
    Ok(())
}

/// Encodes and publishes the images of `frame`; the report is complete then.
fn write_frame(
    setup: &Setup,
    frame: TracedFrame,
    peak: &mut MemoryUse,
) -> Result<FrameReport, WriteError> {
    let start = Instant::now();
    let task = &frame.task;
    let mut report = frame.report.clone();
    let exr = encode_frame(setup, &frame)?;
    report.clamped_pixels = exr.clamped;
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| WriteError::Io { path, source }
    };
    // The preview first: a ledger line vouches for both, and the EXR is what people wait for.
    if let Some(path) = &task.preview {
        let png = encode_preview(&frame.film, &setup.preview)?;
        publish(path, &png).map_err(at(path))?;
    }
    publish(&task.image, &exr.bytes).map_err(at(&task.image))?;
    report.seconds.encode = start.elapsed().as_secs_f64();
    let now = MemoryUse::now();
    peak.anonymous = peak.anonymous.max(now.anonymous);
    peak.file = peak.file.max(now.file);
    report.rss = RssSummary {
        anonymous_peak: peak.anonymous,
        file_peak: peak.file,
        total_peak: now.peak,
    };
    Ok(report)
}

/// The EXR of `frame`, with what a compositor may ask about it in one attribute.
///
/// # Errors
/// If the image cannot be encoded.
pub fn encode_frame(setup: &Setup, frame: &TracedFrame) -> Result<EncodedExr, OutputError> {
    let facts = json!({
        "frame": frame.task.frame,
        "time": frame.time,
        "origin": setup.origin.to_array(),
        "particles": frame.report.particles,
    });
    let options = ExrOptions {
        custom: Some(CustomAttribute {
            name: "spherule".to_owned(),
            json: facts.to_string(),
        }),
        ..setup.exr.clone()
    };
    encode_exr(&frame.film, &options)
}
