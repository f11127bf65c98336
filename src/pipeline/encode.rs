//! Third stage: images are encoded, published under their final names, and recorded.

use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::time::Instant;

use serde_json::json;
use spherule_jobs::{Job, JobError, Publisher, publish};

use super::renderer::TracedFrame;
use super::setup::Setup;
use super::{Event, InHand, Passed, Stage, Watch};
use crate::metrics::{MemoryPeaks, MemoryUse};
use crate::mishap::is_place_at_fault;
use crate::output::{CustomAttribute, ExrOptions, OutputError, encode_preview, write_exr};
use crate::render::Film;
use crate::report::FrameReport;
use crate::report::frame::RssSummary;

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

/// Who is told when an image is written. They may have ended by then.
pub(super) struct Written {
    /// Whoever reads the next frame only then.
    pub(super) is_written: Option<SyncSender<()>>,
    /// Whoever traces into the same planes again.
    pub(super) films: Option<Sender<Film>>,
}

pub(super) fn write_stage(
    setup: &Setup,
    traced: Receiver<InHand<TracedFrame>>,
    next: &Written,
    job: &mut Job,
    watch: Watch,
) -> Result<(), JobError> {
    let mut peaks = MemoryPeaks::default();
    let mut image_before = Instant::now();
    for InHand { claim, passed } in traced {
        match passed {
            Passed::Frame(frame) => {
                watch(Event::Entered(frame.task.frame, Stage::Write));
                if !claim.is_valid() {
                    let dir = job.state().dir().to_owned();
                    return Err(JobError::TakenForDead { dir });
                }
                let task = frame.task.clone();
                match write_frame(setup, frame, &mut peaks) {
                    Ok((mut report, film)) => {
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
                        watch(Event::Done(&task, &report));
                    }
                    // Not the frame's fault: it stays to be done.
                    Err(WriteError::Io { path, source }) if is_place_at_fault(&source) => {
                        return Err(JobError::writing(&path, source));
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
        claim.end();
        if let Some(is_written) = &next.is_written {
            let _ = is_written.send(());
        }
    }
    Ok(())
}

/// Encodes and publishes the images of `frame`; the report is complete then, and the planes can serve another.
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
    // The preview first: a ledger line vouches for both, and the EXR is what people wait for.
    if let Some(path) = &task.preview {
        let png = encode_preview(&frame.film, &setup.preview_from(&frame.camera))?;
        publish(path, &png).map_err(at(path))?;
    }
    if report.bytes.file.total() > 0 {
        peaks.looks_only();
    }
    peaks.take_in(frame.memory);
    let mut file = Publisher::create(&task.image).map_err(at(&task.image))?;
    let mut looking = Looking {
        out: &mut file,
        peaks,
        looks: 0,
    };
    let options = exr_options(setup, &frame);
    let (film, clamped) =
        write_exr(frame.film, &options, &mut looking).map_err(|e| match e.into_io() {
            Ok(source) => at(&task.image)(source),
            Err(error) => error.into(),
        })?;
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

/// Looks at memory when the first bytes come through: then all that encoding takes is there.
struct Looking<'a, W> {
    out: &'a mut W,
    peaks: &'a mut MemoryPeaks,
    looks: u32,
}

/// Writes looked at: the header is written before blocks are compressed.
const LOOKS: u32 = 16;

impl<W: Write> Write for Looking<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.looks < LOOKS {
            self.looks += 1;
            self.peaks.take_in(MemoryUse::now());
        }
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl<W: Seek> Seek for Looking<'_, W> {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}

/// How the EXR of `frame` is written, with what a compositor may ask about it in one attribute.
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
