//! USD files: the points of `UsdGeomPoints` prims, and the instances of `UsdGeomPointInstancer` prims.
//!
//! `binary` and `text` read the prims of the two kinds of files, and later their values, for a `layer`. `scene` finds
//! the prims with particles and values at a time, `transform` multiplies the transforms of prims, `particles` reads a
//! time step. `package` finds the file in a `.usdz`. After the documentation of OpenUSD.
//!
//! One file is read, without those that it refers to: if positions might depend on others, the file is refused.

mod binary;
mod layer;
mod notes;
mod number_type;
mod package;
mod particles;
mod prim;
mod scene;
#[cfg(test)]
mod tests;
mod text;
mod transform;

use self::layer::Layer;
use self::scene::ParticlePrims;
use super::npy::is_usdz;
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FileExtent, FormatInfo, Reader};
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

/// USD files: binary, text, and packages of them.
pub const FORMAT: Format = Format::new(&Usd);

struct Usd;

/// The key of the step of a file in which nothing changes: the bits of a NaN.
const NO_TIME: u64 = u64::MAX;

/// Memory for what is not about the particles of a step: packed lists of a damaged file may be thousands of times as
/// long as the file.
const METADATA_BUDGET: MemoryBudget = MemoryBudget::new(1 << 30, "write fewer prims into one file");

impl Reader for Usd {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: true,
            notes_need_whole_file: true,
            ..FormatInfo::new("usd", &["usd", "usda", "usdc", "usdz"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_usd = head.starts_with(binary::MAGIC) || head.starts_with(text::MAGIC);
        Ok(Confidence::signature_if(is_usd || is_usdz(head)))
    }

    /// One step for each time. The key of a step is its time code.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        with_layer(source.bytes(), budget, |layer, len| {
            let prims = ParticlePrims::find(layer)?;
            let times = scene::times(layer, &prims, len, budget)?;
            let mut steps = Vec::new();
            if times.is_empty() {
                Step::push_with_key(&mut steps, NO_TIME, budget)?;
            }
            for time in times {
                Step::push_with_key(&mut steps, time.to_bits(), budget)?;
                if let Some(step) = steps.last_mut() {
                    step.time = Some(time / layer.metadata.rate());
                    step.number = whole(time);
                }
            }
            if steps.iter().any(|step| step.number.is_none()) {
                steps.iter_mut().for_each(|step| step.number = None);
            }
            Ok(steps)
        })
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let time = Some(step.key()).filter(|key| *key != NO_TIME).map(f64::from_bits);
        with_layer(source.bytes(), budget, |layer, _| {
            let prims = ParticlePrims::find(layer)?;
            let mut particles = particles::particles(layer, &prims, time, budget)?;
            particles.step = step.number;
            Ok(particles)
        })
    }

    /// Values of several prims are joined, and compressed ones decoded, one property after another.
    fn unpacked_arrays_len(
        &self,
        _head: &[u8],
        _file: FileExtent,
        particles: &RawParticles,
    ) -> u64 {
        2 * particles.largest_array_len()
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let budget = METADATA_BUDGET;
        let notes = with_layer(bytes, budget, |layer, _| Ok(notes::notes(layer)));
        notes.unwrap_or_default()
    }

    fn is_y_up(&self, bytes: &[u8]) -> bool {
        let budget = METADATA_BUDGET;
        let is_y_up = with_layer(bytes, budget, |layer, _| Ok(!layer.metadata.is_z_up));
        is_y_up.unwrap_or(true)
    }
}

/// Calls `read` with the layer of a file and the number of its bytes.
fn with_layer<T>(
    bytes: &[u8],
    budget: MemoryBudget,
    read: impl FnOnce(&Layer<'_>, usize) -> Result<T, ParseError>,
) -> Result<T, ParseError> {
    let range = if is_usdz(bytes) { package::first_file(bytes)? } else { 0..bytes.len() };
    let file = bytes.get(range.clone()).unwrap_or_default();
    let result = Layer::open(file, budget).and_then(|layer| read(&layer, file.len()));
    result.map_err(|error| error.behind(range.start))
}

/// A time code as the number of a frame, if it is whole.
#[expect(clippy::cast_possible_truncation, reason = "whole numbers of up to 53 bits")]
fn whole(time: f64) -> Option<i64> {
    let is_whole = time.trunc() == time && time.abs() < 9e15;
    is_whole.then_some(time as i64)
}
