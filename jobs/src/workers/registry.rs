//! The registry of a job's workers, as one of them uses it: its own record and heartbeats, and the records of
//! the others.

use std::collections::HashSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use spherule_files::{owner, part_owner, publish};

use super::files::{ListedParts, list_files, list_records, remove_if_exists};
use super::record::is_worker_name;
use super::{HeartbeatSchedule, Liveness, LivenessMonitor, RECORD_SUFFIX, WORK_DIR, WorkerRecord};
use crate::clock::Clock;
use crate::open_regular;
use crate::process::{Process, now_ms};

/// Longest time between heartbeats.
const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(5);

/// Shortest time between heartbeats.
const MIN_HEARTBEAT_INTERVAL: Duration = Duration::from_millis(10);

/// Time between looks at the heartbeats of other workers.
const WAIT_INTERVAL: Duration = Duration::from_millis(50);

/// Suffix of the file name of a record that spherule 0.1.0 was writing.
const DRAFT_SUFFIX: &str = ".new";

/// See the module. The worker is registered until this is dropped.
#[derive(Debug)]
pub(crate) struct WorkerRegistry {
    /// The directory `job.work`.
    pub(super) work_dir: PathBuf,
    pub(super) record: WorkerRecord,
    pub(super) record_path: PathBuf,
    /// The first line of the record's file.
    pub(super) record_line: Vec<u8>,
    pub(super) monitor: LivenessMonitor,
    heartbeats: &'static HeartbeatSchedule,
    is_declared_dead: Arc<AtomicBool>,
    /// Directories in which workers of this job create temporary files.
    output_dirs: OnceLock<Vec<PathBuf>>,
}

impl WorkerRegistry {
    /// Registers a worker in the job's directory `dir`. Other workers are declared dead after
    /// `takeover_after` without a heartbeat.
    pub(crate) fn register(dir: &Path, takeover_after: Duration) -> io::Result<Arc<Self>> {
        Self::register_with(dir, takeover_after, HeartbeatSchedule::of_process())
    }

    /// Like [`Self::register`], with the heartbeats and the clock of `heartbeats`.
    pub(super) fn register_with(
        dir: &Path,
        takeover_after: Duration,
        heartbeats: &'static HeartbeatSchedule,
    ) -> io::Result<Arc<Self>> {
        let work_dir = dir.join(WORK_DIR);
        let interval = HEARTBEAT_INTERVAL.min(takeover_after / 4).max(MIN_HEARTBEAT_INTERVAL);
        // Describe this worker
        let record = WorkerRecord {
            worker: new_worker_name(),
            process: Process::current().clone(),
            since_ms: now_ms(),
            heartbeat_interval_ms: u64::try_from(interval.as_millis()).unwrap_or(u64::MAX),
        };
        let record_line = record.to_line()?;
        // Write the record before the first claim, and keep it fresh by heartbeats
        let record_path = work_dir.join(record.file_name());
        write_record(&work_dir, &record_path, &record_line)?;
        let is_declared_dead = Arc::new(AtomicBool::new(false));
        heartbeats.add(&record_path, interval, &is_declared_dead);
        Ok(Arc::new(Self {
            work_dir,
            record,
            record_path,
            record_line,
            monitor: LivenessMonitor::new(takeover_after, heartbeats.clock().clone()),
            heartbeats,
            is_declared_dead,
            output_dirs: OnceLock::new(),
        }))
    }

    /// Sets the directories in which workers of this job create files. The last worker removes the temporary
    /// files of dead workers from them.
    pub(crate) fn set_output_dirs(&self, dirs: Vec<PathBuf>) {
        let _ = self.output_dirs.set(dirs);
    }

    /// The name of this worker.
    pub(crate) fn worker(&self) -> &str {
        &self.record.worker
    }

    /// Whether another worker has declared this worker dead.
    pub(crate) fn is_declared_dead(&self) -> bool {
        self.is_declared_dead.load(Ordering::Relaxed)
    }

    /// The clock by which this worker judges others.
    pub(crate) const fn clock(&self) -> &Clock {
        self.heartbeats.clock()
    }

    /// The other living workers.
    pub(crate) fn others(&self) -> io::Result<Vec<WorkerRecord>> {
        let records = list_records(&self.work_dir)?;
        let living = |(path, record): (PathBuf, Option<WorkerRecord>)| {
            let record = record.filter(|record| record.worker != self.record.worker)?;
            let liveness = self.monitor.of_worker(&self.work_dir, &record);
            (liveness == Liveness::Alive && path.exists()).then_some(record)
        };
        Ok(records.into_iter().filter_map(living).collect())
    }

    /// Waits until each of the other workers has either ended or missed its heartbeats, or until one of them has shown
    /// a heartbeat: that one is returned. A record alone does not tell a busy worker from one whose machine is gone.
    /// The caller must hold the lock.
    pub(crate) fn wait_for_others(&self) -> io::Result<Option<WorkerRecord>> {
        loop {
            let others = self.others()?;
            let mut beating =
                others.iter().filter(|record| self.monitor.has_beaten(&self.work_dir, record));
            if let Some(record) = beating.next() {
                return Ok(Some(record.clone()));
            }
            if others.is_empty() {
                self.remove_dead()?;
                return Ok(None);
            }
            self.clock().sleep(WAIT_INTERVAL);
        }
    }

