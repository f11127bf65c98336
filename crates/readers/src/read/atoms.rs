//! Atoms of molecular text files, collected one by one, and the chemical elements that their names stand for.

use glam::DVec3;

use super::category;
use super::text::{self, Line};
use super::texts::{CODE_LEN, TextColumn};
use spherule_frame::{Attribute, AttributeData, MemoryBudget, ParseError, Positions, RawParticles};

/// Attribute for the chemical element.
pub(super) const ELEMENT: &str = "element";
/// Attribute for the number of the residue.
pub(super) const RESIDUE: &str = "residue";

/// Positions and attributes that grow atom by atom within a budget.
#[derive(Debug)]
pub(super) struct AtomTable {
    positions: Vec<DVec3>,
    attributes: Vec<Attribute>,
    texts: Vec<TextColumn>,
    budget: MemoryBudget,
    /// Bytes of an atom.
    atom_len: usize,
}

impl AtomTable {
    /// No atoms yet. They have attributes of one integer each, called `whole`, of real numbers: names and components, and
    /// of text.
    pub(super) fn new(
        whole: &[&'static str],
        real: &[(&'static str, usize)],
        texts: &[&'static str],
        budget: MemoryBudget,
    ) -> Self {
        let attribute =
            |name: &str, components, data| Attribute { name: name.to_owned(), components, data };
        let whole_columns =
            whole.iter().map(|name| attribute(name, 1, AttributeData::I32(Vec::new())));
        let real_columns = real
            .iter()
            .map(|(name, components)| attribute(name, *components, AttributeData::F64(Vec::new())));
        let real_len: usize = real.iter().map(|(_, components)| components).sum();
        Self {
            positions: Vec::new(),
            attributes: whole_columns.chain(real_columns).collect(),
            texts: texts.iter().map(|name| TextColumn::new(name)).collect(),
            budget,
            atom_len: size_of::<DVec3>() + 4 * whole.len() + 8 * real_len + CODE_LEN * texts.len(),
        }
    }

    /// Adds an atom with the numbers and texts of its attributes, in the order of [`Self::new`]. Integers beyond i32 become 0.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`] beyond the budget.
    pub(super) fn push(
        &mut self,
        position: [f64; 3],
        whole: &[i64],
        real: &[f64],
        texts: &[&[u8]],
    ) -> Result<(), ParseError> {
        // A vector that grows holds its old numbers and twice the room for new ones.
        let need = 3 * self.atom_len * (self.positions.len() + 1);
        self.budget.check(need as u64, "its numbers in memory are")?;
        self.positions.push(DVec3::from_array(position));
        let (mut whole, mut real) = (whole.iter(), real.iter());
        for attribute in &mut self.attributes {
            match &mut attribute.data {
                AttributeData::I32(v) => {
                    v.extend(whole.next().map(|n| i32::try_from(*n).unwrap_or_default()));
                }
                AttributeData::F64(v) => v.extend(real.by_ref().take(attribute.components)),
                _ => {}
            }
        }
        for (column, text) in self.texts.iter_mut().zip(texts) {
            column.push(text);
        }
        Ok(())
    }

    /// Whether there are no atoms yet.
    pub(super) fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The atoms. Attributes of text follow the others; those without any text are left out.
    pub(super) fn into_particles(mut self) -> RawParticles {
        for attribute in &mut self.attributes {
            attribute.data.shrink();
        }
        self.positions.shrink_to_fit();
        let mut particles = RawParticles {
            positions: Positions::F64(self.positions),
            attributes: self.attributes,
            ..RawParticles::default()
        };
        for column in self.texts {
            column.add_to(&mut particles);
        }
        particles
    }
}

/// The properties of the atoms of a topology, which has no positions.
#[derive(Debug)]
pub(super) struct TopologyAtoms {
    pub(super) elements: Vec<i32>,
    pub(super) residues: Vec<i32>,
    pub(super) charges: Vec<f64>,
    pub(super) masses: Vec<f64>,
    pub(super) texts: [TextColumn; 3],
}

impl TopologyAtoms {
    pub(super) fn into_particles(self) -> RawParticles {
        let attribute = |name: &str, data| Attribute { name: name.to_owned(), components: 1, data };
        let attributes = vec![
            attribute(ELEMENT, AttributeData::I32(self.elements)),
            attribute(RESIDUE, AttributeData::I32(self.residues)),
            attribute("charge", AttributeData::F64(self.charges)),
            attribute("mass", AttributeData::F64(self.masses)),
        ];
        let mut particles = RawParticles { attributes, ..RawParticles::default() };
        self.texts.into_iter().for_each(|column| column.add_to(&mut particles));
        particles
    }
}

/// A number for a column of i32; 0 beyond it.
pub(super) fn code(number: i64) -> i32 {
    i32::try_from(number).unwrap_or_default()
}

/// The columns `first..end` of a line, from 0, without blanks around; empty where the line is shorter.
pub(super) fn field(line: &[u8], first: usize, end: usize) -> &[u8] {
    let end = end.min(line.len());
    line.get(first..end).unwrap_or_default().trim_ascii()
}

/// The number of a residue, without the code of an insertion behind it (`52A`); 0 without a number.
pub(super) fn residue(field: &[u8]) -> i64 {
    let is_digit =
        |(index, byte): (usize, &u8)| byte.is_ascii_digit() || (index == 0 && *byte == b'-');
    let len = field.iter().enumerate().take_while(|place| is_digit(*place)).count();
    text::integer(field.get(..len).unwrap_or_default()).unwrap_or_default()
}

/// [`field`] as a coordinate.
///
/// # Errors
/// [`ParseError::Malformed`] if it is not a number.
pub(super) fn coordinate(line: Line<'_>, first: usize, end: usize) -> Result<f64, ParseError> {
    let token = field(line.text, first, end);
    text::number(token).ok_or_else(|| {
        let what = format!(
            "columns {} to {end} of an atom have {}, not a coordinate",
            first + 1,
            text::shown(token)
        );
        ParseError::malformed(line.at, what)
    })
}

/// Names of ions in force fields that are not symbols.
const ION_NAMES: [(&[u8], &[u8]); 5] =
    [(b"SOD", b"Na"), (b"CLA", b"Cl"), (b"POT", b"K"), (b"CAL", b"Ca"), (b"CES", b"Cs")];

/// The number of sites that are not atoms.
const NO_ELEMENT: i64 = 0;

/// Letters in the names of such sites: charges of water models, lone pairs, masses of rigid groups, dummies.
const SITES: [&[u8]; 13] = [
    b"M", b"MW", b"EP", b"EPW", b"LP", b"LPA", b"LPB", b"VS", b"DUM", b"DU", b"MCH", b"MNH",
    b"MTRP",
];

/// Symbols of two letters that names of atoms begin with. Others are names such as `CA`, which is the carbon alpha,
/// except for ions.
const LONG_SYMBOLS: [&[u8; 2]; 14] = [
    b"AL", b"AU", b"BR", b"CL", b"CU", b"FE", b"LI", b"MG", b"MN", b"NI", b"PT", b"SE", b"SI",
    b"ZN",
];

/// The number of the element ([`category`]) that `symbol` says, or if the file has none the name of the atom and of its
/// residue.
pub(super) fn element(symbol: &[u8], name: &[u8], residue: &[u8]) -> i64 {
    if symbol.first().is_some_and(u8::is_ascii_alphabetic) {
        return match letters(symbol) {
            b"X" => NO_ELEMENT,
            site if is_any(site, &SITES) => NO_ELEMENT,
            symbol => category::code(symbol),
        };
    }
    let prefix = letters(name);
    if is_any(prefix, &SITES) {
        return NO_ELEMENT;
    }
    let ion = ION_NAMES.iter().find(|(ion, _)| prefix.eq_ignore_ascii_case(ion));
    if let Some((_, symbol)) = ion {
        return category::code(symbol);
    }
    let is_ion = prefix.len() == 2 && prefix.eq_ignore_ascii_case(letters(residue));
    let first_two = prefix.get(..2).unwrap_or(prefix);
    let is_long = LONG_SYMBOLS.iter().any(|long| first_two.eq_ignore_ascii_case(*long));
    if is_ion || is_long {
        return category::code(first_two);
    }
    let short = prefix.get(..1).unwrap_or_default();
    // Isotopes of hydrogen are seldom meant by the first letter of a name
    match category::code(short) {
        number if category::is_element(number) && !category::is_isotope(short) => number,
        _ => category::code(name),
    }
}

/// [`element`] of an atom in a file without residues: names may also be symbols in the usual case (`Na`), and ions (`NA+`).
pub(super) fn element_without_residue(name: &[u8]) -> i64 {
    let is_symbol = matches!(name, [first, second] if first.is_ascii_uppercase() && second.is_ascii_lowercase());
    let is_ion = name.ends_with(b"+") || name.ends_with(b"-");
    match category::code(letters(name)) {
        number if (is_symbol || is_ion) && category::is_element(number) => number,
        _ => element(b"", name, b""),
    }
}

/// Whether `name` is one of `names`, in whatever case.
fn is_any(name: &[u8], names: &[&[u8]]) -> bool {
    names.iter().any(|known| name.eq_ignore_ascii_case(known))
}

/// The letters at the start of a name, after digits.
pub(super) fn letters(name: &[u8]) -> &[u8] {
    let start = name.iter().position(|b| !b.is_ascii_digit());
    let rest = name.get(start.unwrap_or(name.len())..).unwrap_or_default();
    let end = rest.iter().position(|b| !b.is_ascii_alphabetic());
    rest.get(..end.unwrap_or(rest.len())).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_follow_from_names() {
        for (name, residue, number) in [
            ("OW", "SOL", 8),
            ("HW1", "SOL", 1),
            ("1HB2", "ALA", 1),
            ("CA", "ALA", 6),
            ("CA", "CA", 20),
            ("CA", "CA2", 20),
            ("NA", "NA+", 11),
            ("CL", "CL-", 17),
            ("SOD", "SOD", 11),
            ("CLA", "CLA", 17),
            ("FE", "HEM", 26),
            ("SG", "CYS", 16),
        ] {
            assert_eq!(element(b"", name.as_bytes(), residue.as_bytes()), number, "{name}");
        }
        for (name, number) in [
            ("Na", 11),
            ("NA+", 11),
            ("CA", 6),
            ("Cl-", 17),
            ("Ca2+", 20),
            ("OW", 8),
            ("N3", 7),
            ("Hw", 1),
        ] {
            assert_eq!(element_without_residue(name.as_bytes()), number, "{name}");
        }
        assert_eq!(element(b"ZN", b"C1", b"X"), 30);
        assert_eq!(element(b"O1-", b"C1", b"X"), 8);
        for name in ["MW", "M", "EP1", "EPW", "LP2", "DUM", "mw4"] {
            assert_eq!(element(b"", name.as_bytes(), b"SOL"), 0, "{name}");
        }
        for (symbol, number) in [("D", 1), ("T", 1), ("X", 0), ("LP", 0), ("MG", 12), ("M", 0)] {
            assert_eq!(element(symbol.as_bytes(), b"CA", b"ALA"), number, "{symbol}");
        }
        assert!(element(b"", b"T3", b"") >= 1000);
        assert!(element(b"", b"7", b"") >= 1000);
        assert!(element(b"", b"", b"") >= 1000);
    }

    #[test]
    fn residues_may_have_codes_of_insertions() {
        for (field, number) in
            [("52A", 52), ("52", 52), ("-5B", -5), ("A", 0), ("", 0), ("1H2", 1), ("5-6", 5)]
        {
            assert_eq!(residue(field.as_bytes()), number, "{field}");
        }
    }

    #[test]
    fn fields_end_with_the_line() {
        assert_eq!(field(b"  ab cd", 0, 4), b"ab");
        assert_eq!(field(b"ab", 1, 9), b"b");
        assert_eq!(field(b"ab", 3, 9), b"");
    }
}
