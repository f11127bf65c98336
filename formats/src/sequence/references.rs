//! Files that the files of a sequence refer to, such as those with the values of virtual data sets.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::Sequence;
use crate::open::referenced_files;

impl Sequence {
    /// The files that its files refer to and that are in their directories or below, for each file that refers to
    /// some. Looks into all files if the first or the last one refers to some: those of a sequence are of one kind.
    pub fn references(&self) -> BTreeMap<&Path, Vec<PathBuf>> {
        let parts = self.frames.iter().flat_map(|frame| &frame.parts);
        let all: BTreeSet<&Path> = parts.map(|part| part.path.as_path()).collect();
        let mut ends = all.first().into_iter().chain(all.last());
        if ends.all(|path| referenced_files(path).is_empty()) {
            return BTreeMap::new();
        }
        let found = all.iter().map(|path| (*path, referenced_files(path)));
        found.filter(|(_, files)| !files.is_empty()).collect()
    }
}
