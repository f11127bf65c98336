//! Rows of numbers in text to typed columns: in parallel pieces, in file order.
//!
//! A format's own module finds out where the rows are and what their fields mean ([`Table`]); here
//! is only the loop over lines and fields. Splitting is by hand and not by crate `csv` because the
//! same loop has to serve runs of blanks, decimal commas and comments, cut a file into pieces at
//! newlines, and name the byte of a fault.

use memchr::memchr;
use rayon::prelude::*;

use super::category;
use super::input::{LinePiece, TextInput};
use super::text::{self, Line, Lines};
use spherule_frame::{Attribute, MemoryBudget, ParseError, Positions};

mod cells;
mod grow;
mod values;

pub(super) use cells::cells;
use cells::is_blank;
use grow::GrowingColumn;
pub(super) use values::ColumnValues;

/// The message for a line that ends with the file.
pub const CUT_SHORT: &str = "the file is cut short, perhaps still being written";

/// What stands between two fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    /// Any run of blanks and tabs.
    Blanks,
    /// One byte, each time; a field may be empty, quoted, and padded with blanks.
    Byte(u8),
}

/// How numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Decimal {
    /// `1.5`
    Point,
    /// `1,5` or `1.5`
    Comma,
}

/// Lines that are not rows, beside blank ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Comments {
    /// There are none.
    None,
    /// What begins with `#` or `//`.
    HashOrSlashes,
}

/// What to do with more fields in a row than the table has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExtraCells {
    /// Pass over them.
    Ignored,
    /// They may only be empty (a separator at the end of each line).
    Empty,
}

/// How one row is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dialect {
    /// What stands between two fields.
    pub(super) separator: Separator,
    /// How numbers are written.
    pub(super) decimal: Decimal,
    /// Lines to pass over.
    pub(super) comments: Comments,
    /// What to do with more fields than expected.
    pub(super) surplus: ExtraCells,
}

/// The type that a target's numbers get.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberKind {
    /// f64 whatever they are.
    Real,
    /// i64 as long as every one of the file is an integer, else f64.
    WholeIfAll,
}

/// What to do if a field is not a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TextPolicy {
    /// The file is damaged.
    Fault,
    /// The column is text; leave it out.
    LeaveOut,
    /// Every field is a name, whatever it looks like; its number is kept ([`super::category`]).
    Category,
}

/// An array to fill: one or more numbers a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TargetArray {
    /// Name of the attribute that it becomes.
    pub(super) name: String,
    /// Numbers a row.
    pub(super) components: usize,
    /// Their type.
    pub(super) numbers: NumberKind,
    /// What to do with text.
    pub(super) on_text: TextPolicy,
}

impl TargetArray {
    /// An attribute of `components` numbers a row.
    pub(super) fn attribute(
        name: impl Into<String>,
        components: usize,
        numbers: NumberKind,
        on_text: TextPolicy,
    ) -> Self {
        Self { name: name.into(), components, numbers, on_text }
    }

    /// An attribute for a column of names.
    pub(super) fn category(name: impl Into<String>) -> Self {
        Self::attribute(name, 1, NumberKind::WholeIfAll, TextPolicy::Category)
    }

    /// The positions: three f64 a row. Components that no field fills stay 0 (2D runs).
    pub(super) fn positions() -> Self {
        Self {
            name: String::new(),
            components: 3,
            numbers: NumberKind::Real,
            on_text: TextPolicy::Fault,
        }
    }
}

/// The array component that a field is stored in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TargetComponent {
    /// Index of the target.
    pub(super) target: usize,
    /// Which of its numbers.
    pub(super) component: usize,
}

/// Rows to parse.
#[derive(Debug)]
pub(super) struct Table {
    /// How a row is written.
    pub(super) dialect: Dialect,
    /// The target of each field of a row; `None` skips it. A row has at least that many fields.
    pub(super) fields: Vec<Option<TargetComponent>>,
    /// The arrays to fill, positions first.
    pub(super) targets: Vec<TargetArray>,
    /// How many rows there may be: a guess, for which room is made.
    pub(super) rows: usize,
    /// Where users find a fault; `None` where only its byte is known.
    pub(super) labels: Option<RowLabels>,
}

/// What users know of the rows of a table.
#[derive(Debug)]
pub(super) struct RowLabels {
    /// Number of the first line in the file, from 1.
    pub(super) first_line: usize,
    /// Names of the columns; none if the file has none.
    pub(super) columns: Vec<String>,
}

/// Positions and attributes.
pub(super) type Particles = (Positions, Vec<Attribute>);

/// What came of the rows of a table.
#[derive(Debug)]
pub(super) struct RowsRead<T = Particles> {
    /// Lines found, including blank ones and those after a fault.
    pub(super) lines: usize,
    /// What is in them.
    pub(super) content: Result<T, ParseError>,
}

