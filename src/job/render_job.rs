//! A render job before anything is written: manifest, directory, frames, and the setup of its images.

use std::path::{Path, PathBuf};

use serde_json::Value;
use spherule_files::memory::available;
use spherule_formats::Sequence;
use spherule_jobs::{FrameRequest, Job, JobRequest, Plan, ResumeMode};

use super::manifest_file::{JobManifest, ManifestFile};
use super::scene_files::SceneFiles;
use super::selection::{frame_requests, frames_in, indices, select};
use super::target::{check_output_dir, stored_survey};
use super::{Findings, RunError, Shard};
use crate::manifest::{DeviceSetting, FitSetting, Manifest};
use crate::pipeline::{FrameSize, ImageTask, MemoryModel, NextMeshes, Schedule, Setup, gpu};
use crate::render::RendererKind;
use crate::report::job::{HTML_FILE, JSON_FILE};
use crate::resolve::Inquiry;
use crate::survey::{Question, Survey};

/// A render job before anything is written.
#[derive(Debug, Clone)]
pub struct RenderJob {
    /// With paths relative to the directory of the job.
    manifest: Manifest,
    manifest_file: ManifestFile,
    /// The output path of the given manifest.
    shown_output: PathBuf,
    shard: Option<Shard>,
    files: SceneFiles,
    /// The number of the frame that others are placed like, if they are.
    reference: Option<i64>,
}

/// The setting of plans with the number of the frame that others are placed like; not a key of manifests.
const REFERENCE: &str = "cell.reference";

impl RenderJob {
    /// A job with the frames of `sequence`. This run processes `shard`, or all frames.
    ///
    /// # Errors
    /// The manifest selects no frames, or has one output for several frames.
    pub fn new(
        requested: JobManifest,
        sequence: &Sequence,
        shard: Option<Shard>,
    ) -> Result<Self, RunError> {
        let frames = frames_in(sequence, requested.manifest.input.frames.as_ref())?;
        requested.manifest.check_frame_count(frames.len())?;
        let shown_output = PathBuf::from(requested.manifest.output.path.as_str());
        let (manifest_file, manifest) = ManifestFile::new(requested)?;
        let files = SceneFiles::new(manifest_file.dir());
        let first = sequence.frames().first().map(|frame| frame.number);
        let reference = first.filter(|_| manifest.cell.has_reference());
        Ok(Self { manifest, manifest_file, shown_output, shard, files, reference })
    }

    /// The job with the defaults of the version that began it, if a run in `mode` resumes one.
    ///
    /// # Errors
    /// The plan of the existing job cannot be read.
    pub fn resuming(mut self, mode: ResumeMode) -> Result<Self, RunError> {
        if let Some(planned) = self.existing_plan(mode)? {
            self.manifest.adopt_old_defaults(planned.settings());
        }
        Ok(self)
    }

    /// The job, which keeps its environment for other views: see [`RenderJob::with_files_of`].
    #[must_use]
    pub fn keeping_environment(mut self) -> Self {
        self.files.keep_environment();
        self
    }

    /// The job with the pictures and meshes that `other` has read, if both name the same ones.
    #[must_use]
    pub fn with_files_of(mut self, other: &Self) -> Self {
        if self.files.are_those_of(&other.files, [&self.manifest, &other.manifest]) {
            self.files = other.files.clone();
        }
        self
    }

    /// The manifest, with paths relative to [`RenderJob::dir`].
    pub const fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The directory of the images and of all files of the job, absolute.
    pub fn dir(&self) -> &Path {
        self.manifest_file.dir()
    }

    /// The output path of the given manifest.
    pub fn shown_output(&self) -> &Path {
        &self.shown_output
    }

    /// The frames of this run, done or not.
    pub fn selected(&self, sequence: &Sequence) -> Vec<i64> {
        select(sequence, self.manifest.input.frames.as_ref(), self.shard)
    }

