//! The errors of a job, divided by what the caller can do about them. Messages say what is wrong. Remedies that
//! depend on the command line are the caller's.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use crate::{FileError, FrameFailure, InputChange, SettingChange};

/// Why a job cannot start or continue.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The settings differ from those in the plan.
    #[error("{}: settings have changed since this job began: {}", dir.display(), list_some(changes))]
    SettingsChanged {
        /// The job's directory.
        dir: PathBuf,
        /// The changes, in the order of the settings.
        changes: Vec<SettingChange>,
    },
    /// Inputs of finished frames have changed.
    #[error("{}: inputs of finished frames have changed: {}", dir.display(), list_some(changes))]
    InputChanged {
        /// The job's directory.
        dir: PathBuf,
        /// The changes, by frame.
        changes: Vec<InputChange>,
    },
    /// The job was started with another input: none of its files is among the given ones, and the same frames
    /// have other contents.
    #[error("{}: this job was made from other files ({}, now {})", dir.display(), planned.display(), given.display())]
    OtherInput {
        /// The job's directory.
        dir: PathBuf,
        /// A file of the plan.
        planned: PathBuf,
        /// A file of this request.
        given: PathBuf,
        /// Whether they are in the same directory. [`crate::ResumeMode::KeepDone`] then accepts the input.
        is_same_dir: bool,
    },
    /// Files with the names of outputs exist that no worker of this job has written.
    #[error("{}: already exists and was not written by this job", first_of(paths))]
    OutputsExist {
        /// The files; at least one.
        paths: Vec<PathBuf>,
    },
    /// The plan exists but cannot be read.
    #[error("{}: {source}", path.display())]
    PlanDamaged {
        /// The plan.
        path: PathBuf,
        /// Why.
        source: PlanError,
    },
    /// There is a ledger but no plan that gives its lines a meaning.
    #[error("{}: the ledger has lines but {} is missing", ledger.display(), crate::PLAN_FILE)]
    PlanMissing {
        /// The ledger.
        ledger: PathBuf,
    },
    /// A line of a ledger, other than an incomplete last one, cannot be read.
    #[error("{}: line {line}: {source}", path.display())]
    LedgerDamaged {
        /// The ledger.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Why.
        source: EntryError,
    },
    /// The operation is not possible while another worker is active.
    #[error("{}: {worker} is working on this job", dir.display())]
    Busy {
        /// The job's directory.
        dir: PathBuf,
        /// The other worker.
        worker: String,
    },
    /// Other workers have declared this worker dead, or the directory `job.work` was removed.
    #[error("{}: this worker missed its heartbeats and its frames were reassigned", dir.display())]
    DeclaredDead {
        /// The job's directory.
        dir: PathBuf,
    },
    /// A file of the job cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The caller could not resolve the automatic settings.
    #[error(transparent)]
    Resolve(Box<dyn std::error::Error + Send + Sync>),
    /// A failure of a frame stopped the run.
    #[error(transparent)]
    Stopped(FrameFailure),
    /// The request has two frames with the same number.
    #[error("frame {frame} occurs twice")]
    DuplicateFrame {
        /// The number.
        frame: i64,
    },
    /// Two frames of the request have the same output.
    #[error("{}: frames {} and {} have the same output", path.display(), frames[0], frames[1])]
    SharedOutput {
        /// The output.
        path: PathBuf,
        /// The frames.
        frames: [i64; 2],
    },
    /// A frame of the request has the same output as another frame of the existing plan.
    #[error("{}: frame {planned} of the job has this output, frame {requested} would have the same", path.display())]
    PlannedOutput {
        /// The output.
        path: PathBuf,
        /// The frame in the plan.
        planned: i64,
        /// The frame of the request.
        requested: i64,
    },
    /// A path cannot be stored in a plan.
    #[error("{}: the path is not UTF-8 and cannot be stored in a plan; rename it", path.display())]
    NotUtf8 {
        /// The path.
        path: PathBuf,
    },
    /// A result was recorded for a frame that is not in the plan.
    #[error("frame {frame} is not in the plan")]
    UnknownFrame {
        /// The number.
        frame: i64,
    },
    /// A plan or a ledger entry cannot be serialised.
    #[error("{}: cannot serialise: {source}", path.display())]
    Serialize {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
}

impl JobError {
    /// The error for a file on which `action` failed.
    pub(crate) fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        Self::File(FileError::new(path, action, source))
    }
}

/// Why a plan cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// It is not JSON, or not that of a plan.
    #[error("not a readable plan ({0})")]
    Json(#[from] serde_json::Error),
    /// Its version is unknown.
    #[error("the plan has version {found}; this program reads versions 1 to {latest}")]
    Version {
        /// The version.
        found: u32,
        /// The latest known version.
        latest: u32,
    },
    /// Its checksum is wrong.
    #[error("the plan does not match its checksum; it is damaged or was edited")]
    Checksum,
    /// The checksum of the settings in a plan of version 1 is wrong.
    #[error("the settings in the plan do not match their fingerprint")]
    SettingsChecksum,
    /// Its frames are not in ascending order.
    #[error("the frames in the plan are not in ascending order")]
    Unordered,
}

/// Why a line of a ledger cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum EntryError {
    /// It is not JSON, or not that of an entry.
    #[error("not a ledger entry ({0})")]
    Json(#[from] serde_json::Error),
    /// It is too long.
    #[error("not a ledger entry (longer than {max} bytes)")]
    TooLong {
        /// The limit.
        max: u64,
    },
    /// The ledger cannot be read up to its end.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// The first of `paths`, and the number of the others.
fn first_of(paths: &[PathBuf]) -> String {
    let first = paths.first().map(|path| path.display().to_string()).unwrap_or_default();
    match paths.len() {
        0 | 1 => first,
        2 => format!("{first} and 1 more file"),
        count => format!("{first} and {} more files", count - 1),
    }
}

/// The first few of `items`, and the number of the others.
fn list_some(items: &[impl fmt::Display]) -> String {
    const MAX_SHOWN: usize = 8;
    let shown = items.iter().take(MAX_SHOWN);
    let mut text: Vec<String> = shown.map(ToString::to_string).collect();
    if items.len() > MAX_SHOWN {
        text.push(format!("and {} more", items.len() - MAX_SHOWN));
    }
    text.join("; ")
}
