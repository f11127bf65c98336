//! Opens one file of particles: reads it, takes gzip off, finds the format and the steps inside.
//!
//! The only place that reads foreign files; the readers see bytes. Text is read in pieces from the disk,
//! other files as a whole, and both within a [`MemoryBudget`]. A file that changes while it is
//! read is told as such, because a simulation that is still running is the usual cause.

use std::fs::{self, File};
use std::io::{self, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::SystemTime;

use flate2::bufread::GzDecoder;
use memchr::memmem;
use rkyv::util::AlignedVec;

use crate::detect::{Format, HEAD_LEN};
use crate::message::one_line;
use crate::native;
use crate::read::{Step, TextInput, remarks};
use crate::unpack::{ByteSource, SourceError, Unpacker};
use crate::{FrameError, MemoryBudget, ParseError, RawParticles};

/// Files up to this length, unpacked, are always read as a whole; of longer ones so much decides whether that
/// is needed. More than the reader of tables looks at to find columns.
const HEAD: usize = 2 << 20;

/// A file ready to give its steps.
#[derive(Debug)]
pub struct FrameFile {
    path: PathBuf,
    content: Content,
    format: Format,
    steps: Vec<Step>,
    stored_len: u64,
    notes: Vec<String>,
    budget: MemoryBudget,
}

/// Where the bytes of a file are.
#[derive(Debug)]
enum Content {
    Plain(Vec<u8>),
    /// Native frames: their sections are used as they lie.
    Aligned(AlignedVec<64>),
    /// On the disk: they are read whenever they are wanted.
    Streamed(Box<Streamed>),
}

/// Text that is not in memory.
#[derive(Debug)]
struct Streamed {
    /// Its beginning, unpacked.
    head: Arc<[u8]>,
    is_packed: bool,
    /// What the file was when it was opened.
    stamp: Stamp,
    /// Found when it was first read to its end: bytes once unpacked, and oddities.
    end: OnceLock<(u64, Vec<String>)>,
    /// Where the step that was read last ends: the next one often begins there, and packed files have no other way
    /// to it than from their beginning.
    parked: Mutex<Option<TextInput<'static>>>,
}

/// What tells a file from one that was written to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stamp {
    len: u64,
    modified: Option<SystemTime>,
}

impl Content {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Plain(bytes) => bytes,
            Self::Aligned(bytes) => bytes,
            Self::Streamed(streamed) => &streamed.head,
        }
    }

    /// Bytes that are held beside the numbers while these are read.
    fn held_len(&self, format: Format) -> u64 {
        let held = self.bytes().len() as u64;
        match self {
            Self::Streamed(_) => held + format.stream_bytes(),
            Self::Plain(_) | Self::Aligned(_) => held,
        }
    }
}

impl FrameFile {
    /// [`Self::open_within`] all memory that there is.
    ///
    /// # Errors
    /// As [`Self::open_within`].
    pub fn open(path: &Path) -> Result<Self, FrameError> {
        Self::open_within(path, MemoryBudget::UNLIMITED)
    }

