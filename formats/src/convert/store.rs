//! Stores records in chunks of equal size, in memory while there is room and then in a scratch file.
//!
//! Chunks are allocated once and reused; a caller that needs a chunk waits until one is free. When memory is
//! full, a thread writes further full chunks to the scratch file. Room is reserved for the chunks that are
//! being filled (one for each part) and for some that are being written, so that no caller waits forever.

use std::panic;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};

use glam::Vec3;

use super::account::MemoryAccount;
use super::order::PartData;
use super::scratch::ScratchFile;
use crate::FrameError;

/// Largest number of chunks that wait to be written.
const ON_THE_WAY: usize = 8;

/// Records in memory, with one array for positions and one for rows.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub(super) positions: Vec<Vec3>,
    pub(super) rows: Vec<u8>,
}

/// Stored records.
#[derive(Debug)]
pub(super) enum StoredChunk {
    Here(Chunk),
    /// Records in a slot of the scratch file.
    Away {
        slot: u64,
        len: usize,
    },
}

impl StoredChunk {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Here(chunk) => chunk.positions.len(),
            Self::Away { len, .. } => *len,
        }
    }
}

/// Sizes of a store.
#[derive(Debug, Clone)]
pub(super) struct StoreSettings {
    /// Records of a chunk.
    pub(super) chunk_len: usize,
    /// Bytes of a row.
    pub(super) width: usize,
    /// Chunks that may be in memory.
    pub(super) chunks: usize,
    /// Chunks that are filled at the same time.
    pub(super) open: usize,
    /// The directory of the scratch file.
    pub(super) dir: PathBuf,
}

/// Memory and scratch file for records.
#[derive(Debug)]
pub(super) struct ChunkStore<'a> {
    shared: Arc<SharedState>,
    account: &'a MemoryAccount,
    writer: Mutex<Option<Writer>>,
}

#[derive(Debug)]
struct SharedState {
    settings: StoreSettings,
    state: Mutex<ChunkState>,
    /// Signals that a chunk is free, or that an error occurred.
    freed: Condvar,
}

#[derive(Debug, Default)]
struct ChunkState {
    free: Vec<Chunk>,
    /// Allocated chunks.
    made: usize,
    /// Chunks that stay in memory.
    kept: usize,
    /// Chunks that wait to be written.
    leaving: usize,
    free_slots: Vec<u64>,
    slots: u64,
    spilled: u64,
    fault: Option<FrameError>,
}

#[derive(Debug)]
struct Writer {
    scratch: Arc<ScratchFile>,
    chunks: SyncSender<(Chunk, u64)>,
    thread: JoinHandle<()>,
}

impl<'a> ChunkStore<'a> {
    pub(super) fn new(mut settings: StoreSettings, account: &'a MemoryAccount) -> Self {
        // Allow few chunks, but enough that the writer can always proceed.
        settings.chunks = settings.chunks.max(settings.open + ON_THE_WAY + 2);
        let shared = SharedState { settings, state: Mutex::default(), freed: Condvar::new() };
        Self { shared: Arc::new(shared), account, writer: Mutex::new(None) }
    }

    pub(super) fn chunk_len(&self) -> usize {
        self.shared.settings.chunk_len
    }

    /// Bytes that were written to the scratch file.
    pub(super) fn spilled(&self) -> u64 {
        self.shared.state().spilled
    }

    /// Returns an empty chunk; waits until one is free.
    ///
    /// # Errors
    /// If an earlier chunk could not be written.
    pub(super) fn take(&self) -> Result<Chunk, FrameError> {
        let settings = &self.shared.settings;
        let mut state = self.shared.state();
        loop {
            // Report an error of the writer thread
            if let Some(fault) = state.fault.take() {
                return Err(fault);
            }
            // Reuse a chunk
            if let Some(chunk) = state.free.pop() {
                return Ok(chunk);
            }
            // Allocate a chunk; with none being written, waiting would never end
            if state.made < settings.chunks || state.leaving == 0 {
                state.made += 1;
                drop(state);
                self.account.hold(settings.bytes());
                return Ok(Chunk {
                    positions: Vec::with_capacity(settings.chunk_len),
                    rows: Vec::with_capacity(settings.chunk_len * settings.width),
                });
            }
            // Wait for a chunk that is being written
            let freed = self.shared.freed.wait(state);
            state = freed.unwrap_or_else(|e| e.into_inner());
        }
    }

