//! Where the table in a text is: the separator by evidence, the line with the names, the first row.

use std::ops::Range;

use super::{BYTE_ORDER_MARK, names};
use crate::read::table::{Comments, Decimal, Dialect, ExtraCells, Separator, cells};
use crate::read::text::{self, Line, Lines};
use spherule_frame::ParseError;

/// What was found out about a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TableLayout {
    /// How rows are written.
    pub(super) dialect: Dialect,
    /// Cleaned names of the columns, if there are any.
    pub(super) names: Option<Vec<String>>,
    /// Number of columns.
    pub(super) columns: usize,
    /// The bytes with the rows.
    pub(super) rows: Range<usize>,
    /// Simulation time, if a line before the names has it.
    pub(super) time: Option<f64>,
    /// Where the names are.
    names_at: usize,
}

/// The separators to choose from; of those with the same evidence the first is taken.
const SEPARATORS: [Separator; 4] =
    [Separator::Byte(b';'), Separator::Byte(b'\t'), Separator::Byte(b','), Separator::Blanks];

/// Lines and bytes to weigh separators on; many columns make long lines.
const SAMPLE_LINES: usize = 200;
const SAMPLE_BYTES: usize = 1 << 20;

/// Lines of numbers that may come before the names.
const LINES_OF_FACTS: usize = 32;

impl TableLayout {
    /// Finds the table.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if there are neither three numbers in a line nor names of
    /// positions, [`ParseError::Unsupported`] for UTF-16.
    pub(super) fn find(bytes: &[u8]) -> Result<Self, ParseError> {
        if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
            return Err(ParseError::unsupported("UTF-16 text: save the table as UTF-8"));
        }
        let start = match bytes.strip_prefix(BYTE_ORDER_MARK) {
            Some(_) => BYTE_ORDER_MARK.len(),
            None => 0,
        };
        let lines = Lines::new(bytes, start..bytes.len());
        let dialect = dialect(lines.clone());
        LayoutSearch { dialect, time: None, candidate: None, comment: None, passed: None }
            .run(lines, bytes.len())
    }

    /// The error for `names` without positions.
    pub(super) fn no_positions(&self, names: &[String]) -> ParseError {
        let listed = names.iter().take(8).map(|name| text::shown(name.as_bytes()));
        let what = format!(
            "no positions among the columns {}: name them x, y, z or Points:0, Points:1, Points:2",
            listed.collect::<Vec<_>>().join(", ")
        );
        ParseError::malformed(self.names_at, what)
    }
}

/// The walk to the first row.
struct LayoutSearch<'a> {
    dialect: Dialect,
    time: Option<f64>,
    /// The last line that could name columns, none of them a position.
    candidate: Option<Line<'a>>,
    /// The last comment.
    comment: Option<Line<'a>>,
    /// The first line that is nothing of a table.
    passed: Option<Line<'a>>,
}

impl<'a> LayoutSearch<'a> {
    fn run(mut self, mut lines: Lines<'a>, end: usize) -> Result<TableLayout, ParseError> {
        loop {
            let at = lines.at();
            let Some(line) = lines.next() else {
                break;
            };
            if line.is_blank() {
                continue;
            }
            if self.dialect.comments.include(line.text) {
                self.comment = Some(line);
                continue;
            }
            let cells = split(line.text, self.dialect.separator);
            let names = clean(&cells);
            if names::position(&names).is_some() {
                return Ok(self.layout(Some(names), cells.len(), line.at, lines.at()..end));
            }
            let is_number = |cell: &&&[u8]| number(cell, self.dialect.decimal).is_some();
            if cells.iter().filter(is_number).count() >= 3 {
                if !self.names_follow(lines.clone()) {
                    return self.first_row(&cells, at..end);
                }
                self.note_time(&cells);
                continue;
            }
            if cells.len() >= 3 {
                self.candidate = Some(line);
                continue;
            }
            match &cells[..] {
                [name, value] if is_time(name) => {
                    self.time = number(value, self.dialect.decimal);
                }
                _ => {
                    self.passed.get_or_insert(line);
                }
            }
        }
        if let Some(line) = self.candidate {
            let names = clean(&split(line.text, self.dialect.separator));
            let columns = names.len();
            return Ok(self.layout(Some(names), columns, line.at, end..end));
        }
        let what = "no row of 3 or more numbers and no line of column names";
        Err(ParseError::malformed(lines.at(), what))
    }

    /// True if positions are named soon: then the numbers so far belong to a table of facts about
    /// the run, as DualSPHysics may put before the particles.
    fn names_follow(&self, lines: Lines<'_>) -> bool {
        lines.take(LINES_OF_FACTS).filter(|line| !self.dialect.comments.include(line.text)).any(
            |line| names::position(&clean(&split(line.text, self.dialect.separator))).is_some(),
        )
    }

    /// Takes the time from a row of facts.
    fn note_time(&mut self, facts: &[&[u8]]) {
        let Some(line) = self.candidate.take() else {
            return;
        };
        let names = split(line.text, self.dialect.separator);
        let time = names.iter().zip(facts).find(|(name, _)| is_time(name));
        if let Some((_, time)) = time {
            self.time = number(time, self.dialect.decimal);
        }
    }

