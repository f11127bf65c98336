//! LAMMPS text dumps (`dump custom` and `dump atom`), one or many steps a file.
//!
//! The layout is that of the `dump` and `dump_modify` pages of the LAMMPS manual, and LIGGGHTS writes the same. Binary
//! dumps are another format (`binary`).

use std::collections::HashSet;

use memchr::memmem;
use rayon::prelude::*;

use super::input::TextInput;
use super::sniff::is_digits;
use super::table::{
    CUT_SHORT, Comments, Decimal, Dialect, ExtraCells, RowsRead, Separator, Table, most_rows,
};
use super::{ByteSource, Step, text};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit, ValueNames};
use crate::shared::SharedBytes;
use spherule_frame::{MemoryBudget, ParseError, Positions, RawParticles};

mod binary;
mod bounds;
mod columns;
mod data;
mod header;
mod notes;

pub use binary::FORMAT as BINARY;
use bounds::Bounds;
use columns::DumpColumns;
pub use data::FORMAT as DATA;
use header::{DumpHeader, DumpItem};

/// What every header line begins with.
const ITEM: &[u8] = b"ITEM:";

/// What binary dumps begin with, after its length.
const MAGICS: [&[u8]; 2] = [b"DUMPATOM", b"DUMPCUSTOM"];

/// LAMMPS text dumps.
pub const FORMAT: Format = Format::new(&Lammps);

struct Lammps;

impl Reader for Lammps {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: true,
            ..FormatInfo::new("lammps", &["lammps", "lammpstrj", "dump"])
        }
    }

    /// Also `dump.250` and `dump.drop.250`, names without an extension.
    fn matches_name(&self, stem: &str, extension: &str) -> bool {
        let is_numbered_dump =
            is_digits(extension) && (stem == "dump" || stem.starts_with("dump."));
        is_numbered_dump || self.info().extensions.contains(&extension)
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        let is_dump = text.trim_ascii_start().starts_with(ITEM);
        Ok(Confidence::signature_if(is_dump))
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Rows)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        steps(source.text(), budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), step, budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        notes::notes(head)
    }

    fn value_names(&self, file: &SharedBytes) -> Vec<ValueNames> {
        notes::value_names(file)
    }
}

/// The time steps that `text` holds, in file order. Of a step that occurs twice (after a restart)
/// the last stays. One that is cut short is listed, so that reading it gives the error.
///
/// # Errors
/// [`ParseError::Malformed`] if there are no `ITEM:` lines or something else comes first,
/// [`ParseError::Unsupported`] for a binary dump,
/// [`ParseError::TooLarge`] if the list of steps needs more than `budget`.
fn steps(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    let mut steps: Vec<Step> = Vec::new();
    let mut items = StepItems::default();
    let mut pair = LinePair::default();
    check_start(text)?;
    let finder = memmem::Finder::new(ITEM);
    while go_to_item(text, &finder) {
        let at = text.at();
        pair.go_to_next(text);
        let line = text.rest();
        let item = DumpItem::of(line.get(..pair.end - at).unwrap_or(line));
        if steps.is_empty() || items.ends_before(item) {
            if let Some(last) = steps.last_mut() {
                last.end_at(at);
            }
            Step::push(&mut steps, at..at, budget)?;
            items = StepItems::default();
        }
        items.note(item);
        if let (Some(step), Some(value)) = (steps.last_mut(), pair.value) {
            match item {
                DumpItem::TimeStep => step.number = value.integer,
                DumpItem::Time => step.time = value.number,
                _ => {}
            }
        }
        text.advance(ITEM.len());
    }
    match steps.last_mut() {
        Some(last) => last.end_at(text.at()),
        None => return Err(not_a_dump(text.head())),
    }
    keep_last(&mut steps);
    Ok(steps)
}

/// Goes to the next `ITEM:`, or to the end.
fn go_to_item(text: &mut TextInput<'_>, finder: &memmem::Finder<'_>) -> bool {
    while text.want(ITEM.len()) >= ITEM.len() {
        if let Some(found) = finder.find(text.rest()) {
            text.advance(found);
            return true;
        }
        // The last letters may be the first of one.
        text.advance(text.rest().len() + 1 - ITEM.len());
    }
    text.advance(ITEM.len());
    false
}

