//! `spherule movie`: a movie of the finished pictures of a job. `render --movie` makes one after the job.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::json;
use spherule_jobs::Interrupt;

use super::paths::absolute;
use super::pictures::{JobPicture, JobPictures, PicturesArgs, SIGNAL_MESSAGES, Watch, guard};
use super::{CliError, Outcome, events, print, signals};
use crate::job::JobManifest;
use crate::manifest::real_dir;
use crate::movie::{
    Codec, FrameRate, Gaps, INSTALL, MovieError, MovieFormat, MovieSource, Observer, Timeline,
    by_hand, ffmpeg_is_installed, write_movie,
};
use crate::output::view::DisplayView;

const EXAMPLES: &str = "\
Examples:
  spherule movie out -o dam.mp4 --fps 25
      H.264 for everything, by an installed ffmpeg
  spherule movie out -o dam.gif --width 640
      GIF, animated PNG (.png) and animated WebP (.webp) need no ffmpeg
  spherule movie out/job.toml --partial --frames 1-100 -o cut.mov --codec prores
      What is there of a job that is not finished, for editing";

/// Frames per second unless chosen.
const DEFAULT_RATE: &str = "25";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct MovieArgs {
    #[command(flatten)]
    pictures: PicturesArgs,
    /// Movie to write: .mp4, .mov, .mkv or .webm by ffmpeg; .gif, .png or .webp without it.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Frames per second.
    #[arg(long, value_name = "RATE", default_value = DEFAULT_RATE, allow_negative_numbers = true)]
    fps: FrameRate,
    /// How ffmpeg compresses: h264 | prores | vp9 [default: h264; vp9 for .webm].
    #[arg(long, value_name = "NAME")]
    codec: Option<Codec>,
    /// Width to which larger pictures are scaled, in pixels.
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u16).range(1..))]
    width: Option<u16>,
    /// Missing frame numbers: show the picture before for longer, or leave them out.
    #[arg(long, value_enum, default_value_t = GapChoice::Hold)]
    gaps: GapChoice,
    /// Make a movie of what is there if the job is not finished.
    #[arg(long)]
    partial: bool,
    /// Replace a file that was not made by this command.
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum GapChoice {
    /// The movie keeps the time of the simulation
    Hold,
    /// The movie jumps
    Skip,
}

/// A movie to make.
struct Request<'a> {
    /// As typed.
    output: &'a Path,
    format: MovieFormat,
    rate: FrameRate,
    width: Option<u16>,
    gaps: Gaps,
}

pub(super) fn run(args: &MovieArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(SIGNAL_MESSAGES)?;
    let request = Request {
        output: &args.output,
        format: format(&args.output, args.codec, "--output")?,
        rate: args.fps,
        width: args.width,
        gaps: match args.gaps {
            GapChoice::Hold => Gaps::Hold,
            GapChoice::Skip => Gaps::Skip,
        },
    };
    // Refuse a movie with gaps, unless it was asked for
    let pictures = JobPictures::read(&args.pictures)?;
    pictures.require_any()?;
    if let Some(gaps) = pictures.gaps() {
        if !args.partial {
            let wait = if pictures.is_running {
                "wait for it"
            } else {
                "the same `render` command continues the job"
            };
            return Err(CliError::other(format!(
                "{gaps}; {wait}, or make a movie of what is there with --partial"
            )));
        }
        message!("{gaps}; the movie shows what is there");
    }
    pictures.guard(&args.output, args.force)?;
    // Make it
    match make(&request, &pictures, &Watch(signals.start_work()))? {
        Some(line) => {
            print::lines([line])?;
            Ok(Outcome::Done)
        }
        None => Ok(Outcome::Interrupted),
    }
}

/// The format of a file name that the option `shown` gives.
fn format(path: &Path, codec: Option<Codec>, shown: &str) -> Result<MovieFormat, CliError> {
    let format = MovieFormat::of(path, codec);
    format.map_err(|error| CliError::other(format!("{shown} {}: {error}", path.display())))
}

/// Makes the movie, and returns a line about it; None if it was stopped.
fn make(
    request: &Request<'_>,
    pictures: &JobPictures,
    observer: &dyn Observer,
) -> Result<Option<String>, CliError> {
    // Write the movie, and explain what went wrong
    let source = source(request, &pictures.pictures, &pictures.selected, pictures.view);
    let made = write_movie(&source, request.format, request.output, observer);
    let finished = match made {
        Ok(finished) => finished,
        Err(MovieError::Stopped) => {
            message!("{}", SIGNAL_MESSAGES.stopped);
            return Ok(None);
        }
        Err(MovieError::NoFfmpeg) => {
            return Err(no_ffmpeg(by_hand(&source, request.format, request.output)));
        }
        Err(error @ MovieError::Picture(_)) => return Err(pictures.explain(&error)),
        Err(error) => {
            return Err(CliError::other(format!("{}: {error}", request.output.display())));
        }
    };
    // Describe it
    let [width, height] = finished.size;
    let rate = played_rate(request);
    Ok(Some(format!(
        "{}: {}, {width}x{height}, {} frames in {:.2} s at {} fps, {} bytes",
        request.output.display(),
        request.format.name(),
        finished.shown,
        finished.shown as f64 / rate.per_second(),
        rate,
        finished.bytes
    )))
}

