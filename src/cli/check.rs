//! `spherule check`: prints what `render` would do with the same arguments. Writes no files.

use std::time::{Duration, Instant};

use clap::Args;
use spherule_files::Bytes;
use spherule_files::memory::available;
use spherule_formats::Sequence;
use spherule_jobs::{DryRun, FrameState, Job, ResumeMode};

use super::job::use_threads;
use super::manifest_args::{complete, open_sequence};
use super::render::RunArgs;
use super::{CliError, Outcome, disk, print};
use crate::job::{RenderJob, require_one_fits};
use crate::pipeline::{FrameSize, ImageTask, Probe, Schedule, Setup, probe};
use crate::survey::Survey;

mod camera;
mod show;

const EXAMPLES: &str = "\
Examples:
  spherule check run1 -o out/frame.####.exr
      Frames, memory, disk space and time of the same render
  spherule check run1 --memory-limit 2GiB
      The frames that fit into a memory limit
  spherule check out/job.toml --json
      The state of a job and its remaining work, for scripts";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    run: RunArgs,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &CheckArgs) -> Result<Outcome, CliError> {
    let mut requested = args.run.manifest.manifest()?;
    use_threads(requested.manifest.job.threads)?;
    let mut sequence = open_sequence(&requested)?;
    for note in sequence.notes() {
        note!("{note}");
    }
    let mode = args.run.job.mode();
    complete(&mut requested, &mut sequence, Some(mode))?;
    let mut render_job = RenderJob::new(requested, &sequence, args.run.job.shard)?;
    // The check reports a directory that cannot be used
    if render_job.check_output_dir(mode).is_ok() {
        render_job = render_job.resuming(mode)?;
    }
    let mut check = Check::new(&render_job, &sequence);
    check.run(&args.run);
    if args.json {
        print::pretty_json(&check.to_json())?;
    } else {
        print::lines(check.to_lines())?;
    }
    for problem in &check.problems {
        error!("{problem}");
    }
    Ok(if check.problems.is_empty() { Outcome::Done } else { Outcome::Refused })
}

/// The results of a check.
struct Check<'a> {
    render_job: &'a RenderJob,
    sequence: &'a Sequence,
    /// Reasons for which `render` would refuse to start.
    problems: Vec<String>,
    dry_run: Option<DryRun>,
    setup: Option<(Survey, Setup)>,
    tasks: Vec<ImageTask>,
    schedule: Option<Schedule>,
    /// The render will need the same time for its survey.
    survey_time: Duration,
    probe: Option<Probe>,
    free_memory: Option<u64>,
    free_disk: Option<u64>,
}

impl<'a> Check<'a> {
    fn new(render_job: &'a RenderJob, sequence: &'a Sequence) -> Self {
        Self {
            render_job,
            sequence,
            problems: Vec::new(),
            dry_run: None,
            setup: None,
            tasks: Vec::new(),
            schedule: None,
            survey_time: Duration::ZERO,
            probe: None,
            free_memory: available(),
            free_disk: None,
        }
    }

    /// Returns the value, or adds the error to the problems.
    fn or_problem<T, E: Into<CliError>>(&mut self, result: Result<T, E>) -> Option<T> {
        result.map_err(|error| self.problems.extend(error.into().messages())).ok()
    }

    fn run(&mut self, args: &RunArgs) {
        // Find out what a run would do; a directory that cannot be used leaves no state to look at
        if self.check_output_dir(args.job.mode()) {
            let request = self.render_job.request(self.sequence, args.job.mode());
            let dry_run = request.and_then(|r| Ok(Job::dry_run(self.render_job.dir(), &r)?));
            self.dry_run = self.or_problem(dry_run);
            for change in self.dry_run.iter().flat_map(|d| &d.requeued) {
                note!("{change} since it was rendered; it would be rendered again");
            }
        }
        // Resolve the settings: those of the job, or new ones
        let start = Instant::now();
        let setup = match self.dry_run.as_ref().and_then(|d| d.resolved.as_ref()) {
            Some(resolved) => self.render_job.stored_setup(resolved, self.sequence),
            None => {
                message!("surveying the sequence");
                self.render_job.survey(self.sequence)
            }
        };
        self.setup = self.or_problem(setup);
        if self.setup.is_some() {
            let notes = self.or_problem(self.render_job.scene_notes());
            for note in notes.iter().flatten() {
                note!("{note}");
            }
        }
        self.survey_time = start.elapsed();
        // Schedule the frames that are left
        let frames = match &self.dry_run {
            Some(dry_run) => dry_run.pending(),
            None => self.render_job.selected(self.sequence),
        };
        let mut tasks = self.render_job.tasks(self.sequence, &frames);
        if let Some((_, setup)) = &self.setup {
            let schedule = self.render_job.schedule(self.sequence, setup, &mut tasks);
            let fits = require_one_fits(&tasks);
            self.tasks = tasks;
            self.check_memory(&schedule);
            self.schedule = Some(schedule);
            if self.or_problem(fits).is_some() {
                self.estimate_time();
            }
        }
    }