    /// Whether this worker's record is gone although the directory of its job is still there: other workers have
    /// declared it dead. A worker that was suspended learns it here before its next heartbeat.
    pub(crate) fn has_lost_record(&self) -> bool {
        let is_gone = || match open_regular(&self.record_path) {
            Err(e) => e.kind() == io::ErrorKind::NotFound,
            Ok(_) => false,
        };
        let has_job = || self.work_dir.parent().is_some_and(Path::exists);
        self.is_declared_dead() || (is_gone() && has_job())
    }

    /// The names of all registered workers, dead or alive, including those whose records are damaged.
    pub(crate) fn worker_names(&self) -> io::Result<Vec<String>> {
        let records = list_records(&self.work_dir)?;
        let name = |(path, _): (PathBuf, Option<WorkerRecord>)| {
            let name = path.file_name()?.to_str()?.strip_suffix(RECORD_SUFFIX)?;
            is_worker_name(name).then(|| name.to_owned())
        };
        Ok(records.into_iter().filter_map(name).collect())
    }

    /// Removes the record of a worker. All other workers then agree that its claims are free, and the worker
    /// notices it if it comes back.
    pub(super) fn declare_dead(&self, record: &WorkerRecord) -> io::Result<()> {
        remove_if_exists(&self.work_dir.join(record.file_name()))
    }

    /// Removes the files of dead workers from `job.work`. The caller must hold the lock. Returns the owners of
    /// temporary files that may still be written.
    pub(crate) fn remove_dead(&self) -> io::Result<HashSet<String>> {
        remove_dead(&self.work_dir, &self.monitor, Some(&self.record))
    }
}

impl Drop for WorkerRegistry {
    /// The last worker removes what dead workers have left. The next run finds what could not be removed.
    fn drop(&mut self) {
        self.heartbeats.remove(&self.record_path);
        let _ = remove_if_exists(&self.record_path);
        let mut parts = ListedParts::default();
        for dir in self.output_dirs.get().into_iter().flatten() {
            let _ = parts.add(dir);
        }
        let Ok(mut living) = remove_dead(&self.work_dir, &self.monitor, None) else {
            return;
        };
        if living.is_empty() {
            let _ = fs::remove_dir(&self.work_dir);
        }
        // This process may have other jobs open
        living.insert(owner().to_owned());
        parts.remove_stale(&living);
    }
}

/// Removes the records of dead workers. If no worker but `own` is left, also removes all claims except its
/// own: only then is no claim of a dead worker followed by a later generation that it protects.
fn remove_dead(
    work_dir: &Path,
    monitor: &LivenessMonitor,
    own: Option<&WorkerRecord>,
) -> io::Result<HashSet<String>> {
    // Remove the records of dead workers, and count living ones
    let mut living_owners = HashSet::new();
    let mut others = 0;
    for (path, record) in list_records(work_dir)? {
        let liveness = match &record {
            Some(record) if Some(record) == own => {
                living_owners.insert(owner().to_owned());
                continue;
            }
            Some(record) => monitor.of_worker(work_dir, record),
            None => monitor.of_file(&path),
        };
        match (liveness, record) {
            (Liveness::Alive, record) => {
                others += 1;
                living_owners.extend(record.map(|record| record.process.token));
            }
            // A record that cannot be removed does no harm
            _ => drop(remove_if_exists(&path)),
        }
    }
    // Remove the claims of all that are gone
    if others == 0 {
        for path in list_files(work_dir)?.into_iter().filter(|p| is_ours(p)) {
            let record = WorkerRecord::read(&path).ok().flatten();
            if own.is_none() || record.as_ref() != own {
                // A worker that has just registered was not seen above; its claims come after its record
                let is_new =
                    record.is_some_and(|r| monitor.of_worker(work_dir, &r) == Liveness::Alive);
                if !is_new {
                    let _ = remove_if_exists(&path);
                }
            }
        }
    }
    Ok(living_owners)
}

/// Whether workers create files of this name.
fn is_ours(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy());
    name.is_some_and(|name| {
        let is_claim = name.starts_with("frame.") || name.starts_with("lock.");
        let is_record = name.ends_with(RECORD_SUFFIX) || name.ends_with(DRAFT_SUFFIX);
        is_claim || is_record || part_owner(&name).is_some()
    })
}

/// A process may have several jobs open, and is a worker of its own in each.
fn new_worker_name() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let token = &Process::current().token;
    match COUNT.fetch_add(1, Ordering::Relaxed) {
        0 => token.clone(),
        count => format!("{token}-{count}"),
    }
}

/// Writes the record into the directory, which is created if needed. The last worker to leave may remove the
/// directory at any time, hence the retries.
fn write_record(work_dir: &Path, record_path: &Path, line: &[u8]) -> io::Result<()> {
    let write = || {
        fs::create_dir_all(work_dir)?;
        publish(record_path, line)
    };
    for _ in 0..100 {
        match write() {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => {
                let _ = fs::remove_dir(work_dir);
                return Err(e);
            }
            Ok(()) => return Ok(()),
        }
    }
    write()
}
