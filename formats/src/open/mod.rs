//! Opens one particle file: reads it, decompresses it, finds the format and the steps inside.
//!
//! The only place that reads foreign files; the readers see bytes. Text is read in pieces from the disk,
//! files of several steps are mapped step by step, other files are read as a whole, all within a [`MemoryBudget`]. A
//! file that changes while it is read is reported as such, because a simulation that is still running is the usual
//! cause.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rkyv::util::AlignedVec;

use crate::native;
use crate::read::{ByteSource, Step};
use crate::{FrameError, MemoryBudget, ParseError, RawParticles};
use spherule_readers::FileExtent;
use spherule_readers::Format;
use spherule_readers::compression::{ByteStream, Decompressor, StreamError};
use spherule_readers::regular::{FileStamp, regular_len};
use spherule_readers::shared::SharedBytes;

mod head;
mod mapped;
mod siblings;
mod streamed;

pub use head::{detect_file, is_native, notes, value_names};
pub(crate) use head::{head, piece_count, referenced_files, refers_to_pieces};
pub use spherule_readers::compression::unpacked_len;

use mapped::SteppedFile;
pub(crate) use siblings::SiblingFiles;
use spherule_readers::decompressor;
use streamed::StreamedFile;

/// Files up to this length, decompressed, are always read as a whole. Of longer files, this many bytes decide whether
/// they must be. More than the reader of tables needs to find the columns.
const PREFIX_LEN: usize = 2 << 20;

/// A file ready to be read step by step.
#[derive(Debug)]
pub struct FrameFile {
    path: PathBuf,
    content: Content,
    format: Format,
    steps: Vec<Step>,
    stored_len: u64,
    notes: Vec<String>,
    budget: MemoryBudget,
    has_mesh_points: bool,
    /// The files that it refers to, if it was read as a whole.
    siblings: SiblingFiles,
}

/// Where the bytes of a file are.
#[derive(Debug)]
enum Content {
    /// In memory.
    Whole(SharedBytes),
    /// In memory, aligned for native frames, whose sections are used in place.
    Aligned(AlignedVec<64>),
    /// On the disk, mapped for each step.
    Stepped(SteppedFile),
    /// On the disk, read in pieces for each step.
    Streamed(Box<StreamedFile>),
}

impl Content {
    fn whole(bytes: Vec<u8>) -> Self {
        Self::Whole(SharedBytes::new(Arc::new(bytes)))
    }

    /// The same content of a file that may refer to `siblings`.
    fn among(self, siblings: &SiblingFiles) -> Self {
        match self {
            Self::Whole(bytes) => Self::Whole(siblings.around(bytes)),
            other => other,
        }
    }

    /// All bytes, or the first ones if the file is on the disk.
    fn head(&self) -> &[u8] {
        match self {
            Self::Whole(bytes) => bytes,
            Self::Aligned(bytes) => bytes,
            Self::Stepped(file) => file.head(),
            Self::Streamed(file) => file.head(),
        }
    }

    /// Bytes that are held beside the numbers while these are read.
    fn held_len(&self, format: Format) -> u64 {
        let held = self.head().len() as u64;
        match self {
            Self::Streamed(file) => held + format.stream_bytes(file.head()) + file.decoder_len(),
            Self::Whole(_) | Self::Aligned(_) | Self::Stepped(_) => held,
        }
    }
}

impl FrameFile {
    /// [`Self::open_within`] without a limit.
    ///
    /// # Errors
    /// As [`Self::open_within`].
    pub fn open(path: &Path) -> Result<Self, FrameError> {
        Self::open_within(path, MemoryBudget::UNLIMITED)
    }

    /// Reads the file at `path`, whatever its name.
    ///
    /// # Errors
    /// [`FrameError::Io`] if it cannot be read or changed size meanwhile,
    /// [`FrameError::Unsupported`] for a known format that is not read (or no regular file),
    /// [`FrameError::TooLarge`] if it needs more memory than `budget` allows, and
    /// [`FrameError::Malformed`] for everything that breaks its own format.
    pub fn open_within(path: &Path, budget: MemoryBudget) -> Result<Self, FrameError> {
        Self::open_as(path, budget, false)
    }

