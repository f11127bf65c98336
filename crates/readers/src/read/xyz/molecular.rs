//! Molecular text: frames of a count, a comment, and a line for each atom, one after another.

use std::ops::Range;

use super::{comment, foreign};
use crate::read::input::TextInput;
use crate::read::table::{
    CUT_SHORT, Comments, Decimal, Dialect, ExtraCells, NumberKind, RowsRead, Separator, Table,
    TargetArray, TargetComponent, TextPolicy, most_rows,
};
use crate::read::text::{self, Line};
use crate::read::{Step, csv};
use spherule_frame::names::{POSITION_PROPERTIES, SPECIES_PROPERTIES};
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

/// The frames of `text`. Where a count should be and is not, the rest of the file is
/// one last step, so that reading it gives the error.
pub(super) fn steps(
    text: &mut TextInput<'_>,
    budget: MemoryBudget,
) -> Result<Vec<Step>, ParseError> {
    let mut steps = Vec::new();
    let mut are_empty = true;
    while let Some(line) = text.line() {
        if line.is_blank() {
            continue;
        }
        let (at, count) = (line.at, count(line));
        let comment = match count {
            Ok(_) => text.line().map(|comment| (number(comment), time(comment))),
            Err(_) => None,
        };
        are_empty &= !count.as_ref().is_ok_and(|count| *count > 0);
        text.pass_lines(count.as_ref().map_or(usize::MAX, |count| *count));
        Step::push(&mut steps, at..text.at(), budget)?;
        if let (Some(step), Some(comment)) = (steps.last_mut(), comment) {
            (step.number, step.time) = comment;
        }
    }
    if are_empty && steps.len() > 1 {
        let what = "counts of 0 particles and nothing else: not molecular text";
        return Err(ParseError::malformed(0, what));
    }
    Ok(steps)
}

/// Reads the frame in `span`.
pub(super) fn read(
    text: &mut TextInput<'_>,
    span: Range<usize>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    text.go_to(span.start);
    text.end_at(span.end);
    let too_short = |at, what: String| ParseError::malformed(at, format!("{what}: {CUT_SHORT}"));
    text.pass_blank_lines(usize::MAX);
    let Some(first) = text.line() else {
        return Err(too_short(text.at(), "no particle count".into()));
    };
    let (count_at, count) = (first.at, count(first)?);
    let Some(comment) = text.line() else {
        return Err(too_short(text.at(), "no comment after the count".into()));
    };
    let (number, time) = (number(comment), time(comment));
    let cell = comment::cell(comment.text);
    let comment_at = comment.at;
    let second_line = comment.text.to_vec();
    let properties = comment::value(comment.text, "Properties").map(<[u8]>::to_vec);
    let size = text.left_about();
    let blank = text.pass_blank_lines(count);
    let most = count - blank;
    let first = if most > 0 { text.peek_line() } else { None };
    let words = first.map_or(0, |line| text::words(line.text).count());
    let columns = match properties {
        Some(properties) => {
            let size = if count > 0 { size } else { 0 };
            let first = first.map(|line| line.text);
            extended_columns(&properties, comment_at, (size, budget), first)
        }
        None => plain_columns(first, budget),
    };
    let rows = match columns {
        Ok((fields, targets)) => {
            let table = Table {
                dialect: DIALECT,
                rows: most_rows(text.left_about(), fields.len()).min(count),
                fields,
                targets,
                labels: None,
            };
            table.particles(text, most, budget)
        }
        Err(error) => RowsRead::without(error, text, most),
    };
    let found = blank + rows.lines;
    if found < count {
        let is_only = span.start <= csv::BYTE_ORDER_MARK.len() && text.is_file_end();
        if is_only
            && found + 1 == count
            && let Some(what) = foreign::without_comment(&second_line, words)
        {
            return Err(ParseError::unsupported(what));
        }
        let what = format!("{count} particles expected, {found} lines follow");
        return Err(too_short(count_at, what));
    }
    let (positions, attributes) = rows.content?;
    if positions.len() != count {
        let what = format!(
            "{count} particles expected, {} found: blank lines between them",
            positions.len()
        );
        return Err(ParseError::malformed(count_at, what));
    }
    Ok(RawParticles { positions, attributes, time, step: number, cell, ..RawParticles::default() })
}

