//! `spherule still`: renders a single frame to try settings. No job: no plan, ledger, manifest or report.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::json;
use spherule_formats::Sequence;
use spherule_jobs::{FrameRange, Job};

use super::job::{list, use_threads};
use super::manifest_args::{ManifestArgs, complete, open_sequence};
use super::paths::absolute;
use super::render::{details, print_summary, sampling_notes};
use super::still_progress::StillProgress;
use super::{CliError, Outcome, disk, events, print, signals};
use crate::job::{JobManifest, RenderJob, frames_in, require_one_fits};
use crate::manifest::{Look, ProgressMode};
use crate::output::{OutputError, PictureFormat};
use crate::pipeline::{ImageError, ImageTask, Setup, WriteError, make_image_until};
use crate::render::Channels;
use crate::report::FrameReport;

/// Signatures of the files that `still` may replace: OpenEXR, PNG, JPEG, TIFF, PDF, and SVG as it writes it.
const IMAGE_SIGNATURES: [&[u8]; 6] =
    [b"\x76\x2f\x31\x01", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"II*\0", b"%PDF-1.", b"<svg xml"];

const OUTPUT_HELP: &str = "Image to write: look.png, look.exr, look.jpg, look.tif, look.pdf or look.svg; an existing image is replaced";

const EXAMPLES: &str = "Examples:
  spherule still dump -o look.png
  spherule still dump --frame 120 --color-by velocity --map turbo -o look.png
  spherule still out/job.toml --set material.transmission=1 --width 960 --height 540 -o glass.exr";

#[derive(Debug, Args)]
#[command(
    after_help = EXAMPLES,
    mut_arg("output", |a| a.required(true).value_name("FILE").help(OUTPUT_HELP).long_help(OUTPUT_HELP)),
    mut_arg("frames", no_job),
    mut_arg("isolate", no_job),
    mut_arg("memory-ceiling", no_job),
    mut_arg("retries", no_job),
    mut_arg("takeover-after", no_job),
    mut_arg("grace", no_job),
    mut_arg("follow", no_job),
    mut_arg("idle", no_job),
    mut_arg("settle", no_job),
    mut_arg("stop-file", no_job),
)]
pub(super) struct StillArgs {
    #[command(flatten)]
    manifest: ManifestArgs,
    /// Number of the frame to render, first, last, or t=TIME for the nearest in time [default: the middle one]
    ///
    /// -1 is the last frame and -2 the one before it, unless frames have these numbers. Times are those of the files and
    /// must rise from frame to frame.
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = FrameChoice::parse)]
    frame: Option<FrameChoice>,
}

/// The frame that is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum FrameChoice {
    First,
    Last,
    Number(i64),
    /// The one nearest to this simulation time.
    Time(f64),
}

impl FrameChoice {
    fn parse(text: &str) -> Result<Self, String> {
        let time = |time: &str| time.parse().ok().filter(|time: &f64| time.is_finite());
        let choice = match (text, text.strip_prefix("t=")) {
            ("first", _) => Some(Self::First),
            ("last", _) => Some(Self::Last),
            (_, Some(text)) => time(text).map(Self::Time),
            (number, None) => number.parse().ok().map(Self::Number),
        };
        choice.ok_or_else(|| {
            "expected the number of a frame, first, last, or a time (t=0.5)".to_owned()
        })
    }

    /// The frame among `numbers`, which rise; None for a time.
    fn among(self, numbers: &[i64]) -> Option<i64> {
        match self {
            Self::Time(_) => None,
            Self::First => numbers.first().copied(),
            Self::Last => numbers.last().copied(),
            Self::Number(number) if numbers.contains(&number) => Some(number),
            Self::Number(number) => {
                let from_end = usize::try_from(number.checked_neg()?).ok()?;
                numbers.get(numbers.len().checked_sub(from_end)?).copied()
            }
        }
    }
}

/// Hides and refuses an option that only applies to jobs.
fn no_job(option: clap::Arg) -> clap::Arg {
    option.hide(true).conflicts_with("output")
}

const SIGNAL_MESSAGES: signals::SignalMessages =
    signals::SignalMessages { stopping: "stopping", stopped: "stopped; no image was written" };

