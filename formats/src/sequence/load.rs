//! Reads frames of a sequence and merges their parts.

use std::fs;
use std::io;
use std::path::Path;
use std::sync::{Arc, PoisonError};
use std::time::SystemTime;

use glam::DVec3;

use super::{PartFile, Sequence, thinning};
use crate::join::{PART, Part, join, join_numbered};
use crate::open::FrameFile;
use crate::{FrameError, MemoryBudget, ParseError, ParticleFrame, RawParticles, escape_controls};

/// A frame as it is in its files, and the memory that reading it took.
#[derive(Debug)]
pub struct Loaded {
    /// The particles, parts merged.
    pub particles: RawParticles,
    /// Oddities of the files, and what got lost in merging.
    pub notes: Vec<String>,
    /// Bytes of all its files, uncompressed.
    pub all_bytes: u64,
    /// Bytes held at most for one of its files beside its numbers: one is in memory at a time, and none while particles are
    /// placed, which counts as well.
    pub content_bytes: u64,
}

/// The file with several steps that was used last, so that it is not opened again for each step.
#[derive(Debug)]
pub(super) struct CachedFile {
    pub(super) file: Arc<FrameFile>,
    pub(super) stamp: Option<(u64, SystemTime)>,
}

impl Sequence {
    /// Reads frame `index`: finite particles, relative to `origin`.
    ///
    /// # Errors
    /// As [`Self::load_raw`].
    ///
    /// # Panics
    /// If there is no frame `index`.
    pub fn load(&self, index: usize, origin: DVec3) -> Result<ParticleFrame, FrameError> {
        Ok(ParticleFrame::from_raw(self.load_raw(index)?, origin))
    }

    /// Reads frame `index` (not: frame number) as it is in the files, parts merged.
    ///
    /// # Errors
    /// [`FrameError`] of the first file that cannot be read.
    ///
    /// # Panics
    /// If there is no frame `index`.
    pub fn load_raw(&self, index: usize) -> Result<RawParticles, FrameError> {
        self.load_measured(index).map(|loaded| loaded.particles)
    }

    /// Like [`Self::load_raw`], with what got lost in merging the parts and what was read.
    ///
    /// # Errors
    /// As [`Self::load_raw`].
    ///
    /// # Panics
    /// If there is no frame `index`.
    pub fn load_measured(&self, index: usize) -> Result<Loaded, FrameError> {
        if self.every > 1 {
            return self.load_thinned(index);
        }
        self.load_whole(index)
    }

    /// Reads every n-th particle of frame `index`.
    fn load_thinned(&self, index: usize) -> Result<Loaded, FrameError> {
        if let Some(path) = self.native_file(index) {
            let mut particles = thinning::native(path, self.every)?;
            particles.time = self.listed_time(index).or(particles.time);
            let all_bytes = fs::metadata(path).map_or(0, |meta| meta.len());
            return Ok(Loaded { particles, notes: Vec::new(), all_bytes, content_bytes: 0 });
        }
        let mut loaded = self.load_whole(index)?;
        loaded.content_bytes += loaded.particles.byte_len();
        thinning::keep(&mut loaded.particles, self.every);
        Ok(loaded)
    }

    /// Reads all particles of frame `index`.
    fn load_whole(&self, index: usize) -> Result<Loaded, FrameError> {
        // Two frames need not be in memory at once
        if self.placement.align.is_some() {
            self.reference(index)?;
        }
        let mut loaded = self.read_parts(index)?;
        if self.placement.needs_reference(&loaded.particles) && !self.has_reference() {
            drop(loaded);
            self.reference(index)?;
            loaded = self.read_parts(index)?;
        }
        let count = loaded.particles.positions.len() as u64;
        self.place(index, &mut loaded.particles)?;
        loaded.content_bytes = loaded.content_bytes.max(self.placement.bytes(count));
        loaded.notes.append(&mut loaded.particles.notes);
        Ok(loaded)
    }

    /// Reads frame `index` as it is in the files.
    pub(super) fn read_parts(&self, index: usize) -> Result<Loaded, FrameError> {
        let frame = &self.frames[index];
        self.missing_pieces.check(frame)?;
        let mut notes = Vec::new();
        let (mut all_bytes, mut content_bytes) = (0, 0);
        // Read the parts one after the other
        let mut parts = Vec::with_capacity(frame.parts.len());
        let mut read_bytes = 0;
        for part in &frame.parts {
            // A list can name any number of files for one step, and a step may be divided among files
            let is_divided = part.listed.is_some() || self.parts.len() < 2;
            let budget = if is_divided { self.budget.less(read_bytes) } else { self.budget };
            let (file, step) = self.file_of(part, budget)?;
            let mut particles = file.read(step)?;
            if let Some(topology) = &self.topology {
                topology.add_to(&mut particles, file.path())?;
            }
            read_bytes += particles.byte_len();
            notes.extend_from_slice(file.notes());
            all_bytes += file.unpacked_len();
            let held = file.held_len() + file.unpacked_arrays_len(&particles);
            content_bytes = content_bytes.max(held);
            parts.push(Part { number: part.part, name: self.part_name(part), particles });
        }
        let mut particles = self.joined(parts).map_err(|error| self.in_first(index, error))?;
        notes.append(&mut particles.notes);
        if self.parts.len() > 1 {
            // A frame may lack a part
            let names = (0..).zip(self.parts.iter().cloned());
            particles.labels.insert(PART.to_owned(), names.collect());
        }
        particles.time = self.listed_time(index).or(particles.time);
        Ok(Loaded { particles, notes, all_bytes, content_bytes })
    }

