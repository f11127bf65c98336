//! Looks at the first bytes of a file: its format and notes, without reading the rest.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::siblings::SiblingFiles;
use crate::native::{self, MappedFile};
use crate::{FrameError, MemoryBudget};
use spherule_files::one_line;
use spherule_readers::compression::{ByteStream, StreamError, is_compressed};
use spherule_readers::regular::regular_len;
use spherule_readers::shared::SharedBytes;
use spherule_readers::{Format, decompressor};
use spherule_readers::{HEAD_LEN, Reader, ValueNames};

/// Whether the file at `path` begins as a native frame, without compression around it.
///
/// # Errors
/// [`FrameError`] if the file cannot be read, or is not a regular file.
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

/// The format of the file at `path` by its first bytes, compressed or not. Reads a few KiB, or one block of
/// bzip2 or LZ4.
///
/// # Errors
/// As [`super::FrameFile::open`], as far as the first bytes decide.
pub fn detect_file(path: &Path) -> Result<Format, FrameError> {
    let head = head(path)?;
    crate::detect::detect_format(&head, path).map_err(|e| e.in_file(path))
}

/// What the file at `path` holds that is not in its particles: a cell and periodic boundaries, which are not used, and
/// the names behind numbers. Looks at the first bytes unless the format needs more. Empty for a file that cannot be
/// read.
pub fn notes(path: &Path) -> Vec<String> {
    let notes = head(path)
        .and_then(|head| {
            let format = crate::detect::detect_format(&head, path).map_err(|e| e.in_file(path))?;
            let reader = format.reader();
            if !reader.info().notes_need_whole_file {
                return Ok(reader.notes(&head));
            }
            // Some notes need the whole file, which is mapped unless it is compressed
            let map = Arc::new(MappedFile::open(path)?);
            if is_compressed(map.bytes()) {
                return Ok(reader.notes(&head));
            }
            let siblings = SiblingFiles::of(path);
            let found = reader.notes_of_file(&siblings.around(SharedBytes::new(map.clone())));
            map.check()?;
            siblings.check()?;
            Ok(found)
        })
        .unwrap_or_default()
        .into_iter();
    notes.map(one_line).collect()
}

/// The names behind the numbers of attributes in the file at `path`. Empty for a file that cannot be read, and of a
/// compressed one, whose names are those of its first bytes.
pub fn value_names(path: &Path) -> Vec<ValueNames> {
    let names = || {
        let map = Arc::new(MappedFile::open(path).ok()?);
        let bytes: Arc<dyn AsRef<[u8]> + Send + Sync> =
            if is_compressed(map.bytes()) { Arc::new(head(path).ok()?) } else { map.clone() };
        let format = crate::detect::detect_format((*bytes).as_ref(), path).ok()?;
        let names = format.reader().value_names(&SharedBytes::new(bytes));
        map.check().ok()?;
        Some(names)
    };
    names().unwrap_or_default()
}

/// Number of files that the step in the file at `path` is divided among, as the file states; 1 if it does not.
pub(crate) fn piece_count(path: &Path) -> u64 {
    with_reader(path, |reader, file| reader.piece_count(file)).unwrap_or(1)
}

/// Whether the file at `path` only refers to the files that its step is divided among.
pub(crate) fn refers_to_pieces(path: &Path) -> bool {
    with_reader(path, |reader, file| reader.refers_to_pieces(file)).unwrap_or(false)
}

/// The files that the one at `path` refers to, in its directory or below it, if they exist; empty unless its name is that
/// of a format whose files may do so.
pub(crate) fn referenced_files(path: &Path) -> Vec<PathBuf> {
    let may_refer = |format: Format| format.reader().info().may_refer_to_files;
    if !crate::registry::by_name(path).is_some_and(may_refer) {
        return Vec::new();
    }
    let siblings = SiblingFiles::of(path);
    with_reader_among(path, &siblings, |reader, file| reader.open_referenced(file));
    siblings.paths()
}

/// What the reader of the file at `path` says of it; None if the file cannot be opened, or has no known format.
fn with_reader<T>(path: &Path, ask: impl FnOnce(&dyn Reader, &SharedBytes) -> T) -> Option<T> {
    with_reader_among(path, &SiblingFiles::of(path), ask)
}

fn with_reader_among<T>(
    path: &Path,
    siblings: &SiblingFiles,
    ask: impl FnOnce(&dyn Reader, &SharedBytes) -> T,
) -> Option<T> {
    let map = Arc::new(MappedFile::open(path).ok()?);
    let format = crate::detect::detect_format(map.bytes(), path).ok()?;
    let file = siblings.around(SharedBytes::new(map));
    Some(ask(format.reader(), &file))
}

/// The first bytes of the file at `path`, decompressed. Damage that comes later, or that lets some bytes pass, is no
/// error here.
pub(crate) fn head(path: &Path) -> Result<Vec<u8>, FrameError> {
    regular_len(path)?;
    let mut stream = decompressor(path, MemoryBudget::UNLIMITED)?;
    let most = if stream.is_compressed() { HEAD_LEN } else { 4 * HEAD_LEN };
    let mut head = Vec::new();
    match stream.fill(&mut head, most) {
        Err(StreamError::Io(error)) => Err(FrameError::io(path, error)),
        Ok(_) | Err(StreamError::Bytes(_)) => Ok(head),
    }
}
