//! `spherule convert`: converts a sequence to native frames, as a job.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use spherule_formats::detect::Format;
use spherule_formats::native::{Bound, Encoding, FORMAT};
use spherule_formats::sequence::{Sequence, SequenceFrame};
use spherule_formats::{MemoryBudget, SequenceInput};
use spherule_jobs::{DEFAULT_TAKEOVER_AFTER, FrameRange, Job, JobRequest, ResumeMode};

use super::job::{
    FinishedRun, JobArgs, KIND, frames_in, guard_directory, guard_kind, report_kept, requests,
    saved_survey, selection, use_threads,
};
use super::manifest_args::in_thread;
use super::numbers::{DEFAULT_BOUND, duration, not_negative, positive};
use super::paths::absolute;
use super::progress::Progress;
use super::{CliError, Outcome, events, signals};
use crate::conversion::{self, AttributeChoices, Conversion, ConvertSettings, ConvertTask, Event};
use crate::manifest::{MAX_THREADS, ProgressMode, real_dir};
use crate::metrics::Bytes;
use crate::reading::conversion_budget;
use crate::survey::Survey;

/// Value of [`KIND`] in the plan of a conversion.
const CONVERT: &str = "convert";

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
    #[arg(
        long,
        value_name = "RANGE",
        allow_hyphen_values = true,
        help_heading = "Input"
    )]
    frames: Option<FrameRange>,
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
    #[arg(long, help_heading = "Output")]
    encoding: Option<Encoding>,
    /// Largest error of a position as a fraction of the radius [default: 0.02 for q16 and q10]
    #[arg(long, value_name = "FRACTION", value_parser = not_negative, help_heading = "Output")]
    max_error: Option<f64>,
    /// Largest error of a position as a length.
    #[arg(long, value_name = "LENGTH", value_parser = not_negative, conflicts_with = "max_error",
        help_heading = "Output")]
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
    /// Memory limit of the conversion: 4GiB, 512MiB [default: 2GiB]
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
    #[arg(long, value_enum, default_value = "auto", help_heading = "Job")]
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
    guard_name(&args.output)?;
    use_threads(args.threads)?;
    let input = SequenceInput::from_paths(args.input.clone());
    let limit = |memory: Bytes| MemoryBudget::new(memory.0, MEMORY_REMEDY);
    let budget = conversion_budget(args.memory.map(limit));
    let sequence = in_thread(|| Sequence::open_within(&input, budget))?;
    for note in sequence.notes() {
        note!("{note}");
    }
    let (dir, name) = args.output_dir();
    let convert_job = ConvertJob {
        args,
        dir: real_dir(&absolute(&dir)?),
        name,
        settings: args.settings(),
        sequence,
    };
    convert_job.guard()?;
    let mut job = convert_job.open()?;
    let conversion = convert_job.stored_conversion(job.resolved())?;
    let tasks = convert_job.tasks(&job.pending());
    if let Some(radius) = conversion.estimate {
        message!("radius {radius}, half the typical distance of neighbours (--radius sets it)");
    }
    report_kept(&job, tasks.len());
    let progress = Progress::new(args.progress, CONVERT, tasks.len(), &args.output);
    let start = Instant::now();
    let interrupt = signals.start_work_with_grace(args.grace);
    let result = conversion::run(
        &conversion,
        &convert_job.sequence,
        &tasks,
        &mut job,
        interrupt,
        &|event| show_event(&progress, &event),
    );
    // Other workers may have finished some of the frames
    let result = result.and(job.refresh());
    let finished = FinishedRun {
        job: &job,
        tasks: tasks.len(),
        frames: progress.finish(),
        start,
        interrupt,
        output: &args.output,
    };
    Ok(finished.report(result.map_err(CliError::from)))
}

