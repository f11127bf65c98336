//! Finds the frames of a sequence of files: directories, patterns, lists; several files a step, several steps
//! a file.
//!
//! Grouping looks at names only (`group.rs` has the rules); contents are looked at where a format
//! may hold several steps. What a file holds is checked when its frame is loaded, so one damaged
//! file costs one frame and not the sequence. Lists of files (ParaView collections and the like) are
//! followed to the files of particles first (`collection`).

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::native::layout::UP_Y;
use crate::native::{self, Access, MappedFile, NativeFile};
use crate::order::index_u32;
use crate::{MemoryBudget, ValueNames};
use spherule_readers::FormatInfo;
use spherule_readers::compression::is_compressed;

mod collection;
mod error;
mod from_names;
mod group;
mod input;
mod load;
mod name;
mod notes;
mod pattern;
mod pieces;
mod placement;
mod references;
mod scan;
mod thinning;
mod times;
mod topology;

pub use collection::ListSummary;
#[doc(hidden)]
pub use collection::lists_of;
pub use error::{GroupSummary, SequenceError};
#[doc(hidden)]
pub use from_names::{frames_of_list, frames_of_names};
pub use input::SequenceInput;
pub use load::Loaded;
pub use placement::{Group, Placement};
pub use spherule_frame::join::PART as PART_ATTRIBUTE;
pub use topology::Topology;

use collection::{Expansion, ListedFiles};
use group::FileGroup;
use input::listed_names;
use load::{CachedFile, stamp};
use name::FileName;
use notes::{note_gaps, note_missing_parts};
use pattern::Pattern;
use pieces::MissingPieces;
use placement::ReferenceCell;

/// Whether the file at `path` has no particles itself, but stands for others: it is a list of files, or a snapshot of
/// virtual data sets beside the files with the values.
pub fn stands_for_others(path: &Path) -> bool {
    collection::has_list(std::iter::once(path)) || pieces::is_reference(path)
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
    /// Where a list of files names this one; `None` if the input does.
    pub listed: Option<ListPlace>,
}

/// A place in a list of files, such as a `.pvd`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListPlace {
    /// The list.
    pub list: Arc<Path>,
    /// Line, from 1.
    pub line: u32,
}

/// A file of the sequence with the number of one of its steps.
#[derive(Debug, Clone, PartialEq, Eq)]
struct NumberedStep {
    number: i64,
    file: PartFile,
}

/// How the files of a sequence are found and read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SequenceSettings {
    /// Memory for reading one file, and for the names in a list of files.
    pub budget: MemoryBudget,
    /// Whether lists of files may name files outside their directory.
    pub follow_links: bool,
    /// Whether the vertices of meshes are particles; otherwise meshes are refused.
    pub mesh_points: bool,
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
    cache: Mutex<Option<CachedFile>>,
    budget: MemoryBudget,
    /// The lists that the frames come from, if there are some.
    lists: Option<ListedFiles>,
    topology: Option<Topology>,
    placement: Placement,
    reference: ReferenceCell,
    /// Of so many particles of a frame one is read.
    every: u32,
    /// What there is with all parts, if some are left out unless they are named.
    all_parts: Option<AllParts>,
    /// Files that steps lack.
    missing_pieces: MissingPieces,
    mesh_points: bool,
}

/// Frames, names and notes of a sequence of all parts.
#[derive(Debug)]
struct AllParts {
    frames: Vec<SequenceFrame>,
    parts: Vec<String>,
    notes: Vec<String>,
}

impl Sequence {
    /// [`Self::open_within`] without a limit.
    ///
    /// # Errors
    /// As [`Self::open_within`].
    pub fn open(input: &SequenceInput) -> Result<Self, SequenceError> {
        Self::open_within(input, MemoryBudget::UNLIMITED)
    }

    /// [`Self::open_with`] without files outside the directories of lists. Each file is read within `budget`.
    ///
    /// # Errors
    /// As [`Self::open_with`].
    pub fn open_within(input: &SequenceInput, budget: MemoryBudget) -> Result<Self, SequenceError> {
        let settings = SequenceSettings { budget, ..SequenceSettings::default() };
        Self::open_with(input, settings)
    }

