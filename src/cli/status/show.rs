//! The state of a job as text and as JSON.

use serde_json::{Value, json};
use spherule_files::Bytes;
use spherule_jobs::{FrameState, WorkerStatus};

use super::JobSnapshot;
use crate::cli::job::list;
use crate::cli::progress::duration;
use crate::report::frame::DeviceSummary;

/// Number of failed frames that are printed with their reasons.
const MAX_REASONS: usize = 20;

impl JobSnapshot {
    pub(super) fn to_lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let mut line = |name: &str, what: &str| lines.push(format!("{name:<9} {what}"));
        line("job", &self.dir.display().to_string());
        line("frames", &self.summary.total.to_string());
        // List frames by state; states without frames have no line
        let mut frames = |name: &str, frames: &[i64]| {
            if !frames.is_empty() {
                line(name, &format!("{} ({})", frames.len(), list(frames)));
            }
        };
        let running = self.running();
        frames("done", &self.frames(FrameState::Done));
        frames("running", &running);
        frames("to do", &self.pending_without(&running));
        frames("missing", &self.summary.lost);
        frames("failed", &self.summary.failed);
        for worker in &self.workers {
            line("worker", &worker_line(worker));
        }
        // Estimate what is left
        if let (Some(rate), Some(left)) = (self.rate(), self.seconds_left()) {
            let each = format!("{rate:.2} frames per second");
            line("rate", &format!("{each}, {} left", duration(left)));
        }
        if let Some(device) = self.device() {
            line("GPU", &device_line(&device));
        }
        for (frame, reason) in self.reasons().take(MAX_REASONS) {
            line("failure", &format!("frame {frame}: {reason}"));
        }
        lines
    }

    /// Frames that were not tried yet and that no worker is working on.
    fn pending_without(&self, running: &[i64]) -> Vec<i64> {
        let mut pending = self.frames(FrameState::Pending);
        pending.retain(|frame| running.binary_search(frame).is_err());
        pending
    }

    /// Failed frames and why.
    fn reasons(&self) -> impl Iterator<Item = (i64, &str)> {
        self.summary.failed.iter().filter_map(|frame| {
            let entry = self.state.ledger().entry(*frame)?;
            Some((*frame, entry.reason.as_deref().unwrap_or("unknown")))
        })
    }

    pub(super) fn to_json(&self) -> Value {
        let failed: Vec<Value> = self
            .reasons()
            .map(|(frame, reason)| json!({"frame": frame, "reason": reason}))
            .collect();
        let workers: Vec<Value> = self.workers.iter().map(worker_json).collect();
        let running = self.running();
        json!({
            "directory": self.dir,
            "frames": self.summary.total,
            "done": self.frames(FrameState::Done),
            "running": running,
            "pending": self.pending_without(&running),
            "missing": self.summary.lost,
            "failed": failed,
            "workers": workers,
            "device": self.device(),
            "frames_per_second": self.rate(),
            "seconds_left": self.seconds_left(),
        })
    }
}

fn worker_line(worker: &WorkerStatus) -> String {
    let process = format!("process {} on {}", worker.pid, worker.host);
    let work = match worker.frames.as_slice() {
        [] => "no frame".to_owned(),
        frames => format!("working on frame {}", list(frames)),
    };
    let liveness = if worker.has_ended {
        "has died; the next worker takes over".to_owned()
    } else {
        let seconds = worker.since_heartbeat.map_or(0.0, |time| time.as_secs_f64());
        format!("last heartbeat {} ago", duration(seconds))
    };
    format!("{process}: {work}, {liveness}")
}

fn device_line(device: &DeviceSummary) -> String {
    let DeviceSummary { name, driver, upload, build, trace, denoise, download, bytes } = device;
    let stages = [
        ("upload", upload),
        ("build", build),
        ("trace", trace),
        ("denoise", denoise),
        ("download", download),
    ];
    let times = stages.map(|(stage, seconds)| format!("{stage} {:.1} ms", 1e3 * seconds));
    let memory = Bytes(*bytes);
    format!("{name} ({driver}): {}, {memory} in the last frame", times.join(", "))
}

fn worker_json(worker: &WorkerStatus) -> Value {
    json!({
        "worker": worker.worker,
        "host": worker.host,
        "pid": worker.pid,
        "since_ms": worker.since_ms,
        "has_ended": worker.has_ended,
        "silent_seconds": worker.since_heartbeat.map(|time| time.as_secs_f64()),
        "frames": worker.frames,
    })
}
