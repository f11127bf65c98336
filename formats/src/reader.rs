//! What a file format is to the rest of the crate.
//!
//! Each format is one implementation of [`Reader`] in a file of its own. `registry.rs` lists them; detection,
//! opening, sequences and conversion use that list and know no format by name.

use crate::read::ByteSource;
use crate::read::columns::ParticleLayout;
use crate::step::Step;
use crate::{MemoryBudget, ParseError, RawParticles};

/// Bytes that detection looks at. Shorter files are passed as a whole.
pub(crate) const HEAD_LEN: usize = 4096;

/// How well the first bytes of a file match a format, from weakest to strongest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Confidence {
    /// The file is not of this format.
    No,
    /// The file can be of this format, and is if its name has an extension of the format.
    IfNamed,
    /// The content looks like this format. It is, unless the name has an extension of another format.
    Likely,
    /// The signature of this format. The name does not matter.
    Signature,
}

impl Confidence {
    /// [`Self::Signature`] if the file has one.
    pub(crate) const fn signature_if(has_signature: bool) -> Self {
        if has_signature {
            Self::Signature
        } else {
            Self::No
        }
    }
}

/// What a text format consists of, which decides how much memory reading it in pieces takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StreamUnit {
    /// Rows of a table: several pieces are parsed in parallel.
    Rows,
    /// Numbers separated by white space: one piece at a time.
    Words,
}

/// How large a file is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FileExtent {
    /// Bytes, decompressed.
    pub(crate) byte_len: u64,
    /// Time steps.
    pub(crate) step_count: u64,
}

/// Reads the files of one format. Readers trust nothing in a file: they check every count against the bytes that
/// are there, or against a budget, before they allocate.
pub(crate) trait Reader: Sync {
    /// Name of the format in reports and messages. No two formats have the same.
    fn name(&self) -> &'static str;

    /// Extensions of its files, in lower case without the dot.
    fn extensions(&self) -> &'static [&'static str];

    /// Whether `stem` and `extension`, both in lower case and without `.gz`, are a name of this format.
    fn matches_name(&self, _stem: &str, extension: &str) -> bool {
        self.extensions().contains(&extension)
    }

    /// How well `head`, up to [`HEAD_LEN`] first bytes of an uncompressed file, matches.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] for a relative of the format that is not read, with what to do instead.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError>;

    /// True if files may begin with any bytes. Then short signatures of other formats prove nothing.
    fn has_no_signature(&self) -> bool {
        false
    }

    /// True if a file may hold several time steps. Their files are opened to count the steps, and large ones are
    /// mapped instead of read as a whole.
    fn may_hold_many_steps(&self) -> bool {
        false
    }

    /// Whether a file that begins with `head`, and goes on, can be read in pieces; if so, of what unit.
    /// Then [`ByteSource::text`] is all that the reader may use.
    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        None
    }

    /// Lists the time steps of a file. A step that is cut short is listed, so that reading it gives the error.
    ///
    /// # Errors
    /// [`ParseError`]; [`ParseError::TooLarge`] if the list needs more memory than `budget` allows.
    fn steps(
        &self,
        source: &mut ByteSource<'_>,
        budget: MemoryBudget,
    ) -> Result<Vec<Step>, ParseError>;

    /// Reads one of the [`Self::steps`]. `budget` is for everything but the bytes of `source`.
    ///
    /// # Errors
    /// [`ParseError`].
    fn read(
        &self,
        source: &mut ByteSource<'_>,
        step: &Step,
        budget: MemoryBudget,
    ) -> Result<RawParticles, ParseError>;

    /// Where the numbers of the only step are, if they have fixed strides in the uncompressed file `bytes`. Conversion
    /// then reads them from the mapped file. The same particles as [`Self::read`] gives, and the same errors.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn layout(&self, _bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        Ok(None)
    }

    /// Bytes held beside the file and the numbers of `particles` while these are read: the largest array, if arrays of
    /// the file are compressed or encoded. `head` is as much of the file as is in memory.
    fn unpacked_arrays_len(
        &self,
        _head: &[u8],
        _file: FileExtent,
        _particles: &RawParticles,
    ) -> u64 {
        0
    }

    /// Whether [`Self::remarks`] needs all bytes of a file. It gets them if the file is not compressed.
    fn remarks_need_whole_file(&self) -> bool {
        false
    }

    /// What a user should know about a file that begins with `head` and is not in its particles: a simulation
    /// cell, the names behind numbers.
    fn remarks(&self, _head: &[u8]) -> Vec<String> {
        Vec::new()
    }

    /// True if users of the program that wrote the file expect y to point up.
    fn is_y_up(&self, _head: &[u8]) -> bool {
        false
    }
}
