//! Names to frames, from the names alone.
//!
//! Files whose names differ in numbers only form a *run*. In a run the frame number is the first
//! number that differs between all files; a second one that varies along (a particle count) is
//! ignored. If no number does, but two vary (`Fluid_<object>_<frame>`), the last is the frame and
//! the others split the run. Runs that share at least half of the frame numbers of the smaller
//! one are *parts* of one group (`Fluid_7` with `Oil_7`); others are another sequence. A run of one frame beside one of
//! several, as the initial state of a case, is a part only if users ask for it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::error::{GroupSummary, SequenceError, counted};
use super::name::FileName;
use spherule_readers::compression::strip_extension;

/// The files of one sequence, sorted by number, then part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FileGroup {
    pub files: Vec<GroupFile>,
    /// One name for each part.
    pub parts: Vec<String>,
    /// Parts that occur in one step of several; `None` if there are none.
    pub lone: Option<LoneParts>,
}

/// Parts that are left out unless users name them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct LoneParts {
    /// Their indices.
    pub parts: BTreeSet<u32>,
    /// Names of the other parts, which are those of a group without them.
    pub others: Vec<String>,
    /// Notes about the files that are left out.
    pub notes: Vec<String>,
}

impl LoneParts {
    /// The `parts` with these indices among `files`, whose parts are called `names`.
    fn new(
        parts: BTreeSet<u32>,
        others: Vec<String>,
        files: &[GroupFile],
        names: &[String],
    ) -> Self {
        let note = |part: &u32| {
            let first = files.iter().find(|file| file.part == *part);
            let file = first.and_then(|file| file.path.file_name());
            format!(
                "`{}` is left out, since no other step has a file of this name; --parts {} draws its particles",
                file.unwrap_or_default().to_string_lossy(),
                names.get(*part as usize).map_or("", String::as_str)
            )
        };
        Self { notes: parts.iter().map(note).collect(), parts, others }
    }
}

/// One file and what its name says about its position in the sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct GroupFile {
    pub path: PathBuf,
    pub part: u32,
    /// `None` if the name has no number.
    pub number: Option<i64>,
    /// Number of the file among those of one step, if there are several.
    pub piece: Option<i64>,
}

/// Names that differ in numbers only, with the column that counts frames.
#[derive(Debug, Clone)]
struct NameSeries {
    names: Vec<FileName>,
    column: Option<usize>,
    /// Columns that vary along with the frame.
    free: Vec<usize>,
}

impl NameSeries {
    fn numbers(&self) -> BTreeSet<i64> {
        self.names.iter().filter_map(|n| self.number(n)).collect()
    }

    fn number(&self, name: &FileName) -> Option<i64> {
        self.column.and_then(|c| name.numbers.get(c).copied())
    }

    fn pattern(&self) -> String {
        self.names.first().map(|n| n.pattern(self.column, &self.free)).unwrap_or_default()
    }
}

/// Runs that share frame numbers.
#[derive(Debug, Default)]
struct SequenceCandidate {
    runs: Vec<NameSeries>,
    /// Runs of one frame beside those of several.
    lone: Vec<NameSeries>,
    numbers: BTreeSet<i64>,
}

impl SequenceCandidate {
    fn frames(&self) -> usize {
        self.numbers.len().max(1)
    }

    fn summary(&self) -> GroupSummary {
        let patterns: Vec<String> = self.runs.iter().map(NameSeries::pattern).collect();
        let pattern = match self.runs.as_slice() {
            // A file by itself is named: which of its numbers counts frames is a guess.
            [run] if run.names.len() == 1 => run.names[0].pattern(None, &[]),
            _ => common_pattern(&patterns),
        };
        GroupSummary {
            pattern,
            frames: self.frames(),
            files: self.runs.iter().map(|r| r.names.len()).sum(),
        }
    }
}

