//! What a caller asks of a job.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::time::Duration;

use crate::JobError;

/// What to do with what an earlier run left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Go on with it; refuse if settings, or inputs of finished frames, have changed, or if a new job's
    /// outputs are there already.
    #[default]
    Resume,
    /// As [`Mode::Resume`], but finished frames whose inputs have changed are made again
    /// ([`crate::Job::requeued`]): for inputs that a running simulation still writes.
    RequeueChanged,
    /// Forget plan and ledgers, and replace whatever has the names of outputs. Images stay until then.
    Force,
    /// Finished frames stay finished whatever has changed; the rest is done as asked now.
    KeepDone,
}

/// What the caller wants done.
#[derive(Debug, Clone)]
pub struct JobRequest {
    /// Everything that outputs depend on besides the inputs: dotted key and value.
    pub settings: Vec<(String, String)>,
    /// All frames there are, each number and each output once.
    pub frames: Vec<FrameRequest>,
    /// Files that the caller writes for the job as a whole: a new job does not replace them either.
    pub extra_outputs: Vec<PathBuf>,
    /// Numbers of those to do in this run, in this order; all if None. Not part of the job's identity.
    pub selection: Option<Vec<i64>>,
    /// What to do with what an earlier run left.
    pub mode: Mode,
    /// How long a worker on another machine may give no sign of life before its frames are taken over.
    pub patience: Duration,
}

/// Usual [`JobRequest::patience`]: twelve signs of life missed.
pub const DEFAULT_PATIENCE: Duration = Duration::from_secs(60);

/// One frame of a [`JobRequest`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameRequest {
    /// The frame's number.
    pub number: i64,
    /// Files it is made from; they need not be readable.
    pub inputs: Vec<PathBuf>,
    /// Files it will be made into.
    pub outputs: Vec<PathBuf>,
}

impl JobRequest {
    /// The numbers of the frames to do in this run, in their order.
    pub(crate) fn selected(&self) -> Vec<i64> {
        match &self.selection {
            Some(numbers) => numbers.clone(),
            None => self.frames.iter().map(|f| f.number).collect(),
        }
    }

    /// Refuses a request that contradicts itself.
    pub(crate) fn check(&self) -> Result<(), JobError> {
        let mut numbers = HashSet::new();
        let mut outputs = HashMap::new();
        for frame in &self.frames {
            if !numbers.insert(frame.number) {
                let what = format!("frame {} is there twice", frame.number);
                return Err(JobError::Request(what));
            }
            for path in &frame.outputs {
                if let Some(other) = outputs.insert(path, frame.number) {
                    let what = format!(
                        "{}: frames {other} and {} would both be written here; put #### into the output's name",
                        path.display(),
                        frame.number
                    );
                    return Err(JobError::Request(what));
                }
            }
        }
        Ok(())
    }
}
