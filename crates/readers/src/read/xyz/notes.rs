//! Notes about molecular text: what is not in the particles.

use super::molecular::{self, NAME};
use super::{Lines, comment, text_start};
use crate::read::notes::cell_note;
use crate::read::text::Line;
use crate::read::{category, text};
use crate::reader::ValueNames;

/// Notes about molecular text that begins with `head`.
pub(in crate::read) fn notes(head: &[u8]) -> Vec<String> {
    let mut lines = Lines::new(head, text_start(head)..head.len());
    let count = lines.next().and_then(|line| text::integer(line.text.trim_ascii()));
    let Some((count, comment)) = count.zip(lines.next()) else {
        return Vec::new();
    };
    let mut notes = Vec::new();
    let value = |key| comment::value(comment.text, key);
    if value("Lattice").or_else(|| value("Cell")).is_some() {
        let flags = value("pbc").map(|flags| String::from_utf8_lossy(flags).into_owned());
        let is_periodic = |flags: &&String| flags.contains(['T', 't', '1']);
        notes.push(cell_note(flags.as_ref().filter(is_periodic).map(String::as_str)));
    }
    notes.extend(category::note(NAME, names(head, lines.at(), (count, comment.text))));
    notes
}

/// The names in the first frame of molecular text that are not symbols of elements.
pub(in crate::read) fn value_names(bytes: &[u8]) -> Option<ValueNames> {
    let mut lines = Lines::new(bytes, text_start(bytes)..bytes.len());
    let count = text::integer(lines.next()?.text.trim_ascii())?;
    let comment = lines.next()?;
    category::value_names(NAME, names(bytes, lines.at(), (count, comment.text)))
}

/// The names of the atoms of a frame, whose rows begin at `start`, by its number of atoms and its comment.
fn names<'a>(
    bytes: &'a [u8],
    start: usize,
    (count, comment): (i64, &[u8]),
) -> impl Iterator<Item = &'a [u8]> {
    // The last line may be cut off.
    let end = bytes.iter().rposition(|b| *b == b'\n').unwrap_or(start).max(start);
    let rows = || Lines::new(bytes, start..end).take(usize::try_from(count).unwrap_or(0));
    let column = rows().next().and_then(|row| molecular::name_column(comment, row.text));
    let name = move |row: Line<'a>| column.and_then(|column| text::words(row.text).nth(column));
    rows().filter_map(name)
}
