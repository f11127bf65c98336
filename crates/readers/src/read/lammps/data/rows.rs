//! Sections with a line for each atom or bond, joined by the ids of atoms.

use rayon::prelude::*;

use super::{Section, cut_short};
use crate::read::input::TextInput;
use crate::read::table::{
    ColumnValues, Comments, Decimal, Dialect, ExtraCells, NumberKind, Separator, Table,
    TargetArray, TargetComponent, TextPolicy, most_rows,
};
use spherule_frame::gather::gather;
use spherule_frame::{Bond, MemoryBudget, ParseError};

/// Image flags and comments may follow the columns.
const DIALECT: Dialect = Dialect {
    separator: Separator::Blanks,
    decimal: Decimal::Point,
    comments: Comments::None,
    surplus: ExtraCells::Ignored,
};

/// The columns of a section.
pub(super) struct Columns {
    pub(super) fields: Vec<Option<TargetComponent>>,
    pub(super) targets: Vec<TargetArray>,
}

impl Columns {
    /// Velocities: id and three components. Styles have others behind these.
    pub(super) fn velocities() -> Self {
        let vector = TargetArray::attribute("velocity", 3, NumberKind::Real, TextPolicy::Fault);
        let component = |component| Some(TargetComponent { target: 1, component });
        let id = Some(TargetComponent { target: 0, component: 0 });
        Self {
            fields: vec![id, component(0), component(1), component(2)],
            targets: vec![ids(1), vector],
        }
    }

    /// Bonds: number, type, and the ids of two atoms.
    fn bonds() -> Self {
        let atom = |component| Some(TargetComponent { target: 0, component });
        Self { fields: vec![None, None, atom(0), atom(1)], targets: vec![ids(2)] }
    }
}

pub(super) fn ids(components: usize) -> TargetArray {
    TargetArray::attribute("id", components, NumberKind::WholeIfAll, TextPolicy::Fault)
}

/// The values of the `count` lines of a section, column by column.
///
/// # Errors
/// [`ParseError`] if there are fewer lines, or one is damaged.
pub(super) fn read(
    text: &mut TextInput<'_>,
    section: &Section,
    count: usize,
    columns: Columns,
    budget: MemoryBudget,
) -> Result<Vec<ColumnValues>, ParseError> {
    let Columns { fields, targets } = columns;
    let rows = most_rows(text.left_about(), fields.len()).min(count);
    let components: Vec<usize> = targets.iter().map(|target| target.components).collect();
    let table = Table { dialect: DIALECT, fields, targets, rows, labels: None };
    let read = table.parse(text, count, budget);
    let values = read.content.map_err(|error| {
        error.map_message(|what| {
            format!("{what}; section {} has {count} lines by the header", section.name)
        })
    })?;
    let found = values.iter().zip(components).map(|(v, components)| v.len() / components).min();
    let found = found.unwrap_or_default();
    if found == count {
        return Ok(values);
    }
    if text.is_file_end() {
        return Err(cut_short(
            text,
            &format!("section {} has {found} of {count} lines", section.name),
        ));
    }
    let what =
        format!("section {} has {found} lines and not the {count} of the header", section.name);
    Err(ParseError::malformed(section.at, what))
}

/// The order of atoms by their ids.
#[derive(Debug)]
pub(super) struct IdOrder {
    /// Ids, rising.
    pub(super) ids: Vec<i64>,
    /// The line of each atom; none if the lines are in this order.
    lines: Option<Vec<u32>>,
}

impl IdOrder {
    /// The order of the lines of `section` with the `ids`.
    ///
    /// # Errors
    /// [`ParseError`] if ids are not integers, or not distinct.
    pub(super) fn new(
        ids: ColumnValues,
        section: &Section,
        budget: MemoryBudget,
    ) -> Result<Self, ParseError> {
        let ColumnValues::Whole(ids) = ids else {
            let what = format!("an id of an atom in section {} is not an integer", section.name);
            return Err(ParseError::malformed(section.at, what));
        };
        if ids.is_sorted_by(|a, b| a < b) {
            return Ok(Self { ids, lines: None });
        }
        // Lines and sorted ids, beside the ids and one column
        budget.check(24 * ids.len() as u64, "its numbers in memory are")?;
        let count =
            u32::try_from(ids.len()).map_err(|_| budget.exceeded("its numbers in memory are"))?;
        let mut lines: Vec<u32> = (0..count).collect();
        lines.par_sort_unstable_by_key(|line| ids.get(*line as usize));
        let sorted = gather(&ids, 1, &lines);
        match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => {
                let what = format!("section {} has the atom {} twice", section.name, pair[0]);
                Err(ParseError::malformed(section.at, what))
            }
            None => Ok(Self { ids: sorted, lines: Some(lines) }),
        }
    }

    /// A column of `components` numbers in the order of the ids.
    pub(super) fn apply(&self, values: ColumnValues, components: usize) -> ColumnValues {
        match (&self.lines, values) {
            (Some(lines), ColumnValues::Real(v)) => {
                ColumnValues::Real(gather(&v, components, lines))
            }
            (Some(lines), ColumnValues::Whole(v)) => {
                ColumnValues::Whole(gather(&v, components, lines))
            }
            (_, values) => values,
        }
    }

    /// The index of the atom with an id.
    pub(super) fn index(&self, id: i64) -> Option<u32> {
        let first = *self.ids.first()?;
        // Nearly all files have all ids from the first to the last
        let near = id.checked_sub(first).and_then(|index| usize::try_from(index).ok());
        let is_at = |index: &usize| self.ids.get(*index) == Some(&id);
        let index = near.filter(is_at).or_else(|| self.ids.binary_search(&id).ok());
        index.and_then(|index| u32::try_from(index).ok())
    }

    /// Reads the section `Bonds`.
    ///
    /// # Errors
    /// [`ParseError`] if it is damaged, or a bond has an atom that does not exist.
    pub(super) fn bonds(
        &self,
        text: &mut TextInput<'_>,
        section: &Section,
        count: usize,
        budget: MemoryBudget,
    ) -> Result<Vec<Bond>, ParseError> {
        let values = read(text, section, count, Columns::bonds(), budget)?.into_iter().next();
        let Some(ColumnValues::Whole(atoms)) = values else {
            return Err(ParseError::malformed(
                section.at,
                "an id of an atom in section Bonds is not an integer",
            ));
        };
        budget.check(24 * count as u64, "its bonds in memory are")?;
        let unknown = |id: i64| {
            ParseError::malformed(
                section.at,
                format!("a bond has the atom {id}, which section Atoms lacks"),
            )
        };
        let index = |id: i64| self.index(id).ok_or_else(|| unknown(id));
        let (pairs, _) = atoms.as_chunks::<2>();
        pairs.iter().map(|[a, b]| Ok([index(*a)?, index(*b)?])).collect()
    }
}
