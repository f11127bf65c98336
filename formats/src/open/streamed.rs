//! Text that is read from the disk in pieces, once for each step.

use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::read::{ByteSource, Step, TextInput};
use crate::{FrameError, MemoryBudget, ParseError, RawParticles};
use spherule_readers::compression::unpacked_len;
use spherule_readers::regular::FileStamp;
use spherule_readers::{Format, decompressor};

/// A text file that is not in memory.
#[derive(Debug)]
pub(super) struct StreamedFile {
    /// Its beginning, decompressed.
    head: Arc<[u8]>,
    /// Bytes that the decoder holds beside its output; `None` for a file that is not compressed.
    decoder_len: Option<u64>,
    /// The file when it was opened.
    stamp: FileStamp,
    /// Known once the file has been read to its end.
    end: OnceLock<StreamEnd>,
    /// The stream at the end of the step that was read last: the next step often begins there, and a compressed
    /// file can only be read from its beginning.
    parked: Mutex<Option<ByteSource<'static>>>,
    has_mesh_points: bool,
}

/// What only the end of a stream shows.
#[derive(Debug)]
struct StreamEnd {
    /// Bytes of the file, decompressed.
    len: u64,
    notes: Vec<String>,
}

impl StreamedFile {
    /// The file that had `stamp` and begins with `head`. `decoder_len` are the bytes that its decoder holds, if it is
    /// compressed.
    pub(super) fn new(head: Vec<u8>, decoder_len: Option<u64>, stamp: FileStamp) -> Self {
        Self {
            head: head.into(),
            decoder_len,
            stamp,
            end: OnceLock::new(),
            parked: Mutex::new(None),
            has_mesh_points: false,
        }
    }

    /// Says whether the vertices of a mesh are particles.
    pub(super) const fn set_mesh_points(&mut self, are_particles: bool) {
        self.has_mesh_points = are_particles;
    }

    pub(super) fn head(&self) -> &[u8] {
        &self.head
    }

    const fn is_compressed(&self) -> bool {
        self.decoder_len.is_some()
    }

    /// Bytes that the decoder holds beside its output.
    pub(super) fn decoder_len(&self) -> u64 {
        self.decoder_len.unwrap_or(0)
    }

    /// Bytes of the file, decompressed. An estimate for a compressed file that has not been read to its end.
    pub(super) fn unpacked_len(&self, path: &Path) -> u64 {
        match self.end.get() {
            Some(end) => end.len,
            None if !self.is_compressed() => self.stamp.len,
            None => unpacked_len(path).unwrap_or(self.stamp.len),
        }
    }

    /// Oddities of the compression; none before the file has been read to its end.
    pub(super) fn notes(&self) -> &[String] {
        self.end.get().map_or(&[], |end| &end.notes)
    }

    /// The time steps of the file at `path`.
    pub(super) fn steps(
        &self,
        path: &Path,
        format: Format,
        budget: MemoryBudget,
    ) -> Result<Vec<Step>, FrameError> {
        let mut source = self.source(path, budget)?;
        let steps = format.steps_within(&mut source, budget);
        self.checked(path, &mut source, steps)
    }

    /// Reads `step`, one of `step_count`, of the file at `path`.
    pub(super) fn read(
        &self,
        path: &Path,
        format: Format,
        (step, step_count): (&Step, usize),
        budget: MemoryBudget,
    ) -> Result<RawParticles, FrameError> {
        self.stamp.check(path)?;
        let parked = || self.parked.lock().unwrap_or_else(PoisonError::into_inner);
        let last = parked().take();
        let is_alone = format.reader().reads_steps_alone(&self.head);
        let can_reach =
            |source: &mut ByteSource<'_>| is_alone && source.text().can_reach(step.start());
        let mut source = match last.and_then(|mut s| can_reach(&mut s).then_some(s)) {
            Some(source) => source,
            None => self.source(path, budget)?,
        };
        source.set_mesh_points(self.has_mesh_points);
        let particles = format.read_within(&mut source, step, budget);
        // Only the end of a compressed file shows whether all of it is sound.
        if self.is_compressed() && self.end.get().is_none() && particles.is_ok() {
            source.text().finish();
        }
        let particles = self.checked(path, &mut source, particles)?;
        if step_count > 1 {
            source.text().end_at(usize::MAX);
            *parked() = Some(source);
        }
        Ok(particles)
    }

    /// The file at `path` from its beginning.
    fn source(&self, path: &Path, budget: MemoryBudget) -> Result<ByteSource<'static>, FrameError> {
        let stream = Box::new(decompressor(path, budget)?);
        let unpacked = unpacked_len(path).unwrap_or(self.stamp.len);
        let about = usize::try_from(unpacked).unwrap_or(usize::MAX);
        let len = match self.end.get() {
            Some(end) => usize::try_from(end.len).ok(),
            None => (!self.is_compressed()).then_some(about),
        };
        let head = Arc::clone(&self.head);
        let lens = (len, len.unwrap_or(about));
        let text = TextInput::stream(stream, head, lens, budget);
        Ok(ByteSource::from_text(text))
    }

    /// The result of reading `source`, unless a fault of the file itself explains it.
    fn checked<T>(
        &self,
        path: &Path,
        source: &mut ByteSource<'_>,
        result: Result<T, ParseError>,
    ) -> Result<T, FrameError> {
        let text = source.text();
        if let Some((len, notes)) = text.ended() {
            let (len, notes) = (len as u64, notes.to_vec());
            let _ = self.end.set(StreamEnd { len, notes });
        }
        let stream = text.check_source().map_err(|e| e.in_file(path));
        // A file that changed explains any other fault.
        self.stamp.check(path)?;
        stream?;
        result.map_err(|e| e.in_file(path))
    }
}
