//! `spherule completions`: scripts for shells, generated from the command line itself.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, CliError, Outcome, print};

const EXAMPLES: &str = "\
Examples:
  spherule completions bash > ~/.local/share/bash-completion/completions/spherule
      bash, with the package bash-completion
  spherule completions zsh > ~/.zfunc/_spherule
      zsh, if fpath contains ~/.zfunc before compinit runs
  spherule completions fish > ~/.config/fish/completions/spherule.fish
      fish";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CompletionsArgs {
    /// The shell.
    shell: Shell,
}

pub(super) fn run(args: &CompletionsArgs) -> Result<Outcome, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "spherule", &mut script);
    print::file(&String::from_utf8_lossy(&script))?;
    Ok(Outcome::Done)
}
