//! Tripos mol2 files: atoms, types, charges and bonds of molecules, one or many.
//!
//! Text in sections that begin with `@<TRIPOS>` and their names. Each section `MOLECULE` begins a frame. Read are
//! `MOLECULE`, `ATOM`, `BOND` and `CRYSIN`. After "Tripos Mol2 File Format" (Tripos, 2005). Lengths are A.

use super::atoms::{self, AtomTable, ELEMENT, RESIDUE};
use super::input::TextInput;
use super::line_words::{AtomNumbers, BondList, LineWords, next_line};
use super::sniff::is_text;
use super::text::{self, Line, Lines};
use super::{ByteSource, CUT_SHORT, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{Bond, MemoryBudget, ParseError, RawParticles, SimulationCell, names};

/// Tripos mol2 files.
pub const FORMAT: Format = Format::new(&Mol2);

struct Mol2;

const SECTION: &[u8] = b"@<TRIPOS>";
/// Words of an atom up to its charge.
const WITH_CHARGE: usize = 9;

impl Reader for Mol2 {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("mol2", &["mol2"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut lines = Lines::new(head, 0..head.len());
        let first = lines.find(|line| !is_comment(*line));
        let is_section = first.is_some_and(|line| line.text.starts_with(SECTION));
        Ok(Confidence::signature_if(is_section && is_text(head)))
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    /// A frame for each molecule. What is before the first one belongs to it, so that a damaged head is found.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let mut steps = Vec::new();
        let (mut start, mut has_molecule) = (text.at(), false);
        while let Some(line) = text.line() {
            if section(line) != Some(b"MOLECULE") {
                continue;
            }
            let at = line.at;
            if has_molecule {
                Step::push(&mut steps, start..at, budget)?;
                start = at;
            }
            has_molecule = true;
        }
        Step::push(&mut steps, start..text.at(), budget)?;
        Ok(steps)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), step, budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let mut notes = vec![notes::units("angstroms", None, None)];
        if Lines::new(head, 0..head.len()).any(|line| section(line) == Some(b"CRYSIN")) {
            notes.push(notes::cell_note(None));
        }
        notes
    }
}

fn is_comment(line: Line<'_>) -> bool {
    line.is_blank() || line.text.starts_with(b"#")
}

/// The name of the section that begins with `line`.
fn section(line: Line<'_>) -> Option<&[u8]> {
    line.text.strip_prefix(SECTION).map(<[u8]>::trim_ascii)
}

/// Numbers of atoms and bonds of a molecule.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    atoms: usize,
    bonds: usize,
}

fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    text.go_to(range.start);
    text.end_at(range.end);
    let (mut counts, mut found) = (None, None);
    let (mut bonds, mut cell): (Vec<Bond>, _) = (Vec::new(), None);
    let mut numbers = AtomNumbers::default();
    while let Some(line) = text.line() {
        let at = line.at;
        match (section(line), counts) {
            (Some(b"MOLECULE"), _) => counts = Some(read_counts(text)?),
            (Some(b"ATOM"), Some(Counts { atoms, .. })) => {
                let (read, read_numbers) = read_atoms(text, atoms, budget)?;
                (found, numbers) = (Some(read), read_numbers);
            }
            (Some(b"BOND"), Some(Counts { bonds: count, .. })) => {
                let held = found.as_ref().map_or(0, RawParticles::byte_len);
                let mut list = BondList::new(std::mem::take(&mut numbers), budget.less(held));
                for _ in 0..count {
                    let line = next_row(text, "bond")?;
                    let mut words = LineWords::new(line);
                    words.next();
                    let ends = [
                        words.integer("the number of an atom")?,
                        words.integer("the number of an atom")?,
                    ];
                    list.push(line.at, ends)?;
                }
                bonds = list.into_bonds();
            }
            (Some(b"CRYSIN"), _) => cell = text.peek_line().and_then(self::cell),
            (Some(b"ATOM" | b"BOND"), None) => {
                let what = "a section of atoms or bonds without a section MOLECULE before it";
                return Err(ParseError::malformed(at, what));
            }
            _ => {}
        }
    }
    let particles = match (found, counts) {
        (Some(particles), _) => particles,
        (None, Some(Counts { atoms: 0, .. })) => RawParticles::default(),
        _ => {
            let what = "a mol2 file without the sections MOLECULE and ATOM: the file is damaged, or still being written";
            return Err(ParseError::malformed(text.at(), what));
        }
    };
    let stated = counts.map_or(0, |counts| counts.bonds);
    if bonds.len() != stated {
        let what = format!("{stated} bonds are stated, {} follow: {CUT_SHORT}", bonds.len());
        return Err(ParseError::malformed(text.at(), what));
    }
    Ok(RawParticles { bonds, cell, ..particles })
}

/// The next line that is not a comment.
fn next_row<'t>(text: &'t mut TextInput<'_>, what: &str) -> Result<Line<'t>, ParseError> {
    while text.peek_line().is_some_and(is_comment) {
        text.line();
    }
    let next = text.peek_line();
    if let Some(line) = next.filter(|line| line.text.starts_with(SECTION)) {
        let what =
            format!("no {what}, but the next section: more are stated in the section MOLECULE");
        return Err(ParseError::malformed(line.at, what));
    }
    next_line(text, what)
}

