//! Making names that one alone can make, and clearing away what the dead have left.

use std::collections::HashSet;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::{CARD, Card};
use crate::publish::part_owner;

/// Gives the file `card` another name, `to`; false if there is a file of that name. Where the file system
/// has no second names, a file with the same `text` is made there.
pub(super) fn link_alone(card: &Path, to: &Path, text: &[u8]) -> io::Result<bool> {
    use io::ErrorKind as Kind;
    match fs::hard_link(card, to) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == Kind::AlreadyExists => Ok(false),
        Err(e)
            if matches!(
                e.kind(),
                Kind::Unsupported | Kind::PermissionDenied | Kind::TooManyLinks
            ) =>
        {
            create_alone(to, text)
        }
        Err(e) => Err(e),
    }
}

/// Makes a file; false if there is one of that name.
pub(super) fn create_alone(to: &Path, text: &[u8]) -> io::Result<bool> {
    match OpenOptions::new().write(true).create_new(true).open(to) {
        Ok(mut file) => file.write_all(text).map(|()| true).inspect_err(|_| {
            let _ = fs::remove_file(to);
        }),
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(e) => Err(e),
    }
}

/// Removes a file that may be gone already.
pub(super) fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// All files in the directory `work`; none if it is not there.
pub(super) fn list(work: &Path) -> io::Result<Vec<PathBuf>> {
    match fs::read_dir(work) {
        Ok(entries) => entries.map(|entry| Ok(entry?.path())).collect(),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(e) => Err(e),
    }
}

/// The cards in the directory `work`, with None for those that cannot be read.
pub(super) fn cards(work: &Path) -> io::Result<Vec<(PathBuf, Option<Card>)>> {
    let is_card = |path: &PathBuf| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().ends_with(CARD))
    };
    let paths = list(work)?.into_iter().filter(is_card);
    let mut cards = Vec::new();
    for path in paths {
        match Card::read(&path) {
            Ok(card) => {
                let card = card.filter(|card| card.is_at(&path));
                cards.push((path, card));
            }
            // It has just ended.
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(_) => cards.push((path, None)),
        }
    }
    Ok(cards)
}

/// Removes the temporary files in `dir` that none of the processes `at_work` writes; returns how many.
pub(crate) fn sweep_parts(dir: &Path, at_work: &HashSet<String>) -> io::Result<usize> {
    let mut removed = 0;
    for entry in fs::read_dir(dir)? {
        let entry = entry?;
        let name = entry.file_name();
        let Some(owner) = name.to_str().and_then(part_owner) else {
            continue;
        };
        if at_work.contains(owner) || !entry.file_type()?.is_file() {
            continue;
        }
        removed += usize::from(fs::remove_file(entry.path()).is_ok());
    }
    Ok(removed)
}
