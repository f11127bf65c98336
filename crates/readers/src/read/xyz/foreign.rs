//! Other formats that begin with a count, but have no comment behind it.

use crate::read::text;

const POINT_CLOUD: &str = "a point cloud with a count and no comment: if it is of a laser scanner, call it .pts; else \
                           delete its first line";

/// What a text is in whose second line, `row`, is one of the counted lines instead of a comment. The next line has
/// `columns` words.
pub(super) fn without_comment(row: &[u8], columns: usize) -> Option<&'static str> {
    let words: Vec<&[u8]> = text::words(row).collect();
    let is_number = |word: &&[u8]| text::number(word).is_some();
    match words.as_slice() {
        [_, _, _, ..] if words.len() == columns && words.iter().all(is_number) => Some(POINT_CLOUD),
        _ => None,
    }
}
