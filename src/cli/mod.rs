//! The command line: one thin file per command. Only this room prints and decides exit codes.
//!
//! Results go to standard output, everything else to standard error. Exit codes: 0 all done, 1 some
//! frames or files failed, 2 could not start, 75 interrupted and to be resumed.
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// A line on standard error. A reader that has gone away, or a log on a full disk, is no reason to
/// stop work.
macro_rules! say {
    ($($text:tt)*) => {
        $crate::cli::put(&mut std::io::stderr(), &format!($($text)*))
    };
}

mod check;
mod child;
mod convert;
mod disk;
mod errors;
mod export;
mod generate;
mod init;
mod inspect;
mod job;
mod job_args;
mod numbers;
mod plan;
mod progress;
mod render;
mod scale;
mod schema;
mod shard;
mod signals;
mod status;
mod verify;
mod work;

use errors::CliError;

/// Renders particle-simulation time steps to OpenEXR image sequences by CPU ray tracing.
#[derive(Debug, Parser)]
#[command(name = "spherule", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render a directory, pattern or list of particle files, or a manifest, to images.
    Render(Box<render::RenderArgs>),
    /// Tell what `render` would do, in what memory and time; touch nothing.
    Check(Box<check::CheckArgs>),
    /// Tell how a job stands: frames done, failed, missing and running, rate and time left.
    Status(status::StatusArgs),
    /// Print a complete, commented manifest for an input.
    Init(Box<init::InitArgs>),
    /// Print the manifest's JSON schema, for editors.
    Schema,
    /// Open and decode every finished image of a job.
    Verify(verify::VerifyArgs),
    /// Print counts, bounds and attributes of particle files.
    Inspect(inspect::InspectArgs),
    /// Convert particle files to compact native frames (.spf).
    Convert(Box<convert::ConvertArgs>),
    /// Make particles to measure with.
    Generate(generate::GenerateArgs),
    /// Write a job as work for a cluster (Slurm) or a render farm (Open Job Description).
    Export(export::ExportArgs),
    /// Measure images per second, build time and memory over particle counts and structures.
    Scale(Box<scale::ScaleArgs>),
    /// Measure one cell for `scale`.
    #[command(hide = true)]
    ScaleCell,
    /// Make one image for `render --isolate`.
    #[command(hide = true)]
    RenderFrame,
}

/// Writes a line, as one piece so that lines of several threads or processes do not mix.
fn put(to: &mut impl Write, text: &str) {
    let _ = to.write_all(format!("{text}\n").as_bytes());
}

/// Puts a result on standard output. A reader that has seen enough is no fault.
fn print(text: &str) -> Result<Outcome, CliError> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CliError::io(Path::new("standard output"))(e))
        }
        _ => Ok(Outcome::Done),
    }
}

/// Parses the arguments of the process, runs the command, reports what went wrong.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Render(args) => render::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Status(args) => status::run(&args),
        Command::Init(args) => init::run(&args),
        Command::Schema => schema::run(),
        Command::Verify(args) => verify::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Generate(args) => generate::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Scale(args) => scale::run(&args),
        Command::ScaleCell => scale::measure::run(),
        Command::RenderFrame => render::isolate::run_child(),
    };
    match result {
        Ok(outcome) => outcome.into(),
        Err(error) => {
            for line in error.to_string().lines() {
                say!("error: {line}");
            }
            ExitCode::from(2)
        }
    }
}

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// Everything was done.
    Done,
    /// Some frames or files failed; they were named.
    SomeFailed,
    /// Nothing could be started; it was said why.
    Refused,
    /// Stopped by a signal; the same command goes on.
    Interrupted,
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        Self::from(match outcome {
            Outcome::Done => 0,
            Outcome::SomeFailed => 1,
            Outcome::Refused => 2,
            Outcome::Interrupted => INTERRUPTED,
        })
    }
}

/// `EX_TEMPFAIL`: queueing systems take it as "try again".
const INTERRUPTED: u8 = 75;
