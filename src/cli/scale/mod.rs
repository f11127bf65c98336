//! `spherule scale`: the thesis's experiment on this machine, each cell in a process of its own.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::json;
use spherule_jobs::Interrupt;

use super::numbers::pixels_to;
use super::progress::{duration, mode_parser, openjd};
use super::{CliError, Outcome, events, print, signals};
use crate::accel::Structure;
use crate::job::ChildResult;
use crate::manifest::{MAX_THREADS, ProgressMode};
use crate::render::{MAX_DEPTH, MAX_SAMPLES, MAX_SIDE};
use crate::report::machine::Machine;
use crate::scale::report::{
    CSV, CellMeasurement, CellOutcome, CellReport, HTML, JSON, MADE_BY, ScaleReport, files, table,
};
use crate::scale::{Budget, CellRequest, Motion, Representation, Task};

mod experiment;
mod frames;
pub(super) mod measure;
mod values;

use experiment::Experiment;
use frames::Frames;

const EXAMPLES: &str = "\
Examples:
  spherule scale -o scale
      The whole experiment: 36 cells of a minute each
  spherule scale --particles 1e5,1e6 --structures lbvh,kdtree --seconds 10
      Two structures, in short
  spherule scale --input run1 --frame 100 --images 20
      Your own particles";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ScaleArgs {
    /// Particle counts, such as 1e6.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1e5,1e6,1e7",
        value_parser = values::particles, allow_hyphen_values = true, help_heading = "Experiment")]
    particles: Vec<usize>,
    /// Acceleration structures: lbvh, kdtree, bvh, sbvh [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::structure, help_heading = "Experiment")]
    structures: Vec<Structure>,
    /// Camera motions: rotation, translation, both [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::motion, help_heading = "Experiment")]
    motions: Vec<Motion>,
    /// Where positions are stored: memory, f32, q16, q10, gpu [default: memory]
    ///
    /// f32, q16 and q10 use a memory-mapped native frame of that encoding, traced in place (kdtree only). gpu builds and
    /// traces on the GPU (lbvh only); its times are those of the device.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::representation, help_heading = "Experiment")]
    representations: Vec<Representation>,
    /// What traces: cpu, or gpu for both beside each other, the same as --representations memory,gpu.
    #[arg(long, value_name = "NAME", value_parser = ["cpu", "gpu"], conflicts_with = "representations", help_heading = "Experiment")]
    device: Option<String>,
    /// Tracing time per cell, in seconds [default: 60]
    #[arg(long, value_parser = values::seconds, conflicts_with = "images", allow_hyphen_values = true, help_heading = "Experiment")]
    seconds: Option<f64>,
    /// Number of images per cell, instead of a time.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true, help_heading = "Experiment")]
    images: Option<u32>,
    /// Image width in pixels.
    #[arg(long, default_value_t = 1920, allow_hyphen_values = true,
        value_parser = pixels_to(MAX_SIDE), help_heading = "Image")]
    width: u32,
    /// Image height in pixels.
    #[arg(long, default_value_t = 1080, allow_hyphen_values = true,
        value_parser = pixels_to(MAX_SIDE), help_heading = "Image")]
    height: u32,
    /// Maximum depth of reflections and refractions; 1 is direct light only.
    #[arg(long, visible_alias = "depth", default_value_t = 3, allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_DEPTH)), help_heading = "Image")]
    max_depth: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 1, allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SAMPLES)), help_heading = "Image")]
    samples: u32,
    /// Seed of the box, or of the selection of input particles.
    #[arg(long, default_value_t = 1, help_heading = "Input")]
    seed: u64,
    /// Your own particles instead of the box: a file, a pattern or a directory.
    #[arg(long, value_name = "PATH", help_heading = "Input")]
    input: Option<PathBuf>,
    /// Frame of the input [default: the first]
    #[arg(
        long,
        value_name = "NUMBER",
        requires = "input",
        allow_hyphen_values = true,
        help_heading = "Input"
    )]
    frame: Option<i64>,
    /// Directory for scale.json, scale.csv and scale.html.
    #[arg(short, long, value_name = "DIR", default_value = "scale", help_heading = "Output")]
    output: PathBuf,
    /// Threads to use [default: all]; at most 4 per processor are used.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_THREADS)), help_heading = "Job")]
    threads: Option<u32>,
    /// How progress is shown.
    #[arg(long, value_parser = mode_parser(), default_value = "auto", help_heading = "Job")]
    progress: ProgressMode,
}

