//! LAMMPS data files (`read_data`, `write_data`): the atoms of one state with their bonds.
//!
//! Text. A title, a header with counts and the box, then sections in nearly any order. Read are `Atoms`, `Velocities`,
//! `Ellipsoids`, `Bonds`, `Masses` and `Atom Type Labels`. Atoms are sorted by their ids, in which order trajectories without ids have
//! them. After the pages `read_data` and `write_data` of the LAMMPS manual.

use crate::format::Format;
use crate::read::input::TextInput;
use crate::read::notes::cell_note;
use crate::read::sniff::is_text;
use crate::read::table::{CUT_SHORT, ColumnValues};
use crate::read::text::{self, Lines};
use crate::read::{ByteSource, Step};
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use std::collections::BTreeMap;

use spherule_frame::{
    Attribute, AttributeData, Bond, MemoryBudget, ParseError, Positions, RawParticles,
};

mod ellipsoids;
mod header;
mod rows;
mod style;
mod types;

use header::{DataHeader, code};
use rows::{Columns, IdOrder};
use style::AtomColumns;
use types::AtomTypes;

/// LAMMPS data files.
pub const FORMAT: Format = Format::new(&LammpsData);

struct LammpsData;

impl Reader for LammpsData {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            notes_need_whole_file: true,
            ..FormatInfo::new("lammps-data", &["data", "lmp"])
        }
    }

    /// A title, counts as `12 atoms`, and the box as `0 1 xlo xhi` or counts of types.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        if !is_text(head) {
            return Ok(Confidence::No);
        }
        let is_signed = head.starts_with(b"LAMMPS data file");
        let (mut has_atoms, mut has_others) = (false, false);
        for line in Lines::new(head, 0..head.len()).skip(1) {
            let words: Vec<&[u8]> = text::words(code(line.text)).take(5).collect();
            let is_count = |word: &[u8]| text::integer(word).is_some_and(|count| count >= 0);
            match *words.as_slice() {
                [count, b"atoms"] => has_atoms |= is_count(count),
                [count, b"atom", b"types"] => has_others |= is_count(count),
                [_, _, b"xlo", b"xhi"] => has_others = true,
                _ => {}
            }
        }
        let is_sure = (has_atoms && has_others) || (is_signed && (has_atoms || has_others));
        let may_be = is_signed || has_atoms || has_others;
        Ok(if is_sure {
            Confidence::Signature
        } else if may_be {
            Confidence::IfNamed
        } else {
            Confidence::No
        })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Rows)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        Ok(vec![Step::whole(source.text().left_about())])
    }

    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        DataFile::read(source.text(), budget)?.into_particles(budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let mut text = TextInput::whole(head);
        let header = DataHeader::parse(&mut text).unwrap_or_default();
        let mut notes: Vec<String> = header.cell().map(|_| cell_note(None)).into_iter().collect();
        if has_image_flags(&mut text, &header) {
            notes.push(IMAGE_FLAGS.to_owned());
        }
        notes
    }
}

const IMAGE_FLAGS: &str = "image flags of atoms are not used; positions are those in the box (--unwrap makes molecules whole by their bonds)";

/// Whether there are image flags behind the columns of the first atom.
fn has_image_flags(text: &mut TextInput<'_>, header: &DataHeader) -> bool {
    while let Some(section) = next_section(text) {
        text.pass_blank_lines(usize::MAX);
        if section.name == "Atoms" {
            let first = text.peek_line();
            let columns = first.map(|line| AtomColumns::find(header, &section.comment, line));
            return columns.is_some_and(|columns| columns.is_ok_and(|columns| columns.has_images));
        }
    }
    false
}

/// The heading of a section.
struct Section {
    name: &'static str,
    at: usize,
    comment: Vec<u8>,
}

/// The sections that are read.
const SECTIONS: [&str; 6] =
    ["Atoms", "Velocities", "Ellipsoids", "Bonds", "Masses", "Atom Type Labels"];

/// What has been read of a file.
#[derive(Default)]
struct DataFile {
    header: DataHeader,
    types: AtomTypes,
    atoms: Option<Atoms>,
    velocities: Option<Vec<f64>>,
    ellipsoids: Vec<Attribute>,
    bonds: Vec<Bond>,
}

/// The section `Atoms`, sorted by ids.
struct Atoms {
    order: IdOrder,
    columns: AtomColumns,
    positions: Positions,
    attributes: Vec<Attribute>,
}

