//! `spherule convert`: a sequence becomes native frames, in a directory that is a job.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use spherule_formats::SequenceInput;
use spherule_formats::detect::Format;
use spherule_formats::native::{Bound, Encoding, FORMAT};
use spherule_formats::sequence::{Sequence, SequenceFrame};
use spherule_jobs::{DEFAULT_PATIENCE, FrameRange, Job, JobRequest, Mode};

use super::job::apart;
use super::numbers::{USUAL_BOUND, duration, not_negative, positive};
use super::paths::absolute;
use super::progress::Progress;
use super::work::{
    Finished, KIND, WorkArgs, chosen, guard_directory, guard_kind, requests, saved_survey,
    selection, tell_kept, use_threads,
};
use super::{CliError, Outcome, events, signals};
use crate::conversion::{self, AttributeChoices, Conversion, ConvertSettings, ConvertTask, Event};
use crate::manifest::{MAX_THREADS, ProgressMode, real_dir};
use crate::metrics::Bytes;
use crate::reading::conversion_budget;
use crate::survey::Survey;

/// What the job of a conversion is called in its plan.
const CONVERT: &str = "convert";

const EXAMPLES: &str = "\
Examples:
  spherule convert run1 -o run1-native
      Every frame as it is, 12 bytes for each position
  spherule convert run1 -o run1-native --max-error 0.02
      As small as positions within 2 % of the radius can be
  spherule convert run1 -o run1-native --attributes velocity:f16,*:off
      With one attribute, in half precision";

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
    /// Radius of all particles [default: of the files, else half the usual distance of neighbours]
    #[arg(long, value_parser = positive, help_heading = "Input")]
    radius: Option<f32>,
    /// Directory for the frames, which are called frame.NUMBER.spf, or the name of a file (one.spf) for one frame.
    ///
    /// Files that another command made are replaced only with --force. The same command goes on where it was stopped.
    #[arg(short, long, help_heading = "Output")]
    output: PathBuf,
    /// How positions are stored: f32 (12 bytes a particle), q16 (6) or q10 (4) [default: f32]
    ///
    /// With a largest error, the default is what needs the fewest bytes.
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
    /// Ways are keep (as they are), f32, f16, u8 (8 bits over the range) and off; * are all that are not named.
    #[arg(long, value_name = "NAME:HOW,...", help_heading = "Output")]
    attributes: Option<AttributeChoices>,
    /// Store no attributes: positions and radii only.
    #[arg(long, conflicts_with = "attributes", help_heading = "Output")]
    no_attributes: bool,
    /// Keep each particle's place in its file as an attribute `id`, where there is none.
    ///
    /// Native frames are in another order.
    #[arg(long, help_heading = "Output")]
    ids: bool,
    /// Memory that the conversion may hold: 4GiB, 512MiB [default: 2GiB]
    ///
    /// A frame that does not fit is ordered in parts, which lie on the disk of the output meanwhile. The particles of
    /// text and packed files are read into memory first; if they need more than a given SIZE, their frame fails.
    #[arg(long, value_name = "SIZE", help_heading = "Job")]
    memory: Option<Bytes>,
    #[command(flatten)]
    work: WorkArgs,
    /// Threads to use [default: all]; at most 4 for each processor are used.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_THREADS)), help_heading = "Job")]
    threads: Option<u32>,
    /// Seconds that a frame may take after TERM or Ctrl-C; then it is dropped.
    #[arg(long, value_name = "SECONDS", value_parser = duration, default_value = "30", allow_negative_numbers = true)]
    grace: Duration,
    /// How progress is shown.
    #[arg(long, value_enum, default_value = "auto", help_heading = "Job")]
    progress: ProgressMode,
}

const WORDS: signals::Words = signals::Words {
    asked: "stopping after the frame in hand; once more stops at once",
    at_once: "stopped; the same command goes on from here",
};

pub(super) fn run(args: &ConvertArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(WORDS)?;
    if args.progress == ProgressMode::Json {
        events::begin();
    }
    guard_name(&args.output)?;
    use_threads(args.threads)?;
    let input = SequenceInput::from_paths(args.input.clone());
    let budget = conversion_budget(args.memory.map(|memory| memory.0));
    let sequence = apart(|| Sequence::open_within(&input, budget))?;
    for note in sequence.notes() {
        note!("{note}");
    }
    let (dir, name) = args.place();
    let plan = Plan {
        args,
        dir: real_dir(&absolute(&dir)?),
        name,
        settings: args.settings(),
        sequence,
    };
    plan.guard()?;
    let mut job = plan.open()?;
    let conversion = plan.settle(job.resolved())?;
    let tasks = plan.tasks(&job.pending());
    if let Some(radius) = conversion.estimate {
        say!("radius {radius}, half the usual distance of neighbours; --radius sets another");
    }
    tell_kept(&job, tasks.len());
    let progress = Progress::new(args.progress, CONVERT, tasks.len(), &args.output);
    let start = Instant::now();
    let interrupt = signals.at_work_within(args.grace);
    let result = conversion::run(
        &conversion,
        &plan.sequence,
        &tasks,
        &mut job,
        interrupt,
        &|event| show(&progress, &event),
    );
    // Others may have done some of the frames.
    let result = result.and(job.refresh());
    let finished = Finished {
        job: &job,
        tasks: tasks.len(),
        ended: progress.finish(),
        start,
        interrupt,
        output: &args.output,
    };
    Ok(finished.tell(result.map_err(CliError::from)))
}

