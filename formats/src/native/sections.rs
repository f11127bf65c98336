//! The sections of a frame that is being written: filled and summed by a thread of its own, so that what
//! makes the bytes never waits for them to be copied or for the disk, but for a few pieces at most.

use std::fmt;
use std::io;
use std::panic;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use bytemuck::Pod;
use xxhash_rust::xxh3::Xxh3;

use super::layout::{ALIGN, Section};
use crate::write::atomic::Unpublished;

/// Pieces that may wait to be written.
const WAITING: usize = 4;

/// Bytes that go to the end of a section.
pub(super) type Piece = Box<dyn AsRef<[u8]> + Send>;

/// Plain numbers as a piece.
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
    /// Where the next one begins.
    pub(super) next: u64,
}

impl SectionOffsets {
    /// A section of `len` bytes; none if that is beyond 64 bits.
    pub(super) fn section(&mut self, len: u64) -> Option<SectionProgress> {
        let offset = self.next;
        self.next = offset.checked_add(len)?.checked_next_multiple_of(ALIGN)?;
        Some(SectionProgress {
            offset,
            filled: 0,
            hash: Xxh3::new(),
        })
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
    fn append(&mut self, file: &Unpublished, bytes: &[u8]) -> io::Result<()> {
        file.write_all_at(bytes, self.offset + self.filled)?;
        self.filled += bytes.len() as u64;
        self.hash.update(bytes);
        Ok(())
    }

    /// Where it is, what it holds now.
    pub(super) fn done(&self) -> Section {
        Section {
            offset: self.offset,
            len: self.filled,
            xxh3: self.hash.digest(),
        }
    }
}

/// Writes sections to a file on a thread of its own.
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
    /// The file, not yet published.
    pub(super) file: Unpublished,
    /// Its sections in the order they were given.
    pub(super) sections: Vec<SectionProgress>,
}

impl SectionWriter {
    /// Begins to fill `sections` of `file`.
    ///
    /// # Errors
    /// If no thread can be started.
    pub(super) fn begin(file: Unpublished, sections: Vec<SectionProgress>) -> io::Result<Self> {
        let (pieces, to_write) = sync_channel(WAITING);
        let filled = WrittenSections { file, sections };
        let thread = thread::Builder::new()
            .name("spherule-write".to_owned())
            .spawn(move || fill(filled, &to_write))?;
        let at_work = WriterThread { pieces, thread };
        Ok(Self {
            at_work: Some(at_work),
        })
    }

    /// Appends `piece` to section number `section`.
    ///
    /// # Errors
    /// The system's reason why this or an earlier piece cannot be written.
    pub(super) fn append(&mut self, section: usize, piece: Piece) -> io::Result<()> {
        let at_work = self.at_work.as_ref();
        if at_work.is_some_and(|w| w.pieces.send((section, piece)).is_ok()) {
            return Ok(());
        }
        // The thread ends early only for a reason.
        self.end()?;
        Err(io::Error::other("an earlier part could not be written"))
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// The system's reason why something cannot be written.
    pub(super) fn finish(mut self) -> io::Result<WrittenSections> {
        self.end()?
            .ok_or_else(|| io::Error::other("an earlier part could not be written"))
    }

    fn end(&mut self) -> io::Result<Option<WrittenSections>> {
        let Some(WriterThread { pieces, thread }) = self.at_work.take() else {
            return Ok(None);
        };
        drop(pieces);
        let ended = thread.join();
        ended
            .unwrap_or_else(|fault| panic::resume_unwind(fault))
            .map(Some)
    }
}

impl Drop for SectionWriter {
    /// The file is gone when this returns.
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
        filled.sections[section].append(&filled.file, (*piece).as_ref())?;
    }
    Ok(filled)
}