/// The one sequence among the `names` of a directory, or of those that fit a pattern.
///
/// A sequence with at least four times the frames of every other one is taken and the others
/// are noted; so are files without a number beside two numbered frames or more. Anything closer is
/// [`SequenceError::Ambiguous`]: rendering the wrong half of a directory would be worse.
pub(super) fn pick(
    directory: &std::path::Path,
    names: Vec<FileName>,
    notes: &mut Vec<String>,
) -> Result<FileGroup, SequenceError> {
    const CLEARLY_MORE: usize = 4;
    // Group the names, the longest sequence first
    let mut by_extension = BTreeMap::<String, Vec<FileName>>::new();
    for name in names {
        by_extension.entry(name.extension.clone()).or_default().push(name);
    }
    let mut candidates: Vec<SequenceCandidate> =
        by_extension.into_values().flat_map(candidates).collect();
    let weight = |c: &SequenceCandidate| (!c.numbers.is_empty(), c.frames());
    candidates.sort_by_key(|c| std::cmp::Reverse(weight(c)));
    let Some((first, others)) = candidates.split_first() else {
        return Err(SequenceError::NoInput);
    };
    // Refuse to guess between sequences of similar length
    let is_minor = |c: &SequenceCandidate| {
        let unnumbered = c.numbers.is_empty() && first.numbers.len() > 1;
        unnumbered || c.frames() * CLEARLY_MORE <= first.frames()
    };
    if !others.iter().all(is_minor) {
        return Err(SequenceError::Ambiguous {
            path: directory.to_owned(),
            groups: candidates.iter().map(SequenceCandidate::summary).collect(),
        });
    }
    // Report what is left out
    for other in others.iter().map(SequenceCandidate::summary) {
        notes.push(format!("`{}` ({}) is left out", other.pattern, counted(&other)));
    }
    into_group(candidates.swap_remove(0))
}

/// The sequence that listed files make: parts if they share frame numbers, else by number, else
/// in the order given. Nothing is left out.
pub(super) fn listed(
    names: Vec<FileName>,
    notes: &mut Vec<String>,
) -> Result<FileGroup, SequenceError> {
    // Find the series of names; those of a single frame count like the others
    let order: Vec<PathBuf> = names.iter().map(|n| n.path.clone()).collect();
    let mut candidates = candidates(names);
    for candidate in &mut candidates {
        candidate.runs.append(&mut candidate.lone);
    }
    if candidates.len() == 1 && (order.len() == 1 || !candidates[0].numbers.is_empty()) {
        return into_group(candidates.swap_remove(0));
    }
    note_mixed_formats(&order, notes);
    // Take the frame numbers of the names, if they are distinct
    let numbered: BTreeMap<i64, PathBuf> = candidates
        .iter()
        .flat_map(|c| &c.runs)
        .flat_map(|run| {
            run.names.iter().filter_map(|n| run.number(n).map(|number| (number, n.path.clone())))
        })
        .collect();
    let files: Vec<(i64, PathBuf)> = if numbered.len() == order.len() {
        numbered.into_iter().collect()
    } else {
        notes.push(
            "the names do not number the files: frames are numbered from 0 in the order given"
                .to_owned(),
        );
        (0..).zip(order).collect()
    };
    let files = files.into_iter().map(|(number, path)| GroupFile {
        path,
        part: 0,
        number: Some(number),
        piece: None,
    });
    Ok(FileGroup { files: files.collect(), parts: vec![String::new()], lone: None })
}

/// Notes listed files of several formats: these are seldom frames of one simulation.
fn note_mixed_formats(paths: &[PathBuf], notes: &mut Vec<String>) {
    // Find the extensions, without those of compression
    let extension = |path: &PathBuf| {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let extension = strip_extension(&name).rsplit_once('.')?.1;
        Some(extension.to_owned())
    };
    let extensions: BTreeSet<String> = paths.iter().filter_map(extension).collect();
    let is_topology =
        |path: &&PathBuf| matches!(extension(path).as_deref(), Some("psf" | "prmtop" | "parm7"));
    let topology = paths.iter().find(is_topology);
    if extensions.len() < 2 {
        return;
    }
    // A topology among them was probably meant for --topology
    let names: Vec<String> = extensions.into_iter().map(|e| format!(".{e}")).collect();
    notes.push(match topology {
        Some(path) => format!(
            "`{}` is a topology, not a frame; give it with --topology instead",
            path.display()
        ),
        None => format!(
            "files of several formats ({}) are used as frames of one sequence",
            names.join(", ")
        ),
    });
}

