//! Why a job cannot start or continue.

use std::io;
use std::path::{Path, PathBuf};

use spherule_formats::FrameError;
use spherule_formats::sequence::SequenceError;
use spherule_jobs::{FileError, FrameRange, JobError};

use crate::conversion::UnknownAttribute;
use crate::manifest::{ManifestError, RebaseError};
use crate::pipeline::{GrainMeshLoadError, MemoryLimitError, MeshLoadError};
use crate::resolve::ResolveError;
use spherule_images::file::ImageReadError;

/// Why a job cannot start or continue. Messages say what is wrong. Remedies that depend on a command line are the
/// caller's.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The manifest is invalid.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// The paths of the manifest cannot be made relative to the output.
    #[error(transparent)]
    Rebase(#[from] RebaseError),
    /// The input has no frames, or cannot be listed.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// No frame can be surveyed.
    #[error("no frame can be read: {0}")]
    Frame(#[from] FrameError),
    /// The settings and the particles do not go together.
    #[error(transparent)]
    Resolve(#[from] ResolveError),
    /// The image of the environment cannot be read.
    #[error("environment.image: {0}")]
    Environment(#[from] ImageReadError),
    /// The picture on the ground cannot be read.
    #[error("render.ground.image: {0}")]
    GroundImage(ImageReadError),
    /// A picture among the overlays cannot be read.
    #[error("overlay.{index}.path: {source}")]
    OverlayImage {
        /// The index of the overlay in the manifest.
        index: usize,
        /// Why.
        source: ImageReadError,
    },
    /// A mesh cannot be read.
    #[error("mesh.{index}.path: {source}")]
    Mesh {
        /// Its index in the manifest.
        index: usize,
        /// Why.
        source: MeshLoadError,
    },
    /// A mesh of grains cannot be read, or is not the surface of a body.
    #[error("style.{index}.mesh: {source}")]
    GrainMesh {
        /// The index of the style in the manifest.
        index: usize,
        /// Why.
        source: GrainMeshLoadError,
    },
    /// An attribute to convert does not exist.
    #[error(transparent)]
    UnknownAttribute(#[from] UnknownAttribute),
    /// The job refuses the request, or its files cannot be read or written.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The selected range contains no frame.
    #[error("input.frames: {range} contains none of the frames of the input: {available}")]
    NoFrames {
        /// The range.
        range: FrameRange,
        /// The frames of the input.
        available: FrameRange,
    },
    /// The output directory is a file, or below a file.
    #[error("{}: is a file, but a directory for the {purpose} is needed", path.display())]
    OutputIsFile {
        /// The file.
        path: PathBuf,
        /// What the directory is for.
        purpose: &'static str,
    },
    /// The output directory contains a job of another kind.
    #[error("{}: contains a job of `{found}`, not of `{expected}`", dir.display())]
    OtherKind {
        /// The directory.
        dir: PathBuf,
        /// The kind of its job.
        found: String,
        /// The requested kind.
        expected: String,
    },
    /// The output directory contains a manifest that a user wrote for something else.
    #[error("{}: this job would write its manifest here", path.display())]
    ForeignManifest {
        /// The manifest.
        path: PathBuf,
    },
    /// No frame fits into the memory limit.
    #[error("no frame fits into memory: frame {frame}: {source}")]
    NothingFits {
        /// The first frame.
        frame: i64,
        /// Why it does not fit.
        source: MemoryLimitError,
    },
    /// A conversion would overwrite its own input.
    #[error("{}: the conversion would overwrite its own input", path.display())]
    OverwritesInput {
        /// The input.
        path: PathBuf,
    },
    /// One file name was given for several frames.
    #[error("{}: one file name for {frames} frames", path.display())]
    OneName {
        /// The output.
        path: PathBuf,
        /// The number of frames.
        frames: usize,
    },
    /// The plan has no valid survey.
    #[error("{}: its resolved values cannot be read ({source})", path.display())]
    StoredSurvey {
        /// The plan.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// A value cannot be exchanged as JSON with a plan or a child process.
    #[error("invalid JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The manifest isolates frames in child processes, but no command for them was given.
    #[error("job.isolate: no command for child processes")]
    NoChildCommand,
    /// The memory of a process cannot be limited.
    #[error("job.memory_ceiling: {0}")]
    MemoryCeiling(#[source] io::Error),
}

impl RunError {
    /// The error for the file at `path` on which `action` failed.
    pub(crate) fn file(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| FileError::new(&path, action, source).into()
    }
}
