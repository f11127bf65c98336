//! Identifies processes, and finds out whether a process of this machine is still running.

use std::fs;
use std::sync::OnceLock;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use spherule_files::{host_name, process_token};

/// Identifies a process uniquely, even if its process number is reused later.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Process {
    /// Globally unique; part of file names. Letters, digits, `-` and `_`.
    pub(crate) token: String,
    /// Name of the machine. Only displayed.
    pub(crate) host: String,
    /// Equal for processes that can see each other's process numbers; None if unknown.
    machine: Option<String>,
    /// Process number on that machine.
    pub(crate) pid: u32,
    /// When it started, in clock ticks since boot. Distinguishes processes with a reused number.
    start: Option<u64>,
}

static CURRENT: OnceLock<Process> = OnceLock::new();

impl Process {
    /// This process.
    pub(crate) fn current() -> &'static Self {
        CURRENT.get_or_init(|| {
            let pid = std::process::id();
            Self {
                token: process_token().to_owned(),
                host: host_name(),
                machine: machine(),
                pid,
                start: find_process(pid).and_then(|s| s.start),
            }
        })
    }

    /// Whether the process has certainly ended. False if that is unknown, as on other machines.
    pub(crate) fn has_ended(&self) -> bool {
        let here = Self::current();
        if self.machine.is_none() || self.machine != here.machine {
            return false;
        }
        match find_process(self.pid) {
            None => true,
            Some(found) => !found.is_running || (self.start.is_some() && found.start != self.start),
        }
    }
}

/// Milliseconds since 1970 by the clock of this machine.
pub(crate) fn now_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |t| u64::try_from(t.as_millis()).unwrap_or(u64::MAX))
}

/// The state of a process.
struct FoundProcess {
    /// Neither dead nor a zombie.
    is_running: bool,
    start: Option<u64>,
}

/// The process with this number; None if there is none.
#[cfg(target_os = "linux")]
fn find_process(pid: u32) -> Option<FoundProcess> {
    let Ok(stat) = fs::read_to_string(format!("/proc/{pid}/stat")) else {
        // The process may exist but be hidden
        return exists(pid).then_some(FoundProcess { is_running: true, start: None });
    };
    // The name in parentheses may itself contain parentheses
    let mut fields = stat.rsplit_once(')')?.1.split_ascii_whitespace();
    let state = fields.next()?;
    Some(FoundProcess {
        is_running: !matches!(state, "Z" | "X" | "x"),
        // Field 22 of proc(5); the state is field 3
        start: fields.nth(18).and_then(|f| f.parse().ok()),
    })
}

#[cfg(not(target_os = "linux"))]
fn find_process(pid: u32) -> Option<FoundProcess> {
    exists(pid).then_some(FoundProcess { is_running: true, start: None })
}

#[cfg(unix)]
fn exists(pid: u32) -> bool {
    let pid = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw);
    pid.is_none_or(|pid| rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH))
}

#[cfg(not(unix))]
fn exists(_pid: u32) -> bool {
    true
}

/// Identifies the boot of a machine and its PID namespace: containers have their own.
fn machine() -> Option<String> {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let namespace = fs::read_link("/proc/self/ns/pid").ok()?;
    Some(format!("{} {}", boot.trim(), namespace.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reused_process_number_counts_as_ended() {
        let current = Process::current();
        assert!(!current.has_ended());
        assert!(!current.token.contains('.') && current.token.contains(&current.pid.to_string()));
        if current.machine.is_some() {
            let earlier = Process { start: Some(1), ..current.clone() };
            assert!(earlier.has_ended());
            let elsewhere = Process { machine: Some("another".to_owned()), ..earlier };
            assert!(!elsewhere.has_ended(), "the state on other machines is unknown");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_killed_child_has_ended_before_it_is_reaped() {
        let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let process = Process {
            pid: child.id(),
            start: find_process(child.id()).unwrap().start,
            ..Process::current().clone()
        };
        assert!(!process.has_ended());
        child.kill().unwrap();
        while !process.has_ended() {
            std::thread::yield_now();
        }
        child.wait().unwrap();
        assert!(process.has_ended());
    }
}