    /// Reads and understands the file at `path`, whatever its name.
    ///
    /// # Errors
    /// [`FrameError::Io`] if it cannot be read or changed size meanwhile,
    /// [`FrameError::Unsupported`] for a known format that is not read (or no regular file),
    /// [`FrameError::TooLarge`] if it needs more memory than `budget` allows, and
    /// [`FrameError::Malformed`] for everything that breaks its own format.
    pub fn open_within(path: &Path, budget: MemoryBudget) -> Result<Self, FrameError> {
        if is_native(path)? {
            let len = regular_len(path)?;
            let fits = budget.for_content().check(len, "the file is");
            fits.map_err(|e| e.in_file(path))?;
            let bytes = native::read_aligned(path)?;
            let stored_len = bytes.len() as u64;
            let content = Content::Aligned(bytes);
            return Self::new(path, content, stored_len, Vec::new(), budget);
        }
        let in_file = |e: SourceError| e.in_file(path);
        let stamp = Stamp::of(path)?;
        let mut source = unpacker(path)?;
        let mut bytes = Vec::new();
        if !source.is_packed() {
            bytes.reserve_exact(usize::try_from(stamp.len).map_or(HEAD, |len| len.min(HEAD)));
        }
        let is_whole = source.fill(&mut bytes, HEAD).map_err(in_file)? < HEAD;
        // Before more is unpacked than is of use.
        Format::detect(&bytes, path).map_err(|e| e.in_file(path))?;
        if !is_whole && is_streamed(&bytes, path) {
            let streamed = Streamed {
                head: bytes.into(),
                is_packed: source.is_packed(),
                stamp,
                end: OnceLock::new(),
                parked: Mutex::new(None),
            };
            let content = Content::Streamed(Box::new(streamed));
            return Self::new(path, content, stamp.len, Vec::new(), budget);
        }
        let notes = if is_whole {
            source.into_notes()
        } else {
            let room = budget.for_content();
            if !source.is_packed() {
                let fits = room.check(stamp.len, "the file is");
                fits.map_err(|e| e.in_file(path))?;
            }
            // A guess for packed files; more is no harm, since pages that are not used cost nothing.
            let len = unpacked_len(path).unwrap_or(stamp.len).min(room.bytes());
            let more = usize::try_from(len).unwrap_or(usize::MAX);
            let _ = bytes.try_reserve_exact(more.saturating_sub(bytes.len()).saturating_add(1));
            source.finish(&mut bytes, room).map_err(in_file)?
        };
        stamp.check(path)?;
        Self::new(path, Content::Plain(bytes), stamp.len, notes, budget)
    }

    /// Understands `bytes` as the content of a file at `path`, which is not touched.
    ///
    /// # Errors
    /// As [`Self::open`], less the reading.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, FrameError> {
        Self::from_bytes_within(path, bytes, MemoryBudget::UNLIMITED)
    }

    /// [`Self::from_bytes`] if it can be unpacked and read within `budget`.
    ///
    /// # Errors
    /// As [`Self::open_within`], less the reading.
    pub fn from_bytes_within(
        path: &Path,
        bytes: Vec<u8>,
        budget: MemoryBudget,
    ) -> Result<Self, FrameError> {
        let stored_len = bytes.len() as u64;
        let in_file = |e: SourceError| e.in_file(path);
        let mut notes = Vec::new();
        let bytes = if is_gzip(&bytes) {
            let mut unpacked = Vec::new();
            let source = Unpacker::new(Cursor::new(bytes)).map_err(SourceError::Io);
            let source = source.map_err(in_file)?;
            let left = source.finish(&mut unpacked, budget.for_content());
            notes.extend(left.map_err(in_file)?);
            unpacked
        } else {
            bytes
        };
        Self::new(path, Content::Plain(bytes), stored_len, notes, budget)
    }

    fn new(
        path: &Path,
        content: Content,
        stored_len: u64,
        notes: Vec<String>,
        budget: MemoryBudget,
    ) -> Result<Self, FrameError> {
        let in_file = |e: ParseError| e.in_file(path);
        let format = Format::detect(content.bytes(), path).map_err(in_file)?;
        let left = budget.less(content.held_len(format));
        let steps = match &content {
            Content::Streamed(streamed) => streamed.steps(path, format, left)?,
            held => {
                let mut text = TextInput::whole(held.bytes());
                format.steps_within(&mut text, left).map_err(in_file)?
            }
        };
        Ok(Self {
            path: path.to_owned(),
            format,
            steps,
            content,
            stored_len,
            notes,
            budget,
        })
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Which format it is.
    pub const fn format(&self) -> Format {
        self.format
    }

    /// The time steps inside; may be none.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The uncompressed content; of a large text its beginning.
    pub fn bytes(&self) -> &[u8] {
        self.content.bytes()
    }

    /// Bytes on disk, compressed if it was.
    pub const fn stored_len(&self) -> u64 {
        self.stored_len
    }

    /// Bytes of the uncompressed content. Of a packed text a guess until it was read to its end.
    pub fn unpacked_len(&self) -> u64 {
        match &self.content {
            Content::Streamed(streamed) => match streamed.end.get() {
                Some((len, _)) => *len,
                None if !streamed.is_packed => streamed.stamp.len,
                None => unpacked_len(&self.path).unwrap_or(self.stored_len),
            },
            held => held.bytes().len() as u64,
        }
    }

    /// Bytes that are held beside the numbers while these are read.
    pub fn held_len(&self) -> u64 {
        self.content.held_len(self.format)
    }

    /// Bytes that are held on the way from the content to the numbers of `particles`: of arrays that are packed,
    /// or text in XML, in the content.
    pub fn unpacked_arrays_len(&self, particles: &RawParticles) -> u64 {
        let has = |text: &[u8]| memmem::find(self.bytes(), text).is_some();
        let is_packed = match self.format {
            Format::Npz => (self.bytes().len() as u64) < particles.byte_len(),
            Format::VtkXml => has(b"compressor=") || !has(b"encoding=\"raw\""),
            _ => false,
        };
        let arrays = particles.attributes.iter().map(|a| a.data.byte_len());
        let all = arrays.chain([particles.positions.byte_len()]);
        all.max().filter(|_| is_packed).unwrap_or(0)
    }

    /// Oddities that did not stop the file from being understood; those at the end of a large text once it
    /// was read.
    pub fn notes(&self) -> &[String] {
        match &self.content {
            Content::Streamed(streamed) => streamed.end.get().map_or(&[], |(_, notes)| notes),
            Content::Plain(_) | Content::Aligned(_) => &self.notes,
        }
    }

    /// Reads step `index` of [`Self::steps`].
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if there is no such step or its bytes are damaged,
    /// [`FrameError::Unsupported`] for a variant of the format that is not read,
    /// [`FrameError::TooLarge`] if its numbers need more memory than is allowed.
    pub fn read(&self, index: usize) -> Result<RawParticles, FrameError> {
        let step = self.steps.get(index).ok_or_else(|| {
            let what = format!(
                "step {index} was asked for, the file holds {}",
                self.steps.len()
            );
            ParseError::malformed(self.bytes().len(), what).in_file(&self.path)
        })?;
        let left = self.budget.less(self.held_len());
        if let Content::Streamed(streamed) = &self.content {
            return streamed.read(&self.path, self.format, (step, self.steps.len()), left);
        }
        let mut text = TextInput::whole(self.bytes());
        let particles = self.format.read_within(&mut text, step, left);
        let fits = particles.and_then(|particles| {
            left.check(particles.byte_len(), "in memory its numbers are")?;
            Ok(particles)
        });
        fits.map_err(|e| e.in_file(&self.path))
    }
}