pub(super) fn run(mut args: StillArgs) -> Result<Outcome, CliError> {
    let start = Instant::now();
    let _signals = signals::listen(SIGNAL_MESSAGES)?;
    // Check the options and open the sequence
    let shown = args
        .manifest
        .keys
        .take("output")
        .map(PathBuf::from)
        .ok_or_else(|| CliError::other("--output: is missing"))?;
    let format = format_of(&shown)?;
    let output = absolute(&shown)?;
    let mut requested = args.manifest.manifest()?;
    let mode = requested.manifest.job.progress;
    if mode == ProgressMode::Json {
        events::start();
    }
    use_threads(requested.manifest.job.threads)?;
    if format == PictureFormat::Jpeg && requested.manifest.output.transparent {
        return Err(CliError::other(OutputError::NoAlpha.to_string()));
    }
    let mut sequence = open_sequence(&requested)?;
    for note in sequence.notes() {
        note!("{note}");
    }
    guard(&shown, &output, requested.file.as_deref(), &sequence)?;
    // Choose the frame and its settings
    let frame = frame(args.frame, &requested, &sequence)?;
    // The manifest of a job has the camera of the job
    let is_of_job = requested.manifest.look == Look::None;
    complete(&mut requested, &mut sequence, None)?;
    if !is_of_job {
        requested.manifest.show_own_frame();
    }
    requested.manifest.input.frames = FrameRange::from_frames([frame]);

    let render_job = RenderJob::new(requested, &sequence, None)?;
    message!("surveying the sequence");
    let (survey, mut setup) = render_job.survey(&sequence)?;
    for note in render_job.scene_notes()? {
        note!("{note}");
    }
    if format != PictureFormat::Exr {
        setup.picture.render.channels = Channels::COLOR;
    }
    print_summary(&sequence, &survey, &setup);
    // Render the frame
    let tasks = tasks(&render_job, &sequence, &setup, (frame, &output));
    require_one_fits(&tasks)?;
    let task = tasks.first().expect("the frame is in the sequence");
    make_directory(&output)?;
    let render = &setup.picture.render;
    let pixels = u64::from(render.width) * u64::from(render.height);
    events::send(
        "start",
        json!({"command": "still", "total": 1, "output": shown.display().to_string()}),
    );
    let progress = StillProgress::new(mode, pixels);
    let show = |note| progress.above_bar(|| note!("{note}"));
    let rendered = make_image_until(&setup, &sequence, task, &progress, show);
    progress.finish();
    report(rendered, frame, &shown, start)
}

/// Prints what was rendered, or why it was not.
fn report(
    rendered: Result<FrameReport, ImageError>,
    frame: i64,
    shown: &Path,
    start: Instant,
) -> Result<Outcome, CliError> {
    match rendered {
        Ok(mut report) => {
            report.seconds.wall = start.elapsed().as_secs_f64();
            for text in sampling_notes(&report) {
                note!("{text}");
            }
            if print::is_verbose() {
                message!("{}", details(&report));
            }
            let image = shown.display().to_string();
            let facts = json!({"frame": frame, "image": image, "seconds": report.seconds, "done": 1, "total": 1});
            events::send("frame_done", facts);
            events::add_to_end(json!({"total": 1, "done": 1}));
            if !events::are_sent() {
                print::lines([format!(
                    "{image}: frame {frame}, {} particles, {:.2} s",
                    report.particles, report.seconds.wall
                )])?;
            }
            Ok(Outcome::Done)
        }
        Err(ImageError::Write(WriteError::Io { source, .. })) => Err(CliError::io(shown)(source)),
        Err(error) => {
            error!("frame {frame}: {error}");
            let reason = error.to_string();
            events::send(
                "frame_failed",
                json!({"frame": frame, "reason": reason, "done": 1, "total": 1}),
            );
            events::add_to_end(json!({"total": 1, "done": 0, "failed": [frame]}));
            Ok(Outcome::SomeFailed)
        }
    }
}

/// The task of the frame, whose image is the `output` and not one in the directory of a job.
fn tasks(
    render_job: &RenderJob,
    sequence: &Sequence,
    setup: &Setup,
    (frame, output): (i64, &Path),
) -> Vec<ImageTask> {
    let mut tasks = render_job.tasks(sequence, &[frame]);
    for task in &mut tasks {
        output.clone_into(&mut task.image);
        task.preview = None;
    }
    render_job.schedule(sequence, setup, &mut tasks);
    tasks
}

/// The file format of the extension.
fn format_of(path: &Path) -> Result<PictureFormat, CliError> {
    PictureFormat::of(path).ok_or_else(|| {
        CliError::other(format!(
            "--output {}: the name must end in .png, .exr, .jpg, .tif, .pdf or .svg; other programs convert PNG to other formats",
            path.display()
        ))
    })
}

/// The requested frame, or the middle one of those that the manifest selects. The first frame of a simulation is
/// rarely typical.
fn frame(
    choice: Option<FrameChoice>,
    requested: &JobManifest,
    sequence: &Sequence,
) -> Result<i64, CliError> {
    let Some(choice) = choice else {
        let range = requested.manifest.input.frames.as_ref();
        let frames = frames_in(sequence, range)?;
        return Ok(frames[frames.len() / 2]);
    };
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    let shown = match choice {
        FrameChoice::Number(number) => number.to_string(),
        FrameChoice::First => "first".to_owned(),
        FrameChoice::Last => "last".to_owned(),
        FrameChoice::Time(time) => return frame_at(time, sequence),
    };
    choice.among(&numbers).ok_or_else(|| {
        CliError::other(format!("--frame {shown}: is not among the frames: {}", list(&numbers)))
    })
}

