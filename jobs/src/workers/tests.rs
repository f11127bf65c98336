//! Claims of workers that are alive, end, become unresponsive and come back. Time passes only where a test says so.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use crate::clock::Clock;
use crate::process::Process;

use super::*;

const LONG: Duration = Duration::from_secs(3600);

fn register(dir: &Path) -> Arc<WorkerRegistry> {
    WorkerRegistry::register(dir, LONG).unwrap()
}

/// A machine whose clock and heartbeats the test drives.
struct Machine {
    clock: Clock,
    heartbeats: &'static HeartbeatSchedule,
}

impl Machine {
    /// A machine with this clock. Machines may share one.
    fn new(clock: &Clock) -> Self {
        let heartbeats = Box::leak(Box::new(HeartbeatSchedule::new(clock.clone())));
        Self { clock: clock.clone(), heartbeats }
    }

    fn register(&self, dir: &Path, takeover_after: Duration) -> Arc<WorkerRegistry> {
        WorkerRegistry::register_with(dir, takeover_after, self.heartbeats).unwrap()
    }

    /// Lets `time` pass, then the heartbeats that are due.
    fn pass(&self, time: Duration) {
        self.clock.sleep(time);
        self.heartbeats.beat_due();
    }
}

const fn millis(count: u64) -> Duration {
    Duration::from_millis(count)
}

fn acquired(outcome: ClaimOutcome) -> Claim {
    match outcome {
        ClaimOutcome::Acquired(claim) => claim,
        other => panic!("{other:?}"),
    }
}

fn is_held(registry: &Arc<WorkerRegistry>, frame: i64) -> bool {
    matches!(registry.claim_frame(frame).unwrap(), ClaimOutcome::Held(_))
}

fn file_names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir.join(WORK_DIR))
        .map(|list| list.map(|e| e.unwrap().file_name().into_string().unwrap()).collect())
        .unwrap_or_default();
    names.sort();
    names
}

/// Creates the record of a worker on another machine and its claim of `frame`.
fn remote_worker(dir: &Path, name: &str, frame: i64) -> PathBuf {
    other_process(dir, name, frame, "machine", "another".into())
}

/// The same for a worker of this machine that has ended.
fn ended_worker(dir: &Path, name: &str, frame: i64) -> PathBuf {
    other_process(dir, name, frame, "start", 1.into())
}

/// Creates the files of a process that differs from this one in one `field`.
fn other_process(
    dir: &Path,
    name: &str,
    frame: i64,
    field: &str,
    value: serde_json::Value,
) -> PathBuf {
    let mut process: serde_json::Value = serde_json::to_value(Process::current()).unwrap();
    process[field] = value;
    let record = WorkerRecord {
        worker: name.to_owned(),
        process: serde_json::from_value(process).unwrap(),
        since_ms: 0,
        heartbeat_interval_ms: 0,
    };
    write_worker(dir, &record, frame)
}

fn write_worker(dir: &Path, record: &WorkerRecord, frame: i64) -> PathBuf {
    let work_dir = dir.join(WORK_DIR);
    fs::create_dir_all(&work_dir).unwrap();
    let path = work_dir.join(record.file_name());
    fs::write(&path, serde_json::to_string(record).unwrap() + "\n").unwrap();
    fs::hard_link(&path, work_dir.join(format!("frame.{frame}.0"))).unwrap();
    path
}

#[test]
fn a_frame_is_held_by_one_worker_until_it_drops_the_claim() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (register(dir.path()), register(dir.path()));
    let claim = acquired(a.claim_frame(-7).unwrap());
    match b.claim_frame(-7).unwrap() {
        ClaimOutcome::Held(who) => assert!(who.contains(&std::process::id().to_string()), "{who}"),
        other => panic!("{other:?}"),
    }
    let other = acquired(b.claim_frame(8).unwrap());
    drop(claim);
    let claim = acquired(b.claim_frame(-7).unwrap());
    assert!(is_held(&a, -7) && is_held(&a, 8));
    assert_eq!(a.others().unwrap(), std::slice::from_ref(&b.record));
    drop((claim, other));
    drop(b);
    assert!(a.others().unwrap().is_empty());
    drop(a);
    assert!(!dir.path().join(WORK_DIR).exists());
}

