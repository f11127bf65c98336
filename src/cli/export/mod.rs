//! `spherule export`: writes a job for a cluster or a render farm. Its tasks run `spherule render job.toml --frames
//! RANGE`.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use spherule_files::Bytes;
use spherule_formats::ValueError;
use spherule_jobs::export::Chunks;
use spherule_jobs::{ResumeMode, publish};

use super::manifest_args::{is_manifest, open_sequence, read_manifest};
use super::paths::absolute;
use super::{CliError, Outcome, print};
use crate::job::{JobManifest, RenderJob};
use crate::manifest::{Manifest, Override, named_place};

mod openjd;
mod paths;
mod slurm;

use paths::{common_dir, normalized, text};

const EXAMPLES: &str = "\
Examples:
  spherule export slurm job.toml -o job.sh --cpus 16 --time 02:00:00
      A script for sbatch
  spherule export slurm job.toml --chunk 10 --concurrent 20
      The script on standard output: ten frames per task, twenty tasks at once
  spherule export openjd job.toml -o job.template.yaml
      A job template for a render farm";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ExportArgs {
    #[command(subcommand)]
    engine: Engine,
}

#[derive(Debug, Subcommand)]
enum Engine {
    /// A script for sbatch: a job array whose tasks each render a part of the frames.
    Slurm(slurm::SlurmArgs),
    /// A job template of Open Job Description, for AWS Deadline Cloud and `openjd run`.
    Openjd(openjd::OpenjdArgs),
}

pub(super) fn run(args: &ExportArgs) -> Result<Outcome, CliError> {
    match &args.engine {
        Engine::Slurm(args) => slurm::run(args),
        Engine::Openjd(args) => openjd::run(args),
    }
}

/// The grace period of a task that is asked to stop `ahead` seconds before it is killed. A tenth is reserved for
/// recording.
fn grace(ahead: u64) -> String {
    (ahead * 9 / 10).to_string()
}

/// Arguments of all engines.
#[derive(Debug, Args)]
struct CommonArgs {
    /// A manifest: your own, or the job.toml next to the images.
    #[arg(value_name = "JOB.TOML")]
    manifest: PathBuf,
    /// Output file [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Frames to render: 7 | 1-10 | 1-10x2 | 1-5,8 [default: those of the manifest]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    frames: Option<String>,
    /// Frames per task [default: about a hundred tasks]
    ///
    /// Five to thirty minutes per task suit most clusters.
    #[arg(long, value_name = "N")]
    chunk: Option<NonZeroUsize>,
    /// Memory per task: 4GiB, 512MiB.
    #[arg(long, value_name = "SIZE", value_parser = memory)]
    mem: Option<Bytes>,
}

/// Smallest memory that is accepted. A smaller value probably lacks its unit.
const MIN_MEMORY: Bytes = Bytes(16 << 20);

fn memory(text: &str) -> Result<Bytes, ValueError> {
    let size: Bytes = text.parse()?;
    if size < MIN_MEMORY {
        let expected = format!("at least {MIN_MEMORY}, with a unit, such as 4GiB");
        return Err(ValueError::new(expected, text));
    }
    Ok(size)
}

/// A job to export.
struct ExportJob {
    /// Absolute.
    manifest_file: PathBuf,
    /// Name of the job in the queue.
    name: String,
    /// Absolute.
    program: PathBuf,
    /// Absolute.
    out_dir: PathBuf,
    /// The common directory of all inputs, unless it is the root.
    input_dir: Option<PathBuf>,
    /// File name of the images, with a pattern for the number.
    image_name: String,
    frames: Vec<i64>,
    chunks: Chunks,
    /// Memory limit of the manifest.
    memory_limit: Option<Bytes>,
}

