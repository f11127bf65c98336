//! GROMACS `.gro` files: text with fixed columns, one or many frames.
//!
//! A frame is a title (perhaps with `t=` and `step=`), the number of atoms, a line for each atom, and the box. After
//! the page `gro` of the GROMACS manual. Lengths are nm, velocities nm/ps, times ps.

use super::atoms::{self, AtomTable, ELEMENT, RESIDUE, coordinate, field};
use super::beads::Beads;
use super::input::TextInput;
use super::sniff::is_text;
use super::text::{self, Line};
use super::{ByteSource, CUT_SHORT, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles, SimulationCell, names};

/// GROMACS `.gro` files.
pub const FORMAT: Format = Format::new(&Gro);

struct Gro;

impl Reader for Gro {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            angstrom: 0.1,
            time_unit: Some("ps"),
            ..FormatInfo::molecular("gro", &["gro"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        if !is_text(head) {
            return Ok(Confidence::No);
        }
        let mut text = TextInput::whole(head);
        let title_is_count = text.line().is_some_and(|line| count(line).is_ok());
        let has_count = text.line().is_some_and(|line| count(line).is_ok());
        let first = text.line();
        let is_atom = first.is_some_and(|line| {
            let numbers = [field(line.text, 0, 5), field(line.text, 15, 20)];
            numbers.iter().all(|number| text::integer(number).is_some())
                && Columns::of(line).is_ok_and(|columns| columns.position(line).is_ok())
        });
        Ok(if has_count && is_atom && !title_is_count {
            Confidence::Signature
        } else if has_count || is_atom || text.is_at_end() {
            // Without a count: a damaged one, or a file that is still being written.
            Confidence::IfNamed
        } else {
            Confidence::No
        })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        steps(source.text(), budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), step, budget)
    }

    fn notes(&self, _head: &[u8]) -> Vec<String> {
        vec![
            notes::units("nm", Some("nm/ps"), Some("ps")),
            notes::GUESSED_ELEMENTS.to_owned(),
            notes::cell_note(None),
        ]
    }
}

/// The frames. If there is something else than a count in the second line of one, the rest of the file is one last
/// step, so that reading it gives the error.
fn steps(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    let mut steps = Vec::new();
    while let Some(title) = text.line() {
        let (at, is_blank) = (title.at, title.is_blank());
        let (number, time) = (number(title.text), time(title.text));
        // A title may be blank, but blank lines may also end the file.
        let count = match text.peek_line() {
            None if is_blank => continue,
            Some(line) if is_blank && line.is_blank() => continue,
            line => line.map(count),
        };
        let lines = match count {
            Some(Ok(count)) => count.saturating_add(2),
            _ => usize::MAX,
        };
        text.pass_lines(lines);
        Step::push(&mut steps, at..text.at(), budget)?;
        if let Some(step) = steps.last_mut() {
            (step.number, step.time) = (number, time);
        }
    }
    Ok(steps)
}

fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    text.go_to(range.start);
    text.end_at(range.end);
    let Some(title) = text.line() else {
        return Err(cut_short(text, "no title".into()));
    };
    let (number, time) = (self::number(title.text), time(title.text));
    let Some(line) = text.line() else {
        return Err(cut_short(text, "no number of atoms after the title".into()));
    };
    let count = count(line)?;
    let columns =
        text.peek_line().filter(|_| count > 0).map(Columns::of).transpose()?.unwrap_or_default();
    let velocity = [("velocity", 3)];
    let real = &velocity[..usize::from(columns.has_velocity)];
    let texts = [names::RESIDUE_NAME, names::ATOM_NAME];
    let mut atoms = AtomTable::new(&[ELEMENT, RESIDUE], real, &texts, budget);
    let mut beads = Beads::default();
    for index in 0..count {
        let Some(line) = text.line() else {
            let what = format!("{count} atoms expected, {index} lines follow");
            return Err(cut_short(text, what));
        };
        let position = columns.position(line)?;
        let velocity = columns.velocity(line)?;
        let real = &velocity[..if columns.has_velocity { 3 } else { 0 }];
        let name = field(line.text, 10, 15);
        let residue_name = field(line.text, 5, 10);
        let element = atoms::element(b"", name, residue_name);
        let residue = text::integer(field(line.text, 0, 5)).unwrap_or_default();
        atoms.push(position, &[element, residue], real, &[residue_name, name])?;
        beads.push(name, residue_name);
    }
    let Some(cell) = text.line().filter(|line| is_box(*line)).map(cell) else {
        return Err(cut_short(text, format!("no box after {count} atoms")));
    };
    let mut particles = atoms.into_particles();
    particles.attributes.extend(beads.attribute());
    Ok(RawParticles { time, step: number, cell, ..particles })
}

