//! Jobs that are killed, resumed, changed and damaged.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use spherule_jobs::{
    ClaimOutcome, ClaimedFrame, DEFAULT_TAKEOVER_AFTER, EntryStatus, FailureKind, FileError,
    FinishedFrame, FrameFailure, FrameRequest, FrameState, FrameWork, Interrupt, Job, JobError,
    JobRequest, PLAN_FILE, ResumeMode, RunContext, RunOptions, publish, run_frames,
};
use tempfile::TempDir;

/// A temporary directory with input files and a job.
struct Fixture {
    root: TempDir,
}

impl Fixture {
    fn new(frames: impl IntoIterator<Item = i64>) -> Self {
        let fixture = Self { root: tempfile::tempdir().unwrap() };
        fs::create_dir(fixture.root.path().join("data")).unwrap();
        for frame in frames {
            fixture.write_input(frame, &format!("particles of {frame}"));
        }
        fixture
    }

    fn write_input(&self, frame: i64, text: &str) {
        fs::write(self.input(frame), text).unwrap();
    }

    fn input(&self, frame: i64) -> PathBuf {
        self.root.path().join(format!("data/{frame}.vtk"))
    }

    fn dir(&self) -> PathBuf {
        self.root.path().join("out")
    }

    fn image(&self, frame: i64) -> PathBuf {
        self.dir().join(format!("frame.{frame}.exr"))
    }

    /// The ledgers of all workers.
    fn ledgers(&self) -> Vec<PathBuf> {
        let paths = fs::read_dir(self.dir()).unwrap().map(|e| e.unwrap().path());
        let mut ledgers: Vec<PathBuf> =
            paths.filter(|p| p.extension().is_some_and(|e| e == "jsonl")).collect();
        ledgers.sort();
        ledgers
    }

    /// The only ledger.
    fn ledger(&self) -> PathBuf {
        let ledgers = self.ledgers();
        assert_eq!(ledgers.len(), 1, "{ledgers:?}");
        ledgers[0].clone()
    }

    fn request(&self, frames: impl IntoIterator<Item = i64>) -> JobRequest {
        JobRequest {
            settings: settings(3),
            frames: frames
                .into_iter()
                .map(|number| FrameRequest {
                    number,
                    inputs: vec![self.input(number)],
                    companions: Vec::new(),
                    outputs: vec![self.image(number)],
                })
                .collect(),
            extra_outputs: vec![self.dir().join("report.html")],
            selection: None,
            mode: ResumeMode::Resume,
            takeover_after: DEFAULT_TAKEOVER_AFTER,
        }
    }

    fn open(&self, request: JobRequest) -> Result<Job, JobError> {
        Job::open(&self.dir(), request, |_| Ok::<_, String>(resolved()))
    }

    /// A job over `frames` with those `done` finished.
    fn started(&self, frames: std::ops::Range<i64>, done: &[i64]) {
        let mut job = self.open(self.request(frames)).unwrap();
        for frame in done {
            self.finish(&mut job, *frame);
        }
    }

    fn finish(&self, job: &mut Job, frame: i64) {
        publish(&self.image(frame), b"an image").unwrap();
        job.record_done(frame, &[self.image(frame)], json!({ "particles": 5 })).unwrap();
    }
}

fn settings(depth: u32) -> Vec<(String, String)> {
    vec![
        ("image.width".to_owned(), "64".to_owned()),
        ("render.max_depth".to_owned(), depth.to_string()),
    ]
}

fn failure(frame: i64, reason: &str) -> FrameFailure {
    FrameFailure::new(FailureKind::Frame, frame, reason)
}

fn resolved() -> Value {
    json!({ "radius": 0.1 + 0.2 })
}

fn never(_: Option<&Value>) -> Result<Value, String> {
    panic!("the stored values must be used")
}

fn contents(dir: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<_> = fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap())
        .map(|e| (e.file_name().into_string().unwrap(), fs::read(e.path()).unwrap()))
        .collect();
    all.sort();
    all
}

