//! What the head of a file says that is not in its particles: cells and periodic boundaries, which are not used, and
//! the names behind the numbers of an attribute.

use super::{lammps, xyz};
use crate::detect::Format;

/// What a user should know of a file of `format` that begins with `head`. Looks at the first step, as far as it is
/// there.
pub(crate) fn remarks(format: Format, head: &[u8]) -> Vec<String> {
    match format {
        Format::Lammps => lammps::remarks(head),
        Format::Xyz => xyz::remarks(head),
        _ => Vec::new(),
    }
}

/// That the cell of a file is not used; `periodic` is what the file says of its boundaries.
pub(super) fn unused_cell(periodic: Option<&str>) -> String {
    let boundaries = periodic.map_or_else(String::new, |flags| {
        format!(" and its periodic boundaries ({flags})")
    });
    format!(
        "the cell of the simulation{boundaries} is not used: particles are drawn where the file has them"
    )
}
