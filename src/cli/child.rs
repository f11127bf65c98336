//! One task in a process of its own: this program again, under a hidden command.
//!
//! The task is one line on the child's standard input, which stays open: a child whose input ends has
//! lost its parent and ends itself. What came of it is one line on its standard output. The child has its own process group, so that Ctrl-C reaches the parent alone.

use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use spherule_jobs::discard_own_parts;

use super::{CliError, INTERRUPTED};

/// Between two looks at the child; short against what it does.
const INTERVAL: Duration = Duration::from_millis(2);
/// Characters of a reason; what a crash prints may be long.
const REASON: usize = 400;

/// How a child ended.
pub(super) enum Ended<T> {
    /// With a result, failures included.
    Told(T),
    /// Without one: why.
    Died(String),
    /// We have ended it because we were asked to.
    Interrupted,
}

/// Has `task` done by the hidden command `command`, unless `stop` says to end it.
pub(super) fn run<T: DeserializeOwned>(
    command: &str,
    task: &impl Serialize,
    stop: impl Fn() -> bool,
) -> Ended<T> {
    if stop() {
        return Ended::Interrupted;
    }
    let line = match serde_json::to_string(task) {
        Ok(line) => line,
        Err(e) => return Ended::Died(format!("cannot be told to a process: {e}")),
    };
    let mut child = match spawn(command) {
        Ok(child) => child,
        Err(e) => return Ended::Died(format!("cannot start a process: {e}")),
    };
    let output = reader(child.stdout.take());
    let errors = reader(child.stderr.take());
    let mut input = child.stdin.take();
    if let Some(input) = &mut input {
        // A child that is dead already tells by its status why.
        let _ = writeln!(input, "{line}");
    }
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) => {}
            Err(e) => return Ended::Died(format!("lost its process: {e}")),
        }
        if stop() {
            let _ = child.kill();
            let _ = child.wait();
            return Ended::Interrupted;
        }
        thread::sleep(INTERVAL);
    };
    drop(input);
    let text = |reader: JoinHandle<String>| reader.join().unwrap_or_default();
    let (output, errors) = (text(output), text(errors));
    match serde_json::from_str(&output) {
        Ok(told) if status.success() => Ended::Told(told),
        _ => Ended::Died(reason(status, &errors)),
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

/// The child's side: the task, after which the process ends with its parent; `whose` is the command that
/// gives such tasks.
///
/// # Errors
/// Standard input is no task.
pub(super) fn task<T: DeserializeOwned>(whose: &str) -> Result<T, CliError> {
    let mut line = String::new();
    let task = io::stdin()
        .read_line(&mut line)
        .map_err(|e| e.to_string())
        .and_then(|_| serde_json::from_str(&line).map_err(|e| e.to_string()))
        .map_err(|e| {
            CliError::other(format!(
                "standard input: no request of `spherule {whose}`, whose own command this is: {e}"
            ))
        })?;
    thread::spawn(end_with_parent);
    Ok(task)
}

/// Whoever wanted the result is gone once our input ends.
fn end_with_parent() {
    let mut rest = [0; 64];
    while io::stdin().read(&mut rest).is_ok_and(|n| n > 0) {}
    discard_own_parts();
    std::process::exit(i32::from(INTERRUPTED));
}

/// The file that this process runs, even if another has taken its name since.
fn own_program() -> io::Result<PathBuf> {
    let link = PathBuf::from("/proc/self/exe");
    if link.exists() {
        Ok(link)
    } else {
        std::env::current_exe()
    }
}

/// Reads to the end, so that the child never waits for us.
fn reader(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<String> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut bytes);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Why a child ended without a result.
fn reason(status: ExitStatus, errors: &str) -> String {
    let told: Vec<&str> = errors
        .lines()
        .map(|line| line.strip_prefix("error: ").unwrap_or(line).trim())
        .filter(|line| !line.is_empty() && !line.starts_with("note: "))
        .collect();
    let told: String = told.join("; ").chars().take(REASON).collect();
    if told.contains("memory allocation of") {
        return format!("out of memory: {told}");
    }
    let how = match signal(status) {
        Some(9) => "killed by the system, most likely for want of memory".to_owned(),
        Some(signal) => format!("ended by signal {signal}"),
        None if told.contains("panicked at") => {
            "a fault in spherule itself, please report it".to_owned()
        }
        None => status.to_string(),
    };
    if told.is_empty() {
        how
    } else {
        format!("{how}: {told}")
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
    fn reasons_are_readable() {
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
                "killed by the system, most likely for want of memory",
            ),
            (by_signal(15), "", "ended by signal 15"),
            (
                ExitStatus::from_raw(101 << 8),
                "\nthread 'main' panicked at src/x.rs:1:2:\nno such thing\nnote: run with\n",
                "a fault in spherule itself, please report it: thread 'main' panicked at \
                 src/x.rs:1:2:; no such thing",
            ),
            (
                ExitStatus::from_raw(2 << 8),
                "error: standard input: no request\n",
                "exit status: 2: standard input: no request",
            ),
        ] {
            assert_eq!(reason(status, errors), wanted);
        }
    }
}
