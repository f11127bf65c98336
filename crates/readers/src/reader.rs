//! The interface between a file format and the rest of the crate.
//!
//! Each format implements [`Reader`] in its own file. `registry.rs` lists the formats. Detection, opening,
//! sequences and conversion use that list and refer to no format by name.

use crate::ranges::ParticleRanges;
use crate::read::ByteSource;
use crate::read::columns::ParticleLayout;
use crate::shared::SharedBytes;
use crate::step::Step;
use spherule_frame::{ParseError, RawParticles};

/// Number of bytes that detection examines. A shorter file is passed as a whole.
pub const HEAD_LEN: usize = 4096;

/// How well the first bytes of a file match a format, from weakest to strongest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Confidence {
    /// The file is not of this format.
    No,
    /// The file may be of this format; it is if its name has an extension of the format.
    IfNamed,
    /// The content looks like this format. The file is of this format unless its name has an extension of
    /// another format.
    Likely,
    /// The file has the signature of this format. The name does not matter.
    Signature,
}

impl Confidence {
    /// [`Self::Signature`] if the file has one.
    pub const fn signature_if(has_signature: bool) -> Self {
        if has_signature { Self::Signature } else { Self::No }
    }
}

/// The unit of a text format, which decides how much memory reading it in pieces needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamUnit {
    /// Rows of a table: several pieces are parsed in parallel.
    Rows,
    /// Numbers separated by white space: one piece is parsed at a time.
    Words,
}

/// The size of a file.
#[derive(Debug, Clone, Copy)]
pub struct FileExtent {
    /// Decompressed length, bytes.
    pub byte_len: u64,
    /// Number of time steps.
    pub step_count: u64,
}

/// Names behind the numbers of an attribute.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ValueNames {
    /// The attribute.
    pub attribute: String,
    /// Its numbers, rising, with their names.
    pub names: Vec<(i64, String)>,
}

/// What all files of a format have in common.
#[derive(Debug, Clone, Copy)]
pub struct FormatInfo {
    /// Name of the format in reports and messages, distinct for each format.
    pub name: &'static str,
    /// File name extensions, in lower case without the dot.
    pub extensions: &'static [&'static str],
    /// Whether a file may hold several time steps. Such files are opened to count their steps, and large ones are mapped
    /// instead of read as a whole.
    pub may_hold_many_steps: bool,
    /// Whether files may begin with any bytes, so that short signatures of other formats prove nothing.
    pub has_no_signature: bool,
    /// Whether files may refer to others that are not steps of their own.
    pub may_refer_to_files: bool,
    /// Whether [`Reader::notes`] needs all bytes of a file. It gets them if the file is not compressed.
    pub notes_need_whole_file: bool,
    /// Length of an angstrom in the unit of positions, if that is fixed by the format.
    pub angstrom: f64,
    /// Whether the particles are atoms or groups of them, whatever their names are.
    pub is_molecular: bool,
    /// The unit of times, if that is fixed by the format.
    pub time_unit: Option<&'static str>,
}

impl FormatInfo {
    /// A format whose files hold one step and nothing special.
    pub const fn new(name: &'static str, extensions: &'static [&'static str]) -> Self {
        Self {
            name,
            extensions,
            may_hold_many_steps: false,
            has_no_signature: false,
            may_refer_to_files: false,
            notes_need_whole_file: false,
            angstrom: 1.0,
            is_molecular: false,
            time_unit: None,
        }
    }

    /// A format of molecules, with several steps in a file.
    pub const fn molecular(name: &'static str, extensions: &'static [&'static str]) -> Self {
        Self { is_molecular: true, may_hold_many_steps: true, ..Self::new(name, extensions) }
    }
}

/// Reads the files of one format. A reader trusts nothing in a file: before it allocates, it checks every count
/// against the available bytes or against a budget.
pub trait Reader: Sync {
    /// What all files of the format have in common.
    fn info(&self) -> FormatInfo;

    /// Whether a file name is typical of this format. `stem` and `extension` are in lower case and without the
    /// extension of a compression.
    fn matches_name(&self, _stem: &str, extension: &str) -> bool {
        self.info().extensions.contains(&extension)
    }

    /// How well `head` matches: the first bytes of an uncompressed file, up to [`HEAD_LEN`].
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] for a related format that is not read, with a remedy.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError>;

    /// The unit in which a file that begins with `head` and is longer can be read in pieces; `None` if it
    /// cannot. If it can, the reader may use nothing but [`ByteSource::text`].
    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        None
    }

    /// Whether a step of a file that is read in pieces needs nothing of what is before it but `head`, the beginning of
    /// the file.
    fn reads_steps_alone(&self, _head: &[u8]) -> bool {
        true
    }

    /// Lists the time steps of a file. A truncated step is listed too, so that reading it gives the error. By default, the
    /// whole file is one step.
    ///
    /// # Errors
    /// [`ParseError`]; [`ParseError::TooLarge`] if the list needs more memory than the budget of `source` allows.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        Ok(vec![Step::whole(source.bytes().len())])
    }

    /// Reads one of the [`Self::steps`]. The budget of `source` limits everything except its bytes.
    ///
    /// # Errors
    /// [`ParseError`].
    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError>;

    /// The layout of the numbers of the only step, if they have fixed strides in the uncompressed file `bytes`.
    /// Conversion then reads them from the mapped file. The particles and the errors must be the same as with
    /// [`Self::read`].
    ///
    /// # Errors
    /// As [`Self::read`].
    fn layout(&self, _bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        Ok(None)
    }

    /// The particles of the only step as ranges of the mapped `file`, if they are not in a [`Self::layout`] but can be
    /// read without decoding the whole file. Conversion then does so. The particles and the errors must be the same
    /// as with [`Self::read`].
    ///
    /// # Errors
    /// As [`Self::read`].
    fn ranges(&self, _file: &SharedBytes) -> Result<Option<Box<dyn ParticleRanges>>, ParseError> {
        Ok(None)
    }

    /// Bytes held beside the file and the numbers of `particles` while they are read: those of the largest array, if
    /// the arrays of the file are compressed or encoded. `head` is the part of the file that is in memory.
    fn unpacked_arrays_len(
        &self,
        _head: &[u8],
        _file: FileExtent,
        _particles: &RawParticles,
    ) -> u64 {
        0
    }

    /// Opens the files beside `file` that have particles of it, as far as they exist.
    fn open_referenced(&self, _file: &SharedBytes) {}

    /// Notes for the user about a file that begins with `head`, on things that are not in its particles: a
    /// simulation cell, or names behind numbers.
    fn notes(&self, _head: &[u8]) -> Vec<String> {
        Vec::new()
    }

    /// [`Self::notes`] of all bytes of a file.
    fn notes_of_file(&self, file: &SharedBytes) -> Vec<String> {
        self.notes(file)
    }

    /// The names behind the numbers of attributes in the first step of an uncompressed file: of types, species, parts.
    fn value_names(&self, _file: &SharedBytes) -> Vec<ValueNames> {
        Vec::new()
    }

    /// Number of files that the step in `file` is divided among.
    fn piece_count(&self, _file: &SharedBytes) -> u64 {
        1
    }

    /// Whether `file` has no values of its own but those of the files that its step is divided among, which are beside
    /// it.
    fn refers_to_pieces(&self, _file: &SharedBytes) -> bool {
        false
    }

    /// True if users of the program that wrote the file expect y to point up. `_bytes` are the first bytes of the file,
    /// or all if [`FormatInfo::notes_need_whole_file`] and the file is not compressed.
    fn is_y_up(&self, _bytes: &[u8]) -> bool {
        false
    }
}
