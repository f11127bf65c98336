//! Lines of numbers in columns of equal width, as Fortran writes them.

use super::atoms::coordinate;
use super::text::{self, Line};
use spherule_frame::{MemoryBudget, ParseError};

/// Reads the `count` numbers of `width` columns that `line` consists of.
///
/// # Errors
/// [`ParseError::Malformed`] if it has another length, or something else.
pub(super) fn read_row(
    line: Line<'_>,
    width: usize,
    count: usize,
    numbers: &mut Vec<f64>,
) -> Result<(), ParseError> {
    if line.text.trim_ascii_end().len() != count * width {
        let what = format!(
            "expected {count} numbers of {width} columns, found {}: the file is damaged, or still being written",
            text::shown(line.text)
        );
        return Err(ParseError::malformed(line.at, what));
    }
    numbers.clear();
    for start in (0..count).map(|index| index * width) {
        numbers.push(coordinate(line, start, start + width)?);
    }
    Ok(())
}

/// Numbers of many lines.
pub(super) struct RowNumbers {
    pub(super) numbers: Vec<f64>,
    budget: MemoryBudget,
}

impl RowNumbers {
    pub(super) const fn new(budget: MemoryBudget) -> Self {
        Self { numbers: Vec::new(), budget }
    }

    /// Adds the numbers of a line.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`] beyond the budget.
    pub(super) fn push(&mut self, row: &[f64]) -> Result<(), ParseError> {
        // A vector that grows holds its old numbers and twice the room for new ones.
        let need = 3 * size_of::<f64>() * (self.numbers.len() + row.len());
        self.budget.check(need as u64, "its numbers in memory are")?;
        self.numbers.extend(row);
        Ok(())
    }
}