impl Streamed {
    /// The time steps of the file at `path`.
    fn steps(
        &self,
        path: &Path,
        format: Format,
        budget: MemoryBudget,
    ) -> Result<Vec<Step>, FrameError> {
        let mut text = self.text(path, budget)?;
        let steps = format.steps_within(&mut text, budget);
        self.outcome(path, &mut text, steps)
    }

    /// Reads one of so many steps of the file at `path`.
    fn read(
        &self,
        path: &Path,
        format: Format,
        (step, steps): (&Step, usize),
        budget: MemoryBudget,
    ) -> Result<RawParticles, FrameError> {
        self.stamp.check(path)?;
        let parked = || self.parked.lock().unwrap_or_else(PoisonError::into_inner);
        let last = parked().take();
        let mut text = match last.filter(|text| text.can_reach(step.span.start)) {
            Some(text) => text,
            None => self.text(path, budget)?,
        };
        let particles = format.read_within(&mut text, step, budget);
        // Only the end of a packed file tells whether all of it is sound.
        if self.is_packed && self.end.get().is_none() && particles.is_ok() {
            text.finish();
        }
        let particles = self.outcome(path, &mut text, particles)?;
        if steps > 1 {
            text.end_at(usize::MAX);
            *parked() = Some(text);
        }
        Ok(particles)
    }

