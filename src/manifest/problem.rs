//! What is wrong with a manifest, and where.

use std::cell::RefCell;

/// Where a value was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Place {
    /// Byte in the file.
    Byte(usize),
    /// The option as the user typed it.
    Option(String),
    /// It is missing.
    Nowhere,
}

/// One thing wrong with a manifest, or to be warned of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Problem {
    pub(super) place: Place,
    /// Dotted; empty for the file as a whole.
    pub(super) key: String,
    pub(super) what: String,
}

/// Everything that was found.
#[derive(Debug, Default)]
pub(super) struct Problems {
    pub(super) errors: RefCell<Vec<Problem>>,
    pub(super) warnings: RefCell<Vec<Problem>>,
}

impl Problems {
    /// An error.
    pub(super) fn note(&self, place: &Place, key: &str, what: &str) {
        push(&self.errors, place, key, what);
    }

    /// Nothing that stops a job.
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
