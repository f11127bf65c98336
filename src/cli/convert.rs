//! `spherule convert`: converts a sequence to native frames, as a job.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use spherule_files::Bytes;
use spherule_formats::convert;
use spherule_formats::native::{Bound, Encoding, FORMAT};
use spherule_formats::sequence::Sequence;
use spherule_formats::{MemoryBudget, SequenceInput, SequenceSettings};
use spherule_jobs::{DEFAULT_TAKEOVER_AFTER, FrameRange, ResumeMode};

use super::job::{FinishedRun, JobArgs, report_kept, report_wait, use_threads};
use super::key_flags::encodings;
use super::numbers::{DEFAULT_BOUND, duration, not_negative, positive};
use super::progress::{Progress, ShowReport, mode_parser};
use super::{CliError, Outcome, events, signals};
use crate::conversion::{AttributeChoices, ConvertSettings, ConvertedFrame};
use crate::job::{ConvertJob, RunError, in_thread};
use crate::manifest::{MAX_THREADS, ProgressMode};
use crate::reading::conversion_budget;

/// What the user can do if a frame does not fit into the memory limit.
const MEMORY_REMEDY: &str = "raise --memory if there is more memory";

const EXAMPLES: &str = "\
Examples:
  spherule convert run1 -o run1-native
      Every frame unchanged, 12 bytes per position
  spherule convert run1 -o run1-native --max-error 0.02
      The smallest encoding with position errors within 2 % of the radius
  spherule convert run1 -o run1-native --attributes velocity:f16,*:off
      With one attribute in half precision";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ConvertArgs {
    /// A directory, a pattern (dump.#.vtk), or files.
    #[arg(required = true)]
    input: Vec<PathBuf>,
    /// Frames to convert: 7 | 1-10 | 1-10x2 | 1-5,8 [default: all]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true, help_heading = "Input")]
    frames: Option<FrameRange>,
    /// Read files outside the directory of a list of files, such as a .pvd, that names them.
    #[arg(long, help_heading = "Input")]
    follow_links: bool,
    /// Read the vertices of meshes (PLY with faces) as particles.
    #[arg(long, help_heading = "Input")]
    mesh_points: bool,
    /// File with the properties of the atoms of a trajectory: .gro, .pdb, .psf or other
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    topology: Option<PathBuf>,
    /// Radius of all particles [default: from the files, else half the typical distance of neighbours]
    #[arg(long, value_parser = positive, help_heading = "Input")]
    radius: Option<f32>,
    /// Directory for the frames, which are called frame.NUMBER.spf, or the name of a file (one.spf) for one frame.
    ///
    /// Files of other commands are replaced only with --force. The same command continues after a stop.
    #[arg(short, long, help_heading = "Output")]
    output: PathBuf,
    /// Encoding of positions: f32 (12 bytes per particle), q16 (6) or q10 (4) [default: f32]
    ///
    /// If an error bound is given, the default is the smallest encoding within the bound.
    #[arg(long, value_parser = encodings(), hide_possible_values = true, help_heading = "Output")]
    encoding: Option<Encoding>,
    /// Largest error of a position as a fraction of the radius [default: 0.02 for q16 and q10]
    #[arg(long, value_name = "FRACTION", value_parser = not_negative, allow_negative_numbers = true,
        help_heading = "Output")]
    max_error: Option<f64>,
    /// Largest error of a position as a length.
    #[arg(long, value_name = "LENGTH", value_parser = not_negative, allow_negative_numbers = true,
        conflicts_with = "max_error", help_heading = "Output")]
    max_error_length: Option<f64>,
    /// How attributes are stored: velocity:f16,density:u8,id:keep,*:off [default: *:keep]
    ///
    /// HOW is keep (unchanged), f32, f16, u8 (8 bits over the range) or off. * stands for all other attributes.
    #[arg(long, value_name = "NAME:HOW,...", help_heading = "Output")]
    attributes: Option<AttributeChoices>,
    /// Store no attributes: positions and radii only.
    #[arg(long, conflicts_with = "attributes", help_heading = "Output")]
    no_attributes: bool,
    /// Store the index of each particle in its file as attribute `id`, unless there is one.
    ///
    /// Native frames have another order.
    #[arg(long, help_heading = "Output")]
    ids: bool,
    /// Memory limit of the conversion: 4GiB, 512MiB [default: 2GiB]; at least 64MiB are used
    ///
    /// A frame that does not fit is sorted in parts, in temporary files on the disk of the output. The particles of
    /// text files and compressed files are read into memory first; if they need more than SIZE, the frame fails.
    #[arg(long, value_name = "SIZE", help_heading = "Job")]
    memory: Option<Bytes>,
    #[command(flatten)]
    job: JobArgs,
    /// Threads to use [default: all]; at most 4 for each processor are used.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_THREADS)), help_heading = "Job")]
    threads: Option<u32>,
    /// Seconds that a frame may still take after TERM or Ctrl-C; then it is dropped.
    #[arg(long, value_name = "SECONDS", value_parser = duration, default_value = "30", allow_negative_numbers = true)]
    grace: Duration,
    /// Progress display.
    #[arg(long, value_parser = mode_parser(), default_value = "auto", help_heading = "Job")]
    progress: ProgressMode,
}

