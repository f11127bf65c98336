//! Runs one task in a child process: this program with a hidden command.
//!
//! The task is one line on the child's standard input, which stays open. If it is closed, the parent has ended and
//! the child exits. The result is one line on its standard output. The child has its own process group, so that
//! Ctrl-C reaches only the parent.

use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use spherule_jobs::discard_own_parts;

use super::{CliError, INTERRUPTED};

/// Time between checks of the child; short compared with a task.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Longest reason, characters. A crash may print a lot.
const MAX_REASON: usize = 400;

/// The result of a child process.
pub(super) enum ChildResult<T> {
    /// It printed a result, which may be a failure.
    Completed(T),
    /// It ended without a result: why.
    Crashed(Crash),
    /// It was killed because of an interrupt.
    Interrupted,
}

/// Why a child process has no result.
#[derive(Debug, thiserror::Error)]
pub(super) enum Crash {
    /// The task cannot be serialised.
    #[error("cannot serialise the task: {0}")]
    Serialize(#[from] serde_json::Error),
    /// The process cannot be started.
    #[error("cannot start a process: {0}")]
    Start(#[source] io::Error),
    /// The state of the process is unknown.
    #[error("lost the process: {0}")]
    Lost(#[source] io::Error),
    /// The process ended without a result: how, and what it printed.
    #[error("the process died: {0}")]
    Died(String),
}

/// Runs `task` in a child process with the hidden command `command`. Kills the child if `stop` returns true.
pub(super) fn run<T: DeserializeOwned>(
    command: &str,
    task: &impl Serialize,
    stop: impl Fn() -> bool,
) -> ChildResult<T> {
    if stop() {
        return ChildResult::Interrupted;
    }
    let line = match serde_json::to_string(task) {
        Ok(line) => line,
        Err(e) => return ChildResult::Crashed(e.into()),
    };
    let mut child = match spawn(command) {
        Ok(child) => child,
        Err(e) => return ChildResult::Crashed(Crash::Start(e)),
    };
    let output = reader(child.stdout.take());
    let errors = reader(child.stderr.take());
    let mut input = child.stdin.take();
    if let Some(input) = &mut input {
        // If the child is dead already, its status says why
        let _ = writeln!(input, "{line}");
    }
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) => {}
            Err(e) => return ChildResult::Crashed(Crash::Lost(e)),
        }
        if stop() {
            let _ = child.kill();
            let _ = child.wait();
            return ChildResult::Interrupted;
        }
        thread::sleep(POLL_INTERVAL);
    };
    drop(input);
    let text = |reader: JoinHandle<String>| reader.join().unwrap_or_default();
    let (output, errors) = (text(output), text(errors));
    match serde_json::from_str(&output) {
        Ok(result) if status.success() => ChildResult::Completed(result),
        _ => ChildResult::Crashed(Crash::Died(reason(status, &errors))),
    }
}

fn spawn(name: &str) -> io::Result<Child> {
    let mut command = Command::new(own_program()?);
    command
        .arg(name)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command.spawn()
}

/// Called in the child: reads the task. From then on the process ends with its parent. `parent_command` is the
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
    std::process::exit(i32::from(INTERRUPTED));
}

/// The executable of this process, even if the file was replaced meanwhile.
fn own_program() -> io::Result<PathBuf> {
    let link = PathBuf::from("/proc/self/exe");
    if link.exists() {
        Ok(link)
    } else {
        std::env::current_exe()
    }
}

/// Reads a pipe to its end in a thread, so that the child never blocks.
fn reader(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<String> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut bytes);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Why the child ended without a result.
fn reason(status: ExitStatus, errors: &str) -> String {
    let lines: Vec<&str> = errors
        .lines()
        .map(|line| line.strip_prefix("error: ").unwrap_or(line).trim())
        .filter(|line| !line.is_empty() && !line.starts_with("note: "))
        .collect();
    let text: String = lines.join("; ").chars().take(MAX_REASON).collect();
    if text.contains("memory allocation of") {
        return format!("out of memory: {text}");
    }
    let how = match signal(status) {
        Some(9) => "killed by the system, probably because memory ran out".to_owned(),
        Some(signal) => format!("ended by signal {signal}"),
        None if text.contains("panicked at") => "a bug in spherule, please report it".to_owned(),
        None => status.to_string(),
    };
    if text.is_empty() {
        how
    } else {
        format!("{how}: {text}")
    }
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

#[cfg(not(unix))]
fn signal(_: ExitStatus) -> Option<i32> {
    None
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    #[test]
    fn reasons() {
        let by_signal = |n| ExitStatus::from_raw(n);
        for (status, errors, wanted) in [
            (
                by_signal(6),
                "memory allocation of 48000000000 bytes failed\n",
                "out of memory: memory allocation of 48000000000 bytes failed",
            ),
            (
                by_signal(9),
                "",
                "killed by the system, probably because memory ran out",
            ),
            (by_signal(15), "", "ended by signal 15"),
            (
                ExitStatus::from_raw(101 << 8),
                "\nthread 'main' panicked at src/x.rs:1:2:\nno such thing\nnote: run with\n",
                "a bug in spherule, please report it: thread 'main' panicked at \
                 src/x.rs:1:2:; no such thing",
            ),
            (
                ExitStatus::from_raw(2 << 8),
                "error: standard input: not a task\n",
                "exit status: 2: standard input: not a task",
            ),
        ] {
            assert_eq!(reason(status, errors), wanted);
        }
    }
}
