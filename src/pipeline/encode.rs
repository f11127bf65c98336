//! Third stage: encodes images, publishes them under their final names, and records them.

use std::io::{self, Seek, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::time::Instant;

use serde_json::json;
use spherule_formats::sequence::Sequence;
use spherule_jobs::{Job, JobError, Publisher, publish};

use super::error::{ImageError, WriteError};
use super::renderer::TracedFrame;
use super::setup::Setup;
use super::{ClaimedFrame, Event, ImageTask, OnEvent, Stage, StageResult};
use crate::metrics::{MemoryPeaks, MemoryUse};
use crate::output::{CustomAttribute, ExrOptions, encode_preview, write_exr};
use crate::render::Film;
use crate::report::FrameReport;
use crate::report::frame::RssSummary;

/// Channels to earlier stages, for use after an image is written. The receivers may have ended.
pub(super) struct AfterWrite {
    /// To the reader, without overlap: read the next frame.
    pub(super) is_written: Option<SyncSender<()>>,
    /// To the tracer: reuse the planes.
    pub(super) films: Option<Sender<Film>>,
}

pub(super) fn write_stage(
    setup: &Setup,
    sequence: &Sequence,
    traced: Receiver<ClaimedFrame<TracedFrame>>,
    next: &AfterWrite,
    job: &mut Job,
    on_event: OnEvent,
) -> Result<(), JobError> {
    let mut peaks = MemoryPeaks::default();
    let mut image_before = Instant::now();
    for ClaimedFrame { claim, result } in traced {
        match result {
            StageResult::Frame(frame) => {
                on_event(Event::StageEntered(frame.task.frame, Stage::Write));
                if !claim.is_valid() {
                    let dir = job.state().dir().to_owned();
                    return Err(JobError::DeclaredDead { dir });
                }
                // Encode and publish the image
                let task = frame.task.clone();
                if sequence.maps_files() {
                    peaks.looks_only();
                }
                match write_frame(setup, frame, &mut peaks) {
                    Ok((mut report, film)) => {
                        // Return the planes to the tracer, and record the frame
                        if let Some(films) = &next.films {
                            let _ = films.send(film);
                        }
                        report.seconds.wall = image_before.elapsed().as_secs_f64();
                        image_before = Instant::now();
                        let outputs: Vec<_> = std::iter::once(&task.image)
                            .chain(&task.preview)
                            .cloned()
                            .collect();
                        job.record_done(task.frame, &outputs, json!(report))?;
                        on_event(Event::Done(&task, &report));
                    }
                    Err(error) => fail(&task, error.into(), job, on_event)?,
                }
            }
            StageResult::Failed(failed) => {
                let (task, error) = *failed;
                fail(&task, error, job, on_event)?;
            }
        }
        claim.complete();
        if let Some(is_written) = &next.is_written {
            let _ = is_written.send(());
        }
    }
    Ok(())
}

/// Records that `task` failed, or stops the run if further images would fail too.
fn fail(
    task: &ImageTask,
    error: ImageError,
    job: &mut Job,
    on_event: OnEvent,
) -> Result<(), JobError> {
    let failure = error.into_failure(task.frame);
    if failure.kind.stops_run() {
        return Err(JobError::Stopped(failure));
    }
    on_event(Event::Failed(&failure));
    job.record_failed(&failure)
}

/// Encodes and publishes the images of `frame`. Returns the complete report and the planes, which can be reused.
pub(super) fn write_frame(
    setup: &Setup,
    frame: TracedFrame,
    peaks: &mut MemoryPeaks,
) -> Result<(FrameReport, Film), WriteError> {
    let start = Instant::now();
    let task = &frame.task;
    let mut report = frame.report.clone();
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| WriteError::Io { path, source }
    };
    // The preview first: users wait for the EXR, and the ledger entry covers both
    if let Some(path) = &task.preview {
        let png = encode_preview(&frame.film, &setup.preview_from(&frame.camera))?;
        publish(path, &png).map_err(at(path))?;
    }
    if report.bytes.file.total() > 0 {
        peaks.looks_only();
    }
    peaks.take_in(frame.memory);
    // Encode and publish the EXR
    let mut file = Publisher::create(&task.image).map_err(at(&task.image))?;
    let mut sampler = MemorySampler {
        out: &mut file,
        peaks,
        samples: 0,
    };
    let options = exr_options(setup, &frame);
    let (film, clamped) =
        write_exr(frame.film, &options, &mut sampler).map_err(|e| match e.into_io() {
            Ok(source) => at(&task.image)(source),
            Err(error) => error.into(),
        })?;
    // Complete the report
    report.clamped_pixels = clamped;
    file.commit().map_err(at(&task.image))?;
    report.seconds.encode = start.elapsed().as_secs_f64();
    let now = MemoryUse::now();
    peaks.take_in(now);
    report.rss = RssSummary {
        anonymous_peak: peaks.anonymous,
        file_peak: peaks.file,
        total_peak: peaks.total,
        anonymous: now.anonymous,
    };
    Ok((report, film))
}

/// Samples memory use during the first writes, when all buffers of the encoder exist.
struct MemorySampler<'a, W> {
    out: &'a mut W,
    peaks: &'a mut MemoryPeaks,
    samples: u32,
}

/// Number of writes with a sample. The header is written before blocks are compressed.
const MAX_SAMPLES: u32 = 16;

impl<W: Write> Write for MemorySampler<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.samples < MAX_SAMPLES {
            self.samples += 1;
            self.peaks.take_in(MemoryUse::now());
        }
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl<W: Seek> Seek for MemorySampler<'_, W> {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}

/// Options of the EXR of `frame`, including an attribute with data for compositing.
fn exr_options(setup: &Setup, frame: &TracedFrame) -> ExrOptions {
    let facts = json!({
        "frame": frame.task.frame,
        "time": frame.time,
        "origin": setup.picture.origin.to_array(),
        "particles": frame.report.particles,
    });
    ExrOptions {
        custom: Some(CustomAttribute {
            name: "spherule".to_owned(),
            json: facts.to_string(),
        }),
        world_to_camera: Some(frame.camera.world_to_camera()),
        ..setup.picture.exr.clone()
    }
}
