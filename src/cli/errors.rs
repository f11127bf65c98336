//! Errors of commands. Libraries say what is wrong; this module adds the remedies that name options of the command
//! line.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use spherule_formats::FrameError;
use spherule_formats::sequence::SequenceError;
use spherule_jobs::export::ExportError;
use spherule_jobs::{FileError, JobError, PLAN_FILE};

use crate::job::{JOB_FILE, RunError};
use crate::manifest::ManifestError;
use crate::pipeline::MeshLoadError;
use crate::resolve::ResolveError;
use crate::survey::ELEMENT;

#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    #[error("{}", run_message(.0))]
    Run(#[from] RunError),
    #[error("{}", WithRemedy(.0, export_remedy(.0)))]
    Export(#[from] ExportError),
    #[error("{}", io_message(path, source))]
    Io { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Other(String),
}

/// Converts errors of libraries by way of [`RunError`].
macro_rules! from_run_error {
    ($($error:ty),*) => {
        $(impl From<$error> for CliError {
            fn from(error: $error) -> Self {
                Self::Run(error.into())
            }
        })*
    };
}

from_run_error!(ManifestError, SequenceError, FrameError, JobError);

/// An error followed by its remedy.
struct WithRemedy<'a, E>(&'a E, Option<&'static str>);

impl<E: fmt::Display> fmt::Display for WithRemedy<'_, E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)?;
        self.1.map_or(Ok(()), |remedy| write!(f, "; {remedy}"))
    }
}

/// The message of an error of a run.
fn run_message(error: &RunError) -> String {
    match error {
        RunError::Sequence(SequenceError::NoFrames { path, .. }) if is_render_job(path) => {
            format!(
                "{}: the directory of a render job; continue it with: spherule render {}",
                path.display(),
                path.join(JOB_FILE).display()
            )
        }
        RunError::Sequence(SequenceError::Topology(error) | SequenceError::List(error))
        | RunError::Frame(error)
            if is_missing(error) =>
        {
            frame_message(error)
        }
        RunError::Mesh { index, source: MeshLoadError::File(error) } => {
            format!("mesh.{index}.path: {}", frame_message(error))
        }
        _ => WithRemedy(error, run_remedy(error)).to_string(),
    }
}

/// Whether `dir` has images of a job, which are not particles.
fn is_render_job(dir: &Path) -> bool {
    dir.join(PLAN_FILE).is_file() && dir.join(JOB_FILE).is_file()
}

fn is_missing(error: &FrameError) -> bool {
    matches!(error, FrameError::Io { source, .. } if matches!(source.kind(), io::ErrorKind::NotFound))
}

/// The message about a file, with the names of files that may have been meant.
pub(super) fn frame_message(error: &FrameError) -> String {
    match error {
        FrameError::Io { path, .. } if is_missing(error) => {
            SequenceError::missing(path).to_string()
        }
        other => other.to_string(),
    }
}

/// What the user can do about an error of a run.
fn run_remedy(error: &RunError) -> Option<&'static str> {
    Some(match error {
        RunError::Job(error) => return job_remedy(error),
        RunError::Resolve(error) => return resolve_remedy(error),
        RunError::Sequence(SequenceError::Outside { .. }) => {
            "--follow-links (input.follow_links = true) allows them"
        }
        RunError::File(error) => return file_remedy(error),
        RunError::OutputIsFile { .. } => "choose another output",
        RunError::OtherKind { .. } => "choose another directory, or discard that job with --force",
        RunError::ForeignManifest { .. } => {
            "render that file, choose another output directory, or move the file away"
        }
        RunError::OverwritesInput { .. } => "choose another output directory",
        RunError::OneName { .. } => "give a directory, or select one frame with --frames",
        RunError::StoredSurvey { .. } => "start over with --force",
        _ => return None,
    })
}