#[test]
fn failed_frames_are_retried_on_resume() {
    let fixture = Fixture::new(0..4);
    let mut job = fixture.open(fixture.request(0..4)).unwrap();
    assert_eq!(job.pending(), [0, 1, 2, 3]);
    fixture.finish(&mut job, 0);
    job.record_failed(&failure(1, "byte 9: damaged")).unwrap();
    let summary = job.summary();
    assert_eq!((summary.done, summary.pending), (1, 2));
    assert_eq!(summary.failed, [1]);
    drop(job);

    let mut job = Job::open(&fixture.dir(), fixture.request(0..4), never).unwrap();
    assert_eq!(job.resolved(), &resolved());
    assert_eq!(job.pending(), [1, 2, 3]);
    let failed = job.state().ledger().entry(1).unwrap();
    assert_eq!(failed.reason.as_deref(), Some("byte 9: damaged"));
    assert_eq!(failed.failure, Some(FailureKind::Frame));
    for frame in job.pending() {
        fixture.finish(&mut job, frame);
    }
    assert_eq!(job.summary().done, 4);
    let state = Job::read(&fixture.dir()).unwrap().unwrap();
    assert_eq!(state.summary().done, 4);
    assert_eq!(state.ledger().entry(0).unwrap().details.value(), json!({ "particles": 5 }));
}

#[test]
fn a_selection_orders_and_limits_one_run() {
    let fixture = Fixture::new(1..=10);
    let mut request = fixture.request(1..=10);
    request.selection = Some(vec![10, 7, 4, 1]);
    let mut job = fixture.open(request).unwrap();
    assert_eq!(job.pending(), [10, 7, 4, 1]);
    fixture.finish(&mut job, 7);
    assert_eq!(job.summary().total, 4);
    assert_eq!(job.state().summary().total, 10);
    drop(job);
    let job = fixture.open(fixture.request(1..=10)).unwrap();
    assert_eq!(job.pending(), [1, 2, 3, 4, 5, 6, 8, 9, 10]);
}

#[test]
fn a_kill_between_image_and_ledger() {
    let fixture = Fixture::new(0..2);
    fixture.started(0..2, &[]);
    publish(&fixture.image(0), b"an image").unwrap();
    fs::write(fixture.dir().join(".frame.1.exr.host-7-ff.0.part"), b"half").unwrap();
    let job = fixture.open(fixture.request(0..2)).unwrap();
    assert_eq!(job.pending(), [0, 1]);
    assert!(!fixture.dir().join(".frame.1.exr.host-7-ff.0.part").exists());
}

#[test]
fn a_kill_within_a_ledger_line() {
    let fixture = Fixture::new(0..3);
    fixture.started(0..3, &[0, 1]);
    let whole = fs::read(fixture.ledger()).unwrap();
    fs::write(fixture.ledger(), &whole[..whole.len() - 5]).unwrap();
    let mut job = fixture.open(fixture.request(0..3)).unwrap();
    assert_eq!(job.pending(), [1, 2]);
    fixture.finish(&mut job, 2);
    drop(job);
    let job = fixture.open(fixture.request(0..3)).unwrap();
    assert_eq!(job.pending(), [1]);
}

#[test]
fn missing_and_truncated_images_are_repeated() {
    let fixture = Fixture::new(0..3);
    fixture.started(0..3, &[0, 1, 2]);
    fs::remove_file(fixture.image(0)).unwrap();
    fs::write(fixture.image(2), b"an ima").unwrap();
    let job = fixture.open(fixture.request(0..3)).unwrap();
    assert_eq!(job.pending(), [0, 2]);
    assert_eq!(job.summary().lost, [0, 2]);
    assert_eq!(job.state().frame_state(0), Some(FrameState::Lost));
}

#[test]
fn the_directory_may_be_moved() {
    let fixture = Fixture::new(0..2);
    fixture.started(0..2, &[0, 1]);
    let moved = fixture.root.path().join("elsewhere");
    fs::rename(fixture.dir(), &moved).unwrap();
    assert_eq!(Job::read(&moved).unwrap().unwrap().summary().done, 2);
}

