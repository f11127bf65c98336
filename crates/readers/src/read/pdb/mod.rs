//! Protein Data Bank files: the positions of their atoms, one or many models.
//!
//! Text with fixed columns: each line is a record that begins with its name. Models are between `MODEL` and `ENDMDL`,
//! or end with `END`. Lengths are A. After version 3.3 of the format. `pqr.rs` has the variant with charges and radii.

mod pqr;

use super::atoms::{self, AtomTable, ELEMENT, RESIDUE, coordinate, field};
use super::beads::Beads;
use super::input::TextInput;
use super::sniff::is_text;
use super::text::{self, Line};
use super::{ByteSource, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles, SimulationCell, names};

/// Protein Data Bank files.
pub const FORMAT: Format = Format::new(&Pdb);

pub use pqr::FORMAT as PQR;

struct Pdb;

/// How a format writes its atoms.
struct Records {
    is_atom: fn(Line<'_>) -> bool,
    atom: for<'a> fn(Line<'a>) -> Result<Atom<'a>, ParseError>,
    /// Names of the two real numbers of an atom.
    real: [&'static str; 2],
}

const RECORDS: Records = Records { is_atom, atom, real: ["occupancy", "b_factor"] };

/// What the record of an atom says.
struct Atom<'a> {
    position: [f64; 3],
    real: [f64; 2],
    residue_number: i64,
    symbol: &'a [u8],
    name: &'a [u8],
    residue: &'a [u8],
    chain: &'a [u8],
    segment: &'a [u8],
}

/// Names of records that files begin with.
const OPENINGS: [&[u8]; 10] = [
    b"HEADER", b"TITLE ", b"REMARK", b"CRYST1", b"COMPND", b"MODEL ", b"ATOM  ", b"HETATM",
    b"EXPDTA", b"AUTHOR",
];

