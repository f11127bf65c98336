//! PQR files: PDB files with the charge and the radius of each atom in place of occupancy and temperature factor.
//!
//! Records of atoms have words instead of columns: `ATOM serial name residue chain number x y z charge radius`, where
//! the chain may be missing. Other records are those of PDB files. Charges are in e, lengths in A. After the
//! documentation of APBS (Baker and others, "Electrostatics of nanosystems", PNAS, 2001), which reads such files.

use super::{Atom, OPENINGS, Records, position};
use crate::format::Format;
use crate::read::atoms::{field, residue};
use crate::read::sniff::is_text;
use crate::read::text::{self, Line};
use crate::read::{ByteSource, Step};
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{ParseError, RawParticles, names};

/// PQR files.
pub const FORMAT: Format = Format::new(&Pqr);

struct Pqr;

const RECORDS: Records = Records { is_atom, atom, real: ["charge", names::RADIUS] };

/// Words of an atom after the name of the record, with a chain.
const WORDS: usize = 10;
/// Numbers at the end of a record: x, y, z, charge, radius.
const NUMBERS: usize = 5;

impl Reader for Pqr {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("pqr", &["pqr"])
    }

    /// Some programs put long notes before the atoms. Others write what may also be a PDB file without elements.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        if !is_text(head) {
            return Ok(Confidence::No);
        }
        let mut lines = text::Lines::new(head, 0..head.len());
        // The last line may be cut
        let is_whole = |line: &Line<'_>| line.at + line.text.len() < head.len();
        let atoms = || lines.clone().filter(|line| is_atom(*line));
        let is_sure = |line| words_of_atom(line).is_some() && !has_columns(line);
        if atoms().any(is_sure) {
            return Ok(Confidence::Signature);
        }
        let opens = |line: Line<'_>| OPENINGS.iter().any(|name| line.text.starts_with(name));
        let is_possible = if atoms().any(|line| is_whole(&line)) {
            atoms().any(|line| words_of_atom(line).is_some())
        } else {
            lines.next().is_none_or(opens)
        };
        Ok(if is_possible { Confidence::IfNamed } else { Confidence::No })
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
        super::steps(source.text(), &RECORDS, budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        super::read(source.text(), step, &RECORDS, budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        super::notes(head)
    }
}

/// What follows the name of the record of an atom. Large serial numbers follow it without a blank.
fn after_name(line: Line<'_>) -> Option<&[u8]> {
    let names = [&b"ATOM"[..], b"HETATM"];
    let rest = names.iter().find_map(|name| line.text.strip_prefix(*name))?;
    rest.first().filter(|byte| matches!(byte, b' ' | b'\t' | b'0'..=b'9')).map(|_| rest)
}

fn is_atom(line: Line<'_>) -> bool {
    after_name(line).is_some()
}

/// The words after the name of the record and how many there are, if the last ones are numbers.
pub(super) fn words_of_atom(line: Line<'_>) -> Option<([&[u8]; WORDS], usize)> {
    let mut found = [&b""[..]; WORDS];
    let mut count = 0;
    for word in text::words(after_name(line)?) {
        *found.get_mut(count)? = word;
        count += 1;
    }
    let numbers = found.get(count.checked_sub(NUMBERS)?..count)?;
    let are_numbers = numbers.iter().all(|word| text::number(word).is_some());
    (are_numbers && count + 1 >= WORDS).then_some((found, count))
}

/// Whether `line` has all numbers where PDB files have them.
fn has_columns(line: Line<'_>) -> bool {
    let is_blank_or_number = |start, end| {
        let field = field(line.text, start, end);
        field.is_empty() || text::number(field).is_some()
    };
    position(line).is_ok() && is_blank_or_number(54, 60) && is_blank_or_number(60, 66)
}

