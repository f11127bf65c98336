//! `spherule generate`: seeded particles that others can make exactly.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use glam::DVec3;
use spherule_formats::generate::{BoxSettings, fill_box};
use spherule_formats::{FrameError, ParticleFrame, Positions, RawParticles, native, write};

use super::{CliError, Outcome};

#[derive(Debug, Args)]
pub(super) struct GenerateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The thesis's box (3,5,-2)-(7,8,2), filled evenly by splitmix64.
    Box {
        /// Particles; 1e6 is understood.
        #[arg(long, value_parser = count)]
        particles: usize,
        /// The generator's first state.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// File to write: .spf, .npy or .vtk.
        #[arg(short, long)]
        output: PathBuf,
    },
}

pub(super) fn run(args: &GenerateArgs) -> Result<Outcome, CliError> {
    let What::Box {
        particles,
        seed,
        output,
    } = &args.what;
    let writer = writer(output)?;
    let centers = fill_box(&BoxSettings::thesis(*particles, *seed));
    writer(output, centers).map_err(|e| CliError::Other(e.to_string()))?;
    say!("{}: {particles} particles, seed {seed}", output.display());
    Ok(Outcome::Done)
}

type Writer = fn(&Path, Vec<glam::Vec3>) -> Result<(), FrameError>;

/// By the name, before anything is computed.
fn writer(path: &Path) -> Result<Writer, CliError> {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .map(str::to_lowercase);
    match extension.as_deref() {
        Some("npy") => Ok(|path, centers| write::npy::write(path, &centers)),
        Some("vtk") => Ok(|path, centers| write::vtk::write(path, &centers, &[])),
        Some("spf") => Ok(write_native),
        _ => Err(CliError::other(format!(
            "{}: which format? name the file .spf, .npy or .vtk",
            path.display()
        ))),
    }
}

fn write_native(path: &Path, centers: Vec<glam::Vec3>) -> Result<(), FrameError> {
    let raw = RawParticles {
        positions: Positions::F32(centers),
        attributes: Vec::new(),
        time: None,
        step: None,
    };
    native::write(path, &ParticleFrame::from_raw(raw, DVec3::ZERO), None)
}

/// A whole number, also as 1e6 or 2_000_000.
pub(super) fn count(text: &str) -> Result<usize, String> {
    let plain = text.replace('_', "");
    if let Ok(count) = plain.parse() {
        return Ok(count);
    }
    let wrong = || format!("`{text}` is no number of particles, as 100000 or 1e5");
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
    fn counts_are_whole() {
        assert_eq!(count("100000"), Ok(100_000));
        assert_eq!(count("1e6"), Ok(1_000_000));
        assert_eq!(count("2_000"), Ok(2000));
        assert_eq!(count("0"), Ok(0));
        for wrong in ["", "-1", "1.5", "1e-3", "many", "inf", "1e300"] {
            assert!(count(wrong).is_err(), "{wrong}");
        }
    }
}