/// Most frames per second of a GIF.
const MAX_GIF_RATE: f64 = 50.0;

/// The rate at which the movie plays, which the format may limit.
fn played_rate(request: &Request<'_>) -> FrameRate {
    let is_limited = request.format == MovieFormat::Gif && request.rate.per_second() > MAX_GIF_RATE;
    let limit = FrameRate::new(MAX_GIF_RATE).ok();
    limit.filter(|_| is_limited).unwrap_or(request.rate)
}

/// Prints after which frames others are missing, and what the movie shows there.
fn report_gaps(timeline: &Timeline) {
    for (what, gaps) in [
        ("is shown for longer (--gaps skip leaves gaps out)", &timeline.held),
        ("is followed by the next (the movie jumps)", &timeline.skipped),
    ] {
        if let Some((frame, missing)) = gaps.first() {
            let more = match gaps.len() - 1 {
                0 => String::new(),
                1 => ", and so on at 1 more place".to_owned(),
                more => format!(", and so on at {more} more places"),
            };
            let are = if *missing == 1 { "frame is" } else { "frames are" };
            message!("{missing} {are} missing after frame {frame}, which {what}{more}");
        }
    }
}

/// The pictures in their order, with notes about gaps, odd sizes and rates that the format changes.
fn source(
    request: &Request<'_>,
    pictures: &[JobPicture],
    all: &[i64],
    view: DisplayView,
) -> MovieSource {
    // Arrange the frames in time
    let frames: Vec<i64> = pictures.iter().map(|picture| picture.number).collect();
    let timeline = Timeline::new(&frames, all, request.gaps);
    report_gaps(&timeline);
    if played_rate(request) != request.rate {
        message!(
            "GIF has at most {MAX_GIF_RATE} frames per second: the movie is slower than {} fps",
            request.rate
        );
    }
    // Take pictures as they are, and report a size that the format changes
    let source = MovieSource {
        paths: pictures.iter().map(|picture| picture.picture.clone()).collect(),
        repeats: timeline.repeats,
        rate: request.rate,
        width: request.width.map(usize::from),
        view,
    };
    // Errors of the first picture come again when the movie is written
    if let Ok(size) = source.size() {
        let padded = request.format.padded(size);
        if padded != size {
            message!(
                "{}x{} pixels become {}x{}: {} needs even sides, so the last column or row is repeated",
                size[0],
                size[1],
                padded[0],
                padded[1],
                request.format.name()
            );
        }
    }
    source
}

fn no_ffmpeg(by_hand: Option<String>) -> CliError {
    let by_hand = by_hand.map(|line| format!(". Or run by hand elsewhere: {line}"));
    CliError::other(format!(
        "ffmpeg is not installed, which writes .mp4, .mov, .mkv and .webm; .gif, .png and .webp need none. Install it \
         ({INSTALL}) and give the same command again{}",
        by_hand.unwrap_or_default()
    ))
}

/// A movie to make after a render.
pub(super) struct MovieAfter {
    output: PathBuf,
    format: MovieFormat,
    /// The job.
    pictures: PicturesArgs,
    /// Whether a file that is not a movie of this program may be replaced.
    force: bool,
}

impl MovieAfter {
    /// Checks before the render that the movie can be written.
    pub(super) fn new(
        output: &Path,
        requested: &JobManifest,
        force: bool,
    ) -> Result<Self, CliError> {
        let format = format(output, None, "--movie")?;
        guard(output, force)?;
        if format.needs_ffmpeg() && !ffmpeg_is_installed() {
            return Err(no_ffmpeg(None));
        }
        let dir = requested.base.join(requested.manifest.output.path.dir());
        Ok(Self {
            output: output.to_owned(),
            format,
            pictures: PicturesArgs {
                job: real_dir(&absolute(&dir)?),
                frames: requested.manifest.input.frames.clone(),
            },
            force,
        })
    }

    /// Makes the movie, if all frames are done. The lines are messages, because standard output may be for events.
    pub(super) fn make(&self, interrupt: &Interrupt) -> Outcome {
        match self.try_make(interrupt) {
            Ok(outcome) => outcome,
            Err(error) => {
                error!("no movie: {error}");
                events::add_to_end(json!({"errors": [error.to_string()]}));
                Outcome::SomeFailed
            }
        }
    }

    fn try_make(&self, interrupt: &Interrupt) -> Result<Outcome, CliError> {
        // Read the finished frames, and refuse gaps
        let pictures = JobPictures::read(&self.pictures)?;
        if let Some(gaps) = pictures.gaps() {
            return Err(CliError::other(format!(
                "{gaps}; `spherule movie --partial` makes one of what is there"
            )));
        }
        pictures.guard(&self.output, self.force)?;
        // Make the movie with the usual settings
        let rate = DEFAULT_RATE.parse();
        let request = Request {
            output: &self.output,
            format: self.format,
            rate: rate.map_err(|error| CliError::other(format!("{error}")))?,
            width: None,
            gaps: Gaps::Hold,
        };
        match make(&request, &pictures, &Watch(interrupt))? {
            Some(line) => {
                message!("{line}");
                Ok(Outcome::Done)
            }
            None => Ok(Outcome::Interrupted),
        }
    }
}
