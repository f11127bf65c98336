//! Hands traced images to encoders, and records their results in the order of the run.
//!
//! An encoder gets another image only when its last one is recorded. So no image is further ahead of the ledger than
//! there are encoders, whatever one of them waits for.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::time::Instant;

use spherule_jobs::{ClaimedFrame, FinishedFrame, FrameFailure, FrameRecorder, JobError, Recorded};

use super::renderer::TracedFrame;
use crate::report::FrameReport;

/// A frame between two stages, or the reason why it failed.
pub(super) struct StagedFrame<T> {
    pub(super) claimed: ClaimedFrame,
    pub(super) result: Result<T, FrameFailure>,
}

/// A frame at an encoder.
pub(super) struct AtEncoder<T> {
    /// Its place in the run, from 0.
    pub(super) place: u64,
    /// The index of the encoder.
    pub(super) encoder: usize,
    pub(super) frame: T,
}

/// A frame whose image is published, or the reason why it is not.
pub(super) struct EncodedFrame {
    pub(super) claimed: ClaimedFrame,
    pub(super) result: Result<FinishedFrame<FrameReport>, NotEncoded>,
}

/// Why there is no image of a frame.
pub(super) enum NotEncoded {
    /// It failed.
    Failed(FrameFailure),
    /// Another worker may have it.
    NotHeld,
}

/// The end of the tracer: the channels to all encoders.
pub(super) struct ToEncoders {
    encoders: Vec<SyncSender<AtEncoder<StagedFrame<TracedFrame>>>>,
    /// Those without an image.
    idle: BTreeSet<usize>,
    /// Receives encoders whose image is recorded.
    freed: Receiver<usize>,
    next_place: u64,
}

impl ToEncoders {
    pub(super) fn new(
        encoders: Vec<SyncSender<AtEncoder<StagedFrame<TracedFrame>>>>,
        freed: Receiver<usize>,
    ) -> Self {
        Self { idle: (0..encoders.len()).collect(), encoders, freed, next_place: 0 }
    }

    /// Waits for an encoder, and sends it the frame. The first idle one, so that the others have no memory while they
    /// are not needed. Returns false once nothing can be recorded.
    pub(super) fn send(&mut self, frame: StagedFrame<TracedFrame>) -> bool {
        self.idle.extend(self.freed.try_iter());
        let Some(encoder) = self.idle.pop_first().or_else(|| self.freed.recv().ok()) else {
            return false;
        };
        let place = self.next_place;
        self.next_place += 1;
        self.encoders[encoder].send(AtEncoder { place, encoder, frame }).is_ok()
    }
}

/// The end of the third stage: records every frame in the job, after its image.
pub(super) struct RecordStage {
    /// To the tracer: encoders whose image is recorded.
    pub(super) freed: Sender<usize>,
    /// To the reader, without overlap: read the next frame.
    pub(super) is_written: Option<SyncSender<()>>,
}

impl RecordStage {
    pub(super) fn run(
        &self,
        encoded: Receiver<AtEncoder<EncodedFrame>>,
        recorder: &mut FrameRecorder<'_, FrameReport>,
    ) -> Result<(), JobError> {
        let mut waiting = BTreeMap::new();
        let mut next_place = 0;
        let mut image_before = Instant::now();
        for AtEncoder { place, encoder, frame } in encoded {
            waiting.insert(place, (encoder, frame));
            // Record it and those that waited for it
            while let Some((encoder, frame)) = waiting.remove(&next_place) {
                next_place += 1;
                if record(frame, recorder, &mut image_before)? == Recorded::Stopped {
                    return Ok(());
                }
                // The stages before may have ended
                let _ = self.freed.send(encoder);
                if let Some(is_written) = &self.is_written {
                    let _ = is_written.send(());
                }
            }
        }
        Ok(())
    }
}

/// Records a frame, with the time since the image before.
fn record(
    frame: EncodedFrame,
    recorder: &mut FrameRecorder<'_, FrameReport>,
    image_before: &mut Instant,
) -> Result<Recorded, JobError> {
    let EncodedFrame { claimed, result } = frame;
    match result {
        Ok(mut finished) => {
            finished.report.seconds.wall = image_before.elapsed().as_secs_f64();
            *image_before = Instant::now();
            recorder.record(claimed, Ok(finished))
        }
        Err(NotEncoded::Failed(failure)) => recorder.record(claimed, Err(failure)),
        Err(NotEncoded::NotHeld) => Err(recorder.declared_dead()),
    }
}