    /// The file at `path` from its beginning.
    fn text(&self, path: &Path, budget: MemoryBudget) -> Result<TextInput<'static>, FrameError> {
        let source = Box::new(unpacker(path)?);
        let about = unpacked_len(path).unwrap_or(self.stamp.len);
        let about = usize::try_from(about).unwrap_or(usize::MAX);
        let len = match self.end.get() {
            Some((len, _)) => usize::try_from(*len).ok(),
            None => (!self.is_packed).then_some(about),
        };
        let head = Arc::clone(&self.head);
        let lens = (len, len.unwrap_or(about));
        Ok(TextInput::stream(source, head, lens, budget))
    }

    /// What reading `text` gave, unless something else explains it.
    fn outcome<T>(
        &self,
        path: &Path,
        text: &mut TextInput<'_>,
        read: Result<T, ParseError>,
    ) -> Result<T, FrameError> {
        if let Some((len, notes)) = text.ended() {
            let _ = self.end.set((len as u64, notes.to_vec()));
        }
        let source = text.check_source().map_err(|e| e.in_file(path));
        // What changed meanwhile explains any other fault.
        self.stamp.check(path)?;
        source?;
        read.map_err(|e| e.in_file(path))
    }
}

/// Whether the file at `path`, which begins with `head` and goes on, is text that can be read in pieces.
fn is_streamed(head: &[u8], path: &Path) -> bool {
    Format::detect(head, path).is_ok_and(|format| format.is_streamed(head))
}

fn unpacker(path: &Path) -> Result<Unpacker<BufReader<File>>, FrameError> {
    let file = File::open(path).map(|file| BufReader::with_capacity(1 << 16, file));
    let source = file.and_then(Unpacker::new);
    source.map_err(|e| FrameError::io(path, e))
}

impl Stamp {
    /// Of the regular file at `path`.
    fn of(path: &Path) -> Result<Self, FrameError> {
        let len = regular_len(path)?;
        let meta = fs::metadata(path).map_err(|e| FrameError::io(path, e))?;
        Ok(Self {
            len,
            modified: meta.modified().ok(),
        })
    }

    /// That the file is still what it was.
    fn check(self, path: &Path) -> Result<(), FrameError> {
        self.check_same(Self::of(path)?)
            .map_err(|e| FrameError::io(path, e))
    }

    fn check_same(self, now: Self) -> io::Result<()> {
        if self == now {
            return Ok(());
        }
        let what = if self.len == now.len {
            "the file was written to while it was read".to_owned()
        } else {
            let (before, after) = (self.len, now.len);
            format!("the size went from {before} to {after} bytes while it was read")
        };
        Err(io::Error::other(format!(
            "{what}; it is still being written, try again later"
        )))
    }
}

