//! Remarks about molecular text: what is not in the particles.

use super::molecular::{self, NAME};
use super::{Lines, comment, text_start};
use crate::read::remarks::cell_remark;
use crate::read::{category, text};

/// Remarks about molecular text that begins with `head`.
pub(in crate::read) fn remarks(head: &[u8]) -> Vec<String> {
    let mut lines = Lines::new(head, text_start(head)..head.len());
    let count = lines.next().and_then(|line| text::integer(line.text.trim_ascii()));
    let Some((count, comment)) = count.zip(lines.next()) else {
        return Vec::new();
    };
    let mut remarks = Vec::new();
    let value = |key| comment::value(comment.text, key);
    if value("Lattice").or_else(|| value("Cell")).is_some() {
        let flags = value("pbc").map(|flags| String::from_utf8_lossy(flags).into_owned());
        let is_periodic = |flags: &&String| flags.contains(['T', 't', '1']);
        remarks.push(cell_remark(flags.as_ref().filter(is_periodic).map(String::as_str)));
    }
    // The last line may be cut off.
    let end = head.iter().rposition(|b| *b == b'\n').unwrap_or(lines.at());
    let rows = Lines::new(head, lines.at()..end.max(lines.at()));
    let rows: Vec<&[u8]> =
        rows.take(usize::try_from(count).unwrap_or(0)).map(|row| row.text).collect();
    let column = rows.first().and_then(|row| molecular::name_column(comment.text, row));
    if let Some(column) = column {
        let names = rows.iter().filter_map(|row| text::words(row).nth(column));
        remarks.extend(category::note(NAME, names));
    }
    remarks
}
