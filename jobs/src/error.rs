//! What can go wrong with a job, by what the caller can do next.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// One setting that is not what the plan was made with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingChange {
    /// Dotted key.
    pub key: String,
    /// Value in the plan, if it was set.
    pub old: Option<String>,
    /// Value asked for now, if it is set.
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

/// One input file of a finished frame that is another file now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputChange {
    /// The frame.
    pub frame: i64,
    /// The file.
    pub path: PathBuf,
    /// What is different.
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

/// Why a job cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The plan was made with other settings.
    #[error("{}: settings have changed since this job began: {}; --force starts over, --keep-done keeps what is there", dir.display(), listed(changes))]
    SettingsChanged {
        /// The job's directory.
        dir: PathBuf,
        /// Which, in the order of the settings.
        changes: Vec<SettingChange>,
    },
    /// Frames were finished from inputs that have been rewritten since.
    #[error("{}: inputs of finished frames have changed: {}; --force starts over, --keep-done keeps what is there", dir.display(), listed(changes))]
    InputChanged {
        /// The job's directory.
        dir: PathBuf,
        /// Which, by frame.
        changes: Vec<InputChange>,
    },
    /// The job was begun with another input: none of its files is among those given, and the same frames
    /// have other contents.
    #[error("{}: this job was made from other files ({}, now {}); choose another output{}, or start over with --force", dir.display(), planned.display(), given.display(), if *is_same_dir { ", keep what is there with --keep-done" } else { "" })]
    OtherInput {
        /// The job's directory.
        dir: PathBuf,
        /// A file that it was made from.
        planned: PathBuf,
        /// A file given now.
        given: PathBuf,
        /// Whether they are in the same directory.
        is_same_dir: bool,
    },
    /// Files have the names of outputs, and no worker of the job has made them.
    #[error(
        "{}: there already, and not made by this job; choose another output, move what is there, or replace it with --force",
        existing(paths)
    )]
    OutputsExist {
        /// Which; at least one.
        paths: Vec<PathBuf>,
    },
    /// The plan is there but cannot be understood.
    #[error("{}: {what}; restore it, or start over with --force", path.display())]
    PlanDamaged {
        /// The plan.
        path: PathBuf,
        /// Where and why.
        what: String,
    },
    /// There is a ledger but no plan that would say what its lines mean.
    #[error("{}: the ledger has lines but {} is missing; restore it, or start over with --force", ledger.display(), crate::PLAN_FILE)]
    PlanMissing {
        /// The ledger.
        ledger: PathBuf,
    },
    /// A line of a ledger, other than a torn last one, cannot be understood.
    #[error("{}: line {line}: {what}; remove that line to do its frame again, or start over with --force", path.display())]
    LedgerDamaged {
        /// The ledger.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Why.
        what: String,
    },
    /// What was asked must not be done while another worker is at the job.
    #[error("{}: {who} is at work here; wait for it, or stop it first", dir.display())]
    Busy {
        /// The job's directory.
        dir: PathBuf,
        /// Who works there.
        who: String,
    },
    /// Others have taken this worker for dead, or the directory `job.work` was removed.
    #[error("{}: this worker gave no sign of life for so long that others have taken it for dead; the same command joins again", dir.display())]
    TakenForDead {
        /// The job's directory.
        dir: PathBuf,
    },
    /// The directory refuses files.
    #[error("{}: cannot be written ({source}); check its permissions, or choose another directory", path.display())]
    Unwritable {
        /// The file or directory.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// No room. Nothing that was there is lost.
    #[error("{}: no space left; free some, then the same command goes on from here", path.display())]
    DiskFull {
        /// What was being written.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Any other trouble with a file of the job.
    #[error("{}: {doing}: {source}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What was being done.
        doing: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// The caller could not settle what "auto" means; the message is its own.
    #[error(transparent)]
    Resolve(Box<dyn std::error::Error + Send + Sync>),
    /// The request contradicts itself.
    #[error("{0}")]
    Request(String),
}

impl JobError {
    /// That a file cannot be written, by what can be done about it.
    pub fn writing(path: &Path, source: io::Error) -> Self {
        Self::io(path, "writing", source)
    }

    /// Sorts an error of the system by what can be done about it.
    pub(crate) fn io(path: &Path, doing: &'static str, source: io::Error) -> Self {
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
                doing,
                source,
            },
        }
    }
}

/// The first of `paths`, and how many more there are.
fn existing(paths: &[PathBuf]) -> String {
    let first = paths.first().map(|path| path.display().to_string());
    let first = first.unwrap_or_default();
    match paths.len() {
        0 | 1 => first,
        2 => format!("{first} and 1 more file"),
        count => format!("{first} and {} more files", count - 1),
    }
}

/// The first few of `items`, and how many more there are.
fn listed(items: &[impl fmt::Display]) -> String {
    const SHOWN: usize = 8;
    let mut text: Vec<String> = items.iter().take(SHOWN).map(ToString::to_string).collect();
    if items.len() > SHOWN {
        text.push(format!("and {} more", items.len() - SHOWN));
    }
    text.join("; ")
}
