//! AMBER restart files in text (`.rst7`, `.inpcrd`, `.restrt`): one time step.
//!
//! A title; the number of atoms, perhaps with the time in ps; positions, six numbers of twelve columns in a line
//! (Fortran's 6F12.7). Velocities may follow in the same form, and a line with the lengths and angles of the box.
//! Lengths are A. After the description of the format in the AMBER manual.

use super::fixed_rows::{RowNumbers, read_row};
use super::input::TextInput;
use super::sniff::is_text;
use super::table::ColumnValues;
use super::text::{self, Line, Lines};
use super::{ByteSource, CUT_SHORT, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{
    Attribute, AttributeData, MemoryBudget, ParseError, RawParticles, SimulationCell,
};

/// AMBER restart files in text.
pub const FORMAT: Format = Format::new(&Rst7);

struct Rst7;

/// Columns of a number, and where its decimal point is.
const WIDTH: usize = 12;
const POINT: usize = 4;
/// Numbers in a line.
const PER_LINE: usize = 6;
/// Angstroms per ps in a unit of velocity: AMBER's unit of time is 1 / 20.455 ps.
const VELOCITY_UNIT: f64 = 20.455;
/// No box is shorter, A. Velocities are hardly ever that large.
const MIN_BOX: f64 = 2.0;

impl Reader for Rst7 {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: false,
            notes_need_whole_file: true,
            time_unit: Some("ps"),
            ..FormatInfo::molecular("rst7", &["rst7", "inpcrd", "restrt"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut lines = Lines::new(head, 0..head.len());
        let is_title = is_text(head) && lines.next().is_some();
        let has_heading = lines.next().is_some_and(|line| Heading::of(line).is_ok());
        Ok(match lines.next() {
            _ if !is_title => Confidence::No,
            Some(row) if has_heading && is_row(row.text) => Confidence::Signature,
            // Damaged, or still being written
            Some(row) if has_heading || is_row(row.text) => Confidence::IfNamed,
            None => Confidence::IfNamed,
            Some(_) => Confidence::No,
        })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let text = source.text();
        let mut step = Step::whole(text.left_about());
        let heading = Lines::new(text.head(), 0..text.head().len()).nth(1);
        step.time = heading.and_then(|line| Heading::of(line).ok()?.time);
        Ok(vec![step])
    }

    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), budget)
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let mut notes = vec![notes::units("angstroms", Some("angstroms/ps"), Some("ps"))];
        if has_cell(bytes) {
            notes.push(notes::cell_note(None));
        }
        notes
    }
}

/// What the second line says.
struct Heading {
    count: usize,
    time: Option<f64>,
}

impl Heading {
    /// The number of atoms, then up to five real numbers: the time, a temperature and others.
    fn of(line: Line<'_>) -> Result<Self, ParseError> {
        let mut words = text::words(line.text);
        let count = words.next().and_then(text::integer);
        let count = count.and_then(|count| usize::try_from(count).ok());
        let rest: Option<Vec<f64>> = words.by_ref().take(6).map(text::number).collect();
        match (count, rest) {
            (Some(count @ 1..), Some(rest)) if rest.len() < 6 => {
                Ok(Self { count, time: rest.first().copied().filter(|time| time.is_finite()) })
            }
            _ => {
                let what = format!(
                    "the second line has {}, not a number of atoms, perhaps with the time",
                    text::shown(line.text)
                );
                Err(ParseError::malformed(line.at, what))
            }
        }
    }

    /// Lines of three numbers for each atom.
    const fn rows(&self) -> usize {
        self.count.div_ceil(2)
    }
}

/// Whether `row` has numbers of twelve columns and nothing else.
fn is_row(row: &[u8]) -> bool {
    let row = row.trim_ascii_end();
    let is_field = |field: &[u8]| {
        let is_number =
            field.get(POINT) == Some(&b'.') && text::number(field.trim_ascii()).is_some();
        // Numbers too large for their columns
        field.len() == WIDTH && (is_number || field.iter().all(|b| *b == b'*'))
    };
    matches!(row.len() / WIDTH, 3 | PER_LINE) && row.chunks(WIDTH).all(is_field)
}

