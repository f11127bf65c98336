//! A running program: waits for its messages or files, and sends signals to it.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::thread;

/// Killed when dropped.
pub(crate) struct Running {
    child: Child,
    errors: BufReader<ChildStderr>,
    stderr: String,
}

impl Running {
    pub(crate) fn new(mut command: Command) -> Self {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let errors = child.stderr.take().expect("it is piped");
        Self {
            child,
            errors: BufReader::new(errors),
            stderr: String::new(),
        }
    }

    /// Waits for a line on standard error that has `text`; false if the program ends before.
    pub(crate) fn wait_for_line(&mut self, text: &str) -> bool {
        let mut line = String::new();
        while self.errors.read_line(&mut line).is_ok_and(|n| n > 0) {
            let found = line.contains(text);
            self.stderr.push_str(&line);
            line.clear();
            if found {
                return true;
            }
        }
        false
    }

    /// Waits until `holds`, at the latest until the program ends. Looks without pause: the moment
    /// counts.
    pub(crate) fn wait_until(&mut self, holds: impl Fn() -> bool) -> bool {
        loop {
            if holds() {
                return true;
            }
            if !matches!(self.child.try_wait(), Ok(None)) {
                return false;
            }
            thread::yield_now();
        }
    }

    /// Sends a signal; it may come too late.
    pub(crate) fn signal(&self, name: &str) {
        let sent = Command::new("kill")
            .args([&format!("-{name}"), &self.child.id().to_string()])
            .stderr(Stdio::null())
            .status();
        sent.expect("kill is there");
    }

    /// The number of the process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// SIGKILL.
    pub(crate) fn kill(&mut self) {
        let _ = self.child.kill();
    }

    /// Waits for the end; returns standard error and the exit status.
    pub(crate) fn end(mut self) -> (String, ExitStatus) {
        let mut rest = Vec::new();
        let _ = self.errors.read_to_end(&mut rest);
        self.stderr.push_str(&String::from_utf8_lossy(&rest));
        let status = self.child.wait().expect("it ends");
        (std::mem::take(&mut self.stderr), status)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