    /// Stores a chunk in memory or in the scratch file.
    ///
    /// # Errors
    /// If the scratch file cannot be created, or an earlier chunk could not be written.
    pub(super) fn put(&self, chunk: Chunk) -> Result<StoredChunk, FrameError> {
        let settings = &self.shared.settings;
        let mut state = self.shared.state();
        // Keep the chunk in memory if there is room
        let is_full = chunk.positions.len() == settings.chunk_len;
        if !is_full || state.kept + settings.open + ON_THE_WAY < settings.chunks {
            state.kept += 1;
            return Ok(StoredChunk::Here(chunk));
        }
        drop(state);
        // Start the writer before the chunk counts as waiting: if the start failed, other threads would wait
        // for it forever.
        let chunks = self.with_writer(|writer| writer.chunks.clone())?;
        // Choose a slot of the scratch file
        let mut state = self.shared.state();
        state.leaving += 1;
        state.spilled += settings.bytes();
        let slot = state.free_slots.pop().unwrap_or_else(|| {
            state.slots += 1;
            state.slots - 1
        });
        drop(state);
        // Send the chunk to the writer
        let len = chunk.positions.len();
        if chunks.send((chunk, slot)).is_err() {
            self.shared.left();
            return Err(self.lost());
        }
        Ok(StoredChunk::Away { slot, len })
    }

    /// Calls `visit` with the records of `held`, then frees them.
    ///
    /// # Errors
    /// If the records cannot be read.
    pub(super) fn give_back<T>(
        &self,
        held: StoredChunk,
        visit: impl FnOnce(&Chunk) -> T,
    ) -> Result<T, FrameError> {
        match held {
            StoredChunk::Here(chunk) => {
                // It is in memory: visit it there
                let result = visit(&chunk);
                self.shared.state().kept -= 1;
                self.shared.free(chunk);
                Ok(result)
            }
            StoredChunk::Away { slot, len } => {
                // It is on the disk: read it into a chunk that is free, and give its slot back
                let mut chunk = self.take()?;
                let read = self.read(&mut chunk, slot, len);
                let result = read.map(|()| visit(&chunk));
                self.shared.free(chunk);
                self.shared.state().free_slots.push(slot);
                result
            }
        }
    }

    /// Calls `visit` with the records of `held`, which stay stored.
    ///
    /// # Errors
    /// If the records cannot be read.
    pub(super) fn peek<T>(
        &self,
        held: &StoredChunk,
        visit: impl FnOnce(&Chunk) -> T,
    ) -> Result<T, FrameError> {
        match held {
            StoredChunk::Here(chunk) => Ok(visit(chunk)),
            StoredChunk::Away { slot, len } => {
                let mut chunk = self.take()?;
                let read = self.read(&mut chunk, *slot, *len);
                let result = read.map(|()| visit(&chunk));
                self.shared.free(chunk);
                result
            }
        }
    }

    /// Appends the records of `held` to those of `part`.
    ///
    /// # Errors
    /// If the records cannot be read.
    pub(super) fn load(&self, held: StoredChunk, part: &mut PartData) -> Result<(), FrameError> {
        self.give_back(held, |chunk| {
            part.positions.extend_from_slice(&chunk.positions);
            part.rows.extend_from_slice(&chunk.rows);
        })
    }

    /// Waits until all waiting chunks are on the disk.
    ///
    /// # Errors
    /// If a chunk could not be written.
    pub(super) fn settle(&self) -> Result<(), FrameError> {
        let mut state = self.shared.state();
        loop {
            if let Some(fault) = state.fault.take() {
                return Err(fault);
            }
            if state.leaving == 0 {
                return Ok(());
            }
            let freed = self.shared.freed.wait(state);
            state = freed.unwrap_or_else(|e| e.into_inner());
        }
    }

