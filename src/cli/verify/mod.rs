//! `spherule verify`: opens and decodes all finished outputs of a job.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;
use spherule_formats::FrameError;
use spherule_formats::native::{Access, NativeFile};
use spherule_jobs::{
    EntryStatus, FrameRange, Job, JobState, LedgerEntry, PLAN_FILE, Panic, PlannedFrame,
    catch_panic,
};

use super::job::{job_directory, list, no_job, selected_frames, use_threads};
use super::print::{self, Reader};
use super::{CliError, Outcome};
use crate::manifest::MAX_THREADS;
use crate::output::{ImageFault, verify_exr, verify_preview};
use expected::ExpectedOutput;

mod expected;
mod show;

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// A job: the directory of its images or native frames, or its manifest (job.toml).
    job: PathBuf,
    /// Frames to check: 7 | 1-10 | 1-10x2 | 1-5,8.
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    frames: Option<FrameRange>,
    /// One JSON object per frame and line.
    #[arg(long)]
    json: bool,
    /// Requeue damaged frames, so that the next run of the job repeats them. Deletes nothing. Missing outputs and
    /// those of another length are repeated in any case.
    #[arg(long)]
    requeue_bad: bool,
    /// Threads to use [default: all]; at most 4 per processor are used.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_THREADS)))]
    threads: Option<u32>,
}

/// The result for a file, or for a frame by the worst of its files. From good to bad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    /// Readable.
    Sound,
    /// Not tried yet.
    Pending,
    /// Failed.
    Failed,
    /// Not of the recorded length.
    Length,
    /// Does not exist.
    Missing,
    /// Cannot be read, or is another kind of file.
    Damaged,
}

/// The result for one file of a finished frame.
struct FileVerdict {
    path: String,
    verdict: Verdict,
    /// What is wrong with the file.
    reason: Option<String>,
}

/// The result for one frame of the plan.
struct FrameVerdict {
    frame: i64,
    verdict: Verdict,
    /// Why the frame failed, if it did.
    reason: Option<String>,
    files: Vec<FileVerdict>,
}

impl FrameVerdict {
    /// The frame and the damage of its first damaged file.
    fn damage(&self) -> Option<(i64, String)> {
        let mut files = self.files.iter();
        let file = files.find(|f| f.verdict == Verdict::Damaged)?;
        let reason = file.reason.as_deref().unwrap_or_default();
        Some((self.frame, format!("verify: {}: {reason}", file.path)))
    }
}

/// Frames per thread between two writes to the output.
const FRAMES_PER_THREAD: usize = 4;

pub(super) fn run(args: &VerifyArgs) -> Result<Outcome, CliError> {
    use_threads(args.threads)?;
    // Find out what the job should have written
    let dir = job_directory(&args.job)?;
    let Some(state) = Job::read(&dir)? else {
        return Err(no_job(&dir));
    };
    let expected = ExpectedOutput::of(state.plan())
        .map_err(|e| CliError::other(format!("{}: {e}", dir.join(PLAN_FILE).display())))?;
    // Check the frames in chunks, and print each result as soon as it is known
    let frames = selected_frames(&state, args.frames.as_ref())?;
    let plan = state.plan();
    let frames: Vec<&PlannedFrame> = frames.iter().filter_map(|n| plan.frame(*n)).collect();
    let mut verdicts = Vec::with_capacity(frames.len());
    let mut damaged = Vec::new();
    for chunk in frames.chunks(FRAMES_PER_THREAD * rayon::current_num_threads()) {
        let checked: Vec<FrameVerdict> =
            chunk.par_iter().map(|frame| check_frame(&state, frame, &expected)).collect();
        let reader = print::lines(checked.iter().flat_map(|f| f.lines(args.json)))?;
        damaged.extend(checked.iter().filter_map(FrameVerdict::damage));
        verdicts.extend(checked.iter().map(|f| (f.frame, f.verdict)));
        if reader == Reader::Gone {
            break;
        }
    }
    if !args.json {
        print::lines(show::summary(&verdicts))?;
    }
    // Requeue damaged frames
    if args.requeue_bad
        && let Err(error) = requeue(&state, &damaged)
    {
        error!("{error}");
    }
    let is_bad = |(_, verdict): &(i64, Verdict)| *verdict >= Verdict::Length;
    Ok(if verdicts.iter().any(is_bad) { Outcome::SomeFailed } else { Outcome::Done })
}

