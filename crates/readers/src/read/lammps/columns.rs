//! What the columns named on the `ITEM: ATOMS` line are.

use super::bounds::Bounds;
use super::header::DumpHeader;
use crate::read::table::{NumberKind, TargetArray, TargetComponent, TextPolicy};
use crate::read::text;
use spherule_frame::ParseError;
use spherule_frame::names::{LAMMPS_CATEGORIES, LAMMPS_INTEGERS, LAMMPS_VECTORS};

/// Names of position columns, the preferred ones first, and whether they are fractions of the box.
/// Positions in the box come before unwrapped ones, which leave it.
const POSITIONS: [([&str; 3], bool); 4] = [
    (["x", "y", "z"], false),
    (["xu", "yu", "zu"], false),
    (["xs", "ys", "zs"], true),
    (["xsu", "ysu", "zsu"], true),
];

/// Targets of the columns of a step.
#[derive(Debug)]
pub(super) struct DumpColumns {
    /// The target of each column.
    pub(super) fields: Vec<Option<TargetComponent>>,
    /// The arrays to fill, positions first.
    pub(super) targets: Vec<TargetArray>,
    /// The box that the positions are fractions of, if they are.
    pub(super) scaled_by: Option<Bounds>,
}

impl DumpColumns {
    /// Chooses targets for the columns of `header`; columns without a number in `first_row` are left out.
    pub(super) fn find(header: &DumpHeader, first_row: Option<&[u8]>) -> Result<Self, ParseError> {
        let column = |name: &str| header.names.iter().position(|n| n == name.as_bytes());
        let (axes, scaled) = position_columns(column).ok_or_else(|| no_positions(header))?;
        let scaled_by = match (scaled, header.bounds) {
            (false, _) => None,
            (true, Some(bounds)) => Some(bounds),
            (true, None) => {
                let what = "scaled positions, but no ITEM: BOX BOUNDS before";
                return Err(ParseError::malformed(header.names_at, what));
            }
        };
        let mut plan = Self {
            fields: vec![None; header.names.len()],
            targets: vec![TargetArray::positions()],
            scaled_by,
        };
        for (component, column) in axes.into_iter().enumerate() {
            plan.assign(column, 0, component);
        }
        plan.add_attributes(header, column, first_row);
        Ok(plan)
    }

    fn assign(&mut self, column: Option<usize>, target: usize, component: usize) {
        if let Some(field) = column.and_then(|column| self.fields.get_mut(column)) {
            *field = Some(TargetComponent { target, component });
        }
    }

    fn add_attributes(
        &mut self,
        header: &DumpHeader,
        column: impl Fn(&str) -> Option<usize>,
        first_row: Option<&[u8]>,
    ) {
        let first_row: Vec<&[u8]> = first_row.map(text::words).into_iter().flatten().collect();
        let is_text = |index: usize| {
            let cell = first_row.get(index);
            cell.is_some_and(|cell| text::number(cell).is_none())
        };
        // Found once: a header may repeat a name as often as it has room for.
        let vectors = LAMMPS_VECTORS.map(|(names, vector)| (names, vector, names.map(&column)));
        for (index, name) in header.names.iter().enumerate() {
            let name = String::from_utf8_lossy(name);
            let taken = self.fields.get(index).is_some_and(Option::is_some);
            let target = self.targets.len();
            if !taken && LAMMPS_CATEGORIES.contains(&&*name) {
                self.targets.push(TargetArray::category(name));
                self.assign(Some(index), target, 0);
                continue;
            }
            if taken || is_text(index) {
                continue;
            }
            let vector = vectors.iter().find(|(names, ..)| names.contains(&&*name));
            if let Some((_, vector, [Some(x), Some(y), Some(z)])) = vector.copied()
                && [x, y, z].contains(&index)
                && ![x, y, z].into_iter().any(is_text)
            {
                self.targets.push(real(vector, 3));
                for (component, column) in [x, y, z].into_iter().enumerate() {
                    self.assign(Some(column), target, component);
                }
                continue;
            }
            self.targets.push(if LAMMPS_INTEGERS.contains(&&*name) {
                TargetArray::attribute(name, 1, NumberKind::WholeIfAll, TextPolicy::Fault)
            } else {
                real(&name, 1)
            });
            self.assign(Some(index), target, 0);
        }
    }
}

fn real(name: &str, components: usize) -> TargetArray {
    TargetArray::attribute(name, components, NumberKind::Real, TextPolicy::Fault)
}

/// The columns of x, y and z, and whether they are scaled. A 2D run may do without z.
fn position_columns(column: impl Fn(&str) -> Option<usize>) -> Option<([Option<usize>; 3], bool)> {
    let found = POSITIONS.map(|(names, scaled)| (names.map(&column), scaled));
    let solid = found.iter().find(|(axes, _)| axes.iter().all(Option::is_some));
    let flat =
        found.iter().find(|(axes, scaled)| !scaled && axes[0].is_some() && axes[1].is_some());
    solid.or(flat).copied()
}

fn no_positions(header: &DumpHeader) -> ParseError {
    let names: Vec<_> = header.names.iter().take(8).map(|n| text::shown(n)).collect();
    let what = format!(
        "no positions among the columns {}: dump x y z, xu yu zu, xs ys zs or xsu ysu zsu",
        names.join(", ")
    );
    ParseError::malformed(header.names_at, what)
}
