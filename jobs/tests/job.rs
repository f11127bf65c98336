//! Jobs as their callers see them: killed, resumed, changed, damaged.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use spherule_jobs::{
    Claimed, DEFAULT_PATIENCE, FrameRequest, FrameState, Job, JobError, JobRequest, Mode,
    PLAN_FILE, Status, publish,
};
use tempfile::TempDir;

/// Data and images in a directory of their own.
struct Place {
    root: TempDir,
}

impl Place {
    fn new(frames: impl IntoIterator<Item = i64>) -> Self {
        let place = Self {
            root: tempfile::tempdir().unwrap(),
        };
        fs::create_dir(place.root.path().join("data")).unwrap();
        for frame in frames {
            place.write_input(frame, &format!("particles of {frame}"));
        }
        place
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

    /// Those of all workers that have said something.
    fn ledgers(&self) -> Vec<PathBuf> {
        let paths = fs::read_dir(self.dir()).unwrap().map(|e| e.unwrap().path());
        let mut ledgers: Vec<PathBuf> = paths
            .filter(|p| p.extension().is_some_and(|e| e == "jsonl"))
            .collect();
        ledgers.sort();
        ledgers
    }

    /// That of the only worker so far.
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
                    outputs: vec![self.image(number)],
                })
                .collect(),
            extra_outputs: vec![self.dir().join("report.html")],
            selection: None,
            mode: Mode::Resume,
            patience: DEFAULT_PATIENCE,
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
        job.record_done(frame, &[self.image(frame)], json!({ "particles": 5 }))
            .unwrap();
    }
}

fn settings(depth: u32) -> Vec<(String, String)> {
    vec![
        ("image.width".to_owned(), "64".to_owned()),
        ("render.max_depth".to_owned(), depth.to_string()),
    ]
}

fn resolved() -> Value {
    json!({ "radius": 0.1 + 0.2 })
}

fn never(_: Option<&Value>) -> Result<Value, String> {
    panic!("what is saved must be used")
}

fn contents(dir: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<_> = fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap())
        .map(|e| {
            (
                e.file_name().into_string().unwrap(),
                fs::read(e.path()).unwrap(),
            )
        })
        .collect();
    all.sort();
    all
}

#[test]
fn runs_resumes_and_retries_what_failed() {
    let place = Place::new(0..4);
    let mut job = place.open(place.request(0..4)).unwrap();
    assert_eq!(job.pending(), [0, 1, 2, 3]);
    place.finish(&mut job, 0);
    job.record_failed(1, "byte 9: damaged", Value::Null)
        .unwrap();
    let summary = job.summary();
    assert_eq!((summary.done, summary.pending), (1, 2));
    assert_eq!(summary.failed, [1]);
    drop(job);

    let mut job = Job::open(&place.dir(), place.request(0..4), never).unwrap();
    assert_eq!(job.resolved(), &resolved());
    assert_eq!(job.pending(), [1, 2, 3]);
    let failed = job.state().ledger().entry(1).unwrap();
    assert_eq!(failed.reason.as_deref(), Some("byte 9: damaged"));
    for frame in job.pending() {
        place.finish(&mut job, frame);
    }
    assert_eq!(job.summary().done, 4);
    let state = Job::read(&place.dir()).unwrap().unwrap();
    assert_eq!(state.summary().done, 4);
    assert_eq!(
        state.ledger().entry(0).unwrap().details.value(),
        json!({ "particles": 5 })
    );
}

#[test]
fn selection_orders_and_limits_but_is_not_remembered() {
    let place = Place::new(1..=10);
    let mut request = place.request(1..=10);
    request.selection = Some(vec![10, 7, 4, 1]);
    let mut job = place.open(request).unwrap();
    assert_eq!(job.pending(), [10, 7, 4, 1]);
    place.finish(&mut job, 7);
    assert_eq!(job.summary().total, 4);
    assert_eq!(job.state().summary().total, 10);
    drop(job);
    let job = place.open(place.request(1..=10)).unwrap();
    assert_eq!(job.pending(), [1, 2, 3, 4, 5, 6, 8, 9, 10]);
}

