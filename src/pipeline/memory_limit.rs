//! Frames that need more memory than the job may use.

use std::fmt;

use spherule_files::Bytes;

use super::predict::{FrameSize, MemoryModel, MemoryNeed};
use super::setup::{RadiusRule, Setup};
use crate::accel::Structure;
use crate::surface::SurfaceKind;

/// A frame needs more memory than `render.memory_limit`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MemoryLimitError {
    /// What the frame needs.
    pub need: MemoryNeed,
    /// The limit.
    pub limit: Bytes,
    /// Radius and voxel size of a smooth surface, as text; empty for other surfaces.
    surface: String,
    /// Ways to reduce the memory, best first.
    pub remedies: Vec<MemoryRemedy>,
}

/// A way to render a frame within a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MemoryRemedy {
    /// Use this acceleration structure.
    Accelerator(Structure),
    /// Make the image smaller, or store fewer channels.
    SmallerImage,
    /// Use larger voxels for the smooth surface.
    LargerVoxels,
    /// Raise the limit.
    RaiseLimit,
}

impl MemoryLimitError {
    /// The error for a frame of size `frame` that needs `need`.
    pub(super) fn new(setup: &Setup, frame: &FrameSize, need: MemoryNeed, limit: Bytes) -> Self {
        Self { need, limit, surface: surface_text(setup), remedies: remedies(setup, frame, limit) }
    }
}

impl fmt::Display for MemoryLimitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let remedies: Vec<String> = self.remedies.iter().map(ToString::to_string).collect();
        write!(
            f,
            "it needs about {} ({}){}, render.memory_limit is {}: {}",
            Bytes(self.need.total()),
            self.need,
            self.surface,
            self.limit,
            remedies.join(", or ")
        )
    }
}

impl std::error::Error for MemoryLimitError {}

impl fmt::Display for MemoryRemedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Accelerator(structure) => write!(f, "set render.accelerator to {structure}"),
            Self::SmallerImage => f.write_str("make the image smaller or ask for fewer channels"),
            Self::LargerVoxels => f.write_str("give larger voxels (surface.voxel)"),
            Self::RaiseLimit => f.write_str("raise the limit"),
        }
    }
}

/// Radius and voxel size of a smooth surface. A grid that is too large usually has a wrong radius.
fn surface_text(setup: &Setup) -> String {
    if setup.picture.surface.kind != SurfaceKind::Smooth {
        return String::new();
    }
    let voxel = setup.picture.surface.voxel;
    match setup.picture.particles.first().radius {
        RadiusRule::Common(radius) | RadiusRule::FileOr(radius) if radius > 0.0 => format!(
            " for a smooth surface of particles of radius {radius} in voxels of {}",
            voxel * radius
        ),
        _ => format!(
            " for a smooth surface of particles of their own radius in voxels of {voxel} of it"
        ),
    }
}

/// Ways to reduce the memory of a frame that needs more than `limit`.
fn remedies(setup: &Setup, frame: &FrameSize, limit: Bytes) -> Vec<MemoryRemedy> {
    let is_sufficient = |structure: &Structure| {
        let mut setup = setup.clone();
        setup.run.accelerator = Some(*structure);
        MemoryModel::new(&setup).alone(frame).total() <= limit.0
    };
    let structures = Structure::ALL.into_iter().filter(is_sufficient);
    let mut remedies: Vec<MemoryRemedy> = structures.map(MemoryRemedy::Accelerator).collect();
    let alone = MemoryModel::new(setup).alone(frame);
    let image_only = MemoryModel::new(setup).alone(&FrameSize::default());
    if 4 * (image_only.images + image_only.encoding) > limit.0 {
        remedies.push(MemoryRemedy::SmallerImage);
    }
    if setup.picture.surface.kind == SurfaceKind::Smooth && 4 * alone.surface > limit.0 {
        remedies.push(MemoryRemedy::LargerVoxels);
    }
    remedies.push(MemoryRemedy::RaiseLimit);
    remedies
}