/// Whether the file at `path` begins as a native frame, not packed by gzip.
///
/// # Errors
/// The file cannot be read, or is no regular file.
pub fn is_native(path: &Path) -> Result<bool, FrameError> {
    regular_len(path)?;
    let mut start = [0; native::MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    match read {
        Ok(()) => Ok(start == *native::MAGIC),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(FrameError::io(path, e)),
    }
}

/// The format of the file at `path` by its first bytes, gzip or not: reads a few KiB at most.
///
/// # Errors
/// As [`FrameFile::open`], as far as the first bytes tell.
pub fn detect_file(path: &Path) -> Result<Format, FrameError> {
    let head = head(path)?;
    Format::detect(&head, path).map_err(|e| e.in_file(path))
}

/// What the head of the file at `path` says that is not in its particles: a cell and periodic boundaries, which are
/// not used, and the names behind numbers. Nothing for a file that is not read.
pub fn remarks(path: &Path) -> Vec<String> {
    let Ok(head) = head(path) else {
        return Vec::new();
    };
    let format = Format::detect(&head, path);
    let remarks = format.map(|format| remarks::remarks(format, &head));
    remarks
        .unwrap_or_default()
        .into_iter()
        .map(one_line)
        .collect()
}

/// The first bytes of the file at `path`, gzip taken off.
pub(crate) fn head(path: &Path) -> Result<Vec<u8>, FrameError> {
    let io = |e| FrameError::io(path, e);
    regular_len(path)?;
    let mut stored = Vec::new();
    File::open(path)
        .and_then(|f| f.take(4 * HEAD_LEN as u64).read_to_end(&mut stored))
        .map_err(io)?;
    if !is_gzip(&stored) {
        return Ok(stored);
    }
    let mut head = Vec::new();
    // The end is cut off on purpose, so an early end is no fault here.
    let _ = GzDecoder::new(stored.as_slice())
        .take(HEAD_LEN as u64)
        .read_to_end(&mut head);
    Ok(head)
}

/// Length of a regular file: reading a pipe or a device could take forever.
pub(crate) fn regular_len(path: &Path) -> Result<u64, FrameError> {
    let meta = fs::metadata(path).map_err(|e| FrameError::io(path, e))?;
    if meta.is_file() {
        return Ok(meta.len());
    }
    let what = if meta.is_dir() {
        "a directory, where a file of particles was expected"
    } else {
        "no regular file; copy it to one first"
    };
    Err(ParseError::unsupported(what).in_file(path))
}

/// Bytes of the file at `path` once unpacked, by the last four bytes of a gzip file (RFC 1952), without
/// reading the rest. A guess where those lie: with several members, or beyond 4 GiB.
///
/// # Errors
/// The file cannot be read.
pub fn unpacked_len(path: &Path) -> io::Result<u64> {
    // Opening a pipe would wait for a writer.
    if !fs::metadata(path)?.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let mut file = File::open(path)?;
    let len = file.metadata()?.len();
    let mut start = [0; 4];
    let mut end = [0; 4];
    if len < 18 {
        return Ok(len);
    }
    file.read_exact(&mut start)?;
    if !is_gzip(&start) {
        return Ok(len);
    }
    file.seek(io::SeekFrom::End(-4))?;
    file.read_exact(&mut end)?;
    Ok(u64::from(u32::from_le_bytes(end)).max(len))
}

/// Magic, deflate, no reserved flags: four bytes, so that raw floats do not look like it.
pub(crate) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b, 8]) && bytes.get(3).is_none_or(|flags| flags & 0xe0 == 0)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

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
        assert!(
            error.starts_with("a.bgeo: ") && error.contains(words),
            "{error}"
        );
    }

    #[test]
    fn gzip_members_are_joined() {
        let packed = [gz(&TEXT[..9]), gz(&TEXT[9..])].concat();
        let file = open(packed.clone()).expect("two members");
        assert_eq!(file.bytes(), TEXT);
        assert_eq!(file.format(), Format::Lammps);
        assert_eq!(file.stored_len(), packed.len() as u64);
        assert!(file.notes().is_empty());
    }

    #[test]
    fn bytes_after_the_stream_are_told() {
        let zeros = open([gz(TEXT), vec![0; 512]].concat()).expect("padding");
        assert!(zeros.bytes() == TEXT && zeros.notes().is_empty());
        let other = open([gz(TEXT), b"junk".to_vec()].concat()).expect("ignored");
        assert!(other.bytes() == TEXT && other.notes().len() == 1);
    }

    #[test]
    #[cfg_attr(miri, ignore = "unpacks too often for an interpreter")]
    fn every_truncation_of_gzip_is_noticed() {
        let packed = [gz(&TEXT[..9]), gz(&TEXT[9..])].concat();
        let first = gz(&TEXT[..9]).len();
        for len in (3..packed.len()).filter(|l| *l != first) {
            fails(packed[..len].to_vec(), "still being written");
        }
    }

    #[test]
    fn damaged_gzip_is_noticed() {
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
        assert!(matches!(
            FrameFile::open(&missing),
            Err(FrameError::Io { .. })
        ));
        let path = dir.path().join("dump.7");
        fs::write(&path, gz(TEXT)).expect("writable");
        assert_eq!(detect_file(&path).expect("known"), Format::Lammps);
        assert_eq!(FrameFile::open(&path).expect("known").bytes(), TEXT);
    }

    #[test]
    fn a_growing_file_is_noticed() {
        let stamp = |len, seconds| Stamp {
            len,
            modified: Some(SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(seconds)),
        };
        assert!(stamp(7, 1).check_same(stamp(7, 1)).is_ok());
        for now in [stamp(8, 1), stamp(6, 2), stamp(7, 2)] {
            let error = stamp(7, 1).check_same(now).expect_err("changed");
            assert!(error.to_string().contains("still being written"));
        }
    }
}
