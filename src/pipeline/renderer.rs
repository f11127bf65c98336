//! The seam between the stages of a run and whatever makes their images.

use super::load::LoadedFrame;
use super::setup::Setup;
use super::trace::{BuiltFrame, CpuRenderer, TraceError, TracedFrame};
use crate::render::{Film, RayCounts, RendererKind, Stop};

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

/// The renderer of that kind, without memory yet.
pub fn renderer_of(kind: RendererKind) -> Box<dyn FrameRenderer> {
    match kind {
        RendererKind::Cpu => Box::new(CpuRenderer::default()),
    }
}