#[test]
fn threads_agree_on_the_holders() {
    let dir = tempfile::tempdir().unwrap();
    let taken: Vec<usize> = thread::scope(|scope| {
        let work = || {
            let registry = register(dir.path());
            let mut kept = Vec::new();
            for frame in 0..200 {
                if let ClaimOutcome::Acquired(claim) = registry.claim_frame(frame).unwrap() {
                    kept.push(claim);
                }
            }
            kept
        };
        let workers: Vec<_> = (0..4).map(|_| scope.spawn(work)).collect();
        let kept: Vec<Vec<Claim>> = workers.into_iter().map(|w| w.join().unwrap()).collect();
        kept.iter().map(Vec::len).collect()
    });
    assert_eq!(taken.iter().sum::<usize>(), 200, "{taken:?}");
}

#[test]
fn the_claim_of_an_ended_process_is_free_at_once() {
    let dir = tempfile::tempdir().unwrap();
    ended_worker(dir.path(), "dead", 3);
    let (a, b) = (register(dir.path()), register(dir.path()));
    let claim = acquired(a.claim_frame(3).unwrap());
    assert!(is_held(&b, 3), "a holds the next generation");
    claim.complete();
    assert!(!file_names(dir.path()).iter().any(|n| n.starts_with("frame.")));
    drop((a, b));
    assert!(!dir.path().join(WORK_DIR).exists());
}

#[test]
fn the_claim_of_another_machine_is_free_after_missed_heartbeats() {
    let dir = tempfile::tempdir().unwrap();
    let record = remote_worker(dir.path(), "far", 3);
    let here = Machine::new(&Clock::manual());
    let a = here.register(dir.path(), millis(300));
    for _ in 0..8 {
        assert!(is_held(&a, 3));
        assert_eq!(a.others().unwrap().len(), 1);
        let text = fs::read_to_string(&record).unwrap();
        fs::write(&record, text + ".").unwrap();
        here.pass(millis(299));
    }
    assert!(is_held(&a, 3), "it has just appended");
    here.pass(millis(299));
    assert!(is_held(&a, 3));
    here.pass(millis(1));
    assert!(!is_held(&a, 3));
    assert!(!record.exists(), "all workers must agree that it is dead");
    let other = register(dir.path());
    assert!(!is_held(&other, 3));
    drop((a, other));
    assert!(!dir.path().join(WORK_DIR).exists());
}

/// A record alone does not tell whether the worker's machine is still there.
#[test]
fn whoever_waits_for_others_sees_a_heartbeat_or_declares_them_dead() {
    let dir = tempfile::tempdir().unwrap();
    let record = remote_worker(dir.path(), "far", 3);
    let clock = Clock::manual();
    let start = clock.now();
    let here = Machine::new(&clock);
    let a = here.register(dir.path(), millis(60_000));
    assert_eq!(a.wait_for_others().unwrap(), None);
    assert_eq!(clock.now() - start, millis(60_000));
    assert!(!record.exists(), "all workers must agree that it is dead");
    // The heartbeats of this one are real, the clock of the observer is not
    let worker = WorkerRegistry::register(dir.path(), millis(40)).unwrap();
    let length = || fs::metadata(&worker.record_path).unwrap().len();
    assert_eq!(a.others().unwrap().len(), 1);
    let first = length();
    while length() == first {
        thread::yield_now();
    }
    let beating = a.wait_for_others().unwrap();
    assert_eq!(beating.as_ref(), Some(&worker.record));
}

/// A suspended worker that comes back must not take missing files for errors of the disk.
#[test]
fn a_worker_learns_from_its_record_that_it_was_declared_dead() {
    let dir = tempfile::tempdir().unwrap();
    let here = Machine::new(&Clock::manual());
    let a = here.register(dir.path(), millis(400));
    assert!(!a.has_lost_record());
    register(dir.path()).declare_dead(&a.record).unwrap();
    assert!(!a.is_declared_dead() && a.has_lost_record());
    // Without the directory of the job, that is the reason for all errors
    fs::remove_dir_all(dir.path()).unwrap();
    assert!(!a.has_lost_record());
}

#[test]
fn a_worker_notices_that_it_was_declared_dead() {
    let dir = tempfile::tempdir().unwrap();
    let here = Machine::new(&Clock::manual());
    let a = here.register(dir.path(), millis(400));
    let claim = acquired(a.claim_frame(1).unwrap());
    let b = register(dir.path());
    here.pass(millis(100));
    assert!(is_held(&b, 1) && claim.is_valid());
    b.declare_dead(&a.record).unwrap();
    assert!(!claim.is_valid());
    let _claim = acquired(b.claim_frame(1).unwrap());
    here.pass(millis(99));
    assert!(!a.is_declared_dead(), "it notices at its next heartbeat");
    here.pass(millis(1));
    assert!(a.is_declared_dead());
}

