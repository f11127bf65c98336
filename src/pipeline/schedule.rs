//! Schedules the frames of a job within memory: overlapping, one at a time, or not at all.

use spherule_files::Bytes;

use super::memory_limit::MemoryLimitError;
use super::predict::{FrameSize, MemoryModel, MemoryNeed};

/// Whether several frames are in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Overlap {
    /// One frame per stage: the fastest.
    #[default]
    Stages,
    /// One frame in total: the least memory.
    None,
}

/// A schedule for the frames of a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schedule {
    /// The peak memory of all frames that fit.
    pub need: MemoryNeed,
    /// Whether frames overlap.
    pub overlap: Overlap,
    /// How many images are encoded at the same time at most.
    pub encoders: u32,
    /// Frames that do not fit, by their index in the input.
    pub too_large: Vec<(usize, MemoryLimitError)>,
}

impl MemoryModel<'_> {
    /// A schedule within `limit`. Frames that do not even fit alone are excluded. The others are rendered one at a
    /// time if they do not fit overlapping, or if overlapping needs more memory than is `free`.
    pub fn schedule(
        &self,
        frames: &[FrameSize],
        limit: Option<Bytes>,
        free: Option<u64>,
    ) -> Schedule {
        let mut too_large = Vec::new();
        let mut fitting = Vec::new();
        // Exclude frames that do not fit alone
        for (index, frame) in frames.iter().enumerate() {
            let need = self.alone(frame);
            match limit.filter(|limit| need.total() > limit.0) {
                Some(limit) => {
                    let error = MemoryLimitError::new(self.setup, frame, need, limit);
                    too_large.push((index, error));
                }
                None => fitting.push(*frame),
            }
        }
        // Overlap the others if that fits, with as many encoders as fit
        let bound = limit.map_or(u64::MAX, |limit| limit.0).min(free.unwrap_or(u64::MAX));
        let fits = |encoders: &u32| self.bound(&fitting, *encoders).total() <= bound;
        match (1..=self.setup.useful_encoders()).rev().find(fits) {
            Some(encoders) => {
                let need = self.peak(&fitting, encoders);
                Schedule { need, overlap: Overlap::Stages, encoders, too_large }
            }
            None => {
                let alone = fitting.iter().map(|frame| self.alone(frame));
                let need = alone.fold(MemoryNeed::default(), MemoryNeed::larger);
                Schedule { need, overlap: Overlap::None, encoders: 1, too_large }
            }
        }
    }
}
