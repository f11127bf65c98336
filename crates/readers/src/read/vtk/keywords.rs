//! The fixed words of the format: the version line, keywords, names of the time.

use super::attributes::field_array;
use super::cursor::VtkLine;
use spherule_frame::ParseError;

/// Major version from `# vtk DataFile Version 4.1`.
pub(super) fn parse_version(line: &VtkLine) -> Result<u32, ParseError> {
    const MAGIC: &[u8] = b"# vtk DataFile Version";
    let version = line
        .text
        .split_at_checked(MAGIC.len())
        .filter(|(magic, _)| magic.eq_ignore_ascii_case(MAGIC))
        .and_then(|(_, version)| std::str::from_utf8(version).ok())
        .map(str::trim);
    let major = version.and_then(|v| v.split('.').next()?.parse().ok());
    match major {
        Some(major @ 1..=5) => Ok(major),
        Some(major) => Err(ParseError::unsupported(format!(
            "legacy VTK version {major} is not known; write version 5.1 or older"
        ))),
        None => Err(ParseError::malformed(
            line.at,
            format!("`{}` is not a legacy VTK header", line.shown()),
        )),
    }
}

/// True where a new part of the file may begin: a keyword, or an array of a FIELD.
pub(super) fn is_section_start(line: &VtkLine) -> bool {
    is_keyword(line.first_word()) || field_array(line).is_some()
}

/// True for the first word of a line that begins a part of the file.
pub(super) fn is_keyword(word: &[u8]) -> bool {
    const KEYWORDS: [&str; 25] = [
        "DATASET",
        "POINTS",
        "CELLS",
        "VERTICES",
        "LINES",
        "POLYGONS",
        "TRIANGLE_STRIPS",
        "OFFSETS",
        "CONNECTIVITY",
        "CELL_TYPES",
        "POINT_DATA",
        "CELL_DATA",
        "FIELD",
        "SCALARS",
        "COLOR_SCALARS",
        "LOOKUP_TABLE",
        "VECTORS",
        "NORMALS",
        "TENSORS",
        "TENSORS6",
        "TEXTURE_COORDINATES",
        "GLOBAL_IDS",
        "PEDIGREE_IDS",
        "EDGE_FLAGS",
        "METADATA",
    ];
    KEYWORDS.iter().any(|keyword| word.eq_ignore_ascii_case(keyword.as_bytes()))
}

/// True for the names under which a FIELD holds the simulation time.
pub(super) fn is_time_name(name: &str) -> bool {
    ["time", "timevalue"].iter().any(|t| name.eq_ignore_ascii_case(t))
}
