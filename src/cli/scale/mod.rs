//! `spherule scale`: the thesis's experiment on this machine, each cell in a process of its own.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::json;
use spherule_jobs::Interrupt;

use super::progress::{duration, openjd};
use super::{CliError, Outcome, signals};
use crate::accel::Structure;
use crate::cli::child::{self, Ended};
use crate::manifest::ProgressMode;
use crate::render::{MAX_DEPTH, MAX_SAMPLES, MAX_SIDE};
use crate::report::machine::Machine;
use crate::report::scale::{
    CellMeasurement, CellOutcome, CellReport, MADE_BY, ScaleReport, files, table,
};
use crate::scale::{Budget, CellRequest, Motion, Representation, Task};

mod experiment;
mod frames;
pub(super) mod measure;
mod words;

use experiment::Experiment;
use frames::Frames;

#[derive(Debug, Args)]
pub(super) struct ScaleArgs {
    /// Particle counts; 1e6 is understood.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1e5,1e6,1e7",
        value_parser = words::particles, allow_hyphen_values = true)]
    particles: Vec<usize>,
    /// Acceleration structures; default: all.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = words::structure)]
    structures: Vec<Structure>,
    /// Camera motions: rotation, translation, both; default: all.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = words::motion)]
    motions: Vec<Motion>,
    /// Where positions are: memory, or f32, q16, q10 for a mapped native frame of that encoding, traced
    /// where it lies (kdtree alone); default: memory.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = words::representation)]
    representations: Vec<Representation>,
    /// Seconds that the images of a cell are traced for; default: 60.
    #[arg(long, value_parser = words::seconds, conflicts_with = "images", allow_hyphen_values = true)]
    seconds: Option<f64>,
    /// Images of a cell, instead of a time.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true)]
    images: Option<u32>,
    /// Image width in pixels.
    #[arg(long, default_value_t = 1920, allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SIDE)))]
    width: u32,
    /// Image height in pixels.
    #[arg(long, default_value_t = 1080, allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SIDE)))]
    height: u32,
    /// Reflections and refractions followed; 1 is direct light only.
    #[arg(long, visible_alias = "depth", default_value_t = 3, allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_DEPTH)))]
    max_depth: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 1, allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SAMPLES)))]
    samples: u32,
    /// Seed of the box, or of the choice among the input's particles.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads to use; default: all.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Particles of your own instead of the box: a file, a pattern or a directory.
    #[arg(long, value_name = "PATH")]
    input: Option<PathBuf>,
    /// Which frame of the input; default: the first.
    #[arg(
        long,
        value_name = "NUMBER",
        requires = "input",
        allow_hyphen_values = true
    )]
    frame: Option<i64>,
    /// Directory for scale.json, scale.csv and scale.html.
    #[arg(short, long, value_name = "DIR", default_value = "scale")]
    output: PathBuf,
    /// How progress is shown.
    #[arg(long, value_enum, default_value = "auto")]
    progress: ProgressMode,
}

const WORDS: signals::Words = signals::Words {
    asked: "stopping; what is measured is kept",
    at_once: "stopped",
};

pub(super) fn run(args: &ScaleArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(WORDS)?;
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
    say!("{}", table::subject(&report));
    let ended = measure_all(&cells, &mut report, args, signals.at_work());
    if report.cells.is_empty() {
        return Ok(Outcome::Interrupted);
    }
    print(&table::text(&report))?;
    if let Some((path, source)) = ended.unwritten {
        say!("error: {}", CliError::Io { path, source });
        return Ok(Outcome::SomeFailed);
    }
    let [json, csv, html] = [files::JSON, files::CSV, files::HTML];
    say!("{json}, {csv} and {html} are in {}", args.output.display());
    Ok(if ended.interrupted {
        Outcome::Interrupted
    } else if report.failed().next().is_some() {
        Outcome::SomeFailed
    } else {
        Outcome::Done
    })
}

/// What came of the run as a whole.
#[derive(Default)]
struct EndOfRun {
    interrupted: bool,
    /// What the last try to write results met.
    unwritten: Option<(PathBuf, io::Error)>,
}

/// Runs `cells` one after the other and puts what they tell into `report` and the files.
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
        let Ended::Told(outcome) = measure_one(request, &mut frames, interrupt) else {
            ended.interrupted = true;
            break;
        };
        report.cells.push(cell_report(request, outcome));
        progress.show(report);
        // After every cell: a long run that is killed has not run for nothing. One that finds the
        // disk full goes on, in the hope of room and for its tables.
        ended.unwritten = files::write(&args.output, report).err();
    }
    ended
}

/// Measures the cell of `request`, in its native frame if it has one.
fn measure_one(
    request: &CellRequest,
    frames: &mut Frames,
    interrupt: &Interrupt,
) -> Ended<CellOutcome> {
    let mut made = None;
    if request.representation.encoding().is_some() {
        match frames.of(request, interrupt) {
            Ended::Interrupted => return Ended::Interrupted,
            Ended::Died(reason) => return Ended::Told(CellOutcome::Failed { reason }),
            Ended::Told(Ok(frame)) => made = Some(frame),
            Ended::Told(Err(reason)) => {
                let reason = format!("no native frame: {reason}");
                return Ended::Told(CellOutcome::Failed { reason });
            }
        }
    }
    let task = Task::Measure {
        request: request.clone(),
        file: made.map(|(path, _)| path.clone()),
    };
    let stop = || interrupt.is_raised();
    let measured: Result<CellMeasurement, String> = match child::run(measure::COMMAND, &task, stop)
    {
        Ended::Interrupted => return Ended::Interrupted,
        Ended::Told(measured) => measured,
        Ended::Died(reason) => Err(reason),
    };
    Ended::Told(match measured {
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

/// Sees that results can be written, before hours are spent on them.
fn prepare(dir: &Path) -> Result<(), CliError> {
    if let Some(file) = dir.ancestors().find(|p| p.exists() && !p.is_dir()) {
        return Err(CliError::other(format!(
            "{}: is a file where a directory for the results should be; choose another with -o",
            file.display()
        )));
    }
    if let Some(path) = files::foreign(dir) {
        return Err(CliError::other(format!(
            "{}: is in the way and not of `{MADE_BY}`; move it or choose another directory with -o",
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

/// The result: a full disk is told, a reader that has seen enough is not.
fn print(text: &str) -> Result<(), CliError> {
    match io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(CliError::io(Path::new("standard output"))(e))
        }
        _ => Ok(()),
    }
}

/// Tells one cell after the other.
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
        let told = match &cell.outcome {
            CellOutcome::Done(measured) => table::line(measured),
            CellOutcome::Failed { reason } => {
                say!("error: {name}: {reason}");
                "failed".to_owned()
            }
        };
        match self.mode {
            ProgressMode::Auto | ProgressMode::Plain => say!(
                "[{done}/{}] {name}: {told}, {} left",
                self.total,
                self.remaining(done)
            ),
            ProgressMode::Json => {
                say!(
                    "{}",
                    json!({"cell": cell, "done": done, "total": self.total})
                );
            }
            ProgressMode::Openjd => openjd(done, self.total, &format!("{name}: {told}")),
            ProgressMode::None => {}
        }
    }

    /// Cells that are still to come are larger, but take their time at least.
    fn remaining(&self, done: usize) -> String {
        let mean = self.start.elapsed().as_secs_f64() / done.max(1) as f64;
        let each = match self.budget {
            Budget::Seconds(seconds) => mean.max(seconds),
            Budget::Images(_) => mean,
        };
        duration(each * (self.total - done.min(self.total)) as f64)
    }
}
