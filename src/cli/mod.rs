//! The command line: one thin file per command. Only this module prints and decides exit codes.
//!
//! Results go to standard output, everything else to standard error. Exit codes: 0 all done, 1 some
//! frames or files failed, 2 could not start, 75 interrupted.
use std::env;
use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use spherule_formats::escape_controls;

/// Prints a line on standard error, unless `--quiet` is given.
macro_rules! message {
    ($($text:tt)*) => {
        $crate::cli::print::message(&format!($($text)*))
    };
}

/// Prints an error on standard error, also with `--quiet`.
macro_rules! error {
    ($($text:tt)*) => {
        $crate::cli::print::error(&format!($($text)*))
    };
}

/// Prints a note on standard error and sends it as an event.
macro_rules! note {
    ($($text:tt)*) => {
        $crate::cli::events::note(&format!($($text)*))
    };
}

mod allocator;
mod camera_path;
mod check;
mod child;
mod completions;
mod convert;
mod devices;
mod disk;
mod errors;
mod events;
mod explore;
mod export;
mod generate;
mod guesses;
mod hints;
mod init;
mod inspect;
mod job;
mod key_flags;
mod man;
mod manifest_args;
mod movie;
mod numbers;
mod paths;
mod pictures;
mod print;
mod progress;
mod render;
mod scale;
mod schema;
mod sheet;
mod shortcuts;
mod signals;
mod status;
mod still;
mod still_progress;
mod style_flag;
mod verify;
mod view;

use errors::CliError;

/// Renders particle-simulation time steps to OpenEXR image sequences by ray tracing.
#[derive(Debug, Parser)]
#[command(name = "spherule", version, max_term_width = 100)]
struct Cli {
    /// Print only errors: no notes, no progress.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Print the stages, rays and memory of each picture.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render a directory, pattern or list of particle files, or a manifest, to images.
    Render(Box<render::RenderArgs>),
    /// Render a single frame to a PNG or EXR, without a job, to try settings.
    Still(Box<still::StillArgs>),
    /// Find the view and the settings on a local page with the mouse, then save or render the job.
    Explore(Box<explore::ExploreArgs>),
    /// Print what `render` would do, with memory and time. Changes nothing.
    Check(Box<check::CheckArgs>),
    /// Write a movie of the finished pictures of a job: MP4, MOV, WebM, GIF, animated PNG or WebP.
    Movie(movie::MovieArgs),
    /// Write a contact sheet of the finished pictures of a job.
    Sheet(sheet::SheetArgs),
    /// Write a page that plays the finished pictures of a job, with ids and plots.
    View(view::ViewArgs),
    /// Print the state of a job: frames done, failed, missing and running, rate and time left.
    Status(status::StatusArgs),
    /// Print a complete, commented manifest for an input.
    Init(Box<init::InitArgs>),
    /// Print the manifest's JSON schema, for editors.
    Schema,
    /// List the GPUs that can render images, with driver and self-test, or print why there is none.
    Devices,
    /// Open and decode every finished image of a job.
    Verify(verify::VerifyArgs),
    /// Print counts, bounds and attributes of particle files.
    Inspect(inspect::InspectArgs),
    /// Convert particle files to compact native frames (.spf).
    Convert(Box<convert::ConvertArgs>),
    /// Generate test particles.
    Generate(generate::GenerateArgs),
    /// Export a job to a cluster (Slurm) or a render farm (Open Job Description).
    Export(export::ExportArgs),
    /// Measure images per second, build time and memory over particle counts and structures.
    Scale(Box<scale::ScaleArgs>),
    /// Print a script with which a shell completes commands, options and file names.
    Completions(completions::CompletionsArgs),
    /// Print a manual page in roff, for `man`.
    Man(man::ManArgs),
}

/// Parses the arguments of the process, runs the command, and prints errors.
pub fn main() -> ExitCode {
    allocator::return_large_pieces();
    let arguments: Vec<OsString> = env::args_os().collect();
    let result = match hidden_command(&arguments) {
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
        error!("{error}");
    }
    events::end(code, &errors);
    ExitCode::from(code)
}

/// The commands of child processes. clap does not know them, so it neither lists nor suggests them.
fn hidden_command(arguments: &[OsString]) -> Option<fn() -> Result<Outcome, CliError>> {
    let [_, name] = arguments else {
        return None;
    };
    match name.to_str()? {
        scale::measure::COMMAND => Some(scale::measure::run),
        render::isolate::COMMAND => Some(render::isolate::run_child),
        _ => None,
    }
}

/// Parses the command. If there is none, prints help or a message and returns the exit code.
fn parse(arguments: &[OsString]) -> Result<Command, u8> {
    let arguments = key_flags::with_equals(arguments.iter().cloned());
    let error = match Cli::try_parse_from(&arguments) {
        Ok(cli) => {
            if cli.quiet {
                print::silence();
            }
            if cli.verbose {
                print::set_verbose();
            }
            return Ok(cli.command);
        }
        Err(error) => error,
    };
    if !error.use_stderr() {
        let printed = error.print().and_then(|()| std::io::stdout().flush());
        return Err(match print::written_to_stdout(printed) {
            Ok(_) => Outcome::Done.code(),
            Err(error) => {
                error!("{error}");
                Outcome::Refused.code()
            }
        });
    }
    // The message of clap quotes the arguments, so parse escaped arguments to get an escaped message
    let escaped = arguments.iter().map(|argument| {
        let text = argument.to_string_lossy();
        escape_controls(&text).into_owned()
    });
    let error = Cli::try_parse_from(escaped).err().unwrap_or(error);
    let name = arguments.get(1).and_then(|name| name.to_str());
    let error = hints::with_hints(error, name.unwrap_or_default(), &Cli::command());
    for line in error.render().to_string().lines() {
        message!("{line}");
    }
    Err(Outcome::Refused.code())
}

fn run(command: Command) -> Result<Outcome, CliError> {
    match command {
        Command::Render(args) => render::run(&args),
        Command::Still(args) => still::run(*args),
        Command::Explore(args) => explore::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Movie(args) => movie::run(&args),
        Command::Sheet(args) => sheet::run(&args),
        Command::View(args) => view::run(&args),
        Command::Status(args) => status::run(&args),
        Command::Init(args) => init::run(&args),
        Command::Schema => schema::run(),
        Command::Devices => devices::run(),
        Command::Verify(args) => verify::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Generate(args) => generate::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Scale(args) => scale::run(&args),
        Command::Completions(args) => completions::run(&args),
        Command::Man(args) => man::run(&args),
    }
}

/// The result of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// Everything is done.
    Done,
    /// Some frames or files failed; they were printed.
    SomeFailed,
    /// The command could not start; the reason was printed.
    Refused,
    /// Stopped by a signal; the same command continues.
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

/// `EX_TEMPFAIL`: queueing systems retry after it.
const INTERRUPTED: u8 = 75;