    /// A row of numbers: the names are in a comment, or in a line without positions (which is an
    /// error to come), or there are none. Without names, nothing but comments and a time may come before the row:
    /// numbers behind other lines are those of another format.
    fn first_row(self, cells: &[&[u8]], rows: Range<usize>) -> Result<TableLayout, ParseError> {
        let columns = cells.len();
        if let Some(line) = self.candidate {
            let names = clean(&split(line.text, self.dialect.separator));
            return Ok(self.layout(Some(names), columns, line.at, rows));
        }
        if let Some(line) = self.comment {
            let text = line.text.trim_ascii_start();
            let marks = text.iter().take_while(|b| b"#/ \t".contains(b)).count();
            // Yade writes `#format x_y_z_r`
            let text = &text[marks..];
            let text = text.strip_prefix(b"format ").map_or(text, <[u8]>::trim_ascii);
            let separators = [self.dialect.separator].into_iter().chain(SEPARATORS);
            for separator in separators.chain([Separator::Byte(b'_')]) {
                let names = clean(&split(text, separator));
                if names.len() == columns && names::position(&names).is_some() {
                    return Ok(self.layout(Some(names), columns, line.at, rows));
                }
            }
        }
        if let Some(line) = self.passed {
            let what = format!(
                "numbers without names of columns follow {}: put # before this line, or write names of columns such as \
                 x y z below it",
                text::shown(line.text)
            );
            return Err(ParseError::malformed(line.at, what));
        }
        let leading = cells.iter().take(3);
        if leading
            .into_iter()
            .all(|cell| cell.is_empty() || number(cell, self.dialect.decimal).is_some())
        {
            let at = rows.start;
            return Ok(self.layout(None, columns, at, rows));
        }
        let what = "no column names, and the first three columns are not numbers";
        Err(ParseError::malformed(rows.start, what))
    }

    fn layout(
        &self,
        names: Option<Vec<String>>,
        columns: usize,
        names_at: usize,
        rows: Range<usize>,
    ) -> TableLayout {
        TableLayout { dialect: self.dialect, names, columns, rows, time: self.time, names_at }
    }
}

/// The separator that splits a sample into the most numbers, in rows of the same length; a sample
/// without rows of numbers is chosen by the names of positions.
fn dialect(lines: Lines<'_>) -> Dialect {
    let start = lines.at();
    let comments = Comments::HashOrSlashes;
    let sample: Vec<&[u8]> = lines
        .filter(|line| !line.is_blank() && !comments.include(line.text))
        .take_while(|line| line.at - start < SAMPLE_BYTES)
        .take(SAMPLE_LINES)
        .map(|line| line.text)
        .collect();
    let mut best = (0, SEPARATORS[0]);
    for separator in SEPARATORS {
        let evidence = evidence(&sample, separator);
        if evidence > best.0 {
            best = (evidence, separator);
        }
    }
    let named = |separator: &Separator| {
        sample.iter().any(|line| names::position(&clean(&split(line, *separator))).is_some())
    };
    let longest = |separator: &Separator| {
        let counts = sample.iter().map(|line| split(line, *separator).len());
        counts.max()
    };
    let separator = if best.0 > 0 {
        best.1
    } else if let Some(separator) = SEPARATORS.into_iter().find(named) {
        separator
    } else {
        SEPARATORS.into_iter().max_by_key(longest).unwrap_or(best.1)
    };
    Dialect { separator, decimal: decimal(separator), comments, surplus: ExtraCells::Empty }
}

/// A comma can only be the decimal point if it separates nothing.
fn decimal(separator: Separator) -> Decimal {
    if separator == Separator::Byte(b',') { Decimal::Point } else { Decimal::Comma }
}

/// Numbers, less cells of text, in the rows of the most frequent length.
fn evidence(sample: &[&[u8]], separator: Separator) -> i64 {
    // Per number of cells: rows, and numbers less texts in them.
    let mut by_length: std::collections::BTreeMap<usize, (i64, i64)> = Default::default();
    for line in sample {
        let cells = split(line, separator);
        let weigh = |cell: &&[u8]| match number(cell, decimal(separator)) {
            Some(_) => 1,
            None if cell.is_empty() => 0,
            None => -1,
        };
        let weight: i64 = cells.iter().map(weigh).sum();
        if cells.len() >= 2 && weight > 0 {
            let (rows, weights) = by_length.entry(cells.len()).or_default();
            *rows += 1;
            *weights += weight;
        }
    }
    let most = by_length.into_values().max();
    most.map_or(0, |(_, weights)| weights)
}

/// The cells of a line, without the empty ones after its last separators.
fn split(line: &[u8], separator: Separator) -> Vec<&[u8]> {
    let mut found: Vec<&[u8]> = match separator {
        Separator::Blanks => text::words(line).collect(),
        Separator::Byte(b) => cells(line, b).map(|cell| cell.text).collect(),
    };
    while found.last().is_some_and(|cell| cell.is_empty()) {
        found.pop();
    }
    found
}

fn is_time(name: &[u8]) -> bool {
    name.get(..4).is_some_and(|start| start.eq_ignore_ascii_case(b"time"))
}

fn clean(cells: &[&[u8]]) -> Vec<String> {
    cells.iter().map(|cell| names::clean(cell)).collect()
}

fn number(cell: &[u8], decimal: Decimal) -> Option<f64> {
    match decimal {
        Decimal::Point => text::number(cell),
        Decimal::Comma => text::number_with_comma(cell),
    }
}