/// What the user can do about an error of a job.
fn job_remedy(error: &JobError) -> Option<&'static str> {
    // Remedies name options, which libraries do not know
    Some(match error {
        JobError::SettingsChanged { .. } | JobError::InputChanged { .. } => {
            "--force starts over, --keep-done keeps what is there"
        }
        JobError::OtherInput { is_same_dir, .. } if *is_same_dir => {
            "choose another output, keep what is there with --keep-done, or start over with --force"
        }
        JobError::OtherInput { .. } => "choose another output, or start over with --force",
        JobError::OutputsExist { .. } => {
            "choose another output, move the file away, or replace it with --force"
        }
        JobError::PlanDamaged { .. } | JobError::PlanMissing { .. } => {
            "restore it, or start over with --force"
        }
        JobError::LedgerDamaged { .. } => {
            "remove that line to repeat its frame, or start over with --force"
        }
        JobError::Busy { .. } => "wait for it, or stop it first",
        JobError::DeclaredDead { .. } => "the same command rejoins the job",
        JobError::File(error) => return file_remedy(error),
        JobError::SharedOutput { .. } => "put #### into the output's name",
        JobError::PlannedOutput { .. } => {
            "put #### into the name, choose another one, or start over with --force"
        }
        JobError::Stopped(failure) => return file_remedy(failure.source.downcast_ref()?),
        JobError::Resolve(source) => return source.downcast_ref().and_then(run_remedy),
        _ => return None,
    })
}

/// What the user can do about a file of a job.
const fn file_remedy(error: &FileError) -> Option<&'static str> {
    match error {
        FileError::Unwritable { .. } => Some("check its permissions, or choose another directory"),
        FileError::DiskFull { .. } => Some("free some, then the same command continues"),
        FileError::Other { .. } => None,
    }
}

/// What the user can do if the manifest and the particles do not go together.
fn resolve_remedy(error: &ResolveError) -> Option<&'static str> {
    match error {
        ResolveError::NoRadius => Some("give a length with --radius"),
        ResolveError::MissingAttribute { key, name, .. }
            if *key == "bonds.find" && name == ELEMENT =>
        {
            Some(
                "give a file that has elements with --topology, or a distance, such as --bonds 1.8",
            )
        }
        _ => None,
    }
}

/// What the user can do if a job cannot be exported.
fn export_remedy(error: &ExportError) -> Option<&'static str> {
    let is_too_long = matches!(error, ExportError::TooManyGaps { .. });
    is_too_long.then_some("export them in parts with --frames")
}

/// The message about a file that the operating system refuses, with a remedy if there is one.
fn io_message(path: &Path, error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => SequenceError::missing(path).to_string(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            format!("{}: no space left; free some and run the same command again", path.display())
        }
        _ => format!("{}: {error}", path.display()),
    }
}

impl CliError {
    pub(super) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    /// The messages, one per line.
    pub(super) fn messages(&self) -> Vec<String> {
        match self {
            Self::Run(RunError::Manifest(error)) => error.messages().to_vec(),
            other => vec![other.to_string()],
        }
    }

    pub(super) fn other(what: impl Into<String>) -> Self {
        Self::Other(what.into())
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use spherule_jobs::{FrameFailure, JobError};

    use super::*;

    /// The kind of the failure decides, through any number of layers.
    #[test]
    fn remedies_follow_the_kind_of_an_error() {
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        let stopped = FrameFailure::writing(3, Path::new("out/f.exr"), full());
        for (error, message) in [
            (
                CliError::from(JobError::Stopped(stopped)),
                "out/f.exr: no space left; free some, then the same command continues",
            ),
            (
                CliError::from(JobError::Resolve(Box::new(RunError::from(ResolveError::NoRadius)))),
                "give a length with --radius",
            ),
            (
                CliError::from(JobError::OutputsExist {
                    paths: vec![PathBuf::from("a.exr"), PathBuf::from("b.exr")],
                }),
                "a.exr and 1 more file: already exists and was not written by this job; choose another output",
            ),
            (
                CliError::io(Path::new("x"))(full()),
                "x: no space left; free some and run the same command again",
            ),
        ] {
            let text = error.to_string();
            assert!(text.contains(message), "{text}");
        }
    }
}
