//! `spherule convert`: a sequence becomes native frames.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use glam::DVec3;
use spherule_formats::native::{self, Bound, Encoding, FrameIndex, StoreSettings};
use spherule_formats::sequence::Sequence;
use spherule_formats::{ParticleFrame, Radius, SequenceInput};

use super::{CliError, Outcome, signals};
use crate::survey::{ColorQuestion, Question, RadiusQuestion, Survey};

/// The bound that coded positions keep if none is given: a fraction of the radius.
const USUAL_BOUND: f64 = 0.02;

#[derive(Debug, Args)]
pub(super) struct ConvertArgs {
    /// A directory, a pattern (dump.#.vtk), or files.
    #[arg(required = true)]
    input: Vec<PathBuf>,
    /// Directory for the frames, which are called frame.NUMBER.spf; those that are there are replaced.
    #[arg(short, long)]
    output: PathBuf,
    /// How positions are stored: f32 (12 bytes a particle), q16 (6) or q10 (4). Without this, f32, or with
    /// a largest error what needs the fewest bytes.
    #[arg(long)]
    encoding: Option<Encoding>,
    /// Largest error of a position as a fraction of the radius [default: 0.02 for q16 and q10].
    #[arg(long, value_name = "FRACTION", value_parser = not_negative)]
    max_error: Option<f64>,
    /// Largest error of a position as a length.
    #[arg(long, value_name = "LENGTH", value_parser = not_negative, conflicts_with = "max_error")]
    max_error_length: Option<f64>,
    /// Radius of all particles. Without this, that of the files, or half the usual distance of neighbours.
    #[arg(long, value_parser = positive)]
    radius: Option<f32>,
}

const WORDS: signals::Words = signals::Words {
    asked: "stopping after the frame in hand; once more stops at once",
    at_once: "stopped",
};

/// What holds for all frames.
struct Plan {
    store: StoreSettings,
    origin: DVec3,
    /// Replaces the radii of the files.
    radius: Option<f32>,
    /// Stands where the files bring none.
    estimate: Option<f32>,
}

pub(super) fn run(args: &ConvertArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(WORDS)?;
    let sequence = Sequence::open(&SequenceInput::from_paths(args.input.clone()))?;
    for note in sequence.notes() {
        say!("note: {note}");
    }
    let question = Question {
        color: ColorQuestion::None,
        radius: args
            .radius
            .map_or(RadiusQuestion::Auto, |_| RadiusQuestion::None),
    };
    let survey = Survey::of(&sequence, question)?;
    let plan = args.plan(&survey);
    fs::create_dir_all(&args.output).map_err(CliError::io(&args.output))?;
    let interrupt = signals.at_work();
    let mut failed = 0;
    for (index, frame) in sequence.frames().iter().enumerate() {
        if interrupt.is_raised() {
            return Ok(Outcome::Interrupted);
        }
        let path = args.output.join(format!("frame.{:04}.spf", frame.number));
        let start = Instant::now();
        match convert(&plan, &sequence, index, &path) {
            Ok(converted) => say!(
                "frame {}: {converted}, {:.2} s",
                frame.number,
                start.elapsed().as_secs_f64()
            ),
            Err(error) => {
                failed += 1;
                say!("frame {} failed: {error}", frame.number);
            }
        }
    }
    let all = sequence.frames().len();
    say!(
        "{} of {all} frames are in {}",
        all - failed,
        args.output.display()
    );
    Ok(if failed > 0 {
        Outcome::SomeFailed
    } else {
        Outcome::Done
    })
}

impl ConvertArgs {
    fn plan(&self, survey: &Survey) -> Plan {
        let bound = match (self.max_error, self.max_error_length) {
            (Some(fraction), _) => Bound::OfRadius(fraction),
            (None, Some(length)) => Bound::Length(length),
            (None, None) => Bound::OfRadius(USUAL_BOUND),
        };
        let is_bounded = self.max_error.is_some() || self.max_error_length.is_some();
        let estimate = survey.radius.filter(|_| self.radius.is_none());
        if let Some(radius) = estimate {
            say!("radius {radius}, half the usual distance of neighbours; --radius sets another");
        }
        Plan {
            store: StoreSettings {
                encoding: self.encoding.or((!is_bounded).then_some(Encoding::F32)),
                bound,
                ..StoreSettings::EXACT
            },
            origin: survey.origin,
            radius: self.radius,
            estimate,
        }
    }
}

/// Converts one frame; tells what came of it.
fn convert(plan: &Plan, sequence: &Sequence, index: usize, path: &Path) -> Result<String, String> {
    let raw = sequence.load_raw(index).map_err(|e| e.to_string())?;
    let step = raw.step;
    let settings = StoreSettings {
        rounding: raw.positions.rounding(plan.origin),
        ..plan.store.clone()
    };
    let mut frame = ParticleFrame::from_raw(raw, plan.origin);
    if let Some(radius) = plan.radius {
        frame.radius = Some(Radius::Common(radius));
    } else if frame.radius.is_none() {
        frame.radius = plan.estimate.map(Radius::Common);
    }
    let smallest = match &frame.radius {
        None => None,
        Some(Radius::Common(radius)) => Some(*radius),
        Some(Radius::PerParticle(radii)) => radii.iter().copied().reduce(f32::min),
    };
    let index = native::store(path, &frame, step, &settings).map_err(|e| e.to_string())?;
    Ok(describe(&index, smallest))
}

/// Count, bytes and error of a frame.
#[expect(clippy::cast_precision_loss, reason = "for people")]
fn describe(index: &FrameIndex, radius: Option<f32>) -> String {
    let stored = [&index.positions, &index.wide, &index.nodes];
    let bytes: u64 = stored.iter().map(|section| section.len).sum();
    let each = bytes as f64 / index.count.max(1) as f64;
    let mut text = format!(
        "{} particles, {}, {each:.2} bytes each for positions and nodes, largest error {:.3e}",
        index.count,
        index.encoding(),
        index.max_error
    );
    if let Some(radius) = radius.filter(|r| *r > 0.0) {
        text += &format!(
            " ({:.2e} of the smallest radius)",
            index.max_error / f64::from(radius)
        );
    }
    if index.dropped > 0 {
        text += &format!(", {} dropped (not finite)", index.dropped);
    }
    text
}

fn not_negative(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("`{text}` is no error; 0.02 is one"))
    }
}

fn positive(text: &str) -> Result<f32, String> {
    let value: f32 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("`{text}` is no radius"))
    }
}
