//! The sections of a frame that is being written. A separate thread writes and checksums them, so that the
//! encoder waits neither for copies nor for the disk unless too many pieces are pending.

use std::fmt;
use std::io::{self, Seek, SeekFrom, Write};
use std::panic;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use bytemuck::Pod;
use spherule_files::Publisher;
use xxhash_rust::xxh3::Xxh3;

use super::layout::{ALIGN, Section};

/// Largest number of pieces that wait to be written.
const WAITING: usize = 4;

/// Bytes to append to a section.
pub(super) type Piece = Box<dyn AsRef<[u8]> + Send>;

/// Wraps plain numbers as a piece.
pub(super) fn piece<T: Pod + Send>(numbers: Vec<T>) -> Piece {
    struct Numbers<T>(Vec<T>);
    impl<T: Pod> AsRef<[u8]> for Numbers<T> {
        fn as_ref(&self) -> &[u8] {
            bytemuck::cast_slice(&self.0)
        }
    }
    Box::new(Numbers(numbers))
}

/// Assigns offsets to sections, one after the other.
pub(super) struct SectionOffsets {
    /// Offset of the next section.
    pub(super) next: u64,
}

impl SectionOffsets {
    /// A section of `len` bytes; `None` if its end exceeds 64 bits.
    pub(super) fn section(&mut self, len: u64) -> Option<SectionProgress> {
        let offset = self.next;
        self.next = offset.checked_add(len)?.checked_next_multiple_of(ALIGN)?;
        Some(SectionProgress { offset, filled: 0, hash: Xxh3::new() })
    }
}

/// A section that is being written.
pub(super) struct SectionProgress {
    offset: u64,
    filled: u64,
    hash: Xxh3,
}

impl fmt::Debug for SectionProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes at {}", self.filled, self.offset)
    }
}

impl SectionProgress {
    fn append(&mut self, file: &mut Publisher, bytes: &[u8]) -> io::Result<()> {
        file.seek(SeekFrom::Start(self.offset + self.filled))?;
        file.write_all(bytes)?;
        self.filled += bytes.len() as u64;
        self.hash.update(bytes);
        Ok(())
    }

    /// The place and the checksum of the bytes written so far.
    pub(super) fn done(&self) -> Section {
        Section { offset: self.offset, len: self.filled, xxh3: self.hash.digest() }
    }
}

/// Writes sections to a file on a separate thread.
#[derive(Debug)]
pub(super) struct SectionWriter {
    /// `None` once the thread has ended.
    at_work: Option<WriterThread>,
}

#[derive(Debug)]
struct WriterThread {
    pieces: SyncSender<(usize, Piece)>,
    thread: JoinHandle<io::Result<WrittenSections>>,
}

/// The result of the thread.
#[derive(Debug)]
pub(super) struct WrittenSections {
    /// The file, which is not published yet.
    pub(super) file: Publisher,
    /// The sections, in the order in which they were passed to [`SectionWriter::begin`].
    pub(super) sections: Vec<SectionProgress>,
}

impl SectionWriter {
    /// Starts to write `sections` of `file`.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub(super) fn begin(file: Publisher, sections: Vec<SectionProgress>) -> io::Result<Self> {
        let (pieces, to_write) = sync_channel(WAITING);
        let filled = WrittenSections { file, sections };
        let thread = thread::Builder::new()
            .name("spherule-write".to_owned())
            .spawn(move || fill(filled, &to_write))?;
        let at_work = WriterThread { pieces, thread };
        Ok(Self { at_work: Some(at_work) })
    }

    /// Appends `piece` to section number `section`.
    ///
    /// # Errors
    /// The system's error if this piece or an earlier one cannot be written.
    pub(super) fn append(&mut self, section: usize, piece: Piece) -> io::Result<()> {
        let at_work = self.at_work.as_ref();
        if at_work.is_some_and(|w| w.pieces.send((section, piece)).is_ok()) {
            return Ok(());
        }
        // The thread only ends early because of an error.
        self.end()?;
        Err(io::Error::other("an earlier part could not be written"))
    }

    /// Waits until all pieces are written.
    ///
    /// # Errors
    /// The system's error if a piece cannot be written.
    pub(super) fn finish(mut self) -> io::Result<WrittenSections> {
        self.end()?.ok_or_else(|| io::Error::other("an earlier part could not be written"))
    }

    fn end(&mut self) -> io::Result<Option<WrittenSections>> {
        let Some(WriterThread { pieces, thread }) = self.at_work.take() else {
            return Ok(None);
        };
        drop(pieces);
        let ended = thread.join();
        ended.unwrap_or_else(|fault| panic::resume_unwind(fault)).map(Some)
    }
}

impl Drop for SectionWriter {
    /// The file is removed when this returns.
    fn drop(&mut self) {
        if let Some(WriterThread { pieces, thread }) = self.at_work.take() {
            drop(pieces);
            // Errors of a discarded file are not reported.
            let _ = thread.join();
        }
    }
}

fn fill(
    mut filled: WrittenSections,
    pieces: &Receiver<(usize, Piece)>,
) -> io::Result<WrittenSections> {
    for (section, piece) in pieces {
        filled.sections[section].append(&mut filled.file, (*piece).as_ref())?;
    }
    Ok(filled)
}
