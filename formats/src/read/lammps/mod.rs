//! LAMMPS text dumps (`dump custom` and `dump atom`), one or many steps a file.
//!
//! The layout is that of the `dump` and `dump_modify` pages of the LAMMPS manual. Binary dumps are
//! another format and refused by name.

use std::collections::HashSet;

use memchr::{memchr, memmem};
use rayon::prelude::*;

use super::Step;
use super::table::{CUT_SHORT, Comments, Decimal, Dialect, Separator, Surplus, Table};
use super::text::{self, Lines};
use crate::{MemoryBudget, ParseError, Positions, RawParticles};

mod bounds;
mod columns;
mod header;
mod remarks;

use columns::Columns;
use header::{Header, Item};
pub(super) use remarks::remarks;

/// What every header line begins with.
const ITEM: &[u8] = b"ITEM:";

/// The time steps that `bytes` hold, in file order. Of a step that occurs twice (after a restart)
/// the last stays. One that is cut short is listed, so that reading it can say so.
///
/// # Errors
/// [`ParseError::Malformed`] if there are no `ITEM:` lines or something else comes first,
/// [`ParseError::Unsupported`] for a binary dump.
pub fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    let mut steps: Vec<Step> = Vec::new();
    let mut seen = Seen::default();
    let mut pair = LinePair::default();
    for at in memmem::find_iter(bytes, ITEM) {
        if steps.is_empty() {
            check_start(bytes, at)?;
        }
        pair.go_to(bytes, at);
        let item = Item::of(bytes.get(at..pair.end).unwrap_or_default());
        if steps.is_empty() || seen.ends_before(item) {
            if let Some(last) = steps.last_mut() {
                last.span.end = at;
            }
            steps.push(Step {
                index: steps.len(),
                span: at..bytes.len(),
                number: None,
                time: None,
            });
            seen = Seen::default();
        }
        seen.note(item);
        if let (Some(step), Some(value)) = (steps.last_mut(), pair.value()) {
            match item {
                Item::TimeStep => step.number = value.integer,
                Item::Time => step.time = value.number,
                _ => {}
            }
        }
    }
    if steps.is_empty() {
        return Err(not_a_dump(bytes));
    }
    keep_last(&mut steps);
    Ok(steps)
}

/// Reads one of the [`steps`]: scaled positions are put into the box, `vx vy vz` become `velocity`,
/// `fx fy fz` become `force`, names (`element`, `typelabel`) become numbers, and other columns of text are left out.
///
/// # Errors
/// [`ParseError::Malformed`] if the step is cut short or breaks the format,
/// [`ParseError::Unsupported`] for dumps of other things than atoms.
pub fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    read_within(bytes, step, MemoryBudget::UNLIMITED)
}

/// [`read`] within a budget.
pub(crate) fn read_within(
    bytes: &[u8],
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    if bytes.len() < step.span.end || step.span.end < step.span.start {
        let what = format!("the step ends at {}: {CUT_SHORT}", step.span.end);
        return Err(ParseError::malformed(bytes.len(), what));
    }
    let mut lines = Lines::new(bytes, step.span.clone());
    let header = Header::parse(&mut lines).map_err(|fault| fault.explain(bytes, step))?;
    let start = lines.at();
    let found = lines.pass(header.count);
    if found < header.count {
        let what = format!("{} atoms announced, {found} lines follow", header.count);
        return Err(header::cut_short(bytes, step, header.count_at, &what));
    }
    let rows = start..lines.at();
    check_end(bytes, lines, header.count)?;

    let first = Lines::new(bytes, rows.clone()).find(|line| !line.is_blank());
    let columns = Columns::find(&header, first.map(|line| line.text))?;
    let table = Table {
        bytes,
        span: rows,
        dialect: DIALECT,
        fields: columns.fields,
        targets: columns.targets,
    };
    let (mut positions, attributes) = table.particles(budget)?;
    if positions.len() != header.count {
        let what = format!(
            "{} atoms announced, {} found: blank lines between them",
            header.count,
            positions.len()
        );
        return Err(ParseError::malformed(header.count_at, what));
    }
    if let (Some(bounds), Positions::F64(v)) = (columns.scaled_by, &mut positions) {
        v.par_iter_mut().for_each(|p| *p = bounds.place(*p));
    }
    Ok(RawParticles {
        positions,
        attributes,
        time: header.time,
        step: header.number,
    })
}