    /// Checks the output directory. Returns whether it is, or could be, a directory.
    fn check_output_dir(&mut self, mode: ResumeMode) -> bool {
        if self.or_problem(self.render_job.check_output_dir(mode)).is_none() {
            return false;
        }
        self.or_problem(self.render_job.check_manifest_file());
        let existing = disk::nearest_existing(self.render_job.dir());
        self.free_disk = disk::free(&existing);
        if let Err(error) = disk::check_writable(&existing) {
            self.problems.push(format!(
                "{}: cannot be written ({error}); check its permissions, or choose another directory",
                existing.display()
            ));
        }
        true
    }

    fn check_memory(&mut self, schedule: &Schedule) {
        let need = schedule.need.total();
        if let Some(free) = self.free_memory.filter(|free| need > *free) {
            self.problems.push(format!(
                "memory: {} are needed ({}), {} are free; make the image smaller, ask for fewer \
                 channels, or use another machine",
                Bytes(need),
                schedule.need,
                Bytes(free)
            ));
        }
    }

    /// Measures the pending frame with the most particles, and some others.
    fn estimate_time(&mut self) {
        let Some((_, setup)) = &self.setup else {
            return;
        };
        let Some(heaviest) = self.renderable().max_by_key(|task| self.size(setup, task).raw) else {
            return;
        };
        let others = self.spread_tasks(heaviest);
        match probe(setup, self.sequence, heaviest, &others) {
            Ok(probe) => self.probe = Some(probe),
            // Only that frame will fail
            Err(reason) => note!("frame {}: {reason}", heaviest.frame),
        }
        let needed = self.disk_bytes().unwrap_or(0.0);
        if let Some(free) = self.free_disk.filter(|free| needed > *free as f64) {
            self.problems.push(format!(
                "{}: the images need about {}, {} are free; choose another directory",
                self.render_job.shown_output().display(),
                Bytes(whole(needed)),
                Bytes(free)
            ));
        }
    }

    fn size(&self, setup: &Setup, task: &ImageTask) -> FrameSize {
        FrameSize::of_task(self.sequence, task, setup)
    }

    fn renderable(&self) -> impl Iterator<Item = &ImageTask> {
        self.tasks.iter().filter(|task| task.refused.is_none())
    }

    /// Up to four pending frames, spread evenly, without the `heaviest`.
    fn spread_tasks(&self, heaviest: &ImageTask) -> Vec<&ImageTask> {
        let all: Vec<&ImageTask> = self.renderable().collect();
        let mut spread: Vec<&ImageTask> = Vec::new();
        for eighth in [1, 5, 3, 7] {
            let task = all[all.len() * eighth / 8];
            if task.frame != heaviest.frame && spread.iter().all(|t| t.frame != task.frame) {
                spread.push(task);
            }
        }
        spread
    }

    fn disk_bytes(&self) -> Option<f64> {
        // The size is unknown if the image was not finished
        let probe = self.probe.filter(|probe| !probe.is_lower_bound)?;
        Some(probe.image_bytes * self.renderable().count() as f64)
    }

    fn seconds(&self) -> Option<f64> {
        let probe = self.probe?;
        let (_, setup) = self.setup.as_ref()?;
        let threads = rayon::current_num_threads();
        let overlap = self.schedule.as_ref()?.overlap;
        let sizes: Vec<FrameSize> = self.renderable().map(|task| self.size(setup, task)).collect();
        let probed = self.renderable().find(|task| task.frame == probe.frame)?;
        let frames = probe.seconds_for(&sizes, &self.size(setup, probed), overlap, threads);
        Some(self.survey_time.as_secs_f64() + frames)
    }

    /// Frames of the run in this state.
    fn in_state(&self, state: FrameState) -> Vec<i64> {
        let Some(dry_run) = &self.dry_run else {
            return Vec::new();
        };
        let all = dry_run.selected.iter().copied();
        all.filter(|frame| dry_run.state.frame_state(*frame) == Some(state)).collect()
    }

    fn too_large(&self) -> Vec<i64> {
        let refused = self.tasks.iter().filter(|task| task.refused.is_some());
        refused.map(|task| task.frame).collect()
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "an estimate of a size; saturates"
)]
const fn whole(bytes: f64) -> u64 {
    bytes as u64
}