fn read(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    text.line();
    let heading = text
        .line()
        .map(Heading::of)
        .transpose()?
        .ok_or_else(|| cut_short(text, "no number of atoms".into()))?;
    let (count, rows) = (heading.count, heading.rows());
    let len = count.saturating_mul(3);
    let mut positions = RowNumbers::new(budget);
    let mut numbers = Vec::new();
    for row in 0..rows {
        let Some(line) = text.line() else {
            let what = format!("{count} atoms have {rows} lines of positions, {row} follow");
            return Err(cut_short(text, what));
        };
        read_row(line, WIDTH, PER_LINE.min(len - row * PER_LINE), &mut numbers)?;
        positions.push(&numbers)?;
    }
    let mut others = RowNumbers::new(budget.less(8 * len as u64));
    let cell = read_tail(text, rows, |row| others.push(row))?;
    let mut velocities = others.numbers;
    if !velocities.is_empty() && velocities.len() != len {
        let what = format!(
            "{count} atoms have {len} components of velocities, {} follow the positions",
            velocities.len()
        );
        return Err(cut_short(text, what));
    }
    velocities.iter_mut().for_each(|v| *v *= VELOCITY_UNIT);
    let velocity = (!velocities.is_empty()).then(|| Attribute {
        name: "velocity".to_owned(),
        components: 3,
        data: AttributeData::F64(velocities),
    });
    Ok(RawParticles {
        positions: ColumnValues::Real(positions.numbers).into_positions(),
        attributes: velocity.into_iter().collect(),
        time: heading.time,
        cell,
        ..RawParticles::default()
    })
}

/// Passes on the lines of velocities behind `rows` lines of positions, and gives the cell of the box behind them, if
/// there is one. The number of lines tells whether the last one may be a box.
fn read_tail(
    text: &mut TextInput<'_>,
    rows: usize,
    mut add: impl FnMut(&[f64]) -> Result<(), ParseError>,
) -> Result<Option<SimulationCell>, ParseError> {
    let (mut count, mut last) = (0, Vec::new());
    while let Some(line) = text.line() {
        if line.is_blank() {
            continue;
        }
        if count > rows {
            let what = "more than positions, velocities and a box";
            return Err(ParseError::malformed(line.at, what));
        }
        add(&last)?;
        let numbers = line.text.trim_ascii_end().len().div_ceil(WIDTH);
        read_row(line, WIDTH, numbers.min(PER_LINE), &mut last)?;
        count += 1;
    }
    if is_box_at(count, rows) && is_box(&last) {
        return Ok(cell(&last));
    }
    add(&last)?;
    Ok(None)
}

/// Whether the last of `others` lines behind `rows` lines of positions may be a box.
const fn is_box_at(others: usize, rows: usize) -> bool {
    others == 1 || others == rows + 1
}

/// Whether a line is a box, and not velocities. Zeros stand for none.
fn is_box(numbers: &[f64]) -> bool {
    let (lengths, angles) = numbers.split_at(numbers.len().min(3));
    let is_cell = lengths.iter().all(|length| *length >= MIN_BOX)
        && angles.iter().all(|angle| (30.0..=150.0).contains(angle));
    is_cell || numbers.iter().all(|number| *number == 0.0)
}

/// The cell of a box: three lengths, and perhaps three angles in degrees.
fn cell(numbers: &[f64]) -> Option<SimulationCell> {
    match *numbers {
        [a, b, c] => SimulationCell::from_angles([a, b, c], [90.0; 3]),
        [a, b, c, alpha, beta, gamma] => {
            SimulationCell::from_angles([a, b, c], [alpha, beta, gamma])
        }
        _ => None,
    }
}

/// Whether the file `bytes` has a box that is a cell.
fn has_cell(bytes: &[u8]) -> bool {
    let mut text = TextInput::whole(bytes);
    text.line();
    let Some(Ok(heading)) = text.line().map(Heading::of) else {
        return false;
    };
    let rows = heading.rows();
    let has_positions = (0..rows).all(|_| text.line().is_some());
    let cell = read_tail(&mut text, rows, |_| Ok(()));
    has_positions && matches!(cell, Ok(Some(_)))
}