/// Bytes that a column takes on the way to its array, with its name.
const COLUMN: usize = 256;

/// People append notes to atoms, so more columns than the first atom has are no fault.
const DIALECT: Dialect = Dialect {
    separator: Separator::Blanks,
    decimal: Decimal::Point,
    comments: Comments::None,
    surplus: ExtraCells::Ignored,
};

fn count(line: Line<'_>) -> Result<usize, ParseError> {
    let token = line.text.trim_ascii();
    let count = text::integer(token).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let what = format!("{} is not a particle count", text::shown(token));
        ParseError::malformed(line.at, what)
    })
}

fn time(comment: Line<'_>) -> Option<f64> {
    text::number(comment::value(comment.text, "Time")?.trim_ascii())
}

fn number(comment: Line<'_>) -> Option<i64> {
    let step = comment::lammps_step(comment.text)
        .or_else(|| comment::value(comment.text, "Step"))
        .or_else(|| comment::value(comment.text, "Timestep"))?;
    text::integer(step.trim_ascii())
}

type TableColumns = (Vec<Option<TargetComponent>>, Vec<TargetArray>);

/// The attribute for elements and species.
pub(super) const NAME: &str = "element";

/// Which column has the names of elements or species, if the first atom has one there that is not a number.
pub(super) fn name_column(comment: &[u8], first: &[u8]) -> Option<usize> {
    let column = match comment::value(comment, "Properties") {
        Some(properties) => {
            let parts: Vec<&[u8]> = properties.split(|b| *b == b':').collect();
            let (triples, _) = parts.as_chunks::<3>();
            let place = triples.iter().position(|[name, kind, count]| {
                is_species(name, kind) && text::integer(count) == Some(1)
            })?;
            let before = triples.iter().take(place);
            let widths = before
                .map(|[_, _, count]| text::integer(count))
                .map(|width| usize::try_from(width?).ok());
            widths.sum::<Option<usize>>()?
        }
        None => 0,
    };
    let name = text::words(first).nth(column)?;
    text::number(name).is_none().then_some(column)
}

/// The columns of plain text by the first atom: element (an attribute `type` if it is a number in
/// every line, numbers for the names if it is one there), x, y, z, and `column_5`... for what follows.
fn plain_columns(
    first: Option<Line<'_>>,
    budget: MemoryBudget,
) -> Result<TableColumns, ParseError> {
    let mut targets = vec![
        TargetArray::positions(),
        TargetArray::attribute("type", 1, NumberKind::WholeIfAll, TextPolicy::LeaveOut),
    ];
    let place = |target, component| Some(TargetComponent { target, component });
    let mut fields = vec![place(1, 0), place(0, 0), place(0, 1), place(0, 2)];
    let Some(first) = first else {
        return Ok((fields, targets));
    };
    let columns = text::words(first.text).count();
    if columns < 4 {
        let what = format!("an atom has an element and x y z, not {}", text::shown(first.text));
        return Err(ParseError::malformed(first.at, what));
    }
    budget.check((columns * COLUMN) as u64, "its columns in memory are")?;
    if name_column(b"", first.text).is_some() {
        targets[1] = TargetArray::category(NAME);
    }
    for column in 5..=columns {
        fields.push(place(targets.len(), 0));
        let name = format!("column_{column}");
        targets.push(TargetArray::attribute(name, 1, NumberKind::WholeIfAll, TextPolicy::LeaveOut));
    }
    Ok((fields, targets))
}

