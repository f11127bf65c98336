//! A render job before anything is written: shared by `render`, `check`, `still` and `export`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;
use spherule_formats::Sequence;
use spherule_jobs::{FrameRequest, Job, JobRequest, ResumeMode, publish, read_regular_text};

use super::CliError;
use super::job::{
    JobArgs, frames_in, guard_directory, guard_kind, requests, saved_survey, selection,
};
use super::manifest_args::{ManifestArgs, RequestedManifest, in_thread};
use super::paths::absolute;
use super::schema::{is_schema, schema_text};
use super::shard::Shard;
use crate::manifest::{
    Manifest, OutputPattern, SCHEMA_FILE, is_marked, marked, named_place, read_manifest, real_dir,
};
use crate::metrics::memory::available;
use crate::pipeline::{FrameSize, ImageTask, MemoryModel, Schedule, Setup};
use crate::report::job::{HTML_FILE, JSON_FILE};
use crate::resolve::{self, check_views, question};
use crate::survey::Survey;

/// The manifest that is written next to the images.
const JOB_FILE: &str = "job.toml";

/// Arguments of `render` and `check`.
#[derive(Debug, Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    pub(super) manifest: ManifestArgs,
    #[command(flatten)]
    pub(super) job: JobArgs,
}

/// A render job before anything is written.
pub(super) struct RenderJob {
    /// Directory of the images and of all files of the job. Absolute.
    pub(super) dir: PathBuf,
    /// The manifest, with paths relative to `dir`.
    pub(super) manifest: Manifest,
    /// The file of the manifest, absolute.
    file: Option<PathBuf>,
    /// The manifest in that file, also relative to `dir`; None if it is not valid without options.
    unchanged: Option<Manifest>,
    /// The output path that the user gave.
    pub(super) shown_output: PathBuf,
    /// The part of the frames that this run processes.
    shard: Option<Shard>,
}

impl RenderJob {
    pub(super) fn new(
        requested: RequestedManifest,
        sequence: &Sequence,
        shard: Option<Shard>,
    ) -> Result<Self, CliError> {
        let base = requested.absolute_base()?;
        let mut manifest = requested.manifest;
        let range = manifest.input.frames.as_ref();
        let frames = frames_in(sequence, range, "input.frames")?;
        manifest.check_frame_count(frames.len())?;
        let shown_output = PathBuf::from(manifest.output.path.as_str());
        let dir = real_dir(&base.join(manifest.output.path.dir()));
        move_into(&mut manifest, &base, &dir)?;
        let mut unchanged = requested.unchanged;
        if let Some(manifest) = &mut unchanged {
            move_into(manifest, &base, &dir)?;
        }
        let file = requested
            .file
            .as_deref()
            .map(absolute)
            .transpose()?
            .map(|f| named_place(&f));
        Ok(Self {
            dir,
            manifest,
            file,
            unchanged,
            shown_output,
            shard,
        })
    }

    fn job_file(&self) -> PathBuf {
        self.dir.join(JOB_FILE)
    }

    /// Whether the given manifest is the file that this job would write.
    fn is_own_manifest(&self) -> bool {
        self.file.as_deref() == Some(&self.job_file())
    }

    /// The selected frames, done or not.
    pub(super) fn selected(&self, sequence: &Sequence) -> Vec<i64> {
        selection(sequence, self.manifest.input.frames.as_ref(), self.shard)
    }

    /// Refuses an output directory that is a file, or that contains a job of another kind.
    pub(super) fn guard_directory(&self, mode: ResumeMode) -> Result<(), CliError> {
        guard_directory(&self.dir, "images")?;
        guard_kind(&self.dir, None, mode)
    }

    /// Refuses to start a job next to a `job.toml` that a user wrote for something else. No option overwrites such
    /// a file.
    pub(super) fn guard_manifest(&self) -> Result<(), CliError> {
        let path = self.job_file();
        let is_free = || !path.exists() || read_manifest(&path).is_ok_and(|text| is_marked(&text));
        if self.is_own_manifest() || is_free() || Job::exists(&self.dir)? {
            return Ok(());
        }
        Err(CliError::other(format!(
            "{}: this job would write its manifest here; render that file, choose another \
             output directory, or move the file away",
            path.display()
        )))
    }

    fn image(&self, frame: i64) -> PathBuf {
        self.dir.join(self.manifest.output.path.path_for(frame))
    }

    fn preview(&self, frame: i64) -> Option<PathBuf> {
        let path = || {
            self.dir
                .join(self.manifest.output.path.preview_path_for(frame))
        };
        self.manifest.output.preview.then(path)
    }

