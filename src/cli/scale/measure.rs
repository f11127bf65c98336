//! The hidden command that does one task of `spherule scale`: it measures a cell, or makes its particles.

use serde_json::Value;

use crate::cli::{CliError, Outcome, child, print};
use crate::scale::{Task, cell, convert};

/// Its name.
pub(in crate::cli) const COMMAND: &str = "scale-cell";

/// Reads the task, does it, prints what came of it or why nothing did.
pub(in crate::cli) fn run() -> Result<Outcome, CliError> {
    let task: Task = child::read_task("scale")?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(task.threads())
        .build_global()
        .map_err(|e| CliError::other(format!("{} threads: {e}", task.threads())))?;
    let told = do_task(&task);
    let text = serde_json::to_string(&told).map_err(|e| CliError::Other(e.to_string()))?;
    print::file(&(text + "\n"))?;
    Ok(Outcome::Done)
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
    result
        .map_err(|e| e.to_string())?
        .map_err(|e| e.to_string())
}