/// What follows the name of a molecule, which may be blank.
fn read_counts(text: &mut TextInput<'_>) -> Result<Counts, ParseError> {
    next_line(text, "name of the molecule")?;
    let mut words = LineWords::new(next_line(text, "number of atoms")?);
    let atoms = words.count("a number of atoms")?;
    // Molecules without bonds may lack their number
    let bonds = text::integer(words.next()).and_then(|count| usize::try_from(count).ok());
    Ok(Counts { atoms, bonds: bonds.unwrap_or_default() })
}

/// Lines `number name x y z type [residue [residue_name [charge ...]]]`.
fn read_atoms(
    text: &mut TextInput<'_>,
    count: usize,
    budget: MemoryBudget,
) -> Result<(RawParticles, AtomNumbers), ParseError> {
    let first = text.peek_line().map_or(0, |line| text::words(line.text).take(WITH_CHARGE).count());
    let columns = [("charge", 1)];
    let real = &columns[..usize::from(first == WITH_CHARGE)];
    let texts = [names::RESIDUE_NAME, names::ATOM_NAME];
    let mut table = AtomTable::new(&[ELEMENT, RESIDUE], real, &texts, budget);
    let mut numbers = AtomNumbers::default();
    for _ in 0..count {
        let mut words = LineWords::new(next_row(text, "line of an atom")?);
        let number = words.integer("the number of an atom")?;
        let name = words.next();
        let position = words.vector("a coordinate")?;
        let kind = words.next();
        let residue = atoms::residue(words.next());
        let residue_name = words.next();
        let charge = [text::number(words.next()).unwrap_or_default()];
        // Types of Sybyl begin with the symbol, those of force fields, in lower case, do not
        let is_symbol = kind.first().is_some_and(u8::is_ascii_uppercase);
        let symbol = if is_symbol { kind } else { b"" };
        let element = atoms::element(symbol, name, residue_name);
        table.push(position, &[element, residue], &charge[..real.len()], &[residue_name, name])?;
        numbers.push(number, budget)?;
    }
    Ok((table.into_particles(), numbers))
}

/// Lengths and angles of a cell.
fn cell(line: Line<'_>) -> Option<SimulationCell> {
    let mut words = LineWords::new(line);
    let lengths = words.vector("a length").ok()?;
    SimulationCell::from_angles(lengths, words.vector("an angle").ok()?)
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

    const WATER: &str = "# made by hand\n\n@<TRIPOS>MOLECULE\nwater\n 3 2 1\nSMALL\nUSER_CHARGES\n\n@<TRIPOS>ATOM\n\
        1 O 0.5 1.25 -3 O.3 4 HOH4 -0.8\n2 H1 1 2 3 H 4 HOH4 0.4\n3 H2 1 2 4 hw 4 HOH4 0.4\n\
        @<TRIPOS>BOND\n1 1 2 1\n2 1 3 1\n@<TRIPOS>CRYSIN\n10 20 30 90 90 90 1 1\n";

    #[test]
    fn molecules_are_frames() {
        let ion = "@<TRIPOS>MOLECULE\n\n1\nSMALL\nNO_CHARGES\n@<TRIPOS>ATOM\n7 CA 1 2 3 Ca\n";
        let text = WATER.to_owned() + ion;
        for text in [&text, &text.replace('\n', "\r\n")] {
            assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
            let frames = READER.all(text.as_bytes()).expect("frames");
            let [water, ion] = frames.as_slice() else { panic!("two frames") };
            assert_eq!(names(water), ["element", "residue", "charge", "residue_name", "atom_name"]);
            assert_eq!(numbers(&attribute(water, "element").data), [8.0, 1.0, 1.0]);
            assert_eq!(numbers(&attribute(water, "charge").data), [-0.8, 0.4, 0.4]);
            assert_eq!(coordinates(&water.positions)[0], [0.5, 1.25, -3.0]);
            assert_eq!(water.bonds, [[0, 1], [0, 2]]);
            assert_eq!(water.cell.expect("a cell").vectors[1].y, 20.0);
            assert_eq!(names(ion), ["element", "residue", "atom_name"]);
            assert_eq!(numbers(&attribute(ion, "element").data), [20.0]);
        }
    }

    #[test]
    fn numbers_of_atoms_may_be_any() {
        let text = WATER.replace("\n1 O", "\n11 O").replace("\n3 H2", "\n5 H2");
        let text = text.replace("1 1 2 1\n2 1 3 1", "1 11 2 1\n2 11 5 1");
        assert_eq!(READER.one(text.as_bytes()).bonds, [[0, 1], [0, 2]]);
    }

    #[test]
    fn damage_is_named() {
        for (from, to, message) in [
            (" 3 2 1", "x", "found \"x\" where a number of atoms is expected"),
            ("0.5 1.25", "0.5 wide", "found \"wide\" where a coordinate is expected"),
            (
                "2 1 3 1\n",
                "2 1 4 1\n",
                "a bond between the atoms 1 and 4, which are not both among the 3 atoms",
            ),
            (" 3 2 1", "999999999999 2 1", "no line of an atom, but the next section"),
            ("MOLECULE", "MOLECULES", "without a section MOLECULE"),
            ("2 1 3 1\n@", "@", "no bond, but the next section"),
        ] {
            let error = READER.error_inside(WATER.replacen(from, to, 1).as_bytes()).to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
        READER.survives_truncation(WATER.as_bytes(), &[20, 50, 60, 80, 120, 150], 150);
        let tight = MemoryBudget::new(200, "take care");
        let mut source = ByteSource::whole(WATER.as_bytes());
        assert!(FORMAT.read_within(&mut source, &Step::whole(WATER.len()), tight).is_err());
    }
}
