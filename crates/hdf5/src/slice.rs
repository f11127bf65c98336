//! Rows of a data set that are asked for.

use std::ops::Range;

use super::types::Field;

/// Which rows of a data set, and what in them.
#[derive(Debug, Clone, Default)]
pub(super) struct Slice {
    /// Index along the first dimension, if rows are the second.
    pub(super) frame: Option<u64>,
    /// Rows; all if `None`.
    pub(super) rows: Option<Range<u64>>,
    /// Elements of a data set of one dimension that form a row, if there are several.
    pub(super) stride: Option<u64>,
    /// A field of a compound type; `None` for all numbers of a row.
    pub(super) field: Option<Field>,
}

impl Slice {
    /// All rows.
    pub(super) const ALL: Self = Self { frame: None, rows: None, stride: None, field: None };

    /// The rows at index `frame` of the first dimension.
    pub(super) fn frame(frame: u64) -> Self {
        Self { frame: Some(frame), ..Self::ALL }
    }

    /// `rows` of a data set.
    pub(super) fn rows(rows: Range<u64>) -> Self {
        Self { rows: Some(rows), ..Self::ALL }
    }
}