    /// Checks the output directory: it must not be a file, or contain a job of another kind.
    ///
    /// # Errors
    /// [`RunError::OutputIsFile`], [`RunError::OtherKind`], or the plan of the existing job cannot be read.
    pub fn check_output_dir(&self, mode: ResumeMode) -> Result<(), RunError> {
        check_output_dir(self.dir(), "images", None, mode)
    }

    /// Checks that a new job would not overwrite a `job.toml` that a user wrote for something else.
    ///
    /// # Errors
    /// [`RunError::ForeignManifest`], or the directory cannot be read.
    pub fn check_manifest_file(&self) -> Result<(), RunError> {
        if self.manifest_file.is_free() || Job::exists(self.dir())? {
            return Ok(());
        }
        let path = self.manifest_file.path();
        Err(RunError::ForeignManifest { path })
    }

    /// Writes the manifest next to the images; returns notes for the user. A file that a user wrote or edited is not
    /// changed. Overrides are added to the given manifest only in a `mode` that resolves automatic settings again.
    pub(super) fn write_manifest(&self, mode: ResumeMode) -> Result<Vec<String>, RunError> {
        let resolves_again = matches!(mode, ResumeMode::Force | ResumeMode::KeepDone);
        self.manifest_file.write(&self.manifest, resolves_again)
    }

    fn image(&self, frame: i64) -> PathBuf {
        self.dir().join(self.manifest.output.path.path_for(frame))
    }

    fn preview(&self, frame: i64) -> Option<PathBuf> {
        let output = &self.manifest.output;
        let path = || self.dir().join(output.path.preview_path_for(frame));
        output.has_previews().then(path)
    }

    /// The request for the job.
    ///
    /// # Errors
    /// The plan of the existing job cannot be read.
    pub fn request(&self, sequence: &Sequence, mode: ResumeMode) -> Result<JobRequest, RunError> {
        let outputs = |frame| {
            let image = std::iter::once(self.image(frame));
            image.chain(self.preview(frame)).collect()
        };
        Ok(JobRequest {
            settings: self.settings(mode)?,
            frames: self.frames_of_job(frame_requests(
                sequence,
                |frame| self.mesh_files(frame),
                outputs,
            )),
            extra_outputs: [JSON_FILE, HTML_FILE].map(|name| self.dir().join(name)).into(),
            selection: Some(self.selected(sequence)),
            mode: match mode {
                // A running simulation may have paused in the middle of a file
                ResumeMode::Resume if self.manifest.job.follow => ResumeMode::RequeueChanged,
                mode => mode,
            },
            takeover_after: self.manifest.job.takeover_after,
        })
    }

    /// The request that adds the frames `new` to an open job.
    pub(super) fn request_for(
        &self,
        sequence: &Sequence,
        new: &[i64],
    ) -> Result<JobRequest, RunError> {
        Ok(JobRequest {
            selection: Some(new.to_vec()),
            ..self.request(sequence, ResumeMode::Resume)?
        })
    }

    fn existing_plan(&self, mode: ResumeMode) -> Result<Option<Plan>, RunError> {
        Ok(match mode {
            ResumeMode::Force => None,
            _ => Job::read_plan(self.dir())?,
        })
    }

    /// The settings of the images. Those with the same effect as in the existing plan are written as in the plan.
    fn settings(&self, mode: ResumeMode) -> Result<Vec<(String, String)>, RunError> {
        let reference = self.reference.map(|number| (REFERENCE.to_owned(), number.to_string()));
        let mut settings = self.manifest.settings();
        settings.extend(reference.clone());
        let identities = self.files.identities(&self.manifest)?;
        identify(&mut settings, &identities);
        let Some(planned) = self.existing_plan(mode)? else {
            return Ok(settings);
        };
        let has_rgb = planned.resolved().get("rgb").is_some_and(Value::is_object);
        let mut as_planned = self.manifest.settings_as_planned(planned.settings(), has_rgb);
        as_planned.extend(reference);
        identify(&mut as_planned, &identities);
        // Settings that are resolved again must be the new ones
        let resolves_again =
            mode == ResumeMode::KeepDone && !planned.changes_to(&as_planned).is_empty();
        Ok(if resolves_again { settings } else { as_planned })
    }