    /// [`Self::open_within`] of a file whose particles are not read at once: if it is neither compressed nor text, it is
    /// mapped instead of read into memory, also if it has one step.
    ///
    /// # Errors
    /// As [`Self::open_within`].
    pub fn open_mapped(path: &Path, budget: MemoryBudget) -> Result<Self, FrameError> {
        Self::open_as(path, budget, true)
    }

    fn open_as(path: &Path, budget: MemoryBudget, always_map: bool) -> Result<Self, FrameError> {
        if is_native(path)? {
            let len = regular_len(path)?;
            let fits = budget.for_content().check(len, "the file is");
            fits.map_err(|e| e.in_file(path))?;
            let bytes = native::read_aligned(path)?;
            let stored_len = bytes.len() as u64;
            let content = Content::Aligned(bytes);
            return Self::new(path, content, stored_len, Vec::new(), budget);
        }
        let (content, stamp, notes) = Self::read_content(path, budget, always_map)?;
        stamp.check(path)?;
        let siblings = SiblingFiles::of(path);
        let content = content.among(&siblings);
        let file = Self::new(path, content, stamp.len, notes, budget)?;
        Ok(Self { siblings, ..file })
    }

    /// Reads as much of the file at `path` as has to be in memory. Also returns what the file was before, and notes.
    fn read_content(
        path: &Path,
        budget: MemoryBudget,
        always_map: bool,
    ) -> Result<(Content, FileStamp, Vec<String>), FrameError> {
        let in_file = |e: StreamError| e.in_file(path);
        let stamp = FileStamp::of(path)?;
        // Read the start, which is enough to detect the format
        let mut stream = decompressor(path, budget)?;
        let is_compressed = stream.is_compressed();
        let mut bytes = Vec::new();
        if !is_compressed {
            let len = usize::try_from(stamp.len).unwrap_or(usize::MAX);
            bytes.reserve_exact(len.min(PREFIX_LEN));
        }
        let is_whole = stream.fill(&mut bytes, PREFIX_LEN).map_err(in_file)? < PREFIX_LEN;
        // Fail before more is decompressed than is of use.
        let format = crate::detect::detect_format(&bytes, path).map_err(|e| e.in_file(path))?;
        // Small files are kept whole
        if is_whole {
            return Ok((Content::whole(bytes), stamp, stream.into_notes()));
        }
        // Formats that are read in order need no more bytes at once
        if format.is_streamed(&bytes) {
            let decoder_len = is_compressed.then(|| stream.decoder_len());
            let file = StreamedFile::new(bytes, decoder_len, stamp);
            return Ok((Content::Streamed(Box::new(file)), stamp, Vec::new()));
        }
        // Long trajectories are mapped: steps are read one by one
        if !is_compressed && (always_map || format.may_hold_many_steps()) {
            let file = SteppedFile::new(&bytes, stamp);
            if always_map || file.is_worth_mapping(path, format, budget) {
                return Ok((Content::Stepped(file), stamp, Vec::new()));
            }
        }
        // Read the rest of all others into memory, as far as the budget allows
        let room = budget.for_content();
        if !is_compressed {
            let fits = room.check(stamp.len, "the file is");
            fits.map_err(|e| e.in_file(path))?;
        }
        // An estimate for compressed files. Too much does no harm: pages that are not used cost nothing.
        let len = unpacked_len(path).unwrap_or(stamp.len).min(room.bytes());
        let more = usize::try_from(len).unwrap_or(usize::MAX);
        let _ = bytes.try_reserve_exact(more.saturating_sub(bytes.len()).saturating_add(1));
        let notes = stream.finish(&mut bytes, room).map_err(in_file)?;
        Ok((Content::whole(bytes), stamp, notes))
    }

