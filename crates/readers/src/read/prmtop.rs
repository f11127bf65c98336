//! AMBER topologies (`.prmtop`, `.parm7`): the properties of the atoms of a simulation, without positions.
//!
//! Text in sections: `%FLAG NAME`, `%FORMAT(20a4)` with the Fortran format of its lines, and values in columns of equal
//! width. Read are names, residues, charges, masses, atomic numbers and bonds. After the page `prmtop` of the AMBER
//! manual.

use std::collections::BTreeMap;
use std::ops::Range;

use super::atoms::{self, TopologyAtoms, code};
use super::text::{self, Line, Lines};
use super::texts::{CODE_LEN, TextColumn};
use spherule_frame::{Bond, MemoryBudget, ParseError, RawParticles, masses, names};

/// Charges are stored in units of kcal and A: times the square root of Coulomb's constant in these.
const CHARGE_UNIT: f64 = 18.2223;
/// The square of that in files with the force field of CHARMM, which `chamber` writes.
const CHARMM_CONSTANT: f64 = 332.0716;
/// Indices of atoms in bonds are those of their first coordinate.
const STRIDE: usize = 3;
/// The largest atomic number.
const MAX_NUMBER: i64 = 118;
/// Sections that some files lack.
const OPTIONAL: [&str; 3] = ["ATOMIC_NUMBER", "RESIDUE_NUMBER", "RESIDUE_CHAINID"];

/// Whether a file that begins with `head` is an AMBER topology: a version, or the first section with its format, which
/// older programs write alone. Comments may come first.
pub fn is_prmtop(head: &[u8]) -> bool {
    let is_head = |line: &Line<'_>| !line.is_blank() && !line.text.starts_with(b"%COMMENT");
    let mut lines = Lines::new(head, 0..head.len()).filter(is_head).map(|line| line.text);
    let first = lines.next().unwrap_or_default();
    let second = lines.next().unwrap_or_default();
    first.starts_with(b"%VERSION")
        || (first.starts_with(b"%FLAG ") && second.starts_with(b"%FORMAT("))
}

/// Reads the number of atoms, and particles with their properties and bonds, but without positions.
///
/// # Errors
/// [`ParseError`] if the file is damaged, or its atoms need more memory than `budget` allows.
pub fn read(bytes: &[u8], budget: MemoryBudget) -> Result<(usize, RawParticles), ParseError> {
    let file = Prmtop::new(bytes);
    let pointer = |index: usize| file.pointer(index);
    let (count, residue_count) = (pointer(0)?, pointer(11)?);
    let bond_counts =
        [("BONDS_INC_HYDROGEN", pointer(2)?), ("BONDS_WITHOUT_HYDROGEN", pointer(12)?)];
    // An atom has four bytes at least, a bond nine.
    let bond_count: usize =
        bond_counts.iter().map(|(_, count)| *count).fold(0, usize::saturating_add);
    let atom_len = 72 + 3 * CODE_LEN;
    let need = atom_len * count.min(bytes.len() / 4) + 32 * bond_count.min(bytes.len() / 9);
    budget.check(need as u64, "its numbers in memory are")?;
    let residues = file.residues(residue_count, count)?;
    let mut atoms = file.atoms(count, &residues)?;
    for (name, count_of) in bond_counts {
        file.bonds(name, count_of, count, &mut atoms.bonds)?;
    }
    Ok((count, atoms))
}

/// A section.
#[derive(Debug)]
struct Section {
    /// Where it begins.
    at: usize,
    /// Values in a line, and columns of a value.
    per_line: usize,
    width: usize,
    /// The lines of the values.
    body: Range<usize>,
}

/// A residue, with the atoms that it has.
struct Residue<'a> {
    name: &'a [u8],
    chain: &'a [u8],
    number: i64,
    atoms: Range<usize>,
}

/// The sections of a file by name.
struct Prmtop<'a> {
    bytes: &'a [u8],
    sections: BTreeMap<&'a [u8], Section>,
}