    /// The files of the meshes that only `frame` has.
    fn mesh_files(&self, frame: i64) -> Vec<PathBuf> {
        self.files.frame_meshes(&self.manifest, frame)
    }

    /// The meshes that those of the frame with `index` move to, with motion blur.
    fn next_meshes(&self, sequence: &Sequence, index: usize) -> Option<NextMeshes> {
        if self.manifest.camera.shutter == 0.0 {
            return None;
        }
        let frames = sequence.frames();
        let (other, steps) = match frames.get(index + 1) {
            Some(next) => (next, 1),
            None => (frames.get(index.checked_sub(1)?)?, -1),
        };
        Some(NextMeshes { files: self.mesh_files(other.number), steps })
    }

    /// The frames of the job: all of the sequence, or the selected one if the output has no number.
    fn frames_of_job(&self, mut all: Vec<FrameRequest>) -> Vec<FrameRequest> {
        let range = self.manifest.input.frames.as_ref();
        if let Some(range) = range.filter(|_| !self.manifest.output.path.has_number()) {
            all.retain(|frame| range.contains(frame.number));
        }
        all
    }

    /// Whether opening the job in this mode surveys the sequence, which reads some of its frames.
    ///
    /// # Errors
    /// The plan of the existing job cannot be read.
    pub fn needs_survey(&self, mode: ResumeMode) -> Result<bool, RunError> {
        let Some(planned) = self.existing_plan(mode)? else {
            return Ok(true);
        };
        let changes = || Ok::<_, RunError>(planned.changes_to(&self.settings(mode)?));
        Ok(mode == ResumeMode::KeepDone && !changes()?.is_empty())
    }

    /// Opens the job. Surveys the sequence if that is necessary, and chooses the device of a new job. Returns a note if that
    /// is not a GPU.
    pub(super) fn open(
        &mut self,
        sequence: &Sequence,
        mode: ResumeMode,
    ) -> Result<(Job, Option<String>), RunError> {
        // Start a new job, or discard an old one, only if its images are possible
        let (surveyed, why_cpu) = match self.existing_plan(mode)? {
            None => {
                let (survey, setup) = self.survey_for_start(sequence)?;
                (Some(serde_json::to_value(&survey)?), setup.run.why_cpu)
            }
            Some(_) => (None, None),
        };
        let request = self.request(sequence, mode)?;
        let resolve = |_: Option<&Value>| match surveyed {
            Some(survey) => Ok(survey),
            None => Ok::<_, RunError>(serde_json::to_value(self.survey(sequence)?.0)?),
        };
        let job = Job::open(self.dir(), request, resolve)?;
        Ok((job, why_cpu.as_deref().map(cpu_note)))
    }

    fn survey_for_start(&mut self, sequence: &Sequence) -> Result<(Survey, Setup), RunError> {
        let (survey, setup) = self.survey(sequence)?;
        // All workers of the job use the same device
        if setup.picture.renderer == RendererKind::Gpu {
            self.manifest.render.device = DeviceSetting::Gpu;
        }
        let mut tasks = self.tasks(sequence, &self.selected(sequence));
        self.schedule(sequence, &setup, &mut tasks);
        require_one_fits(&tasks)?;
        Ok((survey, setup))
    }

    /// Surveys the sequence, and resolves the automatic settings with it. An automatic device is a GPU if one suits.
    ///
    /// # Errors
    /// No frame can be read, or the settings and the particles do not go together.
    pub fn survey(&self, sequence: &Sequence) -> Result<(Survey, Setup), RunError> {
        self.survey_with(sequence, &mut Findings::default())
    }

