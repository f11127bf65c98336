//! Renders the frames of a sequence: reads them, builds trees, traces images, and writes them. [`Setup`] defines the
//! pictures in advance. [`RenderWork`] runs the stages of several frames side by side; [`make_image`] renders one
//! frame alone. Estimates of memory ([`MemoryModel`]) and time ([`probe`]) use the same parts.

use std::borrow::Cow;
use std::path::PathBuf;

use glam::Vec3;
use spherule_formats::ParticleFrame;

mod arrows;
mod bodies;
mod bonds;
mod clumps;
mod decoded;
mod denoise;
mod encode;
mod encoders;
mod error;
mod facts;
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
pub mod gpu;
mod grain_meshes;
mod grain_parts;
mod grains;
mod in_place;
mod load;
mod load_error;
mod mattes;
mod memory_limit;
mod meshes;
mod motion;
mod overlays;
#[cfg(test)]
mod owner_tests;
mod predict;
mod probe;
mod rays;
mod read_threads;
mod record;
mod renderer;
mod rods;
mod schedule;
mod setup;
mod shading;
mod shutter;
mod single;
mod stages;
mod styled;
mod styles;
mod surface;
mod trace;
mod trails;
#[cfg(feature = "gpu")]
mod vulkan;
mod whitewater;
mod work;

pub(crate) use bonds::covalent_lengths;
pub use decoded::{DecodedFrame, DecodedShading};
pub use error::{ImageError, WriteError};
pub use grain_meshes::{GrainMeshLoadError, GrainMeshes};
pub use in_place::{StoredFrame, StoredShading};
pub use load::{LoadedFrame, LoadedParticles, load_frame, load_particles};
pub use load_error::LoadError;
pub(crate) use load_error::attribute_list;
pub use memory_limit::{MemoryLimitError, MemoryRemedy};
pub use meshes::{
    CREASE_ANGLE, LoadedMesh, MeshLoadError, MeshSettings, MeshSlices, MeshThing, PictureMesh,
    load_mesh,
};
pub use predict::{FrameSize, MemoryModel, MemoryNeed};
pub use probe::{Probe, ProbeError, probe};
pub use renderer::{BuiltFrame, FrameRenderer, TraceError, TracedFrame};
pub use rods::FrameRods;
pub use schedule::{Overlap, Schedule};
pub use setup::{
    ArrowStyle, AttributeChannel, BondRule, BondStyle, ColorRule, FileSettings, GrainRules,
    OpacityRule, ParticleRules, ParticleStyle, Picture, RadiusRule, RodLook, RunSettings, Setup,
    StyleForm, Things, TrailStyle, ViewSettings,
};
pub use shutter::{FrameStep, Shutter};
pub use single::{make_image, make_image_until, trace_particles};
pub use trace::{CpuRenderer, renderer_of};
pub use work::RenderWork;

/// A frame whose positions may belong to a caller.
type SharedFrame<'a> = ParticleFrame<Cow<'a, [Vec3]>>;

/// One image to render.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageTask {
    /// Frame number.
    pub frame: i64,
    /// Index in the sequence.
    pub index: usize,
    /// Path of the image: an EXR, or another picture file by its ending.
    pub image: PathBuf,
    /// Path of the optional PNG.
    pub preview: Option<PathBuf>,
    /// The files of the meshes that each frame has for itself, in the order of [`Things::meshes`].
    pub meshes: Vec<PathBuf>,
    /// The meshes that those of the frame move to, with motion blur.
    pub next_meshes: Option<NextMeshes>,
    /// Why it cannot be rendered, if that is known in advance.
    pub refused: Option<MemoryLimitError>,
}

/// The meshes of a neighbouring frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NextMeshes {
    /// Their files, like [`ImageTask::meshes`].
    pub files: Vec<PathBuf>,
    /// Number of steps to that frame: 1, or -1 for the one before.
    pub steps: i8,
}

impl ImageTask {
    /// The output files.
    pub fn outputs(&self) -> Vec<PathBuf> {
        let image = std::iter::once(&self.image);
        image.chain(&self.preview).cloned().collect()
    }

    /// The error that is known in advance, if any.
    fn check(&self) -> Result<(), MemoryLimitError> {
        self.refused.clone().map_or(Ok(()), Err)
    }
}
