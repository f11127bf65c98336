//! Which files are which frame: directories, patterns, lists; several files a step, several steps
//! a file.
//!
//! Grouping looks at names only (`group.rs` has the rules); contents are looked at where a format
//! may hold several steps. What a file holds is checked when its frame is loaded, so one damaged
//! file costs one frame and not the sequence.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use glam::DVec3;

use crate::detect::Format;
use crate::native::layout::UP_Y;
use crate::native::{self, Access, NativeFile};
use crate::open::FrameFile;
use crate::{FrameError, MemoryBudget, ParseError, ParticleFrame, RawParticles};

mod error;
mod from_names;
mod group;
mod merge;
mod name;
mod pattern;
mod scan;

pub use error::{GroupSummary, SequenceError};
#[doc(hidden)]
pub use from_names::{frames_of_list, frames_of_names};
pub use merge::{PART_ATTRIBUTE, merge};

use group::Group;
use name::Name;
use pattern::Pattern;

/// What a user names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SequenceInput {
    /// All particle files of a directory.
    Directory(PathBuf),
    /// `dump.#.vtk`, `frame_####.bgeo`, `%04d`, `*`, `?` in the file name.
    Pattern(PathBuf),
    /// Files, each of which may be a pattern or a directory itself.
    Files(Vec<PathBuf>),
}

impl SequenceInput {
    /// Tells by what is on disk: a directory, one file, or else a pattern if it has wildcards.
    pub fn from_path(path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        if path.is_dir() {
            Self::Directory(path)
        } else if !path.exists() && pattern::has_wildcards(&path) {
            Self::Pattern(path)
        } else {
            Self::Files(vec![path])
        }
    }

    /// One argument is read as by [`Self::from_path`], several are files.
    pub fn from_paths(mut paths: Vec<PathBuf>) -> Self {
        match (paths.pop(), paths.is_empty()) {
            (Some(only), true) => Self::from_path(only),
            (Some(last), false) => {
                paths.push(last);
                Self::Files(paths)
            }
            (None, _) => Self::Files(paths),
        }
    }
}

/// One file of a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartFile {
    /// The file.
    pub path: PathBuf,
    /// Index into [`Sequence::part_names`].
    pub part: u32,
    /// Which step of the file; `None` for a file that is one step.
    pub step: Option<usize>,
}

/// One time step: its number in the simulation and the files it is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SequenceFrame {
    /// The number in the file names, or the step number inside the file.
    pub number: i64,
    /// At least one file, in the order of the parts.
    pub parts: Vec<PartFile>,
}

/// The time steps of a simulation in numeric order. Shared between threads by reference.
#[derive(Debug)]
pub struct Sequence {
    frames: Vec<SequenceFrame>,
    parts: Vec<String>,
    notes: Vec<String>,
    cache: Mutex<Option<Cached>>,
    budget: MemoryBudget,
}

/// A frame as it is in its files, and what was in memory for it.
#[derive(Debug)]
pub struct Loaded {
    /// The particles, parts merged.
    pub particles: RawParticles,
    /// Oddities of the files, and what got lost in merging.
    pub notes: Vec<String>,
    /// Bytes of all its files, uncompressed.
    pub all_bytes: u64,
    /// Bytes held at most for one of its files beside its numbers: one is in memory at a time.
    pub content_bytes: u64,
}

/// The file with several steps that was used last, so that its steps do not read it again each.
#[derive(Debug)]
struct Cached {
    file: Arc<FrameFile>,
    stamp: Option<(u64, SystemTime)>,
}

impl Sequence {
    /// [`Self::open_within`] all memory that there is.
    ///
    /// # Errors
    /// As [`Self::open_within`].
    pub fn open(input: &SequenceInput) -> Result<Self, SequenceError> {
        Self::open_within(input, MemoryBudget::UNLIMITED)
    }

