//! Coarse-grained beads, by their names: those of the force field Martini (Marrink and others, "The MARTINI force field",
//! J. Phys. Chem. B, 2007; Souza and others, "Martini 3", Nature Methods, 2021).
//!
//! Their names begin with symbols of elements: without this list, water is tungsten and a backbone is boron.

use super::atoms::letters;
use spherule_frame::{Attribute, AttributeData};

/// Attribute for the kind of a bead.
const BEAD: &str = "bead";

/// Kinds of beads, by number.
const KINDS: [&str; 10] = [
    "other",
    "backbone",
    "side chain",
    "head group",
    "phosphate",
    "glycerol",
    "tail",
    "sterol",
    "water",
    "ion",
];

/// The kind of beads that have a number in the attribute `bead`, if there is one.
pub fn bead_name(number: i64) -> Option<&'static str> {
    KINDS.get(usize::try_from(number).ok()?).copied()
}

/// Beads whose names are those of no atom.
const NAMES: [(&[u8], usize); 30] = [
    (b"BB", 1),
    (b"BAS", 1),
    (b"BB1", 1),
    (b"BB2", 1),
    (b"BB3", 1),
    (b"SC1", 2),
    (b"SC2", 2),
    (b"SC3", 2),
    (b"SC4", 2),
    (b"SC5", 2),
    (b"SC6", 2),
    (b"NC3", 3),
    (b"NH3", 3),
    (b"CNO", 3),
    (b"GL0", 3),
    (b"COO", 3),
    (b"PO4", 4),
    (b"PO3", 4),
    (b"PO1", 4),
    (b"PO2", 4),
    (b"GL1", 5),
    (b"GL2", 5),
    (b"GL3", 5),
    (b"AM1", 5),
    (b"AM2", 5),
    (b"ROH", 7),
    (b"WF", 8),
    (b"WP", 8),
    (b"WM", 8),
    (b"PW", 8),
];

/// Residues of sterols, whose other beads are called R1 and C1.
const STEROLS: [&[u8]; 3] = [b"CHOL", b"CHL1", b"ERGO"];

/// Residues of water that is one bead.
const WATERS: [&[u8]; 4] = [b"W", b"WF", b"PW", b"SW"];

/// The beads of a file, atom by atom.
#[derive(Debug, Default)]
pub(super) struct Beads {
    kinds: Vec<u8>,
    /// Number of those that can be no atoms.
    sure: usize,
}

impl Beads {
    /// Adds a particle with the names of the bead and its residue.
    pub(super) fn push(&mut self, name: &[u8], residue: &[u8]) {
        let is_sterol = STEROLS.contains(&residue);
        let named = NAMES.iter().find(|(known, _)| *known == name).map(|(_, kind)| *kind);
        let is_water = name == b"W" && WATERS.contains(&residue);
        let is_tail = || matches!(name, [b'C' | b'D' | b'T', b'1'..=b'9', b'A'..=b'D']);
        let is_ion = || {
            let symbol = letters(name);
            [&b"NA"[..], b"CL", b"K", b"CA", b"ION"].contains(&symbol) && residue == b"ION"
        };
        self.sure += usize::from(named.is_some() || is_water);
        let kind = match named {
            _ if is_sterol => 7,
            Some(kind) => kind,
            None if is_water => 8,
            None if is_tail() => 6,
            None if is_ion() => 9,
            None => 0,
        };
        self.kinds.push(u8::try_from(kind).unwrap_or_default());
    }

    /// The attribute with the kinds, if the particles are beads: some have names that atoms do not have, and most are of a
    /// known kind.
    pub(super) fn attribute(self) -> Option<Attribute> {
        let known = self.kinds.iter().filter(|kind| **kind > 0).count();
        let are_beads = 10 * self.sure >= self.kinds.len() && 2 * known > self.kinds.len();
        let data = AttributeData::U8(self.kinds);
        are_beads.then(|| Attribute { name: BEAD.to_owned(), components: 1, data })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(names: &[(&str, &str)]) -> Option<Vec<&'static str>> {
        let mut beads = Beads::default();
        for (name, residue) in names {
            beads.push(name.as_bytes(), residue.as_bytes());
        }
        let AttributeData::U8(kinds) = beads.attribute()?.data else { return None };
        Some(kinds.into_iter().filter_map(|kind| bead_name(kind.into())).collect())
    }

    #[test]
    fn beads_have_kinds_and_atoms_have_none() {
        let lipid =
            [("NC3", "DPPC"), ("PO4", "DPPC"), ("GL1", "DPPC"), ("C1A", "DPPC"), ("R1", "CHOL")];
        let found = kinds(&lipid).expect("beads");
        assert_eq!(found, ["head group", "phosphate", "glycerol", "tail", "sterol"]);
        let protein = kinds(&[("BB", "ALA"), ("SC1", "LYS"), ("W", "W")]).expect("beads");
        assert_eq!(protein, ["backbone", "side chain", "water"]);
        // A haem, tungsten, and a protein
        assert_eq!(kinds(&[("C1A", "HEM"), ("C2A", "HEM"), ("NA", "HEM")]), None);
        assert_eq!(kinds(&[("W", "WO3"), ("O1", "WO3")]), None);
        assert_eq!(kinds(&[("N", "ALA"), ("CA", "ALA"), ("C", "ALA"), ("O", "ALA")]), None);
        assert_eq!(kinds(&[]), None);
        assert_eq!(bead_name(-1), None);
    }
}