impl<'a> Prmtop<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let mut sections = BTreeMap::new();
        let mut current: Option<(&[u8], Section)> = None;
        for line in Lines::new(bytes, 0..bytes.len()) {
            if let Some(name) = line.text.strip_prefix(b"%FLAG") {
                let section =
                    Section { at: line.at, per_line: 0, width: 0, body: bytes.len()..bytes.len() };
                let last = current.replace((name.trim_ascii(), section));
                sections.extend(last.map(|(name, section)| ended(name, section, line.at)));
            } else if let (Some(format), Some((_, section))) =
                (line.text.strip_prefix(b"%FORMAT("), &mut current)
            {
                (section.per_line, section.width) = format_of(format).unwrap_or_default();
                section.body.start = (line.at + line.text.len()).min(bytes.len());
            }
        }
        sections.extend(current.map(|(name, section)| ended(name, section, bytes.len())));
        Self { bytes, sections }
    }

    /// The first `count` values of the section `name`, by `parse`; an empty list if the section may be missing and is.
    fn values<T>(
        &self,
        name: &str,
        count: usize,
        parse: impl Fn(&'a [u8]) -> Option<T>,
    ) -> Result<Vec<T>, ParseError> {
        let Some(section) = self.sections.get(name.as_bytes()) else {
            if OPTIONAL.contains(&name) || count == 0 {
                return Ok(Vec::new());
            }
            let what = format!("an AMBER topology without the section `%FLAG {name}`");
            return Err(ParseError::malformed(self.bytes.len(), what));
        };
        if section.width == 0 && count > 0 {
            let what = format!("section {name} has no format such as `%FORMAT(10I8)`");
            return Err(ParseError::malformed(section.at, what));
        }
        let mut values = Vec::new();
        let is_row = |line: &Line<'_>| !line.text.is_empty() && !line.text.starts_with(b"%");
        let mut rows = Lines::new(self.bytes, section.body.clone()).filter(is_row);
        while values.len() < count {
            let Some(row) = rows.next() else {
                let what = format!("section {name} has {} of {count} values", values.len());
                return Err(ParseError::malformed(section.body.end, what));
            };
            for index in 0..section.per_line.min(count - values.len()) {
                let start = index * section.width;
                let field = atoms::field(row.text, start, start + section.width);
                values.push(parse(field).ok_or_else(|| {
                    let what = format!("section {name} has {} as a value", text::shown(field));
                    ParseError::malformed(row.at, what)
                })?);
            }
        }
        Ok(values)
    }

    /// Number `index` of the section with the counts.
    fn pointer(&self, index: usize) -> Result<usize, ParseError> {
        let counts = self.values("POINTERS", index + 1, |field| {
            text::integer(field).and_then(|count| usize::try_from(count).ok())
        })?;
        Ok(counts.last().copied().unwrap_or_default())
    }

    /// The residues of `atoms` atoms.
    fn residues(&self, count: usize, atoms: usize) -> Result<Vec<Residue<'a>>, ParseError> {
        let starts = self.values("RESIDUE_POINTER", count, text::integer)?;
        let labels = self.values("RESIDUE_LABEL", count, Some)?;
        let numbers = self.values("RESIDUE_NUMBER", count, text::integer)?;
        let chains = self.values("RESIDUE_CHAINID", count, Some)?;
        let start_of = |index: usize| {
            starts.get(index).map_or(Some(atoms), |start| usize::try_from(start - 1).ok())
        };
        let residue = |(index, name): (usize, &&'a [u8])| {
            let range = start_of(index)?..start_of(index + 1)?;
            let is_next =
                range.start <= range.end && range.end <= atoms && (index > 0 || range.start == 0);
            is_next.then(|| Residue {
                name,
                chain: chains.get(index).copied().unwrap_or_default(),
                number: numbers.get(index).copied().unwrap_or(1 + index as i64),
                atoms: range,
            })
        };
        let residues: Option<Vec<Residue<'a>>> = labels.iter().enumerate().map(residue).collect();
        let residues = residues.filter(|residues| atoms == 0 || !residues.is_empty());
        residues.ok_or_else(|| {
            let at = self.sections.get(&b"RESIDUE_POINTER"[..]).map_or(0, |section| section.at);
            let what = format!(
                "section RESIDUE_POINTER does not divide {atoms} atoms among {count} residues"
            );
            ParseError::malformed(at, what)
        })
    }

    /// The attributes of `count` atoms.
    fn atoms(&self, count: usize, residues: &[Residue<'_>]) -> Result<RawParticles, ParseError> {
        let atom_names = self.values("ATOM_NAME", count, Some)?;
        let mut charges = self.values("CHARGE", count, text::number)?;
        let is_charmm = self.sections.contains_key(&b"CTITLE"[..]);
        let unit = if is_charmm { CHARMM_CONSTANT.sqrt() } else { CHARGE_UNIT };
        charges.iter_mut().for_each(|charge| *charge /= unit);
        let masses = self.values("MASS", count, text::number)?;
        let numbers = self.values("ATOMIC_NUMBER", count, text::integer)?;
        let mut texts = [names::CHAIN, names::RESIDUE_NAME, names::ATOM_NAME].map(TextColumn::new);
        let (mut elements, mut residue_numbers) = (Vec::new(), Vec::new());
        let has_own = has_own_masses(&masses);
        for residue in residues {
            for index in residue.atoms.clone() {
                let name = atom_names.get(index).copied().unwrap_or_default();
                let by_mass =
                    masses.get(index).copied().filter(|_| has_own).and_then(masses::element);
                elements.push(match numbers.get(index) {
                    Some(number @ 1..=MAX_NUMBER) => code(*number),
                    Some(_) => by_mass.unwrap_or_default(),
                    None => {
                        by_mass.unwrap_or_else(|| code(atoms::element(b"", name, residue.name)))
                    }
                });
                residue_numbers.push(code(residue.number));
                for (column, text) in texts.iter_mut().zip([residue.chain, residue.name, name]) {
                    column.push(text);
                }
            }
        }
        let residues = residue_numbers;
        Ok(TopologyAtoms { elements, residues, charges, masses, texts }.into_particles())
    }

    /// Adds the `count` bonds of the section `name`: indices of coordinates of two of the `atoms` atoms, and a type.
    fn bonds(
        &self,
        name: &str,
        count: usize,
        atoms: usize,
        bonds: &mut Vec<Bond>,
    ) -> Result<(), ParseError> {
        let values = self.values(name, count.saturating_mul(3), text::integer)?;
        let index = |value: i64| {
            let coordinate =
                usize::try_from(value).ok().filter(|value| value.is_multiple_of(STRIDE))?;
            let atom = Some(coordinate / STRIDE).filter(|atom| *atom < atoms)?;
            u32::try_from(atom).ok()
        };
        let (triples, _) = values.as_chunks::<3>();
        for [a, b, _] in triples {
            let (Some(first), Some(second)) = (index(*a), index(*b)) else {
                let at = self.sections.get(name.as_bytes()).map_or(0, |section| section.at);
                let what = format!(
                    "section {name} has a bond between {a} and {b}, which are not both multiples of 3 below {}",
                    STRIDE * atoms
                );
                return Err(ParseError::malformed(at, what));
            };
            bonds.push([first, second]);
        }
        Ok(())
    }
}