impl RowsRead {
    /// Of up to `most` lines that are not looked into because of `error`.
    pub(super) fn without(error: ParseError, text: &mut TextInput<'_>, most: usize) -> Self {
        Self { lines: text.pass_lines(most), content: Err(error) }
    }
}

impl Table {
    /// Parses up to `most` lines of `text`; the values are in the order of the targets, each `components` times the
    /// number of rows long. Some pieces are parsed at a time, so that little is held but the values.
    ///
    /// The error is [`ParseError::Malformed`] at the first field (in file order) that has no place or does not
    /// fit, whatever the number of threads; or [`ParseError::TooLarge`] if the values need more memory than
    /// `budget` allows.
    pub(super) fn parse(
        &self,
        text: &mut TextInput<'_>,
        most: usize,
        budget: MemoryBudget,
    ) -> RowsRead<Vec<ColumnValues>> {
        let mut values = GrowingColumn::new(&self.targets, self.rows, budget);
        let mut lines = 0;
        let fault = loop {
            let some = text.pieces(most - lines);
            if some.is_empty() {
                break None;
            }
            let parsed: Vec<Result<Vec<ColumnValues>, ParseError>> =
                some.par_iter().map(|piece| self.rows_of(piece).parse()).collect();
            let mut before = lines;
            lines += some.iter().map(|piece| piece.lines).sum::<usize>();
            let fault = some.iter().zip(parsed).find_map(|(piece, parsed)| {
                let parsed = parsed.map_err(|error| self.located(error, piece, before));
                before += piece.lines;
                parsed.and_then(|parsed| values.append(parsed)).err()
            });
            text.take_back(some);
            if fault.is_some() {
                lines += text.pass_lines(most - lines);
                break fault;
            }
        };
        RowsRead { lines, content: fault.map_or_else(|| Ok(values.into_values()), Err) }
    }

    /// [`Self::parse`] with target 0 taken for the positions and the rest for attributes.
    pub(super) fn particles(
        self,
        text: &mut TextInput<'_>,
        most: usize,
        budget: MemoryBudget,
    ) -> RowsRead {
        let read = self.parse(text, most, budget);
        RowsRead {
            lines: read.lines,
            content: read.content.map(|values| particles(self.targets, values)),
        }
    }

    /// `error` in `piece`, behind `before` lines of the rows, with its place in the file.
    fn located(&self, error: ParseError, piece: &LinePiece<'_>, before: usize) -> ParseError {
        let (Some(labels), ParseError::Malformed { at, .. }) = (&self.labels, &error) else {
            return error.behind(piece.at);
        };
        let passed = usize::try_from(*at).ok().and_then(|at| piece.bytes.get(..at));
        let passed = memchr::memchr_iter(b'\n', passed.unwrap_or_default()).count();
        let line = labels.first_line + before + passed;
        let message = |what: &str| match what.strip_prefix("line ") {
            Some(rest) => format!("line {line} {rest}"),
            None => format!("line {line}: {what}"),
        };
        error.map_message(message).behind(piece.at)
    }

    /// The name of a field for messages, or its number if the table has no names.
    fn label(&self, field: usize) -> String {
        let names = self.labels.as_ref().map(|labels| labels.columns.as_slice());
        let name = names.and_then(|names| names.get(field));
        name.filter(|name| !name.is_empty()).map_or_else(
            || format!("column {}", field + 1),
            |name| format!("column {}", text::shown(name.as_bytes())),
        )
    }

    fn rows_of<'t>(&'t self, piece: &'t LinePiece<'_>) -> Rows<'t> {
        Rows {
            bytes: &piece.bytes,
            ends_file: piece.ends_file,
            dialect: self.dialect,
            fields: &self.fields,
            targets: &self.targets,
            table: self,
        }
    }
}

/// The most rows of `fields` fields that `bytes` bytes can have, if none is empty.
pub(super) fn most_rows(bytes: usize, fields: usize) -> usize {
    // A field takes two bytes with what follows it.
    bytes / (2 * fields).max(1) + 1
}

/// Rows in memory.
struct Rows<'t> {
    bytes: &'t [u8],
    /// Whether the file ends with them.
    ends_file: bool,
    dialect: Dialect,
    fields: &'t [Option<TargetComponent>],
    targets: &'t [TargetArray],
    table: &'t Table,
}

fn particles(targets: Vec<TargetArray>, values: Vec<ColumnValues>) -> Particles {
    let mut values = values.into_iter();
    let positions = values.next().map_or(Positions::F64(Vec::new()), ColumnValues::into_positions);
    let attributes = targets
        .into_iter()
        .skip(1)
        .zip(values)
        .filter_map(|(target, values)| {
            Some(Attribute {
                name: target.name,
                components: target.components,
                data: values.into_data()?,
            })
        })
        .collect();
    (positions, attributes)
}

