//! The steps of a file as text: of a long trajectory the first and the last, and those that are unlike the one before.

use spherule_files::counted;

use super::Inspected;
use crate::cli::CliError;
use crate::cli::print::{self, Reader};

/// Most steps that are all printed.
const ALL: usize = 4;

/// Prints the steps of a file in order.
pub(super) struct StepLines {
    /// Number of steps.
    count: usize,
    seen: usize,
    /// What the last printed step consists of.
    shape: Option<StepShape>,
    /// Steps that were not printed since.
    skipped: usize,
}

/// What most steps of a file have in common: all but the values.
#[derive(PartialEq)]
struct StepShape {
    count: u64,
    dropped: u64,
    /// Names and numbers of components.
    attributes: Vec<(String, usize)>,
    has_cell: bool,
}

impl StepShape {
    fn of(step: &Inspected<'_>) -> Self {
        let attributes = step.stats.attributes.iter();
        Self {
            count: step.stats.count,
            dropped: step.stats.dropped,
            attributes: attributes.map(|a| (a.name.clone(), a.components.len())).collect(),
            has_cell: step.cell.is_some(),
        }
    }
}

impl StepLines {
    /// For a file of `count` steps.
    pub(super) const fn new(count: usize) -> Self {
        Self { count, seen: 0, shape: None, skipped: 0 }
    }

    /// Prints the next step, unless it is like the one before and in the middle of many.
    pub(super) fn print(&mut self, step: &Inspected<'_>) -> Result<Reader, CliError> {
        self.seen += 1;
        let shape = Some(StepShape::of(step));
        let is_alike = self.shape == shape;
        if self.count > ALL && self.seen < self.count && is_alike {
            self.skipped += 1;
            return Ok(Reader::Listening);
        }
        let mut lines = Vec::new();
        if self.skipped > 0 {
            lines.push(format!(
                "  ... {} with as many particles and the same attributes (--json prints all)",
                counted(self.skipped, "step")
            ));
        }
        lines.extend(step.to_lines());
        (self.shape, self.skipped) = (shape, 0);
        print::lines(lines)
    }
}