    /// Reads `bytes` as the content of a file at `path`, which is not opened.
    ///
    /// # Errors
    /// As [`Self::open`], except for reading the file.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, FrameError> {
        Self::from_bytes_within(path, bytes, MemoryBudget::UNLIMITED)
    }

    /// [`Self::from_bytes`], decompressed and read within `budget`.
    ///
    /// # Errors
    /// As [`Self::open_within`], except for reading the file.
    pub fn from_bytes_within(
        path: &Path,
        bytes: Vec<u8>,
        budget: MemoryBudget,
    ) -> Result<Self, FrameError> {
        let stored_len = bytes.len() as u64;
        let in_file = |e: StreamError| e.in_file(path);
        let mut notes = Vec::new();
        let stream = Decompressor::new(Cursor::new(&bytes), budget).map_err(in_file)?;
        let unpacked = if stream.is_compressed() {
            let mut unpacked = Vec::new();
            let left = stream.finish(&mut unpacked, budget.for_content());
            notes.extend(left.map_err(in_file)?);
            Some(unpacked)
        } else {
            None
        };
        let bytes = unpacked.unwrap_or(bytes);
        Self::new(path, Content::whole(bytes), stored_len, notes, budget)
    }

    fn new(
        path: &Path,
        content: Content,
        stored_len: u64,
        notes: Vec<String>,
        budget: MemoryBudget,
    ) -> Result<Self, FrameError> {
        let in_file = |e: ParseError| e.in_file(path);
        let format = crate::detect::detect_format(content.head(), path).map_err(in_file)?;
        // Find the steps, with the memory that the content leaves
        let left = budget.less(content.held_len(format));
        let steps = match &content {
            Content::Streamed(file) => file.steps(path, format, left)?,
            Content::Stepped(file) => file.steps(path, format, left)?,
            Content::Whole(bytes) => {
                let mut source = ByteSource::shared(bytes);
                format.steps_within(&mut source, left).map_err(in_file)?
            }
            Content::Aligned(bytes) => {
                let mut source = ByteSource::whole(bytes);
                format.steps_within(&mut source, left).map_err(in_file)?
            }
        };
        Ok(Self {
            siblings: SiblingFiles::of(path),
            path: path.to_owned(),
            format,
            steps,
            content,
            stored_len,
            notes,
            budget,
            has_mesh_points: false,
        })
    }

    /// Reads the vertices of a mesh as particles if `are_particles`; otherwise, meshes are refused.
    #[must_use]
    pub fn with_mesh_points(mut self, are_particles: bool) -> Self {
        self.has_mesh_points = are_particles;
        match &mut self.content {
            Content::Stepped(file) => file.set_mesh_points(are_particles),
            Content::Streamed(file) => file.set_mesh_points(are_particles),
            Content::Whole(_) | Content::Aligned(_) => {}
        }
        self
    }

    /// Whether the vertices of a mesh are particles.
    pub const fn has_mesh_points(&self) -> bool {
        self.has_mesh_points
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Format of the file.
    pub const fn format(&self) -> Format {
        self.format
    }

    /// The time steps inside; may be none.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The uncompressed content; of a large text its beginning.
    pub fn bytes(&self) -> &[u8] {
        self.content.head()
    }

    /// Bytes on disk, compressed if it was.
    pub const fn stored_len(&self) -> u64 {
        self.stored_len
    }

    /// Bytes of the uncompressed content. For compressed text an estimate until it was read to its end.
    pub fn unpacked_len(&self) -> u64 {
        match &self.content {
            Content::Streamed(file) => file.unpacked_len(&self.path),
            Content::Stepped(file) => file.len(),
            Content::Whole(_) | Content::Aligned(_) => self.bytes().len() as u64,
        }
    }

    /// Bytes that are held beside the numbers while these are read.
    pub fn held_len(&self) -> u64 {
        self.content.held_len(self.format)
    }

    /// Whether the file is mapped while a step is read.
    pub const fn is_mapped(&self) -> bool {
        matches!(self.content, Content::Stepped(_))
    }

    /// Bytes that are held beside content and numbers while `particles` are read: arrays that are compressed,
    /// or text in XML, in the content.
    pub fn unpacked_arrays_len(&self, particles: &RawParticles) -> u64 {
        let file =
            FileExtent { byte_len: self.unpacked_len(), step_count: self.steps.len() as u64 };
        let reader = self.format.reader();
        reader.unpacked_arrays_len(self.bytes(), file, particles)
    }

    /// Oddities that did not stop the file from being read; those at the end of a large text once it
    /// was read.
    pub fn notes(&self) -> &[String] {
        match &self.content {
            Content::Streamed(file) => file.notes(),
            Content::Whole(_) | Content::Aligned(_) | Content::Stepped(_) => &self.notes,
        }
    }

    /// Reads step `index` of [`Self::steps`].
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if there is no such step or its bytes are damaged,
    /// [`FrameError::Unsupported`] for a variant of the format that is not read,
    /// [`FrameError::TooLarge`] if its numbers need more memory than is allowed.
    pub fn read(&self, index: usize) -> Result<RawParticles, FrameError> {
        // Find the step, and the memory for it
        let step = self.steps.get(index).ok_or_else(|| {
            let what = format!("step {index} does not exist, the file has {}", self.steps.len());
            ParseError::malformed(self.bytes().len(), what).in_file(&self.path)
        })?;
        let left = self.budget.less(self.held_len());
        let in_file = |e: ParseError| e.in_file(&self.path);
        // Read it from where the content is
        let particles = match &self.content {
            Content::Streamed(file) => {
                return file.read(&self.path, self.format, (step, self.steps.len()), left);
            }
            Content::Stepped(file) => file.read(&self.path, self.format, step, left)?,
            Content::Whole(bytes) => {
                let mut source = ByteSource::shared(bytes);
                source.set_mesh_points(self.has_mesh_points);
                let particles = self.format.read_within(&mut source, step, left);
                self.siblings.check()?;
                particles.map_err(in_file)?
            }
            Content::Aligned(bytes) => {
                let mut source = ByteSource::whole(bytes);
                let particles = self.format.read_within(&mut source, step, left);
                particles.map_err(in_file)?
            }
        };
        // Check that the particles fit beside the content
        let fits = left.check(particles.byte_len(), "its numbers in memory are");
        fits.map_err(in_file)?;
        Ok(particles)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use std::fs;

    use super::*;
    use crate::read::lammps;

    const TEXT: &[u8] = b"ITEM: TIMESTEP\n0\n";

    fn gz(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).expect("memory takes all");
        encoder.finish().expect("memory takes all")
    }

    fn open(bytes: Vec<u8>) -> Result<FrameFile, FrameError> {
        FrameFile::from_bytes(Path::new("a.bgeo"), bytes)
    }

    #[track_caller]
    fn fails(bytes: Vec<u8>, words: &str) {
        let error = open(bytes).expect_err("damaged").to_string();
        assert!(error.starts_with("a.bgeo: ") && error.contains(words), "{error}");
    }

    #[test]
    fn gzip_members_are_joined() {
        let packed = [gz(&TEXT[..9]), gz(&TEXT[9..])].concat();
        let file = open(packed.clone()).expect("two members");
        assert_eq!(file.bytes(), TEXT);
        assert_eq!(file.format(), lammps::FORMAT);
        assert_eq!(file.stored_len(), packed.len() as u64);
        assert!(file.notes().is_empty());
    }

    #[test]
    fn bytes_after_the_stream_are_reported() {
        let zeros = open([gz(TEXT), vec![0; 512]].concat()).expect("padding");
        assert!(zeros.bytes() == TEXT && zeros.notes().is_empty());
        let other = open([gz(TEXT), b"junk".to_vec()].concat()).expect("ignored");
        assert!(other.bytes() == TEXT && other.notes().len() == 1);
    }

    #[test]
    #[cfg_attr(miri, ignore = "unpacks too often for an interpreter")]
    fn every_truncation_of_gzip_is_detected() {
        let packed = [gz(&TEXT[..9]), gz(&TEXT[9..])].concat();
        let first = gz(&TEXT[..9]).len();
        for len in (3..packed.len()).filter(|l| *l != first) {
            fails(packed[..len].to_vec(), "still being written");
        }
    }

    #[test]
    fn damaged_gzip_is_detected() {
        let mut packed = gz(TEXT);
        let crc = packed.len() - 8;
        packed[crc] ^= 1;
        fails(packed, "damaged");
        fails(gz(&gz(TEXT)), "gzip inside gzip");
        fails(gz(b""), "empty");
    }

    #[test]
    fn files_that_cannot_be_read_are_named() {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let error = FrameFile::open(dir.path()).expect_err("a directory");
        assert!(error.to_string().contains("a directory"), "{error}");
        let missing = dir.path().join("none.vtk");
        assert!(matches!(FrameFile::open(&missing), Err(FrameError::Io { .. })));
        let path = dir.path().join("dump.7");
        fs::write(&path, gz(TEXT)).expect("writable");
        assert_eq!(detect_file(&path).expect("known"), lammps::FORMAT);
        assert_eq!(FrameFile::open(&path).expect("known").bytes(), TEXT);
    }
}
