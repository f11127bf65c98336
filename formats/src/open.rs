//! Opens one file of particles: reads it, takes gzip off, finds the format and the steps inside.
//!
//! The only place that reads foreign files; the readers see bytes. A file that changes while it is
//! read is told as such, because a simulation that is still running is the usual cause.

use std::fs::{self, File};
use std::io::{self, Read, Seek};
use std::path::{Path, PathBuf};

use flate2::bufread::GzDecoder;
use rkyv::util::AlignedVec;

use crate::detect::{Format, HEAD_LEN};
use crate::message::one_line;
use crate::native;
use crate::read::{Step, remarks};
use crate::{FrameError, ParseError, RawParticles};

/// A file in memory, ready to give its steps.
#[derive(Debug)]
pub struct FrameFile {
    path: PathBuf,
    content: Content,
    format: Format,
    steps: Vec<Step>,
    stored_len: u64,
    notes: Vec<String>,
}

/// Where the bytes of a file are.
#[derive(Debug)]
enum Content {
    Plain(Vec<u8>),
    /// Native frames: their sections are used as they lie.
    Aligned(AlignedVec<64>),
}

impl Content {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Plain(bytes) => bytes,
            Self::Aligned(bytes) => bytes,
        }
    }
}

impl FrameFile {
    /// Reads and understands the file at `path`, whatever its name.
    ///
    /// # Errors
    /// [`FrameError::Io`] if it cannot be read or changed size meanwhile,
    /// [`FrameError::Unsupported`] for a known format that is not read (or no regular file), and
    /// [`FrameError::Malformed`] for everything that breaks its own format.
    pub fn open(path: &Path) -> Result<Self, FrameError> {
        if is_native(path)? {
            let bytes = native::read_aligned(path)?;
            let stored_len = bytes.len() as u64;
            return Self::new(path, Content::Aligned(bytes), stored_len, Vec::new());
        }
        Self::from_bytes(path, read_stable(path)?)
    }

    /// Understands `bytes` as the content of a file at `path`, which is not touched.
    ///
    /// # Errors
    /// As [`Self::open`], less the reading.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, FrameError> {
        let stored_len = bytes.len() as u64;
        let in_file = |e: ParseError| e.in_file(path);
        let mut notes = Vec::new();
        let bytes = if is_gzip(&bytes) {
            gunzip(&bytes, &mut notes).map_err(in_file)?
        } else {
            bytes
        };
        Self::new(path, Content::Plain(bytes), stored_len, notes)
    }

    fn new(
        path: &Path,
        content: Content,
        stored_len: u64,
        notes: Vec<String>,
    ) -> Result<Self, FrameError> {
        let in_file = |e: ParseError| e.in_file(path);
        let format = Format::detect(content.bytes(), path).map_err(in_file)?;
        let steps = format.steps(content.bytes()).map_err(in_file)?;
        Ok(Self {
            path: path.to_owned(),
            content,
            format,
            steps,
            stored_len,
            notes,
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

    /// The uncompressed content.
    pub fn bytes(&self) -> &[u8] {
        self.content.bytes()
    }

    /// Bytes on disk, compressed if it was.
    pub const fn stored_len(&self) -> u64 {
        self.stored_len
    }

    /// Oddities that did not stop the file from being understood.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Reads step `index` of [`Self::steps`].
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if there is no such step or its bytes are damaged,
    /// [`FrameError::Unsupported`] for a variant of the format that is not read.
    pub fn read(&self, index: usize) -> Result<RawParticles, FrameError> {
        let step = self.steps.get(index).ok_or_else(|| {
            let what = format!(
                "step {index} was asked for, the file holds {}",
                self.steps.len()
            );
            ParseError::malformed(self.bytes().len(), what).in_file(&self.path)
        })?;
        self.format
            .read(self.bytes(), step)
            .map_err(|e| e.in_file(&self.path))
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

/// The whole file, if it did not change size while it was read.
fn read_stable(path: &Path) -> Result<Vec<u8>, FrameError> {
    let before = regular_len(path)?;
    let bytes = fs::read(path).map_err(|e| FrameError::io(path, e))?;
    let after = regular_len(path)?;
    check_stable(before, bytes.len() as u64, after).map_err(|e| FrameError::io(path, e))?;
    Ok(bytes)
}

fn check_stable(before: u64, read: u64, after: u64) -> io::Result<()> {
    if before == read && read == after {
        return Ok(());
    }
    Err(io::Error::other(format!(
        "the size went from {before} to {after} bytes while {read} were read; \
         it is still being written, try again later"
    )))
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

/// Unpacks all members of a gzip file. Zeros after the last one are padding; anything else there
/// is ignored with a note, as `gzip -d` does.
fn gunzip(mut packed: &[u8], notes: &mut Vec<String>) -> Result<Vec<u8>, ParseError> {
    let mut bytes = Vec::new();
    loop {
        let mut decoder = GzDecoder::new(packed);
        decoder.read_to_end(&mut bytes).map_err(|e| {
            let at = bytes.len();
            match e.kind() {
                io::ErrorKind::UnexpectedEof => ParseError::malformed(
                    at,
                    "the gzip stream breaks off here; perhaps it is still being written",
                ),
                io::ErrorKind::OutOfMemory => {
                    ParseError::malformed(at, "no memory left to unpack the gzip stream")
                }
                _ => ParseError::malformed(at, format!("the gzip stream is damaged: {e}")),
            }
        })?;
        let rest = decoder.into_inner();
        if rest.iter().all(|b| *b == 0) {
            return Ok(bytes);
        }
        if rest[0] != 0x1f || rest.get(1).is_some_and(|b| *b != 0x8b) {
            notes.push(format!(
                "{} bytes after the gzip stream are ignored",
                rest.len()
            ));
            return Ok(bytes);
        }
        packed = rest;
    }
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
        assert!(check_stable(7, 7, 7).is_ok());
        for (before, read, after) in [(7, 8, 8), (7, 7, 8), (8, 7, 7)] {
            let error = check_stable(before, read, after).expect_err("changed");
            assert!(error.to_string().contains("still being written"));
        }
    }
}
