//! `spherule man`: manual pages, generated from the command line itself.

use clap::{Args, Command, CommandFactory};
use clap_mangen::Man;

use super::{Cli, CliError, Outcome, print};

const EXAMPLES: &str = "\
Examples:
  spherule man > spherule.1
      The program
  spherule man render > spherule-render.1
      One command
  spherule man render | man -l -
      Shows a page at once";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ManArgs {
    /// The command that the page describes [default: the program].
    command: Option<String>,
}

pub(super) fn run(args: &ManArgs) -> Result<Outcome, CliError> {
    let mut program = Cli::command();
    // Pages name the program before the command, and tell inherited options
    program.build();
    let described = match &args.command {
        None => &program,
        Some(name) => (program.find_subcommand(name)).ok_or_else(|| unknown(name, &program))?,
    };
    print::file(&page(described.clone()))?;
    Ok(Outcome::Done)
}

fn page(command: Command) -> String {
    let mut page = Vec::new();
    // Writing to memory does not fail
    let _ = Man::new(command).render(&mut page);
    String::from_utf8_lossy(&page).into_owned()
}

fn unknown(name: &str, program: &Command) -> CliError {
    let names: Vec<&str> = program.get_subcommands().map(Command::get_name).collect();
    CliError::other(format!(
        "there is no command `{name}`; the commands are {}",
        names.join(", ")
    ))
}
