//! `[bonds]`: bonds between particles that are near each other.

use serde_json::{Value as Json, json};

use super::color::ColorSetting;
use super::field::Field;
use super::key::Key;
use super::keys::section;
use super::value::{Fault, FlagKind, Value, quoted};

section! {
    /// Bonds between particles, as cylinders
    Bonds {
        /// Which particles have a bond: those up to a distance apart, covalent, file, or none
        ///
        /// `covalent` are those up to the sum of their covalent radii and 0.4 angstroms apart, by the attribute
        /// `element`. `file` are the bonds that GSD, mol2, MDL, Tinker and LAMMPS data files list, or a PSF, AMBER or LAMMPS data file as
        /// input.topology. In a periodic cell, bonds go on at the other side.
        find: BondSearch = BondSearch::None, flag("bonds", "HOW", "Look");
        /// Radius, or auto: a third of the radius of the particles
        radius: Option<f32> = None, or("auto"), unit("a length"), above(0), single();
        /// Colour, linear RGB, { attribute = "charge", range = [-1, 1] }, or auto: halves have those of their particles
        ///
        /// The keys of a map are those of material.color, as for arrows.
        color: ColorSetting = ColorSetting::Auto, from(0);
    }
}

/// How bonds are found.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum BondSearch {
    /// There are none.
    #[default]
    None,
    /// Between atoms whose distance is that of a covalent bond.
    Covalent,
    /// Those that the file lists.
    File,
    /// Between particles up to this distance apart.
    Distance(f64),
}

const NONE: &str = "none";
const COVALENT: &str = "covalent";
const FILE: &str = "file";

impl Value for BondSearch {
    const FLAG: FlagKind = FlagKind::SwitchOrNumberOrText(COVALENT);

    fn kind(_: &Key) -> String {
        "a distance above 0, \"covalent\", \"file\" or \"none\"".to_owned()
    }

    fn words() -> Vec<&'static str> {
        vec![NONE, COVALENT, FILE]
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        match field.as_text() {
            Some(NONE) => Ok(Self::None),
            Some(COVALENT) => Ok(Self::Covalent),
            Some(FILE) => Ok(Self::File),
            Some(_) => Err(Fault::Unwanted),
            None => {
                let usable = |distance: &f64| *distance > 0.0 && *distance <= f64::from(f32::MAX);
                let distance = field.as_number().filter(usable);
                distance.map(Self::Distance).ok_or(Fault::Unwanted)
            }
        }
    }

    fn toml(&self) -> String {
        match self {
            Self::None => quoted(NONE),
            Self::Covalent => quoted(COVALENT),
            Self::File => quoted(FILE),
            Self::Distance(distance) => distance.toml(),
        }
    }

    fn schema(_: &Key) -> Json {
        json!({ "anyOf": [
            { "enum": Self::words() },
            { "type": "number", "exclusiveMinimum": 0 },
        ] })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Manifest;

    fn read(text: &str) -> Result<Bonds, String> {
        let text = format!("input.path = \"a\"\n{text}");
        let manifest = Manifest::parse(&text, Path::new("job.toml"));
        manifest.map(|m| m.bonds).map_err(|e| e.to_string())
    }

    #[test]
    fn bonds_are_found_by_distance_or_elements() {
        assert_eq!(read("").unwrap().find, BondSearch::None);
        for (text, expected) in [
            ("1.5", BondSearch::Distance(1.5)),
            ("2", BondSearch::Distance(2.0)),
            ("\"covalent\"", BondSearch::Covalent),
            ("\"file\"", BondSearch::File),
            ("\"none\"", BondSearch::None),
        ] {
            let found = read(&format!("bonds.find = {text}")).unwrap();
            assert_eq!(found.find, expected);
            assert_eq!(read(&format!("bonds.find = {}", found.find.toml())), Ok(found));
        }
        for text in ["0", "-1", "nan", "1e39", "\"metallic\"", "[1]"] {
            let error = read(&format!("bonds.find = {text}")).unwrap_err();
            assert!(error.contains("bonds.find: expected a distance above 0"), "{error}");
        }
    }
}
