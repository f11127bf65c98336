//! `spherule inspect`: the content of particle files as text or JSON.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use spherule_formats::native::{FORMAT, layout, verify};
use spherule_formats::open::{is_native, remarks};
use spherule_formats::sequence::lone_frame_number;
use spherule_formats::stats::FrameStats;
use spherule_formats::{FrameError, FrameFile, Positions, Sequence, SequenceInput};

use super::print::{self, Reader};
use super::render::parts_text;
use super::{CliError, Outcome};
use crate::reading::read_budget;

mod native;
mod show;

use native::NativeFacts;

const EXAMPLES: &str = "\
Examples:
  spherule inspect run1/frame_0001.vtk
      Counts, bounds and attributes of one file
  spherule inspect --json run1
      The same for all frames of a directory, as JSON
  spherule inspect --verify run1-native
      Check all frames for damage";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct InspectArgs {
    /// Files, directories or patterns.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One JSON object per frame, one per line.
    #[arg(long)]
    json: bool,
    /// Check everything: all sections of native frames, every number of other files.
    #[arg(long)]
    verify: bool,
}

/// One particle frame of a file.
struct Inspected<'a> {
    file: &'a Path,
    format: &'static str,
    frame: Option<i64>,
    time: Option<f64>,
    /// How positions are stored.
    encoding: &'static str,
    stats: FrameStats,
    /// Bytes of the file per particle; None without particles.
    bytes_per_particle: Option<f64>,
    /// Summary of a native frame.
    native: Option<NativeFacts>,
    /// Metadata of the file that is not per particle.
    notes: Vec<String>,
    /// Whether a full verification was requested and done.
    verified: bool,
}

pub(super) fn run(args: &InspectArgs) -> Result<Outcome, CliError> {
    let mut outcome = Outcome::Done;
    for meant in expand(&args.files) {
        let inspected = match meant {
            Meant::File(file, number) => {
                inspect(&file, number, args).map_err(|e| (file, e.to_string()))
            }
            Meant::Nothing(argument, why) => Err((argument, why)),
        };
        let printed = match inspected {
            Ok(printed) => printed,
            Err((file, error)) => {
                outcome = Outcome::SomeFailed;
                if args.json {
                    let shown = file.display().to_string();
                    print::json(&json!({"file": shown, "error": error}))
                } else {
                    message!("error: {error}");
                    Ok(Reader::Listening)
                }
            }
        };
        if printed? == Reader::Gone {
            return Ok(outcome);
        }
    }
    Ok(outcome)
}

/// The file that an argument refers to.
enum Meant {
    /// A file, with the frame number from its name if it belongs to a sequence.
    File(PathBuf, Option<i64>),
    /// An error.
    Nothing(PathBuf, String),
}

/// The files of all arguments. An invalid argument does not affect the others.
fn expand(arguments: &[PathBuf]) -> Vec<Meant> {
    let mut all = Vec::new();
    let mut known = HashSet::new();
    for argument in arguments {
        match SequenceInput::from_path(argument) {
            SequenceInput::Files(listed) => {
                for file in listed {
                    let number = lone_frame_number(&file);
                    known.insert(file.clone());
                    all.push(Meant::File(file, number));
                }
            }
            input => match Sequence::open_within(&input, read_budget(None, None)) {
                Err(error) => all.push(Meant::Nothing(argument.clone(), error.to_string())),
                Ok(sequence) => {
                    if let Some(parts) = parts_text(&sequence) {
                        message!("{}: {parts}", argument.display());
                    }
                    for frame in sequence.frames() {
                        // A file with many steps is in many frames.
                        for part in &frame.parts {
                            if known.insert(part.path.clone()) {
                                all.push(Meant::File(part.path.clone(), Some(frame.number)));
                            }
                        }
                    }
                }
            },
        }
    }
    all
}

/// Inspects one file. The outer error is of the file, the inner one of the output.
fn inspect(
    path: &Path,
    number: Option<i64>,
    args: &InspectArgs,
) -> Result<Result<Reader, CliError>, FrameError> {
    if is_native(path)? {
        let inspected = native::inspect(path, number, args.verify)?;
        return Ok(inspected.print(args.json));
    }
    let file = FrameFile::open_within(path, read_budget(None, None))?;
    // For several steps, the metadata come from the first one.
    let mut remarks = remarks(path);
    for index in 0..file.steps().len() {
        let mut inspected = read(&file, index, number)?;
        inspected.notes = std::mem::take(&mut remarks);
        if args.verify && inspected.native.is_some() {
            verify(file.bytes()).map_err(|e| e.in_file(path))?;
        }
        inspected.verified = args.verify;
        match inspected.print(args.json) {
            Ok(Reader::Listening) => {}
            ended => return Ok(ended),
        }
    }
    Ok(Ok(Reader::Listening))
}

/// Reads step `index` of `file`.
fn read(file: &FrameFile, index: usize, number: Option<i64>) -> Result<Inspected<'_>, FrameError> {
    let raw = file.read(index)?;
    let mut stats = FrameStats::of(&raw);
    let step = &file.steps()[index];
    let running = i64::try_from(index).ok();
    let number = if file.steps().len() > 1 {
        running
    } else {
        number
    };
    // A native frame comes here packed by gzip.
    let native = (file.format() == FORMAT)
        .then(|| layout::parse(file.bytes()).ok())
        .flatten();
    let all = stats.count + stats.dropped;
    stats.dropped += native.as_ref().map_or(0, |index| index.dropped);
    let share = match file.steps().len() {
        1 => 1.0,
        _ => step.byte_range().map_or(1.0, |range| {
            range.len() as f64 / file.unpacked_len().max(1) as f64
        }),
    };
    let stored = file.stored_len() as f64 * share;
    Ok(Inspected {
        file: file.path(),
        format: file.format().name(),
        frame: step.number.or(number),
        time: raw.time,
        encoding: match (&native, &raw.positions) {
            (Some(index), _) => index.encoding().name(),
            (None, Positions::F32(_)) => "f32",
            (None, Positions::F64(_)) => "f64",
        },
        stats,
        bytes_per_particle: (all > 0).then(|| stored / all as f64),
        native: native.map(|index| NativeFacts::new(index, file.bytes().len() as u64, None)),
        notes: Vec::new(),
        verified: false,
    })
}
