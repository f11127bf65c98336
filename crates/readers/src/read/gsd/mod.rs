//! GSD files of HOOMD-blue: several frames, values that did not change since the first frame left out.
//!
//! `file` reads the file layer (header, names, index of chunks), `frame` finds the chunks of a frame by the schema
//! `hoomd`, `shapes` has the shapes of types, `notes` reports what is
//! not in the particles. After the specification of GSD: file layer 1.0 and 2.x,
//! schema `hoomd` 1.x and 2.x.

mod file;
mod frame;
mod notes;
mod shapes;
#[cfg(test)]
mod tests;

use self::file::{GsdFile, MAGIC};
use self::frame::FrameChunks;
use super::columns::ParticleLayout;
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, ValueNames};
use crate::shared::SharedBytes;
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

/// GSD files with the schema `hoomd`.
pub const FORMAT: Format = Format::new(&Gsd);

struct Gsd;

impl Reader for Gsd {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: true,
            notes_need_whole_file: true,
            ..FormatInfo::new("gsd", &["gsd"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        // The magic number is the same two bytes four times; the other order is that of a big-endian machine.
        let swapped: Vec<u8> = MAGIC.iter().rev().copied().collect();
        if head.starts_with(&swapped) {
            let what = "a GSD file of a big-endian machine, which is not read; copy its frames to a new file with gsd \
                        on a little-endian one";
            return Err(ParseError::unsupported(what));
        }
        Ok(Confidence::signature_if(head.starts_with(MAGIC)))
    }

    /// One step for each frame. The key of a step is the index entry with which its frame begins.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        frame::steps(&GsdFile::parse(source.bytes())?, budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let file = GsdFile::parse(source.bytes())?;
        FrameChunks::find(&file, step)?.particles(budget)
    }

    /// `None` for several frames, and if a value of the particles is left out.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let file = GsdFile::parse(bytes)?;
        match frame::steps(&file, MemoryBudget::UNLIMITED)?.as_slice() {
            [step] => FrameChunks::find(&file, step)?.stored_layout(),
            _ => Ok(None),
        }
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        notes::notes(bytes)
    }

    fn value_names(&self, file: &SharedBytes) -> Vec<ValueNames> {
        notes::value_names(file).into_iter().collect()
    }
}