/// The thread that serves the registries of a process.
#[test]
fn the_heartbeat_thread_notices_a_lost_record() {
    let dir = tempfile::tempdir().unwrap();
    let a = WorkerRegistry::register(dir.path(), millis(40)).unwrap();
    register(dir.path()).declare_dead(&a.record).unwrap();
    while !a.is_declared_dead() {
        thread::yield_now();
    }
}

#[test]
fn a_worker_keeps_its_claims_as_long_as_its_heart_beats() {
    let dir = tempfile::tempdir().unwrap();
    let clock = Clock::manual();
    let (here, there) = (Machine::new(&clock), Machine::new(&clock));
    let observer = here.register(dir.path(), millis(60_000));
    let worker = there.register(dir.path(), millis(60_000));
    let claim = acquired(worker.claim_frame(1).unwrap());
    let length = || fs::metadata(&worker.record_path).unwrap().len();
    let first_length = length();
    for beats in 1..=24 {
        there.pass(millis(4_999));
        assert_eq!(length(), first_length + beats - 1, "a beat every 5 s");
        there.pass(millis(1));
        assert_eq!(length(), first_length + beats);
        assert!(is_held(&observer, 1));
    }
    // The machine is suspended
    here.pass(millis(59_999));
    assert!(is_held(&observer, 1));
    here.pass(millis(1));
    let taken = acquired(observer.claim_frame(1).unwrap());
    // It comes back, notices, and must not overwrite
    assert!(!claim.is_valid());
    there.pass(Duration::ZERO);
    assert!(worker.is_declared_dead());
    drop((claim, worker));
    assert!(taken.is_valid());
    let other = there.register(dir.path(), millis(60_000));
    assert!(is_held(&other, 1), "the claim of the dead removes no other");
}

/// A worker that beats slowly must not be declared dead by one with a short timeout.
#[test]
fn a_short_timeout_waits_for_several_heartbeats() {
    let dir = tempfile::tempdir().unwrap();
    let clock = Clock::manual();
    let (here, there) = (Machine::new(&clock), Machine::new(&clock));
    let worker = there.register(dir.path(), millis(60_000));
    let _claim = acquired(worker.claim_frame(1).unwrap());
    let hasty = here.register(dir.path(), millis(100));
    assert!(is_held(&hasty, 1));
    here.pass(millis(19_999));
    assert!(is_held(&hasty, 1), "four beats of 5 s");
    here.pass(millis(1));
    assert!(!is_held(&hasty, 1));
}

#[test]
fn the_lock_of_an_unresponsive_worker_is_taken_over() {
    let dir = tempfile::tempdir().unwrap();
    let clock = Clock::manual();
    let (here, there) = (Machine::new(&clock), Machine::new(&clock));
    let worker = there.register(dir.path(), millis(300));
    let lost = worker.lock().unwrap();
    let start = clock.now();
    let a = here.register(dir.path(), millis(300));
    a.lock().unwrap().complete();
    assert_eq!(clock.now() - start, millis(300));
    assert!(!lost.is_valid());
}

#[test]
fn one_of_two_generations_yields() {
    let dir = tempfile::tempdir().unwrap();
    ended_worker(dir.path(), "dead", 1);
    let (a, b) = (register(dir.path()), register(dir.path()));
    let claim = acquired(a.claim_frame(1).unwrap());
    // Another worker has removed the dead claim before it
    fs::remove_file(dir.path().join(WORK_DIR).join("frame.1.0")).unwrap();
    assert!(is_held(&b, 1));
    drop(claim);
    assert!(!is_held(&b, 1));
}

#[test]
fn damaged_and_unknown_files_are_harmless() {
    let dir = tempfile::tempdir().unwrap();
    let work_dir = dir.path().join(WORK_DIR);
    fs::create_dir(&work_dir).unwrap();
    fs::write(work_dir.join("torn.worker"), "{\"worker\":").unwrap();
    fs::write(work_dir.join("frame.1.0"), "").unwrap();
    fs::write(work_dir.join("frame.2.0"), [0xff; 9]).unwrap();
    fs::write(work_dir.join("notes.txt"), "mine").unwrap();
    fs::create_dir(work_dir.join("frame.4.0")).unwrap();
    fs::create_dir(work_dir.join("folder.worker")).unwrap();
    let here = Machine::new(&Clock::manual());
    let a = here.register(dir.path(), millis(50));
    a.remove_dead().unwrap();
    assert!(!is_held(&a, 4), "workers create no directories");
    assert!(is_held(&a, 1) && is_held(&a, 2));
    here.pass(millis(50));
    assert!(!is_held(&a, 1) && !is_held(&a, 2));
    a.remove_dead().unwrap();
    assert!(work_dir.join("notes.txt").exists() && !work_dir.join("torn.worker").exists());
    assert!(!is_held(&a, 3));
}

