//! `spherule still`: renders a single frame to try settings. No job: no plan, ledger, manifest or report.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use spherule_formats::Sequence;
use spherule_jobs::{FrameRange, Job};

use super::job::{list, use_threads};
use super::manifest_args::ManifestArgs;
use super::paths::absolute;
use super::render::print_summary;
use super::{CliError, Outcome, print, signals};
use crate::job::{JobManifest, RenderJob, frames_in, require_one_fits};
use crate::pipeline::{ImageError, PictureKind, WriteError, make_picture};
use crate::render::Channels;

/// Signatures of the files that `still` may replace: OpenEXR and PNG.
const IMAGE_SIGNATURES: [&[u8]; 2] = [b"\x76\x2f\x31\x01", b"\x89PNG\r\n\x1a\n"];

const OUTPUT_HELP: &str = "Image to write: look.png or look.exr; an existing image is replaced";

const EXAMPLES: &str = "Examples:
  spherule still dump -o look.png
  spherule still dump --frame 120 --color-by velocity --map turbo -o look.png
  spherule still out/job.toml --set material.transmission=1 --width 960 --height 540 -o glass.exr";

#[derive(Debug, Args)]
#[command(
    after_help = EXAMPLES,
    mut_arg("output", |a| a.required(true).value_name("FILE").help(OUTPUT_HELP).long_help(OUTPUT_HELP)),
    mut_arg("frames", no_job),
    mut_arg("progress", no_job),
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
    /// Number of the frame to render [default: the middle one]
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true)]
    frame: Option<i64>,
}

/// Hides and refuses an option that only applies to jobs.
fn no_job(option: clap::Arg) -> clap::Arg {
    option.hide(true).conflicts_with("output")
}

const SIGNAL_MESSAGES: signals::SignalMessages = signals::SignalMessages {
    stopping: "stopping",
    stopped: "stopped; no image was written",
};

pub(super) fn run(mut args: StillArgs) -> Result<Outcome, CliError> {
    let start = Instant::now();
    let _signals = signals::listen(SIGNAL_MESSAGES)?;
    let shown = args.manifest.keys.take("output").map(PathBuf::from);
    let shown = shown.ok_or_else(|| CliError::other("--output: is missing"))?;
    let kind = kind(&shown)?;
    let output = absolute(&shown)?;
    let mut requested = args.manifest.manifest()?;
    use_threads(requested.manifest.job.threads)?;
    let sequence = requested.open_sequence()?;
    for note in sequence.notes() {
        note!("{note}");
    }
    guard(&shown, &output, requested.file.as_deref(), &sequence)?;
    let frame = frame(args.frame, &requested, &sequence)?;
    requested.manifest.input.frames = FrameRange::from_frames([frame]);

    let render_job = RenderJob::new(requested, &sequence, None)?;
    message!("surveying the sequence");
    let (survey, mut setup) = render_job.survey(&sequence)?;
    for note in render_job.scene_notes()? {
        note!("{note}");
    }
    if kind == PictureKind::Png {
        setup.picture.render.channels = Channels::COLOR;
    }
    print_summary(&sequence, &survey, &setup);
    let mut tasks = render_job.tasks(&sequence, &[frame]);
    for task in &mut tasks {
        task.image.clone_from(&output);
        task.preview = None;
    }
    render_job.schedule(&sequence, &setup, &mut tasks);
    require_one_fits(&tasks)?;
    let task = tasks.first().expect("the frame is in the sequence");
    make_directory(&output)?;
    let rendered = make_picture(&setup, &sequence, task, kind, |note| note!("{note}"));
    match rendered {
        Ok(report) => {
            print::lines([format!(
                "{}: frame {frame}, {} particles, {:.2} s",
                shown.display(),
                report.particles,
                start.elapsed().as_secs_f64()
            )])?;
            Ok(Outcome::Done)
        }
        Err(ImageError::Write(WriteError::Io { source, .. })) => Err(CliError::io(&shown)(source)),
        Err(error) => {
            message!("error: frame {frame}: {error}");
            Ok(Outcome::SomeFailed)
        }
    }
}

/// The file format of the extension.
fn kind(path: &Path) -> Result<PictureKind, CliError> {
    let extension = path.extension().map(OsStr::to_ascii_lowercase);
    match extension.as_ref().and_then(|e| e.to_str()) {
        Some("exr") => Ok(PictureKind::Exr),
        Some("png") => Ok(PictureKind::Png),
        _ => Err(CliError::other(format!(
            "--output {}: the name must end in .png or .exr",
            path.display()
        ))),
    }
}

/// The requested frame, or the middle one of those that the manifest selects. The first frame of a simulation is
/// rarely typical.
fn frame(
    number: Option<i64>,
    requested: &JobManifest,
    sequence: &Sequence,
) -> Result<i64, CliError> {
    let Some(number) = number else {
        let range = requested.manifest.input.frames.as_ref();
        let frames = frames_in(sequence, range)?;
        return Ok(frames[frames.len() / 2]);
    };
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    if numbers.contains(&number) {
        return Ok(number);
    }
    Err(CliError::other(format!(
        "--frame {number}: is not among the frames: {}",
        list(&numbers)
    )))
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
    if is_planned(output)? {
        return refused("is an image of the job in that directory");
    }
    let Ok(existing) = fs::metadata(output) else {
        return Ok(());
    };
    let real = output.canonicalize().map_err(CliError::io(shown))?;
    let inputs = (0..sequence.frames().len()).flat_map(|index| sequence.inputs(index));
    let is_output = |path: &Path| path.canonicalize().is_ok_and(|path| path == real);
    if inputs.chain(manifest).any(is_output) {
        return refused("is an input and would be overwritten");
    }
    if !existing.is_file() {
        return refused("is not a file");
    }
    if !is_image(output).map_err(CliError::io(shown))? {
        return refused("is not an image and would be overwritten");
    }
    Ok(())
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
    let is_known = IMAGE_SIGNATURES
        .iter()
        .any(|known| start.starts_with(known));
    Ok(is_known || start.is_empty())
}

fn make_directory(output: &Path) -> Result<(), CliError> {
    match output.parent() {
        Some(dir) => fs::create_dir_all(dir).map_err(CliError::io(dir)),
        None => Ok(()),
    }
}