const SIGNAL_MESSAGES: signals::SignalMessages =
    signals::SignalMessages { stopping: "stopping; finished cells are kept", stopped: "stopped" };

pub(super) fn run(args: &ScaleArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(SIGNAL_MESSAGES)?;
    if args.progress == ProgressMode::Json {
        events::start();
    }
    // Settle the experiment, and start its report
    let experiment = Experiment::settle(args)?;
    prepare(&args.output)?;
    let cells = experiment.cells();
    let mut report = ScaleReport {
        made_by: MADE_BY.to_owned(),
        machine: Machine::this(),
        planned: cells.len(),
        settings: experiment.settings,
        cells: Vec::with_capacity(cells.len()),
    };
    message!("{}", table::subject(&report));
    let output = args.output.display().to_string();
    events::send("start", json!({"command": "scale", "total": cells.len(), "output": output}));
    // Measure the cells
    let ended = measure_all(&cells, &mut report, args, signals.start_work());
    if report.cells.is_empty() {
        return Ok(Outcome::Interrupted);
    }
    // Report the results
    let failed: Vec<String> = report.failed().map(|(cell, _)| table::cell_name(cell)).collect();
    events::add_to_end(json!({
        "done": report.cells.len() - failed.len(),
        "total": report.planned,
        "failed": failed,
    }));
    show_tables(&report, args.progress)?;
    if let Some((path, source)) = ended.unwritten {
        let error = CliError::Io { path, source };
        error!("{error}");
        events::add_to_end(json!({"errors": [error.to_string()]}));
        return Ok(Outcome::SomeFailed);
    }
    let [json, csv, html] = [JSON, CSV, HTML];
    message!("{json}, {csv} and {html} are in {}", args.output.display());
    Ok(if ended.interrupted {
        Outcome::Interrupted
    } else if report.failed().next().is_some() {
        Outcome::SomeFailed
    } else {
        Outcome::Done
    })
}

/// How the run ended.
#[derive(Default)]
struct EndOfRun {
    interrupted: bool,
    /// The error of the last attempt to write the results.
    unwritten: Option<(PathBuf, io::Error)>,
}

/// Runs `cells` one after the other, and adds their results to `report` and the files.
fn measure_all(
    cells: &[CellRequest],
    report: &mut ScaleReport,
    args: &ScaleArgs,
    interrupt: &Interrupt,
) -> EndOfRun {
    let progress = Progress {
        mode: args.progress,
        total: cells.len(),
        budget: report.settings.budget,
        start: Instant::now(),
    };
    let mut ended = EndOfRun::default();
    let mut frames = Frames::in_dir(&args.output);
    for request in cells {
        let ChildResult::Completed(outcome) = measure_one(request, &mut frames, interrupt) else {
            ended.interrupted = true;
            break;
        };
        report.cells.push(cell_report(request, outcome));
        progress.show(report);
        // Write after every cell, so that a killed run keeps its results. If the disk is full, continue: there may be
        // space later, and the tables are printed in any case.
        ended.unwritten = files::write(&args.output, report).err();
    }
    ended
}

