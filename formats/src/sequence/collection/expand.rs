//! Follows lists of files to the files of particles, and makes time steps of them.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::super::group::{FileGroup, GroupFile};
use super::super::{ListPlace, NumberedStep, PartFile, SequenceError, SequenceSettings};
use super::entry::{List, ListEntry, ListKind, label};
use super::parts::{PartKey, PartTable, stem_of};
use super::paths::ListRoot;
use super::{ListSummary, is_list, stands_for_blocks};
use crate::{FrameError, ParseError};

/// Most lists that list one another in a chain.
const MAX_DEPTH: usize = 16;

/// Most entries that are followed in all lists together, and so most files of a sequence that is made of lists. Each
/// list is followed once for each time step that lists it, which would take time without end, with files or without.
const MAX_ENTRIES: usize = 1 << 22;

/// The time steps that lists of files make.
#[derive(Debug)]
pub(in crate::sequence) struct Expansion {
    pub(in crate::sequence) steps: Vec<NumberedStep>,
    /// Names of the parts.
    pub(in crate::sequence) parts: Vec<String>,
    pub(in crate::sequence) lists: ListedFiles,
}

/// What a sequence keeps of its lists.
#[derive(Debug)]
pub(in crate::sequence) struct ListedFiles {
    pub(in crate::sequence) summary: ListSummary,
    /// The lists that were read, by name.
    pub(in crate::sequence) paths: Vec<PathBuf>,
    /// Simulation times of steps, by their numbers.
    pub(in crate::sequence) times: BTreeMap<i64, f64>,
    /// Lists that cannot be used, which stand among the files of their steps.
    pub(in crate::sequence) faults: BTreeMap<PathBuf, ParseError>,
}

/// Expands the lists among the files of `group`.
///
/// A single list may have many time steps, which are numbered from 0 in the order of their times. Of several lists,
/// each is a part of a time step, or a time step, as its name says.
///
/// # Errors
/// [`SequenceError`] if the only list cannot be read, if files are outside the directory of their list, if there are
/// too many, or if one of several lists has several time steps.
pub(in crate::sequence) fn expand(
    group: &FileGroup,
    settings: SequenceSettings,
    notes: &mut Vec<String>,
) -> Result<Expansion, SequenceError> {
    let mut expander = Expander::new(settings);
    let is_only = group.files.len() == 1;
    // Follow each list to the files of particles, and number their time steps
    let mut numbers = Vec::new();
    let mut times = BTreeMap::new();
    let mut kind = None;
    for file in &group.files {
        let first = expander.leaves.len();
        let found = expander.expand(file, is_only)?;
        kind = kind.or(found);
        let leaves = expander.leaves.get(first..).unwrap_or_default();
        number(file, found, leaves, is_only, (&mut numbers, &mut times))?;
    }
    expander.note_ghosts(notes);
    if expander.repeated > 0 {
        let count = expander.repeated;
        notes.push(format!(
            "{count} lists of files are listed twice for one time step and used once"
        ));
    }
    // Sort the files by time step and part
    let Expander { leaves, lists, parts, faults, .. } = expander;
    let mut paths: Vec<PathBuf> = lists.into_keys().collect();
    paths.sort();
    let used = leaves.iter().zip(&numbers).map(|(leaf, number)| (*number, leaf.part));
    let (of_number, names) = parts.finish(used, &group.parts);
    let mut steps = numbered_steps(leaves, numbers, &of_number);
    drop_repeated(&mut steps, notes);
    // Summarise what was found
    let step_count = steps.chunk_by(|a, b| a.number == b.number).count();
    let ends = times.values().next().zip(times.values().next_back());
    let summary = ListSummary {
        kind: kind.map_or("list of files", ListKind::name),
        list_count: group.files.len(),
        step_count,
        file_count: steps.len(),
        times: ends.map(|(first, last)| (*first, *last)),
    };
    notes.push(summary.to_string());
    Ok(Expansion { steps, parts: names, lists: ListedFiles { summary, paths, times, faults } })
}

