//! What a job keeps on disk: plan, ledgers, and in `job.work` cards and claims.

use std::convert::Infallible;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use serde_json::Value;
use spherule::conversion::Conversion;
use spherule::manifest::Manifest;
use spherule::report::job::JobReport;
use spherule::resolve::{check_views, setup};
use spherule::survey::Survey;
use spherule_jobs::{
    Claimed, FrameRequest, Job, JobRequest, JobState, Mode, PLAN_FILE, Plan, settings_hash,
};
use tempfile::TempDir;

/// A job's directory beside a file that is none of its business.
struct Place {
    dir: TempDir,
}

impl Place {
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let place = Self { dir };
        fs::create_dir_all(place.work()).expect("writable");
        fs::write(place.bystander(), "").expect("writable");
        place
    }

    fn job(&self) -> PathBuf {
        self.dir.path().join("job")
    }

    fn work(&self) -> PathBuf {
        self.job().join("job.work")
    }

    /// Named like a card, for names that lead out of the directory: `../../a`.
    fn bystander(&self) -> PathBuf {
        self.dir.path().join("a.worker")
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.job().join(name), bytes).expect("writable");
    }
}

/// Three frames of files that are not there.
fn request(dir: &Path) -> JobRequest {
    let frame = |number: i64| FrameRequest {
        number,
        inputs: vec![PathBuf::from(format!("in/f.{number}.vtk"))],
        outputs: vec![dir.join(format!("f.{number}.exr"))],
    };
    JobRequest {
        settings: vec![("image.width".to_owned(), "64".to_owned())],
        frames: [1, 2, 40].map(frame).to_vec(),
        extra_outputs: Vec::new(),
        selection: None,
        mode: Mode::Resume,
        patience: Duration::ZERO,
    }
}

fn open(dir: &Path) -> Result<Job, String> {
    let settled = |_: Option<&Value>| Ok::<_, Infallible>(Value::Null);
    Job::open(dir, request(dir), settled).map_err(|error| error.to_string())
}

/// The plan of the job that is asked for.
static PLAN: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let place = Place::new();
    open(&place.job()).expect("a new job");
    fs::read(place.job().join(PLAN_FILE)).expect("a plan")
});

/// A plan: as it is, and with the checksum put right that mutation would never hit.
pub fn plan(bytes: &[u8]) -> usize {
    let repaired = repaired(bytes).map_or(0, |bytes| read_plan(&bytes));
    read_plan(bytes) + repaired
}

fn repaired(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut file: Value = serde_json::from_slice(bytes).ok()?;
    if let Some(plan) = file.get("plan") {
        let text = plan.to_string();
        let (version, sum) = (file.get("version")?, blake3::hash(text.as_bytes()).to_hex());
        let sealed = format!(r#"{{"version":{version},"blake3":"{sum}","plan":{text}}}"#);
        return Some(sealed.into_bytes());
    }
    let settings = serde_json::from_value::<Vec<(String, String)>>(file.get("settings")?.clone());
    *file.get_mut("settings_blake3")? = settings_hash(&settings.ok()?).into();
    serde_json::to_vec(&file).ok()
}

fn read_plan(bytes: &[u8]) -> usize {
    let place = Place::new();
    place.write(PLAN_FILE, bytes);
    match Job::peek(&place.job()) {
        Ok(plan) => look_at(&plan.expect("there is a file")),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return 0;
        }
    }
    let state = Job::read(&place.job())
        .expect("as it was")
        .expect("as it was");
    report(&state);
    // Whether it goes on or refuses.
    let _ = open(&place.job());
    state.plan().frames().len()
}

/// What was settled when the job began, as `render` and `convert` take it.
fn look_at(plan: &Plan) {
    let numbers = plan.frames().iter().map(|frame| frame.number);
    assert!(numbers.clone().all(|number| plan.frame(number).is_some()));
    let Ok(survey) = serde_json::from_value::<Survey>(plan.resolved().clone()) else {
        return;
    };
    let _ = setup(&Manifest::new("in"), &survey, None)
        .map(|setup| check_views(&setup, numbers).is_ok());
    let _ = Conversion::new(conversion(), &survey);
}

fn conversion() -> spherule::conversion::ConvertSettings {
    spherule::conversion::ConvertSettings {
        encoding: None,
        bound: spherule_formats::native::Bound::OfRadius(1e-3),
        radius: None,
        attributes: Default::default(),
        keep_ids: true,
        memory: None,
    }
}

/// Both files of the report, of which the one for scripts can be read.
fn report(state: &JobState) {
    let files = JobReport::new(state, &Manifest::new("in")).files();
    let [(_, json), (_, html)] = &files[..] else {
        panic!("two files");
    };
    assert!(serde_json::from_str::<Value>(json).is_ok(), "{json}");
    assert!(html.contains("</html>"));
}

/// A ledger. Images that it tells of are there if they are named like those of the plan, without a byte.
pub fn ledger(bytes: &[u8]) -> usize {
    let place = Place::new();
    place.write(PLAN_FILE, &PLAN);
    place.write("job.ledger.a.jsonl", bytes);
    place.write("f.1.exr", b"");
    place.write("f.2.exr", b"");
    match Job::read(&place.job()) {
        Ok(state) => {
            let state = state.expect("there is a plan");
            report(&state);
            assert_eq!(state.summary().total, 3);
            state.ledger().entries().count()
        }
        Err(error) => {
            assert!(error.to_string().contains("job.ledger.a.jsonl"));
            0
        }
    }
}

/// A card.
pub fn card(bytes: &[u8]) -> usize {
    let place = Place::new();
    fs::write(place.work().join("a.worker"), bytes).expect("writable");
    let workers = Job::workers(&place.job()).expect("a readable directory");
    workers.len()
}

/// Lines: a card, a claim of the first frame, one that follows it, and one of the second. A job is opened, which
/// clears away what the dead have left, and its frames are claimed, since all others are silent.
pub fn claim(bytes: &[u8]) -> usize {
    let place = Place::new();
    place.write(PLAN_FILE, &PLAN);
    let write = |names: &[&str]| {
        for (name, line) in names.iter().zip(bytes.split(|b| *b == b'\n')) {
            fs::write(place.work().join(name), line).expect("writable");
        }
    };
    write(&["a.worker", "frame.1.0", "frame.1.1", "frame.2.0"]);
    let seen = Job::workers(&place.job())
        .expect("a readable directory")
        .len();
    if let Ok(job) = open(&place.job()) {
        write(&["b.worker", "frame.1.0", "frame.1.1", "frame.2.0"]);
        take(&job);
    }
    assert!(place.bystander().exists(), "a file outside the job is gone");
    assert!(place.job().join(PLAN_FILE).exists());
    seen
}

fn take(job: &Job) {
    let claims = job.claims();
    for frame in [1, 2] {
        match claims.take(frame) {
            Ok(Claimed::Mine(claim)) => claim.end(),
            Ok(Claimed::Held(who)) => assert!(!who.is_empty()),
            Ok(Claimed::Ended(_)) => panic!("nobody has"),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}