#[test]
fn killed_between_image_and_ledger() {
    let place = Place::new(0..2);
    place.started(0..2, &[]);
    publish(&place.image(0), b"an image").unwrap();
    fs::write(place.dir().join(".frame.1.exr.host-7-ff.0.part"), b"half").unwrap();
    let job = place.open(place.request(0..2)).unwrap();
    assert_eq!(job.pending(), [0, 1]);
    assert!(!place.dir().join(".frame.1.exr.host-7-ff.0.part").exists());
}

#[test]
fn killed_within_a_ledger_line() {
    let place = Place::new(0..3);
    place.started(0..3, &[0, 1]);
    let whole = fs::read(place.ledger()).unwrap();
    fs::write(place.ledger(), &whole[..whole.len() - 5]).unwrap();
    let mut job = place.open(place.request(0..3)).unwrap();
    assert_eq!(job.pending(), [1, 2]);
    place.finish(&mut job, 2);
    drop(job);
    let job = place.open(place.request(0..3)).unwrap();
    assert_eq!(job.pending(), [1]);
}

#[test]
fn lost_and_shortened_images_are_made_again() {
    let place = Place::new(0..3);
    place.started(0..3, &[0, 1, 2]);
    fs::remove_file(place.image(0)).unwrap();
    fs::write(place.image(2), b"an ima").unwrap();
    let job = place.open(place.request(0..3)).unwrap();
    assert_eq!(job.pending(), [0, 2]);
    assert_eq!(job.summary().lost, [0, 2]);
    assert_eq!(job.state().frame_state(0), Some(FrameState::Lost));
}

#[test]
fn the_directory_may_be_moved() {
    let place = Place::new(0..2);
    place.started(0..2, &[0, 1]);
    let moved = place.root.path().join("elsewhere");
    fs::rename(place.dir(), &moved).unwrap();
    assert_eq!(Job::read(&moved).unwrap().unwrap().summary().done, 2);
}

#[test]
fn changed_setting_is_refused_by_name() {
    let place = Place::new(0..2);
    place.started(0..2, &[0]);
    let before = contents(&place.dir());
    let mut request = place.request(0..2);
    request.settings = settings(5);
    let error = Job::open(&place.dir(), request, never).unwrap_err();
    assert!(matches!(&error, JobError::SettingsChanged { changes, .. } if changes.len() == 1));
    let text = error.to_string();
    for part in ["render.max_depth: 3 -> 5", "--force", "--keep-done"] {
        assert!(text.contains(part), "{text}");
    }
    assert_eq!(contents(&place.dir()), before);
}

#[test]
fn keep_done_takes_the_new_settings_for_the_rest() {
    let place = Place::new(0..2);
    place.started(0..2, &[0]);
    let mut request = place.request(0..2);
    request.settings = settings(5);
    request.mode = Mode::KeepDone;
    let job = Job::open(&place.dir(), request.clone(), |saved| {
        assert_eq!(saved, Some(&resolved()));
        Ok::<_, String>(json!({ "radius": 7 }))
    })
    .unwrap();
    assert_eq!(job.pending(), [1]);
    drop(job);
    request.mode = Mode::Resume;
    let job = Job::open(&place.dir(), request, never).unwrap();
    assert_eq!(job.resolved(), &json!({ "radius": 7 }));
}

#[test]
fn done_under_another_name_is_not_done() {
    let place = Place::new(0..2);
    place.started(0..2, &[0, 1]);
    let mut request = place.request(0..2);
    request.mode = Mode::KeepDone;
    request.frames[1].outputs = vec![place.dir().join("other.1.exr")];
    let job = place.open(request).unwrap();
    assert_eq!(job.pending(), [1]);
    assert_eq!(job.state().frame_state(1), Some(FrameState::Lost));
    drop(job);
    // What was made beside the wanted image does no harm.
    let mut request = place.request(0..2);
    request.mode = Mode::KeepDone;
    request.frames[0].outputs.clear();
    assert!(place.open(request).unwrap().pending().is_empty());
}

