//! The child side of tasks in child processes: commands of this program that users do not call.

use std::io::{self, Read};
use std::thread;

use serde::de::DeserializeOwned;
use spherule_jobs::discard_own_parts;

use super::CliError;
use super::signals::exit_at_once;

/// Reads the task. From then on the process ends with its parent. `parent_command` is the
/// command that creates such tasks.
///
/// # Errors
/// Standard input does not contain a task.
pub(super) fn read_task<T: DeserializeOwned>(parent_command: &str) -> Result<T, CliError> {
    let mut line = String::new();
    let task = io::stdin()
        .read_line(&mut line)
        .map_err(|e| e.to_string())
        .and_then(|_| serde_json::from_str(&line).map_err(|e| e.to_string()))
        .map_err(|e| {
            CliError::other(format!(
                "standard input: not a task of `spherule {parent_command}`, which uses this command internally: {e}"
            ))
        })?;
    thread::spawn(exit_with_parent);
    Ok(task)
}

/// Exits when standard input is closed: the parent has ended.
fn exit_with_parent() {
    let mut rest = [0; 64];
    while io::stdin().read(&mut rest).is_ok_and(|n| n > 0) {}
    discard_own_parts();
    exit_at_once();
}