/// Runs of `names`, joined where they share frame numbers.
fn candidates(names: Vec<FileName>) -> Vec<SequenceCandidate> {
    // Group names that differ in numbers only, the longest run first
    let mut by_text = BTreeMap::<Vec<String>, Vec<FileName>>::new();
    for name in names {
        by_text.entry(name.literals.clone()).or_default().push(name);
    }
    let mut runs: Vec<NameSeries> = by_text.into_values().flat_map(runs).collect();
    runs.sort_by_key(|run| std::cmp::Reverse(run.names.len()));
    let mut candidates: Vec<SequenceCandidate> = Vec::new();
    // Candidates that have a frame number: only those can share it.
    let mut homes = BTreeMap::<i64, BTreeSet<usize>>::new();
    for run in runs {
        // Find a candidate that shares at least half of the frame numbers of the shorter one of both
        let numbers = run.numbers();
        let mut shared = BTreeMap::<usize, usize>::new();
        for home in numbers.iter().filter_map(|n| homes.get(n)).flatten() {
            *shared.entry(*home).or_default() += 1;
        }
        let home = shared.into_iter().find(|(home, shared)| {
            let most = numbers.len().min(candidates[*home].numbers.len());
            shared * 2 >= most
        });
        let home = home.map_or(candidates.len(), |(home, _)| home);
        if home == candidates.len() {
            candidates.push(SequenceCandidate::default());
        }
        // Add the run; one that has a single frame is kept apart
        for number in &numbers {
            homes.entry(*number).or_default().insert(home);
        }
        let candidate = &mut candidates[home];
        let is_lone = numbers.len() == 1 && candidate.numbers.len() > 1;
        candidate.numbers.extend(numbers);
        if is_lone {
            candidate.lone.push(run);
        } else {
            candidate.runs.push(run);
        }
    }
    candidates
}

/// Finds the frame column of names that differ in numbers only, see the module's head.
fn runs(names: Vec<FileName>) -> Vec<NameSeries> {
    let given = names.first().and_then(|n| n.frame_column);
    let columns = names.first().map_or(0, |n| n.numbers.len());
    // Find the numbers that differ, and the one that counts frames
    let values =
        |column: usize| -> BTreeSet<i64> { names.iter().map(|n| n.numbers[column]).collect() };
    let varying: Vec<usize> = (0..columns).filter(|c| values(*c).len() > 1).collect();
    // Files of one step count once
    let least = names.iter().filter_map(|name| name.piece).min();
    let firsts = names.iter().filter(|name| name.piece == least).count();
    let distinct = |column: usize| values(column).len() == firsts;
    let column = given
        .or_else(|| varying.iter().copied().find(|c| distinct(*c)))
        .or_else(|| varying.last().copied())
        .or_else(|| names.first().and_then(FileName::lone_column));
    // Divide the names by the other numbers
    let free: Vec<usize> = varying.into_iter().filter(|c| Some(*c) != column).collect();
    if free.is_empty() || column.is_some_and(distinct) {
        return vec![NameSeries { names, column, free }];
    }
    let mut split = BTreeMap::<Vec<i64>, Vec<FileName>>::new();
    for name in names {
        let key = free.iter().map(|c| name.numbers[*c]).collect();
        split.entry(key).or_default().push(name);
    }
    let run = |names| NameSeries { names, column, free: Vec::new() };
    split.into_values().map(run).collect()
}

