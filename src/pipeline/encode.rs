//! Encodes images, and publishes them under their final names.

use std::io::{self, Cursor, Seek, Write};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde_json::json;
use spherule_files::memory::{MemoryPeaks, MemoryUse};
use spherule_jobs::{Publisher, publish};

use super::error::WriteError;
use super::overlays;
use super::renderer::TracedFrame;
use super::setup::Setup;
use crate::output::{
    CustomAttribute, ExrOptions, OutputError, PictureFormat, encode_figure, encode_picture,
    encode_preview, write_exr,
};
use crate::render::Film;
use crate::report::FrameReport;
use crate::report::frame::RssSummary;

/// Encodes and publishes the images of `frame`. Returns the complete report and the planes, which can be reused.
pub(super) fn write_frame(
    setup: &Setup,
    mut frame: TracedFrame,
    peaks: &Mutex<MemoryPeaks>,
) -> Result<(FrameReport, Film), WriteError> {
    let start = Instant::now();
    let sprites = setup.overlays_of(&frame);
    overlays::store(&mut frame.film, &sprites, setup.film_at());
    let task = &frame.task;
    let mut report = frame.report.clone();
    // The preview first: users wait for the EXR, and the ledger entry covers both
    if let Some(path) = &task.preview {
        let png = encode_preview(&frame.film, &setup.preview_from(&frame.camera), &sprites)?;
        publish(path, &png).map_err(at(path))?;
    }
    // Encode the picture, unless it is an EXR, which is written while it is encoded
    let format = PictureFormat::of(&task.image).unwrap_or(PictureFormat::Exr);
    let picture = match format {
        PictureFormat::Exr => None,
        PictureFormat::Pdf | PictureFormat::Svg if frame.camera.eyes() == [1, 1] => {
            let options = setup.preview_from(&frame.camera);
            let drawings = setup.drawings_of(&frame);
            Some(encode_figure(&frame.film, &options, drawings, format)?)
        }
        format => {
            let options = setup.preview_from(&frame.camera);
            Some(encode_picture(&frame.film, &options, &sprites, format)?)
        }
    };
    drop(sprites);
    // Measure the memory while the picture is still there
    {
        let mut peaks = lock_peaks(peaks);
        if report.bytes.file.total() > 0 {
            peaks.use_samples_only();
        }
        peaks.update(frame.memory);
    }
    // Publish it under its final name
    let (film, clamped) = match picture {
        Some(picture) => {
            lock_peaks(peaks).update(MemoryUse::now());
            publish(&task.image, &picture).map_err(at(&task.image))?;
            (frame.film, 0)
        }
        None => publish_exr(setup, frame, peaks)?,
    };
    // Complete the report
    report.clamped_pixels = clamped;
    report.seconds.encode = start.elapsed().as_secs_f64();
    report.rss = rss_summary(peaks);
    Ok((report, film))
}

/// The memory in use, and its peaks including it.
fn rss_summary(peaks: &Mutex<MemoryPeaks>) -> RssSummary {
    let now = MemoryUse::now();
    let mut peaks = lock_peaks(peaks);
    peaks.update(now);
    RssSummary {
        anonymous_peak: peaks.anonymous,
        file_peak: peaks.file,
        total_peak: peaks.total,
        anonymous: now.anonymous,
    }
}

/// The peaks, which all encoders update.
pub(super) fn lock_peaks(peaks: &Mutex<MemoryPeaks>) -> MutexGuard<'_, MemoryPeaks> {
    peaks.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Encodes the EXR of `frame` and publishes it. Returns its planes, and the number of clamped values.
fn publish_exr(
    setup: &Setup,
    frame: TracedFrame,
    peaks: &Mutex<MemoryPeaks>,
) -> Result<(Film, u64), WriteError> {
    let task = &frame.task;
    let mut file = Publisher::create(&task.image).map_err(at(&task.image))?;
    let mut sampler = MemorySampler { out: &mut file, peaks, samples: 0 };
    let options = exr_options(setup, &frame);
    let (film, clamped) =
        write_exr(frame.film, &options, &mut sampler).map_err(|e| match e.into_io() {
            Ok(source) => at(&task.image)(source),
            Err(error) => error.into(),
        })?;
    file.commit().map_err(at(&task.image))?;
    Ok((film, clamped))
}

/// The error of writing to `path`.
fn at(path: &Path) -> impl Fn(io::Error) -> WriteError + use<> {
    let path = path.to_owned();
    move |source| WriteError::Io { path: path.clone(), source }
}

impl TracedFrame {
    /// The EXR as bytes, the same as a job writes.
    ///
    /// # Errors
    /// The encoder fails.
    pub fn to_exr(&self, setup: &Setup) -> Result<Vec<u8>, OutputError> {
        let mut film = self.film.clone();
        overlays::store(&mut film, &setup.overlays_of(self), setup.film_at());
        let mut file = Cursor::new(Vec::new());
        write_exr(film, &exr_options(setup, self), &mut file)?;
        Ok(file.into_inner())
    }

    /// The PNG as bytes, the same as a preview of a job.
    ///
    /// # Errors
    /// The encoder fails.
    pub fn to_png(&self, setup: &Setup) -> Result<Vec<u8>, OutputError> {
        self.to_picture(setup, PictureFormat::Png)
    }

    /// The bytes of a picture in a format other than EXR, after the view transform, with overlays.
    ///
    /// # Errors
    /// The encoder fails, or the format has no alpha, which the background needs.
    pub fn to_picture(&self, setup: &Setup, format: PictureFormat) -> Result<Vec<u8>, OutputError> {
        let options = setup.preview_from(&self.camera);
        encode_picture(&self.film, &options, &setup.overlays_of(self), format)
    }
}

/// Samples memory use during the first writes, when all buffers of the encoder exist.
struct MemorySampler<'a, W> {
    out: &'a mut W,
    peaks: &'a Mutex<MemoryPeaks>,
    samples: u32,
}

/// Number of writes with a sample. The header is written before blocks are compressed.
const MAX_SAMPLES: u32 = 16;

impl<W: Write> Write for MemorySampler<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.samples < MAX_SAMPLES {
            self.samples += 1;
            lock_peaks(self.peaks).update(MemoryUse::now());
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
        custom: Some(CustomAttribute { name: "spherule".to_owned(), json: facts.to_string() }),
        world_to_camera: Some(frame.camera.world_to_camera()),
        world_to_ndc: frame.camera.world_to_ndc(),
        screen_window_width: frame.camera.screen_window_width(),
        field_of_view: frame.camera.field_of_view(),
        texts: frame.texts.clone(),
        ..setup.picture.files.exr.clone()
    }
}
