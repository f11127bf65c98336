//! AMBER trajectories in text (`.mdcrd`, `.crd`): positions, ten numbers of eight columns in a line (Fortran's 10F8.3).
//!
//! A title, then frames that begin in new lines, with a line of the lengths of the box behind each, or none. Nothing says
//! how many atoms there are. Nearly always this follows from the lines that are not full; other files are refused. After
//! the description of the format in the AMBER manual. Lengths are A.

use super::fixed_rows::{RowNumbers, read_row};
use super::input::TextInput;
use super::sniff::is_text;
use super::table::ColumnValues;
use super::text::{self, Lines};
use super::{ByteSource, CUT_SHORT, Step, csv, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles, SimulationCell};

/// AMBER trajectories in text.
pub const FORMAT: Format = Format::new(&Mdcrd);

struct Mdcrd;

/// Columns of a number, and where its decimal point is.
const WIDTH: usize = 8;
const POINT: usize = 4;
/// Numbers in a full line.
const PER_LINE: usize = 10;
/// Numbers of a box.
const BOX: usize = 3;

impl Reader for Mdcrd {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("mdcrd", &["mdcrd", "crd"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut lines = Lines::new(head, 0..head.len());
        let title = lines.next().map(|line| line.text).unwrap_or_default();
        // Tables have names of columns, or numbers
        let is_numbers = text::words(title).next().is_some()
            && text::words(title).all(|word| text::number(word).is_some());
        let is_title = !is_numbers && !title.starts_with(b"#") && !csv::finds_columns(title);
        let is_row = |row: &[u8]| {
            let is_field = |field: &[u8]| {
                field.get(POINT) == Some(&b'.') && text::number(field.trim_ascii()).is_some()
            };
            !row.is_empty() && row.len().is_multiple_of(WIDTH) && row.chunks(WIDTH).all(is_field)
        };
        let row = lines.next().map(|line| line.text).unwrap_or_default();
        Ok(if !is_text(head) || !is_title || !is_row(row) {
            Confidence::No
        } else if row.len() == PER_LINE * WIDTH {
            Confidence::Signature
        } else {
            Confidence::IfNamed
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
            notes::units("angstroms", None, None),
            "the format has no number of atoms, which follows from the lengths of lines, and no angles of the box, which \
             are right ones; --topology checks the number"
                .to_owned(),
        ]
    }
}

/// The frames, which all have as many lines as the first one.
fn steps(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    text.line();
    let mut at = text.at();
    let lines = pass_frame(text)?;
    let mut steps = Vec::new();
    loop {
        Step::push(&mut steps, at..text.at(), budget)?;
        at = text.at();
        // Blank lines may end the file
        let is_end = text.ahead(|text| {
            text.pass_blanks();
            text.is_at_end()
        });
        if is_end {
            return Ok(steps);
        }
        text.pass_lines(lines);
    }
}

/// Passes the lines of the first frame: full ones, one that is not full, and perhaps a box. Returns how many there are.
fn pass_frame(text: &mut TextInput<'_>) -> Result<usize, ParseError> {
    let mut full = 0;
    let last = loop {
        let Some(line) = text.line() else {
            let error =
                if full == 0 { cut_short(text, "no frame") } else { unknown_count(text.at()) };
            return Err(error);
        };
        match numbers_in(line.text) {
            PER_LINE => full += 1,
            count => break count,
        }
    };
    // A line of three may be a box, or the last atom
    let has_box = text.peek_line().is_some_and(|line| numbers_in(line.text) == BOX);
    if has_box {
        text.line();
    }
    if full == 0 || last == 0 || (last == BOX && !has_box) {
        return Err(unknown_count(text.at()));
    }
    Ok(full + 1 + usize::from(has_box))
}

/// Bytes of the first frame, if `head` has all of it.
fn first_len(head: &[u8]) -> Option<usize> {
    let mut text = TextInput::whole(head);
    text.line();
    let start = text.at();
    pass_frame(&mut text).ok()?;
    (!text.is_at_end()).then(|| text.at() - start)
}

fn numbers_in(line: &[u8]) -> usize {
    line.trim_ascii_end().len().div_ceil(WIDTH)
}

fn unknown_count(at: usize) -> ParseError {
    let what = "the number of atoms does not follow from the lines of this AMBER trajectory in text; write NetCDF \
                (`cpptraj -p a.prmtop -y a.mdcrd -x a.nc`)";
    ParseError::malformed(at, what)
}

fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    // The last line may lack its end
    let is_whole = first_len(text.head()).is_none_or(|len| range.len() + b"\r\n".len() >= len);
    text.go_to(range.start);
    text.end_at(range.end);
    let mut positions = RowNumbers::new(budget);
    let (mut row, mut cell, mut has_end) = (Vec::new(), None, false);
    while let Some(line) = text.line() {
        let count = numbers_in(line.text);
        let expected = if has_end { BOX } else { count.clamp(1, PER_LINE) };
        read_row(line, WIDTH, expected, &mut row)?;
        if has_end {
            cell = <[f64; BOX]>::try_from(row.as_slice()).ok();
            break;
        }
        positions.push(&row)?;
        has_end = count < PER_LINE;
    }
    let count = positions.numbers.len();
    if !has_end || !is_whole || !text.is_at_end() || !count.is_multiple_of(3) {
        let what = format!("a frame with {count} coordinates differs from the first one");
        return Err(cut_short(text, &what));
    }
    Ok(RawParticles {
        positions: ColumnValues::Real(positions.numbers).into_positions(),
        cell: cell.and_then(|lengths| SimulationCell::from_angles(lengths, [90.0; 3])),
        ..RawParticles::default()
    })
}

fn cut_short(text: &TextInput<'_>, what: &str) -> ParseError {
    ParseError::malformed(text.at(), format!("{what}: {CUT_SHORT}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, coordinates};
    use crate::read::pieces;

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn particles(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read: particles };

    /// A coordinate of an atom; negative ones fill their columns.
    fn coordinate(frame: usize, index: usize) -> f64 {
        if index % 4 == 1 { -100.125 - frame as f64 } else { (index * 3 + frame) as f64 / 8.0 }
    }

    fn rows(numbers: impl Iterator<Item = f64>) -> String {
        let fields: Vec<String> = numbers.map(|number| format!("{number:8.3}")).collect();
        fields.chunks(PER_LINE).map(|row| row.concat() + "\n").collect()
    }

    /// A trajectory of `frames` frames of `atoms` atoms.
    fn trajectory(frames: usize, atoms: usize, has_box: bool) -> String {
        let frame = |frame| {
            let cell = if has_box { "  30.000  40.000  50.500\n" } else { "" };
            rows((0..3 * atoms).map(|index| coordinate(frame, index))) + cell
        };
        "made by hand\n".to_owned() + &(0..frames).map(frame).collect::<String>()
    }

    #[test]
    fn the_number_of_atoms_follows_from_the_lines() {
        for (atoms, has_box) in (4..40).flat_map(|atoms| [(atoms, false), (atoms, true)]) {
            let text = trajectory(3, atoms, has_box);
            // Full lines only, or a last line of three numbers that may be one or the other
            let is_unknown = atoms % 10 == 0 || (atoms % 10 == 1 && !has_box);
            for text in
                [&text, text.trim_end(), &text.replace('\n', "\r\n"), &format!("{text}\n\n")]
            {
                assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
                let frames = READER.all(text.as_bytes());
                if is_unknown {
                    let error = frames.expect_err("ambiguous").to_string();
                    assert!(error.contains("cpptraj"), "{error}");
                    continue;
                }
                let frames = frames.expect("frames");
                assert_eq!(frames.len(), 3, "{atoms} {has_box}");
                for (number, frame) in frames.iter().enumerate() {
                    let found = coordinates(&frame.positions).concat();
                    let expected: Vec<f64> =
                        (0..3 * atoms).map(|i| coordinate(number, i)).collect();
                    assert_eq!(found, expected);
                    assert_eq!(frame.cell.map(|c| c.vectors[2].z), has_box.then_some(50.5));
                }
            }
        }
    }

    #[test]
    fn damage_is_named() {
        let good = trajectory(3, 5, true);
        let second = good.len() / 3 + 13;
        for cut in [1, 25, 30, 60, 100] {
            let text = &good[..good.len() - cut];
            let steps = READER.all(text.as_bytes());
            assert_eq!(steps.is_ok(), cut == 1, "{cut} bytes cut");
            let first = steps_of(text);
            assert_eq!(first.len(), 3);
            assert!(particles(text.as_bytes(), &first[1]).is_ok());
        }
        let text = good[..second].to_owned() + &good[second..].replace("-101.125", "-10l.125");
        let error = READER.all(text.as_bytes()).expect_err("damaged").to_string();
        assert!(error.contains("\"-10l.125\", not a coordinate"), "{error}");
        let wide = good.replace("-101.125", "********");
        assert!(READER.all(wide.as_bytes()).expect("NaN")[1].positions.get(0).y.is_nan());
        for text in ["title\n", "", "title\n   1.000   2.000   3.000\n"] {
            assert!(READER.all(text.as_bytes()).is_err(), "{text}");
        }
        READER.survives_truncation(good.as_bytes(), &[20, 50, 100, 150, 200], 0);
        let tight = MemoryBudget::new(200, "take care");
        let mut source = ByteSource::whole(good.as_bytes());
        assert!(FORMAT.read_within(&mut source, &steps_of(&good)[0], tight).is_err());
    }

    fn steps_of(text: &str) -> Vec<Step> {
        steps(text.as_bytes()).expect("steps")
    }
}
