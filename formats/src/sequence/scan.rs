//! Directory listings, and the steps inside files that hold several.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::collection::{has_list_name, has_timed_name};
use super::group::GroupFile;
use super::name::FileName;
use super::pattern::Pattern;
use super::{NumberedStep, PartFile, SequenceError};
use crate::MemoryBudget;
use crate::detect::ADIOS;
use crate::open::{FrameFile, detect_file};
use crate::read::Step;
use spherule_readers::Format;

/// The particle files of a directory. Pictures, notes, hidden and unfinished files are passed
/// over by name; only where no name is known are the files looked into.
pub(super) fn directory(path: &Path) -> Result<Vec<FileName>, SequenceError> {
    let files = list(path)?;
    // Known names first, then lists of files
    let known = files.iter().filter(|f| crate::registry::by_name(f).is_some());
    let mut names: Vec<FileName> = known.map(|f| FileName::parse(f, None)).collect();
    if names.is_empty() {
        names = lists_among(&files);
    }
    // Then look into all files
    let mut refusal = None;
    if names.is_empty() {
        for file in &files {
            match detect_file(file) {
                Ok(_) => names.push(FileName::parse(file, None)),
                Err(e @ crate::FrameError::Unsupported { .. }) if refusal.is_none() => {
                    refusal = Some(e.to_string());
                }
                Err(_) => {}
            }
        }
    }
    // Say what is there instead, for the error
    if names.is_empty() {
        let refusal = is_adios(&files).then(|| ADIOS.to_owned()).or(refusal);
        return Err(SequenceError::NoFrames {
            path: path.to_owned(),
            found: refusal.unwrap_or_else(|| what_is_there(path, &files)),
        });
    }
    Ok(names)
}

/// Whether `files` are those of a directory that ADIOS2 writes.
fn is_adios(files: &[PathBuf]) -> bool {
    let has = |name: &str| files.iter().any(|file| file.file_name().is_some_and(|n| n == name));
    has("md.idx") && has("data.0")
}

/// The lists of files in a directory without particle files: the only one with times, else all.
fn lists_among(files: &[PathBuf]) -> Vec<FileName> {
    let timed: Vec<&PathBuf> = files.iter().filter(|f| has_timed_name(f)).collect();
    let lists = match timed.as_slice() {
        [only] => vec![*only],
        _ => files.iter().filter(|f| has_list_name(f)).collect(),
    };
    lists.into_iter().map(|f| FileName::parse(f, None)).collect()
}

/// The files that fit `pattern`; those with a known name if any has one.
pub(super) fn fitting(pattern: &Pattern, text: &Path) -> Result<Vec<FileName>, SequenceError> {
    let files = list(&pattern.directory)?;
    let fit = |path: &PathBuf| {
        let name = path.file_name()?.to_string_lossy();
        let fit = pattern.fit(&name)?;
        Some(FileName::parse(path, fit.number))
    };
    let mut names: Vec<FileName> = files.iter().filter_map(fit).collect();
    if names.is_empty() {
        return Err(SequenceError::NoMatch {
            pattern: text.display().to_string(),
            found: closest(text, &pattern.directory, &files),
        });
    }
    if names.iter().any(|n| crate::registry::by_name(&n.path).is_some()) {
        names.retain(|n| crate::registry::by_name(&n.path).is_some());
    }
    Ok(names)
}

impl SequenceError {
    /// The file `path` does not exist. The error names similar files in its directory.
    pub fn missing(path: &Path) -> Self {
        let hint = similar(path).unwrap_or_default();
        Self::Missing { path: path.to_owned(), hint }
    }
}

/// Files that are neither hidden nor unfinished, in the order of their names.
fn list(path: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let io = |source: std::io::Error| match source.kind() {
        std::io::ErrorKind::NotFound => {
            SequenceError::Missing { path: path.to_owned(), hint: String::new() }
        }
        _ => SequenceError::Io { path: path.to_owned(), source },
    };
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(io)? {
        let file = entry.map_err(io)?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let unfinished = [".part", ".tmp", ".partial", ".swp", "~"];
        let skipped = name.starts_with('.') || unfinished.iter().any(|end| name.ends_with(end));
        if !skipped && file.is_file() {
            files.push(file);
        }
    }
    files.sort();
    Ok(files)
}