#[test]
fn force_starts_over_but_leaves_images() {
    let place = Place::new(0..2);
    place.started(0..2, &[0]);
    fs::write(place.dir().join("job.ledger.other.jsonl"), "damaged\n").unwrap();
    fs::write(place.dir().join(PLAN_FILE), "damaged").unwrap();
    let mut request = place.request(0..2);
    request.mode = Mode::Force;
    let job = place.open(request).unwrap();
    assert_eq!(job.pending(), [0, 1]);
    assert!(place.image(0).exists());
}

#[test]
fn changed_input_of_a_finished_frame_is_refused_by_name() {
    let place = Place::new(0..4);
    place.started(0..4, &[0, 1]);
    // Frame 2 is not done: it will simply be made from what is there now.
    place.write_input(2, "more particles of 2");
    place.write_input(1, "more particles of 1");
    let error = Job::open(&place.dir(), place.request(0..4), never).unwrap_err();
    let JobError::InputChanged { changes, .. } = &error else {
        panic!("{error}")
    };
    let frames: Vec<i64> = changes.iter().map(|c| c.frame).collect();
    assert_eq!(frames, [1]);
    let text = error.to_string();
    for part in ["frame 1: ", "1.vtk", "length", "--force", "--keep-done"] {
        assert!(text.contains(part), "{text}");
    }
    // A run that does not touch that frame need not care.
    let mut elsewhere = place.request(0..4);
    elsewhere.selection = Some(vec![2, 3]);
    assert_eq!(place.open(elsewhere).unwrap().pending(), [2, 3]);
    let mut keep = place.request(0..4);
    keep.mode = Mode::KeepDone;
    assert_eq!(place.open(keep).unwrap().pending(), [2, 3]);
    // That was agreed to once, and is not asked again.
    assert_eq!(place.open(place.request(0..4)).unwrap().pending(), [2, 3]);
}

#[test]
fn unreadable_inputs_do_not_stop_the_rest() {
    let place = Place::new([0]);
    place.started(0..2, &[]);
    let job = place.open(place.request(0..2)).unwrap();
    assert_eq!(job.pending(), [0, 1]);
    assert_eq!(
        job.state().plan().frame(1).unwrap().inputs[0].fingerprint,
        None
    );
}

#[test]
fn appended_frames_join_under_the_saved_values() {
    let place = Place::new(-1..5);
    place.started(0..2, &[0, 1]);
    let job = Job::open(&place.dir(), place.request([4, 0, 1, -1]), never).unwrap();
    assert_eq!(job.pending(), [4, -1]);
    let plan = Job::peek(&place.dir()).unwrap().unwrap();
    let numbers: Vec<i64> = plan.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [-1, 0, 1, 4]);
    assert_eq!(plan.resolved(), &resolved());
}

#[test]
fn resuming_unchanged_writes_nothing() {
    let place = Place::new(0..3);
    place.started(0..3, &[1]);
    let before = contents(&place.dir());
    drop(place.open(place.request(0..3)).unwrap());
    assert_eq!(contents(&place.dir()), before);
}

#[test]
fn damage_is_an_error_and_never_a_fresh_start() {
    let place = Place::new(0..2);
    place.started(0..2, &[0, 1]);
    let plan = place.dir().join(PLAN_FILE);
    let good = fs::read(&plan).unwrap();

    fs::write(&plan, &good[..good.len() / 2]).unwrap();
    let error = place.open(place.request(0..2)).unwrap_err();
    assert!(matches!(error, JobError::PlanDamaged { .. }), "{error}");
    fs::remove_file(&plan).unwrap();
    let error = place.open(place.request(0..2)).unwrap_err();
    assert!(matches!(error, JobError::PlanMissing { .. }), "{error}");
    fs::write(&plan, &good).unwrap();

    let ledger = fs::read_to_string(place.ledger()).unwrap();
    fs::write(place.ledger(), ledger.replacen('{', "", 1)).unwrap();
    let error = place.open(place.request(0..2)).unwrap_err();
    assert!(
        matches!(error, JobError::LedgerDamaged { line: 1, .. }),
        "{error}"
    );
    assert!(error.to_string().contains("--force"), "{error}");
    assert!(Job::read(&place.dir()).is_err());
}