#[test]
fn a_changed_setting_is_refused_by_name() {
    let fixture = Fixture::new(0..2);
    fixture.started(0..2, &[0]);
    let before = contents(&fixture.dir());
    let mut request = fixture.request(0..2);
    request.settings = settings(5);
    let error = Job::open(&fixture.dir(), request, never).unwrap_err();
    assert!(matches!(&error, JobError::SettingsChanged { changes, .. } if changes.len() == 1));
    let text = error.to_string();
    for part in ["out: ", "render.max_depth: 3 -> 5"] {
        assert!(text.contains(part), "{text}");
    }
    assert_eq!(contents(&fixture.dir()), before);
}

#[test]
fn keep_done_uses_the_new_settings_for_the_rest() {
    let fixture = Fixture::new(0..2);
    fixture.started(0..2, &[0]);
    let mut request = fixture.request(0..2);
    request.settings = settings(5);
    request.mode = ResumeMode::KeepDone;
    let job = Job::open(&fixture.dir(), request.clone(), |saved| {
        assert_eq!(saved, Some(&resolved()));
        Ok::<_, String>(json!({ "radius": 7 }))
    })
    .unwrap();
    assert_eq!(job.pending(), [1]);
    drop(job);
    request.mode = ResumeMode::Resume;
    let job = Job::open(&fixture.dir(), request, never).unwrap();
    assert_eq!(job.resolved(), &json!({ "radius": 7 }));
}

#[test]
fn done_under_another_name_is_not_done() {
    let fixture = Fixture::new(0..2);
    fixture.started(0..2, &[0, 1]);
    let mut request = fixture.request(0..2);
    request.mode = ResumeMode::KeepDone;
    request.frames[1].outputs = vec![fixture.dir().join("other.1.exr")];
    let job = fixture.open(request).unwrap();
    assert_eq!(job.pending(), [1]);
    assert_eq!(job.state().frame_state(1), Some(FrameState::Lost));
    drop(job);
    // An additional output is harmless
    let mut request = fixture.request(0..2);
    request.mode = ResumeMode::KeepDone;
    request.frames[0].outputs.clear();
    assert!(fixture.open(request).unwrap().pending().is_empty());
}

#[test]
fn force_starts_over_but_leaves_images() {
    let fixture = Fixture::new(0..2);
    fixture.started(0..2, &[0]);
    fs::write(fixture.dir().join("job.ledger.other.jsonl"), "damaged\n").unwrap();
    fs::write(fixture.dir().join(PLAN_FILE), "damaged").unwrap();
    let mut request = fixture.request(0..2);
    request.mode = ResumeMode::Force;
    let job = fixture.open(request).unwrap();
    assert_eq!(job.pending(), [0, 1]);
    assert!(fixture.image(0).exists());
}

#[test]
fn changed_input_of_a_finished_frame_is_refused_by_name() {
    let fixture = Fixture::new(0..4);
    fixture.started(0..4, &[0, 1]);
    // Frame 2 is not done: it will use the current file
    fixture.write_input(2, "more particles of 2");
    fixture.write_input(1, "more particles of 1");
    let error = Job::open(&fixture.dir(), fixture.request(0..4), never).unwrap_err();
    let JobError::InputChanged { changes, .. } = &error else { panic!("{error}") };
    let frames: Vec<i64> = changes.iter().map(|c| c.frame).collect();
    assert_eq!(frames, [1]);
    let text = error.to_string();
    for part in ["frame 1: ", "1.vtk", "length"] {
        assert!(text.contains(part), "{text}");
    }
    // A run without that frame is not affected
    let mut elsewhere = fixture.request(0..4);
    elsewhere.selection = Some(vec![2, 3]);
    assert_eq!(fixture.open(elsewhere).unwrap().pending(), [2, 3]);
    let mut keep = fixture.request(0..4);
    keep.mode = ResumeMode::KeepDone;
    assert_eq!(fixture.open(keep).unwrap().pending(), [2, 3]);
    // Accepted once, the change is not reported again
    assert_eq!(fixture.open(fixture.request(0..4)).unwrap().pending(), [2, 3]);
}