/// Measures the cell of `request`, in its native frame if it has one.
fn measure_one(
    request: &CellRequest,
    frames: &mut Frames,
    interrupt: &Interrupt,
) -> ChildResult<CellOutcome> {
    // Make the native frame first, if the cell needs one
    let mut made = None;
    if request.representation.encoding().is_some() {
        match frames.of(request, interrupt) {
            ChildResult::Interrupted => return ChildResult::Interrupted,
            ChildResult::Crashed(crash) => {
                let reason = crash.to_string();
                return ChildResult::Completed(CellOutcome::Failed { reason });
            }
            ChildResult::Completed(Ok(frame)) => made = Some(frame),
            ChildResult::Completed(Err(reason)) => {
                let reason = format!("cannot make the native frame: {reason}");
                return ChildResult::Completed(CellOutcome::Failed { reason });
            }
        }
    }
    // Measure in a child process, which may run out of memory
    let task = Task::Measure { request: request.clone(), file: made.map(|(path, _)| path.clone()) };
    let stop = || interrupt.is_raised();
    let measured: Result<CellMeasurement, String> = match measure::run_child(&task, stop) {
        ChildResult::Interrupted => return ChildResult::Interrupted,
        ChildResult::Completed(measured) => measured,
        ChildResult::Crashed(crash) => Err(crash.to_string()),
    };
    ChildResult::Completed(match measured {
        Err(reason) => CellOutcome::Failed { reason },
        Ok(measured) => CellOutcome::Done(Box::new(CellMeasurement {
            conversion: made.map(|(_, conversion)| *conversion),
            ..measured
        })),
    })
}

fn cell_report(request: &CellRequest, outcome: CellOutcome) -> CellReport {
    CellReport {
        particles: request.particles,
        structure: request.structure.name().to_owned(),
        motion: request.motion,
        representation: request.representation,
        outcome,
    }
}

/// Checks that results can be written, before hours are spent on them.
fn prepare(dir: &Path) -> Result<(), CliError> {
    if let Some(file) = dir.ancestors().find(|p| p.exists() && !p.is_dir()) {
        return Err(CliError::other(format!(
            "{}: is a file, but a directory for the results is needed; choose another with -o",
            file.display()
        )));
    }
    if let Some(path) = files::foreign(dir) {
        return Err(CliError::other(format!(
            "{}: exists and was not written by `{MADE_BY}`; move it or choose another directory with -o",
            path.display()
        )));
    }
    files::prepare(dir).map_err(|e| {
        CliError::other(format!(
            "{}: cannot be written: {e}; choose another directory with -o",
            dir.display()
        ))
    })
}

/// Prints the tables; to standard error if standard output has the events.
fn show_tables(report: &ScaleReport, mode: ProgressMode) -> Result<(), CliError> {
    let text = table::text(report);
    if mode == ProgressMode::Json {
        text.lines().for_each(print::message);
    } else {
        print::lines(text.lines())?;
    }
    Ok(())
}

/// Reports each finished cell.
struct Progress {
    mode: ProgressMode,
    total: usize,
    budget: Budget,
    start: Instant,
}

impl Progress {
    /// The last cell of `report` has ended.
    fn show(&self, report: &ScaleReport) {
        let Some(cell) = report.cells.last() else {
            return;
        };
        let done = report.cells.len();
        let name = table::cell_name(cell);
        let event = match &cell.outcome {
            CellOutcome::Done(_) => "cell_done",
            CellOutcome::Failed { .. } => "cell_failed",
        };
        events::send(event, json!({"cell": cell, "done": done, "total": self.total}));
        let summary = match &cell.outcome {
            CellOutcome::Done(measured) => table::line(measured),
            CellOutcome::Failed { reason } => {
                error!("{name}: {reason}");
                "failed".to_owned()
            }
        };
        match self.mode {
            ProgressMode::Auto | ProgressMode::Plain => {
                message!("[{done}/{}] {name}: {summary}, {} left", self.total, self.remaining(done))
            }
            ProgressMode::Openjd => openjd(done, self.total, &format!("{name}: {summary}")),
            ProgressMode::Json | ProgressMode::None => {}
        }
    }

    /// Estimate from the mean so far; a cell takes at least its time budget.
    fn remaining(&self, done: usize) -> String {
        let mean = self.start.elapsed().as_secs_f64() / done.max(1) as f64;
        let each = match self.budget {
            Budget::Seconds(seconds) => mean.max(seconds),
            Budget::Images(_) => mean,
        };
        duration(each * (self.total - done.min(self.total)) as f64)
    }
}
