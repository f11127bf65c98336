//! `spherule generate`: reproducible test particles from a seed.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use spherule_files::Bytes;
use spherule_formats::convert::{
    BlockSettings, BlockSource, BoxSource, ConvertError, ConvertSettings, ParticleSource, Phase,
    Progress, convert,
};
use spherule_formats::generate::BoxSettings;
use spherule_formats::native::{Bound, Encoding};
use spherule_formats::{ValueError, write};
use spherule_jobs::Interrupt;

use super::key_flags::encodings;
use super::numbers::{DEFAULT_BOUND, not_negative, positive};
use super::{CliError, Outcome, signals};

const SIGNAL_MESSAGES: signals::SignalMessages =
    signals::SignalMessages { stopping: "stopping", stopped: "stopped" };

const EXAMPLES: &str = "\
Examples:
  spherule generate box --particles 1e6 -o box.npy
      The box of the thesis
  spherule generate block --particles 1e7 --velocity -o water.spf
      A block of water as a native frame
  spherule generate box --particles 1e8 --radius 0.01 --encoding q16 -o box.spf
      Positions of 6 bytes each";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct GenerateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The box of the thesis, from (3,5,-2) to (7,8,2), filled uniformly at random.
    Box(BoxArgs),
    /// A block of water with waves, about 4:2:1: slightly disordered particles, two radii apart.
    Block(BlockArgs),
}

#[derive(Debug, Args)]
struct BoxArgs {
    #[command(flatten)]
    common: CommonArgs,
    /// Radius of all particles, stored in native frames.
    #[arg(long, value_parser = positive)]
    radius: Option<f32>,
}

#[derive(Debug, Args)]
struct BlockArgs {
    #[command(flatten)]
    common: CommonArgs,
    /// Radius of all particles [default: so that the block is about 1 high]
    #[arg(long, value_parser = positive)]
    radius: Option<f32>,
    /// Store a velocity for each particle.
    #[arg(long)]
    velocity: bool,
}

#[derive(Debug, Args)]
struct CommonArgs {
    /// Number of particles, such as 1e6.
    #[arg(long, value_parser = count)]
    particles: usize,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File to write: .spf, .npy or .vtk.
    #[arg(short, long)]
    output: PathBuf,
    /// Encoding of positions in native frames: f32 (12 bytes per particle), q16 (6) or q10 (4) [default: f32]
    ///
    /// If --max-error is given, the default is the smallest encoding within that error.
    #[arg(long, value_parser = encodings(), hide_possible_values = true)]
    encoding: Option<Encoding>,
    /// Largest error of a position as a fraction of the radius [default: 0.02 for q16 and q10 with a radius]
    #[arg(long, value_name = "FRACTION", value_parser = not_negative)]
    max_error: Option<f64>,
    /// Memory limit for writing a native frame: 4GiB, 512MiB.
    ///
    /// A larger frame is sorted in parts, in a temporary file next to the output.
    #[arg(long, value_name = "SIZE", default_value = "2GiB")]
    memory: Bytes,
}

pub(super) fn run(args: &GenerateArgs) -> Result<Outcome, CliError> {
    let (common, radius) = match &args.what {
        What::Box(args) => (&args.common, args.radius),
        What::Block(args) => (&args.common, args.radius),
    };
    // Check the options before anything is written
    let format = Format::of(&common.output)?;
    if common.max_error.is_some() && matches!(args.what, What::Box(_)) && radius.is_none() {
        return Err(CliError::other("--max-error is a fraction of the radius and needs --radius"));
    }
    // Choose the source
    let settings = BoxSettings::thesis(common.particles, common.seed);
    let source: Box<dyn ParticleSource> = match &args.what {
        What::Box(_) => Box::new(BoxSource::new(settings, radius)),
        What::Block(args) => Box::new(BlockSource::new(BlockSettings {
            count: common.particles as u64,
            seed: common.seed,
            radius,
            has_velocity: args.velocity,
        })),
    };
    // Write it until it ends or is interrupted
    let signals = signals::listen(SIGNAL_MESSAGES)?;
    let until = Until(signals.start_work());
    match write(format, &*source, common, &until) {
        Err(ConvertError::Interrupted) => return Ok(Outcome::Interrupted),
        result => result.map_err(|e| CliError::Other(e.to_string()))?,
    }
    let CommonArgs { particles, seed, output, .. } = common;
    message!("{}: {particles} particles, seed {seed}", output.display());
    Ok(Outcome::Done)
}