fn cut_short(text: &TextInput<'_>, what: String) -> ParseError {
    ParseError::malformed(text.at(), format!("{what}: {CUT_SHORT}"))
}

/// The number of atoms, alone in its line.
fn count(line: Line<'_>) -> Result<usize, ParseError> {
    let token = line.text.trim_ascii();
    let count = text::integer(token).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let what = format!("{} is not a number of atoms", text::shown(token));
        ParseError::malformed(line.at, what)
    })
}

/// Three lengths, or nine components of vectors. Those of large boxes have no blanks between them.
fn is_box(line: Line<'_>) -> bool {
    let is_part = |b: &u8| b.is_ascii_digit() || b" \t.+-eE".contains(b);
    let points = memchr::memchr_iter(b'.', line.text).count();
    line.text.iter().all(is_part) && (points >= 3 || text::words(line.text).count() >= 3)
}

/// The cell in the line of the box: the diagonal of the matrix of its edges, and the other components if not all are
/// zero. None if the numbers are damaged, or zero.
pub(super) fn cell(line: Line<'_>) -> Option<SimulationCell> {
    let numbers: Option<Vec<f64>> = match text::words(line.text).count() {
        3 | 9 => text::words(line.text).map(text::number).collect(),
        // Columns of equal width
        _ => {
            let mut points = memchr::memchr_iter(b'.', line.text);
            let width = points.next().zip(points.next()).map(|(x, y)| y - x)?;
            let columns = line.text.trim_ascii_end().chunks(width);
            columns.map(|column| text::number(column.trim_ascii())).collect()
        }
    };
    let numbers = numbers?;
    let [x, y, z, rest @ ..] = numbers.as_slice() else {
        return None;
    };
    let [ay, az, bx, bz, cx, cy] = match rest {
        [] => [0.0; 6],
        rest => rest.try_into().ok()?,
    };
    SimulationCell::from_components([*x, ay, az, bx, *y, bz, cx, cy, *z])
}

/// Where positions and velocities are in the lines of a frame.
#[derive(Debug, Clone, Copy, Default)]
struct Columns {
    /// Columns of a number, which follow from the distance of the decimal points.
    width: usize,
    has_velocity: bool,
}

/// The column of x.
const FIRST: usize = 20;

impl Columns {
    /// The columns of a frame whose first atom is in `line`.
    fn of(line: Line<'_>) -> Result<Self, ParseError> {
        let numbers = line.text.get(FIRST..).unwrap_or_default();
        let mut points = memchr::memchr_iter(b'.', numbers);
        let width = points.next().zip(points.next()).map(|(x, y)| y - x);
        let Some(width @ 2..) = width else {
            let what = format!(
                "an atom has its position from column 21 on, not {}",
                text::shown(line.text)
            );
            return Err(ParseError::malformed(line.at, what));
        };
        Ok(Self {
            width,
            has_velocity: !field(line.text, FIRST + 3 * width, FIRST + 6 * width).is_empty(),
        })
    }

    fn position(self, line: Line<'_>) -> Result<[f64; 3], ParseError> {
        self.triple(line, 0)
    }

    /// Zeros without velocities, which single atoms may lack.
    fn velocity(self, line: Line<'_>) -> Result<[f64; 3], ParseError> {
        let first = FIRST + 3 * self.width;
        if self.has_velocity && !field(line.text, first, first + 3 * self.width).is_empty() {
            self.triple(line, 3)
        } else {
            Ok([0.0; 3])
        }
    }

    /// Three numbers, from the number `first` on.
    fn triple(self, line: Line<'_>, first: usize) -> Result<[f64; 3], ParseError> {
        let mut triple = [0.0; 3];
        for (index, number) in triple.iter_mut().enumerate() {
            let start = FIRST + (first + index) * self.width;
            *number = coordinate(line, start, start + self.width)?;
        }
        Ok(triple)
    }
}

/// The number after `t=` in a title.
fn time(title: &[u8]) -> Option<f64> {
    text::number(value(title, b"t=")?)
}

/// The number after `step=` in a title.
fn number(title: &[u8]) -> Option<i64> {
    text::integer(value(title, b"step=")?)
}

/// The word after the last `key` in a title that begins a word.
fn value<'a>(title: &'a [u8], key: &[u8]) -> Option<&'a [u8]> {
    let begins_word = |at: &usize| *at == 0 || title[at - 1].is_ascii_whitespace();
    let places = memchr::memmem::find_iter(title, key);
    let at = places.filter(begins_word).last()?;
    text::words(&title[at + key.len()..]).next()
}
