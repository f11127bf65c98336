//! Lists of files: what they name, and where in their text.

use crate::ParseError;

/// Most bytes of a name that tells parts apart.
const MAX_LABEL: usize = 120;

/// What kind of list a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ListKind {
    /// `.pvd`: files with times and parts.
    Collection,
    /// `.vtu.series` and the like: files with times, in JSON.
    Series,
    /// `.pvtu`, `.pvtp`: the pieces of one data set.
    Pieces,
    /// `.vtm`, `.vtmb`, `.vtpd`, `.vtpc`: blocks with names, in blocks.
    Blocks,
}

impl ListKind {
    /// Name for messages.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Collection => "ParaView collection",
            Self::Series => "ParaView file series",
            Self::Pieces => "parallel VTK index",
            Self::Blocks => "multi-block VTK index",
        }
    }

    /// Whether the entries have times, so that one list may have several time steps.
    pub(super) const fn has_times(self) -> bool {
        matches!(self, Self::Collection | Self::Series)
    }
}

/// A place in a list, from where its text begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct TextPlace {
    /// Byte, from 0.
    pub(super) at: usize,
    /// Line, from 1.
    pub(super) line: u32,
}

impl TextPlace {
    /// An error here. `what` is the fact and the remedy.
    pub(super) fn malformed(self, what: impl std::fmt::Display) -> ParseError {
        ParseError::malformed(self.at, format!("line {}: {what}", self.line))
    }
}

/// Counts lines up to places that only grow.
#[derive(Debug)]
pub(super) struct LineCounter<'a> {
    text: &'a [u8],
    place: TextPlace,
}

impl<'a> LineCounter<'a> {
    pub(super) const fn new(text: &'a [u8]) -> Self {
        let place = TextPlace { at: 0, line: 1 };
        Self { text, place }
    }

    /// The place of byte `at`, which is not before that of the last call.
    pub(super) fn place(&mut self, at: usize) -> TextPlace {
        let passed = self.text.get(self.place.at..at).unwrap_or_default();
        let count = memchr::memchr_iter(b'\n', passed).count();
        let lines = u32::try_from(count).unwrap_or(u32::MAX);
        self.place =
            TextPlace { at: at.max(self.place.at), line: self.place.line.saturating_add(lines) };
        self.place
    }
}

/// What a list says about the part that a file is of. Files with the same labels are of the same part.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PartLabel {
    /// `group` of a `.pvd`.
    pub(super) group: String,
    /// `part` of a `.pvd`, which is a number.
    pub(super) part: String,
    /// `name` of a `.pvd`; the names of a block and of those around it.
    pub(super) name: String,
}

/// The beginning of `name`, so that long names in a list do not take memory for each of its files.
pub(super) fn label(mut name: String) -> String {
    let mut end = name.len().min(MAX_LABEL);
    while !name.is_char_boundary(end) {
        end -= 1;
    }
    name.truncate(end);
    name
}

/// One file that a list names.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ListEntry {
    /// The name as it is in the list.
    pub(super) path: String,
    /// Simulation time.
    pub(super) time: Option<f64>,
    pub(super) part: PartLabel,
    pub(super) place: TextPlace,
}

/// The content of a file that lists others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct List {
    pub(super) kind: ListKind,
    pub(super) entries: Vec<ListEntry>,
    /// Layers of points that pieces share (`GhostLevel`).
    pub(super) ghost_level: u32,
}