    /// Finds the frames of `input`, of which each file is read within `budget`.
    ///
    /// # Errors
    /// [`SequenceError`] if there is nothing, or no way to tell which files belong together.
    pub fn open_within(input: &SequenceInput, budget: MemoryBudget) -> Result<Self, SequenceError> {
        let mut notes = Vec::new();
        let group = match input {
            SequenceInput::Directory(path) => {
                group::pick(path, scan::directory(path)?, &mut notes)?
            }
            SequenceInput::Pattern(path) => {
                let pattern = Pattern::parse(path)?;
                let names = scan::fitting(&pattern, path)?;
                group::pick(&pattern.directory, names, &mut notes)?
            }
            SequenceInput::Files(paths) => group::listed(listed_names(paths)?, &mut notes)?,
        };
        Ok(Self::from_group(group, notes, budget))
    }

    fn from_group(group: Group, mut notes: Vec<String>, budget: MemoryBudget) -> Self {
        let (numbered, last) = scan::number_steps(group.files, budget, &mut notes);
        let mut by_number = BTreeMap::<i64, Vec<PartFile>>::new();
        for entry in numbered {
            by_number.entry(entry.number).or_default().push(entry.file);
        }
        let frames: Vec<SequenceFrame> = by_number
            .into_iter()
            .map(|(number, parts)| SequenceFrame { number, parts })
            .collect();
        note_gaps(&frames, &mut notes);
        note_missing_parts(&frames, &group.parts, &mut notes);
        let cache = last.filter(|f| f.steps().len() > 1).map(|file| Cached {
            stamp: stamp(file.path()),
            file: Arc::new(file),
        });
        Self {
            frames,
            parts: group.parts,
            notes,
            cache: Mutex::new(cache),
            budget,
        }
    }

    /// The frames, by number.
    pub fn frames(&self) -> &[SequenceFrame] {
        &self.frames
    }

    /// Names of the parts of a step, by index; a single empty name if steps have one part.
    pub fn part_names(&self) -> &[String] {
        &self.parts
    }

    /// Whether users of this format are used to y pointing up: Houdini's BGEO, and VTK files that
    /// SPlisHSPlasH signs in their title, and native frames made of either. Elsewhere z is. Looks into the first file.
    pub fn is_y_up(&self) -> bool {
        let first = self.frames.first().and_then(|f| f.parts.first());
        first.is_some_and(|part| y_is_up(&part.path))
    }

    /// Names of the parts that the frames have, which are fewer after [`Self::keep_parts`].
    pub fn kept_part_names(&self) -> Vec<&str> {
        let files = self.frames.iter().flat_map(|frame| &frame.parts);
        let kept: BTreeSet<u32> = files.map(|file| file.part).collect();
        let names = (0..).zip(&self.parts);
        names
            .filter(|(part, _)| kept.contains(part))
            .map(|(_, name)| name.as_str())
            .collect()
    }

    /// Keeps only the parts that `names` mean: those of the name in whatever case, else all whose names contain it.
    /// Frames without any of them are left out.
    ///
    /// # Errors
    /// The first name that means no part.
    pub fn keep_parts(&mut self, names: &[String]) -> Result<(), SequenceError> {
        let mut meant = BTreeSet::new();
        for name in names {
            let found = parts_meant(&self.parts, name);
            if found.is_empty() {
                return Err(SequenceError::NoSuchPart {
                    name: name.clone(),
                    known: self.parts.clone(),
                });
            }
            meant.extend(found);
        }
        let kept = |part: &PartFile| meant.contains(&part.part);
        for frame in &mut self.frames {
            frame.parts.retain(kept);
        }
        self.frames.retain(|f| !f.parts.is_empty());
        Ok(())
    }

    /// Keeps only the frames that are `wanted`.
    pub fn keep_frames(&mut self, wanted: impl FnMut(&SequenceFrame) -> bool) {
        self.frames.retain(wanted);
    }

    /// What a user should know: gaps, files left out, missing parts.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What the files of the first frame say that is not in their particles ([`crate::open::remarks`]), each once.
    pub fn remarks(&self) -> Vec<String> {
        let mut all: Vec<String> = Vec::new();
        for path in self.inputs(0) {
            for remark in crate::open::remarks(path) {
                if !all.contains(&remark) {
                    all.push(remark);
                }
            }
        }
        all
    }

    /// The files that frame `index` is read from.
    pub fn inputs(&self, index: usize) -> Vec<&Path> {
        let frame = self.frames.get(index);
        let parts = frame.map_or(&[][..], |f| f.parts.as_slice());
        parts.iter().map(|p| p.path.as_path()).collect()
    }