    fn read(&self, chunk: &mut Chunk, slot: u64, len: usize) -> Result<(), FrameError> {
        let settings = &self.shared.settings;
        let scratch = self.with_writer(|writer| Arc::clone(&writer.scratch))?;
        chunk.positions.resize(len, Vec3::ZERO);
        chunk.rows.resize(len * settings.width, 0);
        let at = slot * settings.bytes();
        let positions: &mut [u8] = bytemuck::cast_slice_mut(&mut chunk.positions);
        let rows_at = at + positions.len() as u64;
        scratch.read(positions, at)?;
        scratch.read(&mut chunk.rows, rows_at)
    }

    /// The scratch file and its writer thread, both created on first use.
    fn with_writer<T>(&self, ask: impl FnOnce(&Writer) -> T) -> Result<T, FrameError> {
        let mut guard = self.writer.lock().unwrap_or_else(|e| e.into_inner());
        let writer = match &mut *guard {
            Some(writer) => writer,
            none => none.insert(self.start()?),
        };
        Ok(ask(writer))
    }

    fn start(&self) -> Result<Writer, FrameError> {
        let dir = &self.shared.settings.dir;
        let scratch = Arc::new(ScratchFile::create(dir)?);
        let (chunks, to_write) = sync_channel(ON_THE_WAY);
        let (shared, file) = (Arc::clone(&self.shared), Arc::clone(&scratch));
        let thread = thread::Builder::new()
            .name("spherule-spill".to_owned())
            .spawn(move || shared.write_all(&file, &to_write))
            .map_err(|e| FrameError::io(dir, e))?;
        Ok(Writer { scratch, chunks, thread })
    }

    /// The error for a writer thread that stopped early.
    fn lost(&self) -> FrameError {
        let what =
            std::io::Error::other("an earlier part could not be written to the temporary file");
        FrameError::io(&self.shared.settings.dir, what)
    }
}

impl Drop for ChunkStore<'_> {
    /// The scratch file is deleted when this returns.
    fn drop(&mut self) {
        let writer = self.writer.get_mut().unwrap_or_else(|e| e.into_inner());
        if let Some(Writer { chunks, thread, .. }) = writer.take() {
            drop(chunks);
            if let Err(fault) = thread.join()
                && !thread::panicking()
            {
                panic::resume_unwind(fault);
            }
        }
    }
}

impl StoreSettings {
    /// Bytes of a chunk.
    fn bytes(&self) -> u64 {
        (self.chunk_len * (size_of::<Vec3>() + self.width)) as u64
    }
}

impl SharedState {
    fn state(&self) -> MutexGuard<'_, ChunkState> {
        self.state.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Makes `chunk` available for reuse.
    fn free(&self, mut chunk: Chunk) {
        chunk.positions.clear();
        chunk.rows.clear();
        self.state().free.push(chunk);
        self.freed.notify_all();
    }

    /// Counts a waiting chunk as written, and wakes the threads that wait for one.
    fn left(&self) {
        self.state().leaving -= 1;
        self.freed.notify_all();
    }

    /// Writes the chunks that it receives until the channel closes. After an error it only frees them.
    fn write_all(&self, scratch: &ScratchFile, chunks: &Receiver<(Chunk, u64)>) {
        let mut is_sound = true;
        for (chunk, slot) in chunks {
            if is_sound && let Err(fault) = self.write(scratch, &chunk, slot) {
                is_sound = false;
                self.state().fault = Some(fault);
            }
            self.free(chunk);
            self.left();
        }
    }

    fn write(&self, scratch: &ScratchFile, chunk: &Chunk, slot: u64) -> Result<(), FrameError> {
        let at = slot * self.settings.bytes();
        let positions: &[u8] = bytemuck::cast_slice(&chunk.positions);
        scratch.write(positions, at)?;
        scratch.write(&chunk.rows, at + positions.len() as u64)
    }
}
