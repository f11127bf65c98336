//! Runs tasks in child processes.
//!
//! The task is one line on the child's standard input, which stays open. If it is closed, the parent has ended and
//! the child must exit. The result is one line on its standard output. The child has its own process group, so that
//! Ctrl-C reaches only the parent.

use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Time between checks of the child; short compared with a task.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Longest reason, characters. A crash may print a lot.
const MAX_REASON: usize = 400;

/// The result of a child process.
pub enum ChildResult<T> {
    /// It printed a result, which may be a failure.
    Completed(T),
    /// It ended without a result: why.
    Crashed(Crash),
    /// It was killed because of an interrupt.
    Interrupted,
}

/// Why a child process has no result.
#[derive(Debug, thiserror::Error)]
pub enum Crash {
    /// The task cannot be serialised.
    #[error("cannot serialise the task: {0}")]
    Serialize(#[from] serde_json::Error),
    /// The process cannot be started.
    #[error("cannot start a process: {0}")]
    Start(#[source] io::Error),
    /// The state of the process is unknown.
    #[error("lost the process: {0}")]
    Lost(#[source] io::Error),
    /// The process could not allocate memory: what it printed.
    #[error("the process died: out of memory: {0}")]
    OutOfMemory(String),
    /// The process ended without a result: how, and what it printed.
    #[error("the process died: {0}")]
    Died(String),
}

/// A command that runs one task in a child process.
#[derive(Debug, Clone)]
pub struct ChildCommand {
    program: PathBuf,
    arguments: Vec<String>,
}

impl ChildCommand {
    /// The command that runs `program` with `arguments`.
    pub fn new(
        program: impl Into<PathBuf>,
        arguments: impl IntoIterator<Item = impl Into<String>>,
    ) -> Self {
        Self { program: program.into(), arguments: arguments.into_iter().map(Into::into).collect() }
    }

    /// The command that runs the executable of this process with `arguments`, even if the file is replaced meanwhile.
    ///
    /// # Errors
    /// The executable is unknown.
    pub fn own_program(arguments: impl IntoIterator<Item = impl Into<String>>) -> io::Result<Self> {
        let link = PathBuf::from("/proc/self/exe");
        let program = if link.exists() { link } else { std::env::current_exe()? };
        Ok(Self::new(program, arguments))
    }

    /// Runs `task` in a child process. Kills the child if `stop` returns true.
    pub fn run<T: DeserializeOwned>(
        &self,
        task: &impl Serialize,
        stop: impl Fn() -> bool,
    ) -> ChildResult<T> {
        if stop() {
            return ChildResult::Interrupted;
        }
        // Start the child, and give it the task
        let line = match serde_json::to_string(task) {
            Ok(line) => line,
            Err(e) => return ChildResult::Crashed(e.into()),
        };
        let mut child = match self.spawn() {
            Ok(child) => child,
            Err(e) => return ChildResult::Crashed(Crash::Start(e)),
        };
        // Read its output in threads: full pipes would block it
        let output = reader(child.stdout.take());
        let errors = reader(child.stderr.take());
        let mut input = child.stdin.take();
        if let Some(input) = &mut input {
            // If the child is dead already, its status says why
            let _ = writeln!(input, "{line}");
        }
        // Wait for its end
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
        // Read the result
        drop(input);
        let text = |reader: JoinHandle<String>| reader.join().unwrap_or_default();
        let (output, errors) = (text(output), text(errors));
        match serde_json::from_str(&output) {
            Ok(result) if status.success() => ChildResult::Completed(result),
            _ => ChildResult::Crashed(Crash::of(status, &errors)),
        }
    }

    fn spawn(&self) -> io::Result<Child> {
        let mut command = Command::new(&self.program);
        command
            .args(&self.arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.spawn()
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

impl Crash {
    /// Why the child ended without a result, by its `status` and what it printed. Rust ends a process that cannot
    /// allocate memory as it ends others that abort, so that only its message tells.
    fn of(status: ExitStatus, errors: &str) -> Self {
        let lines: Vec<&str> = errors
            .lines()
            .map(|line| line.strip_prefix("error: ").unwrap_or(line).trim())
            .filter(|line| !line.is_empty() && !line.starts_with("note: "))
            .collect();
        let shown = |text: &str| text.chars().take(MAX_REASON).collect::<String>();
        // What follows is a backtrace, which says nothing about memory
        let mut all = lines.iter();
        if let Some(line) = all.find(|line| line.contains("memory allocation of")) {
            return Self::OutOfMemory(shown(line));
        }
        let text = shown(&lines.join("; "));
        let how = match signal(status) {
            Some(9) => "killed by the system, probably because memory ran out".to_owned(),
            Some(signal) => format!("ended by signal {signal}"),
            None if text.contains("panicked at") => "internal error, please report it".to_owned(),
            None => status.to_string(),
        };
        if text.is_empty() { Self::Died(how) } else { Self::Died(format!("{how}: {text}")) }
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
        for (status, errors, expected) in [
            (
                by_signal(6),
                "memory allocation of 48000000000 bytes failed\nstack backtrace:\n   0: main\n",
                "out of memory: memory allocation of 48000000000 bytes failed",
            ),
            (by_signal(9), "", "killed by the system, probably because memory ran out"),
            (by_signal(15), "", "ended by signal 15"),
            (
                ExitStatus::from_raw(101 << 8),
                "\nthread 'main' panicked at src/x.rs:1:2:\nno such thing\nnote: run with\n",
                "internal error, please report it: thread 'main' panicked at \
                 src/x.rs:1:2:; no such thing",
            ),
            (
                ExitStatus::from_raw(2 << 8),
                "error: standard input: not a task\n",
                "exit status: 2: standard input: not a task",
            ),
        ] {
            let crash = Crash::of(status, errors);
            assert_eq!(crash.to_string(), format!("the process died: {expected}"));
            assert_eq!(
                matches!(crash, Crash::OutOfMemory(_)),
                errors.contains("memory allocation")
            );
        }
    }
}
