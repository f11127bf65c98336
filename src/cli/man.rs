//! `spherule man`: manual pages, generated from the command line itself.

use clap::{Args, Command, CommandFactory};
use clap_mangen::Man;

use super::key_flags::KnownWords;
use super::{Cli, CliError, Outcome, print};

const EXAMPLES: &str = "\
Examples:
  spherule man > spherule.1
      The program
  spherule man render > spherule-render.1
      One command
  spherule man render | man -l -
      Shows a page at once";

/// The commands that have pages, for shells that complete them.
const COMMANDS: [&str; 19] = [
    "render",
    "still",
    "explore",
    "check",
    "movie",
    "sheet",
    "view",
    "status",
    "init",
    "schema",
    "devices",
    "verify",
    "inspect",
    "convert",
    "generate",
    "export",
    "scale",
    "completions",
    "man",
];

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ManArgs {
    /// The command that the page describes [default: the program].
    #[arg(value_parser = KnownWords(COMMANDS.to_vec()), hide_possible_values = true)]
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
    let examples = command.get_after_help().map(ToString::to_string);
    let has_commands = command.has_subcommands();
    let man = Man::new(command)
        .source(concat!("spherule ", env!("CARGO_PKG_VERSION")))
        .manual("spherule");
    let mut page = Vec::new();
    // Writing to memory does not fail
    let _ = man.render_title(&mut page);
    let _ = man.render_name_section(&mut page);
    let _ = man.render_synopsis_section(&mut page);
    let _ = man.render_description_section(&mut page);
    let _ = man.render_options_section(&mut page);
    if has_commands {
        let _ = man.render_subcommands_section(&mut page);
    }
    let mut text = String::from_utf8_lossy(&page).into_owned();
    text.push_str(EXIT_STATUS);
    if let Some(examples) = examples {
        text.push_str(&example_section(&examples));
    }
    text
}

/// The codes of all commands; the manual says which command has which.
const EXIT_STATUS: &str = ".SH \"EXIT STATUS\"
.IP 0
Everything is done.
.IP 1
Some frames or files failed.
.IP 2
The command could not start.
.IP 75
Interrupted by a signal, or not finished; the same command continues.
";

/// The examples, line by line: they are to be copied, so nothing is filled or hyphenated.
fn example_section(examples: &str) -> String {
    let mut section = ".SH EXAMPLES\n.nf\n".to_owned();
    for line in examples.lines().filter(|line| *line != "Examples:") {
        let text = line.replace('\\', "\\e").replace('-', "\\-");
        // A line that begins with a full stop or an apostrophe is a request
        section.push_str("\\&");
        section.push_str(&text);
        section.push('\n');
    }
    section + ".fi\n"
}

fn unknown(name: &str, program: &Command) -> CliError {
    let names: Vec<&str> = program.get_subcommands().map(Command::get_name).collect();
    CliError::other(format!("there is no command `{name}`; the commands are {}", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_completed() {
        let program = Cli::command();
        let names: Vec<&str> = program.get_subcommands().map(Command::get_name).collect();
        assert_eq!(names, COMMANDS);
    }

    #[test]
    fn examples_can_be_copied() {
        let section = example_section("Examples:\n  spherule still a -o b.png\n'x' \\");
        assert_eq!(
            section,
            ".SH EXAMPLES\n.nf\n\\&  spherule still a \\-o b.png\n\\&'x' \\e\n.fi\n"
        );
    }
}