/// Describes a directory without particle files, by extension.
fn what_is_there(path: &Path, files: &[PathBuf]) -> String {
    // Suggest directories, which are probably those with the particles
    let mut directories: Vec<String> = fs::read_dir(path)
        .into_iter()
        .flatten()
        .flatten()
        .filter(|e| e.path().is_dir())
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .filter(|name| !name.starts_with('.'))
        .collect();
    directories.sort();
    if !directories.is_empty() {
        directories.truncate(6);
        let names = directories.join("`, `");
        return format!("it has the directories `{names}`; give one of them");
    }
    if files.is_empty() {
        return "the directory is empty".to_owned();
    }
    // Otherwise name the most frequent extensions
    let mut kinds = BTreeMap::<String, usize>::new();
    for file in files {
        let extension = file.extension().unwrap_or_default().to_string_lossy();
        *kinds.entry(extension.into_owned()).or_default() += 1;
    }
    let mut kinds: Vec<(String, usize)> = kinds.into_iter().collect();
    kinds.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    kinds.truncate(4);
    let texts: Vec<String> = kinds
        .iter()
        .map(|(kind, count)| match kind.as_str() {
            "" => format!("{count} without extension"),
            kind => format!("{count} .{kind}"),
        })
        .collect();
    format!("it has {}", texts.join(", "))
}