    /// Finds the frames of `input`.
    ///
    /// # Errors
    /// [`SequenceError`] if there is nothing, or nothing shows which files belong together, or a list of files cannot
    /// be followed.
    pub fn open_with(
        input: &SequenceInput,
        settings: SequenceSettings,
    ) -> Result<Self, SequenceError> {
        let mut notes = Vec::new();
        // Find the files, and which of them belong together
        let (group, missing_pieces) = match input {
            SequenceInput::Directory(path) => {
                let (names, missing) =
                    pieces::find_pieces(input, scan::directory(path)?, &mut notes);
                (group::pick(path, names, &mut notes)?, missing)
            }
            SequenceInput::Pattern(path) => {
                let pattern = Pattern::parse(path)?;
                let names = scan::fitting(&pattern, path)?;
                let (names, missing) = pieces::find_pieces(input, names, &mut notes);
                (group::pick(&pattern.directory, names, &mut notes)?, missing)
            }
            SequenceInput::Files(paths) => {
                let names = listed_names(paths)?;
                let (names, missing) = pieces::find_pieces(input, names, &mut notes);
                (group::listed(names, &mut notes)?, missing)
            }
        };
        // Follow lists of files
        if collection::has_list(group.files.iter().map(|file| &*file.path)) {
            let expansion = collection::expand(&group, settings, &mut notes)?;
            let sequence = Self::from_expansion(expansion, notes, settings.budget);
            return Ok(Self { mesh_points: settings.mesh_points, ..sequence });
        }
        let sequence = Self::from_group(group, notes, settings.budget);
        Ok(Self { missing_pieces, mesh_points: settings.mesh_points, ..sequence })
    }

    fn from_expansion(expansion: Expansion, mut notes: Vec<String>, budget: MemoryBudget) -> Self {
        let frames = frames_of(expansion.steps);
        note_missing_parts(&frames, &expansion.parts, &mut notes);
        Self {
            frames,
            parts: expansion.parts,
            notes,
            cache: Mutex::new(None),
            budget,
            lists: Some(expansion.lists),
            topology: None,
            placement: Placement::default(),
            reference: ReferenceCell::default(),
            every: 1,
            all_parts: None,
            missing_pieces: MissingPieces::default(),
            mesh_points: false,
        }
    }

    fn from_group(group: FileGroup, mut notes: Vec<String>, budget: MemoryBudget) -> Self {
        // Number the steps of files with several of them
        let (numbered, last) = scan::number_steps(group.files, budget, &mut notes);
        let all = frames_of(numbered);
        // Parts of a single frame are left out at first; keep them for those who ask for them
        let add_notes = |frames: &[SequenceFrame], parts: &[String], notes: &mut Vec<String>| {
            note_gaps(frames, notes);
            note_missing_parts(frames, parts, notes);
        };
        let (frames, parts, all_parts) = match group.lone {
            None => (all, group.parts, None),
            Some(lone) => {
                let mut all_notes = notes.clone();
                add_notes(&all, &group.parts, &mut all_notes);
                notes.extend(lone.notes);
                let some = without_parts(&all, &lone.parts);
                let all_parts = AllParts { frames: all, parts: group.parts, notes: all_notes };
                (some, lone.others, Some(all_parts))
            }
        };
        add_notes(&frames, &parts, &mut notes);
        // Keep the file that was opened last, if more of its steps will be read
        let cache = last
            .filter(|f| f.steps().len() > 1)
            .map(|file| CachedFile { stamp: stamp(file.path()), file: Arc::new(file) });
        Self {
            frames,
            parts,
            notes,
            cache: Mutex::new(cache),
            budget,
            lists: None,
            topology: None,
            placement: Placement::default(),
            reference: ReferenceCell::default(),
            every: 1,
            all_parts,
            missing_pieces: MissingPieces::default(),
            mesh_points: false,
        }
    }

    /// The lists of files that the frames come from; `None` if the input names the files of particles.
    pub fn list_summary(&self) -> Option<&ListSummary> {
        self.lists.as_ref().map(|lists| &lists.summary)
    }

    /// The lists of files that the frames come from, lists in lists included.
    pub fn list_paths(&self) -> &[PathBuf] {
        self.lists.as_ref().map_or(&[], |lists| &lists.paths)
    }