impl ExportJob {
    /// Reads the manifest, finds the frames, and refuses what `render` would refuse.
    fn read(args: &CommonArgs, max_tasks: NonZeroUsize) -> Result<Self, CliError> {
        // Read the manifest, and find the files that the job reads
        let requested = requested_manifest(args)?;
        let sequence = open_sequence(&requested)?;
        for note in sequence.notes() {
            note!("{note}");
        }
        let inputs = (0..sequence.frames().len()).flat_map(|index| sequence.inputs(index));
        let lists = sequence.list_paths().iter().map(PathBuf::as_path);
        let inputs: Vec<PathBuf> = inputs.chain(lists).map(absolute).collect::<Result<_, _>>()?;
        // Refuse what would fail on every host
        let out = requested.absolute_base()?.join(requested.manifest.output.path.dir());
        let render_job = RenderJob::new(requested, &sequence, None)?;
        render_job.check_output_dir(ResumeMode::Resume)?;
        render_job.check_manifest_file()?;
        // Divide the frames
        let frames = render_job.selected(&sequence);
        let chunks = Chunks::of(&frames, args.chunk, max_tasks)?;
        // The name of the manifest stays as it is, in a directory without links and dots
        let given = absolute(&args.manifest)?;
        let manifest_file = match (given.parent(), given.file_name()) {
            (Some(dir), Some(name)) => normalized(dir).join(name),
            _ => given,
        };
        Ok(Self {
            name: paths::job_name(&manifest_file),
            program: std::env::current_exe().map_err(CliError::io(Path::new("spherule")))?,
            out_dir: normalized(&out),
            input_dir: common_dir(&inputs),
            image_name: render_job.manifest().output.path.file_name().to_owned(),
            memory_limit: render_job.manifest().render.memory_limit,
            manifest_file,
            frames,
            chunks,
        })
    }

    /// Description: the frames and the manifest.
    fn title(&self) -> String {
        let first = self.frames.iter().min().copied().unwrap_or_default();
        let last = self.frames.iter().max().copied().unwrap_or_default();
        let frames = match self.frames.len() {
            1 => format!("frame {first}"),
            count => format!("{count} frames, {first} to {last},"),
        };
        format!("Renders {frames} of {}", self.manifest_file.display())
    }
}

/// The manifest with its frames. Each task reads everything else from the file.
fn requested_manifest(args: &CommonArgs) -> Result<JobManifest, CliError> {
    let path = &args.manifest;
    if !is_manifest(path) {
        return Err(CliError::other(format!(
            "{}: is not a manifest (.toml), which each task reads; `spherule init {0} > job.toml` \
             writes one",
            path.display()
        )));
    }
    // Apply the frames only: tasks read the file without other options
    let content = read_manifest(path)?;
    let frames = args.frames.as_ref().map(|range| {
        Override::new("input.frames", range.clone(), "--frames")
            .map_err(|e| CliError::other(e.to_string()))
    });
    let overrides = frames.transpose()?.into_iter().collect();
    let (manifest, warnings) = Manifest::parse_with_warnings(&content, path, overrides)?;
    for warning in warnings {
        note!("{warning}");
    }
    Ok(JobManifest {
        manifest,
        base: path.parent().map_or_else(PathBuf::new, Path::to_owned),
        file: Some(path.clone()),
        unchanged: Manifest::parse(&content, path).ok(),
        source: None,
    })
}

/// Writes the text to the output.
fn write_output(args: &CommonArgs, content: &str) -> Result<(), CliError> {
    let Some(path) = &args.output else {
        print::file(content)?;
        return Ok(());
    };
    // Refuse to replace a manifest
    let same = |a: &Path, b: &Path| -> Result<bool, CliError> {
        Ok(named_place(&absolute(a)?) == named_place(&absolute(b)?))
    };
    if same(path, &args.manifest)? {
        return Err(CliError::other(format!(
            "{}: is the manifest itself; choose another --output",
            path.display()
        )));
    }
    if is_manifest(path) && path.exists() {
        return Err(CliError::other(format!(
            "{}: is a manifest already; choose another --output",
            path.display()
        )));
    }
    publish(path, content.as_bytes()).map_err(CliError::io(path))
}