impl Reader for Pdb {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("pdb", &["pdb", "ent"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        if !is_text(head) {
            return Ok(Confidence::No);
        }
        let mut lines = text::Lines::new(head, 0..head.len());
        let opens = lines
            .clone()
            .next()
            .is_some_and(|line| OPENINGS.iter().any(|name| line.text.starts_with(name)));
        // Records without elements may also be those of a PQR file, if its name says so
        let is_sure_atom =
            |line| is_atom(line) && position(line).is_ok() && pqr::words_of_atom(line).is_none();
        let is_sure = head.starts_with(b"HEADER    ") || lines.clone().any(is_sure_atom);
        let is_likely = is_sure || lines.any(|line| is_atom(line) && position(line).is_ok());
        Ok(match () {
            () if is_sure && opens => Confidence::Signature,
            () if is_likely => Confidence::Likely,
            () => Confidence::IfNamed,
        })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    /// The cell may be before all models.
    fn reads_steps_alone(&self, head: &[u8]) -> bool {
        text::Lines::new(head, 0..head.len()).any(is_atom)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        steps(source.text(), &RECORDS, budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), step, &RECORDS, budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        notes(head)
    }
}

/// Notes on the units and the cell.
fn notes(head: &[u8]) -> Vec<String> {
    let mut notes = vec![notes::units("angstroms", None, None)];
    let mut lines = text::Lines::new(head, 0..head.len());
    if lines.any(is_cell) {
        notes.push(notes::cell_note(None));
    }
    notes
}

fn is_atom(line: Line<'_>) -> bool {
    line.text.starts_with(b"ATOM  ") || line.text.starts_with(b"HETATM")
}

/// The position of an atom.
fn position(line: Line<'_>) -> Result<[f64; 3], ParseError> {
    let mut position = [0.0; 3];
    for (number, start) in position.iter_mut().zip([30, 38, 46]) {
        *number = coordinate(line, start, start + 8)?;
    }
    Ok(position)
}

/// Names of residues have three letters in the format, and four in many programs.
fn atom(line: Line<'_>) -> Result<Atom<'_>, ParseError> {
    let field = |start, end| field(line.text, start, end);
    let real = |start, end, default| text::number(field(start, end)).unwrap_or(default);
    Ok(Atom {
        position: position(line)?,
        real: [real(54, 60, 1.0), real(60, 66, 0.0)],
        residue_number: text::integer(field(22, 26)).unwrap_or_default(),
        symbol: field(76, 78),
        name: field(12, 16),
        residue: field(17, 21),
        chain: field(21, 22),
        segment: field(72, 76),
    })
}

fn is_cell(line: Line<'_>) -> bool {
    line.text.starts_with(b"CRYST1")
}

/// The cell in a record `CRYST1`. None if a number is damaged, or for a unit cube, which stands for no cell.
fn cell(line: Line<'_>) -> Option<SimulationCell> {
    let number = |(start, end)| text::number(field(line.text, start, end)).unwrap_or(f64::NAN);
    let lengths = [(6, 15), (15, 24), (24, 33)].map(number);
    let angles = [(33, 40), (40, 47), (47, 54)].map(number);
    SimulationCell::from_angles(lengths, angles).filter(|_| lengths != [1.0; 3])
}

/// Whether a model ends with `line`.
fn ends_model(line: Line<'_>) -> bool {
    matches!(line.text.trim_ascii_end(), b"END" | b"ENDMDL")
}

/// The cell in the records of `head` before the first atom.
fn header_cell(head: &[u8], is_atom: fn(Line<'_>) -> bool) -> Option<SimulationCell> {
    let records = text::Lines::new(head, 0..head.len()).take_while(|line| !is_atom(*line));
    records.filter(|line| is_cell(*line)).last().and_then(cell)
}

/// The models: parts of the file that have atoms, up to a record for their end or to the next model. Records between
/// two models are about the second one, but cells about the first one if that had none before its atoms.
fn steps(
    text: &mut TextInput<'_>,
    records: &Records,
    budget: MemoryBudget,
) -> Result<Vec<Step>, ParseError> {
    let mut steps = Vec::new();
    let mut start = text.at();
    let (mut has_atoms, mut number) = (false, None);
    let mut has_cell_first = false;
    loop {
        let at = text.at();
        let line = text.line();
        let (is_cell, is_behind) = (line.is_some_and(is_cell), !has_atoms && !has_cell_first);
        let model = line.and_then(|line| line.text.strip_prefix(b"MODEL "));
        let next_number = model.and_then(|model| text::integer(model.trim_ascii()));
        let (is_model, is_file_end) = (model.is_some(), line.is_none());
        let is_end = is_model || line.is_none_or(ends_model);
        has_atoms |= line.is_some_and(records.is_atom);
        if is_end && has_atoms {
            // Some files have no record at the end of a model.
            let end = if is_model { at } else { text.at() };
            Step::push(&mut steps, start..end, budget)?;
            if let Some(step) = steps.last_mut() {
                step.number = number;
            }
            (has_atoms, number, start) = (false, None, end);
        }
        match steps.last_mut() {
            None => has_cell_first |= is_cell && !has_atoms,
            Some(last) if is_cell && is_behind => {
                start = text.at();
                last.end_at(start);
            }
            Some(_) => {}
        }
        if is_model {
            number = next_number;
        }
        if is_file_end {
            break;
        }
    }
    if steps.is_empty() {
        // Reading it gives the error.
        Step::push(&mut steps, 0..text.at(), budget)?;
    }
    Step::keep_increasing_numbers(&mut steps);
    Ok(steps)
}

fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    records: &Records,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    // What precedes the first model is about all of them. Atoms are not passed: text in pieces only goes forward.
    let mut cell = if text.at() > 0 { header_cell(text.head(), records.is_atom) } else { None };
    while text.at() < range.start {
        let Some(line) = text.peek_line().filter(|line| !(records.is_atom)(*line)) else {
            break;
        };
        if is_cell(line) {
            cell = self::cell(line);
        }
        text.line();
    }
    text.go_to(range.start);
    text.end_at(range.end);
    let real = records.real.map(|name| (name, 1));
    let texts = [names::CHAIN, names::SEGMENT, names::RESIDUE_NAME, names::ATOM_NAME];
    let mut atoms = AtomTable::new(&[ELEMENT, RESIDUE], &real, &texts, budget);
    let mut beads = Beads::default();
    while let Some(line) = text.line() {
        if is_cell(line) {
            cell = self::cell(line);
        }
        if !(records.is_atom)(line) {
            continue;
        }
        let Atom { position, real, residue_number, symbol, name, residue, chain, segment } =
            (records.atom)(line)?;
        let whole = [atoms::element(symbol, name, residue), residue_number];
        atoms.push(position, &whole, &real, &[chain, segment, residue, name])?;
        beads.push(name, residue);
    }
    if atoms.is_empty() {
        let what = "no ATOM or HETATM records: the file has no positions";
        return Err(ParseError::malformed(range.start, what));
    }
    let mut particles = atoms.into_particles();
    particles.attributes.extend(beads.attribute());
    Ok(RawParticles { step: step.number, cell, ..particles })
}
