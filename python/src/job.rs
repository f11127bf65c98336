//! Runs render jobs as the command does.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use spherule::job::{JobManifest, RenderJob, RenderRun};
use spherule::manifest::{Manifest, ManifestSource, read_manifest, real_dir};
use spherule::report::FrameReport;
use spherule_jobs::{FrameEvent, Interrupt, JobSummary, ResumeMode};

use crate::errors::{Class, Failure};
use crate::settings::{overrides, raised};
use crate::threads;

/// Runs the job of a manifest, and returns its directory and a summary of its frames; see `spherule.Job.run`.
#[pyfunction]
#[pyo3(signature = (file, settings, *, base, mode, progress, threads))]
pub(crate) fn run_job<'py>(
    py: Python<'py>,
    file: Option<PathBuf>,
    settings: &str,
    base: PathBuf,
    mode: &str,
    progress: Option<Py<PyAny>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    let mode = mode_of(mode);
    let interrupt = Interrupt::new();
    // Pass events to Python; the first exception stops the job
    let exception: Mutex<Option<PyErr>> = Mutex::new(None);
    let on_event = |event: FrameEvent<'_, FrameReport>| {
        let Some(progress) = &progress else {
            return;
        };
        let called = Python::attach(|py| match described(py, &event)? {
            Some(event) => progress.call1(py, (event,)).map(drop),
            None => Ok(()),
        });
        if let Err(error) = called {
            interrupt.raise();
            if let Ok(mut first) = exception.lock() {
                first.get_or_insert(error);
            }
        }
    };
    let on_signal = || interrupt.raise();
    // Run the job while other threads of Python continue
    let done = threads::run(py, threads, on_signal, || {
        let mut manifest = manifest(file.as_deref(), settings, base)?;
        let mut sequence = manifest.open_sequence()?;
        for line in manifest.complete(&mut sequence, Some(mode))? {
            on_event(FrameEvent::Note(&line));
        }
        let job = RenderJob::new(manifest, &sequence, None)?;
        let mut run = RenderRun::open(job, sequence, mode)?;
        for note in run.notes() {
            on_event(FrameEvent::Note(note));
        }
        run.render_pending(&interrupt, &on_event)?;
        run.write_reports()?;
        Ok((run.render_job().dir().to_owned(), run.job().summary()))
    });
    if let Some(error) = exception.into_inner().ok().flatten() {
        return Err(error);
    }
    let (dir, summary) = done?;
    summary_dict(py, &dir, summary)
}

fn mode_of(name: &str) -> ResumeMode {
    match name {
        "force" => ResumeMode::Force,
        "keep_done" => ResumeMode::KeepDone,
        _ => ResumeMode::Resume,
    }
}

/// The directory of a job and the counts of its frames, as Python receives them.
fn summary_dict<'py>(
    py: Python<'py>,
    dir: &Path,
    summary: JobSummary,
) -> PyResult<Bound<'py, PyDict>> {
    let result = PyDict::new(py);
    result.set_item("dir", dir)?;
    result.set_item("total", summary.total)?;
    result.set_item("done", summary.done)?;
    result.set_item("pending", summary.pending)?;
    result.set_item("failed", summary.failed)?;
    Ok(result)
}

/// The directory of the images of a job; see `spherule.Job.dir`.
#[pyfunction]
#[pyo3(signature = (file, settings, *, base))]
pub(crate) fn job_dir(
    py: Python<'_>,
    file: Option<PathBuf>,
    settings: &str,
    base: PathBuf,
) -> PyResult<PathBuf> {
    let requested = raised(py, manifest(file.as_deref(), settings, base))?;
    let base = raised(py, requested.absolute_base())?;
    Ok(real_dir(&base.join(requested.manifest.output.path.dir())))
}

/// Writes a manifest that consists of `settings` to `path`, with paths relative to its directory.
#[pyfunction]
#[pyo3(signature = (path, settings, *, base))]
pub(crate) fn write_manifest(
    py: Python<'_>,
    path: PathBuf,
    settings: &str,
    base: PathBuf,
) -> PyResult<()> {
    let written = || -> Result<(), Failure> {
        let mut requested = manifest(None, settings, base.clone())?;
        // What cannot be opened is reported when the manifest is used
        if let Ok(mut sequence) = requested.open_sequence() {
            requested.complete(&mut sequence, Some(ResumeMode::Resume))?;
        }
        let mut manifest = requested.manifest;
        let dir = path.parent().map_or_else(PathBuf::new, real_dir);
        let moved = manifest.rebase(&base, &dir);
        moved.map_err(|error| Failure::new(Class::Setting, error))?;
        let written = std::fs::write(&path, manifest.to_commented_toml());
        written.map_err(|error| Failure::new(Class::Output, format!("{}: {error}", path.display())))
    };
    raised(py, written())
}

/// The manifest in `file`, or one that consists of `settings`, whose paths begin at `base`.
fn manifest(file: Option<&Path>, settings: &str, base: PathBuf) -> Result<JobManifest, Failure> {
    let overrides = overrides(settings)?;
    let Some(file) = file else {
        let source = ManifestSource::new("", Path::new("settings"), overrides);
        let (manifest, _) = source.parse()?;
        return Ok(JobManifest { source: Some(source), ..JobManifest::new(manifest, base) });
    };
    let text = read_manifest(file)
        .map_err(|error| Failure::new(Class::Input, format!("{}: {error}", file.display())))?;
    let source = ManifestSource::new(&*text, file, overrides);
    let (manifest, _) = source.parse()?;
    Ok(JobManifest {
        manifest,
        base: file.parent().map_or_else(PathBuf::new, Path::to_owned),
        file: Some(file.to_owned()),
        unchanged: Manifest::parse(&text, file).ok(),
        source: Some(source),
    })
}

/// A dict for the `progress` callable; None for events that it does not get.
fn described<'py>(
    py: Python<'py>,
    event: &FrameEvent<'_, FrameReport>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let dict = PyDict::new(py);
    match event {
        FrameEvent::Stage { frame, stage } => {
            dict.set_item("event", "stage")?;
            dict.set_item("frame", frame)?;
            dict.set_item("stage", stage)?;
        }
        FrameEvent::Done { frame, finished } => {
            dict.set_item("event", "done")?;
            dict.set_item("frame", frame)?;
            dict.set_item("outputs", finished.outputs.clone())?;
        }
        FrameEvent::Failed(failure) => {
            dict.set_item("event", "failed")?;
            dict.set_item("frame", failure.frame)?;
            dict.set_item("reason", failure.source.to_string())?;
        }
        FrameEvent::Note(text) => {
            dict.set_item("event", "note")?;
            dict.set_item("text", text)?;
        }
        FrameEvent::Retrying { .. } | FrameEvent::OtherWorker(_) => return Ok(None),
    }
    Ok(Some(dict))
}
