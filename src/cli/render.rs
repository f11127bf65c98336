//! `spherule render`: a sequence, or the job of a manifest, to images.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;
use spherule_formats::Sequence;
use spherule_jobs::{DEFAULT_WORKER, FrameRequest, Job, JobRequest, Mode, publish};

use super::job::{Asked, ManifestArgs, absolute};
use super::progress::{Progress, ProgressMode, duration};
use super::{CliError, Outcome, signals};
use crate::manifest::{Manifest, OutputPattern, named_place, real_dir};
use crate::pipeline::{self, ImageTask, Setup};
use crate::report;
use crate::resolve::{self, question};
use crate::survey::Survey;

/// The manifest that is written beside the images.
const JOB_FILE: &str = "job.toml";

#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    manifest: ManifestArgs,
    /// Start over, whatever was rendered here before.
    #[arg(long)]
    force: bool,
    /// Keep finished images although settings or inputs have changed.
    #[arg(long, conflicts_with = "force")]
    keep_done: bool,
    /// Threads to use; default: all.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// How progress is shown.
    #[arg(long, value_enum, default_value = "auto")]
    progress: ProgressMode,
}

const WORDS: signals::Words = signals::Words {
    asked: "stopping after the frame in hand; once more stops at once",
    at_once: "stopped; the same command goes on from here",
};

pub(super) fn run(args: &RenderArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(WORDS)?;
    if let Some(threads) = args.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .map_err(|e| CliError::other(format!("--threads {threads}: {e}")))?;
    }
    let asked = args.manifest.manifest()?;
    let sequence = asked.sequence()?;
    for note in sequence.notes() {
        say!("note: {note}");
    }
    let plan = Plan::new(asked, &sequence)?;
    plan.guard_directory()?;
    plan.guard_manifest(args.force)?;
    let mut job = plan.open(&sequence, args)?;
    let (survey, setup) = plan.settle(&job)?;
    plan.write_manifest(args.force || args.keep_done)?;
    tell(&sequence, &survey, &setup);
    let tasks = plan.tasks(&sequence, &job.pending());
    let kept = job.selected().len() - tasks.len();
    if kept > 0 {
        say!("{kept} of {} frames are done already", job.selected().len());
    }
    let progress = Progress::new(args.progress, tasks.len());
    let start = std::time::Instant::now();
    let interrupt = signals.at_work();
    let result = pipeline::run(&setup, &sequence, &tasks, &mut job, interrupt, &|event| {
        progress.show(&event);
    });
    let ended = progress.finish();
    let report = report::job::JobReport::new(job.state(), &plan.manifest);
    let reported = report.files().iter().try_for_each(|(name, text)| {
        report::job::write(&plan.dir, name, text).map_err(CliError::io(&plan.dir.join(name)))
    });
    // What ended the run explains why there is no report either.
    let result = result.map_err(CliError::from).and(reported);
    let summary = job.summary();
    say!(
        "{} of {} frames done in {}: {}",
        summary.done,
        summary.total,
        duration(start.elapsed().as_secs_f64()),
        plan.shown_output.display()
    );
    // Frames that failed earlier and were not tried again are still to be done.
    if !ended.failed.is_empty() {
        say!("failed: {}", list(&ended.failed));
    }
    match result {
        Err(error) => {
            say!("error: {error}");
            Ok(Outcome::SomeFailed)
        }
        Ok(()) if interrupt.is_raised() && ended.count < tasks.len() => Ok(Outcome::Interrupted),
        Ok(()) if summary.done < summary.total => Ok(Outcome::SomeFailed),
        Ok(()) => Ok(Outcome::Done),
    }
}

/// Frame numbers as a range.
fn list(frames: &[i64]) -> String {
    spherule_jobs::FrameRange::from_frames(frames.iter().copied())
        .map_or_else(String::new, |r| r.to_string())
}

/// A job before anything is written.
struct Plan {
    /// Where the images go: everything of the job lies there. Absolute.
    dir: PathBuf,
    /// With paths relative to `dir`.
    manifest: Manifest,
    /// The manifest's own file, absolute.
    file: Option<PathBuf>,
    /// What that file says, seen from `dir` too; None if it cannot stand alone.
    unchanged: Option<Manifest>,
    /// The images as the user named them.
    shown_output: PathBuf,
}