/// The three names of `files` most similar to `missing`, as a clause.
fn closest(missing: &Path, directory: &Path, files: &[PathBuf]) -> String {
    if files.is_empty() {
        return format!("`{}` has no files", directory.display());
    }
    let missing = name_of(missing);
    let mut names: Vec<String> = files.iter().map(|f| name_of(f)).collect();
    names.sort_by_key(|name| std::cmp::Reverse(likeness(name, &missing)));
    names.truncate(3);
    format!("closest of {} files in `{}`: {}", files.len(), directory.display(), names.join(", "))
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Number of characters that two names have in common at the start and at the end.
fn likeness(a: &str, b: &str) -> usize {
    let start = a.chars().zip(b.chars()).take_while(|(a, b)| a == b).count();
    let end = a.chars().rev().zip(b.chars().rev()).take_while(|(a, b)| a == b).count();
    // `aaa` is as long as its common start and end with `aa`
    (start + end).min(a.chars().count().min(b.chars().count()))
}

/// Up to three names in the directory of `missing` that may have been meant, as a clause: those that have two thirds of
/// their characters in common with it. Directories and files with the name of a particle format come first.
fn similar(missing: &Path) -> Option<String> {
    let directory = match missing.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let name = name_of(missing);
    // Compare the names of its directory, and prefer those that can be opened
    let mut found = Vec::new();
    for entry in fs::read_dir(directory).ok()? {
        let path = entry.ok()?.path();
        let other = name_of(&path);
        let alike = likeness(&name, &other);
        let length = name.chars().count().max(other.chars().count());
        if !other.starts_with('.') && 3 * alike >= 2 * length {
            let is_input = path.is_dir() || crate::registry::by_name(&path).is_some();
            found.push((!is_input, std::cmp::Reverse(alike), other));
        }
    }
    found.sort();
    found.truncate(3);
    let names: Vec<String> = found.into_iter().map(|(.., name)| name).collect();
    let place = directory.display();
    (!names.is_empty()).then(|| format!("; closest in `{place}`: {}", names.join(", ")))
}

/// Opens files that may hold several steps and numbers every step: by the number written in the
/// file where all have one, else by counting from 0 in the order of the files.
///
/// Files with one step each keep the number of their name. Then not all are opened, which on a
/// long sequence would mean reading all of it: only the first, the last, and those half as large
/// again as any scanned to hold one step. Loading checks the rest.
pub(super) fn number_steps(
    files: Vec<GroupFile>,
    budget: MemoryBudget,
    notes: &mut Vec<String>,
) -> (Vec<NumberedStep>, Option<FrameFile>) {
    // Look for a file with several steps among those that may have them
    let lone = files.len() == 1;
    let mut scan = StepScan { budget, ..StepScan::default() };
    let several = files.iter().enumerate().any(|(i, f)| {
        may_hold_many(&f.path) && scan.is_suspect(&files, i) && scan.steps(i, &f.path).len() > 1
    });
    // Without one, names number the files; a lone file may have a number inside
    if !several {
        let own = |index: usize| match scan.scanned.get(&index).map(Vec::as_slice) {
            Some([step]) if lone => step.number,
            _ => None,
        };
        let numbered = files.iter().enumerate().map(|(index, f)| NumberedStep {
            number: own(index).or(f.number).unwrap_or(0),
            file: PartFile { path: f.path.clone(), part: f.part, step: None, listed: None },
        });
        return (numbered.collect(), scan.last);
    }
    // Otherwise each step is an entry of its own
    let mut entries: Vec<(Option<i64>, PartFile)> = Vec::new();
    for (index, file) in files.iter().enumerate() {
        for (at, step) in scan.steps(index, &file.path).iter().enumerate() {
            let part_file =
                PartFile { path: file.path.clone(), part: file.part, step: Some(at), listed: None };
            entries.push((step.number, part_file));
        }
    }
    (number_entries(entries, notes), scan.last)
}

/// Numbers steps; of two with the same number in one part the later is kept, as a restarted
/// run repeats its first step.
fn number_entries(
    entries: Vec<(Option<i64>, PartFile)>,
    notes: &mut Vec<String>,
) -> Vec<NumberedStep> {
    // Use the written numbers only if all steps have one
    let written = entries.iter().all(|(number, _)| number.is_some());
    let mut counts = BTreeMap::<u32, i64>::new();
    let mut numbered = BTreeMap::<(i64, u32), PartFile>::new();
    let mut repeated = Vec::new();
    for (number, file) in entries {
        let count = counts.entry(file.part).or_default();
        let number = number.filter(|_| written).unwrap_or(*count);
        *count += 1;
        if numbered.insert((number, file.part), file).is_some() {
            repeated.push(number);
        }
    }
    if !repeated.is_empty() {
        notes.push(format!(
            "steps {} occur more than once; the last of each is used",
            super::notes::ranges(&repeated)
        ));
    }
    let entry = |((number, _), file)| NumberedStep { number, file };
    numbered.into_iter().map(entry).collect()
}

fn may_hold_many(path: &Path) -> bool {
    let named = crate::registry::by_name(path).filter(|f| !f.may_hold_many_steps());
    named.or_else(|| detect_file(path).ok()).is_some_and(Format::may_hold_many_steps)
}

#[derive(Default)]
struct StepScan {
    scanned: BTreeMap<usize, Vec<Step>>,
    /// Largest file that holds one step, so far.
    single: u64,
    /// The file opened last: the caller may want it next.
    last: Option<FrameFile>,
    budget: MemoryBudget,
}

impl StepScan {
    fn is_suspect(&self, files: &[GroupFile], index: usize) -> bool {
        let len = fs::metadata(&files[index].path).map_or(0, |m| m.len());
        index == 0 || index + 1 == files.len() || len > self.single.saturating_add(self.single / 2)
    }

    /// The steps of a file; one that cannot be read counts as one, and fails when it is loaded.
    fn steps(&mut self, index: usize, path: &Path) -> &[Step] {
        if !self.scanned.contains_key(&index) {
            let mut steps = Vec::new();
            // Before the next is opened, so that only one is in memory.
            self.last = None;
            if let Ok(file) = FrameFile::open_within(path, self.budget) {
                steps = file.steps().to_vec();
                if steps.len() == 1 {
                    self.single = self.single.max(file.stored_len());
                }
                self.last = Some(file);
            }
            if steps.is_empty() {
                steps.push(Step::whole(0));
            }
            self.scanned.insert(index, steps);
        }
        self.scanned.get(&index).map_or(&[], Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(number: Option<i64>, path: &str, step: usize) -> (Option<i64>, PartFile) {
        let path = path.into();
        (number, PartFile { path, part: 0, step: Some(step), listed: None })
    }

    #[test]
    fn steps_are_numbered_as_written_and_the_last_wins() {
        let mut notes = Vec::new();
        let steps =
            vec![entry(Some(0), "a", 0), entry(Some(250), "a", 1), entry(Some(250), "b", 0)];
        let numbered = number_entries(steps, &mut notes);
        assert_eq!(numbered.iter().map(|n| n.number).collect::<Vec<_>>(), [0, 250]);
        assert_eq!(numbered[1].file.path, Path::new("b"));
        assert_eq!(notes.len(), 1);
    }

    #[test]
    fn steps_without_numbers_are_counted() {
        let steps = vec![entry(None, "a", 0), entry(Some(9), "a", 1)];
        let numbered = number_entries(steps, &mut Vec::new());
        assert_eq!(numbered.iter().map(|n| n.number).collect::<Vec<_>>(), [0, 1]);
    }
}