/// The frame nearest to `time`.
fn frame_at(time: f64, sequence: &Sequence) -> Result<i64, CliError> {
    let failed = |why: String| CliError::other(format!("--frame t={time}: {why}"));
    let found = sequence.frame_at(time).map_err(|error| failed(error.to_string()))?;
    let (index, nearest) = found.ok_or_else(|| {
        failed("the files have no times; give the number of a frame, first or last".to_owned())
    })?;
    let number = sequence.frames()[index].number;
    note!("frame {number} is the nearest to t={time}: its time is {nearest}");
    Ok(number)
}

/// Refuses to replace anything but an image, and images that belong to the input or to a job.
fn guard(
    shown: &Path,
    output: &Path,
    manifest: Option<&Path>,
    sequence: &Sequence,
) -> Result<(), CliError> {
    let refused = |why: &str| {
        let text = format!("{}: {why}; choose another name", shown.display());
        Err(CliError::Other(text))
    };
    // Refuse an image of a job, even if it does not exist yet
    if is_planned(output)? {
        return refused("is an image of the job in that directory");
    }
    let existing = match fs::metadata(output) {
        Ok(existing) => existing,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return check_writable(shown, output);
        }
        Err(error) => return Err(CliError::io(shown)(error)),
    };
    // Refuse an input, under whatever name
    let real = output.canonicalize().map_err(CliError::io(shown))?;
    let inputs = (0..sequence.frames().len()).flat_map(|index| sequence.inputs(index));
    let is_output = |path: &Path| path.canonicalize().is_ok_and(|path| path == real);
    if inputs.chain(manifest).any(is_output) {
        return refused("is an input and would be overwritten");
    }
    // Refuse what is not an image
    if !existing.is_file() {
        return refused("is not a file");
    }
    if !is_image(output).map_err(CliError::io(shown))? {
        return refused("is not an image and would be overwritten");
    }
    Ok(())
}

/// Refuses a new file that could not be written after the render.
fn check_writable(shown: &Path, output: &Path) -> Result<(), CliError> {
    let existing = disk::nearest_existing(output);
    let is_writable = disk::check_writable(&existing);
    // The directory of the file may be missing, too, which hides that its name is too long
    let named = output.file_name().map(|name| fs::metadata(existing.join(name)));
    let name = match named {
        Some(Err(error)) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    };
    is_writable.and(name).map_err(CliError::io(shown))
}

/// Whether a job in the same directory has an output of this name.
fn is_planned(output: &Path) -> Result<bool, CliError> {
    let (Some(dir), Some(name)) = (output.parent(), output.file_name()) else {
        return Ok(false);
    };
    let Some(plan) = Job::read_plan(dir)? else {
        return Ok(false);
    };
    let mut outputs = plan.frames().iter().flat_map(|frame| &frame.outputs);
    Ok(outputs.any(|planned| {
        let planned = dir.join(planned);
        planned == output || (planned.parent() == Some(dir) && planned.file_name() == Some(name))
    }))
}

/// Whether the file has the signature of an image, or is empty.
fn is_image(path: &Path) -> io::Result<bool> {
    let mut start = Vec::new();
    File::open(path)?.take(8).read_to_end(&mut start)?;
    let is_known = IMAGE_SIGNATURES.iter().any(|known| start.starts_with(known));
    Ok(is_known || start.is_empty())
}

fn make_directory(output: &Path) -> Result<(), CliError> {
    match output.parent() {
        Some(dir) => fs::create_dir_all(dir).map_err(CliError::io(dir)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_chosen_by_number_or_place() {
        let numbers = [3, 5, 9];
        for (text, expected) in [
            ("first", Some(3)),
            ("last", Some(9)),
            ("5", Some(5)),
            ("4", None),
            ("-1", Some(9)),
            ("-3", Some(3)),
            ("-4", None),
            ("0", None),
            ("-9223372036854775808", None),
        ] {
            let choice = FrameChoice::parse(text).expect("a choice");
            assert_eq!(choice.among(&numbers), expected, "{text}");
        }
        // Numbers of frames have precedence
        assert_eq!(FrameChoice::Number(-1).among(&[-1, 0]), Some(-1));
        for invalid in ["middle", "t=", "t=nan", "t=inf", "t=1 s", "t", "0.5"] {
            let error = FrameChoice::parse(invalid).expect_err("no choice");
            assert!(error.contains("t=0.5"), "{invalid}: {error}");
        }
        assert_eq!(FrameChoice::parse("t=-1.5e-3"), Ok(FrameChoice::Time(-1.5e-3)));
    }
}
