//! Parts of a time step become one set of particles, by one rule wherever the parts come from: files, pieces of a file,
//! blocks, prims or groups.
//!
//! Columns of one name are one column, in the smallest type that holds the numbers of all parts. Where a part lacks a
//! column, its particles have NaN there, and integers become floating point. [`plan`] says which columns there are and
//! what is reported; [`join`] also copies the numbers.

mod columns;
mod notes;
mod plan;

pub use columns::{ColumnShape, PartColumns};
pub use plan::{JoinPlan, JoinedColumn, plan};

use std::collections::BTreeMap;

use spherule_files::one_line;

use crate::bonds::Bond;
use crate::{Attribute, AttributeData, MemoryBudget, ParseError, Positions, RawParticles};

/// The column that tells parts apart by their numbers.
pub const PART: &str = "part";

/// Most notes of joined particles.
const MAX_NOTES: usize = 100;

/// One of the parts of a time step.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Value of the column [`PART`].
    pub number: u32,
    /// Name in messages, and in conditions.
    pub name: String,
    /// Its particles.
    pub particles: RawParticles,
}

/// Puts `parts` after one another. Notes of the result say what not all of them have.
///
/// # Errors
/// [`ParseError::TooLarge`] if the joined columns do not fit into `budget`.
pub fn join(mut parts: Vec<Part>, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    // Leave out columns whose numbers belong to nothing
    let mut notes = Vec::new();
    for part in &mut parts {
        remove_ragged(part, &mut notes);
    }
    // Find out which columns there are
    let layouts: Vec<PartColumns<'_>> = parts.iter().map(PartColumns::of).collect();
    let count = layouts.iter().map(|part| part.count).fold(0, u64::saturating_add);
    let JoinPlan { columns, notes: of_plan } = plan(&layouts);
    notes.extend(of_plan);
    // Check that they fit into memory
    let width = |column: &JoinedColumn| (column.components * column.scalar.size()) as u64;
    let need = columns.iter().map(width).fold(0, u64::saturating_add).saturating_mul(count);
    budget.check(need, "the joined columns of its parts are")?;
    // Copy the numbers, column by column: those of the parts are freed on the way
    let counts: Vec<usize> = parts.iter().map(|part| part.particles.positions.len()).collect();
    let attributes =
        columns.into_iter().map(|column| filled(column, &mut parts, &counts)).collect();
    let mut joined = RawParticles { attributes, notes, ..RawParticles::default() };
    // Append everything else; of times, cells and shapes, the first one counts
    joined.bonds = joined_bonds(&parts);
    let mut positions = Vec::with_capacity(parts.len());
    for Part { particles, .. } in parts {
        joined.time = joined.time.or(particles.time);
        joined.step = joined.step.or(particles.step);
        joined.cell = joined.cell.or(particles.cell);
        joined.shapes = joined.shapes.take().or(particles.shapes);
        for (column, labels) in particles.labels {
            joined.labels.entry(column).or_default().extend(labels);
        }
        for note in particles.notes {
            if !joined.notes.contains(&note) && joined.notes.len() < MAX_NOTES {
                joined.notes.push(note);
            }
        }
        positions.push(particles.positions);
    }
    joined.positions = Positions::joined(positions);
    Ok(joined)
}

/// [`join`], with the numbers of the parts as a column [`PART`] in place of columns of this name.
///
/// # Errors
/// As [`join`].
pub fn join_numbered(
    mut parts: Vec<Part>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let mut numbers = Vec::new();
    let labels = part_labels(&parts);
    for Part { number, particles, .. } in &mut parts {
        particles.attributes.retain(|attribute| attribute.name != PART);
        particles.labels.remove(PART);
        numbers.resize(numbers.len() + particles.positions.len(), *number);
    }
    let mut joined = join(parts, budget)?;
    joined.attributes.push(Attribute {
        name: PART.to_owned(),
        components: 1,
        data: AttributeData::U32(numbers),
    });
    joined.labels.insert(PART.to_owned(), labels);
    Ok(joined)
}

/// The names of parts by their numbers; none of those that are divided among several of `parts`.
fn part_labels(parts: &[Part]) -> BTreeMap<i64, String> {
    let mut labels = BTreeMap::new();
    for part in parts {
        let label = labels.entry(i64::from(part.number)).or_insert(Some(&part.name));
        *label = label.filter(|name| **name == part.name);
    }
    labels.into_iter().filter_map(|(number, name)| Some((number, name?.clone()))).collect()
}

impl<'a> PartColumns<'a> {
    fn of(part: &'a Part) -> Self {
        let columns = part.particles.attributes.iter().map(|attribute| ColumnShape {
            name: &attribute.name,
            components: attribute.components,
            scalar: attribute.data.scalar_type(),
        });
        let count = part.particles.positions.len() as u64;
        Self { name: &part.name, count, columns: columns.collect() }
    }
}

/// Removes columns of `part` that have more or fewer numbers than its particles.
fn remove_ragged(part: &mut Part, notes: &mut Vec<String>) {
    let Part { name, particles, .. } = part;
    let count = particles.positions.len();
    particles.attributes.retain(|attribute| {
        let (len, need) = (attribute.data.len(), attribute.components.saturating_mul(count));
        if len != need && notes.len() < MAX_NOTES {
            notes.push(one_line(format!(
                "`{}` of part `{name}` has {len} numbers, and {count} particles need {need}: left out",
                attribute.name
            )));
        }
        len == need
    });
}

/// The numbers of `column`, taken from `parts` with these `counts` of particles.
fn filled(column: JoinedColumn, parts: &mut [Part], counts: &[usize]) -> Attribute {
    let JoinedColumn { name, components, scalar, cells } = column;
    let mut data = AttributeData::zeros(scalar, 0);
    if counts.len() > 1 {
        data.reserve(components * counts.iter().sum::<usize>());
    }
    let mut cells = cells.into_iter().peekable();
    for (index, (part, count)) in parts.iter_mut().zip(counts).enumerate() {
        match cells.next_if(|(part, _)| *part == index) {
            Some((_, place)) => {
                let slot = &mut part.particles.attributes[place].data;
                let own = std::mem::replace(slot, AttributeData::U8(Vec::new()));
                data.append(own.into_type(scalar));
            }
            None => data.append_nan(components * count),
        }
    }
    Attribute { name, components, data }
}

/// The bonds of all parts, by the indices that their particles have behind one another.
fn joined_bonds(parts: &[Part]) -> Vec<Bond> {
    let mut bonds = Vec::new();
    let mut first = 0_usize;
    for Part { particles, .. } in parts {
        let start = u32::try_from(first).unwrap_or(u32::MAX);
        let moved = particles.bonds.iter().map(|bond| bond.map(|i| i.saturating_add(start)));
        bonds.extend(moved);
        first += particles.positions.len();
    }
    bonds
}

#[cfg(test)]
mod tests;
