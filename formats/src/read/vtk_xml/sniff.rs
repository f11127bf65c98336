//! Particle files among XML VTK files, by the `type` of the root element.

use crate::ParseError;
use crate::reader::Confidence;

/// See [`crate::reader::Reader::sniff`].
pub(super) fn sniff(head: &[u8]) -> Result<Confidence, ParseError> {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    if !head.trim_ascii_start().starts_with(b"<") {
        return Ok(Confidence::No);
    }
    let head = String::from_utf8_lossy(head);
    let Some((_, root)) = head.split_once("<VTKFile") else {
        return Ok(Confidence::No);
    };
    let root = root.split_once('>').map_or(root, |(root, _)| root);
    let what = match type_attribute(root) {
        // The reader says what is wrong with a root element without a type.
        Some("UnstructuredGrid" | "PolyData") | None => return Ok(Confidence::Signature),
        Some("Collection") => {
            "a ParaView collection (.pvd), which only lists other files; give those files"
                .to_owned()
        }
        Some("PUnstructuredGrid" | "PPolyData") => {
            "a parallel VTK index (.pvtu, .pvtp), which only lists its pieces; give the pieces"
                .to_owned()
        }
        Some(kind) if kind.contains("MultiBlock") || kind.contains("PartitionedDataSet") => {
            "a VTK multi-block index (.vtm), which only lists its blocks; give the blocks"
                .to_owned()
        }
        Some(kind) => {
            format!("a VTK file of type {kind} is not read; save as UnstructuredGrid or PolyData")
        }
    };
    Err(ParseError::unsupported(what))
}

/// The attribute `type` of an element with the attributes `root`.
fn type_attribute(root: &str) -> Option<&str> {
    ["type=\"", "type='"].iter().find_map(|key| {
        // `header_type=` ends the same way, so white space must come before.
        let at = root
            .match_indices(key)
            .find(|(at, _)| root[..*at].ends_with(char::is_whitespace))?
            .0;
        root[at + key.len()..].split(['"', '\'']).next()
    })
}
