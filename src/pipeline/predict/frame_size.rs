//! Estimates the size of a frame before it is read, from the length of its files and a known frame.

use spherule_formats::open::unpacked_len;
use spherule_formats::sequence::Sequence;

use super::super::ImageTask;
use super::super::read_threads::needs_many;
use super::super::setup::{RadiusRule, Setup};
use crate::surface::SurfaceSize;
use crate::survey::{FrameWeight, SurfaceWeight};

/// Estimated size of a frame before it is read; everything except counts in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameSize {
    /// Particle count.
    pub particles: u64,
    /// Size of its largest file, uncompressed.
    pub content: u64,
    /// Size of the numbers in its files.
    pub raw: u64,
    /// Size of the positions among them.
    pub positions: u64,
    /// Number of files.
    pub files: u64,
    /// Whether its file contains other frames too, and stays in memory for them.
    pub is_shared: bool,
    /// Size of the files of the meshes that only this frame has.
    pub meshes: u64,
    /// Size of its surface, if frames around it have been surveyed for that.
    pub surface: Option<SurfaceSize>,
}

impl FrameSize {
    /// Size of frame `index` of `sequence`, from the length of its files and a known frame.
    pub fn of(sequence: &Sequence, index: usize, known: Option<&FrameWeight>) -> Self {
        let sizes = sequence.inputs(index).into_iter().map(unpacked_len);
        let stored = sizes.filter_map(Result::ok).sum();
        let parts = sequence.frames().get(index).map(|f| f.parts.as_slice());
        let is_shared = parts.is_some_and(|parts| parts.iter().any(|p| p.step.is_some()));
        Self::estimate(stored, is_shared, known)
    }

    /// Size of the frame of `task`, and of its own meshes.
    pub fn of_task(sequence: &Sequence, task: &ImageTask, setup: &Setup) -> Self {
        let meshes = task.meshes.iter().map(|path| unpacked_len(path));
        let size = Self::of(sequence, task.index, setup.run.weight.as_ref());
        Self {
            meshes: meshes.filter_map(Result::ok).sum(),
            surface: surface_at(setup, task.index, size.particles),
            ..size
        }
    }

    /// Bytes to process when reading: the size of its file, or of the numbers in it if that is larger.
    pub(in crate::pipeline) fn read_bytes(&self) -> u64 {
        self.content.max(self.raw).max(self.meshes)
    }

    /// Whether it is read by as many threads as trace.
    pub(super) fn needs_many(&self) -> bool {
        needs_many(self.read_bytes())
    }

    /// Size of a frame with files of `stored` bytes (unpacked), in proportion to a known frame. Jobs of the first
    /// versions have no known frame; plain single-precision positions are assumed for them.
    pub fn estimate(stored: u64, is_shared: bool, known: Option<&FrameWeight>) -> Self {
        // Without a known frame, suppose positions in f32
        let Some(known) = known.filter(|k| k.stored > 0) else {
            return Self {
                particles: stored / 12,
                content: stored,
                raw: stored,
                positions: stored,
                files: 1,
                is_shared,
                meshes: 0,
                surface: None,
            };
        };
        // Otherwise scale it
        let scaled = |value: u64| {
            let product = u128::from(value) * u128::from(stored) / u128::from(known.stored);
            u64::try_from(product).unwrap_or(u64::MAX)
        };
        Self {
            particles: scaled(known.particles),
            content: scaled(known.content),
            raw: scaled(known.raw),
            positions: scaled(known.positions),
            files: known.files,
            is_shared,
            meshes: 0,
            surface: None,
        }
    }
}

/// The size of the surface of frame `index` with so many particles: the larger of those that the surveyed frames
/// before and after it would have.
fn surface_at(setup: &Setup, index: usize, particles: u64) -> Option<SurfaceSize> {
    let picture = &setup.picture;
    let radius = match picture.particles.first().radius {
        RadiusRule::Common(radius) | RadiusRule::FileOr(radius) => Some(radius),
        RadiusRule::Attribute { .. } | RadiusRule::Table { .. } => None,
    };
    let surfaces = || setup.run.surfaces.iter();
    let before = surfaces().rfind(|surface| surface.index <= index);
    let after = surfaces().find(|surface| surface.index >= index);
    let (voxel, speed) = (picture.surface.voxel, picture.surface.whitewater_speed);
    let speed = speed.filter(|_| picture.surface.whitewater);
    let scaled = |surface: &SurfaceWeight| surface.scaled(particles, voxel, radius, speed);
    before.into_iter().chain(after).map(scaled).reduce(SurfaceSize::larger)
}
