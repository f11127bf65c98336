//! The seam between the stages of a run and whatever makes their images.

use std::path::PathBuf;

use spherule_formats::FrameError;

use super::ImageTask;
use super::decoded::DecodedShading;
use super::in_place::StoredFrame;
use super::load::LoadedFrame;
use super::setup::Setup;
use crate::accel::stored::StoredFault;
use crate::metrics::MemoryUse;
use crate::render::{Film, RayCounts, RenderError, Stop};
use crate::report::FrameReport;
use crate::scene::{Camera, CameraError};
use crate::surface::smooth::SmoothError;

/// Why there is no image of a frame that was read.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// Rendering was interrupted, or a setting makes no image.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The nodes of a native frame cannot be traced.
    #[error("{}: {fault}; convert the frame again", path.display())]
    Stored {
        /// The frame.
        path: PathBuf,
        /// What is wrong with it.
        fault: StoredFault,
    },
    /// A native frame changed while it was traced, or cannot be used on this machine.
    #[error(transparent)]
    File(#[from] FrameError),
    /// The surface would not fit into memory.
    #[error(transparent)]
    Surface(#[from] SmoothError),
    /// There is no picture from where the camera is.
    #[error("camera: {0}")]
    Camera(#[from] CameraError),
}

/// An image in memory.
#[derive(Debug)]
pub struct TracedFrame {
    /// What it is.
    pub task: ImageTask,
    /// Where it was taken from.
    pub camera: Camera,
    /// The planes.
    pub film: Film,
    /// Simulation time, if known.
    pub time: Option<f64>,
    /// The report so far.
    pub report: FrameReport,
    /// Memory when the image was finished and everything it was made of still there.
    pub memory: MemoryUse,
}

/// A frame whose tree stands in the tracer; what shading needs beside it.
#[derive(Debug)]
pub struct BuiltFrame {
    pub(super) task: ImageTask,
    pub(super) particles: BuiltParticles,
    pub(super) time: Option<f64>,
    pub(super) report: FrameReport,
    /// What the user should know of it.
    pub(super) notes: Vec<String>,
}

/// What is left of a frame's particles beside the tree.
#[derive(Debug)]
pub(super) enum BuiltParticles {
    /// The tree has copied the rest.
    Decoded(DecodedShading),
    /// All of it: the tree's leaves are here.
    Stored(StoredFrame),
}

/// Makes the images of frames, one after the other, with memory that lives on from frame to frame.
///
/// A renderer takes particles as they were read and builds whatever it needs over them. Nodes, blocks of particles,
/// lights, materials and camera are plain arrays and structures, which a device can be handed as they are.
pub trait FrameRenderer: Send + Sync {
    /// Builds what `frame` is rendered from. Positions in memory are let go once they are not needed any more.
    ///
    /// # Errors
    /// The frame cannot be rendered: damaged nodes, a surface that does not fit.
    fn prepare(&mut self, setup: &Setup, frame: LoadedFrame) -> Result<BuiltFrame, TraceError>;

    /// Renders `frame`, the one that was prepared last.
    ///
    /// # Errors
    /// [`crate::render::RenderError::Interrupted`] once `stop` is raised, [`TraceError::File`] if a native frame changed
    /// meanwhile; the others are settings that were checked before.
    fn render(
        &mut self,
        setup: &Setup,
        frame: BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<TracedFrame, TraceError>;

    /// Only the planes of `frame`, the one that was prepared last.
    ///
    /// # Errors
    /// As [`Self::render`].
    fn image(
        &self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<(Film, RayCounts), TraceError>;

    /// Takes the planes of an image that nobody needs any more for the next one.
    fn recycle(&mut self, film: Film);
}
