//! Separated tables: CSV of ParaView, DualSPHysics, spreadsheets and scripts, with or without a
//! line of column names, and bare point lists.
//!
//! `layout` finds separator, names and first row; `names` finds positions and vectors among the
//! names; `read::table` parses the rows.

use super::input::TextInput;
use super::sniff::{TextShape, is_text, text_shape};
use super::table::{NumberKind, RowLabels, Table, TargetArray, TargetComponent, TextPolicy};
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::names::{COLOR_CODES, is_one_of, is_radius_name};
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

mod layout;
mod names;

use layout::TableLayout;

/// What some editors put before UTF-8 text.
pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Separated columns with a line of names.
pub const FORMAT: Format = Format::new(&Csv);

struct Csv;

impl Reader for Csv {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("csv", &["csv", "tsv"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(match text_shape(head) {
            Some(TextShape::SeparatedNumbers | TextShape::TitledNumbers) => Confidence::Likely,
            _ if !head.is_empty() && is_text(head) => Confidence::IfNamed,
            _ => Confidence::No,
        })
    }

    fn stream_unit(&self, head: &[u8]) -> Option<StreamUnit> {
        stream_unit(head)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        steps(source.text())
    }

    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        notes(head)
    }
}

/// Notes about a table that begins with `head`.
pub(super) fn notes(head: &[u8]) -> Vec<String> {
    let has_no_names = TableLayout::find(head).is_ok_and(|layout| layout.names.is_none());
    let note = "the table has no names of columns: columns 1 to 3 are the positions";
    has_no_names.then(|| note.to_owned()).into_iter().collect()
}

/// The only time step of `text`, with the time if a line before the names has it.
///
/// # Errors
/// [`ParseError::Unsupported`] for UTF-16; [`read`] reports other faults.
pub(super) fn steps(text: &TextInput<'_>) -> Result<Vec<Step>, ParseError> {
    let time = match TableLayout::find(text.head()) {
        Ok(layout) => layout.time,
        Err(error @ ParseError::Unsupported { .. }) => return Err(error),
        Err(_) => None,
    };
    let mut step = Step::whole(text.left_about());
    step.time = time;
    Ok(vec![step])
}

/// Reads the table. Columns of integers become i64, of other numbers f64; columns with text are
/// left out; an empty cell is NaN. Columns such as `Vel.x`, `Vel.y`, `Vel.z` or `velocity:0..2`
/// become one attribute by their common name. Without names the first three columns are the
/// positions.
///
/// # Errors
/// [`ParseError::Malformed`] if there are no positions among the columns, a row has another
/// number of cells, or a position is not a number; [`ParseError::Unsupported`] for UTF-16;
/// [`ParseError::TooLarge`] beyond `budget`.
pub(super) fn read(
    text: &mut TextInput<'_>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let head = text.head();
    let layout = TableLayout::find(head)?;
    let (fields, targets) = layout_columns(&layout)?;
    let rows = head.get(layout.rows.clone()).unwrap_or_default();
    let lines = memchr::memchr_iter(b'\n', rows).count() as u64;
    let guess = if text.as_whole().is_some() {
        lines.saturating_add(1)
    } else {
        // A little more than in proportion: rows may become shorter.
        let len = text.left_about() as u64;
        len.saturating_mul(lines) / rows.len().max(1) as u64 / 16 * 17
    };
    let before = head.get(..layout.rows.start).unwrap_or_default();
    let table = Table {
        dialect: layout.dialect,
        fields,
        targets,
        rows: usize::try_from(guess).unwrap_or(usize::MAX),
        labels: Some(RowLabels {
            first_line: memchr::memchr_iter(b'\n', before).count() + 1,
            columns: layout.names.unwrap_or_default(),
        }),
    };
    text.go_to(layout.rows.start);
    let (positions, attributes) = table.particles(text, usize::MAX, budget).content?;
    Ok(RawParticles { positions, attributes, time: layout.time, ..RawParticles::default() })
}

/// Lines that decide the layout of a table: more than are searched for the first row, and for separators.
const LAYOUT_LINES: usize = 300;

/// Rows, if `head`, the beginning of a file, holds all that decides the layout of the table.
pub(super) fn stream_unit(head: &[u8]) -> Option<StreamUnit> {
    let layout = TableLayout::find(head).ok()?;
    let rows = head.get(layout.rows).unwrap_or_default();
    let lines = memchr::memchr_iter(b'\n', rows).take(LAYOUT_LINES);
    (lines.count() == LAYOUT_LINES).then_some(StreamUnit::Rows)
}

fn layout_columns(layout: &TableLayout) -> Result<TableColumns, ParseError> {
    match &layout.names {
        Some(names) => named_columns(names).ok_or_else(|| layout.no_positions(names)),
        None => Ok(numbered_columns(layout.columns)),
    }
}

/// True if a line of `bytes` names positions.
pub fn finds_columns(bytes: &[u8]) -> bool {
    TableLayout::find(bytes)
        .is_ok_and(|layout| layout.names.is_some_and(|n| names::position(&n).is_some()))
}

type TableColumns = (Vec<Option<TargetComponent>>, Vec<TargetArray>);

/// Where the columns called `names` go; `None` if no positions are among them.
fn named_columns(names: &[String]) -> Option<TableColumns> {
    let axes = names::position(names)?;
    let mut fields: Vec<Option<TargetComponent>> = vec![None; names.len()];
    let mut targets = vec![TargetArray::positions()];
    let mut assign = |column: usize, target, component| {
        if let Some(field) = fields.get_mut(column) {
            *field = Some(TargetComponent { target, component });
        }
    };
    for (component, column) in axes.into_iter().enumerate() {
        if let Some(column) = column {
            assign(column, 0, component);
        }
    }
    for group in names::attributes(names, axes) {
        for (component, column) in group.columns.iter().enumerate() {
            assign(*column, targets.len(), component);
        }
        targets.push(TargetArray::attribute(
            group.name.clone(),
            group.columns.len(),
            numbers_of(&group),
            TextPolicy::LeaveOut,
        ));
    }
    Some((fields, targets))
}

/// Vectors and radii are real, even if all of a file happen to be integers. Integers of a colour are codes and stay
/// what they are.
fn numbers_of(group: &names::ColumnGroup) -> NumberKind {
    let is_color = is_one_of(&group.name, &COLOR_CODES);
    if (group.columns.len() > 1 && !is_color) || is_radius_name(&group.name) {
        NumberKind::Real
    } else {
        NumberKind::WholeIfAll
    }
}

/// Positions in the first three of `columns` columns, then `column_4`...
fn numbered_columns(columns: usize) -> TableColumns {
    let place = |target, component| Some(TargetComponent { target, component });
    let mut fields = vec![place(0, 0), place(0, 1), place(0, 2)];
    let mut targets = vec![TargetArray::positions()];
    for column in 4..=columns {
        fields.push(place(targets.len(), 0));
        let name = format!("column_{column}");
        targets.push(TargetArray::attribute(name, 1, NumberKind::WholeIfAll, TextPolicy::LeaveOut));
    }
    (fields, targets)
}

#[cfg(test)]
mod tests;