fn cut_short(text: &TextInput<'_>, what: String) -> ParseError {
    ParseError::malformed(text.at(), format!("{what}: {CUT_SHORT}"))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::read::damage::{TestedReader, attribute, numbers};
    use crate::read::pieces;
    use spherule_frame::Positions;

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn particles(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read: particles };

    /// Lines of six numbers.
    fn rows(numbers: &[f64]) -> String {
        let line = |row: &[f64]| -> String {
            let fields: String = row.iter().map(|n| format!("{n:12.7}")).collect();
            fields + "\n"
        };
        numbers.chunks(PER_LINE).map(line).collect()
    }

    /// Numbers that fill their columns, so that there is no blank between them.
    const PLACES: [f64; 9] = [-123.25, -100.5, 0.5, 1.0, -999.125, 3.0, 4.0, 5.0, 6.5];

    #[track_caller]
    fn one(text: &str) -> RawParticles {
        let sniffed = FORMAT.reader().sniff(text.as_bytes());
        assert!(sniffed.is_ok_and(|c| c >= Confidence::Likely), "{text}");
        READER.one(text.as_bytes())
    }

    #[test]
    fn positions_velocities_time_and_box() {
        let velocities: Vec<f64> = PLACES.iter().map(|n| n / 1000.0).collect();
        let positions = rows(&PLACES);
        let cell = rows(&[30.0, 40.0, 50.0, 90.0, 90.0, 90.0]);
        let head = "default_name\n    3  0.5000000E+02\n";
        for (text, has_velocity, has_cell) in [
            (format!("{head}{positions}"), false, false),
            (format!("{head}{positions}{cell}\n\n"), false, true),
            (format!("{head}{positions}{}", rows(&velocities)), true, false),
            (format!("{head}{positions}{}{cell}", rows(&velocities)), true, true),
        ] {
            let found = one(&text);
            let Positions::F64(places) = &found.positions else {
                panic!("single precision");
            };
            let expected: Vec<DVec3> = PLACES.chunks(3).map(DVec3::from_slice).collect();
            assert_eq!(*places, expected, "{text}");
            assert_eq!(found.time, Some(50.0));
            let edges = found.cell.map(|cell| cell.vectors.map(DVec3::length));
            assert_eq!(edges, has_cell.then_some([30.0, 40.0, 50.0]), "{text}");
            assert_eq!(found.attributes.len(), usize::from(has_velocity));
            if has_velocity {
                let found = numbers(&attribute(&found, "velocity").data);
                let is_near = |(a, b): (&f64, &f64)| (a - b * VELOCITY_UNIT).abs() < 1e-5;
                assert!(found.iter().zip(&velocities).all(is_near), "{found:?}");
            }
            assert_eq!(super::has_cell(text.as_bytes()), has_cell, "{text}");
        }
    }

    #[test]
    fn the_line_behind_two_atoms_is_a_box_if_it_may_be_one() {
        let positions = rows(&PLACES[..6]);
        let with = |numbers: &[f64]| one(&format!("\n2\n{positions}{}", rows(numbers)));
        let velocities = with(&[0.5, -1.0, 3.0, 0.25, 1.0, 2.0]);
        assert!(velocities.cell.is_none() && velocities.attributes.len() == 1);
        let cell = with(&[20.0, 20.0, 20.0, 109.471_219, 109.471_219, 109.471_219]);
        assert!(cell.cell.is_some() && cell.attributes.is_empty());
        let lengths = with(&[20.0, 30.0, 40.0]);
        assert_eq!(lengths.cell.map(|c| c.vectors[2].z), Some(40.0));
    }

    #[test]
    fn numbers_that_overflow_their_columns_are_missing() {
        let text = format!("a\n1\n{}{}", "*".repeat(12), "   1.0000000   2.0000000\n");
        let found = one(&text);
        assert!(found.positions.get(0).x.is_nan() && found.positions.get(0).z == 2.0);
    }

    #[test]
    fn damage_is_named() {
        let good = format!("a\n    3\n{}", rows(&PLACES));
        for (from, to, message) in [
            ("    3\n", "    5\n", "byte 81: expected 6 numbers of 12 columns"),
            ("    3\n", "    1\n", "byte 8: expected 3 numbers of 12 columns"),
            ("    3\n", "    9000000000\n", "expected 6 numbers"),
            ("    3\n", "    0\n", "not a number of atoms"),
            ("    3\n", "    three\n", "not a number of atoms"),
            ("4.0000000", "4.zero000", "columns 1 to 12 of an atom have \"4.zero000\""),
            ("6.5000000", "6.50000001", "expected 3 numbers of 12 columns"),
            ("6.5000000\n", "6.5000000\n\n   1.0000000\n", "9 components of velocities, 1 follow"),
        ] {
            let text = good.replace(from, to);
            let error = READER.error_inside(text.as_bytes()).to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
        for (rows_left, message) in
            [(0, "4 atoms have 2 lines of positions, 1 follow"), (1, "components of velocities")]
        {
            let rows = rows(&[PLACES, PLACES].concat()[..12]);
            let len = 73 * (1 + 2 * rows_left);
            let text = format!("a\n    4\n{}", &[rows.clone(), rows].concat()[..len]);
            let error = READER.error(text.as_bytes()).to_string();
            assert!(error.contains(message), "{error}");
        }
        let long = format!("{good}{0}{0}{0}", rows(&PLACES));
        let error = READER.error(long.as_bytes()).to_string();
        assert!(error.contains("more than positions"), "{error}");
        let tight = MemoryBudget::new(100, "take care");
        let mut source = ByteSource::whole(good.as_bytes());
        assert!(FORMAT.read_within(&mut source, &Step::whole(0), tight).is_err());
        READER.survives_truncation(good.as_bytes(), &[0, 1, 5, 8, 9, 81, 82], 100);
    }
}
