//! PSF files of CHARMM and X-PLOR: the properties of the atoms of a simulation, without positions.
//!
//! Text. The first line begins with `PSF`. Behind a count and `!NATOM` is a line for each atom: number, segment (which
//! may be missing), residue, name of the residue, name, type, charge, mass. Behind a count and `!NBOND` are the numbers of the atoms of
//! each bond, from 1. Nothing else of it is read. After the manual of CHARMM.

use super::atoms::{self, TopologyAtoms, code};
use super::text::{self, Line, Lines};
use super::texts::{CODE_LEN, TextColumn};
use spherule_frame::{Bond, MemoryBudget, ParseError, RawParticles, names};

/// What follows the count in the heading of the atoms.
const ATOMS: &[u8] = b"!NATOM";
/// The same of the bonds, which may have words after it: `!NBOND: bonds`.
const BONDS: &[u8] = b"!NBOND";

/// Whether a file that begins with `head` is a PSF file.
pub fn is_psf(head: &[u8]) -> bool {
    head.strip_prefix(b"PSF").is_some_and(|rest| rest.first().is_none_or(u8::is_ascii_whitespace))
}

/// Reads the number of atoms, and particles with their properties and bonds, but without positions.
///
/// # Errors
/// [`ParseError`] if the file is damaged, or its atoms need more memory than `budget` allows.
pub fn read(bytes: &[u8], budget: MemoryBudget) -> Result<(usize, RawParticles), ParseError> {
    let mut lines = Lines::new(bytes, 0..bytes.len());
    let heading = lines.find(|line| text::words(line.text).nth(1).is_some_and(|w| w == ATOMS));
    let Some(heading) = heading else {
        let what = "a PSF file without a line `12 !NATOM`";
        return Err(ParseError::malformed(bytes.len(), what));
    };
    let count = text::words(heading.text).next().and_then(text::integer);
    let Some(count) = count.and_then(|count| usize::try_from(count).ok()) else {
        let what = format!("{} is not a number of atoms", text::shown(heading.text));
        return Err(ParseError::malformed(heading.at, what));
    };
    // A line of an atom has 15 bytes at least.
    let most = count.min(bytes.len() / 15);
    let mut texts = [names::SEGMENT, names::RESIDUE_NAME, names::ATOM_NAME].map(TextColumn::new);
    let atom_len = 24 + CODE_LEN * texts.len();
    budget.check((atom_len * most) as u64, "its numbers in memory are")?;
    let (mut elements, mut residues) = (Vec::new(), Vec::new());
    let (mut charges, mut masses) = (Vec::new(), Vec::new());
    for index in 0..count {
        let line = lines.next();
        let words: Vec<&[u8]> =
            line.map(|line| text::words(line.text).take(8).collect()).unwrap_or_default();
        let segment = words.get(1).filter(|_| has_segment(&words));
        let fields = words.get(if segment.is_some() { 2 } else { 1 }..);
        let numbers = match fields {
            Some([residue, residue_name, name, _, charge, mass, ..]) => {
                elements.push(code(atoms::element(b"", name, residue_name)));
                residues.push(code(atoms::residue(residue)));
                let segment = segment.copied().unwrap_or_default();
                for (column, text) in texts.iter_mut().zip([segment, residue_name, name]) {
                    column.push(text);
                }
                text::number(charge).zip(text::number(mass))
            }
            _ => None,
        };
        let Some((charge, mass)) = numbers else {
            let at = line.map_or(bytes.len(), |line| line.at);
            let what = format!(
                "{count} atoms expected, line {} of them is not one with number, segment, residue, its name, name, \
                 type, charge and mass",
                index + 1
            );
            return Err(ParseError::malformed(at, what));
        };
        charges.push(charge);
        masses.push(mass);
    }
    let bonds = bonds(&mut lines, count, budget)?;
    let atoms = TopologyAtoms { elements, residues, charges, masses, texts };
    Ok((count, RawParticles { bonds, ..atoms.into_particles() }))
}

/// Whether the `words` of an atom have a segment. Without one, charge and mass come one word earlier, and an integer
/// follows them.
fn has_segment(words: &[&[u8]]) -> bool {
    let is_real = |word: &[u8]| word.contains(&b'.') && text::number(word).is_some();
    let [.., charge, mass, fixed] = words else {
        return true;
    };
    !(words.len() == 8 && is_real(charge) && is_real(mass) && text::integer(fixed).is_some())
}

