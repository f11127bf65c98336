//! A file format as a value, with the operations that callers need.

use std::fmt;

use crate::read::{ByteSource, CUT_SHORT, stream_bytes};
use crate::reader::{Reader, StreamUnit};
use crate::step::Step;
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

/// A file format that this crate reads. `spherule_formats::registry::all` lists all formats; constants such as `read::ply::FORMAT`
/// name one.
#[derive(Clone, Copy)]
pub struct Format(&'static dyn Reader);

impl PartialEq for Format {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Format {}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Format({})", self.name())
    }
}

impl Format {
    /// The format that `reader` reads.
    pub const fn new(reader: &'static dyn Reader) -> Self {
        Self(reader)
    }

    /// The reader of the format.
    pub const fn reader(self) -> &'static dyn Reader {
        self.0
    }

    /// The name in reports.
    pub fn name(self) -> &'static str {
        self.0.info().name
    }

    /// True if one file of this format may hold several time steps.
    pub fn may_hold_many_steps(self) -> bool {
        self.0.info().may_hold_many_steps
    }

    /// Lists the time steps of the uncompressed file `bytes`.
    ///
    /// # Errors
    /// [`ParseError`] of the format's reader.
    pub fn steps(self, bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        self.steps_within(&mut ByteSource::whole(bytes), MemoryBudget::UNLIMITED)
    }

    /// [`Self::steps`] of `source`, limited by `budget`.
    pub fn steps_within(
        self,
        source: &mut ByteSource<'_>,
        budget: MemoryBudget,
    ) -> Result<Vec<Step>, ParseError> {
        source.limit(budget);
        self.0.steps(source)
    }

    /// Reads one of the [`Self::steps`] of `bytes`.
    ///
    /// # Errors
    /// [`ParseError`] of the format's reader.
    pub fn read(self, bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        let mut source = ByteSource::whole(bytes);
        self.read_within(&mut source, step, MemoryBudget::UNLIMITED)
    }

    /// [`Self::read`] of `source`, if the numbers fit into `budget`. The bytes of `source` do not count.
    ///
    /// # Errors
    /// As [`Self::read`], and [`ParseError::TooLarge`].
    pub fn read_within(
        self,
        source: &mut ByteSource<'_>,
        step: &Step,
        budget: MemoryBudget,
    ) -> Result<RawParticles, ParseError> {
        if let (Some(bytes), Some(range)) = (source.as_whole(), step.byte_range())
            && (bytes.len() < range.end || range.end < range.start)
        {
            let what = format!("the step ends at {}: {CUT_SHORT}", range.end);
            return Err(ParseError::malformed(bytes.len(), what));
        }
        source.limit(budget);
        self.0.read(source, step)
    }

    /// Bytes held beside the numbers while a file that begins with `head` is read in pieces.
    pub fn stream_bytes(self, head: &[u8]) -> u64 {
        stream_bytes(self.0.stream_unit(head) == Some(StreamUnit::Rows))
    }

    /// Whether a file that begins with `head` and is longer is text that can be read in pieces.
    pub fn is_streamed(self, head: &[u8]) -> bool {
        self.0.stream_unit(head).is_some()
    }
}
