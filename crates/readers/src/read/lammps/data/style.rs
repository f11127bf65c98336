//! The columns of the section `Atoms`, which depend on the atom style.
//!
//! Files name the style behind the heading, as `Atoms # full`, or not. After the page `read_data` of the LAMMPS manual.

use super::header::{DataHeader, code};
use crate::read::table::{NumberKind, TargetArray, TargetComponent, TextPolicy};
use crate::read::text::{self, Line};
use spherule_frame::ParseError;
use spherule_frame::names::LAMMPS_INTEGERS;

/// Atom styles with their columns, which have the names of dumps. `-` is a column that is not read.
const STYLES: [(&str, &str); 27] = [
    ("angle", "id mol type x y z"),
    ("atomic", "id type x y z"),
    ("body", "id type - mass x y z"),
    ("bond", "id mol type x y z"),
    ("bpm/sphere", "id mol type diameter density x y z"),
    ("charge", "id type q x y z"),
    ("dielectric", "id type q x y z mux muy muz area ed em epsilon curvature"),
    ("dipole", "id type q x y z mux muy muz"),
    ("dpd", "id type theta x y z"),
    ("edpd", "id type edpd_temp edpd_cv x y z"),
    ("electron", "id type q espin eradius x y z"),
    ("ellipsoid", "id type - density x y z"),
    ("full", "id mol type q x y z"),
    ("hybrid", "id type x y z"),
    ("line", "id mol type - density x y z"),
    ("mdpd", "id type rho x y z"),
    ("molecular", "id mol type x y z"),
    ("peri", "id type volume density x y z"),
    ("rheo", "id type status rho x y z"),
    ("rheo/thermal", "id type status rho energy x y z"),
    ("smd", "id type mol volume mass kradius cradius - - - x y z"),
    ("sph", "id type rho esph cv x y z"),
    ("sphere", "id type diameter density x y z"),
    ("spin", "id type x y z spx spy spz sp"),
    ("tdpd", "id type x y z"),
    ("template", "id type mol - - x y z"),
    ("tri", "id mol type - density x y z"),
];

/// Largest number of words of a line of an atom that are looked at.
const MAX_WORDS: usize = 40;

/// The columns of the atoms.
#[derive(Debug)]
pub(super) struct AtomColumns {
    /// The atom style.
    pub(super) style: &'static str,
    /// Whether the file names the style.
    pub(super) is_named: bool,
    /// Whether the lines of the atoms end with image flags.
    pub(super) has_images: bool,
    names: Vec<&'static str>,
}

impl AtomColumns {
    /// The columns of atoms whose heading has `comment` behind it, and whose first line is `first`.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] if the number of columns does not tell the style.
    pub(super) fn find(
        header: &DataHeader,
        comment: &[u8],
        first: Line<'_>,
    ) -> Result<Self, ParseError> {
        let words: Vec<&[u8]> = text::words(code(first.text)).take(MAX_WORDS).collect();
        let named =
            text::words(comment).next().and_then(|word| by_name(&String::from_utf8_lossy(word)));
        let Some((style, names)) = named.or_else(|| guess(&words, header)) else {
            let what = format!(
                "the atom style does not follow from the {} columns of {}: write it behind the heading, as `Atoms # full`",
                words.len(),
                text::shown(first.text)
            );
            return Err(ParseError::malformed(first.at, what));
        };
        let names: Vec<&str> = names.split(' ').collect();
        let rest = words.get(names.len()..).unwrap_or_default();
        // Styles with columns of their own at the end have the flags behind these
        let has_images = ends_with_integers(&words) && rest.len() >= 3;
        Ok(Self { style, is_named: named.is_some(), has_images, names })
    }

    /// The targets of the columns: ids, positions, then attributes.
    pub(super) fn targets(
        &self,
        has_type_labels: bool,
    ) -> (Vec<Option<TargetComponent>>, Vec<TargetArray>) {
        let whole =
            |name: &str| TargetArray::attribute(name, 1, NumberKind::WholeIfAll, TextPolicy::Fault);
        let mut targets = vec![whole("id"), TargetArray::positions()];
        let fields = self.names.iter().map(|name| {
            let (target, component) = match *name {
                "-" => return None,
                "id" => (0, 0),
                "x" => (1, 0),
                "y" => (1, 1),
                "z" => (1, 2),
                name => {
                    targets.push(match name {
                        "type" if has_type_labels => TargetArray::category(name),
                        name if LAMMPS_INTEGERS.contains(&name) => whole(name),
                        name => {
                            TargetArray::attribute(name, 1, NumberKind::Real, TextPolicy::Fault)
                        }
                    });
                    (targets.len() - 1, 0)
                }
            };
            Some(TargetComponent { target, component })
        });
        let fields = fields.collect();
        (fields, targets)
    }

    /// What users should know of the columns.
    pub(super) fn notes(&self) -> Vec<String> {
        let guessed = || {
            format!(
                "the file does not name its atom style, which is `{}` by the number of columns; another one can be named \
                 behind the heading, as `Atoms # full`",
                self.style
            )
        };
        let hybrid =
            || "of the atom style `hybrid`, columns behind the positions are not read".to_owned();
        let mut notes = Vec::new();
        notes.extend((!self.is_named).then(guessed));
        notes.extend((self.style == "hybrid").then(hybrid));
        notes
    }

    /// The word of the type in the line of an atom.
    pub(super) fn type_of<'t>(&self, line: &'t [u8]) -> &'t [u8] {
        let column = self.names.iter().position(|name| *name == "type");
        column.and_then(|column| text::words(line).nth(column)).unwrap_or_default()
    }
}

fn by_name(name: &str) -> Option<(&'static str, &'static str)> {
    STYLES.iter().find(|(style, _)| *style == name).copied()
}

/// Whether image flags are at the end: three integers. No style has integers in its last columns.
fn ends_with_integers(words: &[&[u8]]) -> bool {
    words.len() >= 8 && words.iter().rev().take(3).all(|word| text::integer(word).is_some())
}

/// The style that the number of columns, the objects in the header and the third column tell.
fn guess(words: &[&[u8]], header: &DataHeader) -> Option<(&'static str, &'static str)> {
    let count = if ends_with_integers(words) { words.len() - 3 } else { words.len() };
    // A number of a type in the third column means a molecule in the second
    let third = words.get(2).and_then(|word| text::integer(word));
    let has_molecules = third.is_some_and(|third| header.is_type(third));
    let name = match (header.shape, count) {
        (Some(shape), 7 | 8) => shape,
        (_, 5) => "atomic",
        (_, 6) if has_molecules => "molecular",
        (_, 6) => "charge",
        (_, 7) if has_molecules => "full",
        (_, 7) => "sphere",
        (_, 8) if has_molecules => "bpm/sphere",
        (_, 9) => "dipole",
        _ => return None,
    };
    by_name(name)
}