    /// The request for the job.
    ///
    /// # Errors
    /// The plan of the existing job cannot be read.
    pub(super) fn request(
        &self,
        sequence: &Sequence,
        mode: ResumeMode,
    ) -> Result<JobRequest, CliError> {
        let outputs = |frame| {
            let image = std::iter::once(self.image(frame));
            image.chain(self.preview(frame)).collect()
        };
        Ok(JobRequest {
            settings: self.settings(mode)?,
            frames: self.frames_of_job(requests(sequence, outputs)),
            extra_outputs: [JSON_FILE, HTML_FILE]
                .map(|name| self.dir.join(name))
                .into(),
            selection: Some(self.selected(sequence)),
            mode: match mode {
                // A running simulation may have paused in the middle of a file
                ResumeMode::Resume if self.manifest.job.follow => ResumeMode::RequeueChanged,
                mode => mode,
            },
            takeover_after: self.manifest.job.takeover_after,
        })
    }

    /// The settings of the images. Those with the same effect as in the existing plan are written as in the plan.
    fn settings(&self, mode: ResumeMode) -> Result<Vec<(String, String)>, CliError> {
        let settings = self.manifest.settings();
        let planned = match mode {
            ResumeMode::Force => None,
            _ => Job::read_plan(&self.dir)?,
        };
        let Some(planned) = planned else {
            return Ok(settings);
        };
        let has_rgb = planned.resolved().get("rgb").is_some_and(Value::is_object);
        let as_planned = self
            .manifest
            .settings_as_planned(planned.settings(), has_rgb);
        // Settings that are resolved again must be the new ones
        let resolves_again =
            mode == ResumeMode::KeepDone && !planned.changes_to(&as_planned).is_empty();
        Ok(match resolves_again {
            true => settings,
            false => as_planned,
        })
    }

    /// The frames of the job: all of the sequence, or the selected one if the output has no number.
    fn frames_of_job(&self, mut all: Vec<FrameRequest>) -> Vec<FrameRequest> {
        let range = self.manifest.input.frames.as_ref();
        if let Some(range) = range.filter(|_| !self.manifest.output.path.has_number()) {
            all.retain(|frame| range.contains(frame.number));
        }
        all
    }

    /// The request that adds the frames `new` to an open job.
    ///
    /// # Errors
    /// The plan cannot be read.
    pub(super) fn request_for(
        &self,
        sequence: &Sequence,
        new: &[i64],
    ) -> Result<JobRequest, CliError> {
        Ok(JobRequest {
            selection: Some(new.to_vec()),
            ..self.request(sequence, ResumeMode::Resume)?
        })
    }

    pub(super) fn open(&self, sequence: &Sequence, mode: ResumeMode) -> Result<Job, CliError> {
        let request = self.request(sequence, mode)?;
        // Start a new job, or discard an old one, only if its images are possible
        let surveyed = if mode == ResumeMode::Force || Job::read_plan(&self.dir)?.is_none() {
            Some(self.survey_for_start(sequence)?)
        } else {
            None
        };
        Ok(Job::open(&self.dir, request, |_| {
            surveyed.map_or_else(|| to_value(&self.survey(sequence)?.0), Ok)
        })?)
    }

    fn survey_for_start(&self, sequence: &Sequence) -> Result<Value, CliError> {
        let (survey, setup) = self.survey(sequence)?;
        let mut tasks = self.tasks(sequence, &self.selected(sequence));
        self.fit(sequence, &setup, &mut tasks);
        require_one_fits(&tasks)?;
        to_value(&survey)
    }

    /// Surveys the sequence, and resolves the automatic settings with it.
    pub(super) fn survey(&self, sequence: &Sequence) -> Result<(Survey, Setup), CliError> {
        message!("surveying the sequence");
        let survey = in_thread(|| Survey::of(sequence, question(&self.manifest)))?;
        let setup = self.setup(&survey, sequence)?;
        Ok((survey, setup))
    }

    /// The setup, if the view is valid along the whole camera path.
    fn setup(&self, survey: &Survey, sequence: &Sequence) -> Result<Setup, CliError> {
        let frames = sequence.frames().iter().map(|frame| frame.number);
        let setup = resolve::setup(&self.manifest, survey);
        let setup = setup.and_then(|setup| check_views(&setup, frames).map(|()| setup));
        Ok(setup?)
    }

