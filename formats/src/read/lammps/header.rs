//! The `ITEM:` lines before the atoms of a step.

use super::ITEM;
use super::bounds::Bounds;
use crate::ParseError;
use crate::read::Step;
use crate::read::table::CUT_SHORT;
use crate::read::text::{self, Line, Lines};

/// What a header line announces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Item {
    /// The number of the step.
    TimeStep,
    /// Simulation time (`dump_modify time yes`).
    Time,
    /// How many atoms there are.
    Count,
    /// The box.
    Bounds,
    /// The atoms and the names of their columns.
    Atoms,
    /// Rows of something else (`dump local`, `dump grid`).
    Foreign,
    /// `UNITS`, and what other programs may add.
    Other,
}

impl Item {
    /// What `line` announces; it begins with `ITEM:`.
    pub(super) fn of(line: &[u8]) -> Self {
        let rest = line.strip_prefix(ITEM).unwrap_or(line).trim_ascii_start();
        let begins = |name: &str| {
            rest.strip_prefix(name.as_bytes())
                .is_some_and(|tail| tail.first().is_none_or(u8::is_ascii_whitespace))
        };
        if begins("TIMESTEP") {
            Self::TimeStep
        } else if begins("TIME") {
            Self::Time
        } else if begins("NUMBER OF ATOMS") {
            Self::Count
        } else if begins("BOX BOUNDS") {
            Self::Bounds
        } else if begins("ATOMS") {
            Self::Atoms
        } else if begins("ENTRIES") || begins("GRID CELLS") {
            Self::Foreign
        } else {
            Self::Other
        }
    }
}

/// All that is said before the first atom.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header<'a> {
    /// Number of the step.
    pub(super) number: Option<i64>,
    /// Simulation time.
    pub(super) time: Option<f64>,
    /// Atoms announced.
    pub(super) count: usize,
    /// Where they are announced.
    pub(super) count_at: usize,
    /// The box, if given.
    pub(super) bounds: Option<Bounds>,
    /// Where the columns are named.
    pub(super) names_at: usize,
    /// Names of the columns.
    pub(super) names: Vec<&'a [u8]>,
}

/// Why a header could not be read.
#[derive(Debug)]
pub(super) enum Fault {
    /// It ends here.
    Ends(usize),
    /// It is wrong.
    Wrong(ParseError),
}

impl From<ParseError> for Fault {
    fn from(error: ParseError) -> Self {
        Self::Wrong(error)
    }
}

impl Fault {
    /// The error for `step` of the file `bytes`. What is wrong in the last line of the file is
    /// wrong because the rest is missing.
    pub(super) fn explain(self, bytes: &[u8], step: &Step) -> ParseError {
        match self {
            Self::Ends(at) => cut_short(bytes, step, at, "the header of the step ends here"),
            Self::Wrong(error @ ParseError::Malformed { at, .. })
                if usize::try_from(at).is_ok_and(|at| {
                    memchr::memchr(b'\n', bytes.get(at..).unwrap_or_default()).is_none()
                }) =>
            {
                error.retold(|what| format!("{what}: {CUT_SHORT}"))
            }
            Self::Wrong(error) => error,
        }
    }
}

/// The error for a step that has too little; the file's end and a later step are told apart.
pub(super) fn cut_short(bytes: &[u8], step: &Step, at: usize, what: &str) -> ParseError {
    let end = step.span.end;
    let why = if end >= bytes.len() {
        CUT_SHORT.to_owned()
    } else {
        format!("the step is broken off at byte {end}, where the next one begins")
    };
    ParseError::malformed(at, format!("{what}: {why}"))
}

impl<'a> Header<'a> {
    /// Reads up to and including the `ITEM: ATOMS` line.
    pub(super) fn parse(lines: &mut Lines<'a>) -> Result<Self, Fault> {
        let mut header = Self {
            number: None,
            time: None,
            count: 0,
            count_at: 0,
            bounds: None,
            names_at: 0,
            names: Vec::new(),
        };
        let mut count = None;
        loop {
            let line = lines.next().ok_or(Fault::Ends(lines.at()))?;
            if !line.text.starts_with(ITEM) {
                continue; // the value of an item unknown here
            }
            match Item::of(line.text) {
                Item::TimeStep => header.number = Some(header.step_number(value(lines)?)?),
                Item::Time => header.time = text::number(value(lines)?.text.trim_ascii()),
                Item::Count => {
                    let line = value(lines)?;
                    header.count_at = line.at;
                    count = Some(atom_count(line)?);
                }
                Item::Bounds => {
                    let axes = [value(lines)?, value(lines)?, value(lines)?];
                    header.bounds = Some(Bounds::parse(axes)?);
                }
                Item::Foreign => {
                    let what = "a dump of entries or grid cells, not of atoms: use dump custom";
                    return Err(ParseError::unsupported(what).into());
                }
                Item::Atoms => {
                    header.names_at = line.at;
                    header.names = text::words(line.text).skip(2).collect();
                    break;
                }
                Item::Other => {}
            }
        }
        header.count = count.ok_or_else(|| {
            ParseError::malformed(
                header.names_at,
                "atoms without ITEM: NUMBER OF ATOMS before",
            )
        })?;
        Ok(header)
    }

    fn step_number(&self, line: Line<'_>) -> Result<i64, ParseError> {
        let token = line.text.trim_ascii();
        text::integer(token).ok_or_else(|| {
            let what = format!("the step is {}, not an integer", text::shown(token));
            ParseError::malformed(line.at, what)
        })
    }
}

/// The line with the value of an item.
fn value<'a>(lines: &mut Lines<'a>) -> Result<Line<'a>, Fault> {
    lines.next().ok_or(Fault::Ends(lines.at()))
}

fn atom_count(line: Line<'_>) -> Result<usize, ParseError> {
    let token = line.text.trim_ascii();
    let count = text::integer(token).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let what = format!("{} is no number of atoms", text::shown(token));
        ParseError::malformed(line.at, what)
    })
}