impl Plan {
    fn new(asked: Asked, sequence: &Sequence) -> Result<Self, CliError> {
        let base = asked.absolute_base()?;
        let mut manifest = asked.manifest;
        let chosen = match &manifest.input.frames {
            None => sequence.frames().len(),
            Some(range) => {
                let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
                let chosen = range.select(&numbers).len();
                if chosen == 0 {
                    return Err(CliError::other(format!(
                        "input.frames: {range} has none of the frames that there are: {}",
                        list(&numbers)
                    )));
                }
                chosen
            }
        };
        manifest.check_frame_count(chosen)?;
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
        })
    }

    fn job_file(&self) -> PathBuf {
        self.dir.join(JOB_FILE)
    }

    /// Whether the manifest that was given is the one that would be written.
    fn is_own_manifest(&self) -> bool {
        self.file.as_deref() == Some(&self.job_file())
    }

    /// Refuses a directory that cannot be because a file is in its place.
    fn guard_directory(&self) -> Result<(), CliError> {
        match self.dir.ancestors().find(|p| p.exists()) {
            Some(found) if !found.is_dir() => Err(CliError::other(format!(
                "{}: is a file where a directory for the images should be; choose another output",
                found.display()
            ))),
            _ => Ok(()),
        }
    }

    /// Refuses to overwrite a `job.toml` that belongs to no job of ours.
    fn guard_manifest(&self, force: bool) -> Result<(), CliError> {
        let path = self.job_file();
        if force || self.is_own_manifest() || !path.exists() || Job::has_begun(&self.dir)? {
            return Ok(());
        }
        Err(CliError::other(format!(
            "{}: is in the way of this job's own manifest; render that file, choose another \
             output directory, or overwrite it with --force",
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

    fn open(&self, sequence: &Sequence, args: &RenderArgs) -> Result<Job, CliError> {
        let frames = sequence
            .frames()
            .iter()
            .enumerate()
            .map(|(index, frame)| FrameRequest {
                number: frame.number,
                inputs: sequence
                    .inputs(index)
                    .into_iter()
                    .map(Path::to_owned)
                    .collect(),
                outputs: std::iter::once(self.image(frame.number))
                    .chain(self.preview(frame.number))
                    .collect(),
            })
            .collect();
        let request = JobRequest {
            worker: DEFAULT_WORKER.to_owned(),
            settings: self.manifest.settings(),
            frames,
            selection: self.manifest.input.frames.clone(),
            mode: match (args.force, args.keep_done) {
                (true, _) => Mode::Force,
                (_, true) => Mode::KeepDone,
                _ => Mode::Resume,
            },
        };
        // A new job is begun, and an old one forgotten, only for pictures that can be.
        let surveyed = if args.force || Job::peek(&self.dir)?.is_none() {
            Some(self.survey(sequence)?)
        } else {
            None
        };
        Ok(Job::open(&self.dir, request, |_| {
            surveyed.map_or_else(|| self.survey(sequence), Ok)
        })?)
    }

    fn survey(&self, sequence: &Sequence) -> Result<Value, CliError> {
        say!("looking at the sequence");
        let survey = Survey::of(sequence, question(&self.manifest))?;
        resolve::setup(&self.manifest, &survey).map_err(|e| CliError::Other(e.to_string()))?;
        serde_json::to_value(survey).map_err(|e| CliError::Other(e.to_string()))
    }

    /// The pictures, by what was found when the job began.
    fn settle(&self, job: &Job) -> Result<(Survey, Setup), CliError> {
        let survey: Survey = serde_json::from_value(job.resolved().clone()).map_err(|e| {
            CliError::other(format!(
                "{}: its resolved values cannot be read ({e}); start over with --force",
                self.dir.join(spherule_jobs::PLAN_FILE).display()
            ))
        })?;
        let setup =
            resolve::setup(&self.manifest, &survey).map_err(|e| CliError::Other(e.to_string()))?;
        Ok((survey, setup))
    }

    /// Writes the manifest beside the images, unless it is what was given or stands there already.
    /// If it is what was given, options become part of it where the job was `settled_anew` by them.
    fn write_manifest(&self, settled_anew: bool) -> Result<(), CliError> {
        let path = self.job_file();
        let mut manifest = self.manifest.clone();
        if self.is_own_manifest() {
            // Which frames to do now is no property of the job.
            manifest.input.frames = self.unchanged.as_ref().and_then(|m| m.input.frames.clone());
            if !settled_anew || self.unchanged.as_ref() == Some(&manifest) {
                return Ok(());
            }
        }
        let text = manifest.to_commented_toml();
        if fs::read_to_string(&path).is_ok_and(|old| old == text) {
            return Ok(());
        }
        publish(&path, text.as_bytes()).map_err(CliError::io(&path))
    }

    fn tasks(&self, sequence: &Sequence, pending: &[i64]) -> Vec<ImageTask> {
        let frames = sequence.frames();
        let task = |number: &i64| {
            let index = frames.binary_search_by_key(number, |f| f.number).ok()?;
            Some(ImageTask {
                frame: *number,
                index,
                image: self.image(*number),
                preview: self.preview(*number),
            })
        };
        pending.iter().filter_map(task).collect()
    }
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

/// What was decided for the user, so that nothing is a surprise.
fn tell(sequence: &Sequence, survey: &Survey, setup: &Setup) {
    say!(
        "{}, up to {}",
        counted(sequence.frames().len(), "frame"),
        counted(survey.most_particles, "particle")
    );
    if survey.most_particles == 0 {
        return;
    }
    match &setup.radius {
        pipeline::RadiusRule::Common(radius) => say!("radius {radius}"),
        pipeline::RadiusRule::FileOr(_) if survey.has_radii => say!("radius from the files"),
        pipeline::RadiusRule::FileOr(radius) => {
            let radius = short(f64::from(*radius));
            say!("radius {radius}, half the usual distance of neighbours (--radius sets it)");
        }
        pipeline::RadiusRule::Attribute { name, scale } => {
            say!("radius {scale} x attribute `{name}`");
        }
    }
    if let pipeline::ColorRule::Attribute { name, .. } = &setup.color
        && let Some(color) = &survey.color
    {
        say!(
            "colour by `{name}`, seen from {} to {}",
            short(color.low),
            short(color.high)
        );
    }
    if survey.origin != glam::DVec3::ZERO {
        say!("origin {}: the particles are far from zero", survey.origin);
    }
}

/// Four digits, as a person reads a number.
fn short(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

fn counted(count: usize, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}