    /// The file of frame `index` if that is one native frame, which can be used where it lies.
    pub fn native_file(&self, index: usize) -> Option<&Path> {
        // What cannot be looked at is told when it is read.
        let is_native = |path: &&Path| crate::open::is_native(path).unwrap_or(false);
        self.lone_file(index).filter(is_native)
    }

    /// The file of frame `index` if that is all there is of the frame, and nothing else in the file.
    pub fn lone_file(&self, index: usize) -> Option<&Path> {
        let [part] = self.frames.get(index)?.parts.as_slice() else {
            return None;
        };
        let is_alone = self.parts.len() < 2 && part.step.is_none();
        is_alone.then_some(&part.path)
    }

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
        let frame = &self.frames[index];
        let mut notes = Vec::new();
        let (mut all_bytes, mut content_bytes) = (0, 0);
        let mut parts = Vec::with_capacity(frame.parts.len());
        for part in &frame.parts {
            let (file, step) = self.file_of(part)?;
            let particles = file.read(step)?;
            notes.extend_from_slice(file.notes());
            all_bytes += file.unpacked_len();
            let held = file.held_len() + file.unpacked_arrays_len(&particles);
            content_bytes = content_bytes.max(held);
            parts.push((part.part, particles));
        }
        let only = if self.parts.len() < 2 {
            parts.pop().map(|(_, only)| only)
        } else {
            None
        };
        let particles = only.unwrap_or_else(|| merge(parts, &mut notes));
        Ok(Loaded {
            particles,
            notes,
            all_bytes,
            content_bytes,
        })
    }

    /// The opened file of `part` and the step in it.
    fn file_of(&self, part: &PartFile) -> Result<(Arc<FrameFile>, usize), FrameError> {
        let Some(step) = part.step else {
            let file = FrameFile::open_within(&part.path, self.budget)?;
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
        let stamp = stamp(&part.path);
        let lock = || self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cached) = lock().as_ref()
            && cached.file.path() == part.path
            && cached.stamp == stamp
        {
            return Ok((Arc::clone(&cached.file), step));
        }
        // Let go of the old one first: two large files need not be in memory at once.
        *lock() = None;
        let file = Arc::new(FrameFile::open_within(&part.path, self.budget)?);
        *lock() = Some(Cached {
            file: Arc::clone(&file),
            stamp,
        });
        Ok((file, step))
    }
}

/// Indices of the `parts` that `name` means, see [`Sequence::keep_parts`].
fn parts_meant(parts: &[String], name: &str) -> Vec<u32> {
    let wanted = name.to_lowercase();
    let matching = |fits: &dyn Fn(&str) -> bool| -> Vec<u32> {
        let named = (0..).zip(parts);
        let found = named.filter(|(_, part)| fits(&part.to_lowercase()));
        found.map(|(index, _)| index).collect()
    };
    // Names that differ in case only are told apart where they are written as they are.
    let as_written = (0..).zip(parts).filter(|(_, part)| *part == name);
    let as_written: Vec<u32> = as_written.map(|(index, _)| index).collect();
    let whole = matching(&|part| part == wanted);
    match (as_written.is_empty(), whole.is_empty()) {
        (false, _) => as_written,
        (true, false) => whole,
        (true, true) if parts.len() < 2 || wanted.is_empty() => Vec::new(),
        (true, true) => matching(&|part| part.contains(&wanted)),
    }
}

/// See [`Sequence::is_y_up`].
fn y_is_up(path: &Path) -> bool {
    let Ok(head) = crate::open::head(path) else {
        return false;
    };
    let Ok(format) = Format::detect(&head, path) else {
        return false;
    };
    if format == native::FORMAT {
        // The index of a native frame is at its end.
        let file = NativeFile::open(path, Access::Map);
        return file.is_ok_and(|file| file.index().up == UP_Y);
    }
    format.reader().is_y_up(&head)
}

/// The frame number that the name of a file tells when there are no others to compare with: what
/// follows the word `frame`, else the last number.
pub fn lone_frame_number(path: &Path) -> Option<i64> {
    let name = Name::parse(path, None);
    name.numbers.get(name.lone_column()?).copied()
}