impl DataFile {
    fn read(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Self, ParseError> {
        let mut file = Self { header: DataHeader::parse(text)?, ..Self::default() };
        while let Some(section) = next_section(text) {
            let left = budget.less(file.held_len());
            text.pass_blank_lines(usize::MAX);
            match section.name {
                "Masses" => file.types.read_masses(text, &file.header, left)?,
                "Atom Type Labels" => file.types.read_labels(text, &file.header, left)?,
                "Atoms" if file.header.atoms == 0 => {}
                "Atoms" => file.atoms = Some(file.read_atoms(text, &section, left)?),
                "Velocities" => file.velocities = Some(file.read_velocities(text, &section, left)?),
                "Ellipsoids" => {
                    let order = file.order(&section)?;
                    let count = file.header.ellipsoids;
                    file.ellipsoids = ellipsoids::read(text, &section, (count, order), left)?;
                }
                _ => {
                    let order = file.order(&section)?;
                    file.bonds = order.bonds(text, &section, file.header.bonds, left)?;
                }
            }
            check_end(text, &section)?;
        }
        if file.atoms.is_none() && file.header.atoms > 0 {
            let what = format!("no section Atoms, the header has {} atoms", file.header.atoms);
            return Err(cut_short(text, &what));
        }
        Ok(file)
    }

    /// Bytes of the numbers so far.
    fn held_len(&self) -> u64 {
        let atoms = self.atoms.as_ref().map_or(0, |atoms| {
            let attributes: u64 = atoms.attributes.iter().map(|a| a.data.byte_len()).sum();
            12 * atoms.order.ids.len() as u64 + atoms.positions.byte_len() + attributes
        });
        let ellipsoids: u64 = self.ellipsoids.iter().map(|a| a.data.byte_len()).sum();
        let velocities = self.velocities.as_ref().map_or(0, Vec::len);
        atoms + ellipsoids + 8 * velocities as u64 + size_of_val(self.bonds.as_slice()) as u64
    }

    /// The order of the atoms for a `section` that refers to them.
    fn order(&self, section: &Section) -> Result<&IdOrder, ParseError> {
        let atoms = self.atoms.as_ref();
        atoms.map(|atoms| &atoms.order).ok_or_else(|| {
            ParseError::malformed(
                section.at,
                format!("section {} stands before section Atoms", section.name),
            )
        })
    }

    fn read_atoms(
        &self,
        text: &mut TextInput<'_>,
        section: &Section,
        budget: MemoryBudget,
    ) -> Result<Atoms, ParseError> {
        let count = self.header.atoms;
        let Some(first) = text.peek_line() else {
            return Err(cut_short(text, &format!("section Atoms has none of {count} lines")));
        };
        let columns = AtomColumns::find(&self.header, &section.comment, first)?;
        // Types may be labels or numbers
        let has_labels =
            self.types.have_labels() && text::integer(columns.type_of(first.text)).is_none();
        let (fields, targets) = columns.targets(has_labels);
        let names: Vec<String> = targets.iter().map(|target| target.name.clone()).collect();
        let values = rows::read(text, section, count, Columns { fields, targets }, budget)?;
        let mut values = values.into_iter();
        let ids = values.next().unwrap_or(ColumnValues::Whole(Vec::new()));
        let positions = values.next().unwrap_or(ColumnValues::Real(Vec::new()));
        let order = IdOrder::new(ids, section, budget)?;
        let positions = order.apply(positions, 3).into_positions();
        let mut attributes = Vec::new();
        for (name, values) in names.into_iter().skip(2).zip(values) {
            let mut values = order.apply(values, 1);
            if name == "type" {
                self.check_types(&mut values, has_labels, section)?;
            }
            let data = values.into_data();
            attributes.extend(data.map(|data| Attribute { name, components: 1, data }));
        }
        Ok(Atoms { order, columns, positions, attributes })
    }

    /// Checks the types of atoms, and puts numbers for their labels.
    fn check_types(
        &self,
        values: &mut ColumnValues,
        has_labels: bool,
        section: &Section,
    ) -> Result<(), ParseError> {
        let ColumnValues::Whole(numbers) = values else {
            let what = "an atom type is not an integer: write the style behind the heading, as `Atoms # charge`";
            return Err(ParseError::malformed(section.at, what));
        };
        for number in numbers {
            if has_labels {
                *number = self.types.by_code(*number).unwrap_or_default();
            }
            if !self.header.is_type(*number) {
                let what = format!(
                    "an atom has the type {number}, which the header does not count; if the style is another one, write \
                     it behind the heading, as `Atoms # charge`"
                );
                return Err(ParseError::malformed(section.at, what));
            }
        }
        Ok(())
    }

    fn read_velocities(
        &self,
        text: &mut TextInput<'_>,
        section: &Section,
        budget: MemoryBudget,
    ) -> Result<Vec<f64>, ParseError> {
        let atoms = self.order(section)?;
        let mut values =
            rows::read(text, section, self.header.atoms, Columns::velocities(), budget)?
                .into_iter();
        let ids = values.next().unwrap_or(ColumnValues::Whole(Vec::new()));
        let order = IdOrder::new(ids, section, budget)?;
        if let Some((id, atom)) = order.ids.iter().zip(&atoms.ids).find(|(id, atom)| id != atom) {
            let what = if id < atom {
                format!("section Velocities has the atom {id}, which section Atoms lacks")
            } else {
                format!("section Velocities lacks the atom {atom} of section Atoms")
            };
            return Err(ParseError::malformed(section.at, what));
        }
        match values.next().map(|values| order.apply(values, 3)) {
            Some(ColumnValues::Real(velocities)) => Ok(velocities),
            _ => Ok(Vec::new()),
        }
    }

    fn into_particles(self, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
        let cell = self.header.cell();
        let Some(atoms) = self.atoms else {
            return Ok(RawParticles { cell, ..RawParticles::default() });
        };
        let Atoms { order, columns, positions, mut attributes } = atoms;
        let count = order.ids.len();
        let held = positions.byte_len() + attributes.iter().map(|a| a.data.byte_len()).sum::<u64>();
        budget.less(held).check(20 * count as u64, "its numbers in memory are")?;
        // Add what follows from the types
        let types = attributes.iter().find_map(|attribute| match &attribute.data {
            AttributeData::I64(types) if attribute.name == "type" => Some(types),
            _ => None,
        });
        let elements = self.types.elements(self.header.units.as_deref());
        let elements = types.zip(elements).and_then(|(types, elements)| of_types(types, &elements));
        let masses = types.and_then(|types| of_types(types, &self.types.masses));
        let scalar = |name: &str, data| Attribute { name: name.to_owned(), components: 1, data };
        let derived = [
            elements.map(|elements| scalar("element", AttributeData::I32(elements))),
            masses.map(|masses| scalar("mass", AttributeData::F64(masses))),
        ];
        attributes.insert(0, scalar("id", AttributeData::I64(order.ids)));
        attributes.extend(derived.into_iter().flatten());
        let velocity = self.velocities.map(|v| Attribute {
            name: "velocity".to_owned(),
            components: 3,
            data: AttributeData::F64(v),
        });
        attributes.extend(velocity);
        attributes.extend(self.ellipsoids);
        let labels = Some(self.types.names).filter(|names| !names.is_empty());
        Ok(RawParticles {
            positions,
            attributes,
            cell,
            bonds: self.bonds,
            notes: columns.notes(),
            labels: labels.map(|names| ("type".to_owned(), names)).into_iter().collect(),
            ..RawParticles::default()
        })
    }
}

/// The values of all `types`; None if one has no value.
fn of_types<T: Copy>(types: &[i64], values: &BTreeMap<i64, T>) -> Option<Vec<T>> {
    types.iter().map(|number| values.get(number).copied()).collect()
}

/// Goes to the lines of the next section that is read.
fn next_section(text: &mut TextInput<'_>) -> Option<Section> {
    while let Some(line) = text.line() {
        let code = code(line.text);
        if let Some(name) = SECTIONS.into_iter().find(|name| name.as_bytes() == code) {
            let comment = line.text.splitn(2, |byte| *byte == b'#').nth(1);
            let comment = comment.unwrap_or_default().to_vec();
            return Some(Section { name, at: line.at, comment });
        }
    }
    None
}

/// Behind the lines of a section there is another heading, or nothing.
fn check_end(text: &mut TextInput<'_>, section: &Section) -> Result<(), ParseError> {
    text.pass_blank_lines(usize::MAX);
    match text.peek_line() {
        Some(line) if line.text.trim_ascii_start().first().is_some_and(u8::is_ascii_digit) => {
            let what = format!("section {} has more lines than the header says", section.name);
            Err(ParseError::malformed(line.at, what))
        }
        _ => Ok(()),
    }
}

fn cut_short(text: &TextInput<'_>, what: &str) -> ParseError {
    ParseError::malformed(text.at(), format!("{what}: {CUT_SHORT}"))
}

#[cfg(test)]
mod tests;