fn into_group(candidate: SequenceCandidate) -> Result<FileGroup, SequenceError> {
    // Order the runs by their patterns, which name the parts
    let mut others: Vec<String> = candidate.runs.iter().map(NameSeries::pattern).collect();
    others.sort();
    let lone = candidate.lone.into_iter().map(|run| (run, true));
    let mut runs: Vec<(NameSeries, bool)> =
        candidate.runs.into_iter().map(|run| (run, false)).chain(lone).collect();
    runs.sort_by_cached_key(|(run, _)| run.pattern());
    let patterns: Vec<String> = runs.iter().map(|(run, _)| run.pattern()).collect();
    let lone: BTreeSet<u32> =
        (0..).zip(&runs).filter(|(_, (_, is_lone))| *is_lone).map(|(part, _)| part).collect();
    // Order the files by frame, part and piece
    let mut files: Vec<GroupFile> = Vec::new();
    for (part, (run, _)) in (0..).zip(&runs) {
        files.extend(run.names.iter().map(|name| GroupFile {
            path: name.path.clone(),
            part,
            number: run.number(name),
            piece: name.piece,
        }));
    }
    files.sort_by(|a, b| {
        let key = |file: &GroupFile| (file.number, file.part, file.piece);
        (key(a), &a.path).cmp(&(key(b), &b.path))
    });
    // Refuse two files for the same place
    for pair in files.windows(2) {
        if let [a, b] = pair
            && a.number == b.number
            && a.part == b.part
            && a.piece == b.piece
        {
            return Err(SequenceError::Duplicate {
                number: a.number.unwrap_or(0),
                first: a.path.clone(),
                second: b.path.clone(),
            });
        }
    }
    // Name the parts
    let parts = part_names(&patterns);
    let lone =
        (!lone.is_empty()).then(|| LoneParts::new(lone, part_names(&others), &files, &parts));
    Ok(FileGroup { files, parts, lone })
}

/// The parts of the names that differ between patterns: `Fluid` and `Oil` of `ParticleData_Fluid_#.vtk` and
/// `ParticleData_Oil_#.vtk`. The whole pattern where nothing short does.
fn part_names(patterns: &[String]) -> Vec<String> {
    if patterns.len() < 2 {
        return vec![String::new(); patterns.len()];
    }
    let (start, end) = common_ends(patterns);
    let middle = |p: &String| p[start..p.len() - end].trim_matches(SEPARATORS).to_owned();
    let names: Vec<String> = patterns.iter().map(middle).collect();
    let distinct: BTreeSet<&String> = names.iter().collect();
    if names.iter().any(String::is_empty) || distinct.len() < names.len() {
        return patterns.to_vec();
    }
    names
}

const SEPARATORS: [char; 5] = ['_', '-', '.', ' ', '#'];

/// One pattern for all: what is common at the ends with `*` between.
fn common_pattern(patterns: &[String]) -> String {
    match patterns {
        [] => String::new(),
        [one] => one.clone(),
        [first, ..] => {
            let (start, end) = common_ends(patterns);
            format!("{}*{}", &first[..start], &first[first.len() - end..])
        }
    }
}

/// Lengths of the common start and end of all `texts`, cut back to separators and not
/// overlapping in any.
fn common_ends(texts: &[String]) -> (usize, usize) {
    let Some((first, others)) = texts.split_first() else {
        return (0, 0);
    };
    let start_with = |other: &String| {
        let same = first.chars().zip(other.chars()).take_while(|(a, b)| a == b);
        same.map(|(a, _)| a.len_utf8()).sum::<usize>()
    };
    let shared = others.iter().map(start_with).min().unwrap_or(first.len());
    let start = first[..shared].rfind(SEPARATORS).map_or(0, |i| i + 1);
    let end_with = |other: &String| {
        let tails = first[start..].chars().rev().zip(other[start..].chars().rev());
        let same = tails.take_while(|(a, b)| a == b);
        same.map(|(a, _)| a.len_utf8()).sum::<usize>()
    };
    let end = others.iter().map(end_with).min().unwrap_or(0);
    let tail = &first[first.len() - end..];
    let end = tail.find(SEPARATORS).map_or(0, |i| tail.len() - i);
    (start, end)
}

#[cfg(test)]
mod tests;
