//! A job as it is asked for, before anything is written: what `render` and `check` share.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;
use spherule_formats::Sequence;
use spherule_jobs::{Fingerprint, FrameRequest, Job, JobRequest, Mode, publish, read_regular_text};

use super::CliError;
use super::job::{Asked, ManifestArgs, apart};
use super::paths::absolute;
use super::schema::{is_schema, schema_text};
use super::shard::Shard;
use super::work::{
    WorkArgs, chosen, guard_directory, guard_kind, requests, saved_survey, selection,
};
use crate::accel::Structure;
use crate::hdr::read_radiance_map;
use crate::manifest::{
    Manifest, OutputPattern, SCHEMA_FILE, is_marked, marked, named_place, read_manifest, real_dir,
};
use crate::metrics::Bytes;
use crate::metrics::memory::available;
use crate::pipeline::{FrameSize, ImageTask, MemoryModel, RadiusRule, Schedule, Setup};
use crate::report::job::{HTML_FILE, JSON_FILE};
use crate::resolve::{self, check_views, needs_environment_image, question};
use crate::scene::RadianceMap;
use crate::surface::SurfaceKind;
use crate::survey::Survey;

/// The manifest that is written beside the images.
const JOB_FILE: &str = "job.toml";

/// What `render` and `check` are told alike.
#[derive(Debug, Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    pub(super) manifest: ManifestArgs,
    #[command(flatten)]
    pub(super) work: WorkArgs,
}

/// A job before anything is written.
pub(super) struct Plan {
    /// Where the images go: everything of the job lies there. Absolute.
    pub(super) dir: PathBuf,
    /// With paths relative to `dir`.
    pub(super) manifest: Manifest,
    /// The manifest's own file, absolute.
    file: Option<PathBuf>,
    /// What that file says, seen from `dir` too; None if it cannot stand alone.
    unchanged: Option<Manifest>,
    /// The images as the user named them.
    pub(super) shown_output: PathBuf,
    /// The part of the frames that this run is to do.
    shard: Option<Shard>,
}