/// Refuses the name of a file of another format where a directory or a native frame is wanted.
fn guard_name(output: &Path) -> Result<(), CliError> {
    let why = match Format::by_name(output) {
        None => return Ok(()),
        Some(format) if format == FORMAT => return Ok(()),
        Some(_) if output.is_dir() => return Ok(()),
        Some(_) => "convert writes native frames (.spf) alone, and a directory of them",
    };
    let dir = output.with_extension("");
    Err(CliError::other(format!(
        "{}: is a file's name: {why}; name a directory, as in -o {}",
        output.display(),
        dir.display()
    )))
}

fn show(progress: &Progress, event: &Event) {
    match event {
        Event::Entered(frame) => progress.entered(*frame, "converting"),
        Event::Advanced(frame, phase, done, total) => {
            let percent = 100 * u128::from(*done) / u128::from(*total).max(1);
            let doing = format!("converting ({} {percent} %)", phase.name());
            progress.entered(*frame, &doing);
        }
        Event::Done(task, converted) => {
            let mut facts = json!(converted);
            facts["output"] = json!(task.output.display().to_string());
            progress.done(task.frame, &task.output, &converted.to_string(), facts);
        }
        Event::Failed(frame, reason) => progress.failed(*frame, reason),
        Event::Others(news) => progress.others(*news),
        Event::Note(note) => progress.note(note),
    }
}

/// A job before anything is written.
struct Plan<'a> {
    args: &'a ConvertArgs,
    /// Where the frames go, absolute.
    dir: PathBuf,
    /// What the only frame is called, if the user gave it a name.
    name: Option<OsString>,
    settings: ConvertSettings,
    sequence: Sequence,
}

impl Plan<'_> {
    const fn mode(&self) -> Mode {
        self.args.work.mode()
    }

    fn output(&self, frame: i64) -> PathBuf {
        match &self.name {
            Some(name) => self.dir.join(name),
            None => self.dir.join(format!("frame.{frame:04}.spf")),
        }
    }

    /// Refuses what cannot be before anything is written.
    fn guard(&self) -> Result<(), CliError> {
        let frames = chosen(&self.sequence, self.args.frames.as_ref(), "--frames")?;
        if self.name.is_some() && frames.len() > 1 {
            return Err(CliError::other(format!(
                "{}: is one name for {} frames; give a directory, or choose one frame with --frames",
                self.args.output.display(),
                frames.len()
            )));
        }
        guard_directory(&self.dir, "frames")?;
        guard_kind(&self.dir, Some(CONVERT), self.mode())?;
        let made = |(_, frame): &(usize, &SequenceFrame)| frames.contains(&frame.number);
        let is_named = self.name.is_some();
        let all = self.sequence.frames().iter().enumerate();
        for (index, frame) in all.filter(|frame| !is_named || made(frame)) {
            let output = self.output(frame.number);
            let is_output = |path: &&Path| path.canonicalize().is_ok_and(|real| real == output);
            if let Some(input) = self.sequence.inputs(index).into_iter().find(is_output) {
                return Err(CliError::other(format!(
                    "{}: would be overwritten by its own conversion; choose another output directory",
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
                self.args.work.shard,
            )),
            mode: self.mode(),
            patience: DEFAULT_PATIENCE,
        }
    }

    fn open(&self) -> Result<Job, CliError> {
        // A new job is begun, and an old one forgotten, only for frames that can be.
        let surveyed = if self.mode() == Mode::Force || Job::peek(&self.dir)?.is_none() {
            Some(self.survey()?)
        } else {
            None
        };
        Ok(Job::open(&self.dir, self.request(), |_| {
            surveyed.map_or_else(|| self.survey(), Ok)
        })?)
    }

    /// Looks at the sequence: where its zero is, and what radius frames have that bring none.
    fn survey(&self) -> Result<Value, CliError> {
        let survey = apart(|| Survey::of(&self.sequence, self.settings.question()))?;
        self.conversion(&survey)?;
        serde_json::to_value(&survey).map_err(|e| CliError::Other(e.to_string()))
    }

    fn conversion(&self, survey: &Survey) -> Result<Conversion, CliError> {
        Conversion::new(self.settings.clone(), survey).map_err(CliError::Other)
    }

    /// What holds for all frames, by what was found when the job began.
    fn settle(&self, resolved: &Value) -> Result<Conversion, CliError> {
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
    /// The directory for the frames, and what the only one is called if it was given a name.
    fn place(&self) -> (PathBuf, Option<OsString>) {
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
            (None, None) => Bound::OfRadius(USUAL_BOUND),
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
