//! A caller's description of a job.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::time::Duration;

use crate::JobError;

/// How a run treats the results of earlier runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ResumeMode {
    /// Continue. Refuse if settings or inputs of finished frames have changed, or if outputs of a new job exist.
    #[default]
    Resume,
    /// Like [`ResumeMode::Resume`], but repeat finished frames whose inputs have changed
    /// ([`crate::Job::requeued`]). For inputs that a running simulation still writes.
    RequeueChanged,
    /// Discard plan and ledgers, and replace existing outputs. Images stay until they are replaced.
    Force,
    /// Keep finished frames although settings or inputs have changed. The other frames use the new settings.
    KeepDone,
}

/// A caller's description of a job.
#[derive(Debug, Clone)]
pub struct JobRequest {
    /// Everything that outputs depend on besides the inputs: dotted key and value.
    pub settings: Vec<(String, String)>,
    /// All frames. Numbers and outputs must be unique.
    pub frames: Vec<FrameRequest>,
    /// Files that the caller writes for the whole job. A new job refuses to replace existing ones.
    pub extra_outputs: Vec<PathBuf>,
    /// Frames of this run, in this order; None for all. Not part of the identity of the job.
    pub selection: Option<Vec<i64>>,
    /// How this run treats the results of earlier runs.
    pub mode: ResumeMode,
    /// A worker on another machine is declared dead, and its frames are taken over, after this long without a
    /// heartbeat.
    pub takeover_after: Duration,
}

/// Default of [`JobRequest::takeover_after`]: twelve missed heartbeats.
pub const DEFAULT_TAKEOVER_AFTER: Duration = Duration::from_secs(60);

/// One frame of a [`JobRequest`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameRequest {
    /// Frame number.
    pub number: i64,
    /// Input files. They need not be readable.
    pub inputs: Vec<PathBuf>,
    /// Further files that the outputs depend on, such as meshes. They do not tell one input from another.
    pub companions: Vec<PathBuf>,
    /// Output files.
    pub outputs: Vec<PathBuf>,
}

impl FrameRequest {
    /// All files that the outputs depend on.
    pub(crate) fn dependencies(&self) -> impl Iterator<Item = &PathBuf> {
        self.inputs.iter().chain(&self.companions)
    }
}

impl JobRequest {
    /// The frames of this run, in order.
    pub(crate) fn selected(&self) -> Vec<i64> {
        match &self.selection {
            Some(numbers) => numbers.clone(),
            None => self.frames.iter().map(|f| f.number).collect(),
        }
    }

    /// Refuses an inconsistent request.
    pub(crate) fn check(&self) -> Result<(), JobError> {
        let mut numbers = HashSet::new();
        let mut outputs = HashMap::new();
        for frame in &self.frames {
            if !numbers.insert(frame.number) {
                let frame = frame.number;
                return Err(JobError::DuplicateFrame { frame });
            }
            for path in &frame.outputs {
                if let Some(other) = outputs.insert(path, frame.number) {
                    return Err(JobError::SharedOutput {
                        path: path.clone(),
                        frames: [other, frame.number],
                    });
                }
            }
        }
        Ok(())
    }
}