/// The columns by `name:type:count` triples, for atoms in `size` bytes that begin with the line `first`. They may take
/// as much as `budget` allows.
fn extended_columns(
    properties: &[u8],
    at: usize,
    (size, budget): (usize, MemoryBudget),
    first: Option<&[u8]>,
) -> Result<TableColumns, ParseError> {
    let malformed = |what: String| ParseError::malformed(at, what);
    let mut targets = vec![TargetArray::positions()];
    let mut fields = Vec::new();
    let mut positioned = false;
    let mut cells = first.map(text::words);
    let parts: Vec<&[u8]> = properties.split(|b| *b == b':').collect();
    let (triples, rest) = parts.as_chunks::<3>();
    budget.check((triples.len() * COLUMN) as u64, "its columns in memory are")?;
    if !rest.is_empty() {
        return Err(malformed("Properties are not name:type:count triples".into()));
    }
    for [name, kind, count] in triples {
        let components = text::integer(count).and_then(|count| usize::try_from(count).ok());
        let shown = text::shown(name);
        let Some(components @ 1..) = components else {
            let count = text::shown(count);
            return Err(malformed(format!("property {shown} has {count} columns")));
        };
        // A column takes two bytes, its separator included; without atoms none is looked at.
        if size > 0 && fields.len().saturating_add(components) > size / 2 + 1 {
            let what = format!("property {shown} has {components} columns, the atoms {size} bytes");
            return Err(malformed(what));
        }
        let columns = if size > 0 { components } else { 0 };
        let cell = cells.as_mut().and_then(Iterator::next);
        if columns > 1 {
            cells.as_mut().and_then(|cells| cells.nth(columns - 2));
        }
        let need = (fields.len().saturating_add(columns))
            .saturating_mul(size_of::<Option<TargetComponent>>());
        budget.check(need as u64, "its columns in memory are")?;
        let target = if is_position(name) && !positioned {
            if !matches!(components, 2 | 3) || !kind.eq_ignore_ascii_case(b"R") {
                return Err(malformed(format!("property {shown} is not a position")));
            }
            positioned = true;
            Some(0)
        } else {
            attribute(name, kind, components, cell).map(|attribute| {
                targets.push(attribute);
                targets.len() - 1
            })
        };
        fields.extend(
            (0..columns)
                .map(|component| target.map(|target| TargetComponent { target, component })),
        );
    }
    if !positioned {
        return Err(malformed("Properties name no positions (pos:R:3)".into()));
    }
    Ok((fields, targets))
}

fn is_position(name: &[u8]) -> bool {
    POSITION_PROPERTIES.iter().any(|known| name.eq_ignore_ascii_case(known.as_bytes()))
}

fn is_species(name: &[u8], kind: &[u8]) -> bool {
    let is_named = |known: &str| name.eq_ignore_ascii_case(known.as_bytes());
    kind.eq_ignore_ascii_case(b"S") && SPECIES_PROPERTIES.into_iter().any(is_named)
}

/// The array for a property whose first field is `cell`. Text and truth values have none, save species: given as
/// numbers, or by names.
fn attribute(
    name: &[u8],
    kind: &[u8],
    components: usize,
    cell: Option<&[u8]>,
) -> Option<TargetArray> {
    let is_name = || cell.is_some_and(|cell| text::number(cell).is_none());
    if components == 1 && is_species(name, kind) && is_name() {
        return Some(TargetArray::category(NAME));
    }
    let shown = String::from_utf8_lossy(name);
    match kind {
        b"R" | b"r" => Some((shown, NumberKind::Real, TextPolicy::Fault)),
        b"I" | b"i" => Some((shown, NumberKind::WholeIfAll, TextPolicy::Fault)),
        b"S" | b"s" if components == 1 && is_species(name, kind) => {
            Some(("type".into(), NumberKind::WholeIfAll, TextPolicy::LeaveOut))
        }
        _ => None,
    }
    .map(|(name, numbers, on_text)| TargetArray::attribute(name, components, numbers, on_text))
}
