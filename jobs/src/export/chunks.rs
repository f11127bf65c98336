//! Frames in chunks: what one task of an engine does.

use std::fmt;
use std::num::NonZeroUsize;

use super::ExportError;
use crate::range::FrameRange;

/// Tasks where nothing is known of how long a frame takes: enough to fill a small cluster, few enough
/// that starting them is no burden.
const USUAL_TASKS: usize = 100;

/// The frames of each task, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chunks {
    /// What each task does; never empty.
    pub ranges: Vec<FrameRange>,
    /// Frames in each but the last, which may have fewer.
    pub size: usize,
    /// How the size came about.
    pub choice: ChunkChoice,
}

/// How many frames a task has, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChunkChoice {
    /// The user said so.
    Asked,
    /// About a hundred tasks.
    Usual,
    /// What was asked for would have made too many tasks.
    Enlarged {
        /// Frames a task that were asked for.
        asked: usize,
        /// Tasks that this would have made.
        tasks: usize,
        /// Tasks that there may be.
        most: usize,
    },
}

impl Chunks {
    /// Chunks of `asked` frames, or such that there are about a hundred of them, of `frames` in their
    /// order. Larger ones if there would be more than `most_tasks`.
    ///
    /// # Errors
    /// There are no frames.
    pub fn of(
        frames: &[i64],
        asked: Option<NonZeroUsize>,
        most_tasks: NonZeroUsize,
    ) -> Result<Self, ExportError> {
        let usual = frames.len().div_ceil(USUAL_TASKS).max(1);
        let wanted = asked.map_or(usual, NonZeroUsize::get);
        let size = wanted.max(frames.len().div_ceil(most_tasks.get()));
        let choice = match asked {
            Some(asked) if asked.get() < size => ChunkChoice::Enlarged {
                asked: asked.get(),
                tasks: frames.len().div_ceil(asked.get()),
                most: most_tasks.get(),
            },
            Some(_) => ChunkChoice::Asked,
            None => ChunkChoice::Usual,
        };
        let ranges: Vec<FrameRange> = frames
            .chunks(size.max(1))
            .filter_map(|chunk| FrameRange::from_frames(chunk.iter().copied()))
            .collect();
        if ranges.is_empty() {
            return Err(ExportError::NoFrames);
        }
        Ok(Self {
            ranges,
            size,
            choice,
        })
    }
}

impl fmt::Display for Chunks {
    /// `25 tasks of 10 frames, as asked for`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (tasks, frames) = (
            counted(self.ranges.len(), "task"),
            counted(self.size, "frame"),
        );
        write!(f, "{tasks} of {frames}, {}", self.choice)
    }
}

/// `1 frame`, `2 frames`.
pub(super) fn counted(count: usize, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

impl fmt::Display for ChunkChoice {
    /// The reason, to follow `3 frames a task`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Asked => write!(f, "as asked for"),
            Self::Usual => write!(
                f,
                "for about {USUAL_TASKS} tasks at the most, as it is not known how long a frame takes"
            ),
            Self::Enlarged { asked, tasks, most } => write!(
                f,
                "as {asked} would make {tasks} tasks, and arrays usually may have {most}"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn chunks(frames: &[i64], asked: usize, most: usize) -> Chunks {
        let most = NonZeroUsize::new(most).unwrap();
        Chunks::of(frames, NonZeroUsize::new(asked), most).unwrap()
    }

    fn texts(chunks: &Chunks) -> Vec<String> {
        chunks.ranges.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_last_chunk_is_short() {
        let frames: Vec<i64> = (-2..=5).collect();
        let found = chunks(&frames, 3, 1000);
        assert_eq!(texts(&found), ["-2-0", "1-3", "4-5"]);
        assert_eq!((found.size, found.choice), (3, ChunkChoice::Asked));
    }

    #[test]
    fn gaps_and_the_order_asked_for_stay() {
        assert_eq!(
            texts(&chunks(&[1, 3, 5, 100, 7, 2], 3, 1000)),
            ["1-5x2", "2,7,100"]
        );
        assert_eq!(texts(&chunks(&[9, 8, 7, 6], 2, 1000)), ["8-9", "6-7"]);
    }

    #[test]
    fn about_a_hundred_tasks_are_usual() {
        for (count, size, tasks) in [(1, 1, 1), (100, 1, 100), (101, 2, 51), (25_000, 250, 100)] {
            let frames: Vec<i64> = (0..count).collect();
            let found = chunks(&frames, 0, 1000);
            assert_eq!(
                (found.size, found.ranges.len()),
                (size, tasks),
                "{count} frames"
            );
            assert_eq!(found.choice, ChunkChoice::Usual);
        }
    }

    #[test]
    fn there_are_no_more_tasks_than_may_be() {
        let frames: Vec<i64> = (0..2500).collect();
        let found = chunks(&frames, 2, 1000);
        assert_eq!((found.size, found.ranges.len()), (3, 834));
        assert_eq!(
            found.choice.to_string(),
            "as 2 would make 1250 tasks, and arrays usually may have 1000"
        );
        assert_eq!(chunks(&frames, 2, 2000).ranges.len(), 1250);
        // Also of those that nobody asked for.
        assert_eq!(chunks(&frames, 0, 10).ranges.len(), 10);
    }

    #[test]
    fn no_frames_are_no_work() {
        let one = NonZeroUsize::MIN;
        assert_eq!(Chunks::of(&[], None, one), Err(ExportError::NoFrames));
    }

    proptest! {
        #[test]
        fn every_frame_is_in_one_chunk(
            frames in prop::collection::btree_set(-500i64..500, 1..200),
            asked in 0usize..20,
            most in 1usize..50,
        ) {
            let frames: Vec<i64> = frames.into_iter().collect();
            let found = chunks(&frames, asked, most);
            let all: Vec<i64> = found.ranges.iter().flat_map(FrameRange::iter).collect();
            prop_assert_eq!(all, frames);
            prop_assert!(found.ranges.len() <= most);
            prop_assert!(found.ranges.iter().all(|r| r.iter().count() <= found.size));
        }
    }
}
