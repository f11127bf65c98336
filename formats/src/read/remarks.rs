//! Wording of the remarks that several readers make, see [`crate::reader::Reader::remarks`].

/// The remark that the cell of a file is not used; `periodic` are the flags of its boundaries.
pub(super) fn unused_cell(periodic: Option<&str>) -> String {
    let boundaries = periodic.map_or_else(String::new, |flags| {
        format!(" and its periodic boundaries ({flags})")
    });
    format!(
        "the cell of the simulation{boundaries} is not used: particles are drawn where the file has them"
    )
}
