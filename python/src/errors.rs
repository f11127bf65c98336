//! Errors of the library as exceptions of the package, with file, place and remedy.

use std::path::Path;

use pyo3::prelude::*;
use spherule::job::RunError;
use spherule::manifest::ManifestError;
use spherule::pipeline::{ImageError, WriteError};
use spherule::still::StillError;
use spherule_formats::{FrameError, SequenceError};
use spherule_jobs::JobError;

/// A class of `spherule._errors`.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Class {
    Input,
    Setting,
    Output,
    Job,
    Internal,
}

impl Class {
    const fn name(self) -> &'static str {
        match self {
            Self::Input => "InputError",
            Self::Setting => "SettingError",
            Self::Output => "OutputError",
            Self::Job => "JobError",
            Self::Internal => "InternalError",
        }
    }
}

/// An exception before Python is attached.
#[derive(Debug)]
pub(crate) struct Failure {
    class: Class,
    message: String,
    file: Option<String>,
    place: Option<String>,
}

impl Failure {
    pub(crate) fn new(class: Class, message: impl ToString) -> Self {
        Self { class, message: message.to_string(), file: None, place: None }
    }

    fn of_file(mut self, path: &Path) -> Self {
        self.file = Some(path.display().to_string());
        self
    }

    /// The exception. The remedy is what the message says after its last semicolon.
    pub(crate) fn raise(self, py: Python<'_>) -> PyErr {
        let remedy = self.message.rsplit_once("; ").map(|(_, remedy)| remedy);
        let made = py
            .import("spherule._errors")
            .and_then(|errors| errors.getattr(self.class.name()))
            .and_then(|class| class.call1((&self.message, self.file, self.place, remedy)));
        made.map_or_else(|error| error, PyErr::from_value)
    }
}

impl From<FrameError> for Failure {
    fn from(error: FrameError) -> Self {
        let failure = Self::new(Class::Input, &error);
        match &error {
            FrameError::Malformed { path, at, .. } => {
                Self { place: Some(format!("byte {at}")), ..failure.of_file(path) }
            }
            FrameError::Unsupported { path, .. }
            | FrameError::TooLarge { path, .. }
            | FrameError::Io { path, .. } => failure.of_file(path),
        }
    }
}

impl From<SequenceError> for Failure {
    fn from(error: SequenceError) -> Self {
        match error {
            SequenceError::List(error) | SequenceError::Topology(error) => error.into(),
            error => {
                let failure = Self::new(Class::Input, &error);
                match &error {
                    SequenceError::Missing { path, .. }
                    | SequenceError::NoFrames { path, .. }
                    | SequenceError::Ambiguous { path, .. }
                    | SequenceError::Io { path, .. } => failure.of_file(path),
                    _ => failure,
                }
            }
        }
    }
}

impl From<ManifestError> for Failure {
    fn from(error: ManifestError) -> Self {
        Self { place: error.key().map(str::to_owned), ..Self::new(Class::Setting, &error) }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Frame(error) => error.into(),
            RunError::Sequence(error) => error.into(),
            RunError::Manifest(error) => error.into(),
            RunError::Job(error) => error.into(),
            error @ (RunError::OutputIsFile { .. }
            | RunError::OtherKind { .. }
            | RunError::ForeignManifest { .. }
            | RunError::File(_)) => Self::new(Class::Output, error),
            error => {
                // Messages of settings begin with their key
                let message = error.to_string();
                let place = message.split_once(": ").map(|(key, _)| key.to_owned());
                Self {
                    place: place.filter(|key| !key.contains(' ')),
                    ..Self::new(Class::Setting, message)
                }
            }
        }
    }
}

impl From<JobError> for Failure {
    fn from(error: JobError) -> Self {
        Self::new(Class::Job, error)
    }
}

impl From<StillError> for Failure {
    fn from(error: StillError) -> Self {
        match error {
            StillError::Setup(error) => error.into(),
            StillError::Panic(error) => Self::new(Class::Internal, error),
            StillError::Image(error) => match &error {
                ImageError::Panic(_) => Self::new(Class::Internal, error),
                ImageError::Write(WriteError::Io { path, .. }) => {
                    let path = path.clone();
                    Self::new(Class::Output, error).of_file(&path)
                }
                ImageError::Write(_) => Self::new(Class::Output, error),
                ImageError::Load(_) | ImageError::Trace(_) | ImageError::Memory(_) => {
                    Self::new(Class::Input, error)
                }
            },
        }
    }
}
