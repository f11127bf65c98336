//! The steps of a file, or the files of a sequence, as text: of a long trajectory the first and the last, those that are
//! unlike the one before, and what differs among all. Of a large one, only some are read.

use std::collections::BTreeMap;

use spherule_files::counted;
use spherule_formats::SimulationCell;

use super::Inspected;
use crate::cli::CliError;
use crate::cli::print::{self, Reader};

/// Most steps that are all printed.
pub(super) const ALL: usize = 4;
/// Steps that are read of a trajectory of more bytes than these.
const MAX_READ: usize = 8;
const LARGE: u64 = 256 << 20;

/// Which of `count` steps with `bytes` in all are read: all, or some at equal distances, with the first and the last.
pub(super) fn steps_to_read(count: usize, bytes: u64) -> Vec<usize> {
    if count <= MAX_READ || bytes <= LARGE {
        return (0..count).collect();
    }
    let (last, gaps) = (count as u128 - 1, MAX_READ as u128 - 1);
    let places = (0..=gaps).map(|index| usize::try_from(index * last / gaps).unwrap_or(count - 1));
    places.collect()
}

/// Prints the steps of a file, or the files of a sequence, in order.
pub(super) struct StepLines {
    /// What they are called.
    noun: &'static str,
    /// Number of steps.
    count: usize,
    /// What the last printed step consists of.
    shape: Option<StepShape>,
    /// Steps that were read and not printed since.
    skipped: usize,
    /// Steps that were not read since.
    unread: usize,
    /// The step that comes next if all are read.
    next: usize,
    range: StepRange,
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
    /// For `count` steps, each of them a `noun`.
    pub(super) fn new(noun: &'static str, count: usize) -> Self {
        Self {
            noun,
            count,
            shape: None,
            skipped: 0,
            unread: 0,
            next: 0,
            range: StepRange::default(),
        }
    }

    /// Prints the step `index`, unless it is like the one before and in the middle of many.
    pub(super) fn print(&mut self, index: usize, step: &Inspected<'_>) -> Result<Reader, CliError> {
        self.unread += index.saturating_sub(self.next);
        self.next = index.saturating_add(1);
        self.range.add(step);
        let shape = Some(StepShape::of(step));
        let is_alike = self.shape == shape;
        if self.count > ALL && self.next < self.count && is_alike {
            self.skipped += 1;
            return Ok(Reader::Listening);
        }
        let mut lines: Vec<String> = self.take_left_out().into_iter().collect();
        lines.extend(step.to_lines());
        self.shape = shape;
        print::lines(lines)
    }

    /// Ends a long trajectory with what differs.
    pub(super) fn finish(&mut self) -> Result<Reader, CliError> {
        if self.count <= ALL || self.range.read == 0 {
            return Ok(Reader::Listening);
        }
        let mut lines: Vec<String> = self.take_left_out().into_iter().collect();
        let all = counted(self.count, self.noun);
        let which = if self.range.read < self.count {
            format!("{all}, {} of them read", self.range.read)
        } else {
            format!("all {all}")
        };
        lines.push(format!("  {which}: {}", self.range.differences()));
        print::lines(lines)
    }

    /// The line on steps that were not printed since the last one.
    fn take_left_out(&mut self) -> Option<String> {
        let (skipped, unread) = (self.skipped, self.unread);
        (self.skipped, self.unread) = (0, 0);
        let all = counted(skipped + unread, self.noun);
        let alike = "with as many particles and the same attributes";
        match (skipped, unread) {
            (0, 0) => None,
            (_, 0) => Some(format!("  ... {all} {alike} (--json prints all)")),
            (0, _) => Some(format!("  ... {all} not read (--json reads all)")),
            _ => Some(format!("  ... {all}, {skipped} of them read, {alike} (--json reads all)")),
        }
    }
}

/// What the steps that were read have in common, and what differs.
#[derive(Default)]
struct StepRange {
    read: usize,
    /// Smallest and largest number of particles, and time.
    counts: Option<(u64, u64)>,
    times: Option<(f64, f64)>,
    /// How many steps have each attribute.
    attributes: BTreeMap<String, usize>,
    /// The first cell, how many steps have one, and whether they differ.
    cell: Option<SimulationCell>,
    with_cell: usize,
    has_other_cells: bool,
}

impl StepRange {
    fn add(&mut self, step: &Inspected<'_>) {
        self.read += 1;
        let count = step.stats.count;
        let (low, high) = self.counts.unwrap_or((count, count));
        self.counts = Some((low.min(count), high.max(count)));
        if let Some(time) = step.time {
            let (low, high) = self.times.unwrap_or((time, time));
            self.times = Some((low.min(time), high.max(time)));
        }
        for attribute in &step.stats.attributes {
            *self.attributes.entry(attribute.name.clone()).or_default() += 1;
        }
        if let Some(cell) = step.cell {
            self.with_cell += 1;
            self.has_other_cells |= *self.cell.get_or_insert(cell) != cell;
        }
    }

    fn differences(&self) -> String {
        let mut all = Vec::new();
        all.extend(self.counts.map(|(low, high)| {
            if low == high {
                format!("{low} particles each")
            } else {
                format!("{low} to {high} particles")
            }
        }));
        all.extend(self.times.map(|(low, high)| format!("time {low} to {high}")));
        let some = self.attributes.iter().filter(|(_, steps)| **steps < self.read);
        let some: Vec<&str> = some.map(|(name, _)| name.as_str()).collect();
        all.push(if some.is_empty() {
            "the same attributes".to_owned()
        } else {
            format!("not in all: {}", some.join(", "))
        });
        let cells = match self.with_cell {
            0 => None,
            with if with < self.read => Some(format!("{with} with a cell")),
            _ if self.has_other_cells => Some("the cell changes".to_owned()),
            _ => Some("the same cell".to_owned()),
        };
        all.extend(cells);
        all.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_large_trajectories_the_first_the_last_and_some_between_are_read() {
        assert_eq!(steps_to_read(20, LARGE).len(), 20);
        assert_eq!(steps_to_read(3, LARGE + 1), [0, 1, 2]);
        assert_eq!(steps_to_read(71, LARGE + 1), [0, 10, 20, 30, 40, 50, 60, 70]);
        assert_eq!(steps_to_read(0, 0), [0_usize; 0]);
        assert_eq!(steps_to_read(usize::MAX, u64::MAX).last(), Some(&(usize::MAX - 1)));
    }
}
