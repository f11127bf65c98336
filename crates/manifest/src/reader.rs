//! Reads typed values from a [`TomlNode`] tree and collects all problems with location and key, so that one run is
//! enough to fix a manifest.

use super::field::Field;
use super::key::Key;
use super::nearest::nearest;
use super::problem::{MAX_SHOWN, Place, Problems};
use super::tree::{Kind, TomlNode};
use super::value::Slot;

/// A table that is being read. Keys that have not been read before [`Section::finish`] are unknown.
pub(super) struct Section<'a> {
    path: String,
    node: Option<&'a TomlNode>,
    known: Vec<&'static str>,
    problems: &'a Problems,
    /// Number of errors before the first key was read.
    errors_before: usize,
    is_closed: bool,
}

impl<'a> Section<'a> {
    pub(super) fn root(node: &'a TomlNode, problems: &'a Problems) -> Self {
        Self::new(String::new(), Some(node), problems)
    }

    fn new(path: String, node: Option<&'a TomlNode>, problems: &'a Problems) -> Self {
        Self {
            path,
            node,
            known: Vec::new(),
            problems,
            errors_before: problems.errors.borrow().len(),
            is_closed: false,
        }
    }

    fn full_key(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// The value of `key`, if it is present.
    pub(super) fn get(&mut self, key: &'static str) -> Option<Field<'a>> {
        self.known.push(key);
        let Some(Kind::Table(table)) = self.node.map(|n| &n.kind) else {
            return None;
        };
        table.get(key).map(|(_, node)| Field {
            key: self.full_key(key),
            node,
            problems: self.problems,
        })
    }

    /// Reads `key` into `slot`, which keeps its value if the key is missing or invalid.
    pub(super) fn read<S: Slot>(&mut self, key: &Key, slot: &mut S) {
        // Find the value; a required key must be present
        let Some(field) = self.get(key.name) else {
            if let Some(why) = key.required {
                self.missing(key.name, why);
            }
            return;
        };
        // The word for "not set" clears the slot
        if key.word.is_some() && field.as_text() == key.word {
            slot.set(None);
            return;
        }
        // Replace an old name of a value, with a warning
        let old = key.renamed.filter(|[old, _]| field.as_text() == Some(old));
        let renamed = old.map(|[old, new]| {
            let what = format!("\"{old}\" is now called \"{new}\"; the old name still works");
            self.problems.warn(&field.node.place, &field.key, &what);
            TomlNode { kind: Kind::Text(new.to_owned()), place: field.node.place.clone() }
        });
        // Parse the value
        let node = renamed.as_ref().unwrap_or(field.node);
        if let Some(value) = (Field { node, ..field }).value::<S::Value>(key) {
            slot.set(Some(value));
        }
    }

    /// The table `key`; a missing one is treated as empty.
    pub(super) fn section(&mut self, key: &'static str) -> Self {
        let missing = Self::new(self.full_key(key), None, self.problems);
        self.get(key).and_then(|f| f.section()).unwrap_or(missing)
    }

    /// All tables in the list `key`.
    pub(super) fn sections(&mut self, key: &'static str) -> Vec<Self> {
        let Some(field) = self.get(key) else {
            return Vec::new();
        };
        let items = field.items().unwrap_or_else(|| {
            field.fail(&format!(
                "expected a list of tables, such as [[{}]] begins, found {}",
                field.key,
                field.node.describe()
            ));
            Vec::new()
        });
        items.iter().filter_map(Field::section).collect()
    }

    /// The value of the dotted `key`, if it is present.
    pub(super) fn value(&self, key: &str) -> Option<&'a TomlNode> {
        self.node?.entry(key).map(|(_, node)| node)
    }

    /// Whether `key` is missing.
    pub(super) fn lacks(&self, key: &str) -> bool {
        self.value(key).is_none()
    }

    /// Reports that `key` is required but missing.
    pub(super) fn missing(&self, key: &str, what: &str) {
        self.problem(self.place(), key, &format!("is missing; {what}"));
    }

    /// Reports a problem of the dotted `key` in this table.
    pub(super) fn wrong(&self, key: &str, what: &str) {
        self.problem(self.place_of(key), key, what);
    }

    /// Warns about `key` in this table.
    pub(super) fn warn(&self, key: &str, what: &str) {
        self.problems.warn(&self.place_of(key), &self.full_key(key), what);
    }

    /// The place of the value of the dotted `key`, or of the table.
    fn place_of(&self, key: &str) -> Place {
        let entry = self.node.and_then(|node| node.entry(key));
        entry.map_or_else(|| self.place(), |(place, _)| place.clone())
    }

    fn place(&self) -> Place {
        self.node.map_or(Place::Nowhere, |n| n.place.clone())
    }

    fn problem(&self, place: Place, key: &str, what: &str) {
        self.problems.note(&place, &self.full_key(key), what);
    }

    /// Whether `key` is present and was read without a problem.
    pub(super) fn has(&self, key: &str) -> bool {
        !self.lacks(key) && !self.has_problem(key)
    }

    /// Whether a problem of the dotted `key` has been reported.
    pub(super) fn has_problem(&self, key: &str) -> bool {
        let full_key = self.full_key(key);
        let errors = self.problems.errors.borrow();
        errors.iter().skip(self.errors_before).any(|problem| problem.key == full_key)
    }

    /// Ends the checks, if an invalid key determines which keys are known.
    pub(super) const fn close(&mut self) {
        self.is_closed = true;
    }

    /// Reports every unknown key.
    pub(super) fn finish(self) {
        if self.is_closed {
            return;
        }
        // Look at each key of the table, until enough problems are known
        let Some(Kind::Table(table)) = self.node.map(|n| &n.kind) else {
            return;
        };
        for (key, (place, _)) in table {
            if self.known.contains(&key.as_str()) {
                continue;
            }
            if self.problems.errors.borrow().len() > MAX_SHOWN {
                break;
            }
            // Suggest a similar key, here or in another table
            let what = match nearest(key, &self.known) {
                Some(known) => format!("unknown key; did you mean `{}`?", self.full_key(known)),
                None => match elsewhere(key, &self.path) {
                    Some(known) => format!("unknown key here; did you mean `{known}`?"),
                    None => format!("unknown key; known here: {}", self.known.join(", ")),
                },
            };
            self.problem(place.clone(), key, &what);
        }
    }
}

impl<'a> Field<'a> {
    /// The value as a table.
    pub(super) fn as_table(&self) -> Option<Section<'a>> {
        let is_table = matches!(self.node.kind, Kind::Table(_));
        is_table.then(|| Section::new(self.key.clone(), Some(self.node), self.problems))
    }

    fn section(&self) -> Option<Section<'a>> {
        let table = self.as_table();
        if table.is_none() {
            self.fail(&format!("expected a table, found {}", self.node.describe()));
        }
        table
    }
}

/// The same key in the only other section that has it: `samples` belongs to `image`.
fn elsewhere(key: &str, path: &str) -> Option<String> {
    let own = format!("{path}.");
    let mut others = super::known_keys().into_iter().filter(|known| {
        let is_elsewhere = path.is_empty() || !known.starts_with(&own);
        is_elsewhere && known.rsplit('.').next() == Some(key)
    });
    let first = others.next();
    first.filter(|_| others.next().is_none())
}
