//! Converts frames of any size to native frames.
//!
//! A source ([`ParticleSource`]) is read twice: once to survey it (`survey.rs`), and once to bring every
//! particle into tree order. A source that fits into the memory limit of the settings is ordered at once. A
//! larger source is divided along a space-filling curve into parts that fit (`divide.rs`). Their particles are
//! stored in chunks in memory and, when memory is full, in a scratch file (`store.rs`). The parts are then
//! ordered one after the other; the next part is loaded and the last one is written at the same time.
//!
//! The bytes of a frame depend on the source and the settings. With more than one part, they also depend on the
//! part size, which follows from [`ConvertSettings::memory`] and the width of the rows. They never depend on
//! the number of threads or on what was spilled to disk.

use std::path::Path;
use std::time::Instant;

mod account;
mod batch;
mod carry;
mod columns;
mod curve;
mod divide;
mod foreign;
mod limits;
mod order;
mod output;
mod parts;
mod scratch;
mod settings;
mod source;
mod sources;
mod store;
mod survey;
mod whole;

use account::MemoryAccount;
use columns::StoredColumns;
use limits::Limits;
use output::FrameOutput;
use parts::PartCounts;
use survey::{BatchSettings, ConvertRequest, survey};

pub use foreign::open_source;
pub use settings::{
    AttributeChoice, ConvertError, ConvertReport, ConvertSettings, Phase, Progress, RadiusRule,
};
pub use source::{ParticleSource, SourceAttribute};
pub use sources::{BlockSettings, BlockSource, BoxSource, NativeSource, RawSource};

/// Writes the particles of `source` to `path` as a native frame.
///
/// # Errors
/// [`ConvertError`]; in that case no file is left behind.
pub fn convert(
    source: &dyn ParticleSource,
    path: &Path,
    settings: &ConvertSettings,
    progress: &dyn Progress,
) -> Result<ConvertReport, ConvertError> {
    let request = ConvertRequest { source, path, settings, progress };
    let columns = StoredColumns::choose(source, settings, path)?;
    let limits = Limits::of(settings, source.count(), columns.width(), columns.widest());
    convert_within(request, columns, limits)
}

/// [`convert`] for a source that is much larger than the memory: with the smallest parts, all of them spilled to
/// disk. Used for fuzzing, because the smallest memory that settings allow holds any source of a few megabytes.
///
/// # Errors
/// As [`convert`].
#[doc(hidden)]
pub fn convert_in_parts(
    source: &dyn ParticleSource,
    path: &Path,
    settings: &ConvertSettings,
) -> Result<ConvertReport, ConvertError> {
    let request = ConvertRequest { source, path, settings, progress: &() };
    let columns = StoredColumns::choose(source, settings, path)?;
    convert_within(request, columns, Limits::SMALLEST)
}

/// Converts within `limits`.
fn convert_within(
    request: ConvertRequest,
    columns: StoredColumns,
    limits: Limits,
) -> Result<ConvertReport, ConvertError> {
    // Survey the source
    let mut clock = Clock::new();
    let account = MemoryAccount::default();
    let reading = BatchSettings {
        batch_len: limits.batch_len,
        sample_stride: if limits.is_whole {
            0
        } else {
            request.source.count().div_ceil(limits.sample_len).max(1)
        },
    };
    let survey = survey(request, &columns, reading)?;
    clock.lap(Phase::Survey);
    // Choose the columns that are stored
    let (columns, common) = survey.settled(request.path, columns)?;
    let mut output = FrameOutput::new(request, &columns, &survey, common, limits.run_len);
    // Order and write the particles
    let divided = if limits.is_whole {
        whole::convert(&mut output, &limits, &account)?;
        PartCounts { parts: 1, spilled_bytes: 0 }
    } else {
        parts::convert(&mut output, &limits, &account, &mut clock)?
    };
    clock.lap(Phase::Order);
    // Complete the file
    let index = output.finish()?;
    clock.lap(Phase::Finish);
    Ok(ConvertReport {
        index,
        seconds: clock.seconds,
        peak_bytes: account.most(),
        spilled_bytes: divided.spilled_bytes,
        parts: divided.parts,
    })
}

/// Measures the seconds of each phase.
struct Clock {
    last: Instant,
    seconds: Vec<(Phase, f64)>,
}

impl Clock {
    fn new() -> Self {
        Self { last: Instant::now(), seconds: Vec::new() }
    }

    /// Ends `phase` now.
    fn lap(&mut self, phase: Phase) {
        let now = Instant::now();
        let seconds = now.duration_since(self.last).as_secs_f64();
        self.seconds.push((phase, seconds));
        self.last = now;
    }
}

#[cfg(test)]
mod tests;
