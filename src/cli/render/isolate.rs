//! The hidden command of `--isolate`: renders one frame in a child process.

use crate::cli::job::use_threads;
use crate::cli::{CliError, Outcome, child, print};
use crate::job::RunError;
use crate::job::isolate::{IsolatedTask, render_task};

/// The name of the command.
pub(in crate::cli) const COMMAND: &str = "render-frame";

pub(in crate::cli) fn run_child() -> Result<Outcome, CliError> {
    let task: IsolatedTask = child::read_task("render --isolate")?;
    use_threads(task.threads)?;
    let result = render_task(task)?;
    let text = serde_json::to_string(&result).map_err(RunError::Json)?;
    print::file(&(text + "\n"))?;
    Ok(Outcome::Done)
}
