//! The command line: one thin file per command. Only this room prints and decides exit codes.
//!
//! Results go to standard output, everything else to standard error. Exit codes: 0 all done, 1 some
//! frames or files failed, 2 could not start, 75 interrupted and to be resumed.
use std::env;
use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use spherule_formats::escape_controls;

/// A line on standard error.
macro_rules! say {
    ($($text:tt)*) => {
        $crate::cli::print::message(&format!($($text)*))
    };
}

/// What a user should know of, on standard error; also an event for programs.
macro_rules! note {
    ($($text:tt)*) => {
        $crate::cli::events::note(&format!($($text)*))
    };
}

mod allocator;
mod check;
mod child;
mod convert;
mod disk;
mod errors;
mod events;
mod export;
mod generate;
mod init;
mod inspect;
mod job;
mod key_flags;
mod numbers;
mod paths;
mod plan;
mod print;
mod progress;
mod render;
mod scale;
mod schema;
mod shard;
mod signals;
mod status;
mod still;
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
    /// Render one picture of one frame, PNG or EXR, without a job: for trying looks.
    Still(Box<still::StillArgs>),
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
}

/// Parses the arguments of the process, runs the command, reports what went wrong.
pub fn main() -> ExitCode {
    allocator::return_large_pieces();
    let arguments: Vec<OsString> = env::args_os().collect();
    let result = match own_command(&arguments) {
        Some(command) => command(),
        None => match parse(&arguments) {
            Ok(command) => run(command),
            Err(code) => return ExitCode::from(code),
        },
    };
    let (code, errors) = match result {
        Ok(outcome) => (outcome.code(), Vec::new()),
        Err(error) => (Outcome::Refused.code(), error.messages()),
    };
    for error in &errors {
        say!("error: {error}");
    }
    events::end(code, &errors);
    ExitCode::from(code)
}

/// The commands that this program gives to processes of its own. clap does not know them, so it neither lists nor
/// suggests them.
fn own_command(arguments: &[OsString]) -> Option<fn() -> Result<Outcome, CliError>> {
    let [_, name] = arguments else {
        return None;
    };
    match name.to_str()? {
        scale::measure::COMMAND => Some(scale::measure::run),
        render::isolate::COMMAND => Some(render::isolate::run_child),
        _ => None,
    }
}

/// The command of the process; without one, help or a message has been printed, and this is the exit code.
fn parse(arguments: &[OsString]) -> Result<Command, u8> {
    let error = match Cli::try_parse_from(arguments) {
        Ok(cli) => return Ok(cli.command),
        Err(error) => error,
    };
    if !error.use_stderr() {
        let printed = error.print().and_then(|()| std::io::stdout().flush());
        return Err(match print::written_to_stdout(printed) {
            Ok(_) => Outcome::Done.code(),
            Err(error) => {
                say!("error: {error}");
                Outcome::Refused.code()
            }
        });
    }
    // clap's message has several lines, and quotes the arguments as they are: so it is made again of escaped ones.
    let escaped = arguments.iter().map(|argument| {
        let text = argument.to_string_lossy();
        escape_controls(&text).into_owned()
    });
    let error = Cli::try_parse_from(escaped).err().unwrap_or(error);
    for line in error.render().to_string().lines() {
        say!("{line}");
    }
    Err(Outcome::Refused.code())
}

fn run(command: Command) -> Result<Outcome, CliError> {
    match command {
        Command::Render(args) => render::run(&args),
        Command::Still(args) => still::run(*args),
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

impl Outcome {
    /// The exit code.
    const fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::SomeFailed => 1,
            Self::Refused => 2,
            Self::Interrupted => INTERRUPTED,
        }
    }
}

/// `EX_TEMPFAIL`: queueing systems take it as "try again".
const INTERRUPTED: u8 = 75;