/// Stops at the first signal.
struct Until<'a>(&'a Interrupt);

impl Progress for Until<'_> {
    fn advanced(&self, _phase: Phase, _done: u64, _total: u64) -> ControlFlow<()> {
        if self.0.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[derive(Debug, Clone, Copy)]
enum Format {
    Npy,
    Vtk,
    Native,
}

impl Format {
    /// By the name, before anything is computed.
    fn of(path: &Path) -> Result<Self, CliError> {
        let extension = path.extension().and_then(|e| e.to_str());
        match extension.map(str::to_lowercase).as_deref() {
            Some("npy") => Ok(Self::Npy),
            Some("vtk") => Ok(Self::Vtk),
            Some("spf") => Ok(Self::Native),
            _ => Err(CliError::other(format!(
                "{}: the name must end in .spf, .npy or .vtk",
                path.display()
            ))),
        }
    }
}

fn write(
    format: Format,
    source: &dyn ParticleSource,
    args: &CommonArgs,
    until: &Until,
) -> Result<(), ConvertError> {
    let path = &args.output;
    match format {
        Format::Npy => write::npy::stream(path, source, until),
        Format::Vtk => write::vtk::stream(path, source, until),
        Format::Native => {
            let report = convert(source, path, &args.settings(source), until)?;
            let phases = report.seconds.iter();
            let seconds = phases.map(|(phase, s)| format!("{} {s:.2} s", phase.name()));
            message!(
                "{}, largest error {:.3e}, parts {}, memory {}, temporary files {}: {}",
                report.index.encoding(),
                report.index.max_error,
                report.parts,
                Bytes(report.peak_bytes),
                Bytes(report.spilled_bytes),
                seconds.collect::<Vec<_>>().join(", ")
            );
            Ok(())
        }
    }
}

impl CommonArgs {
    fn settings(&self, source: &dyn ParticleSource) -> ConvertSettings {
        let is_plain = self.max_error.is_none() && self.encoding.is_none();
        let usual = source.common_radius().map(|_| DEFAULT_BOUND);
        ConvertSettings {
            encoding: self.encoding.or(is_plain.then_some(Encoding::F32)),
            bound: match self.max_error.or(usual) {
                Some(fraction) => Bound::OfRadius(fraction),
                None => Bound::None,
            },
            memory: self.memory.0,
            ..ConvertSettings::default()
        }
    }
}

/// A whole number, also as 1e6 or 2_000_000.
pub(super) fn count(text: &str) -> Result<usize, ValueError> {
    let plain = text.replace('_', "");
    if let Ok(count) = plain.parse() {
        return Ok(count);
    }
    let wrong = || ValueError::new("a particle count, such as 100000 or 1e5", text);
    let value: f64 = plain.parse().map_err(|_| wrong())?;
    // All integers to 2^53 are exact in f64, and no frame holds more.
    if value.fract() != 0.0 || !(0.0..=9e15).contains(&value) {
        return Err(wrong());
    }
    #[expect(clippy::cast_possible_truncation, reason = "a whole number below 2^53")]
    Ok(value as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_integers() {
        assert_eq!(count("100000"), Ok(100_000));
        assert_eq!(count("1e6"), Ok(1_000_000));
        assert_eq!(count("2_000"), Ok(2000));
        assert_eq!(count("0"), Ok(0));
        for wrong in ["", "-1", "1.5", "1e-3", "many", "inf", "1e300"] {
            assert!(count(wrong).is_err(), "{wrong}");
        }
    }
}
