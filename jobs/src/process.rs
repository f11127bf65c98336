//! Processes as others can find them: on which machine, under which number, and whether they still
//! run.

use std::fs;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::OnceLock;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

/// A process, told from every other one, also from one that got its number later.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Process {
    /// Names files: letters, digits, `-` and `_`, unique for ever.
    pub(crate) token: String,
    /// For people.
    pub(crate) host: String,
    /// The same for processes that can see each other's numbers; None where that is not known.
    machine: Option<String>,
    /// Its number there.
    pub(crate) pid: u32,
    /// When it began, in clock ticks since the machine did; tells numbers that were given twice.
    start: Option<u64>,
}

static OWNER: OnceLock<Process> = OnceLock::new();

impl Process {
    /// This process.
    pub(crate) fn this() -> &'static Self {
        OWNER.get_or_init(|| {
            let pid = std::process::id();
            let host = host_name();
            let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
            let short: String = host.chars().map(plain).take(32).collect();
            let unique = RandomState::new().build_hasher().finish();
            Self {
                token: format!("{short}-{pid}-{:08x}", unique >> 32),
                host,
                machine: machine(),
                pid,
                start: standing(pid).and_then(|s| s.start),
            }
        })
    }

    /// Whether it has certainly ended. False where that cannot be known, as of other machines.
    pub(crate) fn has_ended(&self) -> bool {
        let here = Self::this();
        if self.machine.is_none() || self.machine != here.machine {
            return false;
        }
        match standing(self.pid) {
            None => true,
            Some(found) => !found.runs || (self.start.is_some() && found.start != self.start),
        }
    }
}

static BEHALF: OnceLock<String> = OnceLock::new();

/// Temporary files of this process are from now on those of the worker whose [`owner`] this is, which
/// clears them away if this process dies. To be called once, before the first file.
pub fn work_on_behalf_of(owner: &str) {
    let _ = BEHALF.set(owner.to_owned());
}

/// What the name of a temporary file says of who writes it.
pub fn owner() -> &'static str {
    BEHALF
        .get()
        .map_or_else(|| Process::this().token.as_str(), String::as_str)
}

/// Milliseconds since 1970 by this machine's clock.
pub(crate) fn now_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |t| u64::try_from(t.as_millis()).unwrap_or(u64::MAX))
}

/// What the system says of a process.
struct Found {
    /// It is neither dead nor waiting to be buried.
    runs: bool,
    start: Option<u64>,
}

/// The process of this number, or None if there is none.
#[cfg(target_os = "linux")]
fn standing(pid: u32) -> Option<Found> {
    let Ok(stat) = fs::read_to_string(format!("/proc/{pid}/stat")) else {
        // Hidden processes are not gone.
        return exists(pid).then_some(Found {
            runs: true,
            start: None,
        });
    };
    // The name in brackets may have anything in it, also brackets.
    let mut fields = stat.rsplit_once(')')?.1.split_ascii_whitespace();
    let state = fields.next()?;
    Some(Found {
        runs: !matches!(state, "Z" | "X" | "x"),
        // Field 22 of proc(5); the state is the third.
        start: fields.nth(18).and_then(|f| f.parse().ok()),
    })
}

#[cfg(not(target_os = "linux"))]
fn standing(pid: u32) -> Option<Found> {
    exists(pid).then_some(Found {
        runs: true,
        start: None,
    })
}

#[cfg(unix)]
fn exists(pid: u32) -> bool {
    let pid = i32::try_from(pid)
        .ok()
        .and_then(rustix::process::Pid::from_raw);
    pid.is_none_or(|pid| rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH))
}

#[cfg(not(unix))]
fn exists(_pid: u32) -> bool {
    true
}

#[cfg(unix)]
fn host_name() -> String {
    rustix::system::uname()
        .nodename()
        .to_string_lossy()
        .into_owned()
}

#[cfg(not(unix))]
fn host_name() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

/// A boot of a machine, and within it a space of process numbers: containers have their own.
fn machine() -> Option<String> {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let space = fs::read_link("/proc/self/ns/pid").ok()?;
    Some(format!("{} {}", boot.trim(), space.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_runs_and_its_number_given_again_does_not() {
        let this = Process::this();
        assert!(!this.has_ended());
        assert!(!this.token.contains('.') && this.token.contains(&this.pid.to_string()));
        if this.machine.is_some() {
            let earlier = Process {
                start: Some(1),
                ..this.clone()
            };
            assert!(earlier.has_ended());
            let elsewhere = Process {
                machine: Some("another".to_owned()),
                ..earlier
            };
            assert!(!elsewhere.has_ended(), "other machines are not known");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_child_that_was_killed_has_ended_before_it_is_waited_for() {
        let mut child = std::process::Command::new("sleep")
            .arg("60")
            .spawn()
            .unwrap();
        let process = Process {
            pid: child.id(),
            start: standing(child.id()).unwrap().start,
            ..Process::this().clone()
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
