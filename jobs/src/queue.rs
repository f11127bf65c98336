//! What a worker does next: the frames of its run, in their order, that no other worker has in hand.

use std::collections::VecDeque;
use std::thread;
use std::time::Duration;

use crate::{Claim, Claimed, Claims, Interrupt, JobError, Status};

/// First and longest pause between looks at frames that others have in hand.
const PAUSES: (Duration, Duration) = (Duration::from_millis(5), Duration::from_millis(500));

/// Hands out the frames of a run one by one.
#[derive(Debug)]
pub struct Queue {
    claims: Claims,
    interrupt: Interrupt,
    /// Not looked at yet, with their places in the run.
    fresh: VecDeque<(usize, i64)>,
    /// In the hands of others when they were looked at.
    held: VecDeque<(usize, i64)>,
}

/// What the queue has found out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QueueNews<'a> {
    /// Another worker has ended a frame.
    Elsewhere(i64, Status),
    /// Nothing is left but what others have in hand: a frame, and who has it.
    Waiting(i64, &'a str),
}

impl Queue {
    /// For the `frames` of a run, which were to be done when its worker began.
    pub fn new(
        claims: Claims,
        frames: impl IntoIterator<Item = i64>,
        interrupt: &Interrupt,
    ) -> Self {
        Self {
            claims,
            interrupt: interrupt.clone(),
            fresh: frames.into_iter().enumerate().collect(),
            held: VecDeque::new(),
        }
    }

    /// The next frame by its place in the run, claimed. With nothing left but what others have in hand,
    /// waits until they have ended it or have died. None at the end, or once the interrupt is raised.
    ///
    /// # Errors
    /// Those of [`Claims::take`].
    pub fn take(
        &mut self,
        news: &mut dyn FnMut(QueueNews),
    ) -> Result<Option<(usize, Claim)>, JobError> {
        let mut pause = PAUSES.0;
        let mut has_told = false;
        loop {
            let mut who = None;
            for _ in 0..self.fresh.len() + self.held.len() {
                if self.interrupt.is_raised() {
                    return Ok(None);
                }
                let next = self.fresh.pop_front().or_else(|| self.held.pop_front());
                let Some((place, frame)) = next else { break };
                match self.claims.take(frame)? {
                    Claimed::Mine(claim) => return Ok(Some((place, claim))),
                    Claimed::Ended(status) => news(QueueNews::Elsewhere(frame, status)),
                    Claimed::Held(holder) => {
                        self.held.push_back((place, frame));
                        who = Some((frame, holder));
                    }
                }
            }
            let Some((frame, who)) = who else {
                return Ok(None);
            };
            if !std::mem::replace(&mut has_told, true) {
                news(QueueNews::Waiting(frame, &who));
            }
            thread::sleep(pause);
            pause = (2 * pause).min(PAUSES.1);
        }
    }
}
