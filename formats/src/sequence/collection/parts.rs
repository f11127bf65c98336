//! Which part a listed file is of, and what parts are called.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::super::name::FileName;
use super::entry::PartLabel;

/// Characters that names do not begin or end with.
const SEPARATORS: [char; 5] = ['_', '-', '.', ' ', '#'];

/// What tells the parts of a step apart.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PartKey {
    /// Index of the part that the list itself is, if several lists are parts of one step.
    pub(super) group: u32,
    /// What a `.pvd` says.
    pub(super) label: PartLabel,
    /// Name of the file in a `.pvd` without its numbers. Only counts where nothing else tells files of one step apart.
    pub(super) stem: String,
    /// Names of blocks, from the outermost.
    pub(super) blocks: String,
    /// Index of the piece in a `.pvtu`. Only counts where a step has nothing but the pieces of one data set.
    pub(super) piece: Option<u32>,
}

impl PartKey {
    /// What always counts.
    fn plain(&self) -> Self {
        Self { stem: String::new(), piece: None, ..self.clone() }
    }
}

/// The name of a file without numbers and extension: what a series of files has in common.
pub(super) fn stem_of(name: &str) -> String {
    let name = FileName::parse(Path::new(name), None);
    name.literals.concat().trim_matches(SEPARATORS).to_owned()
}

/// Different parts, numbered in the order of their appearance.
#[derive(Debug, Default)]
pub(super) struct PartTable {
    numbers: BTreeMap<PartKey, u32>,
}

impl PartTable {
    /// The number of `key`.
    pub(super) fn number(&mut self, key: &PartKey) -> u32 {
        if let Some(number) = self.numbers.get(key) {
            return *number;
        }
        let next = u32::try_from(self.numbers.len()).unwrap_or(u32::MAX);
        self.numbers.insert(key.clone(), next);
        next
    }

    /// The parts of the files in `steps`, each a pair of a step and a number of this table: the final part for each
    /// number, and the names of the parts.
    ///
    /// Names of files tell parts apart only if two files of one step have the same label otherwise, and pieces only
    /// if nothing else does.
    pub(super) fn finish(
        self,
        steps: impl Iterator<Item = (i64, u32)>,
        groups: &[String],
    ) -> (Vec<u32>, Vec<String>) {
        // Sort the keys by their numbers
        let mut keys: Vec<(u32, PartKey)> =
            self.numbers.into_iter().map(|(key, number)| (number, key)).collect();
        keys.sort_unstable_by_key(|(number, _)| *number);
        let keys: Vec<PartKey> = keys.into_iter().map(|(_, key)| key).collect();
        // Find the plain keys that are ambiguous: in some step, files with different names have the same one
        let plain: Vec<PartKey> = keys.iter().map(PartKey::plain).collect();
        let mut stems: BTreeMap<(i64, &PartKey), &str> = BTreeMap::new();
        let mut shared = BTreeSet::new();
        for (step, number) in steps {
            let number = number as usize;
            if let (Some(plain), Some(key)) = (plain.get(number), keys.get(number))
                && *stems.entry((step, plain)).or_insert(&key.stem) != key.stem
            {
                shared.insert(plain);
            }
        }
        // Add the names of files to the ambiguous ones only
        let named: Vec<PartKey> = keys
            .iter()
            .zip(&plain)
            .map(|(key, plain)| {
                if shared.contains(plain) {
                    PartKey { stem: key.stem.clone(), ..plain.clone() }
                } else {
                    plain.clone()
                }
            })
            .collect();
        // Pieces count if all files are pieces of one part
        let is_one = named.windows(2).all(|pair| pair[0] == pair[1]);
        let are_pieces = is_one && keys.iter().all(|key| key.piece.is_some());
        // Number the distinct keys in the order of their first file
        let mut parts: Vec<PartKey> = Vec::new();
        let mut of_key = BTreeMap::new();
        let mut of_number = Vec::with_capacity(keys.len());
        for (key, mut identity) in keys.iter().zip(named) {
            identity.piece = key.piece.filter(|_| are_pieces);
            let part = *of_key.entry(identity).or_insert_with(|| {
                parts.push(PartKey { piece: key.piece.filter(|_| are_pieces), ..key.clone() });
                u32::try_from(parts.len() - 1).unwrap_or(u32::MAX)
            });
            of_number.push(part);
        }
        (of_number, names(&parts, groups))
    }
}

/// The words that name a part.
type WordsOf<'a> = &'a dyn Fn(&PartKey) -> Vec<String>;

/// Names of parts: the shortest of what is known that is different for all.
fn names(parts: &[PartKey], groups: &[String]) -> Vec<String> {
    if parts.len() < 2 {
        return vec![String::new(); parts.len()];
    }
    // Try words from the shortest to all that is known
    let group = |key: &PartKey| groups.get(key.group as usize).cloned().unwrap_or_default();
    let schemes: [WordsOf<'_>; 6] = [
        &|key| key.piece.map(|piece| format!("piece {piece}")).into_iter().collect(),
        &|key| vec![key.label.name.clone(), key.blocks.clone()],
        &|key| vec![key.stem.clone(), key.blocks.clone()],
        &|key| vec![group(key), key.blocks.clone()],
        &|key| vec![key.label.part.clone(), key.blocks.clone()],
        &|key| {
            let PartLabel { group: within, part, name } = &key.label;
            let all = [&group(key), within, part, name, &key.stem, &key.blocks];
            all.map(Clone::clone).to_vec()
        },
    ];
    // Stop at the first scheme with a distinct name for every part
    let mut named = Vec::new();
    for scheme in schemes {
        let name = |key: &PartKey| {
            let mut words = scheme(key);
            words.retain(|word| !word.is_empty());
            words.join("/")
        };
        named = parts.iter().map(name).collect();
        let distinct: BTreeSet<&String> = named.iter().collect();
        if distinct.len() == named.len() && !named.iter().any(String::is_empty) {
            break;
        }
    }
    named
}