/// Reads one of the [`steps`]: scaled positions are put into the box, `vx vy vz` become `velocity`,
/// `fx fy fz` become `force`, names (`element`, `typelabel`) become numbers, and other columns of text are left out.
///
/// # Errors
/// [`ParseError::Malformed`] if the step is cut short or breaks the format,
/// [`ParseError::Unsupported`] for dumps of other things than atoms,
/// [`ParseError::TooLarge`] beyond `budget`.
fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    text.go_to(range.start);
    text.end_at(range.end);
    let header = match DumpHeader::parse(text, budget) {
        Ok(header) => header,
        Err(fault) => return Err(fault.explain(text, step)),
    };
    let blank = text.pass_blank_lines(header.count);
    let most = header.count - blank;
    let first = if most > 0 { text.peek_line() } else { None };
    let columns = DumpColumns::find(&header, first.map(|line| line.text));
    let (rows, scaled_by) = match columns {
        Ok(columns) => {
            let table = Table {
                dialect: DIALECT,
                rows: most_rows(text.left_about(), columns.fields.len()).min(header.count),
                fields: columns.fields,
                targets: columns.targets,
                labels: None,
            };
            (table.particles(text, most, budget), columns.scaled_by)
        }
        Err(error) => (RowsRead::without(error, text, most), None),
    };
    let found = blank + rows.lines;
    if found < header.count {
        let what = format!("{} atoms expected, {found} lines follow", header.count);
        return Err(header::cut_short(text, step, header.count_at, &what));
    }
    check_end(text, header.count)?;
    let (mut positions, attributes) = rows.content?;
    if positions.len() != header.count {
        let what = format!(
            "{} atoms expected, {} found: blank lines between them",
            header.count,
            positions.len()
        );
        return Err(ParseError::malformed(header.count_at, what));
    }
    if let (Some(bounds), Positions::F64(v)) = (scaled_by, &mut positions) {
        v.par_iter_mut().for_each(|p| *p = bounds.place(*p));
    }
    Ok(RawParticles {
        positions,
        attributes,
        time: header.time,
        step: header.number,
        cell: header.bounds.and_then(|bounds| bounds.cell(header.periodic)),
        ..RawParticles::default()
    })
}

const DIALECT: Dialect = Dialect {
    separator: Separator::Blanks,
    decimal: Decimal::Point,
    comments: Comments::None,
    surplus: ExtraCells::Empty,
};

/// A line with one `ITEM:` or many, and the next line, which is looked at once for all of them.
#[derive(Debug, Default)]
struct LinePair {
    /// Where the line ends.
    end: usize,
    value: Option<ItemValue>,
}

/// The parsed line after an item.
#[derive(Debug, Clone, Copy)]
struct ItemValue {
    integer: Option<i64>,
    number: Option<f64>,
}

impl LinePair {
    /// Goes to the line that `text` is in, which is not before that of the last call.
    fn go_to_next(&mut self, text: &mut TextInput<'_>) {
        if text.at() < self.end {
            return;
        }
        (self.end, self.value) = text.ahead(|text| {
            let line = text.line();
            let end = line.map(|line| line.at + line.text.len());
            let next = text.line().map(|line| {
                let token = line.text.trim_ascii();
                ItemValue { integer: text::integer(token), number: text::number(token) }
            });
            // A value without a newline may lack digits.
            let next = next.filter(|_| text.is_behind_newline());
            (end.unwrap_or(text.at()), next)
        });
    }
}

/// Header lines of the current step so far.
#[derive(Debug, Default)]
struct StepItems {
    step: bool,
    rows: bool,
}

impl StepItems {
    fn note(&mut self, item: DumpItem) {
        self.step |= item == DumpItem::TimeStep;
        self.rows |= matches!(item, DumpItem::Atoms | DumpItem::Foreign);
    }

    /// True if `item` belongs to the next step: after the rows every item does, and a second `TIMESTEP`
    /// follows a header that was broken off.
    fn ends_before(&self, item: DumpItem) -> bool {
        self.rows || self.step && item == DumpItem::TimeStep
    }
}

/// Only blank lines (and a byte order mark) may stand before the first item.
fn check_start(text: &mut TextInput<'_>) -> Result<(), ParseError> {
    if text.head().starts_with(b"\xef\xbb\xbf") {
        text.go_to(3);
    }
    text.pass_blanks();
    text.want(ITEM.len());
    if text.rest().starts_with(ITEM) { Ok(()) } else { Err(not_a_dump(text.head())) }
}

fn not_a_dump(bytes: &[u8]) -> ParseError {
    let head = bytes.get(..64).unwrap_or(bytes);
    // A binary dump may begin with the name of its style.
    if MAGICS.iter().any(|magic| memmem::find(head, magic).is_some()) {
        return ParseError::unsupported(
            "a binary LAMMPS dump: write it as text, or convert it with binary2txt",
        );
    }
    if ITEM.starts_with(bytes) {
        return ParseError::malformed(bytes.len(), format!("no step yet: {CUT_SHORT}"));
    }
    let what = format!("a LAMMPS dump begins with ITEM: TIMESTEP, not {}", text::shown(head));
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
fn check_end(text: &mut TextInput<'_>, count: usize) -> Result<(), ParseError> {
    while let Some(line) = text.line() {
        let at = line.at;
        if line.is_blank() {
            continue;
        }
        let may_be_item = ITEM.starts_with(line.text);
        if !(may_be_item && !text.is_behind_newline() && text.is_file_end()) {
            let what = format!("more lines than the {count} atoms expected");
            return Err(ParseError::malformed(at, what));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
