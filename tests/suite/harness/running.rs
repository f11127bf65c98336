//! A running program: waits for its messages or files, and sends signals to it.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Longest wait for a line, a file or the end. Only a program that hangs reaches it.
const DEADLINE: Duration = Duration::from_secs(600);

/// Killed when dropped.
pub(crate) struct Running {
    child: Child,
    /// Standard error, line by line.
    lines: Receiver<String>,
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
        let (sender, lines) = channel();
        thread::spawn(move || send_lines(errors, &sender));
        Self { child, lines, stderr: String::new() }
    }

    /// Waits for a line on standard error that has `text`; false if the program ends before.
    pub(crate) fn wait_for_line(&mut self, text: &str) -> bool {
        let deadline = Instant::now() + DEADLINE;
        while let Some(line) = self.next_line(deadline) {
            if line.contains(text) {
                return true;
            }
        }
        false
    }

    /// The next line on standard error; None at its end.
    fn next_line(&mut self, deadline: Instant) -> Option<String> {
        let left = deadline.saturating_duration_since(Instant::now());
        match self.lines.recv_timeout(left) {
            Ok(line) => {
                self.stderr.push_str(&line);
                Some(line)
            }
            Err(RecvTimeoutError::Disconnected) => None,
            Err(RecvTimeoutError::Timeout) => panic!("it hangs after:\n{}", self.stderr),
        }
    }

    /// Waits until `holds`, at the latest until the program ends. Looks ten times in a millisecond: the moment counts, but
    /// the program needs the processor, too.
    pub(crate) fn wait_until(&mut self, holds: impl Fn() -> bool) -> bool {
        let deadline = Instant::now() + DEADLINE;
        loop {
            assert!(Instant::now() < deadline, "it hangs: {}", self.stderr);
            if holds() {
                return true;
            }
            if !matches!(self.child.try_wait(), Ok(None)) {
                return false;
            }
            thread::sleep(Duration::from_micros(100));
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
        let deadline = Instant::now() + DEADLINE;
        while self.next_line(deadline).is_some() {}
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

fn send_lines(errors: impl Read, lines: &Sender<String>) {
    let mut errors = BufReader::new(errors);
    let mut line = Vec::new();
    while errors.read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
        if lines.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
            return;
        }
        line.clear();
    }
}