    /// The setup with the survey that is stored in the plan.
    pub(super) fn stored_setup(
        &self,
        resolved: &Value,
        sequence: &Sequence,
    ) -> Result<(Survey, Setup), CliError> {
        let survey = saved_survey(resolved, &self.dir)?;
        let setup = self.setup(&survey, sequence)?;
        Ok((survey, setup))
    }

    /// Decides whether frames overlap in memory. Tasks that exceed the limit are marked as refused.
    pub(super) fn fit(
        &self,
        sequence: &Sequence,
        setup: &Setup,
        tasks: &mut [ImageTask],
    ) -> Schedule {
        let sizes: Vec<FrameSize> = tasks
            .iter()
            .map(|task| FrameSize::of(sequence, task.index, setup.run.weight.as_ref()))
            .collect();
        let limit = self.manifest.render.memory_limit;
        let mut schedule = MemoryModel::new(setup).schedule(&sizes, limit, available());
        for (index, error) in schedule.too_large.drain(..) {
            tasks[index].refused = Some(error);
        }
        schedule
    }

    /// Writes the manifest next to the images, unless that file is the given manifest or is up to date. If it is the
    /// given manifest, options are added to it only if `resolves_again` is set. A file that a user wrote or edited
    /// is not changed.
    pub(super) fn write_manifest(&self, resolves_again: bool) -> Result<(), CliError> {
        let path = self.job_file();
        let mut manifest = self.manifest.clone();
        if let Some(unchanged) = &self.unchanged {
            // The frame selection and execution options of one worker are not properties of the job
            manifest.input.frames = unchanged.input.frames.clone();
            manifest.job = unchanged.job.clone();
            manifest.render.memory_limit = unchanged.render.memory_limit;
        }
        if self.is_own_manifest() && (!resolves_again || self.unchanged.as_ref() == Some(&manifest))
        {
            return Ok(());
        }
        if path.exists() {
            let text = read_manifest(&path).unwrap_or_default();
            if !is_marked(&text) {
                if Manifest::parse(&text, &path).ok().as_ref() != Some(&manifest) {
                    note!(
                        "{}: not written by spherule, or edited since, so it is not changed; the settings of this job \
                         differ from it: give the same options again, or add them to the file",
                        path.display()
                    );
                }
                return Ok(());
            }
        }
        write_if_changed(&path, &marked(&manifest.to_commented_toml()))?;
        self.write_schema();
        Ok(())
    }

    /// Writes the schema that the first line of the manifest refers to. Only editors use it.
    fn write_schema(&self) {
        let path = self.dir.join(SCHEMA_FILE);
        if path.exists() && !is_schema(&path) {
            return;
        }
        if let Err(error) = write_if_changed(&path, &schema_text()) {
            note!("{error}; editors will not have a schema");
        }
    }

    pub(super) fn tasks(&self, sequence: &Sequence, pending: &[i64]) -> Vec<ImageTask> {
        let frames = sequence.frames();
        let task = |number: &i64| {
            let index = frames.binary_search_by_key(number, |f| f.number).ok()?;
            Some(ImageTask {
                frame: *number,
                index,
                image: self.image(*number),
                preview: self.preview(*number),
                refused: None,
            })
        };
        pending.iter().filter_map(task).collect()
    }
}

fn write_if_changed(path: &Path, text: &str) -> Result<(), CliError> {
    if read_regular_text(path, text.len() as u64).is_ok_and(|old| old == text) {
        return Ok(());
    }
    publish(path, text.as_bytes()).map_err(CliError::io(path))
}

fn to_value(survey: &Survey) -> Result<Value, CliError> {
    serde_json::to_value(survey).map_err(|e| CliError::Other(e.to_string()))
}

/// Refuses a run in which no frame fits into memory.
pub(super) fn require_one_fits(tasks: &[ImageTask]) -> Result<(), CliError> {
    let refused = tasks.iter().map(|t| Some((t.frame, t.refused.as_ref()?)));
    match refused.collect::<Option<Vec<_>>>().as_deref() {
        Some([(frame, reason), ..]) => Err(CliError::other(format!(
            "no frame fits into memory: frame {frame}: {reason}"
        ))),
        _ => Ok(()),
    }
}

/// Makes the paths in `manifest` relative to `dir`, the directory of its images.
fn move_into(manifest: &mut Manifest, base: &Path, dir: &Path) -> Result<(), CliError> {
    manifest.rebase(base, dir)?;
    // Store only the file name, so that the directory can be moved with its manifest
    if real_dir(&dir.join(manifest.output.path.dir())) == dir {
        manifest.output.path =
            OutputPattern::parse(manifest.output.path.file_name()).map_err(CliError::Other)?;
    }
    Ok(())
}