/// The section `name`, which ends at `end`.
fn ended(name: &[u8], section: Section, end: usize) -> (&[u8], Section) {
    let start = section.body.start.min(end);
    (name, Section { body: start..end, ..section })
}

/// Values in a line and columns of each by a Fortran format such as `20a4)` or `5E16.8)`.
fn format_of(format: &[u8]) -> Option<(usize, usize)> {
    let number = |bytes: &[u8]| text::integer(bytes).and_then(|n| usize::try_from(n).ok());
    let letter = format.iter().position(u8::is_ascii_alphabetic)?;
    let (count, rest) = format.split_at(letter);
    let width = rest.get(1..)?.split(|byte| !byte.is_ascii_digit()).next()?;
    let shape = (number(count)?, number(width)?);
    ((1..=1000).contains(&shape.0) && (1..=1000).contains(&shape.1)).then_some(shape)
}

/// Whether atoms have the masses of their elements: hydrogen that took mass of its neighbours has about 3.
fn has_own_masses(masses: &[f64]) -> bool {
    !masses.iter().any(|mass| (2.1..3.9).contains(mass))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{attribute, names, numbers, sample};
    use spherule_frame::AttributeData;

    const TEXT: &str = "%VERSION  VERSION_STAMP = V0001.000
%FLAG TITLE
%FORMAT(20a4)
water and sodium
%FLAG POINTERS
%FORMAT(10I8)
       4       0       2       1       0       0       0       0       0       0
       0       2       1
%FLAG ATOM_NAME
%FORMAT(20a4)
O   HW1 HW2 Na+
%FLAG CHARGE
%COMMENT in units of kcal and A
%FORMAT(3E16.8)
 -1.51973982E+01  7.59869910E+00  7.59869910E+00
  1.82223000E+01
%FLAG ATOMIC_NUMBER
%FORMAT(10I8)
       8       1      -1      11
%FLAG MASS
%FORMAT(5E16.8)
  1.60000000E+01  1.00800000E+00  1.00800000E+00  2.29900000E+01
%FLAG RESIDUE_LABEL
%FORMAT(20a4)
WAT Na+
%FLAG RESIDUE_POINTER
%FORMAT(10I8)
       1       4
%FLAG BONDS_INC_HYDROGEN
%FORMAT(10I8)
       0       3       1       0       6       1
%FLAG BONDS_WITHOUT_HYDROGEN
%FORMAT(10I8)
       0       9       2
";

    fn whole(text: &str) -> RawParticles {
        let (count, particles) =
            read(text.as_bytes(), MemoryBudget::UNLIMITED).expect("a topology");
        assert_eq!(count, 4);
        particles
    }

    fn texts(particles: &RawParticles, name: &str) -> Vec<String> {
        let AttributeData::I32(codes) = &attribute(particles, name).data else {
            panic!("text has integers");
        };
        codes.iter().map(|code| particles.labels[name][&i64::from(*code)].clone()).collect()
    }

    #[test]
    fn atoms_have_names_residues_charges_and_bonds() {
        assert!(is_prmtop(TEXT.as_bytes()) && !is_prmtop(b"%FLAGS") && !is_prmtop(b""));
        for text in [TEXT, &TEXT.replace('\n', "\r\n")] {
            let found = whole(text);
            let all = ["element", "residue", "charge", "mass", "residue_name", "atom_name"];
            assert_eq!(names(&found), all);
            assert_eq!(numbers(&attribute(&found, "element").data), [8.0, 1.0, 1.0, 11.0]);
            assert_eq!(numbers(&attribute(&found, "residue").data), [1.0, 1.0, 1.0, 2.0]);
            assert_eq!(numbers(&attribute(&found, "mass").data), [16.0, 1.008, 1.008, 22.99]);
            let charges = numbers(&attribute(&found, "charge").data);
            assert_eq!(
                charges,
                [-15.197_398_2 / 18.2223, 7.598_699_1 / 18.2223, 7.598_699_1 / 18.2223, 1.0]
            );
            assert_eq!(texts(&found, "residue_name"), ["WAT", "WAT", "WAT", "Na+"]);
            assert_eq!(texts(&found, "atom_name"), ["O", "HW1", "HW2", "Na+"]);
            assert_eq!(found.bonds, [[0, 1], [0, 2], [0, 3]]);
        }
        // An extra point, and the charges of CHARMM
        let point = TEXT.replace("1.00800000E+00  2.29", "0.00000000E+00  2.29");
        let point = whole(&point.replace("%FLAG TITLE", "%FLAG CTITLE"));
        assert_eq!(numbers(&attribute(&point, "element").data), [8.0, 1.0, 0.0, 11.0]);
        let charge = numbers(&attribute(&point, "charge").data)[3];
        assert_eq!(charge, 18.2223 / 332.0716_f64.sqrt());
    }

    #[test]
    fn elements_follow_from_masses_or_names() {
        let old = TEXT.replace("ATOMIC_NUMBER", "OTHER");
        assert_eq!(numbers(&attribute(&whole(&old), "element").data), [8.0, 1.0, 1.0, 11.0]);
        let heavy =
            old.replace("  1.60000000E+01  1.00800000E+00", "  1.19910000E+01  3.02400000E+00");
        assert_eq!(numbers(&attribute(&whole(&heavy), "element").data), [8.0, 1.0, 1.0, 11.0]);
    }

    #[test]
    fn residues_may_have_numbers_and_chains() {
        let more = "%FLAG RESIDUE_NUMBER\n%FORMAT(20I4)\n  52  -1\n%FLAG RESIDUE_CHAINID\n%FORMAT(20a4)\nA   B\n";
        let found = whole(&format!("{TEXT}{more}"));
        assert_eq!(numbers(&attribute(&found, "residue").data), [52.0, 52.0, 52.0, -1.0]);
        assert_eq!(texts(&found, "chain"), ["A", "A", "A", "B"]);
    }

    #[test]
    fn damage_is_named() {
        for (from, to, message) in [
            ("       4       0", "       x       0", "section POINTERS has \"x\" as a value"),
            ("       4       0", "      -4       0", "section POINTERS has \"-4\""),
            ("       4       0", "     400       0", "section ATOM_NAME has 20 of 400 values"),
            (
                "       0       2       1\n%FLAG ATOM",
                "       0       0       1\n%FLAG ATOM",
                "does not divide 4 atoms among 0",
            ),
            ("%FLAG CHARGE", "%FLAG CHARGES", "without the section `%FLAG CHARGE`"),
            ("%FORMAT(3E16.8)", "%FORMAT(E)", "section CHARGE has no format"),
            ("%FORMAT(3E16.8)", "", "section CHARGE has no format"),
            ("1.82223000E+01", "", "section CHARGE has \"\" as a value"),
            ("       8       1", "       8     one", "section ATOMIC_NUMBER has \"one\""),
            (
                "       1       4",
                "       1       9",
                "section RESIDUE_POINTER does not divide 4 atoms among 2",
            ),
            ("       1       4", "       2       4", "section RESIDUE_POINTER does not divide"),
            (
                "       0       9       2",
                "       0      12       2",
                "a bond between 0 and 12, which are not both",
            ),
            ("       0       9       2", "       0       8       2", "a bond between 0 and 8"),
            ("       0       9       2\n", "", "section BONDS_WITHOUT_HYDROGEN has 0 of 3 values"),
        ] {
            let text = TEXT.replacen(from, to, 1);
            assert_ne!(text, TEXT, "{from}");
            let error =
                read(text.as_bytes(), MemoryBudget::UNLIMITED).expect_err("damaged").to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
        for cut in 0..TEXT.len() - 30 {
            assert!(read(&TEXT.as_bytes()[..cut], MemoryBudget::UNLIMITED).is_err(), "{cut}");
        }
        let absurd = TEXT.replace("       4       0", "99999999       0");
        assert!(read(absurd.as_bytes(), MemoryBudget::UNLIMITED).is_err());
        assert!(read(TEXT.as_bytes(), MemoryBudget::new(10, "take care")).is_err());
    }

    #[test]
    fn the_sample_is_read() {
        let (count, particles) =
            read(&sample("molecules/ethanol.prmtop"), MemoryBudget::UNLIMITED).expect("a topology");
        assert_eq!((count, particles.bonds.len()), (9, 8));
    }
}