/// Refuses an output with the extension of another file format.
fn guard_name(output: &Path) -> Result<(), CliError> {
    let why = match Format::by_name(output) {
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

fn show_event(progress: &Progress, event: &Event) {
    match event {
        Event::Started(frame) => progress.stage(*frame, "converting"),
        Event::Advanced(frame, phase, done, total) => {
            let percent = 100 * u128::from(*done) / u128::from(*total).max(1);
            let stage = format!("converting ({} {percent} %)", phase.name());
            progress.stage(*frame, &stage);
        }
        Event::Done(task, converted) => {
            let mut facts = json!(converted);
            facts["output"] = json!(task.output.display().to_string());
            progress.done(task.frame, &task.output, &converted.to_string(), facts);
        }
        Event::Failed(failure) => progress.failed(failure),
        Event::OtherWorker(event) => progress.other_worker(*event),
        Event::Note(note) => progress.note(note),
    }
}

/// A conversion job before anything is written.
struct ConvertJob<'a> {
    args: &'a ConvertArgs,
    /// Directory of the frames, absolute.
    dir: PathBuf,
    /// File name of the only frame, if the user gave one.
    name: Option<OsString>,
    settings: ConvertSettings,
    sequence: Sequence,
}

impl ConvertJob<'_> {
    const fn mode(&self) -> ResumeMode {
        self.args.job.mode()
    }

    fn output(&self, frame: i64) -> PathBuf {
        match &self.name {
            Some(name) => self.dir.join(name),
            None => self.dir.join(format!("frame.{frame:04}.spf")),
        }
    }

    /// Refuses impossible requests before anything is written.
    fn guard(&self) -> Result<(), CliError> {
        let frames = frames_in(&self.sequence, self.args.frames.as_ref(), "--frames")?;
        if self.name.is_some() && frames.len() > 1 {
            return Err(CliError::other(format!(
                "{}: one file name for {} frames; give a directory, or select one frame with --frames",
                self.args.output.display(),
                frames.len()
            )));
        }
        guard_directory(&self.dir, "frames")?;
        guard_kind(&self.dir, Some(CONVERT), self.mode())?;
        let is_selected = |(_, frame): &(usize, &SequenceFrame)| frames.contains(&frame.number);
        let is_named = self.name.is_some();
        let all = self.sequence.frames().iter().enumerate();
        for (index, frame) in all.filter(|frame| !is_named || is_selected(frame)) {
            let output = self.output(frame.number);
            let is_output = |path: &&Path| path.canonicalize().is_ok_and(|real| real == output);
            if let Some(input) = self.sequence.inputs(index).into_iter().find(is_output) {
                return Err(CliError::other(format!(
                    "{}: the conversion would overwrite its own input; choose another output directory",
                    input.display()
                )));
            }
        }
        Ok(())
    }

    fn request(&self) -> JobRequest {
        let mut settings = vec![(KIND.to_owned(), CONVERT.to_owned())];
        settings.extend(self.settings.settings());
        let mut frames = requests(&self.sequence, |frame| vec![self.output(frame)]);
        if let Some(range) = self.args.frames.as_ref().filter(|_| self.name.is_some()) {
            frames.retain(|frame| range.contains(frame.number));
        }
        JobRequest {
            settings,
            frames,
            extra_outputs: Vec::new(),
            selection: Some(selection(
                &self.sequence,
                self.args.frames.as_ref(),
                self.args.job.shard,
            )),
            mode: self.mode(),
            takeover_after: DEFAULT_TAKEOVER_AFTER,
        }
    }

    fn open(&self) -> Result<Job, CliError> {
        // Start a new job, or discard an old one, only if the conversion is possible
        let surveyed = if self.mode() == ResumeMode::Force || Job::read_plan(&self.dir)?.is_none() {
            Some(self.survey()?)
        } else {
            None
        };
        Ok(Job::open(&self.dir, self.request(), |_| {
            surveyed.map_or_else(|| self.survey(), Ok)
        })?)
    }

    /// Surveys the sequence: its origin, and the radius of frames without one.
    fn survey(&self) -> Result<Value, CliError> {
        let survey = in_thread(|| Survey::of(&self.sequence, self.settings.question()))?;
        self.conversion(&survey)?;
        serde_json::to_value(&survey).map_err(|e| CliError::Other(e.to_string()))
    }

    fn conversion(&self, survey: &Survey) -> Result<Conversion, CliError> {
        Conversion::new(self.settings.clone(), survey)
            .map_err(|e| CliError::other(format!("--attributes: {e}")))
    }

    /// The conversion with the survey that is stored in the plan.
    fn stored_conversion(&self, resolved: &Value) -> Result<Conversion, CliError> {
        self.conversion(&saved_survey(resolved, &self.dir)?)
    }

    fn tasks(&self, pending: &[i64]) -> Vec<ConvertTask> {
        let frames = self.sequence.frames();
        let task = |number: &i64| {
            let index = frames.binary_search_by_key(number, |f| f.number).ok()?;
            Some(ConvertTask {
                frame: *number,
                index,
                output: self.output(*number),
            })
        };
        pending.iter().filter_map(task).collect()
    }
}

impl ConvertArgs {
    /// The directory of the frames, and the file name of the only frame if one was given.
    fn output_dir(&self) -> (PathBuf, Option<OsString>) {
        let is_frame = |e: &OsStr| e.eq_ignore_ascii_case("spf");
        let is_file = self.output.extension().is_some_and(is_frame) && !self.output.is_dir();
        match (self.output.parent(), self.output.file_name()) {
            (Some(dir), Some(name)) if is_file => (dir.to_owned(), Some(name.to_owned())),
            _ => (self.output.clone(), None),
        }
    }

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