fn atom(line: Line<'_>) -> Result<Atom<'_>, ParseError> {
    let Some((words, count)) = words_of_atom(line) else {
        return atom_in_columns(line);
    };
    let [_, name, residue_name, chain, number, ..] = words;
    // Without a chain, the fourth word is the number, or a chain that touches its number
    let (chain, number) = if count == WORDS { (chain, number) } else { split_chain(chain) };
    let [x, y, z, charge, radius] = std::array::from_fn(|index| {
        let word = words.get(count - NUMBERS + index);
        word.and_then(|word| text::number(word)).unwrap_or(f64::NAN)
    });
    Ok(Atom {
        position: [x, y, z],
        real: [charge, radius],
        residue_number: residue(number),
        symbol: b"",
        name,
        residue: residue_name,
        chain,
        segment: b"",
    })
}

/// An atom whose words touch, since they fill the columns of a PDB file: those of pdb2pqr, except for `--whitespace`.
fn atom_in_columns(line: Line<'_>) -> Result<Atom<'_>, ParseError> {
    let mut numbers = text::words(line.text.get(54..).unwrap_or_default()).map(text::number);
    let (Ok(atom), Some(Some(charge)), Some(Some(radius)), None) =
        (super::atom(line), numbers.next(), numbers.next(), numbers.next())
    else {
        let what = format!(
            "{} is not an atom with the words `ATOM serial name residue chain number x y z charge radius`; the chain may \
             be missing",
            text::shown(line.text)
        );
        return Err(ParseError::malformed(line.at, what));
    };
    Ok(Atom { real: [charge, radius], symbol: b"", segment: b"", ..atom })
}

/// The letter of a chain and the number of a residue in one word; no chain if the word begins with a digit or a sign.
fn split_chain(word: &[u8]) -> (&[u8], &[u8]) {
    let has_chain = word.first().is_some_and(u8::is_ascii_alphabetic);
    word.split_at(usize::from(has_chain))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, numbers};
    use crate::read::pieces;
    use spherule_frame::Positions;

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read };

    /// The position of the only atom, and its charge, radius, element and residue.
    #[track_caller]
    fn one(record: &str) -> ([f64; 3], [f64; 4]) {
        let found = READER.one(record.as_bytes());
        let Positions::F64(positions) = &found.positions else { panic!("single precision") };
        assert_eq!(positions.len(), 1, "{record}");
        let number = |name| numbers(&attribute(&found, name).data)[0];
        (positions[0].to_array(), ["charge", "radius", "element", "residue"].map(number))
    }

    #[test]
    fn atoms_are_words_with_or_without_a_chain() {
        let position = [1.5, -2.5, 3.5];
        let expected = (position, [-0.3, 1.85, 7.0, 12.0]);
        for start in [
            "ATOM 1 N ALA A 12",
            "ATOM 1 N ALA 12",
            "ATOM\t1 N ALA 12A",
            "ATOM      1  N   ALA A12",
            "HETATM100000  N   ALA    12",
        ] {
            assert_eq!(one(&format!("{start} 1.5 -2.5 3.5 -0.3 1.85\n")), expected, "{start}");
        }
        let name = "ATOM 1 1HB2 ALA -7 1.5 -2.5 3.5 0 0\r\n";
        assert_eq!(one(name), (position, [0.0, 0.0, 1.0, -7.0]));
    }

    #[test]
    fn numbers_may_fill_the_columns_of_a_pdb_file() {
        let record = "ATOM   1234 HH11AARG A1234    -126.017-313.289-184.371 -0.8000 0.6000\n";
        assert_eq!(one(record), ([-126.017, -313.289, -184.371], [-0.8, 0.6, 1.0, 1234.0]));
    }

    #[test]
    fn chains_are_text() {
        let text = "ATOM 1 N ALA A 1 1 2 3 0 1\nATOM 2 N ALA B2 1 2 3 0 1\nEND\n";
        let found = READER.one(text.as_bytes());
        assert_eq!(attribute(&found, "chain").data.len(), 2);
        assert!(found.attributes.iter().all(|attribute| attribute.name != "segment"));
    }

    #[test]
    fn damage_is_named() {
        for (record, message) in [
            ("REMARK nothing else\n", "byte 0: no ATOM or HETATM records"),
            (
                "ATOM 1 N ALA 1 1.5 2.5 3.5 -0.3\n",
                "byte 0: \"ATOM 1 N ALA 1 1.5 2.5 3\"... is not an atom with the words",
            ),
            (
                "REMARK\nATOM      1  N   ALA A   1      11.250  -8.500   3.125 -0.3000 wide\n",
                "byte 7: \"ATOM      1  N   ALA A  \"... is not an atom with the words `ATOM serial",
            ),
        ] {
            let error = READER.error_inside(record.as_bytes()).to_string();
            assert!(error.starts_with(message), "{error} | {message}");
        }
    }
}
