//! `spherule check`: what `render` would do with the same arguments. Writes nothing but its answer.

use std::time::{Duration, Instant};

use clap::Args;
use spherule_formats::Sequence;
use spherule_jobs::{Foreseen, FrameState, Job, Mode};

use super::plan::{Plan, RunArgs, one_fits};
use super::work::use_threads;
use super::{CliError, Outcome, disk, print};
use crate::metrics::Bytes;
use crate::metrics::memory::available;
use crate::pipeline::{FrameSize, ImageTask, Probe, Schedule, Setup, probe};
use crate::survey::Survey;

mod camera;
mod show;

const EXAMPLES: &str = "\
Examples:
  spherule check run1 -o out/frame.####.exr
      What the same render would do, need and take
  spherule check run1 --memory-limit 2GiB
      Which frames fit into a limit
  spherule check out/job.toml --json
      How a job stands and what is left of it, for scripts";

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
    let asked = args.run.manifest.manifest()?;
    use_threads(asked.manifest.job.threads)?;
    let sequence = asked.sequence()?;
    for note in sequence.notes() {
        note!("{note}");
    }
    let plan = Plan::new(asked, &sequence, args.run.work.shard)?;
    let mut check = Check::new(&plan, &sequence);
    check.look(&args.run);
    if args.json {
        print::pretty_json(&check.to_json())?;
    } else {
        print::lines(check.to_lines())?;
    }
    for problem in &check.problems {
        say!("error: {problem}");
    }
    Ok(if check.problems.is_empty() {
        Outcome::Done
    } else {
        Outcome::Refused
    })
}

/// What was found.
struct Check<'a> {
    plan: &'a Plan,
    sequence: &'a Sequence,
    /// What would make `render` refuse.
    problems: Vec<String>,
    foreseen: Option<Foreseen>,
    pictures: Option<(Survey, Setup)>,
    tasks: Vec<ImageTask>,
    schedule: Option<Schedule>,
    /// Looking at the sequence takes the same time when it is rendered.
    survey_time: Duration,
    probe: Option<Probe>,
    free_memory: Option<u64>,
    free_disk: Option<u64>,
}

impl<'a> Check<'a> {
    fn new(plan: &'a Plan, sequence: &'a Sequence) -> Self {
        Self {
            plan,
            sequence,
            problems: Vec::new(),
            foreseen: None,
            pictures: None,
            tasks: Vec::new(),
            schedule: None,
            survey_time: Duration::ZERO,
            probe: None,
            free_memory: available(),
            free_disk: None,
        }
    }

    /// Keeps what went well; what did not is a problem.
    fn noted<T>(&mut self, result: Result<T, CliError>) -> Option<T> {
        result
            .map_err(|error| self.problems.extend(error.messages()))
            .ok()
    }

    fn look(&mut self, args: &RunArgs) {
        if self.look_at_place(args.work.mode()) {
            let request = self.plan.request(self.sequence, args.work.mode());
            let foreseen = request.and_then(|r| Ok(Job::foresee(&self.plan.dir, &r)?));
            self.foreseen = self.noted(foreseen);
            for change in self.foreseen.iter().flat_map(|f| &f.requeued) {
                note!("{change} since it was rendered; it would be rendered again");
            }
        }
        let start = Instant::now();
        let pictures = match self.foreseen.as_ref().and_then(|f| f.resolved.as_ref()) {
            Some(resolved) => self.plan.settle(resolved, self.sequence),
            None => self.plan.survey(self.sequence),
        };
        self.pictures = self.noted(pictures);
        self.survey_time = start.elapsed();
        let frames = match &self.foreseen {
            Some(foreseen) => foreseen.pending(),
            None => self.plan.selected(self.sequence),
        };
        let mut tasks = self.plan.tasks(self.sequence, &frames);
        if let Some((_, setup)) = &self.pictures {
            let schedule = self.plan.fit(self.sequence, setup, &mut tasks);
            let fits = one_fits(&tasks);
            self.tasks = tasks;
            self.look_at_room(&schedule);
            self.schedule = Some(schedule);
            if self.noted(fits).is_some() {
                self.look_at_time();
            }
        }
    }

    /// Looks at where the images go; whether that is, or could be, a directory.
    fn look_at_place(&mut self, mode: Mode) -> bool {
        if self.noted(self.plan.guard_directory(mode)).is_none() {
            return false;
        }
        self.noted(self.plan.guard_manifest());
        let there = disk::existing(&self.plan.dir);
        self.free_disk = disk::free(&there);
        if let Err(error) = disk::writable(&there) {
            self.problems.push(format!(
                "{}: cannot be written ({error}); check its permissions, or choose another directory",
                there.display()
            ));
        }
        true
    }

    fn look_at_room(&mut self, schedule: &Schedule) {
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

    /// Measures the heaviest frame that is to be done, and some others.
    fn look_at_time(&mut self) {
        let Some((_, setup)) = &self.pictures else {
            return;
        };
        let Some(heaviest) = self.to_do().max_by_key(|task| self.size(setup, task).raw) else {
            return;
        };
        let others = self.spread_tasks(heaviest);
        match probe(setup, self.sequence, heaviest, &others) {
            Ok(probe) => self.probe = Some(probe),
            // Costs that frame alone when its turn comes.
            Err(reason) => note!("frame {}: {reason}", heaviest.frame),
        }
        let needed = self.disk_bytes().unwrap_or(0.0);
        if let Some(free) = self.free_disk.filter(|free| needed > *free as f64) {
            self.problems.push(format!(
                "{}: the images need about {}, {} are free; choose another place",
                self.plan.shown_output.display(),
                Bytes(whole(needed)),
                Bytes(free)
            ));
        }
    }

    fn size(&self, setup: &Setup, task: &ImageTask) -> FrameSize {
        FrameSize::of(self.sequence, task.index, setup.run.weight.as_ref())
    }

    fn to_do(&self) -> impl Iterator<Item = &ImageTask> {
        self.tasks.iter().filter(|task| task.refused.is_none())
    }

    /// Up to four frames that are to be done, spread evenly over them; not the `heaviest`.
    fn spread_tasks(&self, heaviest: &ImageTask) -> Vec<&ImageTask> {
        let all: Vec<&ImageTask> = self.to_do().collect();
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
        // An image that was given up tells no size.
        let probe = self.probe.filter(|probe| !probe.is_lower_bound)?;
        Some(probe.image_bytes * self.to_do().count() as f64)
    }

    fn seconds(&self) -> Option<f64> {
        let probe = self.probe?;
        let (_, setup) = self.pictures.as_ref()?;
        let threads = rayon::current_num_threads();
        let overlap = self.schedule.as_ref()?.overlap;
        let sizes: Vec<FrameSize> = self.to_do().map(|task| self.size(setup, task)).collect();
        let probed = self.to_do().find(|task| task.frame == probe.frame)?;
        let frames = probe.seconds_for(&sizes, &self.size(setup, probed), overlap, threads);
        Some(self.survey_time.as_secs_f64() + frames)
    }

    /// Frames of the run that stand so.
    fn standing(&self, state: FrameState) -> Vec<i64> {
        let Some(foreseen) = &self.foreseen else {
            return Vec::new();
        };
        let all = foreseen.selected.iter().copied();
        all.filter(|frame| foreseen.state.frame_state(*frame) == Some(state))
            .collect()
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
