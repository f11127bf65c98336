//! What a data file says of its atom types: names, and masses, from which elements follow.

use std::collections::BTreeMap;

use super::header::{DataHeader, code};
use crate::read::category;
use crate::read::input::TextInput;
use crate::read::text::{self, Line};
use spherule_files::escape_controls;
use spherule_frame::{MemoryBudget, ParseError, masses};

/// Bytes of a type in memory, with its name.
const TYPE_LEN: usize = 256;

/// Longest name of a type, bytes.
const MAX_NAME: usize = 64;

/// Systems of units whose masses are those of atoms in g/mol.
const ATOMIC_UNITS: [&str; 3] = ["real", "metal", "electron"];

/// Atom types by number.
#[derive(Debug, Default)]
pub(super) struct AtomTypes {
    /// Names: type labels, or comments behind masses.
    pub(super) names: BTreeMap<i64, String>,
    /// Masses.
    pub(super) masses: BTreeMap<i64, f64>,
    /// Numbers of types by the [codes](category::code) of their labels.
    codes: BTreeMap<i64, i64>,
}

impl AtomTypes {
    /// Whether types have labels, which atoms may have instead of numbers.
    pub(super) fn have_labels(&self) -> bool {
        !self.codes.is_empty()
    }

    /// The number of the type with the code of a label.
    pub(super) fn by_code(&self, code: i64) -> Option<i64> {
        self.codes.get(&code).copied()
    }

    /// Reads the section `Atom Type Labels`.
    ///
    /// # Errors
    /// [`ParseError`] of a line that is not a number and a label.
    pub(super) fn read_labels(
        &mut self,
        text: &mut TextInput<'_>,
        header: &DataHeader,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        self.each_row(text, header, budget, "Atom Type Labels", |types, line, words| {
            let number = words.first().and_then(|word| text::integer(word));
            let (Some(number), Some(label)) = (number.filter(|n| header.is_type(*n)), words.get(1)) else {
                let what = format!("{} is not the number of an atom type and a label", text::shown(line.text));
                return Err(ParseError::malformed(line.at, what));
            };
            for word in [label, words[0]] {
                let other = types.codes.insert(category::code(word), number);
                if other.is_some_and(|other| other != number) {
                    let what = format!(
                        "the label {} is like that of another type; write types as numbers (`write_data a.data types numeric`)",
                        text::shown(label)
                    );
                    return Err(ParseError::unsupported(what));
                }
            }
            types.name(number, label);
            Ok(())
        })
    }

    /// Reads the section `Masses`, with names in comments unless types have labels.
    ///
    /// # Errors
    /// [`ParseError`] of a line that is not a type and a mass.
    pub(super) fn read_masses(
        &mut self,
        text: &mut TextInput<'_>,
        header: &DataHeader,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        self.each_row(text, header, budget, "Masses", |types, line, words| {
            let number = words.first().and_then(|word| {
                text::integer(word)
                    .filter(|n| header.is_type(*n))
                    .or_else(|| types.by_code(category::code(word)))
            });
            let mass = words.get(1).and_then(|word| text::number(word));
            let (Some(number), Some(mass)) = (number, mass) else {
                let what = format!(
                    "{} is not the number of an atom type and its mass",
                    text::shown(line.text)
                );
                return Err(ParseError::malformed(line.at, what));
            };
            types.masses.insert(number, mass);
            let comment = line.text.splitn(2, |byte| *byte == b'#').nth(1).unwrap_or_default();
            if let Some(name) = text::words(comment).next().filter(|_| !types.have_labels()) {
                types.name(number, name);
            }
            Ok(())
        })
    }

    /// Passes on the line of each type with its first words, before a comment.
    fn each_row(
        &mut self,
        text: &mut TextInput<'_>,
        header: &DataHeader,
        budget: MemoryBudget,
        section: &str,
        mut add: impl FnMut(&mut Self, Line<'_>, &[&[u8]]) -> Result<(), ParseError>,
    ) -> Result<(), ParseError> {
        let count = header.types.unwrap_or_default();
        let mut index = 0;
        while index < count {
            let Some(line) = text.line() else {
                return Err(super::cut_short(
                    text,
                    &format!("{section} has {index} of {count} lines"),
                ));
            };
            if line.is_blank() {
                continue;
            }
            budget.check((TYPE_LEN * (index + 1)) as u64, "its atom types in memory are")?;
            let words: Vec<&[u8]> = text::words(code(line.text)).take(2).collect();
            add(self, line, &words)?;
            index += 1;
        }
        Ok(())
    }

    fn name(&mut self, number: i64, name: &[u8]) {
        let name = String::from_utf8_lossy(name.get(..MAX_NAME).unwrap_or(name));
        self.names.insert(number, escape_controls(&name).into_owned());
    }

    /// The elements of all types, if the masses are those of elements in `units`: every one is that of an element. In
    /// files that do not name their units, masses that are all 1 are those of reduced units.
    pub(super) fn elements(&self, units: Option<&str>) -> Option<BTreeMap<i64, i32>> {
        let is_atomic = units.map_or_else(
            || self.masses.values().any(|mass| *mass != 1.0),
            |units| ATOMIC_UNITS.contains(&units),
        );
        let elements =
            self.masses.iter().map(|(number, mass)| Some((*number, masses::element(*mass)?)));
        elements.collect::<Option<_>>().filter(|_| is_atomic)
    }
}
