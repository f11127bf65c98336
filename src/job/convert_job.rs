//! A conversion job: converts the frames of a sequence to native frames in a directory.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use serde_json::Value;
use spherule_formats::sequence::{Sequence, SequenceFrame};
use spherule_jobs::{
    DEFAULT_TAKEOVER_AFTER, FrameRange, Interrupt, Job, JobRequest, OnFrameEvent, ResumeMode,
    RunOptions, run_frames,
};

use super::selection::{frame_requests, frames_in, indices, select};
use super::target::{KIND, check_output_dir, stored_survey};
use super::{RunError, Shard, in_thread};
use crate::conversion::{
    Conversion, ConvertSettings, ConvertTask, ConvertWork, ConvertedFrame, UnknownAttribute,
};
use crate::manifest::real_dir;
use crate::survey::Survey;

/// Value of [`KIND`] in the plan of a conversion.
const CONVERT: &str = "convert";

/// A conversion job before anything is written.
#[derive(Debug)]
pub struct ConvertJob {
    /// The output that the user gave.
    output: PathBuf,
    /// Directory of the frames, absolute.
    dir: PathBuf,
    /// File name of the only frame, if one was given.
    name: Option<OsString>,
    settings: ConvertSettings,
    sequence: Sequence,
    range: Option<FrameRange>,
    shard: Option<Shard>,
}

impl ConvertJob {
    /// A job that converts the frames of `sequence` in `range`, or all. `output` is a directory, or the file of the
    /// only frame. This run processes `shard`, or all frames.
    ///
    /// # Errors
    /// The range selects no frames, the output is one file for several frames, or it would overwrite the input.
    pub fn new(
        output: &Path,
        settings: ConvertSettings,
        sequence: Sequence,
        range: Option<FrameRange>,
        shard: Option<Shard>,
    ) -> Result<Self, RunError> {
        let (dir, name) = split_output(output);
        let dir = if dir.as_os_str().is_empty() { PathBuf::from(".") } else { dir };
        let dir =
            std::path::absolute(&dir).map_err(RunError::file(&dir, "cannot be made absolute"))?;
        let job = Self {
            output: output.to_owned(),
            dir: real_dir(&dir),
            name,
            settings,
            sequence,
            range,
            shard,
        };
        job.check_outputs()?;
        Ok(job)
    }

    /// The frames of the input.
    pub const fn sequence(&self) -> &Sequence {
        &self.sequence
    }

    /// The directory of the frames and of all files of the job, absolute.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    fn output(&self, frame: i64) -> PathBuf {
        match &self.name {
            Some(name) => self.dir.join(name),
            None => self.dir.join(format!("frame.{frame:04}.spf")),
        }
    }

    /// Refuses one file for several frames, and outputs that are inputs.
    fn check_outputs(&self) -> Result<(), RunError> {
        let frames = frames_in(&self.sequence, self.range.as_ref())?;
        let is_named = self.name.is_some();
        if is_named && frames.len() > 1 {
            return Err(RunError::OneName { path: self.output.clone(), frames: frames.len() });
        }
        let is_selected = |(_, frame): &(usize, &SequenceFrame)| frames.contains(&frame.number);
        let all = self.sequence.frames().iter().enumerate();
        for (index, frame) in all.filter(|frame| !is_named || is_selected(frame)) {
            let output = self.output(frame.number);
            let is_output = |path: &&Path| path.canonicalize().is_ok_and(|real| real == output);
            if let Some(input) = self.sequence.inputs(index).into_iter().find(is_output) {
                let path = input.to_owned();
                return Err(RunError::OverwritesInput { path });
            }
        }
        Ok(())
    }

    fn request(&self, mode: ResumeMode) -> JobRequest {
        let mut settings = vec![(KIND.to_owned(), CONVERT.to_owned())];
        settings.extend(self.settings.settings());
        let mut frames =
            frame_requests(&self.sequence, |_| Vec::new(), |frame| vec![self.output(frame)]);
        if let Some(range) = self.range.as_ref().filter(|_| self.name.is_some()) {
            frames.retain(|frame| range.contains(frame.number));
        }
        JobRequest {
            settings,
            frames,
            extra_outputs: Vec::new(),
            selection: Some(select(&self.sequence, self.range.as_ref(), self.shard)),
            mode,
            takeover_after: DEFAULT_TAKEOVER_AFTER,
        }
    }

    /// Opens the job: starts or resumes it. Surveys the sequence if that is necessary.
    ///
    /// # Errors
    /// Nothing is converted then. See [`RunError`].
    pub fn open(&self, mode: ResumeMode) -> Result<(Job, Conversion), RunError> {
        check_output_dir(&self.dir, "frames", Some(CONVERT), mode)?;
        // Start a new job, or discard an old one, only if the conversion is possible
        let is_new = mode == ResumeMode::Force || Job::read_plan(&self.dir)?.is_none();
        let surveyed = is_new.then(|| self.survey()).transpose()?;
        let job = Job::open(&self.dir, self.request(mode), |_| {
            surveyed.map_or_else(|| self.survey(), Ok)
        })?;
        let survey = stored_survey(job.resolved(), &self.dir)?;
        let conversion = self.conversion(&survey)?;
        Ok((job, conversion))
    }

    /// Surveys the sequence: its origin, and the radius of frames without one.
    fn survey(&self) -> Result<Value, RunError> {
        let survey = in_thread(|| Survey::of(&self.sequence, self.settings.question()))?;
        self.conversion(&survey)?;
        Ok(serde_json::to_value(&survey)?)
    }

    fn conversion(&self, survey: &Survey) -> Result<Conversion, UnknownAttribute> {
        Conversion::new(self.settings.clone(), survey)
    }

    /// Converts the pending frames of `job`, and records them in it. Other workers may convert some of them. Returns
    /// when all are finished, or after the frame in progress once the interrupt is raised.
    ///
    /// # Errors
    /// The ledger or the frames cannot be written, for example because the disk is full.
    pub fn convert_pending(
        &self,
        job: &mut Job,
        conversion: &Conversion,
        interrupt: &Interrupt,
        on_event: OnFrameEvent<'_, ConvertedFrame>,
    ) -> Result<(), RunError> {
        let tasks: Vec<ConvertTask> = indices(&self.sequence, &job.pending())
            .map(|(frame, index)| ConvertTask { frame, index, output: self.output(frame) })
            .collect();
        let options = RunOptions {
            frames: tasks.iter().map(|task| task.frame).collect(),
            retries: 0,
            interrupt: interrupt.clone(),
        };
        let work = ConvertWork { conversion, sequence: &self.sequence, tasks: &tasks };
        Ok(run_frames(job, &work, &options, on_event)?)
    }
}

/// The directory of the frames, and the file name of the only frame if `output` is one.
fn split_output(output: &Path) -> (PathBuf, Option<OsString>) {
    let is_frame = |e: &OsStr| e.eq_ignore_ascii_case("spf");
    let is_file = output.extension().is_some_and(is_frame) && !output.is_dir();
    match (output.parent(), output.file_name()) {
        (Some(dir), Some(name)) if is_file => (dir.to_owned(), Some(name.to_owned())),
        _ => (output.to_owned(), None),
    }
}
