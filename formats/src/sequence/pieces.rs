//! Steps that are divided among several files, `snap_010.0.hdf5` and `snap_010.1.hdf5`, and files that only refer to
//! these, `snap_010.hdf5`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::name::FileName;
use crate::open::{piece_count, refers_to_pieces};

/// Replaces files that only refer to others by those, and finds which files belong to one step. Adds a note on replaced
/// files, and on steps with missing files.
pub(super) fn find_pieces(mut names: Vec<FileName>, notes: &mut Vec<String>) -> Vec<FileName> {
    follow_references(&mut names, notes);
    split_pieces(&mut names, notes);
    names
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

/// Finds names whose last number is that of a file of one step: the files state how many a step has. Notes steps that
/// have fewer.
fn split_pieces(names: &mut [FileName], notes: &mut Vec<String>) {
    // Ask the first file of each series how many files a step has
    let mut counts = BTreeMap::<Vec<String>, u64>::new();
    for name in names.iter_mut().filter(|name| name.may_be_piece()) {
        let entry = counts.entry(name.literals.clone());
        let count = *entry.or_insert_with(|| piece_count(&name.path));
        if count > 1 {
            name.split_piece();
        }
    }
    // Count the files of each step that are there
    let mut found = BTreeMap::<(&[String], &[i64]), (u64, &Path)>::new();
    for name in names.iter().filter(|name| name.piece.is_some()) {
        let step = found.entry((&name.literals, &name.numbers));
        step.or_insert((0, &name.path)).0 += 1;
    }
    // Note steps that lack some
    for (count, path) in found.into_values() {
        let stated = piece_count(path);
        if count < stated {
            let path = path.display();
            notes.push(format!(
                "`{path}` belongs to a step of {stated} files, but only {count} of them exist"
            ));
        }
    }
}
