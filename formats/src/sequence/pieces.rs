//! Steps that are divided among several files, `snap_010.0.hdf5` and `snap_010.1.hdf5`, and files that only refer to
//! these, `snap_010.hdf5`.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use super::name::FileName;
use super::{SequenceFrame, SequenceInput};
use crate::FrameError;
use crate::open::{piece_count, refers_to_pieces};

/// Steps that lack files, by their first file that exists.
#[derive(Debug, Default)]
pub(super) struct MissingPieces(BTreeMap<PathBuf, IncompleteStep>);

#[derive(Debug)]
struct IncompleteStep {
    /// The first file that exists, and the first that does not.
    first: PathBuf,
    missing: PathBuf,
    /// Files that exist, and how many there should be.
    found: u64,
    stated: u64,
}

impl MissingPieces {
    /// Checks that all files of a step exist.
    ///
    /// # Errors
    /// [`FrameError::Io`] of the first one that does not.
    pub(super) fn check(&self, frame: &SequenceFrame) -> Result<(), FrameError> {
        let step = frame.parts.iter().find_map(|part| self.0.get(&part.path));
        step.map_or(Ok(()), |step| Err(step.error()))
    }
}

impl IncompleteStep {
    fn error(&self) -> FrameError {
        let what = format!(
            "does not exist; {} says that its step has {} files, of which there are {}: copy the others there, or give one \
             file by its name to read it alone",
            self.first.display(),
            self.stated,
            self.found
        );
        FrameError::io(&self.missing, io::Error::new(io::ErrorKind::NotFound, what))
    }
}

/// The note about a step that is read from only some of its files.
fn note(first: &Path, found: u64, stated: u64) -> String {
    let path = first.display();
    let used = if found == 1 { "is" } else { "are" };
    format!("`{path}` belongs to a step of {stated} files, but only {found} of them {used} used")
}

/// Replaces files that only refer to others by those, and finds which files belong to one step, and which of them are
/// missing. The `names` are those of `input`. Adds a note on replaced files, and on steps whose files are not all used,
/// because others are not among `names`, or one file was given alone.
pub(super) fn find_pieces(
    input: &SequenceInput,
    mut names: Vec<FileName>,
    notes: &mut Vec<String>,
) -> (Vec<FileName>, MissingPieces) {
    follow_references(&mut names, notes);
    let mut missing = split_pieces(&mut names, notes);
    if let (SequenceInput::Files(paths), [name]) = (input, names.as_slice())
        && paths.as_slice() == std::slice::from_ref(&name.path)
    {
        let steps = std::mem::take(&mut missing).0.into_values();
        notes.extend(steps.map(|step| note(&step.first, step.found, step.stated)));
    }
    (names, missing)
}

/// Whether the file at `path` only refers to others that are beside it.
pub(super) fn is_reference(path: &Path) -> bool {
    refers_to_others(&FileName::parse(path, None))
}

fn refers_to_others(name: &FileName) -> bool {
    let first = name.piece_path(0);
    first.is_some_and(|first| first.is_file() && refers_to_pieces(&name.path))
}

/// Replaces files that only refer to others beside them by those.
fn follow_references(names: &mut Vec<FileName>, notes: &mut Vec<String>) {
    let (references, others): (Vec<_>, Vec<_>) = names.drain(..).partition(refers_to_others);
    *names = others;
    let Some(first) = references.first() else {
        return;
    };
    let path = first.path.display();
    let which = match references.len() {
        1 => format!("`{path}` has"),
        count => format!("`{path}` and {} more have", count - 1),
    };
    notes.push(format!("{which} virtual data sets: the files with the values are read instead"));
    let known: BTreeSet<PathBuf> = names.iter().map(|name| name.path.clone()).collect();
    for reference in &references {
        let count = reference.piece_path(0).map_or(0, |path| piece_count(&path));
        // A count in a file may be anything
        let pieces = (0..i64::try_from(count).unwrap_or(i64::MAX))
            .map_while(|number| reference.piece(number).filter(|piece| piece.path.is_file()));
        names.extend(pieces.filter(|piece| !known.contains(&piece.path)));
    }
}

/// Finds names whose last number is that of a file of one step: the files state how many a step has. Notes steps
/// that are read from only some of their files, and returns steps with files that do not exist.
fn split_pieces(names: &mut [FileName], notes: &mut Vec<String>) -> MissingPieces {
    // Ask the first file of each series how many files a step has
    let mut counts = BTreeMap::<Vec<String>, u64>::new();
    for name in names.iter_mut().filter(|name| name.may_be_piece()) {
        let entry = counts.entry(name.literals.clone());
        let count = *entry.or_insert_with(|| piece_count(&name.path));
        if count > 1 {
            name.split_piece();
        }
    }
    // Collect the files of each step
    let mut steps = BTreeMap::<(&[String], &[i64]), BTreeMap<i64, &FileName>>::new();
    for name in names.iter() {
        if let Some(piece) = name.piece {
            steps.entry((&name.literals, &name.numbers)).or_default().insert(piece, name);
        }
    }
    // Find steps that lack some
    let mut missing = MissingPieces::default();
    for pieces in steps.into_values() {
        let Some(first) = pieces.values().next() else { continue };
        let (found, stated) = (pieces.len() as u64, piece_count(&first.path));
        if found >= stated {
            continue;
        }
        if let Some(path) = first_missing(&pieces, first) {
            let first = first.path.clone();
            let step = IncompleteStep { first: first.clone(), missing: path, found, stated };
            missing.0.insert(first, step);
        } else {
            notes.push(note(&first.path, found, stated));
        }
    }
    missing
}

/// The first file of a step with these `pieces` that does not exist.
fn first_missing(pieces: &BTreeMap<i64, &FileName>, first: &FileName) -> Option<PathBuf> {
    let is_missing = |number: &u64| i64::try_from(*number).is_ok_and(|n| !pieces.contains_key(&n));
    let mut paths = (0_u64..=pieces.len() as u64)
        .filter(is_missing)
        .filter_map(|number| first.sibling_piece(number));
    paths.find(|path| !path.exists())
}
