//! The hidden command for one task of `spherule scale`: measure a cell, or convert its particles.

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::cli::{CliError, Outcome, child, print};
use crate::job::{ChildCommand, ChildResult, Crash};
use crate::scale::{Task, cell, convert};

/// Name of the command.
pub(in crate::cli) const COMMAND: &str = "scale-cell";

/// Reads the task, runs it, and prints the result or the error.
pub(in crate::cli) fn run() -> Result<Outcome, CliError> {
    let task: Task = child::read_task("scale")?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(task.threads())
        .build_global()
        .map_err(|e| CliError::other(format!("{} threads: {e}", task.threads())))?;
    let result = do_task(&task);
    let text = serde_json::to_string(&result).map_err(|e| CliError::Other(e.to_string()))?;
    print::file(&(text + "\n"))?;
    Ok(Outcome::Done)
}

/// Runs `task` in a child process.
pub(super) fn run_child<T: DeserializeOwned>(
    task: &Task,
    stop: impl Fn() -> bool,
) -> ChildResult<T> {
    match ChildCommand::own_program([COMMAND]) {
        Ok(command) => command.run(task, stop),
        Err(error) => ChildResult::Crashed(Crash::Start(error)),
    }
}

/// Runs the task. The parent reads the result as JSON: errors are text there.
fn do_task(task: &Task) -> Result<Value, String> {
    let result = match task {
        Task::Convert { request, path } => {
            convert::convert(request, path).map(serde_json::to_value)
        }
        Task::Measure { request, file } => {
            cell::measure(request, file.as_deref()).map(serde_json::to_value)
        }
    };
    result.map_err(|e| e.to_string())?.map_err(|e| e.to_string())
}
