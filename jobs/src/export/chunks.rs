//! Divides frames into chunks, one per task.

use std::fmt;
use std::num::NonZeroUsize;

use super::ExportError;
use crate::range::FrameRange;

/// Number of tasks by default: enough to fill a small cluster, few enough that the cost of starting them does not
/// matter.
const DEFAULT_TASKS: usize = 100;

/// The frames of each task, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chunks {
    /// The frames of each task; never empty.
    pub ranges: Vec<FrameRange>,
    /// Frames per task. The last task may have fewer.
    pub size: usize,
    /// Why this size was chosen.
    pub choice: ChunkChoice,
}

/// Why a task has its number of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChunkChoice {
    /// The user chose the size.
    Requested,
    /// Default: about a hundred tasks.
    Default,
    /// The requested size would have given too many tasks.
    Enlarged {
        /// Requested frames per task.
        requested: usize,
        /// Number of tasks with that size.
        tasks: usize,
        /// Largest number of tasks.
        max_tasks: usize,
    },
}

impl Chunks {
    /// Divides `frames`, in their order, into chunks of `requested` frames, or into about a hundred chunks. Uses
    /// larger chunks if there would be more than `max_tasks`.
    ///
    /// # Errors
    /// There are no frames.
    pub fn of(
        frames: &[i64],
        requested: Option<NonZeroUsize>,
        max_tasks: NonZeroUsize,
    ) -> Result<Self, ExportError> {
        // Choose the size
        let default = frames.len().div_ceil(DEFAULT_TASKS).max(1);
        let preferred = requested.map_or(default, NonZeroUsize::get);
        let size = preferred.max(frames.len().div_ceil(max_tasks.get()));
        // Remember why, for the report
        let choice = match requested {
            Some(requested) if requested.get() < size => ChunkChoice::Enlarged {
                requested: requested.get(),
                tasks: frames.len().div_ceil(requested.get()),
                max_tasks: max_tasks.get(),
            },
            Some(_) => ChunkChoice::Requested,
            None => ChunkChoice::Default,
        };
        // Divide the frames
        let ranges: Vec<FrameRange> = frames
            .chunks(size.max(1))
            .filter_map(|chunk| FrameRange::from_frames(chunk.iter().copied()))
            .collect();
        if ranges.is_empty() {
            return Err(ExportError::NoFrames);
        }
        Ok(Self { ranges, size, choice })
    }
}

impl fmt::Display for Chunks {
    /// `25 tasks of 10 frames, as requested`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (tasks, frames) = (counted(self.ranges.len(), "task"), counted(self.size, "frame"));
        write!(f, "{tasks} of {frames}, {}", self.choice)
    }
}

/// `1 frame`, `2 frames`.
pub(super) fn counted(count: usize, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

impl fmt::Display for ChunkChoice {
    /// The reason, as it follows `3 frames per task`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Requested => write!(f, "as requested"),
            Self::Default => write!(f, "the default, for at most {DEFAULT_TASKS} tasks"),
            Self::Enlarged { requested, tasks, max_tasks } => write!(
                f,
                "because {requested} would give {tasks} tasks, and arrays are usually limited to {max_tasks}"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn chunks(frames: &[i64], requested: usize, max_tasks: usize) -> Chunks {
        let max_tasks = NonZeroUsize::new(max_tasks).unwrap();
        Chunks::of(frames, NonZeroUsize::new(requested), max_tasks).unwrap()
    }

    fn texts(chunks: &Chunks) -> Vec<String> {
        chunks.ranges.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_last_chunk_is_short() {
        let frames: Vec<i64> = (-2..=5).collect();
        let found = chunks(&frames, 3, 1000);
        assert_eq!(texts(&found), ["-2-0", "1-3", "4-5"]);
        assert_eq!((found.size, found.choice), (3, ChunkChoice::Requested));
    }

    #[test]
    fn gaps_and_order_are_kept() {
        assert_eq!(texts(&chunks(&[1, 3, 5, 100, 7, 2], 3, 1000)), ["1-5x2", "2,7,100"]);
        assert_eq!(texts(&chunks(&[9, 8, 7, 6], 2, 1000)), ["8-9", "6-7"]);
    }

    #[test]
    fn about_a_hundred_tasks_by_default() {
        for (count, size, tasks) in [(1, 1, 1), (100, 1, 100), (101, 2, 51), (25_000, 250, 100)] {
            let frames: Vec<i64> = (0..count).collect();
            let found = chunks(&frames, 0, 1000);
            assert_eq!((found.size, found.ranges.len()), (size, tasks), "{count} frames");
            assert_eq!(found.choice, ChunkChoice::Default);
        }
    }

    #[test]
    fn the_number_of_tasks_is_limited() {
        let frames: Vec<i64> = (0..2500).collect();
        let found = chunks(&frames, 2, 1000);
        assert_eq!((found.size, found.ranges.len()), (3, 834));
        assert_eq!(
            found.choice.to_string(),
            "because 2 would give 1250 tasks, and arrays are usually limited to 1000"
        );
        assert_eq!(chunks(&frames, 2, 2000).ranges.len(), 1250);
        // The limit also applies to the default
        assert_eq!(chunks(&frames, 0, 10).ranges.len(), 10);
    }

    #[test]
    fn no_frames_are_an_error() {
        let one = NonZeroUsize::MIN;
        assert_eq!(Chunks::of(&[], None, one), Err(ExportError::NoFrames));
    }

    proptest! {
        #[test]
        fn every_frame_is_in_one_chunk(
            frames in prop::collection::btree_set(-500i64..500, 1..200),
            requested in 0usize..20,
            max_tasks in 1usize..50,
        ) {
            let frames: Vec<i64> = frames.into_iter().collect();
            let found = chunks(&frames, requested, max_tasks);
            let all: Vec<i64> = found.ranges.iter().flat_map(FrameRange::iter).collect();
            prop_assert_eq!(all, frames);
            prop_assert!(found.ranges.len() <= max_tasks);
            prop_assert!(found.ranges.iter().all(|r| r.iter().count() <= found.size));
        }
    }
}