/// The files in the order of their time steps and parts; `parts` has the part of each number in the table of parts.
fn numbered_steps(leaves: Vec<Leaf>, numbers: Vec<i64>, parts: &[u32]) -> Vec<NumberedStep> {
    let mut steps: Vec<NumberedStep> = leaves
        .into_iter()
        .zip(numbers)
        .map(|(leaf, number)| NumberedStep {
            number,
            file: PartFile {
                path: leaf.path,
                part: parts.get(leaf.part as usize).copied().unwrap_or(0),
                step: None,
                listed: leaf.listed,
            },
        })
        .collect();
    steps.sort_by_key(|step| (step.number, step.file.part));
    steps
}

/// A file of particles that a list names.
#[derive(Debug)]
struct Leaf {
    path: PathBuf,
    time: Option<f64>,
    /// Number in the table of parts.
    part: u32,
    listed: Option<ListPlace>,
}

/// What the lists on the way to a file say about it.
#[derive(Debug, Clone, Default)]
struct LeafContext {
    time: Option<f64>,
    part: PartKey,
    listed: Option<ListPlace>,
}

impl LeafContext {
    /// The context of `entry`, number `index` of `list` at `path`. What outer lists say goes before.
    fn of(&self, list: &List, path: &Arc<Path>, index: usize, entry: &ListEntry) -> Self {
        let mut part = self.part.clone();
        match list.kind {
            ListKind::Collection | ListKind::Series => {
                if part.stem.is_empty() {
                    part.stem = stem_of(&entry.path);
                    part.label = entry.part.clone();
                }
            }
            ListKind::Blocks if part.blocks.is_empty() => part.blocks.clone_from(&entry.part.name),
            ListKind::Blocks => part.blocks = label(format!("{}/{}", part.blocks, entry.part.name)),
            ListKind::Pieces => part.piece = part.piece.or(u32::try_from(index).ok()),
        }
        Self {
            time: self.time.or(entry.time),
            part,
            listed: Some(ListPlace { list: Arc::clone(path), line: entry.place.line }),
        }
    }
}

/// A list that was read, with its path.
struct OpenedList {
    path: Arc<Path>,
    list: List,
}

struct Expander {
    settings: SequenceSettings,
    root: ListRoot,
    /// Lists that were read.
    lists: HashMap<PathBuf, Arc<OpenedList>>,
    leaves: Vec<Leaf>,
    parts: PartTable,
    faults: BTreeMap<PathBuf, ParseError>,
    /// Bytes of `leaves` and `lists`.
    held: u64,
    /// Entries that were followed.
    entries: usize,
    /// Lists that were followed for the file that is expanded, with their times.
    followed: HashSet<(Arc<Path>, Option<u64>)>,
    /// Number of entries that were left out because their lists are in `followed`.
    repeated: usize,
    /// A list whose pieces share points.
    has_ghosts: Option<Arc<Path>>,
}

impl Expander {
    fn new(settings: SequenceSettings) -> Self {
        Self {
            settings,
            root: ListRoot::of(Path::new(""), false),
            lists: HashMap::new(),
            leaves: Vec::new(),
            parts: PartTable::default(),
            faults: BTreeMap::new(),
            held: 0,
            entries: 0,
            followed: HashSet::new(),
            repeated: 0,
            has_ghosts: None,
        }
    }

    /// Adds the files that `file` lists, or the file itself if it is none. Returns the kind of the list.
    fn expand(
        &mut self,
        file: &GroupFile,
        is_only: bool,
    ) -> Result<Option<ListKind>, SequenceError> {
        self.root = ListRoot::of(&file.path, self.settings.follow_links);
        let context = LeafContext {
            part: PartKey { group: file.part, ..PartKey::default() },
            ..LeafContext::default()
        };
        if !(is_list(&file.path) || stands_for_blocks(&file.path)) {
            self.push(file.path.clone(), &context)?;
            return Ok(None);
        }
        let Some(opened) = self.list(&file.path) else {
            // Of several lists, one that cannot be used costs its frames
            if is_only {
                return Err(SequenceError::List(self.fault_of(&file.path)));
            }
            self.push(file.path.clone(), &context)?;
            return Ok(None);
        };
        self.followed.clear();
        self.follow(&opened, &context, &mut Vec::new())?;
        Ok(Some(opened.list.kind))
    }

