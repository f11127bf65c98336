//! The workers of a job as an observer sees them.

use std::fs;
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};

use super::files::{list_files, list_records};
use super::{WORK_DIR, WorkerRecord};

/// The status of a worker, read from its files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkerStatus {
    /// Name of the worker and of its ledger.
    pub worker: String,
    /// Name of its machine.
    pub host: String,
    /// Process number on that machine.
    pub pid: u32,
    /// When it started, milliseconds since 1970 by its own clock.
    pub since_ms: u64,
    /// Whether it has certainly ended; its frames are then free.
    pub has_ended: bool,
    /// Time since its last heartbeat, provided that the clocks of this machine and of the file system agree.
    pub since_heartbeat: Option<Duration>,
    /// Frames that it is working on, ascending.
    pub frames: Vec<i64>,
}

/// The workers in the job's directory `dir`, by name.
pub(crate) fn worker_statuses(dir: &Path) -> io::Result<Vec<WorkerStatus>> {
    let work_dir = dir.join(WORK_DIR);
    let mut statuses: Vec<WorkerStatus> = list_records(&work_dir)?
        .into_iter()
        .filter_map(|(path, record)| Some(WorkerStatus::new(&path, record?)))
        .collect();
    // Add the frames that each of them has claimed
    for path in list_files(&work_dir)? {
        let name = path.file_name().and_then(|name| name.to_str());
        let Some(frame) = name.and_then(claimed_frame) else {
            continue;
        };
        let Ok(Some(record)) = WorkerRecord::read(&path) else {
            continue;
        };
        let status = statuses.iter_mut().find(|s| s.worker == record.worker);
        if let Some(status) = status {
            status.frames.push(frame);
        }
    }
    // Order them for display
    for status in &mut statuses {
        status.frames.sort_unstable();
        status.frames.dedup();
    }
    statuses.sort_by(|a, b| a.worker.cmp(&b.worker));
    Ok(statuses)
}

impl WorkerStatus {
    fn new(path: &Path, record: WorkerRecord) -> Self {
        let modified = fs::metadata(path).and_then(|m| m.modified());
        let since_heartbeat =
            modified.ok().and_then(|at| SystemTime::now().duration_since(at).ok());
        Self {
            has_ended: record.process.has_ended(),
            worker: record.worker,
            host: record.process.host,
            pid: record.process.pid,
            since_ms: record.since_ms,
            since_heartbeat,
            frames: Vec::new(),
        }
    }
}

/// The frame that a file of this name claims.
fn claimed_frame(name: &str) -> Option<i64> {
    let (frame, generation) = name.strip_prefix("frame.")?.split_once('.')?;
    generation.parse::<u32>().ok()?;
    frame.parse().ok()
}
