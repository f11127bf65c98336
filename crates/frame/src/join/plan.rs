//! Which columns joined parts have.

use std::collections::{BTreeMap, BTreeSet};

use super::columns::PartColumns;
use super::notes::{Omission, Omitted};
use crate::ScalarType;
use crate::names::{ID, is_one_of, is_radius_name};

/// A column of all parts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JoinedColumn {
    /// The name.
    pub name: String,
    /// Numbers per particle.
    pub components: usize,
    /// Type that holds the numbers of all parts, and NaN if a part lacks the column.
    pub scalar: ScalarType,
    /// Index of each part that has the column, ascending, and index of the column in it.
    pub cells: Vec<(usize, usize)>,
}

/// What becomes of the columns of parts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JoinPlan {
    /// The columns, in the order in which they first appear.
    pub columns: Vec<JoinedColumn>,
    /// Which parts lack columns, and which columns are left out.
    pub notes: Vec<String>,
}

/// What `parts` have after one another.
///
/// A part without particles lacks nothing, because writers drop the columns then. Two kinds of columns must be in all
/// parts, or are left out: radii, because a sphere needs one, and ids, because NaN would not tell particles apart.
/// Columns of one name but different numbers of components are left out as well.
pub fn plan(parts: &[PartColumns<'_>]) -> JoinPlan {
    let is_empty = parts.iter().all(|part| part.count == 0);
    let counts = |index: usize| is_empty || parts[index].count > 0;
    let filled = (0..parts.len()).filter(|index| counts(*index)).count();
    // Collect the columns of each name. They are looked up, never searched for: there may be very many
    let mut omissions = Omitted::new(parts);
    let mut names: Vec<&str> = Vec::new();
    let mut by_name: BTreeMap<&str, Vec<(usize, usize)>> = BTreeMap::new();
    for (index, part) in parts.iter().enumerate().filter(|(index, _)| counts(*index)) {
        let mut own = BTreeSet::new();
        for (place, column) in part.columns.iter().enumerate() {
            if !own.insert(column.name) {
                omissions.add(column.name, Omission::Repeated, &[(index, place)]);
                continue;
            }
            let cells = by_name.entry(column.name).or_insert_with(|| {
                names.push(column.name);
                Vec::new()
            });
            cells.push((index, place));
        }
    }
    // Choose types, and columns that are left out
    let mut columns = Vec::with_capacity(names.len());
    for name in names {
        let cells = by_name.remove(name).unwrap_or_default();
        let shapes = || cells.iter().map(|(part, place)| &parts[*part].columns[*place]);
        let Some(first) = shapes().next() else { continue };
        if shapes().any(|shape| shape.components != first.components) {
            omissions.add(name, Omission::Components, &cells);
            continue;
        }
        let mut scalar =
            shapes().map(|shape| shape.scalar).fold(first.scalar, ScalarType::common_with);
        if cells.len() < filled && !is_empty {
            if is_radius_name(name) || is_one_of(name, &ID) {
                omissions.add(name, Omission::Incomplete, &cells);
                continue;
            }
            omissions.add(name, Omission::Missing, &cells);
            scalar = scalar.common_with(ScalarType::F32);
        }
        columns.push(JoinedColumn {
            name: name.to_owned(),
            components: first.components,
            scalar,
            cells,
        });
    }
    JoinPlan { columns, notes: omissions.notes() }
}