    /// Adds the files of `opened`. `chain` has the lists on the way to it.
    fn follow(
        &mut self,
        opened: &OpenedList,
        context: &LeafContext,
        chain: &mut Vec<Arc<Path>>,
    ) -> Result<(), SequenceError> {
        chain.push(Arc::clone(&opened.path));
        for (index, entry) in opened.list.entries.iter().enumerate() {
            // Find the file, inside the directory of the first list unless the user allows others
            let target = self.root.resolve(&opened.path, &entry.path).ok_or_else(|| {
                SequenceError::Outside {
                    list: opened.path.to_path_buf(),
                    line: entry.place.line,
                    file: entry.path.clone(),
                }
            })?;
            let context = context.of(&opened.list, &opened.path, index, entry);
            self.count_entry(opened)?;
            // Add files of particles, and follow lists
            if !is_list(&target) {
                self.push(target, &context)?;
            } else if let Some(what) = fault_of_chain(chain, &target) {
                // The list at the end of the chain is at fault: `target` itself can be fine.
                let fault = entry.place.malformed(what);
                let list = opened.path.to_path_buf();
                self.faults.entry(list.clone()).or_insert(fault);
                self.push(list, &context)?;
            } else if let Some(inner) = self.list(&target) {
                let time = context.time.map(f64::to_bits);
                if self.followed.insert((Arc::clone(&inner.path), time)) {
                    self.held += size_of::<(Arc<Path>, Option<u64>)>() as u64;
                    self.follow(&inner, &context, chain)?;
                } else {
                    self.repeated += 1;
                }
            } else {
                self.push(target, &context)?;
            }
        }
        chain.pop();
        Ok(())
    }

    /// Counts an entry of `opened` that is followed.
    fn count_entry(&mut self, opened: &OpenedList) -> Result<(), SequenceError> {
        self.entries += 1;
        if self.entries <= MAX_ENTRIES {
            return Ok(());
        }
        let what = format!(
            "it and the lists in it have more than {MAX_ENTRIES} entries; give a part of them"
        );
        let error = ParseError::too_large(what).in_file(&opened.path);
        Err(SequenceError::List(error))
    }

    /// The list at `path`; `None` if it cannot be read. Then its fault is noted, unless it is an error of the operating
    /// system, which loading the step gives again.
    fn list(&mut self, path: &Path) -> Option<Arc<OpenedList>> {
        if let Some(opened) = self.lists.get(path) {
            return Some(Arc::clone(opened));
        }
        if self.faults.contains_key(path) {
            return None;
        }
        match List::open(path, self.settings.budget.less(self.held)) {
            // Count its memory, and remember a list with ghost cells for a note
            Ok(list) => {
                let texts = list.entries.iter().map(|e| e.path.len() + size_of::<ListEntry>());
                self.held += texts.sum::<usize>() as u64;
                let opened = Arc::new(OpenedList { path: path.into(), list });
                if opened.list.ghost_level > 0 && self.has_ghosts.is_none() {
                    self.has_ghosts = Some(Arc::clone(&opened.path));
                }
                self.lists.insert(path.to_owned(), Arc::clone(&opened));
                Some(opened)
            }
            Err(error) => {
                if let Some(fault) = parse_error(error) {
                    self.faults.insert(path.to_owned(), fault);
                }
                None
            }
        }
    }

    /// Why the list at `path` could not be read.
    fn fault_of(&mut self, path: &Path) -> FrameError {
        match self.faults.remove(path) {
            Some(fault) => fault.in_file(path),
            None => match List::open(path, self.settings.budget) {
                Err(error) => error,
                Ok(_) => FrameError::io(path, std::io::Error::other("it changed; try again")),
            },
        }
    }

