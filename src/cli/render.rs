//! `spherule render`: a sequence, or the job of a manifest, to images.

use clap::Args;
use serde_json::json;
use spherule_formats::Sequence;

use super::plan::{Plan, RunArgs, one_fits};
use super::progress::Progress;
use super::work::{Finished, tell_kept, use_threads};
use super::{CliError, Outcome, signals};
use crate::pipeline::{self, Event, Overlap, RadiusRule, Setup, Stage};
use crate::report::{self, FrameReport};
use crate::survey::Survey;

#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    run: RunArgs,
}

const WORDS: signals::Words = signals::Words {
    asked: "stopping after the frame in hand; once more stops at once",
    at_once: "stopped; the same command goes on from here",
};

pub(super) fn run(args: &RenderArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(WORDS)?;
    let RenderArgs { run } = args;
    let mode = run.work.mode();
    let asked = run.manifest.manifest()?;
    use_threads(asked.manifest.job.threads)?;
    let sequence = asked.sequence()?;
    for note in sequence.notes() {
        say!("note: {note}");
    }
    let plan = Plan::new(asked, &sequence)?;
    plan.guard_directory(mode)?;
    plan.guard_manifest(run.work.force)?;
    let mut job = plan.open(&sequence, mode)?;
    let (survey, setup) = plan.settle(job.resolved(), &sequence)?;
    let mut tasks = plan.tasks(&sequence, &job.pending());
    let schedule = plan.fit(&sequence, &setup, &mut tasks);
    one_fits(&tasks)?;
    plan.write_manifest(run.work.force || run.work.keep_done)?;
    tell(&sequence, &survey, &setup);
    if schedule.overlap == Overlap::None && tasks.len() > 1 {
        say!("note: one frame at a time, to take less memory");
    }
    tell_kept(&job, tasks.len());
    let progress = Progress::new(plan.manifest.job.progress, tasks.len());
    let start = std::time::Instant::now();
    let interrupt = signals.at_work();
    let overlap = schedule.overlap;
    let watch = |event: Event| show(&progress, &event);
    let result = pipeline::run(
        &setup, &sequence, &tasks, overlap, &mut job, interrupt, &watch,
    );
    let ended = progress.finish();
    // Others may have done some of the frames.
    let refreshed = job.refresh().map_err(CliError::from);
    let report = report::job::JobReport::new(job.state(), &plan.manifest);
    let reported = report.files().iter().try_for_each(|(name, text)| {
        report::job::write(&plan.dir, name, text).map_err(CliError::io(&plan.dir.join(name)))
    });
    // What ended the run explains why there is no report either.
    let result = result.map_err(CliError::from).and(refreshed).and(reported);
    let finished = Finished {
        job: &job,
        tasks: tasks.len(),
        ended,
        start,
        interrupt,
        output: &plan.shown_output,
    };
    Ok(finished.tell(result))
}

/// Shows an event of the pipeline. Called from all its stages.
fn show(progress: &Progress, event: &Event) {
    match event {
        Event::Entered(frame, stage) => progress.entered(
            *frame,
            match stage {
                Stage::Read => "reading",
                Stage::Trace => "tracing",
                Stage::Write => "writing",
            },
        ),
        Event::Done(task, report) => {
            let image = task.image.display().to_string();
            let facts = json!({"image": image, "seconds": report.seconds});
            progress.done(task.frame, &task.image, &told(report), facts);
        }
        Event::Failed(frame, reason) => progress.failed(*frame, reason),
        Event::Others(news) => progress.others(*news),
        Event::Note(note) => progress.note(&format!("note: {note}")),
    }
}

fn told(report: &FrameReport) -> String {
    let s = &report.seconds;
    format!(
        "{} particles, {} built in {:.3} s, trace {:.2} s",
        report.particles, report.build.structure, s.build, s.trace
    )
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
    say!("{}", radius_text(setup, survey));
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

/// The radius in words.
pub(super) fn radius_text(setup: &Setup, survey: &Survey) -> String {
    match &setup.radius {
        RadiusRule::Common(radius) => format!("radius {radius}"),
        RadiusRule::FileOr(_) if survey.has_radii => "radius from the files".to_owned(),
        RadiusRule::FileOr(radius) => {
            let radius = short(f64::from(*radius));
            format!("radius {radius}, half the usual distance of neighbours (--radius sets it)")
        }
        RadiusRule::Attribute { name, scale } => format!("radius {scale} x attribute `{name}`"),
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