    /// The simulation time of frame `index` that a list of files states. It goes before that in the files.
    pub fn listed_time(&self, index: usize) -> Option<f64> {
        let number = self.frames.get(index)?.number;
        self.lists.as_ref()?.times.get(&number).copied()
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
    /// SPlisHSPlasH signs in their title, USD files that say so, and native frames made of any. Elsewhere z is. Looks into
    /// the first file.
    pub fn is_y_up(&self) -> bool {
        let first = self.frames.first().and_then(|f| f.parts.first());
        first.is_some_and(|part| y_is_up(&part.path))
    }

    /// What is known of the format of the first file, if it has one. Looks into the file.
    pub fn format_info(&self) -> Option<FormatInfo> {
        let part = self.frames.first().and_then(|f| f.parts.first())?;
        let head = crate::open::head(&part.path).ok()?;
        let format = crate::detect::detect_format(&head, &part.path).ok()?;
        Some(format.reader().info())
    }

    /// Length of an angstrom in the unit of positions: 0.1 for formats of GROMACS, which have nanometres, otherwise 1.
    /// Looks into the first file.
    pub fn angstrom(&self) -> f64 {
        self.format_info().map_or(1.0, |info| info.angstrom)
    }

    /// Names of the parts that the frames have, which are fewer after [`Self::keep_parts`].
    pub fn kept_part_names(&self) -> Vec<&str> {
        let files = self.frames.iter().flat_map(|frame| &frame.parts);
        let kept: BTreeSet<u32> = files.map(|file| file.part).collect();
        let names = (0..).zip(&self.parts);
        names.filter(|(part, _)| kept.contains(part)).map(|(_, name)| name.as_str()).collect()
    }

    /// Keeps only the parts that match `names`: those of the name in whatever case, else all whose names contain it.
    /// Frames without any of them are left out.
    ///
    /// # Errors
    /// The first name that matches no part.
    pub fn keep_parts(&mut self, names: &[String]) -> Result<(), SequenceError> {
        // Start from all parts, with those of a single frame
        if let Some(all) = self.all_parts.take() {
            (self.frames, self.parts, self.notes) = (all.frames, all.parts, all.notes);
        }
        // Find the parts that are meant
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
        // Drop all others
        let kept = |part: &PartFile| meant.contains(&part.part);
        for frame in &mut self.frames {
            frame.parts.retain(kept);
        }
        self.frames.retain(|f| !f.parts.is_empty());
        Ok(())
    }

    /// What `read` finds in the parts that match `names`. Afterwards the sequence has all of its parts again.
    ///
    /// # Errors
    /// As [`Self::keep_parts`].
    pub fn with_parts<T>(
        &mut self,
        names: &[String],
        read: impl FnOnce(&Self) -> T,
    ) -> Result<T, SequenceError> {
        // Parts keep their numbers: those that are left out unless they are named stay left out
        let (frames, all_parts) = (self.frames.clone(), self.all_parts.take());
        let found = self.keep_parts(names).map(|()| read(self));
        (self.frames, self.all_parts) = (frames, all_parts);
        found
    }

    /// Adds to all frames the properties of their atoms that the file at `path` has and they have not: elements,
    /// residues and others that do not change. The file is a PSF, or has any format with particles.
    ///
    /// # Errors
    /// The file cannot be read. A frame with another number of atoms fails when it is loaded.
    pub fn add_topology(&mut self, path: &Path) -> Result<(), SequenceError> {
        let topology = Topology::open(path, self.budget);
        self.topology = Some(topology.map_err(SequenceError::Topology)?);
        Ok(())
    }

    /// The topology of [`Self::add_topology`].
    pub const fn topology(&self) -> Option<&Topology> {
        self.topology.as_ref()
    }

    /// Moves, turns and copies the particles of all frames. Frames for which that is not possible, such as those without a
    /// simulation cell, then fail when they are loaded.
    pub fn set_placement(&mut self, placement: Placement) {
        self.placement = placement;
        self.reference = ReferenceCell::default();
    }

    /// Reads only those particles of frames whose index is a multiple of `every`, if that is not 0. Those without ids get
    /// their indices as ids. Of native frames, the others need no memory.
    pub fn set_thinning(&mut self, every: u32) {
        self.every = every.max(1);
    }

    /// Replaces the frames by `count` times the middle one, with the numbers from 0: for pictures from all sides.
    pub fn repeat_middle(&mut self, count: u32) {
        let Some(middle) = self.frames.get(self.frames.len() / 2).cloned() else {
            return;
        };
        let numbers = 0..i64::from(count);
        let repeated = numbers.map(|number| SequenceFrame { number, parts: middle.parts.clone() });
        self.frames = repeated.collect();
        // Notes are about the frames that there were
        self.notes.clear();
    }

    /// Keeps only the frames for which `keep` is true.
    pub fn keep_frames(&mut self, keep: impl FnMut(&SequenceFrame) -> bool) {
        self.frames.retain(keep);
    }

    /// Notes for the user: gaps, files left out, missing parts.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Notes about the files of the first frame ([`crate::open::notes`]), each once.
    pub fn file_notes(&self) -> Vec<String> {
        let mut all: Vec<String> = Vec::new();
        for path in self.inputs(0) {
            for note in crate::open::notes(path) {
                if !all.contains(&note) {
                    all.push(note);
                }
            }
        }
        all
    }

    /// The names behind the numbers of attributes in the files of the first frame ([`crate::open::value_names`]).
    pub fn value_names(&self) -> Vec<ValueNames> {
        self.inputs(0).into_iter().flat_map(crate::open::value_names).collect()
    }

    /// The files that frame `index` is read from.
    pub fn inputs(&self, index: usize) -> Vec<&Path> {
        let frame = self.frames.get(index);
        let parts = frame.map_or(&[][..], |f| f.parts.as_slice());
        parts.iter().map(|p| p.path.as_path()).collect()
    }

    /// The file of frame `index` if that is one native frame, which can be traced in place.
    pub fn native_file(&self, index: usize) -> Option<&Path> {
        // A file that cannot be opened is reported when it is read.
        let is_native = |path: &&Path| crate::open::is_native(path).unwrap_or(false);
        self.lone_file(index).filter(is_native)
    }

    /// The file of frame `index` if that is all there is of the frame, and nothing else in the file. None with a
    /// topology or a placement, or if vertices of meshes are particles.
    pub fn lone_file(&self, index: usize) -> Option<&Path> {
        let frame = self.frames.get(index)?;
        let [part] = frame.parts.as_slice() else {
            return None;
        };
        let is_whole = self.missing_pieces.check(frame).is_ok();
        let is_alone = self.parts.len() < 2 && part.step.is_none() && is_whole;
        let is_unchanged = self.topology.is_none() && self.placement.is_none() && !self.mesh_points;
        (is_alone && is_unchanged).then_some(&part.path)
    }
}

/// The frames that `steps` make, by number.
fn frames_of(steps: Vec<NumberedStep>) -> Vec<SequenceFrame> {
    let mut by_number = BTreeMap::<i64, Vec<PartFile>>::new();
    for entry in steps {
        by_number.entry(entry.number).or_default().push(entry.file);
    }
    let frames = by_number.into_iter();
    frames.map(|(number, parts)| SequenceFrame { number, parts }).collect()
}

/// The `frames` without some parts; the others are numbered anew.
fn without_parts(frames: &[SequenceFrame], parts: &BTreeSet<u32>) -> Vec<SequenceFrame> {
    let mut frames = frames.to_vec();
    for frame in &mut frames {
        frame.parts.retain(|file| !parts.contains(&file.part));
        for file in &mut frame.parts {
            file.part -= index_u32(parts.range(..file.part).count());
        }
    }
    frames.retain(|frame| !frame.parts.is_empty());
    frames
}

/// Indices of the `parts` that match `name`, see [`Sequence::keep_parts`].
fn parts_meant(parts: &[String], name: &str) -> Vec<u32> {
    let lower = name.to_lowercase();
    let matching = |fits: &dyn Fn(&str) -> bool| -> Vec<u32> {
        let named = (0..).zip(parts);
        let found = named.filter(|(_, part)| fits(&part.to_lowercase()));
        found.map(|(index, _)| index).collect()
    };
    // An exact match wins over names that differ in case only.
    let as_written: Vec<u32> =
        (0..).zip(parts).filter(|(_, part)| *part == name).map(|(index, _)| index).collect();
    let whole = matching(&|part| part == lower);
    match (as_written.is_empty(), whole.is_empty()) {
        (false, _) => as_written,
        (true, false) => whole,
        (true, true) if parts.len() < 2 || lower.is_empty() => Vec::new(),
        (true, true) => matching(&|part| part.contains(&lower)),
    }
}

/// See [`Sequence::is_y_up`].
fn y_is_up(path: &Path) -> bool {
    let Ok(head) = crate::open::head(path) else {
        return false;
    };
    let Ok(format) = crate::detect::detect_format(&head, path) else {
        return false;
    };
    if format == native::FORMAT {
        // The index of a native frame is at its end.
        let file = NativeFile::open(path, Access::Map);
        return file.is_ok_and(|file| file.index().up == UP_Y);
    }
    if format.reader().info().notes_need_whole_file
        && let Ok(map) = MappedFile::open(path)
        && !is_compressed(map.bytes())
    {
        return format.reader().is_y_up(map.bytes());
    }
    format.reader().is_y_up(&head)
}

/// The frame number in the name of a file when there are no others to compare with: what
/// follows the word `frame`, else the last number.
pub fn lone_frame_number(path: &Path) -> Option<i64> {
    let name = FileName::parse(path, None);
    name.numbers.get(name.lone_column()?).copied()
}

#[cfg(test)]
mod tests;
