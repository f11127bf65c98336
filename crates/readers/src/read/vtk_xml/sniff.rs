//! Particle files and lists of files among XML VTK files, by the `type` of the root element.

use crate::reader::Confidence;
use spherule_frame::ParseError;

/// See [`crate::reader::Reader::sniff`].
pub(super) fn sniff(head: &[u8]) -> Result<Confidence, ParseError> {
    let Some(kind) = root_type(head) else {
        return Ok(Confidence::No);
    };
    let list = match kind.as_str() {
        // The reader says what is wrong with a root element without a type.
        "UnstructuredGrid" | "PolyData" | "" => return Ok(Confidence::Signature),
        "Collection" => "a ParaView collection (.pvd)",
        "PUnstructuredGrid" | "PPolyData" => "a parallel VTK index (.pvtu, .pvtp)",
        kind if kind.contains("MultiBlock") || kind.contains("PartitionedDataSet") => {
            "a multi-block VTK index (.vtm)"
        }
        kind => {
            let what = format!(
                "a VTK file of type {kind} is not read; save as UnstructuredGrid or PolyData"
            );
            return Err(ParseError::unsupported(what));
        }
    };
    Err(ParseError::unsupported(format!("{list}, which lists other files: {GIVE_LIST}")))
}

/// What to do with a list where one file of particles was expected.
pub(super) const GIVE_LIST: &str =
    "give it as the input of render, convert or inspect, or give one of the files in it";

/// The type of the root element of an XML VTK file that begins with `head`, empty if it has none; `None` for other
/// files.
pub fn root_type(head: &[u8]) -> Option<String> {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    if !head.trim_ascii_start().starts_with(b"<") {
        return None;
    }
    let head = String::from_utf8_lossy(head);
    let (_, root) = head.split_once("<VTKFile")?;
    let root = root.split_once('>').map_or(root, |(root, _)| root);
    Some(type_attribute(root).unwrap_or_default().to_owned())
}

/// The attribute `type` of an element with the attributes `root`.
fn type_attribute(root: &str) -> Option<&str> {
    ["type=\"", "type='"].iter().find_map(|key| {
        // `header_type=` ends the same way, so white space must come before.
        let at =
            root.match_indices(key).find(|(at, _)| root[..*at].ends_with(char::is_whitespace))?.0;
        root[at + key.len()..].split(['"', '\'']).next()
    })
}