    /// An error that concerns all files of a frame names the first one.
    pub(super) fn in_first(&self, index: usize, error: ParseError) -> FrameError {
        let part = self.frames.get(index).and_then(|frame| frame.parts.first());
        error.in_file(part.map_or(Path::new(""), |part| &part.path))
    }

    /// The parts of a frame as one. Files of one part may have parts of their own, which keep their numbers.
    fn joined(&self, parts: Vec<Part>) -> Result<RawParticles, ParseError> {
        let has_own = |part: &Part| part.particles.attributes.iter().any(|a| a.name == PART);
        let is_one = parts.windows(2).all(|pair| pair[0].number == pair[1].number);
        let keeps_own = is_one && (parts.iter().any(has_own) || parts.len() == 1);
        if self.parts.len() < 2 && keeps_own {
            join(parts, self.budget)
        } else {
            join_numbered(parts, self.budget)
        }
    }

    /// The name of a part in messages: that of its file, if it is one of several files of one part.
    fn part_name(&self, part: &PartFile) -> String {
        match self.parts.get(part.part as usize).filter(|name| !name.is_empty()) {
            Some(name) if self.parts.len() > 1 => name.clone(),
            _ => part.path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        }
    }

    /// Whether the file of several steps that was used last is mapped while a step is read.
    pub fn maps_files(&self) -> bool {
        let cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        cache.as_ref().is_some_and(|cached| cached.file.is_mapped())
    }

    /// The opened file of `part` and the step in it.
    fn file_of(
        &self,
        part: &PartFile,
        budget: MemoryBudget,
    ) -> Result<(Arc<FrameFile>, usize), FrameError> {
        // A file with one step is not kept
        let Some(step) = part.step else {
            self.check_listed(part)?;
            let file = FrameFile::open_within(&part.path, budget)?;
            let file = file.with_mesh_points(self.mesh_points);
            return match file.steps() {
                [_, second, ..] => {
                    let what = format!(
                        "{} time steps where one was expected; give such files one at a time",
                        file.steps().len()
                    );
                    Err(ParseError::malformed(second.start(), what).in_file(&part.path))
                }
                _ => Ok((Arc::new(file), 0)),
            };
        };
        // Use the file that is open already, unless it has changed since
        let stamp = stamp(&part.path);
        let lock = || self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cached) = lock().as_ref()
            && cached.file.path() == part.path
            && cached.stamp == stamp
        {
            return Ok((Arc::clone(&cached.file), step));
        }
        // Drop the old one first: two large files need not be in memory at once.
        *lock() = None;
        let file = FrameFile::open_within(&part.path, budget)?;
        let file = Arc::new(file.with_mesh_points(self.mesh_points));
        *lock() = Some(CachedFile { file: Arc::clone(&file), stamp });
        Ok((file, step))
    }
}

impl Sequence {
    /// Checks that a file that a list names is there, and is no list that cannot be used.
    ///
    /// # Errors
    /// [`FrameError`] that names the list and the place in it.
    pub fn check_listed(&self, part: &PartFile) -> Result<(), FrameError> {
        let faults = self.lists.as_ref().map(|lists| &lists.faults);
        if let Some(fault) = faults.and_then(|faults| faults.get(&part.path)) {
            return Err(fault.clone().in_file(&part.path));
        }
        match &part.listed {
            Some(place) if !part.path.exists() => {
                let what = format!(
                    "line {}: it lists {}, which does not exist; copy the file there, or remove the entry",
                    place.line,
                    escape_controls(&part.path.to_string_lossy())
                );
                let source = io::Error::new(io::ErrorKind::NotFound, what);
                Err(FrameError::io(&place.list, source))
            }
            _ => Ok(()),
        }
    }
}

/// Length and time of modification, to notice that a file was rewritten.
pub(super) fn stamp(path: &Path) -> Option<(u64, SystemTime)> {
    let meta = fs::metadata(path).ok()?;
    Some((meta.len(), meta.modified().ok()?))
}
