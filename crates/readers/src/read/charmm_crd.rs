//! CHARMM coordinate files (`.crd`, `.cor`): the atoms of one structure.
//!
//! Titles that begin with an asterisk, the number of atoms, then a line for each atom in columns of equal width: those of
//! the extended form, which has `EXT` behind the number, are wider. After the page `io` of the CHARMM manual. Lengths
//! are A.

use super::atoms::{self, AtomTable, ELEMENT, RESIDUE, coordinate, field};
use super::beads::Beads;
use super::input::TextInput;
use super::line_words::{LineWords, next_line};
use super::sniff::is_text;
use super::text::{self, Line};
use super::{ByteSource, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles, names};

/// CHARMM coordinate files.
pub const FORMAT: Format = Format::new(&CharmmCrd);

struct CharmmCrd;

impl Reader for CharmmCrd {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: false,
            ..FormatInfo::molecular("charmm", &["cor", "charmm"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_titled = head.starts_with(b"*") && is_text(head);
        if !is_titled {
            return Ok(Confidence::No);
        }
        let mut text = TextInput::whole(head);
        let has_atom = Heading::read(&mut text).is_ok_and(|heading| {
            text.peek_line().is_some_and(|line| heading.columns.position(line).is_ok())
        });
        Ok(if has_atom { Confidence::Signature } else { Confidence::IfNamed })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        Ok(vec![Step::whole(source.text().left_about())])
    }

    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), budget)
    }

    fn notes(&self, _head: &[u8]) -> Vec<String> {
        vec![notes::units("angstroms", None, None), notes::GUESSED_ELEMENTS.to_owned()]
    }
}

/// Where the values of an atom are, columns from 0.
struct Columns {
    residue_name: [usize; 2],
    name: [usize; 2],
    /// The first coordinate, and the width of each.
    position: [usize; 2],
    segment: [usize; 2],
    residue: [usize; 2],
    weight: [usize; 2],
}

const NORMAL: Columns = Columns {
    residue_name: [11, 15],
    name: [16, 20],
    position: [20, 10],
    segment: [51, 55],
    residue: [56, 60],
    weight: [60, 70],
};

const EXTENDED: Columns = Columns {
    residue_name: [22, 30],
    name: [32, 40],
    position: [40, 20],
    segment: [102, 110],
    residue: [112, 120],
    weight: [120, 140],
};

/// Structures of more atoms have the extended form, whether they say so or not.
const MAX_NORMAL: usize = 99_999;

impl Columns {
    fn position(&self, line: Line<'_>) -> Result<[f64; 3], ParseError> {
        let [first, width] = self.position;
        let axis = |index| coordinate(line, first + index * width, first + (index + 1) * width);
        Ok([axis(0)?, axis(1)?, axis(2)?])
    }
}

/// The titles and the number of atoms.
struct Heading {
    count: usize,
    columns: Columns,
}

impl Heading {
    fn read(text: &mut TextInput<'_>) -> Result<Self, ParseError> {
        while text.peek_line().is_some_and(|line| line.text.starts_with(b"*")) {
            text.line();
        }
        let mut words = LineWords::new(next_line(text, "number of atoms")?);
        let count = words.count("a number of atoms")?;
        let is_extended = words.next().eq_ignore_ascii_case(b"ext") || count > MAX_NORMAL;
        Ok(Self { count, columns: if is_extended { EXTENDED } else { NORMAL } })
    }
}

fn read(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    let Heading { count, columns } = Heading::read(text)?;
    let texts = [names::SEGMENT, names::RESIDUE_NAME, names::ATOM_NAME];
    let mut table = AtomTable::new(&[ELEMENT, RESIDUE], &[("weight", 1)], &texts, budget);
    let mut beads = Beads::default();
    for _ in 0..count {
        let line = next_line(text, "line of each atom")?;
        let of = |[start, end]: [usize; 2]| field(line.text, start, end);
        let [segment, residue_name, name] =
            [columns.segment, columns.residue_name, columns.name].map(of);
        let weight = text::number(of(columns.weight)).unwrap_or_default();
        let element = atoms::element(b"", name, residue_name);
        let whole = [element, atoms::residue(of(columns.residue))];
        let position = columns.position(line)?;
        table.push(position, &whole, &[weight], &[segment, residue_name, name])?;
        beads.push(name, residue_name);
    }
    let mut particles = table.into_particles();
    particles.attributes.extend(beads.attribute());
    Ok(particles)
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

    fn normal() -> String {
        let atom = |index: usize, residue: &str, name: &str| {
            format!(
                "{index:5}{index:5} {residue:<4} {name:<4}{:10.5}{:10.5}{:10.5} {:<4} {:<4}{:10.5}\n",
                0.5,
                -100.25,
                3.0,
                "MAIN",
                index + 6,
                2.5
            )
        };
        format!("* made by hand\n*\n    2\n{}{}", atom(1, "ALA", "CA"), atom(2, "SOD", "SOD"))
    }

    fn extended() -> String {
        let atom = |index: usize, residue: &str, name: &str| {
            format!(
                "{index:10}{index:10}  {residue:<8}  {name:<8}{:20.10}{:20.10}{:20.10}  {:<8}  {:<8}{:20.10}\n",
                0.5,
                -100.25,
                3.0,
                "MAIN",
                index + 6,
                2.5
            )
        };
        format!(
            "* made by hand\n         2  EXT\n{}{}",
            atom(1, "ALA", "CA"),
            atom(2, "SOD", "SOD")
        )
    }

    #[test]
    fn both_forms_give_the_same() {
        for text in [normal(), extended(), normal().replace('\n', "\r\n")] {
            assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
            let found = READER.one(text.as_bytes());
            let all = ["element", "residue", "weight", "segment", "residue_name", "atom_name"];
            assert_eq!(names(&found), all);
            assert_eq!(numbers(&attribute(&found, "element").data), [6.0, 11.0]);
            assert_eq!(numbers(&attribute(&found, "residue").data), [7.0, 8.0]);
            assert_eq!(numbers(&attribute(&found, "weight").data), [2.5, 2.5]);
            assert_eq!(coordinates(&found.positions), [[0.5, -100.25, 3.0]; 2]);
        }
    }

    #[test]
    fn damage_is_named() {
        for (from, to, message) in [
            ("    2\n", "    x\n", "found \"x\" where a number of atoms is expected"),
            ("    2\n", "    3\n", "no line of each atom: the file is cut short"),
            ("    2\n", "9999999999\n", "not a coordinate"),
            ("-100.25000", "-100.25OOO", "columns 31 to 40 of an atom have"),
        ] {
            let error = READER.error_inside(normal().replacen(from, to, 1).as_bytes()).to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
        for text in [normal(), extended()] {
            READER.survives_truncation(text.as_bytes(), &[1, 16, 20, 24, 60], text.len() - 60);
            let tight = MemoryBudget::new(100, "take care");
            let mut source = ByteSource::whole(text.as_bytes());
            assert!(FORMAT.read_within(&mut source, &Step::whole(text.len()), tight).is_err());
        }
    }
}
