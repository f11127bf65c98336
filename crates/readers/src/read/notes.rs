//! Wording of the notes that several readers make, see [`crate::reader::Reader::notes`].

/// The note that a file has a cell; `periodic` are the flags of its boundaries.
pub fn cell_note(periodic: Option<&str>) -> String {
    let boundaries =
        periodic.map_or_else(String::new, |flags| format!(" with periodic boundaries ({flags})"));
    format!("the file has a simulation cell{boundaries}")
}

/// The units of a format, which are not converted.
pub(super) fn units(length: &str, velocity: Option<&str>, time: Option<&str>) -> String {
    let velocity = velocity.map_or_else(String::new, |unit| format!(", velocities in {unit}"));
    let time = time.map_or_else(String::new, |unit| format!(", times in {unit}"));
    format!("units of the format: lengths in {length}{velocity}{time}")
}

/// The note that a file has names of atoms but no elements.
pub(super) const GUESSED_ELEMENTS: &str =
    "attribute `element` has the atomic numbers that follow from the names of the atoms";
