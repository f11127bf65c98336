//! How a job's frames go through memory: side by side, one at a time, or not at all.

use super::predict::{FrameSize, MemoryModel, MemoryNeed};

/// Whether frames are in flight beside one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Overlap {
    /// One in each stage: the fastest.
    #[default]
    Stages,
    /// One at all: the least memory.
    None,
}

/// How a job's frames go through memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schedule {
    /// The peak, over the frames that are not left out.
    pub need: MemoryNeed,
    /// Whether they go beside one another.
    pub overlap: Overlap,
    /// Frames that do not fit, by their place among those asked about, and what they need.
    pub too_large: Vec<(usize, MemoryNeed)>,
}

impl MemoryModel<'_> {
    /// How to stay within `limit`: frames that do not fit even alone are left out, and the others
    /// go one at a time if they do not fit side by side. Going on beside one another is also given
    /// up where it would take more than is `free`.
    pub fn schedule(
        &self,
        frames: &[FrameSize],
        limit: Option<u64>,
        free: Option<u64>,
    ) -> Schedule {
        let mut too_large = Vec::new();
        let mut fitting = Vec::new();
        for (place, frame) in frames.iter().enumerate() {
            let need = self.alone(frame);
            if limit.is_some_and(|limit| need.total() > limit) {
                too_large.push((place, need));
            } else {
                fitting.push(*frame);
            }
        }
        let beside = self.peak(&fitting);
        let bound = limit.unwrap_or(u64::MAX).min(free.unwrap_or(u64::MAX));
        let (overlap, need) = if beside.total() <= bound {
            (Overlap::Stages, beside)
        } else {
            let alone = fitting.iter().map(|frame| self.alone(frame));
            let need = alone.fold(MemoryNeed::default(), MemoryNeed::larger);
            (Overlap::None, need)
        };
        Schedule {
            need,
            overlap,
            too_large,
        }
    }
}
