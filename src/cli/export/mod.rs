//! `spherule export`: a job as work for a cluster or a render farm, whose tasks only ever call
//! `spherule render job.toml --frames RANGE`.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use spherule_jobs::export::{Chunks, ExportError};
use spherule_jobs::{Mode, publish};

use super::job::{Asked, is_manifest, read_manifest};
use super::paths::absolute;
use super::plan::Plan;
use super::{CliError, Outcome, print};
use crate::manifest::{Manifest, Override, named_place};
use crate::metrics::Bytes;

mod openjd;
mod place;
mod slurm;

use place::{common_dir, text, tidy};

const EXAMPLES: &str = "\
Examples:
  spherule export slurm job.toml -o job.sh --cpus 16 --time 02:00:00
      A script for sbatch
  spherule export slurm job.toml --chunk 10 --concurrent 20
      The script on standard output: ten frames a task, twenty tasks at once
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
    /// A script for sbatch: an array of tasks, each with some of the frames.
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

/// The grace period of a task that is told to stop `ahead` seconds before it is killed: a tenth is left to record
/// what was done.
fn grace(ahead: u64) -> String {
    (ahead * 9 / 10).to_string()
}

/// What all engines are told.
#[derive(Debug, Args)]
struct CommonArgs {
    /// A manifest: your own, or the job.toml beside the images.
    #[arg(value_name = "JOB.TOML")]
    manifest: PathBuf,
    /// Where the text goes [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Frames to render: 7 | 1-10 | 1-10x2 | 1-5,8 [default: those of the manifest]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    frames: Option<String>,
    /// Frames a task does [default: as many as make about a hundred tasks]
    ///
    /// Five to thirty minutes a task suit most clusters.
    #[arg(long, value_name = "N")]
    chunk: Option<NonZeroUsize>,
    /// Memory for a task: 4GiB, 512MiB.
    #[arg(long, value_name = "SIZE", value_parser = memory)]
    mem: Option<Bytes>,
}

/// The least that a task can work with; less is a unit forgotten.
const LEAST_MEMORY: Bytes = Bytes(16 << 20);

fn memory(text: &str) -> Result<Bytes, String> {
    let size: Bytes = text.parse()?;
    if size < LEAST_MEMORY {
        return Err(format!(
            "{size} is less than {LEAST_MEMORY}; write the unit, as in 4GiB"
        ));
    }
    Ok(size)
}

/// A job that is to be exported.
struct Work {
    /// Absolute.
    manifest_file: PathBuf,
    /// What the engine's own name for it can be.
    name: String,
    /// Absolute.
    program: PathBuf,
    /// Absolute.
    out_dir: PathBuf,
    /// The directory that all inputs are in, unless that is the whole disk.
    input_dir: Option<PathBuf>,
    /// Names of the images, with room for the number.
    image_name: String,
    frames: Vec<i64>,
    chunks: Chunks,
    /// The manifest's own limit.
    memory_limit: Option<Bytes>,
}

impl Work {
    /// Reads the manifest, finds the frames, and refuses what `render` would refuse.
    fn read(args: &CommonArgs, most_tasks: NonZeroUsize) -> Result<Self, CliError> {
        let asked = asked(args)?;
        let sequence = asked.sequence()?;
        for note in sequence.notes() {
            note!("{note}");
        }
        let inputs = (0..sequence.frames().len()).flat_map(|index| sequence.inputs(index));
        let inputs: Vec<PathBuf> = inputs.map(absolute).collect::<Result<_, _>>()?;
        let out = asked
            .absolute_base()?
            .join(asked.manifest.output.path.dir());
        let plan = Plan::new(asked, &sequence, None)?;
        plan.guard_directory(Mode::Resume)?;
        plan.guard_manifest()?;
        let frames = plan.selected(&sequence);
        let chunks = Chunks::of(&frames, args.chunk, most_tasks)?;
        let manifest_file = absolute(&args.manifest)?;
        let manifest_file = match (manifest_file.parent(), manifest_file.file_name()) {
            (Some(dir), Some(name)) => tidy(dir).join(name),
            _ => manifest_file,
        };
        Ok(Self {
            name: place::job_name(&manifest_file),
            program: std::env::current_exe().map_err(CliError::io(Path::new("spherule")))?,
            out_dir: tidy(&out),
            input_dir: common_dir(&inputs),
            image_name: plan.manifest.output.path.file_name().to_owned(),
            memory_limit: plan.manifest.render.memory_limit,
            manifest_file,
            frames,
            chunks,
        })
    }

    /// For people: which frames of what.
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

/// The manifest with its frames: all else is read by each task from the file itself.
fn asked(args: &CommonArgs) -> Result<Asked, CliError> {
    let path = &args.manifest;
    if !is_manifest(path) {
        return Err(CliError::other(format!(
            "{}: is no manifest (.toml), which each task is to read; `spherule init {0} > job.toml` \
             writes one",
            path.display()
        )));
    }
    let content = read_manifest(path)?;
    let frames = args.frames.as_ref().map(|range| {
        Override::new("input.frames", range.clone(), "--frames").map_err(CliError::Other)
    });
    let overrides = frames.transpose()?.into_iter().collect();
    let (manifest, warnings) = Manifest::parse_with_warnings(&content, path, overrides)?;
    for warning in warnings {
        note!("{warning}");
    }
    Ok(Asked {
        manifest,
        base: path.parent().map_or_else(PathBuf::new, Path::to_owned),
        file: Some(path.clone()),
        unchanged: Manifest::parse(&content, path).ok(),
    })
}

/// Writes `text` where it was asked for.
fn deliver(args: &CommonArgs, content: &str) -> Result<(), CliError> {
    let Some(path) = &args.output else {
        print::file(content)?;
        return Ok(());
    };
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

impl From<ExportError> for CliError {
    fn from(error: ExportError) -> Self {
        Self::Other(error.to_string())
    }
}