const SIGNAL_MESSAGES: signals::SignalMessages = signals::SignalMessages {
    stopping: "stopping after the frames in progress; a second signal stops at once",
    stopped: "stopped; the same command continues",
};

pub(super) fn run(args: &ConvertArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(SIGNAL_MESSAGES)?;
    if args.progress == ProgressMode::Json {
        events::start();
    }
    // Check the output before anything is read
    guard_name(&args.output)?;
    guard_input(&args.input, &args.output)?;
    use_threads(args.threads)?;
    let sequence = open_sequence(args)?;
    for note in sequence.notes() {
        note!("{note}");
    }
    // Open the job
    let mode = args.job.mode();
    let convert_job = ConvertJob::new(
        &args.output,
        args.settings(),
        sequence,
        args.frames.clone(),
        args.job.shard,
    )
    .map_err(explained)?;
    if mode != ResumeMode::Resume {
        report_wait(convert_job.dir(), DEFAULT_TAKEOVER_AFTER)?;
    }
    let (mut job, conversion) = convert_job.open(mode).map_err(explained)?;
    // Report what is known before the first frame, then convert
    let task_count = job.pending().len();
    if let Some(radius) = conversion.estimate {
        message!("radius {radius}, half the typical distance of neighbours (--radius sets it)");
    }
    report_kept(&job, task_count);
    let progress = Progress::new(args.progress, "convert", task_count, &args.output);
    let start = Instant::now();
    let interrupt = signals.start_work_with_grace(args.grace);
    let result =
        convert_job.convert_pending(&mut job, &conversion, interrupt, &|e| progress.show(&e));
    // Other workers may have finished some of the frames
    let result = result.and(job.refresh().map_err(RunError::from));
    let finished = FinishedRun {
        job: &job,
        task_count,
        frames: progress.finish(),
        start,
        interrupt,
        output: &args.output,
    };
    Ok(finished.report(result))
}

/// The error of a conversion, with the option that is at fault.
fn explained(error: RunError) -> CliError {
    match error {
        RunError::NoFrames { range, available } => CliError::other(format!(
            "--frames: {range} contains none of the frames of the input: {available}"
        )),
        RunError::UnknownAttribute(error) => CliError::other(format!("--attributes: {error}")),
        error => error.into(),
    }
}

/// Opens the input, with the memory of the conversion.
fn open_sequence(args: &ConvertArgs) -> Result<Sequence, CliError> {
    let input = SequenceInput::from_paths(args.input.clone());
    // The conversion itself holds as much
    let limit = |memory: Bytes| {
        let bytes = memory.0.max(convert::ConvertSettings::MIN_MEMORY);
        MemoryBudget::new(bytes, MEMORY_REMEDY)
    };
    let settings = SequenceSettings {
        budget: conversion_budget(args.memory.map(limit)),
        follow_links: args.follow_links,
        mesh_points: args.mesh_points,
    };
    let mut sequence = in_thread(|| Sequence::open_with(&input, settings))?;
    if let Some(path) = &args.topology {
        in_thread(|| sequence.add_topology(path))?;
    }
    Ok(sequence)
}

/// Refuses an output with the extension of another file format.
fn guard_name(output: &Path) -> Result<(), CliError> {
    let why = match spherule_formats::registry::by_name(output) {
        None => return Ok(()),
        Some(format) if format == FORMAT => return Ok(()),
        Some(_) if output.is_dir() => return Ok(()),
        Some(_) => "convert writes only native frames (.spf), or a directory of them",
    };
    let dir = output.with_extension("");
    Err(CliError::other(format!(
        "{}: has the extension of another format: {why}; give a directory, as in -o {}",
        output.display(),
        dir.display()
    )))
}

/// Refuses to write frames into a directory that is an input: later it would contain two sequences.
fn guard_input(inputs: &[PathBuf], output: &Path) -> Result<(), CliError> {
    let real = output.canonicalize().ok();
    let is_output =
        |input: &&PathBuf| real.is_some() && input.is_dir() && input.canonicalize().ok() == real;
    match inputs.iter().find(is_output) {
        None => Ok(()),
        Some(input) => Err(CliError::other(format!(
            "{}: is the input; choose another directory for the native frames",
            input.display()
        ))),
    }
}

impl ShowReport for ConvertedFrame {
    fn summary(&self) -> String {
        self.to_string()
    }

    fn facts(&self, output: String) -> Value {
        let mut facts = json!(self);
        facts["output"] = json!(output);
        facts
    }
}

impl ConvertArgs {
    fn settings(&self) -> ConvertSettings {
        let bound = match (self.max_error, self.max_error_length) {
            (Some(fraction), _) => Bound::OfRadius(fraction),
            (None, Some(length)) => Bound::Length(length),
            (None, None) => Bound::OfRadius(DEFAULT_BOUND),
        };
        let is_bounded = self.max_error.is_some() || self.max_error_length.is_some();
        let attributes = match (&self.attributes, self.no_attributes) {
            (_, true) => AttributeChoices::NONE,
            (Some(choices), false) => choices.clone(),
            (None, false) => AttributeChoices::default(),
        };
        ConvertSettings {
            encoding: self.encoding.or((!is_bounded).then_some(Encoding::F32)),
            bound,
            radius: self.radius,
            attributes,
            keep_ids: self.ids,
            memory: self.memory,
        }
    }
}