#[test]
fn unreadable_inputs_do_not_stop_the_rest() {
    let fixture = Fixture::new([0]);
    fixture.started(0..2, &[]);
    let job = fixture.open(fixture.request(0..2)).unwrap();
    assert_eq!(job.pending(), [0, 1]);
    assert_eq!(job.state().plan().frame(1).unwrap().inputs[0].fingerprint, None);
}

#[test]
fn appended_frames_join_under_the_saved_values() {
    let fixture = Fixture::new(-1..5);
    fixture.started(0..2, &[0, 1]);
    let job = Job::open(&fixture.dir(), fixture.request([4, 0, 1, -1]), never).unwrap();
    assert_eq!(job.pending(), [4, -1]);
    let plan = Job::read_plan(&fixture.dir()).unwrap().unwrap();
    let numbers: Vec<i64> = plan.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [-1, 0, 1, 4]);
    assert_eq!(plan.resolved(), &resolved());
}

#[test]
fn resuming_unchanged_writes_nothing() {
    let fixture = Fixture::new(0..3);
    fixture.started(0..3, &[1]);
    let before = contents(&fixture.dir());
    drop(fixture.open(fixture.request(0..3)).unwrap());
    assert_eq!(contents(&fixture.dir()), before);
}

#[test]
fn damage_is_an_error_and_never_a_fresh_start() {
    let fixture = Fixture::new(0..2);
    fixture.started(0..2, &[0, 1]);
    let plan = fixture.dir().join(PLAN_FILE);
    let good = fs::read(&plan).unwrap();

    fs::write(&plan, &good[..good.len() / 2]).unwrap();
    let error = fixture.open(fixture.request(0..2)).unwrap_err();
    assert!(matches!(error, JobError::PlanDamaged { .. }), "{error}");
    fs::remove_file(&plan).unwrap();
    let error = fixture.open(fixture.request(0..2)).unwrap_err();
    assert!(matches!(error, JobError::PlanMissing { .. }), "{error}");
    fs::write(&plan, &good).unwrap();

    let ledger = fs::read_to_string(fixture.ledger()).unwrap();
    fs::write(fixture.ledger(), ledger.replacen('{', "", 1)).unwrap();
    let error = fixture.open(fixture.request(0..2)).unwrap_err();
    assert!(matches!(error, JobError::LedgerDamaged { line: 1, .. }), "{error}");
    assert!(Job::read(&fixture.dir()).is_err());
}

#[test]
fn several_workers_share_the_frames() {
    let fixture = Fixture::new(0..4);
    let mut a = fixture.open(fixture.request(0..4)).unwrap();
    let mut b = Job::open(&fixture.dir(), fixture.request(0..4), never).unwrap();
    let claim = |job: &Job, frame| job.claims().claim(frame).unwrap();
    let ClaimOutcome::Acquired(zero) = claim(&a, 0) else { panic!("the frame is free") };
    assert!(matches!(claim(&b, 0), ClaimOutcome::Held(_)));
    let ClaimOutcome::Acquired(one) = claim(&b, 1) else { panic!("the frame is free") };
    fixture.finish(&mut a, 0);
    zero.complete();
    b.record_failed(&failure(1, "damaged")).unwrap();
    one.complete();
    assert!(matches!(claim(&b, 0), ClaimOutcome::Finished(EntryStatus::Done)));
    assert!(matches!(claim(&a, 1), ClaimOutcome::Finished(EntryStatus::Failed)));
    let ClaimOutcome::Acquired(dropped) = claim(&a, 2) else { panic!("the frame is free") };
    drop(dropped);
    assert!(matches!(claim(&b, 2), ClaimOutcome::Acquired(_)));
    a.refresh().unwrap();
    assert_eq!((a.summary().done, a.summary().failed), (1, vec![1]));
    assert_eq!(fixture.ledgers().len(), 2);
    drop((a, b));
    assert!(!fixture.dir().join("job.work").exists());

    // A new run retries failed frames
    let job = fixture.open(fixture.request(0..4)).unwrap();
    assert_eq!(job.pending(), [1, 2, 3]);
    assert!(matches!(claim(&job, 1), ClaimOutcome::Acquired(_)));
}

