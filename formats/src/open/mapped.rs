//! Files of several steps that are mapped for each step, so that only the pages of that step are in memory.

use std::path::Path;
use std::sync::Arc;

use super::siblings::SiblingFiles;
use crate::native::MappedFile;
use crate::read::{ByteSource, Step};
use crate::{FrameError, MemoryBudget, ParseError, RawParticles};
use spherule_readers::Format;
use spherule_readers::HEAD_LEN;
use spherule_readers::regular::FileStamp;
use spherule_readers::shared::SharedBytes;

/// An uncompressed file that is not in memory.
#[derive(Debug)]
pub(super) struct SteppedFile {
    head: Vec<u8>,
    /// The file when it was opened.
    stamp: FileStamp,
    has_mesh_points: bool,
}

impl SteppedFile {
    /// The file that had `stamp` and begins with `head`.
    pub(super) fn new(head: &[u8], stamp: FileStamp) -> Self {
        let head = head[..head.len().min(HEAD_LEN)].to_vec();
        Self { head, stamp, has_mesh_points: false }
    }

    /// Whether the file has several steps. A file with one step is read as a whole: its pages would count as memory
    /// of the process either way. A damaged file is mapped, to find the fault without reading everything.
    pub(super) fn is_worth_mapping(
        &self,
        path: &Path,
        format: Format,
        budget: MemoryBudget,
    ) -> bool {
        let steps = self.steps(path, format, budget);
        steps.map_or(true, |steps| steps.len() > 1)
    }

    /// Says whether the vertices of a mesh are particles.
    pub(super) const fn set_mesh_points(&mut self, are_particles: bool) {
        self.has_mesh_points = are_particles;
    }

    pub(super) fn head(&self) -> &[u8] {
        &self.head
    }

    /// Bytes of the file.
    pub(super) const fn len(&self) -> u64 {
        self.stamp.len
    }

    /// The time steps of the file at `path`.
    pub(super) fn steps(
        &self,
        path: &Path,
        format: Format,
        budget: MemoryBudget,
    ) -> Result<Vec<Step>, FrameError> {
        self.with_map(path, |source| format.steps_within(source, budget))
    }

    /// Reads one of the [`Self::steps`].
    pub(super) fn read(
        &self,
        path: &Path,
        format: Format,
        step: &Step,
        budget: MemoryBudget,
    ) -> Result<RawParticles, FrameError> {
        self.with_map(path, |source| {
            source.set_mesh_points(self.has_mesh_points);
            format.read_within(source, step, budget)
        })
    }

    /// Maps the file while `read` runs.
    fn with_map<T>(
        &self,
        path: &Path,
        read: impl FnOnce(&mut ByteSource<'_>) -> Result<T, ParseError>,
    ) -> Result<T, FrameError> {
        self.stamp.check(path)?;
        let map = Arc::new(MappedFile::open(path)?);
        let siblings = SiblingFiles::of(path);
        let bytes = siblings.around(SharedBytes::new(map.clone()));
        let result = read(&mut ByteSource::shared(&bytes));
        // A file that changed explains any fault, and bytes that were cut off read as zeros.
        self.stamp.check(path)?;
        map.check()?;
        siblings.check()?;
        result.map_err(|e| e.in_file(path))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use super::*;
    use crate::FrameFile;

    const FRAMES: usize = 5;
    const COUNT: usize = 60_000;

    /// An array of (frames, N, 3) that is too long to be read as a whole.
    fn array(frames: usize) -> Vec<u8> {
        let shape = format!("'shape': ({frames}, {COUNT}, 3), ");
        let header = format!("{{'descr': '<f4', 'fortran_order': False, {shape}}}");
        let mut bytes = b"\x93NUMPY\x01\0\x76\0".to_vec();
        bytes.extend(format!("{header:117}\n").bytes());
        let numbers = (0..u16::MAX).cycle().take(frames * COUNT * 3);
        bytes.extend(numbers.flat_map(|n| f32::from(n).to_le_bytes()));
        bytes
    }

    fn written(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("all.npy");
        fs::write(&path, bytes).expect("writable");
        (dir, path)
    }

    #[test]
    fn steps_are_those_of_the_file_in_memory() {
        let bytes = array(FRAMES);
        let (_dir, path) = written(&bytes);
        let stepped = FrameFile::open(&path).expect("a good file");
        let whole = FrameFile::from_bytes(&path, bytes.clone()).expect("a good file");
        assert_eq!(stepped.steps(), whole.steps());
        assert_eq!(stepped.steps().len(), FRAMES);
        assert_eq!(stepped.unpacked_len(), bytes.len() as u64);
        assert!(stepped.held_len() <= HEAD_LEN as u64, "the file is in memory");
        for step in [3, 0, 4] {
            let expected = whole.read(step).expect("a good step");
            assert_eq!(stepped.read(step).expect("a good step"), expected);
        }
    }

    #[test]
    fn budget_limits_the_step_not_the_file() {
        let (_dir, path) = written(&array(FRAMES));
        let open = |bytes| FrameFile::open_within(&path, MemoryBudget::new(bytes, "get more"));
        let step = (COUNT * 12) as u64;
        let file = open(step + HEAD_LEN as u64).expect("steps fit one by one");
        assert!(file.read(FRAMES - 1).is_ok());
        let error = open(step).expect("the steps fit").read(0).expect_err("too large").to_string();
        assert!(error.contains("get more"), "{error}");
    }

    #[test]
    fn change_between_steps_is_detected() {
        let (_dir, path) = written(&array(FRAMES));
        let file = FrameFile::open(&path).expect("a good file");
        assert!(file.read(0).is_ok());
        fs::write(&path, array(FRAMES - 1)).expect("writable");
        let error = file.read(1).expect_err("another file").to_string();
        assert!(error.contains("still being written"), "{error}");
    }
}