impl Rows<'_> {
    fn parse(&self) -> Result<Vec<ColumnValues>, ParseError> {
        let newlines = memchr::memchr_iter(b'\n', self.bytes).count();
        let rows = most_rows(self.bytes.len(), self.fields.len()).min(newlines + 1);
        let mut values: Vec<ColumnValues> = self
            .targets
            .iter()
            .map(|target| match target.numbers {
                NumberKind::Real => {
                    ColumnValues::Real(Vec::with_capacity(rows * target.components))
                }
                NumberKind::WholeIfAll => {
                    ColumnValues::Whole(Vec::with_capacity(rows * target.components))
                }
            })
            .collect();
        for line in Lines::new(self.bytes, 0..self.bytes.len()) {
            if line.is_blank() || self.dialect.comments.include(line.text) {
                continue;
            }
            for (target, values) in self.targets.iter().zip(&mut values) {
                values.add_row(target.components);
            }
            match self.dialect.separator {
                Separator::Blanks => self.row_of_words(line, &mut values)?,
                Separator::Byte(b) => self.row_of_cells(line, b, &mut values)?,
            }
        }
        Ok(values)
    }

    fn row_of_words(&self, line: Line<'_>, values: &mut [ColumnValues]) -> Result<(), ParseError> {
        let text = line.text;
        let mut found = 0;
        let mut at = 0;
        loop {
            while at < text.len() && is_blank(text[at]) {
                at += 1;
            }
            if at == text.len() {
                break;
            }
            let start = at;
            while at < text.len() && !is_blank(text[at]) {
                at += 1;
            }
            if found == self.fields.len() {
                match self.dialect.surplus {
                    ExtraCells::Ignored => return Ok(()),
                    ExtraCells::Empty => return Err(self.surplus(line.at + start)),
                }
            }
            self.store(found, &text[start..at], line.at + start, values)?;
            found += 1;
        }
        self.check_count(line, found)
    }

    fn row_of_cells(
        &self,
        line: Line<'_>,
        separator: u8,
        values: &mut [ColumnValues],
    ) -> Result<(), ParseError> {
        let mut found = 0;
        for cell in cells(line.text, separator) {
            let at = line.at + cell.at;
            if found < self.fields.len() {
                self.store(found, cell.text, at, values)?;
                found += 1;
            } else if self.dialect.surplus == ExtraCells::Ignored {
                return Ok(());
            } else if !cell.text.is_empty() {
                return Err(self.surplus(at));
            }
        }
        self.check_count(line, found)
    }

    #[inline]
    fn store(
        &self,
        field: usize,
        token: &[u8],
        at: usize,
        values: &mut [ColumnValues],
    ) -> Result<(), ParseError> {
        let Some(place) = self.fields[field] else {
            return Ok(());
        };
        let TargetArray { components, on_text, .. } = self.targets[place.target];
        let from_end = components - place.component;
        if on_text == TextPolicy::Category {
            values[place.target].set_whole(from_end, category::code(token));
            return Ok(());
        }
        if values[place.target].set(from_end, token, self.dialect.decimal) {
            return Ok(());
        }
        if on_text == TextPolicy::LeaveOut {
            values[place.target] = ColumnValues::Text;
            return Ok(());
        }
        let column = self.table.label(field);
        let what = format!("{column} has {}, not a number", text::shown(token));
        Err(ParseError::malformed(at, self.with_cause(at, what)))
    }

    fn check_count(&self, line: Line<'_>, found: usize) -> Result<(), ParseError> {
        if found >= self.fields.len() {
            return Ok(());
        }
        let what = format!("line has {found} of {} columns", self.fields.len());
        Err(ParseError::malformed(line.at, self.with_cause(line.at, what)))
    }

    fn surplus(&self, at: usize) -> ParseError {
        ParseError::malformed(at, format!("line has more than {} columns", self.fields.len()))
    }

    /// Adds the likely cause if the fault at byte `at` is in an unfinished last line.
    fn with_cause(&self, at: usize, what: String) -> String {
        let rest = self.bytes.get(at..).unwrap_or_default();
        if self.ends_file && memchr(b'\n', rest).is_none() {
            format!("{what}: {CUT_SHORT}")
        } else {
            what
        }
    }
}

impl Comments {
    /// True if the line `text` is a comment.
    pub(super) fn include(self, text: &[u8]) -> bool {
        let text = text.trim_ascii_start();
        self == Self::HashOrSlashes && (text.starts_with(b"#") || text.starts_with(b"//"))
    }
}

#[cfg(test)]
mod tests;
