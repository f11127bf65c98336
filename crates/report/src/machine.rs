//! Description of the machine of a measurement.

use std::fs;
use std::thread;

use serde::{Deserialize, Serialize};
use spherule_files::memory;

use spherule_tree::accel::simd::SimdLevel;

/// Hardware and program.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Machine {
    /// Name of the CPU.
    pub cpu: String,
    /// Number of hardware threads.
    pub threads: usize,
    /// The instruction set that rays are traced with.
    pub simd: String,
    /// Installed memory in bytes; None if the system does not report it.
    pub memory: Option<u64>,
    /// Operating system.
    pub os: String,
    /// Architecture.
    pub arch: String,
    /// Version of the program.
    pub spherule: String,
}

impl Machine {
    /// The current machine.
    pub fn this() -> Self {
        Self {
            cpu: cpu_name(),
            threads: thread::available_parallelism().map_or(1, usize::from),
            simd: SimdLevel::best().name().to_owned(),
            memory: memory::installed(),
            os: std::env::consts::OS.to_owned(),
            arch: std::env::consts::ARCH.to_owned(),
            spherule: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }
}

/// One line, for headings.
impl std::fmt::Display for Machine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, {} threads, {}", self.cpu, self.threads, self.simd)?;
        if let Some(memory) = self.memory {
            write!(f, ", {:.0} GiB", memory as f64 / f64::from(1 << 30))?;
        }
        Ok(())
    }
}

fn cpu_name() -> String {
    let named = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    named.unwrap_or_else(|| format!("unknown {} processor", std::env::consts::ARCH))
}