    fn push(&mut self, path: PathBuf, context: &LeafContext) -> Result<(), SequenceError> {
        // `Sequence` makes a list of its own, and so does its caller.
        let need = 3 * (path.as_os_str().len() + size_of::<Leaf>() + size_of::<NumberedStep>());
        self.held += need as u64;
        let budget = self.settings.budget;
        let fits = budget.check(self.held, "the list of its files is");
        fits.map_err(|e| {
            let list = context.listed.as_ref().map_or(&*path, |place| &place.list);
            SequenceError::List(e.in_file(list))
        })?;
        let part = self.parts.number(&context.part);
        self.leaves.push(Leaf { path, time: context.time, part, listed: context.listed.clone() });
        Ok(())
    }

    fn note_ghosts(&self, notes: &mut Vec<String>) {
        if let Some(list) = &self.has_ghosts {
            notes.push(spherule_files::one_line(format!(
                "{}: its pieces share points (GhostLevel), which are used from each piece",
                list.display()
            )));
        }
    }
}

/// Why `target` must not be followed, if `chain` are the lists on the way to it.
fn fault_of_chain(chain: &[Arc<Path>], target: &Path) -> Option<String> {
    if chain.len() >= MAX_DEPTH {
        let remedy = "list the files of particles directly";
        return Some(format!("more than {MAX_DEPTH} lists of files in one another; {remedy}"));
    }
    let is_cycle = chain.iter().any(|list| **list == *target);
    is_cycle.then(|| {
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        if chain.last().is_some_and(|last| **last == *target) {
            "the file lists itself; remove this entry".to_owned()
        } else {
            format!("it lists `{name}`, which lists this file: a cycle; remove one of the two")
        }
    })
}

/// The fault in the bytes of a list; `None` for an error of the operating system.
fn parse_error(error: FrameError) -> Option<ParseError> {
    match error {
        FrameError::Malformed { at, what, .. } => Some(ParseError::Malformed { at, what }),
        FrameError::Unsupported { what, .. } => Some(ParseError::Unsupported { what }),
        FrameError::TooLarge { what, .. } => Some(ParseError::TooLarge { what }),
        FrameError::Io { .. } => None,
    }
}

/// Numbers the steps of the files that `file` lists, and notes their times.
fn number(
    file: &GroupFile,
    kind: Option<ListKind>,
    leaves: &[Leaf],
    is_only: bool,
    (numbers, step_times): (&mut Vec<i64>, &mut BTreeMap<i64, f64>),
) -> Result<(), SequenceError> {
    // Find the distinct times of the files
    let mut times: Vec<f64> = leaves.iter().filter_map(|leaf| leaf.time).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    // From 0 with one step, too: a collection may still grow
    let is_counted = is_only && kind.is_some_and(ListKind::has_times);
    // A single time is one step, with the number in the name
    if times.len() < 2 {
        let named = file.number.filter(|_| !is_counted);
        let number = named.unwrap_or(0);
        numbers.extend(leaves.iter().map(|_| number));
        step_times.extend(times.first().map(|time| (number, *time)));
        return Ok(());
    }
    // Several times are steps of one list, numbered in the order of their times
    if !is_only {
        return Err(SequenceError::SeveralLists { path: file.path.clone(), steps: times.len() });
    }
    let place = |leaf: &Leaf| {
        let time = leaf.time.unwrap_or_default();
        let place = times.partition_point(|other| *other < time);
        i64::try_from(place).unwrap_or(i64::MAX)
    };
    numbers.extend(leaves.iter().map(place));
    step_times.extend((0..).zip(times.iter().copied()));
    Ok(())
}

/// Drops files that are there twice in one step. `steps` are sorted by number.
fn drop_repeated(steps: &mut Vec<NumberedStep>, notes: &mut Vec<String>) {
    let mut kept = Vec::with_capacity(steps.len());
    let before = steps.len();
    let mut seen = BTreeSet::new();
    let mut current = None;
    for step in std::mem::take(steps) {
        if current.replace(step.number) != Some(step.number) {
            seen.clear();
        }
        if seen.insert(step.file.path.clone()) {
            kept.push(step);
        }
    }
    *steps = kept;
    let dropped = before - steps.len();
    if dropped > 0 {
        notes.push(format!("{dropped} files are listed twice for one time step and used once"));
    }
}