// Each refusal waits for the next heartbeat of the active worker.
#[test]
fn settings_of_active_workers_do_not_change() {
    let fixture = Fixture::new(0..2);
    let active = fixture.open(fixture.request(0..2)).unwrap();
    let with =
        |mode, depth| JobRequest { mode, settings: settings(depth), ..fixture.request(0..2) };
    for (mode, depth) in [(ResumeMode::Force, 3), (ResumeMode::KeepDone, 5)] {
        let error = fixture.open(with(mode, depth)).unwrap_err();
        assert!(matches!(error, JobError::Busy { .. }), "{error}");
    }
    fixture.open(with(ResumeMode::KeepDone, 3)).unwrap();
    drop(active);
    fixture.open(with(ResumeMode::KeepDone, 5)).unwrap();
    fixture.open(with(ResumeMode::Force, 3)).unwrap();
}

#[test]
fn frames_with_changed_inputs_are_requeued_on_request() {
    let fixture = Fixture::new(0..3);
    fixture.started(0..3, &[0, 1]);
    fs::write(fixture.input(1), "one that has grown").unwrap();
    fs::remove_file(fixture.input(0)).unwrap();
    let request = |selection: &[i64]| JobRequest {
        mode: ResumeMode::RequeueChanged,
        selection: Some(selection.to_vec()),
        ..fixture.request(0..3)
    };
    let error =
        fixture.open(JobRequest { mode: ResumeMode::Resume, ..request(&[1, 2]) }).unwrap_err();
    assert!(matches!(error, JobError::InputChanged { .. }), "{error}");
    let dry_run = Job::dry_run(&fixture.dir(), &request(&[2, 1, 0])).unwrap();
    assert_eq!(dry_run.pending(), [2, 1]);
    assert_eq!(dry_run.requeued.len(), 1);

    // Other frames are not checked
    let job = fixture.open(request(&[2])).unwrap();
    assert_eq!((job.pending(), job.requeued()), (vec![2], &[][..]));
    drop(job);
    let mut job = fixture.open(request(&[2, 1, 0])).unwrap();
    assert_eq!(job.requeued(), dry_run.requeued);
    assert_eq!(job.selected(), [2, 1, 0]);
    assert_eq!(job.pending(), [2, 1]);
    fixture.finish(&mut job, 1);
    drop(job);
    let job = fixture.open(request(&[2, 1, 0])).unwrap();
    assert_eq!((job.pending(), job.requeued()), (vec![2], &[][..]));
    drop(job);
    let other = JobRequest { settings: settings(5), ..request(&[2]) };
    let error = fixture.open(other).unwrap_err();
    assert!(matches!(error, JobError::SettingsChanged { .. }), "{error}");
}

#[test]
fn workers_that_start_together_create_one_plan() {
    let fixture = Fixture::new(0..20);
    let resolved: Vec<Value> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..4)
            .map(|worker| {
                let fixture = &fixture;
                scope.spawn(move || {
                    let request = fixture.request(0..20);
                    let resolve = |_: Option<&Value>| Ok::<_, String>(json!(worker));
                    let mut job = Job::open(&fixture.dir(), request, resolve).unwrap();
                    for frame in job.pending() {
                        if let ClaimOutcome::Acquired(claim) = job.claims().claim(frame).unwrap() {
                            fixture.finish(&mut job, frame);
                            claim.complete();
                        }
                    }
                    job.resolved().clone()
                })
            })
            .collect();
        workers.into_iter().map(|w| w.join().unwrap()).collect()
    });
    assert!(resolved.iter().all(|r| *r == resolved[0]), "{resolved:?}");
    let lines: usize = fixture
        .ledgers()
        .iter()
        .map(|path| fs::read_to_string(path).unwrap().lines().count())
        .sum();
    assert_eq!(lines, 20, "each frame was done once");
    assert!(!fixture.dir().join("job.work").exists());
}