/// Reads the bonds of `atoms` atoms from the `lines` behind these; there need not be any.
fn bonds(
    lines: &mut Lines<'_>,
    atoms: usize,
    budget: MemoryBudget,
) -> Result<Vec<Bond>, ParseError> {
    let is_heading = |line: &Line<'_>| {
        let word = text::words(line.text).nth(1);
        word.is_some_and(|word| word.starts_with(BONDS))
    };
    let Some(heading) = lines.find(is_heading) else {
        return Ok(Vec::new());
    };
    let count = text::words(heading.text).next().and_then(text::integer);
    let Some(count) = count.and_then(|count| usize::try_from(count).ok()) else {
        let what = format!("{} is not a number of bonds", text::shown(heading.text));
        return Err(ParseError::malformed(heading.at, what));
    };
    let mut bonds = Vec::new();
    let mut first = None;
    let mut at = heading.at;
    while bonds.len() < count {
        let Some(line) = lines.next() else {
            let what = format!("{count} bonds expected, the file has {}", bonds.len());
            return Err(ParseError::malformed(at, what));
        };
        at = line.at;
        budget.check(8 * (bonds.len() as u64 + 8), "its bonds in memory are")?;
        for word in text::words(line.text) {
            let number = text::integer(word).and_then(|n| u32::try_from(n).ok());
            let atom = number.filter(|n| (1..=atoms).contains(&(*n as usize)));
            let Some(atom) = atom.map(|number| number - 1) else {
                let what = format!(
                    "{} in a bond is not the number of an atom, 1 to {atoms}",
                    text::shown(word)
                );
                return Err(ParseError::malformed(line.at, what));
            };
            match first.take() {
                None => first = Some(atom),
                Some(_) if bonds.len() == count => break,
                Some(first) => bonds.push([first, atom]),
            }
        }
    }
    Ok(bonds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use spherule_frame::AttributeData;

    const TEXT: &str = "PSF EXT\n\n 1 !NTITLE\n* made by hand\n\n 2 !NATOM\n \
        1 SYS 7 SOL OW OT -0.834 15.9994 0\n 2 SYS 7 SOL HW1 HT 0.417 1.008 0\n\n 2 !NBOND: bonds\n \
        1 2 2\n 1\n";

    fn fails(from: &str, to: &str, words: &str) {
        let text = TEXT.replace(from, to);
        let error = read(text.as_bytes(), MemoryBudget::UNLIMITED).expect_err("damaged");
        assert!(error.to_string().contains(words), "{error}");
    }

    #[test]
    fn atoms_have_elements_charges_and_masses() {
        assert!(is_psf(TEXT.as_bytes()) && !is_psf(b"PSFX"));
        let (count, particles) = read(TEXT.as_bytes(), MemoryBudget::UNLIMITED).unwrap();
        let RawParticles { attributes, bonds, labels, .. } = particles;
        assert_eq!(count, 2);
        assert_eq!(bonds, [[0, 1], [1, 0]]);
        let without = TEXT.split_once(" 2 !NBOND").unwrap().0;
        assert_eq!(
            read(without.as_bytes(), MemoryBudget::UNLIMITED).unwrap().1.bonds,
            Vec::<Bond>::new()
        );
        let data = |i: usize| &attributes[i].data;
        assert_eq!(data(0), &AttributeData::I32(vec![8, 1]));
        assert_eq!(data(1), &AttributeData::I32(vec![7, 7]));
        assert_eq!(data(2), &AttributeData::F64(vec![-0.834, 0.417]));
        assert_eq!(data(3), &AttributeData::F64(vec![15.9994, 1.008]));
        let texts = |name: &str| -> Vec<&str> {
            let attribute = attributes.iter().find(|a| a.name == name).expect("text");
            let AttributeData::I32(codes) = &attribute.data else { panic!("integers") };
            codes.iter().map(|code| labels[name][&i64::from(*code)].as_str()).collect()
        };
        assert_eq!(texts("segment"), ["SYS", "SYS"]);
        assert_eq!(texts("residue_name"), ["SOL", "SOL"]);
        assert_eq!(texts("atom_name"), ["OW", "HW1"]);
    }

    #[test]
    fn segments_may_be_missing_and_residues_have_letters() {
        let data = |text: &str| read(text.as_bytes(), MemoryBudget::UNLIMITED).unwrap().1;
        let whole = data(TEXT);
        let mut without = whole.clone();
        without.attributes.retain(|attribute| attribute.name != "segment");
        without.labels.remove("segment");
        assert_eq!(data(&TEXT.replace(" SYS ", " ")), without);
        assert_eq!(data(&TEXT.replace(" 7 SOL", " 7A SOL")), whole);
        // Types may be numbers, and more numbers may follow
        let numbers =
            TEXT.replace("OT -0.834 15.9994 0", "2 -0.834 15.9994 0 0.00000 -0.301140E-02");
        assert_eq!(data(&numbers), whole);
        assert_eq!(data(&numbers.replace(" SYS ", " ")), without);
    }

    #[test]
    fn damage_is_named() {
        fails("2 !NATOM", "x !NATOM", "not a number of atoms");
        fails("2 !NATOM", "3 !NATOM", "3 atoms expected, line 3");
        fails("2 !NATOM", "2000000000 !NATOM", "line 3");
        fails("!NATOM", "!ATOM", "without a line");
        fails("15.9994", "heavy", "line 1 of them");
        fails("2 !NBOND", "x !NBOND", "not a number of bonds");
        fails("2 !NBOND", "3 !NBOND", "3 bonds expected, the file has 2");
        fails("1 2 2", "1 2 3", "\"3\" in a bond is not the number of an atom, 1 to 2");
        fails("1 2 2", "1 two 2", "\"two\" in a bond");
        fails("1 2 2", "0 2 2", "\"0\" in a bond");
        let tight = MemoryBudget::new(10, "take care");
        assert!(read(TEXT.as_bytes(), tight).is_err());
    }
}
