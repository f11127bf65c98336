//! The `ITEM:` lines before the atoms of a step.

use super::ITEM;
use super::bounds::{Axis, Bounds, periodic_axes};
use crate::read::Step;
use crate::read::input::TextInput;
use crate::read::table::CUT_SHORT;
use crate::read::text::{self, Line};
use spherule_frame::{MemoryBudget, ParseError};

/// What a header line announces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DumpItem {
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

impl DumpItem {
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

/// The header lines before the first atom.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DumpHeader {
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
    /// Whether the boundaries of each axis are periodic.
    pub(super) periodic: [bool; 3],
    /// Where the columns are named.
    pub(super) names_at: usize,
    /// Names of the columns.
    pub(super) names: Vec<Vec<u8>>,
}

/// Why a header could not be read.
#[derive(Debug)]
pub(super) enum HeaderFault {
    /// It ends here.
    Ends(usize),
    /// It is wrong.
    Wrong(ParseError),
}

impl From<ParseError> for HeaderFault {
    fn from(error: ParseError) -> Self {
        Self::Wrong(error)
    }
}

impl HeaderFault {
    /// The error for `step`, whose header ends where `text` is. What is wrong in the last line of the file is
    /// wrong because the rest is missing.
    pub(super) fn explain(self, text: &mut TextInput<'_>, step: &Step) -> ParseError {
        match self {
            Self::Ends(at) => cut_short(text, step, at, "the header of the step ends here"),
            Self::Wrong(error @ ParseError::Malformed { .. })
                if !text.is_behind_newline() && text.is_file_end() =>
            {
                error.map_message(|what| format!("{what}: {CUT_SHORT}"))
            }
            Self::Wrong(error) => error,
        }
    }
}

/// The error for a step that has too little; distinguishes the end of the file from a later step.
pub(super) fn cut_short(
    text: &mut TextInput<'_>,
    step: &Step,
    at: usize,
    what: &str,
) -> ParseError {
    let why = if text.is_file_end() {
        CUT_SHORT.to_owned()
    } else {
        let end = step.byte_range().map_or(usize::MAX, |range| range.end);
        format!("the step is cut short at byte {end}, where the next one begins")
    };
    ParseError::malformed(at, format!("{what}: {why}"))
}

/// Bytes that a column takes on the way to its array, with its name.
const COLUMN: usize = 256;

impl DumpHeader {
    /// Reads up to and including the `ITEM: ATOMS` line. Its columns may take as much as `budget` allows.
    pub(super) fn parse(
        text: &mut TextInput<'_>,
        budget: MemoryBudget,
    ) -> Result<Self, HeaderFault> {
        let mut header = Self {
            number: None,
            time: None,
            count: 0,
            count_at: 0,
            bounds: None,
            periodic: [true; 3],
            names_at: 0,
            names: Vec::new(),
        };
        let mut count = None;
        loop {
            let Some(line) = text.line() else {
                return Err(HeaderFault::Ends(text.at()));
            };
            if !line.text.starts_with(ITEM) {
                continue; // the value of an item unknown here
            }
            match DumpItem::of(line.text) {
                DumpItem::TimeStep => header.number = Some(step_number(value(text)?)?),
                DumpItem::Time => header.time = text::number(value(text)?.text.trim_ascii()),
                DumpItem::Count => {
                    let line = value(text)?;
                    header.count_at = line.at;
                    count = Some(atom_count(line)?);
                }
                DumpItem::Bounds => {
                    header.periodic = periodic_axes(line.text);
                    let mut axis = || value(text).map(Axis::parse);
                    header.bounds = Some(Bounds::new([axis()?, axis()?, axis()?])?);
                }
                DumpItem::Foreign => {
                    let what = "a dump of entries or grid cells, not of atoms: use dump custom";
                    return Err(ParseError::unsupported(what).into());
                }
                DumpItem::Atoms => {
                    let columns = text::words(line.text).count();
                    let need = columns.saturating_mul(COLUMN) as u64;
                    budget.check(need, "its columns in memory are")?;
                    header.names_at = line.at;
                    header.names = text::words(line.text).skip(2).map(<[u8]>::to_vec).collect();
                    break;
                }
                DumpItem::Other => {}
            }
        }
        header.count = count.ok_or_else(|| {
            ParseError::malformed(header.names_at, "atoms without ITEM: NUMBER OF ATOMS before")
        })?;
        Ok(header)
    }
}

fn step_number(line: Line<'_>) -> Result<i64, ParseError> {
    let token = line.text.trim_ascii();
    text::integer(token).ok_or_else(|| {
        let what = format!("the step is {}, not an integer", text::shown(token));
        ParseError::malformed(line.at, what)
    })
}

/// The line with the value of an item.
fn value<'t>(text: &'t mut TextInput<'_>) -> Result<Line<'t>, HeaderFault> {
    let at = text.at();
    text.line().ok_or(HeaderFault::Ends(at))
}

fn atom_count(line: Line<'_>) -> Result<usize, ParseError> {
    let token = line.text.trim_ascii();
    let count = text::integer(token).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let what = format!("{} is not a number of atoms", text::shown(token));
        ParseError::malformed(line.at, what)
    })
}
