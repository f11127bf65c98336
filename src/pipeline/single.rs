//! Renders one image, with no other frame in memory.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use spherule_formats::{PositionSlice, RawParticles, Sequence};
use spherule_jobs::catch_panic;

use super::ImageTask;
use super::encode::write_frame;
use super::error::ImageError;
use super::load::{LoadedFrame, load_frame, load_particles};
use super::load_error::LoadError;
use super::renderer::TracedFrame;
use super::setup::Setup;
use super::trace::renderer_of;
use crate::render::Stop;
use crate::report::FrameReport;

/// Renders the image of `task`, in the format of its name, with its preview. Passes notes for the user to `note`.
///
/// # Errors
/// See [`ImageError`]. No file is left behind.
pub fn make_image(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    note: impl FnMut(String),
) -> Result<FrameReport, ImageError> {
    make_image_until(setup, sequence, task, &AtomicBool::new(false), note)
}

/// Same as [`make_image`]; `stop` ends it, and receives the number of pixels that are traced.
///
/// # Errors
/// Same as [`make_image`]; [`RenderError::Interrupted`](crate::render::RenderError::Interrupted) if `stop` is raised.
pub fn make_image_until(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    stop: &dyn Stop,
    note: impl FnMut(String),
) -> Result<FrameReport, ImageError> {
    let traced = trace_single(setup, sequence, task, stop, note)?;
    catch_panic(|| {
        let (report, _) = write_frame(setup, traced, &Mutex::default())?;
        Ok(report)
    })
}

/// Renders particles in memory to planes; `name` stands for their file. The tree copies the positions, and nothing
/// else does if [`ParticleFrame::borrowed`](spherule_formats::ParticleFrame::borrowed) does not. Passes notes for the
/// user to `note`.
///
/// # Errors
/// See [`ImageError`]; [`RenderError::Interrupted`](crate::render::RenderError::Interrupted) if `stop` is raised.
pub fn trace_particles(
    setup: &Setup,
    particles: RawParticles<PositionSlice<'_>>,
    name: &str,
    task: &ImageTask,
    stop: &dyn Stop,
    note: impl FnMut(String),
) -> Result<TracedFrame, ImageError> {
    let load = || load_particles(setup, particles, name, task);
    catch_panic(|| trace(setup, load, stop, note))
}

fn trace_single(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    stop: &dyn Stop,
    note: impl FnMut(String),
) -> Result<TracedFrame, ImageError> {
    catch_panic(|| {
        task.check()?;
        trace(setup, || load_frame(setup, sequence, task), stop, note)
    })
}

/// Builds the tree of the frame that `load` returns, and traces its image.
fn trace<'a>(
    setup: &Setup,
    load: impl FnOnce() -> Result<LoadedFrame<'a>, LoadError>,
    stop: &dyn Stop,
    mut note: impl FnMut(String),
) -> Result<TracedFrame, ImageError> {
    let mut frame = load()?;
    frame.notes.drain(..).for_each(&mut note);
    let mut tracer = renderer_of(setup.picture.renderer);
    let mut built = tracer.prepare(setup, frame)?;
    built.notes.drain(..).for_each(&mut note);
    Ok(tracer.render(setup, &built, stop)?)
}