#[test]
fn ledgers_are_compacted() {
    let fixture = Fixture::new(0..20);
    for frame in 0..20 {
        let mut job = fixture.open(fixture.request(0..20)).unwrap();
        assert_eq!(job.pending().len(), usize::try_from(20 - frame).unwrap());
        fixture.finish(&mut job, frame);
    }
    assert!(fixture.ledgers().len() < 11, "{:?}", fixture.ledgers());
    assert_eq!(Job::read(&fixture.dir()).unwrap().unwrap().summary().done, 20);
}

#[test]
fn inconsistent_requests_are_refused() {
    let fixture = Fixture::new(0..2);
    let refused = |request: JobRequest, what: &str| {
        let error = fixture.open(request).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
        assert!(!fixture.dir().exists());
    };
    refused(fixture.request([0, 0]), "frame 0 occurs twice");
    let mut request = fixture.request(0..2);
    request.frames[1].outputs = vec![fixture.image(0)];
    refused(request, "frames 0 and 1 have the same output");
}

#[test]
fn records_need_a_planned_frame_and_its_output() {
    let fixture = Fixture::new(0..2);
    let mut job = fixture.open(fixture.request(0..2)).unwrap();
    let error = job.record_done(0, &[fixture.image(0)], Value::Null).unwrap_err();
    assert!(error.to_string().contains("frame.0.exr"), "{error}");
    assert!(job.record_failed(&failure(9, "why")).is_err());
    assert!(fixture.ledgers().is_empty());
    assert_eq!(job.pending(), [0, 1]);
}

#[test]
fn a_failure_to_resolve_is_returned_and_leaves_no_plan() {
    let fixture = Fixture::new(0..2);
    let error =
        Job::open(&fixture.dir(), fixture.request(0..2), |_| Err("no particles")).unwrap_err();
    assert_eq!(error.to_string(), "no particles");
    assert!(Job::read_plan(&fixture.dir()).unwrap().is_none());
}

#[test]
fn a_file_in_place_of_the_directory_is_named() {
    let fixture = Fixture::new(0..1);
    fs::write(fixture.dir(), "a file is in the way").unwrap();
    let error = fixture.open(fixture.request(0..1)).unwrap_err().to_string();
    assert!(error.contains("out: "), "{error}");
}

/// Has no effect if the tests run as root, who may write anywhere.
#[cfg(unix)]
#[test]
fn an_unwritable_directory_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let fixture = Fixture::new(0..1);
    fs::create_dir(fixture.dir()).unwrap();
    fs::set_permissions(fixture.dir(), fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(fixture.dir().join("probe"), "").is_ok() {
        return;
    }
    let error = fixture.open(fixture.request(0..1)).unwrap_err();
    assert!(matches!(error, JobError::File(FileError::Unwritable { .. })), "{error}");
}

/// Work of a worker that is suspended, declared dead and revived: its temporary file is gone.
struct Revived {
    work_dir: PathBuf,
}

impl FrameWork for Revived {
    type Report = ();

    fn process(
        &self,
        frame: &ClaimedFrame,
        _: &RunContext<'_, ()>,
    ) -> Result<FinishedFrame<()>, FrameFailure> {
        for entry in fs::read_dir(&self.work_dir).unwrap() {
            fs::remove_file(entry.unwrap().path()).unwrap();
        }
        let path = Path::new("f.exr");
        let gone = std::io::ErrorKind::NotFound.into();
        Err(FrameFailure::writing(frame.frame, path, gone))
    }
}

#[test]
fn a_revived_worker_reports_that_it_was_declared_dead() {
    let fixture = Fixture::new(0..2);
    let mut job = fixture.open(fixture.request(0..2)).unwrap();
    let work = Revived { work_dir: fixture.dir().join("job.work") };
    let options = RunOptions { frames: job.pending(), retries: 0, interrupt: Interrupt::default() };
    let error = run_frames(&mut job, &work, &options, &|_| {}).unwrap_err();
    assert!(matches!(error, JobError::DeclaredDead { .. }), "{error}");
}
