//! `spherule verify`: opens and decodes everything that a job has finished.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;
use spherule_formats::native::{Access, NativeFile};
use spherule_jobs::{Entry, FrameRange, Job, JobState, PLAN_FILE, PlannedFrame, Status};

use super::print::{self, Reader};
use super::work::{job_directory, list, no_job, use_threads};
use super::{CliError, Outcome};
use crate::manifest::MAX_THREADS;
use crate::mishap::guarded;
use crate::output::{verify_exr, verify_preview};
use made::Made;

mod made;
mod show;

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// A job: the directory of its images or native frames, or its manifest (job.toml).
    job: PathBuf,
    /// Frames to look at: 7 | 1-10 | 1-10x2 | 1-5,8.
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    frames: Option<FrameRange>,
    /// One JSON object a frame, one a line.
    #[arg(long)]
    json: bool,
    /// Set damaged frames back, so that the next run of the job makes them anew. Deletes nothing; what is
    /// missing or of another length is made anew in any case.
    #[arg(long)]
    requeue_bad: bool,
    /// Threads to use [default: all]; at most 4 for each processor are used.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_THREADS)))]
    threads: Option<u32>,
}

/// How a file, or a frame by the worst of its files, stands. From good to bad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    /// All of it can be read.
    Sound,
    /// Not tried yet.
    Pending,
    /// Tried without success.
    Failed,
    /// Not as long as it was when it was finished.
    Length,
    /// Not there.
    Missing,
    /// Cannot be read, or is something else.
    Damaged,
}

/// One file of a finished frame.
struct Verified {
    path: String,
    verdict: Verdict,
    /// What is wrong with it.
    reason: Option<String>,
}

/// One frame of the plan.
struct FrameVerdict {
    frame: i64,
    verdict: Verdict,
    /// Why it failed, if it did.
    reason: Option<String>,
    files: Vec<Verified>,
}

impl FrameVerdict {
    /// The frame and what its first damaged file suffers from.
    fn damage(&self) -> Option<(i64, String)> {
        let mut files = self.files.iter();
        let file = files.find(|f| f.verdict == Verdict::Damaged)?;
        let reason = file.reason.as_deref().unwrap_or_default();
        Some((self.frame, format!("verify: {}: {reason}", file.path)))
    }
}

/// Frames looked at between two looks at the output, for each thread.
const AT_ONCE: usize = 4;

pub(super) fn run(args: &VerifyArgs) -> Result<Outcome, CliError> {
    use_threads(args.threads)?;
    let dir = job_directory(&args.job)?;
    let Some(state) = Job::read(&dir)? else {
        return Err(no_job(&dir));
    };
    let made = Made::of(state.plan())
        .map_err(|what| CliError::other(format!("{}: {what}", dir.join(PLAN_FILE).display())))?;
    let frames = chosen(&state, args.frames.as_ref())?;
    let mut verdicts = Vec::with_capacity(frames.len());
    let mut damaged = Vec::new();
    for some in frames.chunks(AT_ONCE * rayon::current_num_threads()) {
        let looked = some.par_iter().map(|frame| look(&state, frame, made));
        let looked: Vec<FrameVerdict> = looked.collect();
        let reader = print::lines(looked.iter().flat_map(|f| f.lines(args.json)))?;
        damaged.extend(looked.iter().filter_map(FrameVerdict::damage));
        verdicts.extend(looked.iter().map(|f| (f.frame, f.verdict)));
        if reader == Reader::Gone {
            break;
        }
    }
    if !args.json {
        print::lines(show::summary(&verdicts))?;
    }
    if args.requeue_bad
        && let Err(error) = requeue(&state, &damaged)
    {
        say!("error: {error}");
    }
    let is_bad = |(_, verdict): &(i64, Verdict)| *verdict >= Verdict::Length;
    Ok(if verdicts.iter().any(is_bad) {
        Outcome::SomeFailed
    } else {
        Outcome::Done
    })
}

/// Sets frames back with what is wrong with them.
fn requeue(state: &JobState, damaged: &[(i64, String)]) -> Result<(), CliError> {
    if damaged.is_empty() {
        return Ok(());
    }
    let set_back = Job::requeue(state, damaged)?;
    if !set_back.is_empty() {
        say!(
            "set back: {}; the next run of the job makes them anew",
            list(&set_back)
        );
    }
    Ok(())
}

