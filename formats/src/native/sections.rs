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

/// Gives sections their places, one after the other.
pub(super) struct Places {
    /// Where the next one begins.
    pub(super) next: u64,
}

impl Places {
    /// A section of `len` bytes; none if that is beyond 64 bits.
    pub(super) fn section(&mut self, len: u64) -> Option<Filling> {
        let offset = self.next;
        self.next = offset.checked_add(len)?.checked_next_multiple_of(ALIGN)?;
        Some(Filling {
            offset,
            filled: 0,
            hash: Xxh3::new(),
        })
    }
}

/// A section that is being filled.
pub(super) struct Filling {
    offset: u64,
    filled: u64,
    hash: Xxh3,
}

impl fmt::Debug for Filling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes at {}", self.filled, self.offset)
    }
}

impl Filling {
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

/// A file and its sections, in the hands of the thread that fills them.
#[derive(Debug)]
pub(super) struct Sections {
    /// `None` once the thread has ended.
    at_work: Option<AtWork>,
}

#[derive(Debug)]
struct AtWork {
    pieces: SyncSender<(usize, Piece)>,
    thread: JoinHandle<io::Result<Filled>>,
}

/// What the thread hands back.
#[derive(Debug)]
pub(super) struct Filled {
    /// The file, not yet published.
    pub(super) file: Unpublished,
    /// Its sections in the order they were given.
    pub(super) sections: Vec<Filling>,
}

impl Sections {
    /// Begins to fill `sections` of `file`.
    ///
    /// # Errors
    /// If no thread can be started.
    pub(super) fn begin(file: Unpublished, sections: Vec<Filling>) -> io::Result<Self> {
        let (pieces, to_write) = sync_channel(WAITING);
        let filled = Filled { file, sections };
        let thread = thread::Builder::new()
            .name("spherule-write".to_owned())
            .spawn(move || fill(filled, &to_write))?;
        let at_work = AtWork { pieces, thread };
        Ok(Self {
            at_work: Some(at_work),
        })
    }

    /// Puts `piece` behind what section number `section` holds.
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
    pub(super) fn finish(mut self) -> io::Result<Filled> {
        self.end()?
            .ok_or_else(|| io::Error::other("an earlier part could not be written"))
    }

    fn end(&mut self) -> io::Result<Option<Filled>> {
        let Some(AtWork { pieces, thread }) = self.at_work.take() else {
            return Ok(None);
        };
        drop(pieces);
        let ended = thread.join();
        ended
            .unwrap_or_else(|fault| panic::resume_unwind(fault))
            .map(Some)
    }
}

impl Drop for Sections {
    /// The file is gone when this returns.
    fn drop(&mut self) {
        if let Some(AtWork { pieces, thread }) = self.at_work.take() {
            drop(pieces);
            // What became of a file that nobody wants is not told.
            let _ = thread.join();
        }
    }
}

fn fill(mut filled: Filled, pieces: &Receiver<(usize, Piece)>) -> io::Result<Filled> {
    for (section, piece) in pieces {
        filled.sections[section].append(&filled.file, (*piece).as_ref())?;
    }
    Ok(filled)
}