impl Plan {
    pub(super) fn new(
        asked: Asked,
        sequence: &Sequence,
        shard: Option<Shard>,
    ) -> Result<Self, CliError> {
        let base = asked.absolute_base()?;
        let mut manifest = asked.manifest;
        let range = manifest.input.frames.as_ref();
        let chosen = chosen(sequence, range, "input.frames")?;
        manifest.check_frame_count(chosen.len())?;
        let shown_output = PathBuf::from(manifest.output.path.as_str());
        let dir = real_dir(&base.join(manifest.output.path.dir()));
        move_into(&mut manifest, &base, &dir)?;
        let mut unchanged = asked.unchanged;
        if let Some(manifest) = &mut unchanged {
            move_into(manifest, &base, &dir)?;
        }
        let file = asked
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

    /// Whether the manifest that was given is the one that would be written.
    fn is_own_manifest(&self) -> bool {
        self.file.as_deref() == Some(&self.job_file())
    }

    /// The frames asked for, done or not.
    pub(super) fn selected(&self, sequence: &Sequence) -> Vec<i64> {
        selection(sequence, self.manifest.input.frames.as_ref(), self.shard)
    }

    /// Refuses a directory that cannot be, or that has a job of another kind.
    pub(super) fn guard_directory(&self, mode: Mode) -> Result<(), CliError> {
        guard_directory(&self.dir, "images")?;
        guard_kind(&self.dir, None, mode)
    }

    /// Refuses to begin a job beside a `job.toml` that a user wrote for something else: no option makes
    /// that file's place free.
    pub(super) fn guard_manifest(&self) -> Result<(), CliError> {
        let path = self.job_file();
        let is_free = || !path.exists() || read_manifest(&path).is_ok_and(|text| is_marked(&text));
        if self.is_own_manifest() || is_free() || Job::has_begun(&self.dir)? {
            return Ok(());
        }
        Err(CliError::other(format!(
            "{}: is in the way of this job's own manifest; render that file, choose another \
             output directory, or move it away",
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

    /// What is asked of the job.
    ///
    /// # Errors
    /// The plan of the job that is there cannot be read.
    pub(super) fn request(&self, sequence: &Sequence, mode: Mode) -> Result<JobRequest, CliError> {
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
                // A simulation that still runs may have paused in the middle of a file.
                Mode::Resume if self.manifest.job.follow => Mode::RequeueChanged,
                mode => mode,
            },
            patience: self.manifest.job.takeover_after,
        })
    }

    /// What the images depend on, in the words of the job that is gone on with, where that makes no difference.
    fn settings(&self, mode: Mode) -> Result<Vec<(String, String)>, CliError> {
        let mut settings = self.manifest.settings();
        self.identify_environment(&mut settings)?;
        let planned = match mode {
            Mode::Force => None,
            _ => Job::peek(&self.dir)?,
        };
        let Some(planned) = planned else {
            return Ok(settings);
        };
        let has_rgb = planned.resolved().get("rgb").is_some_and(Value::is_object);
        let mut as_planned = self
            .manifest
            .settings_as_planned(planned.settings(), has_rgb);
        self.identify_environment(&mut as_planned)?;
        // What is settled anew is settled by what is asked for now.
        let is_settled_anew = mode == Mode::KeepDone && !planned.changes_to(&as_planned).is_empty();
        Ok(match is_settled_anew {
            true => settings,
            false => as_planned,
        })
    }

    /// Replaces the path of the image of the environment in `settings` by its fingerprint: the image may be moved.
    fn identify_environment(&self, settings: &mut [(String, String)]) -> Result<(), CliError> {
        let path = self.environment_path();
        let setting = settings
            .iter_mut()
            .find(|(key, _)| key == "environment.image");
        if let (Some(path), Some((_, value))) = (path, setting) {
            let found = Fingerprint::of_file(&path);
            let found = found.map_err(|e| {
                CliError::Other(format!("environment.image: {}: {e}", path.display()))
            })?;
            *value = format!("blake3 {}", found.blake3);
        }
        Ok(())
    }

    /// The frames that the job has: all of the sequence, or the one that is asked for if there is but one name.
    fn frames_of_job(&self, mut all: Vec<FrameRequest>) -> Vec<FrameRequest> {
        let range = self.manifest.input.frames.as_ref();
        if let Some(range) = range.filter(|_| !self.manifest.output.path.has_number()) {
            all.retain(|frame| range.contains(frame.number));
        }
        all
    }

    /// What is asked of a job that goes on with the frames `new`.
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
            ..self.request(sequence, Mode::Resume)?
        })
    }

    pub(super) fn open(&self, sequence: &Sequence, mode: Mode) -> Result<Job, CliError> {
        let request = self.request(sequence, mode)?;
        // A new job is begun, and an old one forgotten, only for pictures that can be.
        let surveyed = if mode == Mode::Force || Job::peek(&self.dir)?.is_none() {
            Some(self.survey_to_begin(sequence)?)
        } else {
            None
        };
        Ok(Job::open(&self.dir, request, |_| {
            surveyed.map_or_else(|| to_value(&self.survey(sequence)?.0), Ok)
        })?)
    }

    fn survey_to_begin(&self, sequence: &Sequence) -> Result<Value, CliError> {
        let (survey, setup) = self.survey(sequence)?;
        let mut tasks = self.tasks(sequence, &self.selected(sequence));
        self.fit(sequence, &setup, &mut tasks);
        one_fits(&tasks)?;
        to_value(&survey)
    }

    /// Looks at the sequence: what "auto" means, and the pictures that come of it.
    pub(super) fn survey(&self, sequence: &Sequence) -> Result<(Survey, Setup), CliError> {
        say!("looking at the sequence");
        let survey = apart(|| Survey::of(sequence, question(&self.manifest)))?;
        let setup = self.setup(&survey, sequence)?;
        Ok((survey, setup))
    }

    /// The pictures, if there is one from everywhere the camera goes.
    fn setup(&self, survey: &Survey, sequence: &Sequence) -> Result<Setup, CliError> {
        let frames = sequence.frames().iter().map(|frame| frame.number);
        let map = self.environment_image()?;
        let setup = resolve::setup(&self.manifest, survey, map.as_ref());
        let setup = setup.and_then(|setup| check_views(&setup, frames).map(|()| setup));
        setup.map_err(|e| CliError::Other(e.to_string()))
    }

    /// The path of the image of the environment, if there is one.
    fn environment_path(&self) -> Option<PathBuf> {
        let path = self.manifest.environment.image.as_ref()?;
        needs_environment_image(&self.manifest).then(|| self.dir.join(path))
    }

    fn environment_image(&self) -> Result<Option<RadianceMap>, CliError> {
        let Some(path) = self.environment_path() else {
            return Ok(None);
        };
        let map = read_radiance_map(&path)
            .map_err(|e| CliError::Other(format!("environment.image: {e}")))?;
        if map.negative() > 0 {
            note!(
                "{}: {} pixels are negative, which counts as 0",
                path.display(),
                map.negative()
            );
        }
        Ok(Some(map))
    }

    /// The pictures, by what was found when the job began.
    pub(super) fn settle(
        &self,
        resolved: &Value,
        sequence: &Sequence,
    ) -> Result<(Survey, Setup), CliError> {
        let survey = saved_survey(resolved, &self.dir)?;
        let setup = self.setup(&survey, sequence)?;
        Ok((survey, setup))
    }

    /// How `tasks` go through memory. Those that do not fit into the limit are marked so.
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
        let model = MemoryModel::new(setup);
        let schedule = model.schedule(&sizes, limit.map(|l| l.0), available());
        if let Some(limit) = limit {
            for (place, need) in &schedule.too_large {
                tasks[*place].refused = Some(format!(
                    "it needs about {} ({need}){}, render.memory_limit is {limit}: {}",
                    Bytes(need.total()),
                    surface_text(setup),
                    remedy(setup, &sizes[*place], limit)
                ));
            }
        }
        schedule
    }

    /// Writes the manifest beside the images, unless it is what was given or stands there already.
    /// If it is what was given, options become part of it where the job was `settled_anew` by them. A file
    /// that a user wrote or edited stays as it is.
    pub(super) fn write_manifest(&self, settled_anew: bool) -> Result<(), CliError> {
        let path = self.job_file();
        let mut manifest = self.manifest.clone();
        if let Some(unchanged) = &self.unchanged {
            // Which frames one of many workers does now, and how, is no property of the job.
            manifest.input.frames = unchanged.input.frames.clone();
            manifest.job = unchanged.job.clone();
            manifest.render.memory_limit = unchanged.render.memory_limit;
        }
        if self.is_own_manifest() && (!settled_anew || self.unchanged.as_ref() == Some(&manifest)) {
            return Ok(());
        }
        if path.exists() {
            let text = read_manifest(&path).unwrap_or_default();
            if !is_marked(&text) {
                if Manifest::parse(&text, &path).ok().as_ref() != Some(&manifest) {
                    note!(
                        "{}: not written by spherule, or edited since, so it stays as it is; this job was made \
                         with other settings than it has: give the same options again, or put them into it",
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

    /// The manifest's first line refers to the schema, which is of use to editors alone.
    fn write_schema(&self) {
        let path = self.dir.join(SCHEMA_FILE);
        if path.exists() && !is_schema(&path) {
            return;
        }
        if let Err(error) = write_if_changed(&path, &schema_text()) {
            note!("{error}; editors do without it");
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

/// Refuses work of which nothing can be done.
pub(super) fn one_fits(tasks: &[ImageTask]) -> Result<(), CliError> {
    let refused = tasks.iter().map(|t| Some((t.frame, t.refused.as_ref()?)));
    match refused.collect::<Option<Vec<_>>>().as_deref() {
        Some([(frame, reason), ..]) => Err(CliError::other(format!(
            "no frame fits into memory: frame {frame}: {reason}"
        ))),
        _ => Ok(()),
    }
}

/// What the grid of a smooth surface depends on, the usual reason for its size being a wrong radius.
fn surface_text(setup: &Setup) -> String {
    if setup.picture.surface.kind != SurfaceKind::Smooth {
        return String::new();
    }
    let voxel = setup.picture.surface.voxel;
    match setup.picture.radius {
        RadiusRule::Common(radius) | RadiusRule::FileOr(radius) if radius > 0.0 => format!(
            " for a smooth surface of particles of radius {radius} in voxels of {}",
            voxel * radius
        ),
        _ => format!(
            " for a smooth surface of particles of their own radius in voxels of {voxel} of it"
        ),
    }
}

/// What to do about a frame that needs more than `limit`.
fn remedy(setup: &Setup, frame: &FrameSize, limit: Bytes) -> String {
    let mut ways = Vec::new();
    let others = Structure::ALL.into_iter().filter(|structure| {
        let mut setup = setup.clone();
        setup.run.accelerator = Some(*structure);
        MemoryModel::new(&setup).alone(frame).total() <= limit.0
    });
    ways.extend(others.map(|other| format!("choose --accelerator {other}")));
    let alone = MemoryModel::new(setup).alone(frame);
    let empty = MemoryModel::new(setup).alone(&FrameSize::default());
    if 4 * (empty.images + empty.encoding) > limit.0 {
        ways.push("make the image smaller or ask for fewer channels".to_owned());
    }
    if setup.picture.surface.kind == SurfaceKind::Smooth && 4 * alone.surface > limit.0 {
        ways.push("give larger voxels (surface.voxel)".to_owned());
    }
    ways.push("raise the limit".to_owned());
    ways.join(", or ")
}

/// Makes paths relative to `dir`, where the images of `manifest` are to be.
fn move_into(manifest: &mut Manifest, base: &Path, dir: &Path) -> Result<(), CliError> {
    manifest.rebase(base, dir).map_err(CliError::Other)?;
    // However the directory was named: it may be moved with its manifest.
    if real_dir(&dir.join(manifest.output.path.dir())) == dir {
        manifest.output.path =
            OutputPattern::parse(manifest.output.path.file_name()).map_err(CliError::Other)?;
    }
    Ok(())
}