fn chosen<'a>(
    state: &'a JobState,
    range: Option<&FrameRange>,
) -> Result<Vec<&'a PlannedFrame>, CliError> {
    let plan = state.plan();
    let Some(range) = range else {
        return Ok(plan.frames().iter().collect());
    };
    let numbers: Vec<i64> = plan.frames().iter().map(|f| f.number).collect();
    let chosen = range.select(&numbers);
    if chosen.is_empty() {
        return Err(CliError::other(format!(
            "--frames: {range} has none of the job's frames: {}",
            list(&numbers)
        )));
    }
    Ok(chosen.iter().filter_map(|n| plan.frame(*n)).collect())
}

fn look(state: &JobState, planned: &PlannedFrame, made: Made) -> FrameVerdict {
    let open = |verdict, reason| FrameVerdict {
        frame: planned.number,
        verdict,
        reason,
        files: Vec::new(),
    };
    match state.ledger().entry(planned.number) {
        None => open(Verdict::Pending, None),
        Some(entry) if entry.status == Status::Failed => {
            open(Verdict::Failed, entry.reason.clone())
        }
        Some(entry) => {
            let outputs = planned.outputs.iter();
            let files: Vec<Verified> = outputs
                .map(|path| look_at_file(state.dir(), path, entry, made))
                .collect();
            let worst = files.iter().map(|f| f.verdict).max();
            FrameVerdict {
                files,
                ..open(worst.unwrap_or(Verdict::Sound), None)
            }
        }
    }
}

/// Looks at the output `path` of a frame whose last word is `entry`.
fn look_at_file(dir: &Path, path: &str, entry: &Entry, made: Made) -> Verified {
    let (verdict, reason) = match found(dir, path, entry) {
        Err((verdict, reason)) => (verdict, Some(reason)),
        Ok(file) => match guarded(|| decode(&file, made)) {
            Ok(()) => (Verdict::Sound, None),
            Err(reason) => (Verdict::Damaged, Some(reason)),
        },
    };
    Verified {
        path: path.to_owned(),
        verdict,
        reason,
    }
}

/// The file itself, if it is there and as long as it was.
fn found(dir: &Path, path: &str, entry: &Entry) -> Result<PathBuf, (Verdict, String)> {
    let Some(output) = entry.outputs.iter().find(|o| o.path == path) else {
        let reason = "was not made under this name".to_owned();
        return Err((Verdict::Missing, reason));
    };
    let file = dir.join(path);
    let metadata = match fs::metadata(&file) {
        Ok(metadata) => metadata,
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            return Err((Verdict::Missing, "is not there".to_owned()));
        }
        Err(e) => return Err((Verdict::Damaged, format!("cannot be read: {e}"))),
    };
    if !metadata.is_file() {
        return Err((Verdict::Damaged, "is no regular file".to_owned()));
    }
    if metadata.len() != output.len {
        let reason = format!("has {} bytes, {} were written", metadata.len(), output.len);
        return Err((Verdict::Length, reason));
    }
    Ok(file)
}

/// Reads all of `file`.
fn decode(file: &Path, made: Made) -> Result<(), String> {
    let shape = match made {
        Made::Frames => return decode_native(file),
        Made::Images(shape) => shape,
    };
    let opened = File::open(file).map_err(|e| format!("cannot be read: {e}"))?;
    let reader = BufReader::with_capacity(1 << 16, opened);
    let is_preview = file
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("png"));
    if is_preview {
        verify_preview(reader, &shape)
    } else {
        verify_exr(reader, &shape)
    }
    .map_err(|fault| fault.to_string())
}

/// What `inspect --verify` looks at.
fn decode_native(path: &Path) -> Result<(), String> {
    let look = || {
        let file = NativeFile::open(path, Access::Map)?;
        let verified = file
            .frame()
            .and_then(|frame| frame.verify_all().map_err(|e| e.in_file(path)));
        // That the file was changed meanwhile explains whatever was found.
        file.check()?;
        verified
    };
    look().map_err(|e| without_path(&e.to_string(), path))
}

/// The path stands before the reason already.
fn without_path(text: &str, path: &Path) -> String {
    let path = format!("{}: ", path.display());
    text.strip_prefix(&path).unwrap_or(text).to_owned()
}
