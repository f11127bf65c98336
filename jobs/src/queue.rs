//! The order of work of one worker: the frames of its run that no other worker holds.

use std::collections::VecDeque;
use std::time::Duration;

use crate::{Claim, ClaimOutcome, EntryStatus, FrameClaims, Interrupt, JobError};

/// Shortest and longest time between checks of frames that other workers hold.
const POLL_INTERVALS: (Duration, Duration) = (Duration::from_millis(5), Duration::from_millis(500));

/// Claims the frames of a run one after the other.
pub struct FrameQueue<'a> {
    claims: FrameClaims,
    interrupt: Interrupt,
    on_event: &'a (dyn Fn(QueueEvent<'_>) + Sync),
    /// Indices in the run and frames that were not tried yet.
    untried: VecDeque<(usize, i64)>,
    /// Frames that other workers held at the last check.
    held: VecDeque<(usize, i64)>,
}

/// A frame that no other worker processes meanwhile.
#[derive(Debug)]
pub struct ClaimedFrame {
    /// Its index in the frames of the run.
    pub index: usize,
    /// Frame number.
    pub frame: i64,
    pub(crate) claim: Claim,
}

impl ClaimedFrame {
    /// Whether other workers still consider this worker alive. Check it before a file of the frame is published: a
    /// worker that was suspended while others took over, or restarted with other settings, must not overwrite theirs.
    pub fn is_held(&self) -> bool {
        self.claim.is_valid()
    }
}

/// What other workers do with the frames of a queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QueueEvent<'a> {
    /// Another worker has finished this frame.
    FinishedElsewhere(i64, EntryStatus),
    /// All remaining frames are held by other workers: one of the frames, and a description of its worker.
    Waiting(i64, &'a str),
}

impl<'a> FrameQueue<'a> {
    /// A queue of the `frames` of a run, which were pending when the worker started.
    pub(crate) fn new(
        claims: FrameClaims,
        frames: impl IntoIterator<Item = i64>,
        interrupt: &Interrupt,
        on_event: &'a (dyn Fn(QueueEvent<'_>) + Sync),
    ) -> Self {
        Self {
            claims,
            interrupt: interrupt.clone(),
            on_event,
            untried: frames.into_iter().enumerate().collect(),
            held: VecDeque::new(),
        }
    }

    /// Claims the next frame. If other workers hold all remaining frames, blocks until they have finished or died.
    /// None at the end of the run, or once the interrupt is raised.
    ///
    /// # Errors
    /// Those of [`FrameClaims::claim`].
    #[expect(clippy::should_implement_trait, reason = "an iterator cannot return errors with `?`")]
    pub fn next(&mut self) -> Result<Option<ClaimedFrame>, JobError> {
        let mut interval = POLL_INTERVALS.0;
        let mut has_reported = false;
        loop {
            let mut waiting_for = None;
            // Try each frame once
            for _ in 0..self.untried.len() + self.held.len() {
                if self.interrupt.is_raised() {
                    return Ok(None);
                }
                let next = self.untried.pop_front().or_else(|| self.held.pop_front());
                let Some((index, frame)) = next else { break };
                match self.claims.claim(frame)? {
                    ClaimOutcome::Acquired(claim) => {
                        return Ok(Some(ClaimedFrame { index, frame, claim }));
                    }
                    ClaimOutcome::Finished(status) => {
                        (self.on_event)(QueueEvent::FinishedElsewhere(frame, status));
                    }
                    ClaimOutcome::Held(holder) => {
                        self.held.push_back((index, frame));
                        waiting_for = Some((frame, holder));
                    }
                }
            }
            // Frames are left that others hold: wait longer each time
            let Some((frame, holder)) = waiting_for else {
                return Ok(None);
            };
            if !std::mem::replace(&mut has_reported, true) {
                (self.on_event)(QueueEvent::Waiting(frame, &holder));
            }
            self.claims.clock().sleep(interval);
            interval = (2 * interval).min(POLL_INTERVALS.1);
        }
    }
}
