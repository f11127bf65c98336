//! The files of a job: plan, ledgers, and in `job.work` worker records and claims.

use std::convert::Infallible;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use serde_json::Value;
use spherule::conversion::Conversion;
use spherule::manifest::Manifest;
use spherule::report::job::JobReport;
use spherule::resolve::{SceneInputs, check_views, setup};
use spherule::survey::Survey;
use spherule_jobs::{
    ClaimOutcome, FrameRequest, Job, JobRequest, JobState, PLAN_FILE, Plan, ResumeMode,
    settings_hash,
};
use tempfile::TempDir;

/// The directory of a job, and a file outside of it.
struct JobDir {
    dir: TempDir,
}

impl JobDir {
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let job_dir = Self { dir };
        fs::create_dir_all(job_dir.work()).expect("writable");
        fs::write(job_dir.bystander(), "").expect("writable");
        job_dir
    }

    fn job(&self) -> PathBuf {
        self.dir.path().join("job")
    }

    fn work(&self) -> PathBuf {
        self.job().join("job.work")
    }

    /// Named like a worker record, for names that lead out of the directory: `../../a`.
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
        companions: Vec::new(),
        outputs: vec![dir.join(format!("f.{number}.exr"))],
    };
    JobRequest {
        settings: vec![("image.width".to_owned(), "64".to_owned())],
        frames: [1, 2, 40].map(frame).to_vec(),
        extra_outputs: Vec::new(),
        selection: None,
        mode: ResumeMode::Resume,
        takeover_after: Duration::ZERO,
    }
}

fn open(dir: &Path) -> Result<Job, String> {
    let settled = |_: Option<&Value>| Ok::<_, Infallible>(Value::Null);
    Job::open(dir, request(dir), settled).map_err(|error| error.to_string())
}

/// The plan of the requested job.
static PLAN: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let job_dir = JobDir::new();
    open(&job_dir.job()).expect("a new job");
    fs::read(job_dir.job().join(PLAN_FILE)).expect("a plan")
});

/// A plan: unchanged, and with a correct checksum, which mutation would never find.
pub fn plan(bytes: &[u8]) -> usize {
    let repaired = repaired(bytes).map_or(0, |bytes| read_plan(&bytes));
    read_plan(bytes) + repaired
}

fn repaired(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut file: Value = serde_json::from_slice(bytes).ok()?;
    if let Some(plan) = file.get("plan") {
        let text = plan.to_string();
        let (version, sum) = (file.get("version")?, blake3::hash(text.as_bytes()).to_hex());
        let checksummed = format!(r#"{{"version":{version},"blake3":"{sum}","plan":{text}}}"#);
        return Some(checksummed.into_bytes());
    }
    let settings = serde_json::from_value::<Vec<(String, String)>>(file.get("settings")?.clone());
    *file.get_mut("settings_blake3")? = settings_hash(&settings.ok()?).into();
    serde_json::to_vec(&file).ok()
}

fn read_plan(bytes: &[u8]) -> usize {
    let job_dir = JobDir::new();
    job_dir.write(PLAN_FILE, bytes);
    match Job::read_plan(&job_dir.job()) {
        Ok(plan) => check_plan(&plan.expect("there is a file")),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return 0;
        }
    }
    let state = Job::read(&job_dir.job()).expect("as it was").expect("as it was");
    report(&state);
    // The job is resumed or refused
    let _ = open(&job_dir.job());
    state.plan().frames().len()
}

/// Uses the resolved settings of a plan as `render` and `convert` do.
fn check_plan(plan: &Plan) {
    let numbers = plan.frames().iter().map(|frame| frame.number);
    assert!(numbers.clone().all(|number| plan.frame(number).is_some()));
    let Ok(survey) = serde_json::from_value::<Survey>(plan.resolved().clone()) else {
        return;
    };
    let _ = setup(&Manifest::new("in"), &survey, SceneInputs::default())
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
    let files = JobReport::new(state, Manifest::new("in").settings()).files();
    let [(_, json), (_, html)] = &files[..] else {
        panic!("two files");
    };
    assert!(serde_json::from_str::<Value>(json).is_ok(), "{json}");
    assert!(html.contains("</html>"));
}

/// A ledger. The images of the plan exist as empty files.
pub fn ledger(bytes: &[u8]) -> usize {
    let job_dir = JobDir::new();
    job_dir.write(PLAN_FILE, &PLAN);
    job_dir.write("job.ledger.a.jsonl", bytes);
    job_dir.write("f.1.exr", b"");
    job_dir.write("f.2.exr", b"");
    match Job::read(&job_dir.job()) {
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

/// A worker record.
pub fn worker(bytes: &[u8]) -> usize {
    let job_dir = JobDir::new();
    fs::write(job_dir.work().join("a.worker"), bytes).expect("writable");
    let workers = Job::workers(&job_dir.job()).expect("a readable directory");
    workers.len()
}

/// Lines: a worker record, a claim of the first frame, its next generation, and a claim of the second frame. The job
/// is opened, which removes files of dead workers, and its frames are claimed, since no other worker is alive.
pub fn claim(bytes: &[u8]) -> usize {
    let job_dir = JobDir::new();
    job_dir.write(PLAN_FILE, &PLAN);
    let write = |names: &[&str]| {
        for (name, line) in names.iter().zip(bytes.split(|b| *b == b'\n')) {
            fs::write(job_dir.work().join(name), line).expect("writable");
        }
    };
    write(&["a.worker", "frame.1.0", "frame.1.1", "frame.2.0"]);
    let found = Job::workers(&job_dir.job()).expect("a readable directory").len();
    if let Ok(job) = open(&job_dir.job()) {
        write(&["b.worker", "frame.1.0", "frame.1.1", "frame.2.0"]);
        claim_all(&job);
    }
    assert!(job_dir.bystander().exists(), "a file outside the job is gone");
    assert!(job_dir.job().join(PLAN_FILE).exists());
    found
}

fn claim_all(job: &Job) {
    let claims = job.claims();
    for frame in [1, 2] {
        match claims.claim(frame) {
            Ok(ClaimOutcome::Acquired(claim)) => claim.complete(),
            Ok(ClaimOutcome::Held(who)) => assert!(!who.is_empty()),
            Ok(ClaimOutcome::Finished(_)) => panic!("nobody has"),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}
