//! Predicts the memory of a job: the model behind `--memory-limit`, `check`, and the rejection of frames and images
//! that cannot fit.
//!
//! It adds up what the stages hold at the same time (see the parent module). While the tree of frame i is built,
//! frame i-1 is encoded, and the planes of frame i-2 are kept for frame i. While frame i is traced, frame i+1 is
//! read, and frame i-1 may still be encoded. Both are usually done when frame i is denoised; [`MemoryModel::bound`] is
//! what is needed if they are not. If encoding takes longer than tracing, several images are encoded at the same time.
//! Only anonymous memory counts, not the pages of mapped files. Particle counts of frames that have not been opened are
//! estimated from the length of their files and the heaviest frame of the survey; the grid of a smooth surface, and
//! the spray, from those of the surveyed frames before and after. Native frames that are traced in place need almost no
//! memory.

use super::setup::{RadiusRule, Setup};

mod frame_size;
mod image;
mod meshes;
mod need;
mod phases;
mod reading;
mod structures;

pub use frame_size::FrameSize;
pub use need::MemoryNeed;

/// Predicts the memory of the frames of a job.
#[derive(Debug, Clone, Copy)]
pub struct MemoryModel<'a> {
    pub(super) setup: &'a Setup,
    own_radii: bool,
    has_ids: bool,
    has_velocities: bool,
    in_place: bool,
    /// Memory of the meshes that all frames share.
    meshes: u64,
    /// The same while they are read, before the first frame.
    reading_meshes: u64,
}

/// The frames before and after one that is traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Neighbours {
    /// Number of images that are encoded at the same time.
    encoders: u64,
    /// Whether they are still in work when the frame is denoised.
    are_slow: bool,
}

impl<'a> MemoryModel<'a> {
    /// A model for the pictures of `setup`.
    pub fn new(setup: &'a Setup) -> Self {
        let known = setup.run.weight.unwrap_or_default();
        Self {
            setup,
            own_radii: match setup.picture.particles.first().radius {
                _ if setup.picture.particles.is_divided() => true,
                RadiusRule::Common(_) => false,
                RadiusRule::FileOr(_) => known.own_radii,
                RadiusRule::Attribute { .. } | RadiusRule::Table { .. } => true,
            },
            has_ids: known.ids,
            has_velocities: known.velocities,
            in_place: known.in_place && setup.traces_in_place(),
            meshes: meshes::shared(setup),
            reading_meshes: meshes::reading_shared(setup),
        }
    }

    /// Peak memory while these frames are rendered one after another and up to `encoders` images are encoded at the
    /// same time, if reading and encoding a frame take less time than tracing and denoising its neighbour.
    pub fn peak(&self, frames: &[FrameSize], encoders: u32) -> MemoryNeed {
        self.peak_of(frames, Neighbours { encoders: encoders.into(), are_slow: false })
    }

    /// The same, however long reading and encoding take.
    pub fn bound(&self, frames: &[FrameSize], encoders: u32) -> MemoryNeed {
        self.peak_of(frames, Neighbours { encoders: encoders.into(), are_slow: true })
    }

    fn peak_of(&self, frames: &[FrameSize], neighbours: Neighbours) -> MemoryNeed {
        let mut need = MemoryNeed::default();
        let mut tree = 0;
        for (place, frame) in frames.iter().enumerate() {
            // The memory of the tree is reused from frame to frame, and never shrinks.
            tree = self.tree(frame).max(tree);
            let after = frames.get(place + 1);
            let before = place as u64;
            need = need.larger(self.peak_around(before, frame, after, tree, neighbours));
        }
        need
    }

    /// Memory for a frame that is rendered alone.
    pub fn alone(&self, frame: &FrameSize) -> MemoryNeed {
        self.peak(std::slice::from_ref(frame), 1)
    }
}

#[cfg(test)]
mod tests;
