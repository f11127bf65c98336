//! Tinker files: structures (`.xyz`, `.txyz`) and trajectories (`.arc`) with types and bonds.
//!
//! Each frame has a count with a title, perhaps a line with lengths and angles of the cell, and a line for each atom:
//! number, name, x, y, z, type, numbers of the bonded atoms. After the user's guide of Tinker. Lengths are A.

use super::atoms::{self, AtomTable, ELEMENT};
use super::input::TextInput;
use super::line_words::{AtomNumbers, BondList, LineWords, next_line};
use super::sniff::is_text;
use super::text::{self, Line, Lines};
use super::{ByteSource, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles, SimulationCell, names};

/// Tinker files.
pub const FORMAT: Format = Format::new(&Tinker);

struct Tinker;

impl Reader for Tinker {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("tinker", &["arc", "txyz"])
    }

    /// Molecular text has no numbers before the names of its atoms, and a comment in its second line.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        if !is_text(head) {
            return Ok(Confidence::No);
        }
        let mut lines = Lines::new(head, 0..head.len());
        let heading = lines.next().unwrap_or(Line { at: 0, text: b"" });
        let Ok(count) = count(heading) else {
            return Ok(Confidence::No);
        };
        let title = text::words(heading.text).nth(1);
        let is_titled = title.is_some_and(|word| text::number(word).is_none());
        let mut rows = lines.skip_while(|line| cell(*line).is_some());
        let is_first = rows.next().is_some_and(|line| is_atom(line, 1));
        let is_second = count < 2 || rows.next().is_some_and(|line| is_atom(line, 2));
        let is_sure = is_first && (is_titled || (title.is_none() && is_second));
        Ok(if is_sure { Confidence::Signature } else { Confidence::IfNamed })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    /// Where a count should be and is not, the rest is one last step, so that reading it gives the error.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let mut steps = Vec::new();
        loop {
            let start = text.at();
            let lines = text.line().map_or(0, |line| count(line).unwrap_or(usize::MAX));
            if text.peek_line().and_then(cell).is_some() {
                text.line();
            }
            text.pass_lines(lines);
            Step::push(&mut steps, start..text.at(), budget)?;
            text.pass_blank_lines(usize::MAX);
            if text.is_at_end() {
                return Ok(steps);
            }
        }
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), step, budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let mut notes =
            vec![notes::units("angstroms", None, None), notes::GUESSED_ELEMENTS.to_owned()];
        if Lines::new(head, 0..head.len()).nth(1).and_then(cell).is_some() {
            notes.push(notes::cell_note(None));
        }
        notes
    }
}

/// The number of atoms in the first line of a frame.
fn count(line: Line<'_>) -> Result<usize, ParseError> {
    LineWords::new(line).count("a number of atoms")
}

/// Whether a line is the atom with this number: number, name, x, y, z, type.
fn is_atom(line: Line<'_>, number: i64) -> bool {
    let mut words = LineWords::new(line);
    let is_number = words.integer("a number").is_ok_and(|found| found == number);
    let name = words.next();
    let is_name = !name.is_empty() && text::number(name).is_none();
    is_number && is_name && words.vector("x").is_ok() && words.integer("a type").is_ok()
}

/// The cell in a line of three lengths and three angles.
fn cell(line: Line<'_>) -> Option<SimulationCell> {
    let mut words = LineWords::new(line);
    let (lengths, angles) = (words.vector("a length").ok()?, words.vector("an angle").ok()?);
    let is_all = words.next().is_empty();
    SimulationCell::from_angles(lengths, angles).filter(|_| is_all)
}

fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    text.go_to(range.start);
    text.end_at(range.end);
    let count = count(next_line(text, "number of atoms")?)?;
    let cell = text.peek_line().and_then(cell);
    if cell.is_some() {
        text.line();
    }
    let mut table = AtomTable::new(&[ELEMENT, "type"], &[], &[names::ATOM_NAME], budget);
    let mut bonds = BondList::new(AtomNumbers::counted(count), budget);
    for number in 1..=count {
        let line = next_line(text, "line of each atom")?;
        let mut words = LineWords::new(line);
        words.integer("the number of an atom")?;
        let name = words.next();
        let position = words.vector("a coordinate")?;
        let kind = words.integer("the type of an atom")?;
        table.push(position, &[atoms::element_without_residue(name), kind], &[], &[name])?;
        while !words.rest().is_empty() {
            let other = words.integer("the number of a bonded atom")?;
            bonds.push(line.at, [number as i64, other])?;
        }
    }
    Ok(RawParticles { bonds: bonds.into_distinct_bonds(), cell, ..table.into_particles() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};
    use crate::read::pieces;

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn particles(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read: particles };

    const ATOMS: &str = "1 O 0.5 1.25 -3 63 2 3\n2 H 1 2 3.0D0 64 1\n3 H 4 5 6 64 1\n";

    #[test]
    fn frames_have_bonds_and_cells() {
        for (heading, cell) in
            [("  3  water\n", None), ("3\n", None), ("3 water 1\n10 20 30 90 90 90\n", Some(30.0))]
        {
            let text = format!("{heading}{ATOMS}{heading}{ATOMS}");
            for text in [&text, &text.replace('\n', "\r\n"), &format!("{text}\n")] {
                assert_eq!(
                    FORMAT.reader().sniff(text.as_bytes()),
                    Ok(Confidence::Signature),
                    "{text}"
                );
                let frames = READER.all(text.as_bytes()).expect("frames");
                assert_eq!(frames.len(), 2);
                for found in frames {
                    assert_eq!(names(&found), ["element", "type", "atom_name"]);
                    assert_eq!(numbers(&attribute(&found, "element").data), [8.0, 1.0, 1.0]);
                    assert_eq!(numbers(&attribute(&found, "type").data), [63.0, 64.0, 64.0]);
                    assert_eq!(coordinates(&found.positions)[0], [0.5, 1.25, -3.0]);
                    assert_eq!(found.bonds, [[0, 1], [0, 2]]);
                    assert_eq!(found.cell.map(|cell| cell.vectors[2].z), cell);
                }
            }
        }
    }

    #[test]
    fn molecular_text_is_something_else() {
        for text in [
            "2\n1 O 0.1 0.2 0.3 1\nH 1 2 3\n",
            "2\ncell\nO 0.1 0.2 0.3 1\nH 1 2 3 1\n",
            "2\n1 2 3\n4 5 6\n",
        ] {
            assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::IfNamed), "{text}");
        }
    }

    #[test]
    fn damage_is_named() {
        let good = format!("3 water\n{ATOMS}");
        for (from, to, message) in [
            ("3 water", "three", "found \"three\" where a number of atoms is expected"),
            ("3 water", "4 water", "no line of each atom: the file is cut short"),
            ("1.25", "1,25", "found \"1,25\" where a coordinate is expected"),
            (
                "64 1\n",
                "64 7\n",
                "a bond between the atoms 2 and 7, which are not both among the 3 atoms",
            ),
            ("64 1\n", "64 x\n", "where the number of a bonded atom is expected"),
            ("3 water", "999999999999 water", "no line of each atom"),
        ] {
            let error = READER.error_inside(good.replacen(from, to, 1).as_bytes()).to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
        READER.survives_truncation(good.as_bytes(), &[2, 8, 20, 40], good.len() - 12);
        let tight = MemoryBudget::new(100, "take care");
        let mut source = ByteSource::whole(good.as_bytes());
        assert!(FORMAT.read_within(&mut source, &Step::whole(good.len()), tight).is_err());
    }
}