/// A worker name with a path in it must not lead out of the directory.
#[test]
fn a_forged_claim_deletes_nothing_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let (work_dir, victim) = (dir.path().join(WORK_DIR), dir.path().join("victim.worker"));
    fs::write(&victim, "mine").unwrap();
    let remote = remote_worker(dir.path(), "far", 3);
    let forged = |worker: &str| {
        let text = fs::read_to_string(&remote).unwrap();
        text.replace("\"far\"", &format!("\"{worker}\""))
    };
    fs::write(work_dir.join("frame.1.0"), forged("../victim")).unwrap();
    fs::write(work_dir.join("forged.worker"), forged("../victim")).unwrap();
    // A record must not replace that of another worker
    let other = register(dir.path());
    fs::write(work_dir.join("liar.worker"), forged(other.worker())).unwrap();
    let here = Machine::new(&Clock::manual());
    let a = here.register(dir.path(), millis(40));
    assert!(is_held(&a, 1));
    a.remove_dead().unwrap();
    here.pass(millis(40));
    assert!(!is_held(&a, 1));
    a.remove_dead().unwrap();
    assert!(!work_dir.join("forged.worker").exists());
    assert_eq!(fs::read_to_string(&victim).unwrap(), "mine");
    assert!(other.record_path.exists());
    drop((a, other));
    assert_eq!(fs::read_to_string(&victim).unwrap(), "mine");
}

/// Otherwise its ledger would count as that of an ended worker.
#[test]
fn a_worker_with_a_damaged_record_keeps_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (register(dir.path()), register(dir.path()));
    let text = fs::read_to_string(&a.record_path).unwrap();
    fs::write(&a.record_path, text.replace("since_ms", "since_mx")).unwrap();
    assert!(b.worker_names().unwrap().contains(&a.worker().to_owned()));
}

#[cfg(unix)]
#[test]
fn pipes_among_records_and_claims_are_ignored() {
    let dir = tempfile::tempdir().unwrap();
    let work_dir = dir.path().join(WORK_DIR);
    fs::create_dir(&work_dir).unwrap();
    for name in ["frame.1.0", "lock.0", "pipe.worker"] {
        let made = std::process::Command::new("mkfifo").arg(work_dir.join(name)).status();
        assert!(made.unwrap().success());
    }
    let a = register(dir.path());
    a.lock().unwrap().complete();
    a.remove_dead().unwrap();
    assert!(!is_held(&a, 1));
    assert!(a.others().unwrap().is_empty());
    assert_eq!(worker_statuses(dir.path()).unwrap().len(), 1);
}

#[test]
fn only_the_last_worker_removes_dead_files() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (register(dir.path()), register(dir.path()));
    ended_worker(dir.path(), "dead", 5);
    drop(a);
    assert!(file_names(dir.path()).contains(&"frame.5.0".to_owned()));
    drop(b);
    assert!(!dir.path().join(WORK_DIR).exists());
}

#[test]
fn the_lock_is_exclusive() {
    let dir = tempfile::tempdir().unwrap();
    let inside = std::sync::atomic::AtomicUsize::new(0);
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let registry = register(dir.path());
                for _ in 0..20 {
                    let lock = registry.lock().unwrap();
                    assert_eq!(inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst), 0);
                    thread::yield_now();
                    inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                    lock.complete();
                }
            });
        }
    });
}

/// On file systems without hard links the claim is a file of its own with the record's first line.
#[test]
fn a_claim_without_links_lives_as_long_as_its_worker() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (register(dir.path()), register(dir.path()));
    let path = a.work_dir.join("frame.1.0");
    assert!(files::create_exclusively(&path, &a.record_line).unwrap());
    assert!(!files::create_exclusively(&path, &b.record_line).unwrap());
    assert!(is_held(&b, 1));
    drop(a);
    assert!(!is_held(&b, 1));
}