/// Requeues damaged frames.
fn requeue(state: &JobState, damaged: &[(i64, String)]) -> Result<(), CliError> {
    if damaged.is_empty() {
        return Ok(());
    }
    let requeued = Job::requeue(state, damaged)?;
    if !requeued.is_empty() {
        message!("requeued: {}; the next run of the job repeats them", list(&requeued));
    }
    Ok(())
}

fn check_frame(
    state: &JobState,
    planned: &PlannedFrame,
    expected: &ExpectedOutput,
) -> FrameVerdict {
    // Frames without outputs have no files to check
    let without_files = |verdict, reason| FrameVerdict {
        frame: planned.number,
        verdict,
        reason,
        files: Vec::new(),
    };
    match state.ledger().entry(planned.number) {
        None => without_files(Verdict::Pending, None),
        Some(entry) if entry.status == EntryStatus::Failed => {
            without_files(Verdict::Failed, entry.reason.clone())
        }
        Some(entry) => {
            let outputs = planned.outputs.iter();
            let files: Vec<FileVerdict> =
                outputs.map(|path| check_file(state.dir(), path, entry, expected)).collect();
            let worst = files.iter().map(|f| f.verdict).max();
            FrameVerdict { files, ..without_files(worst.unwrap_or(Verdict::Sound), None) }
        }
    }
}

/// Checks the output `path` of a frame whose latest entry is `entry`.
fn check_file(
    dir: &Path,
    path: &str,
    entry: &LedgerEntry,
    expected: &ExpectedOutput,
) -> FileVerdict {
    let (verdict, reason) = match find_file(dir, path, entry) {
        Err((verdict, reason)) => (verdict, Some(reason)),
        Ok(file) => match catch_panic(|| decode(&file, expected)) {
            Ok(()) => (Verdict::Sound, None),
            Err(error) => (Verdict::Damaged, Some(error.reason(&file))),
        },
    };
    FileVerdict { path: path.to_owned(), verdict, reason }
}

/// The path of the file, if it exists and has the recorded length.
fn find_file(dir: &Path, path: &str, entry: &LedgerEntry) -> Result<PathBuf, (Verdict, String)> {
    // Find the record, then the file
    let Some(output) = entry.outputs.iter().find(|o| o.path == path) else {
        let reason = "was not written under this name".to_owned();
        return Err((Verdict::Missing, reason));
    };
    let file = dir.join(path);
    let metadata = match fs::metadata(&file) {
        Ok(metadata) => metadata,
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            return Err((Verdict::Missing, "does not exist".to_owned()));
        }
        Err(e) => return Err((Verdict::Damaged, format!("cannot be read: {e}"))),
    };
    // Check its kind and length, which are cheap
    if !metadata.is_file() {
        return Err((Verdict::Damaged, "is not a regular file".to_owned()));
    }
    if metadata.len() != output.len {
        let reason = format!("has {} bytes, {} were written", metadata.len(), output.len);
        return Err((Verdict::Length, reason));
    }
    Ok(file)
}

/// Why a file cannot be decoded.
#[derive(Debug, thiserror::Error)]
enum DecodeError {
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    #[error(transparent)]
    Image(#[from] ImageFault),
    #[error(transparent)]
    Native(#[from] FrameError),
    #[error(transparent)]
    Panic(#[from] Panic),
}

impl DecodeError {
    /// The message without the path of the file, which is printed before it.
    fn reason(&self, file: &Path) -> String {
        let text = self.to_string();
        let path = format!("{}: ", file.display());
        text.strip_prefix(&path).unwrap_or(&text).to_owned()
    }
}

/// Reads all of `file`.
fn decode(file: &Path, expected: &ExpectedOutput) -> Result<(), DecodeError> {
    let shape = match expected {
        ExpectedOutput::Frames => return Ok(decode_native(file)?),
        ExpectedOutput::Images(shape) => shape,
    };
    let reader = BufReader::with_capacity(1 << 16, File::open(file)?);
    let is_preview = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    if is_preview {
        verify_preview(reader, shape)?;
    } else {
        verify_exr(reader, shape)?;
    }
    Ok(())
}

/// The same check as `inspect --verify`.
fn decode_native(path: &Path) -> Result<(), FrameError> {
    let file = NativeFile::open(path, Access::Map)?;
    let verified = file.frame().and_then(|frame| frame.verify_all().map_err(|e| e.in_file(path)));
    // A change of the file meanwhile explains any other error
    file.check()?;
    verified
}
