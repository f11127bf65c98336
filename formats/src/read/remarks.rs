//! Wording of the remarks that several readers make, see [`crate::reader::Reader::remarks`].

/// The remark that a file has a cell; `periodic` are the flags of its boundaries.
pub(super) fn cell_remark(periodic: Option<&str>) -> String {
    let boundaries = periodic.map_or_else(String::new, |flags| {
        format!(" with periodic boundaries ({flags})")
    });
    format!(
        "the file has a simulation cell{boundaries}; --cell draws it. Particles are drawn where the file has them"
    )
}

/// The remark that the cell of a file is not read; `periodic` are the flags of its boundaries.
pub(super) fn unused_cell(periodic: Option<&str>) -> String {
    let boundaries = periodic.map_or_else(String::new, |flags| {
        format!(" and its periodic boundaries ({flags})")
    });
    format!(
        "the cell of the simulation{boundaries} is not used: particles are drawn where the file has them"
    )
}