/// Tells a rewritten file from the one that was read.
fn stamp(path: &Path) -> Option<(u64, SystemTime)> {
    let meta = fs::metadata(path).ok()?;
    Some((meta.len(), meta.modified().ok()?))
}

/// The files of a list, its patterns and directories filled in; the same file twice is once.
fn listed_names(paths: &[PathBuf]) -> Result<Vec<Name>, SequenceError> {
    let mut names: Vec<Name> = Vec::new();
    let mut known = HashSet::new();
    for path in paths {
        let found = match SequenceInput::from_path(path) {
            SequenceInput::Directory(path) => scan::directory(&path)?,
            SequenceInput::Pattern(path) => scan::fitting(&Pattern::parse(&path)?, &path)?,
            SequenceInput::Files(_) if path.exists() => vec![Name::parse(path, None)],
            SequenceInput::Files(_) => {
                return Err(SequenceError::missing(path));
            }
        };
        for name in found {
            if known.insert(name.path.clone()) {
                names.push(name);
            }
        }
    }
    if names.is_empty() {
        return Err(SequenceError::NoInput);
    }
    Ok(names)
}

/// Tells where the numbering jumps by more than it usually does.
fn note_gaps(frames: &[SequenceFrame], notes: &mut Vec<String>) {
    const SHOWN: usize = 5;
    let pairs = || frames.windows(2).map(|w| (w[0].number, w[1].number));
    let mut strides = BTreeMap::<i64, usize>::new();
    for (a, b) in pairs() {
        *strides.entry(b.saturating_sub(a)).or_default() += 1;
    }
    // The most frequent one, the smallest of equals.
    let usual = strides
        .iter()
        .max_by_key(|(stride, count)| (**count, std::cmp::Reverse(**stride)));
    let Some((usual, _)) = usual else { return };
    let gaps: Vec<String> = pairs()
        .filter(|(a, b)| b.saturating_sub(*a) > *usual)
        .map(|(a, b)| format!("{a} to {b}"))
        .collect();
    if gaps.is_empty() {
        return;
    }
    let more = match gaps.len().saturating_sub(SHOWN) {
        0 => String::new(),
        more => format!(" and {more} times more"),
    };
    let shown = gaps[..gaps.len().min(SHOWN)].join(", ");
    notes.push(format!(
        "frame numbers go up by {usual}, but jump from {shown}{more}"
    ));
}

fn note_missing_parts(frames: &[SequenceFrame], parts: &[String], notes: &mut Vec<String>) {
    if parts.len() < 2 {
        return;
    }
    // Frames that have a part, in their order; a frame may have several steps of one.
    let mut present: Vec<Vec<usize>> = vec![Vec::new(); parts.len()];
    for (place, frame) in frames.iter().enumerate() {
        for part in &frame.parts {
            if let Some(places) = present.get_mut(part.part as usize)
                && places.last() != Some(&place)
            {
                places.push(place);
            }
        }
    }
    for (name, present) in parts.iter().zip(present) {
        if present.len() == frames.len() {
            continue;
        }
        let mut present = present.into_iter().peekable();
        let missing: Vec<i64> = frames
            .iter()
            .enumerate()
            .filter(|(place, _)| present.next_if_eq(place).is_none())
            .map(|(_, frame)| frame.number)
            .collect();
        notes.push(format!(
            "part `{name}` is missing in {} of {} frames: {}",
            missing.len(),
            frames.len(),
            ranges(&missing)
        ));
    }
}

/// Sorted numbers as `1-4, 7`; long lists are cut.
fn ranges(numbers: &[i64]) -> String {
    const SHOWN: usize = 8;
    let mut runs: Vec<(i64, i64)> = Vec::new();
    for &number in numbers {
        match runs.last_mut() {
            Some((_, last)) if number == *last || Some(number) == last.checked_add(1) => {
                *last = number;
            }
            _ => runs.push((number, number)),
        }
    }
    let text = |(first, last): &(i64, i64)| {
        if first == last {
            first.to_string()
        } else {
            format!("{first}-{last}")
        }
    };
    let mut texts: Vec<String> = runs.iter().take(SHOWN).map(text).collect();
    if runs.len() > SHOWN {
        texts.push("...".to_owned());
    }
    texts.join(", ")
}

#[cfg(test)]
mod tests;