    /// [`Self::survey`] with what was found of the sequence before, and what is found now.
    ///
    /// # Errors
    /// Same as [`Self::survey`].
    pub fn survey_with(
        &self,
        sequence: &Sequence,
        findings: &mut Findings,
    ) -> Result<(Survey, Setup), RunError> {
        let inquiry = Inquiry::of(&self.manifest);
        let styles = inquiry.styles();
        let question =
            Question { framed: self.framed(sequence), ..inquiry.question(styles.as_ref()) };
        let survey = findings.survey(sequence, question)?;
        let mut setup = self.setup(&survey, sequence)?;
        if self.manifest.render.device == DeviceSetting::Auto {
            match gpu::suits(&setup, sequence, survey.most_particles as u64) {
                Ok(()) => setup.picture.renderer = RendererKind::Gpu,
                Err(why) => setup.run.why_cpu = why,
            }
        }
        Ok((survey, setup))
    }

    /// Index of the only frame whose particles the camera shows, if there is one.
    fn framed(&self, sequence: &Sequence) -> Option<usize> {
        if self.manifest.camera.fit != Some(FitSetting::This) {
            return None;
        }
        let first = *self.selected(sequence).first()?;
        sequence.frames().iter().position(|frame| frame.number == first)
    }

    fn setup(&self, survey: &Survey, sequence: &Sequence) -> Result<Setup, RunError> {
        let frames = sequence.frames().iter().map(|frame| frame.number);
        self.files.setup(&self.manifest, survey, frames)
    }

    /// Notes for the user on the image of the environment, and on meshes that have been read for a setup.
    ///
    /// # Errors
    /// The image cannot be read.
    pub fn scene_notes(&self) -> Result<Vec<String>, RunError> {
        self.files.notes(&self.manifest)
    }

    /// The setup with the survey that is stored in the plan.
    ///
    /// # Errors
    /// The plan has no valid survey, or the settings and the particles do not go together.
    pub fn stored_setup(
        &self,
        resolved: &Value,
        sequence: &Sequence,
    ) -> Result<(Survey, Setup), RunError> {
        let survey = stored_survey(resolved, self.dir())?;
        let setup = self.setup(&survey, sequence)?;
        Ok((survey, setup))
    }

    /// The images of `frames`.
    pub fn tasks(&self, sequence: &Sequence, frames: &[i64]) -> Vec<ImageTask> {
        indices(sequence, frames)
            .map(|(frame, index)| ImageTask {
                frame,
                index,
                image: self.image(frame),
                preview: self.preview(frame),
                meshes: self.mesh_files(frame),
                next_meshes: self.next_meshes(sequence, index),
                refused: None,
            })
            .collect()
    }

    /// Decides whether frames overlap in memory. Tasks that exceed the limit are marked as refused.
    pub fn schedule(
        &self,
        sequence: &Sequence,
        setup: &Setup,
        tasks: &mut [ImageTask],
    ) -> Schedule {
        let sizes: Vec<FrameSize> =
            tasks.iter().map(|task| FrameSize::of_task(sequence, task, setup)).collect();
        let limit = self.manifest.render.memory_limit;
        let mut schedule = MemoryModel::new(setup).schedule(&sizes, limit, available());
        for (index, error) in schedule.too_large.drain(..) {
            tasks[index].refused = Some(error);
        }
        schedule
    }
}

/// A note for the user on why a job is rendered on the CPU.
pub fn cpu_note(why: &str) -> String {
    format!("rendered on the CPU: {why}")
}

/// Refuses a run in which no frame fits into memory.
///
/// # Errors
/// [`RunError::NothingFits`].
pub fn require_one_fits(tasks: &[ImageTask]) -> Result<(), RunError> {
    let refused = tasks.iter().map(|t| Some((t.frame, t.refused.as_ref()?)));
    match refused.collect::<Option<Vec<_>>>().as_deref() {
        Some([(frame, error), ..]) => {
            Err(RunError::NothingFits { frame: *frame, source: (*error).clone() })
        }
        _ => Ok(()),
    }
}

/// Replaces the values of keys in `settings` by their `identities`.
fn identify(settings: &mut [(String, String)], identities: &[(String, String)]) {
    for (key, identity) in identities {
        if let Some((_, value)) = settings.iter_mut().find(|(name, _)| name == key) {
            value.clone_from(identity);
        }
    }
}
