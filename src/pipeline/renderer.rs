//! The interface between the stages of a run and the renderer.

use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec3;
use spherule_files::memory::MemoryUse;
use spherule_formats::FrameError;

use super::ImageTask;
use super::decoded::DecodedShading;
use super::facts::FileFacts;
use super::in_place::StoredFrame;
use super::load::LoadedFrame;
use super::meshes::MeshSlices;
use super::rods::FrameRods;
use super::setup::Setup;
use crate::accel::stored::StoredFault;
use crate::denoise::DenoiseError;
use crate::output::TextAttribute;
use crate::render::{Film, RayCounts, RenderError, Stop};
use crate::report::FrameReport;
use crate::scene::{Camera, CameraError};
use crate::surface::smooth::SmoothError;

/// Reasons why there is no image of a frame that was read.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// Rendering was interrupted, or a setting is invalid.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The nodes of a native frame cannot be traced.
    #[error("{}: {fault}; convert the frame again", path.display())]
    Stored {
        /// The frame.
        path: PathBuf,
        /// The fault.
        fault: StoredFault,
    },
    /// A native frame changed while it was traced, or cannot be used on this machine.
    #[error(transparent)]
    File(#[from] FrameError),
    /// The image cannot be denoised.
    #[error(transparent)]
    Denoise(#[from] DenoiseError),
    /// The surface does not fit into memory.
    #[error(transparent)]
    Surface(#[from] SmoothError),
    /// There is no GPU, or it failed.
    #[error("render.device: {0}")]
    Device(String),
    /// The camera is invalid.
    #[error("camera: {0}")]
    Camera(#[from] CameraError),
}

/// A frame with its image in memory.
#[derive(Debug)]
pub struct TracedFrame {
    /// The task.
    pub task: ImageTask,
    /// The camera of the image.
    pub camera: Camera,
    /// The planes.
    pub film: Film,
    /// What is left to do until they are complete.
    pub(super) rest: Option<Box<dyn UnfinishedImage>>,
    /// Attributes of the file that describe its layers.
    pub texts: Vec<TextAttribute>,
    /// What overlays show of the file.
    pub facts: FileFacts,
    /// Simulation time, if known.
    pub time: Option<f64>,
    /// The report, without encoding.
    pub report: FrameReport,
    /// Memory in use when the image was finished, before anything was freed.
    pub memory: MemoryUse,
}

impl TracedFrame {
    /// Completes the planes, and denoises them if the settings say so.
    ///
    /// # Errors
    /// If the planes cannot be denoised, or if a native frame changed in the meantime.
    pub(super) fn finish(&mut self, setup: &Setup) -> Result<(), TraceError> {
        if let Some(rest) = self.rest.take() {
            rest.finish(setup, self)?;
        }
        Ok(self.denoise(setup)?)
    }
}

/// An image that is no longer in its renderer, and not in the planes of its frame yet.
pub(super) trait UnfinishedImage: std::fmt::Debug + Send + Sync {
    /// Fills the planes of `frame`.
    ///
    /// # Errors
    /// If a native frame changed in the meantime.
    fn finish(self: Box<Self>, setup: &Setup, frame: &mut TracedFrame) -> Result<(), TraceError>;
}

/// A frame whose tree is in the renderer, with the other data for shading.
#[derive(Debug)]
pub struct BuiltFrame {
    pub(super) task: ImageTask,
    pub(super) particles: Arc<BuiltParticles>,
    pub(super) meshes: Vec<MeshSlices>,
    pub(super) rods: Vec<FrameRods>,
    pub(super) facts: FileFacts,
    pub(super) time: Option<f64>,
    /// Position of the particle in focus.
    pub(super) focus: Option<Vec3>,
    pub(super) report: FrameReport,
    /// Notes for the user.
    pub(super) notes: Vec<String>,
}

impl BuiltFrame {
    /// Notes for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// Particle data that are not part of the tree.
#[derive(Debug)]
pub(super) enum BuiltParticles {
    /// Attributes; the tree has a copy of the rest.
    Decoded(DecodedShading),
    /// The frame itself, whose leaves the tree uses.
    Stored(StoredFrame),
}

/// Renders frames one after another, with memory that is reused from frame to frame.
///
/// A renderer receives particles as they were read, and builds its own data structures over them. Nodes, blocks of
/// particles, lights, materials and camera are plain arrays and structures that can be passed to a device as they
/// are.
pub trait FrameRenderer: Send + Sync {
    /// Builds the data structures to render `frame`. Positions in memory are released when they are no longer needed.
    ///
    /// # Errors
    /// The frame cannot be rendered: damaged nodes, or a surface that does not fit.
    fn prepare(&mut self, setup: &Setup, frame: LoadedFrame<'_>) -> Result<BuiltFrame, TraceError>;

    /// Renders `frame`, which must be the one prepared last. What needs no renderer any more is left to
    /// `TracedFrame::finish`. It can be rendered again, also with other settings of what does not belong to its
    /// particles.
    ///
    /// # Errors
    /// [`crate::render::RenderError::Interrupted`] if `stop` is raised, [`TraceError::File`] if a native frame
    /// changed in the meantime; all other errors are of settings that are checked in advance.
    fn trace(
        &mut self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<TracedFrame, TraceError>;

    /// The same, and finishes the image.
    ///
    /// # Errors
    /// Same as [`Self::trace`].
    fn render(
        &mut self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<TracedFrame, TraceError> {
        let mut traced = self.trace(setup, frame, stop)?;
        traced.finish(setup)?;
        Ok(traced)
    }

    /// Renders only the planes of `frame`, which must be the one prepared last.
    ///
    /// # Errors
    /// Same as [`Self::trace`].
    fn image(
        &self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<(Film, RayCounts), TraceError>;

    /// Takes planes that are no longer needed, for reuse by the next image.
    fn recycle(&mut self, film: Film);
}