#[test]
fn several_workers_share_the_frames() {
    let place = Place::new(0..4);
    let mut a = place.open(place.request(0..4)).unwrap();
    let mut b = Job::open(&place.dir(), place.request(0..4), never).unwrap();
    let take = |job: &Job, frame| job.claims().take(frame).unwrap();
    let Claimed::Mine(zero) = take(&a, 0) else {
        panic!("nobody else has it")
    };
    assert!(matches!(take(&b, 0), Claimed::Held(_)));
    let Claimed::Mine(one) = take(&b, 1) else {
        panic!("nobody else has it")
    };
    place.finish(&mut a, 0);
    zero.end();
    b.record_failed(1, "damaged", Value::Null).unwrap();
    one.end();
    assert!(matches!(take(&b, 0), Claimed::Ended(Status::Done)));
    assert!(matches!(take(&a, 1), Claimed::Ended(Status::Failed)));
    let Claimed::Mine(given_back) = take(&a, 2) else {
        panic!("nobody has it")
    };
    drop(given_back);
    assert!(matches!(take(&b, 2), Claimed::Mine(_)));
    a.refresh().unwrap();
    assert_eq!((a.summary().done, a.summary().failed), (1, vec![1]));
    assert_eq!(place.ledgers().len(), 2);
    drop((a, b));
    assert!(!place.dir().join("job.work").exists());

    // A new run tries again what failed.
    let job = place.open(place.request(0..4)).unwrap();
    assert_eq!(job.pending(), [1, 2, 3]);
    assert!(matches!(take(&job, 1), Claimed::Mine(_)));
}

#[test]
fn what_others_rely_on_does_not_change_under_them() {
    let place = Place::new(0..2);
    let at_work = place.open(place.request(0..2)).unwrap();
    let with = |mode, depth| JobRequest {
        mode,
        settings: settings(depth),
        ..place.request(0..2)
    };
    for (mode, depth) in [(Mode::Force, 3), (Mode::KeepDone, 5)] {
        let error = place.open(with(mode, depth)).unwrap_err();
        assert!(matches!(error, JobError::Busy { .. }), "{error}");
    }
    place.open(with(Mode::KeepDone, 3)).unwrap();
    drop(at_work);
    place.open(with(Mode::KeepDone, 5)).unwrap();
    place.open(with(Mode::Force, 3)).unwrap();
}

#[test]
fn changed_inputs_are_made_again_where_that_is_asked_for() {
    let place = Place::new(0..3);
    place.started(0..3, &[0, 1]);
    fs::write(place.input(1), "one that has grown").unwrap();
    fs::remove_file(place.input(0)).unwrap();
    let request = |selection: &[i64]| JobRequest {
        mode: Mode::RequeueChanged,
        selection: Some(selection.to_vec()),
        ..place.request(0..3)
    };
    let error = place
        .open(JobRequest {
            mode: Mode::Resume,
            ..request(&[1, 2])
        })
        .unwrap_err();
    assert!(matches!(error, JobError::InputChanged { .. }), "{error}");
    let foreseen = Job::foresee(&place.dir(), &request(&[2, 1, 0])).unwrap();
    assert_eq!(foreseen.pending(), [2, 1]);
    assert_eq!(foreseen.requeued.len(), 1);

    // Others are not looked at.
    let job = place.open(request(&[2])).unwrap();
    assert_eq!((job.pending(), job.requeued()), (vec![2], &[][..]));
    drop(job);
    let mut job = place.open(request(&[2, 1, 0])).unwrap();
    assert_eq!(job.requeued(), foreseen.requeued);
    assert_eq!(job.selected(), [2, 1, 0]);
    assert_eq!(job.pending(), [2, 1]);
    place.finish(&mut job, 1);
    drop(job);
    let job = place.open(request(&[2, 1, 0])).unwrap();
    assert_eq!((job.pending(), job.requeued()), (vec![2], &[][..]));
    drop(job);
    let other = JobRequest {
        settings: settings(5),
        ..request(&[2])
    };
    let error = place.open(other).unwrap_err();
    assert!(matches!(error, JobError::SettingsChanged { .. }), "{error}");
}

