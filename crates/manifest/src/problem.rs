//! Errors and warnings about a manifest, with their locations.

use std::cell::RefCell;

/// Maximum number of problems that are reported at once.
pub(super) const MAX_SHOWN: usize = 50;

/// Origin of a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Place {
    /// Byte in the file.
    Byte(usize),
    /// The option as the user typed it.
    Option(String),
    /// The value is missing.
    Nowhere,
}

/// An error in a manifest, or a warning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Problem {
    pub(super) place: Place,
    /// The dotted key; empty for the file as a whole.
    pub(super) key: String,
    pub(super) what: String,
}

/// All problems found so far.
#[derive(Debug, Default)]
pub(super) struct Problems {
    pub(super) errors: RefCell<Vec<Problem>>,
    pub(super) warnings: RefCell<Vec<Problem>>,
}

impl Problems {
    /// Adds an error.
    pub(super) fn note(&self, place: &Place, key: &str, what: &str) {
        push(&self.errors, place, key, what);
    }

    /// Adds a warning.
    pub(super) fn warn(&self, place: &Place, key: &str, what: &str) {
        push(&self.warnings, place, key, what);
    }
}

fn push(list: &RefCell<Vec<Problem>>, place: &Place, key: &str, what: &str) {
    list.borrow_mut().push(Problem {
        place: place.clone(),
        key: key.to_owned(),
        what: what.to_owned(),
    });
}
