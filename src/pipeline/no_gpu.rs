//! What stands for the renderer on a GPU in a program that was built without the feature `gpu`.

use super::load::LoadedFrame;
use super::renderer::{BuiltFrame, FrameRenderer, TraceError, TracedFrame};
use super::setup::Setup;
use crate::render::{Film, RayCounts, Stop};
use spherule_formats::sequence::Sequence;

/// Why there is no GPU, and what to do.
const NOT_BUILT: &str = "this program was built without the renderer for GPUs: build it with \
                         `--features gpu`, or set device = \"cpu\"";

/// Does nothing.
pub const fn choose(_index: usize) {}

/// Nothing was chosen.
pub const fn chosen() -> Option<usize> {
    None
}

/// Says that there is no renderer for adapters.
pub fn adapters() -> Vec<String> {
    vec![NOT_BUILT.to_owned()]
}

/// Nothing is rendered on a GPU.
pub fn lacking(_setup: &Setup) -> Option<(&'static str, String)> {
    Some(("render.device", NOT_BUILT.to_owned()))
}

/// No job is rendered on a GPU.
///
/// # Errors
/// Always, without a reason: nothing about the job is in the way.
pub const fn suits(
    _setup: &Setup,
    _sequence: &Sequence,
    _particles: u64,
) -> Result<(), Option<String>> {
    Err(None)
}

/// No memory.
pub const fn device_bytes(_setup: &Setup, _sequence: &Sequence, _particles: u64) -> u64 {
    0
}

/// No memory.
pub const fn host_bytes(_setup: &Setup) -> u64 {
    0
}

/// Fails.
#[derive(Debug, Default)]
pub struct GpuRenderer(());

impl GpuRenderer {
    fn refuse<T>() -> Result<T, TraceError> {
        Err(TraceError::Device(NOT_BUILT.to_owned()))
    }
}

impl FrameRenderer for GpuRenderer {
    fn prepare(&mut self, _: &Setup, _: LoadedFrame<'_>) -> Result<BuiltFrame, TraceError> {
        Self::refuse()
    }

    fn trace(
        &mut self,
        _: &Setup,
        _: &BuiltFrame,
        _: &dyn Stop,
    ) -> Result<TracedFrame, TraceError> {
        Self::refuse()
    }

    fn image(
        &self,
        _: &Setup,
        _: &BuiltFrame,
        _: &dyn Stop,
    ) -> Result<(Film, RayCounts), TraceError> {
        Self::refuse()
    }

    fn recycle(&mut self, _: Film) {}
}