#[test]
fn workers_that_begin_at_once_make_one_plan() {
    let place = Place::new(0..20);
    let resolved: Vec<Value> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..4)
            .map(|worker| {
                let place = &place;
                scope.spawn(move || {
                    let request = place.request(0..20);
                    let resolve = |_: Option<&Value>| Ok::<_, String>(json!(worker));
                    let mut job = Job::open(&place.dir(), request, resolve).unwrap();
                    for frame in job.pending() {
                        if let Claimed::Mine(claim) = job.claims().take(frame).unwrap() {
                            place.finish(&mut job, frame);
                            claim.end();
                        }
                    }
                    job.resolved().clone()
                })
            })
            .collect();
        workers.into_iter().map(|w| w.join().unwrap()).collect()
    });
    assert!(resolved.iter().all(|r| *r == resolved[0]), "{resolved:?}");
    let lines: usize = place
        .ledgers()
        .iter()
        .map(|path| fs::read_to_string(path).unwrap().lines().count())
        .sum();
    assert_eq!(lines, 20, "each frame was done once");
    assert!(!place.dir().join("job.work").exists());
}

#[test]
fn many_ledgers_become_one() {
    let place = Place::new(0..20);
    for frame in 0..20 {
        let mut job = place.open(place.request(0..20)).unwrap();
        assert_eq!(job.pending().len(), usize::try_from(20 - frame).unwrap());
        place.finish(&mut job, frame);
    }
    assert!(place.ledgers().len() < 11, "{:?}", place.ledgers());
    assert_eq!(Job::read(&place.dir()).unwrap().unwrap().summary().done, 20);
}

#[test]
fn requests_that_contradict_themselves() {
    let place = Place::new(0..2);
    let refused = |request: JobRequest, what: &str| {
        let error = place.open(request).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
        assert!(!place.dir().exists());
    };
    refused(place.request([0, 0]), "frame 0 is there twice");
    let mut request = place.request(0..2);
    request.frames[1].outputs = vec![place.image(0)];
    refused(request, "####");
}

#[test]
fn records_need_a_planned_frame_and_its_output() {
    let place = Place::new(0..2);
    let mut job = place.open(place.request(0..2)).unwrap();
    let error = job
        .record_done(0, &[place.image(0)], Value::Null)
        .unwrap_err();
    assert!(error.to_string().contains("frame.0.exr"), "{error}");
    assert!(job.record_failed(9, "why", Value::Null).is_err());
    assert!(place.ledgers().is_empty());
    assert_eq!(job.pending(), [0, 1]);
}

#[test]
fn failure_to_resolve_is_handed_on_and_leaves_no_plan() {
    let place = Place::new(0..2);
    let error = Job::open(&place.dir(), place.request(0..2), |_| Err("no particles")).unwrap_err();
    assert_eq!(error.to_string(), "no particles");
    assert!(Job::peek(&place.dir()).unwrap().is_none());
}

#[test]
fn directories_that_cannot_be() {
    let place = Place::new(0..1);
    fs::write(place.dir(), "a file is in the way").unwrap();
    let error = place.open(place.request(0..1)).unwrap_err().to_string();
    assert!(error.contains("out: "), "{error}");
}

/// Root may write anywhere, so this can only be seen by others.
#[cfg(unix)]
#[test]
fn unwritable_directory_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let place = Place::new(0..1);
    fs::create_dir(place.dir()).unwrap();
    fs::set_permissions(place.dir(), fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(place.dir().join("probe"), "").is_ok() {
        return;
    }
    let error = place.open(place.request(0..1)).unwrap_err();
    assert!(matches!(error, JobError::Unwritable { .. }), "{error}");
}