const DIALECT: Dialect = Dialect {
    separator: Separator::Blanks,
    decimal: Decimal::Point,
    comments: Comments::None,
    surplus: Surplus::Empty,
};

/// A line with one `ITEM:` or many, and the next line, which is looked at once for all of them.
#[derive(Debug, Default)]
struct LinePair<'a> {
    /// Where the line ends.
    end: usize,
    next: Option<&'a [u8]>,
    value: Option<Value>,
}

/// What the line after an item says.
#[derive(Debug, Clone, Copy)]
struct Value {
    integer: Option<i64>,
    number: Option<f64>,
}

impl<'a> LinePair<'a> {
    /// Goes to the line that has byte `at`, which is not before that of the last call.
    fn go_to(&mut self, bytes: &'a [u8], at: usize) {
        if at < self.end {
            return;
        }
        let mut lines = Lines::new(bytes, at..bytes.len());
        self.end = lines
            .next()
            .map_or(bytes.len(), |line| line.at + line.text.len());
        // A value without a newline may lack digits.
        let next = lines.next().filter(|v| v.at + v.text.len() < bytes.len());
        self.next = next.map(|line| line.text.trim_ascii());
        self.value = None;
    }

    fn value(&mut self) -> Option<Value> {
        let next = self.next?;
        let value = || Value {
            integer: text::integer(next),
            number: text::number(next),
        };
        Some(*self.value.get_or_insert_with(value))
    }
}

/// Which header lines of a step have passed.
#[derive(Debug, Default)]
struct Seen {
    step: bool,
    rows: bool,
}

impl Seen {
    fn note(&mut self, item: Item) {
        self.step |= item == Item::TimeStep;
        self.rows |= matches!(item, Item::Atoms | Item::Foreign);
    }

    /// True if `item` belongs to the next step: after the rows all do, and a second `TIMESTEP`
    /// follows a header that was broken off.
    fn ends_before(&self, item: Item) -> bool {
        self.rows || self.step && item == Item::TimeStep
    }
}

/// Only blank lines (and a byte order mark) may stand before the first item.
fn check_start(bytes: &[u8], first: usize) -> Result<(), ParseError> {
    let before = bytes.get(..first).unwrap_or_default();
    let before = before.strip_prefix(b"\xef\xbb\xbf").unwrap_or(before);
    if before.trim_ascii().is_empty() {
        Ok(())
    } else {
        Err(not_a_dump(bytes))
    }
}

fn not_a_dump(bytes: &[u8]) -> ParseError {
    let head = bytes.get(..64).unwrap_or(bytes);
    // A binary dump may begin with the name of its style.
    if [&b"DUMPATOM"[..], b"DUMPCUSTOM"]
        .iter()
        .any(|magic| memmem::find(head, magic).is_some())
    {
        return ParseError::unsupported(
            "a binary LAMMPS dump: write it as text, or convert it with binary2txt",
        );
    }
    if ITEM.starts_with(bytes) {
        return ParseError::malformed(bytes.len(), format!("no step yet: {CUT_SHORT}"));
    }
    let what = format!(
        "a LAMMPS dump begins with ITEM: TIMESTEP, not {}",
        text::shown(head)
    );
    ParseError::malformed(0, what)
}

/// Drops all but the last step of each number.
fn keep_last(steps: &mut Vec<Step>) {
    let mut numbers = HashSet::new();
    let mut kept: Vec<bool> = steps
        .iter()
        .rev()
        .map(|step| step.number.is_none_or(|number| numbers.insert(number)))
        .collect();
    steps.retain(|_| kept.pop().unwrap_or(true));
    for (index, step) in steps.iter_mut().enumerate() {
        step.index = index;
    }
}

/// After the last atom come blank lines, or the first letters of the next step's `ITEM:`.
fn check_end(bytes: &[u8], rest: Lines<'_>, count: usize) -> Result<(), ParseError> {
    for line in rest {
        let unfinished = memchr(b'\n', bytes.get(line.at..).unwrap_or_default()).is_none();
        if !(line.is_blank() || unfinished && ITEM.starts_with(line.text)) {
            let what = format!("more lines than the {count} atoms announced");
            return Err(ParseError::malformed(line.at, what));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
