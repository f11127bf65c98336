//! The errors of a job, divided by what the caller can do about them.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A setting that differs from the one in the plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingChange {
    /// Dotted key.
    pub key: String,
    /// Value in the plan, if it was set.
    pub old: Option<String>,
    /// Value of this request, if it is set.
    pub new: Option<String>,
}

impl fmt::Display for SettingChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let show = |value: &Option<String>| value.clone().unwrap_or_else(|| "(not set)".to_owned());
        write!(
            f,
            "{}: {} -> {}",
            self.key,
            show(&self.old),
            show(&self.new)
        )
    }
}

/// An input file of a finished frame that has changed since.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputChange {
    /// The frame.
    pub frame: i64,
    /// The file.
    pub path: PathBuf,
    /// The difference.
    pub what: String,
}

impl fmt::Display for InputChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "frame {}: {}: {}",
            self.frame,
            self.path.display(),
            self.what
        )
    }
}

/// Why a job cannot start or continue.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The settings differ from those in the plan.
    #[error("{}: settings have changed since this job began: {}; --force starts over, --keep-done keeps what is there", dir.display(), list_some(changes))]
    SettingsChanged {
        /// The job's directory.
        dir: PathBuf,
        /// The changes, in the order of the settings.
        changes: Vec<SettingChange>,
    },
    /// Inputs of finished frames have changed.
    #[error("{}: inputs of finished frames have changed: {}; --force starts over, --keep-done keeps what is there", dir.display(), list_some(changes))]
    InputChanged {
        /// The job's directory.
        dir: PathBuf,
        /// The changes, by frame.
        changes: Vec<InputChange>,
    },
    /// The job was started with another input: none of its files is among the given ones, and the same frames
    /// have other contents.
    #[error("{}: this job was made from other files ({}, now {}); choose another output{}, or start over with --force", dir.display(), planned.display(), given.display(), if *is_same_dir { ", keep what is there with --keep-done" } else { "" })]
    OtherInput {
        /// The job's directory.
        dir: PathBuf,
        /// A file of the plan.
        planned: PathBuf,
        /// A file of this request.
        given: PathBuf,
        /// Whether they are in the same directory.
        is_same_dir: bool,
    },
    /// Files with the names of outputs exist that no worker of this job has written.
    #[error(
        "{}: already exists and was not written by this job; choose another output, move the file away, or \
         replace it with --force",
        first_of(paths)
    )]
    OutputsExist {
        /// The files; at least one.
        paths: Vec<PathBuf>,
    },
    /// The plan exists but cannot be read.
    #[error("{}: {what}; restore it, or start over with --force", path.display())]
    PlanDamaged {
        /// The plan.
        path: PathBuf,
        /// Place and reason.
        what: String,
    },
    /// There is a ledger but no plan that gives its lines a meaning.
    #[error("{}: the ledger has lines but {} is missing; restore it, or start over with --force", ledger.display(), crate::PLAN_FILE)]
    PlanMissing {
        /// The ledger.
        ledger: PathBuf,
    },
    /// A line of a ledger, other than an incomplete last one, cannot be read.
    #[error("{}: line {line}: {what}; remove that line to repeat its frame, or start over with --force", path.display())]
    LedgerDamaged {
        /// The ledger.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Why.
        what: String,
    },
    /// The operation is not possible while another worker is active.
    #[error("{}: {worker} is working on this job; wait for it, or stop it first", dir.display())]
    Busy {
        /// The job's directory.
        dir: PathBuf,
        /// The other worker.
        worker: String,
    },
    /// Other workers have declared this worker dead, or the directory `job.work` was removed.
    #[error("{}: this worker missed its heartbeats and its frames were reassigned; the same command rejoins the job", dir.display())]
    DeclaredDead {
        /// The job's directory.
        dir: PathBuf,
    },
    /// The directory is not writable.
    #[error("{}: cannot be written ({source}); check its permissions, or choose another directory", path.display())]
    Unwritable {
        /// The file or directory.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The disk is full. Existing files are intact.
    #[error("{}: no space left; free some, then the same command continues", path.display())]
    DiskFull {
        /// The file that was being written.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// Any other I/O error on a file of the job.
    #[error("{}: {action}: {source}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What failed.
        action: &'static str,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The caller could not resolve the automatic settings.
    #[error(transparent)]
    Resolve(Box<dyn std::error::Error + Send + Sync>),
    /// The request is inconsistent.
    #[error("{0}")]
    Request(String),
}

impl JobError {
    /// The error for a file that cannot be written.
    pub fn writing(path: &Path, source: io::Error) -> Self {
        Self::io(path, "writing", source)
    }

    /// Chooses the variant by the kind of the I/O error.
    pub(crate) fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                Self::DiskFull { path, source }
            }
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::Unwritable { path, source }
            }
            _ => Self::Io {
                path,
                action,
                source,
            },
        }
    }
}

/// The first of `paths`, and the number of the others.
fn first_of(paths: &[PathBuf]) -> String {
    let first = paths.first().map(|path| path.display().to_string());
    let first = first.unwrap_or_default();
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
