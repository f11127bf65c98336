//! Why a cell cannot be measured.

use std::io;
use std::path::PathBuf;

use spherule_formats::FrameError;
use spherule_formats::sequence::SequenceError;

use spherule_tracer::render::RenderError;
use spherule_tracer::scene::CameraError;
use spherule_tree::accel::stored::StoredFault;

/// Why a cell cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum CellError {
    /// The image does not fit into memory.
    #[error("out of memory: an image of {width}x{height} needs {need} MiB, {free} MiB are free")]
    ImageTooLarge {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// MiB.
        need: u64,
        /// MiB.
        free: u64,
    },
    /// There is no GPU, or it failed.
    #[error("GPU: {0}")]
    Gpu(String),
    /// The particles do not fit into memory.
    #[error("out of memory: {particles} particles need at least {need} MiB, {free} MiB are free")]
    TooManyParticles {
        /// Number of particles.
        particles: usize,
        /// MiB.
        need: u64,
        /// MiB.
        free: u64,
    },
    /// The input cannot be opened.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// A frame cannot be read or written.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The input has no such frame.
    #[error("{}: no frame {frame}", path.display())]
    MissingFrame {
        /// The input.
        path: PathBuf,
        /// The frame.
        frame: i64,
    },
    /// The frame has no particles.
    #[error("{}: frame {frame} has no particles, there is nothing to measure", path.display())]
    NoParticles {
        /// The input.
        path: PathBuf,
        /// The frame.
        frame: i64,
    },
    /// A native frame cannot be traced in place.
    #[error("{}: {fault}", path.display())]
    Stored {
        /// The native frame.
        path: PathBuf,
        /// Why.
        fault: StoredFault,
    },
    /// The native frame cannot be examined.
    #[error("{}: {source}", path.display())]
    Io {
        /// The native frame.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The camera has no valid view.
    #[error("camera: {0}")]
    Camera(#[from] CameraError),
    /// The image cannot be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
}
