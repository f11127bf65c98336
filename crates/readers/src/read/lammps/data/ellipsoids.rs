//! The section `Ellipsoids`: diameters and quaternions of atoms, as columns with the names of dumps.

use super::Section;
use super::header::code;
use super::rows::{self, Columns, IdOrder};
use crate::read::input::TextInput;
use crate::read::table::{ColumnValues, NumberKind, TargetArray, TargetComponent, TextPolicy};
use crate::read::text;
use spherule_frame::{Attribute, AttributeData, MemoryBudget, ParseError};

/// The columns behind the id. The last two are those of superellipsoids, which not all files have.
const NAMES: [&str; 9] =
    ["shapex", "shapey", "shapez", "quatw", "quati", "quatj", "quatk", "block1", "block2"];

/// Number of columns without those of superellipsoids.
const OF_ELLIPSOIDS: usize = 7;

/// The id and `numbers` numbers.
fn columns(numbers: usize) -> Columns {
    let name = "ellipsoid";
    let of_atom = TargetArray::attribute(name, numbers, NumberKind::Real, TextPolicy::Fault);
    let component = |component| Some(TargetComponent { target: 1, component });
    let id = Some(TargetComponent { target: 0, component: 0 });
    Columns {
        fields: std::iter::once(id).chain((0..numbers).map(component)).collect(),
        targets: vec![rows::ids(1), of_atom],
    }
}

/// Reads the section with `count` lines. Atoms of `order` that are not in it have zeros, as in a dump.
///
/// # Errors
/// [`ParseError`] if the section is damaged, or has an atom twice or one that does not exist.
pub(super) fn read(
    text: &mut TextInput<'_>,
    section: &Section,
    (count, order): (usize, &IdOrder),
    budget: MemoryBudget,
) -> Result<Vec<Attribute>, ParseError> {
    // Read the lines, which all have as many columns as the first one
    let words = text.peek_line().map_or(0, |line| text::words(code(line.text)).count());
    let numbers = if words > NAMES.len() { NAMES.len() } else { OF_ELLIPSOIDS };
    let mut values = rows::read(text, section, count, columns(numbers), budget)?.into_iter();
    let ids = values.next().unwrap_or(ColumnValues::Whole(Vec::new()));
    let own = IdOrder::new(ids, section, budget)?;
    let Some(ColumnValues::Real(values)) = values.next().map(|values| own.apply(values, numbers))
    else {
        return Ok(Vec::new());
    };
    // Put them at the places of their atoms
    let atoms = order.ids.len();
    budget.check(
        8 * (atoms as u64 + own.ids.len() as u64) * numbers as u64,
        "its numbers in memory are",
    )?;
    let mut all = vec![vec![0.0; atoms]; numbers];
    for (id, row) in own.ids.iter().zip(values.chunks_exact(numbers)) {
        let index = order.index(*id).ok_or_else(|| {
            let what = format!("section Ellipsoids has the atom {id}, which section Atoms lacks");
            ParseError::malformed(section.at, what)
        })?;
        for (column, value) in all.iter_mut().zip(row) {
            column[index as usize] = *value;
        }
    }
    let named = NAMES.iter().zip(all);
    let attribute = |(name, data): (&&str, Vec<f64>)| Attribute {
        name: (*name).to_owned(),
        components: 1,
        data: AttributeData::F64(data),
    };
    Ok(named.map(attribute).collect())
}
