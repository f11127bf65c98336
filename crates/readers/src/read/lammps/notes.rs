//! Notes about a dump: what is not in the particles.

use super::ITEM;
use super::bounds::boundary_flags;
use super::header::{DumpHeader, DumpItem};
use crate::read::category;
use crate::read::input::TextInput;
use crate::read::notes::cell_note;
use crate::read::text::{self, Lines};
use crate::reader::ValueNames;
use spherule_frame::MemoryBudget;
use spherule_frame::names::LAMMPS_CATEGORIES;

/// See [`crate::read::notes`].
pub(in crate::read) fn notes(head: &[u8]) -> Vec<String> {
    let mut notes = Vec::new();
    let mut items = Lines::new(head, 0..head.len());
    let bounds = items.find(|line| {
        line.text.starts_with(ITEM)
            && matches!(DumpItem::of(line.text), DumpItem::Bounds | DumpItem::Atoms)
    });
    if let Some(bounds) = bounds.filter(|line| DumpItem::of(line.text) == DumpItem::Bounds) {
        let flags: Vec<_> =
            boundary_flags(bounds.text).into_iter().map(String::from_utf8_lossy).collect();
        let is_periodic = flags.iter().any(|flag| flag.contains('p'));
        notes.push(cell_note(is_periodic.then(|| flags.join(" ")).as_deref()));
    }
    notes.extend(columns(head, |name, names| category::note(name, names)));
    notes
}

/// The names in the first step that are not symbols of elements.
pub(in crate::read) fn value_names(bytes: &[u8]) -> Vec<ValueNames> {
    columns(bytes, |name, names| category::value_names(name, names))
}

/// What `of` makes of each column with names: its own name, and those in it.
fn columns<'a, T>(
    bytes: &'a [u8],
    of: impl Fn(&str, &mut dyn Iterator<Item = &'a [u8]>) -> Option<T>,
) -> Vec<T> {
    let mut text = TextInput::whole(bytes);
    let Ok(header) = DumpHeader::parse(&mut text, MemoryBudget::UNLIMITED) else {
        return Vec::new();
    };
    let start = text.at();
    // The last line may be cut off.
    let end = bytes.iter().rposition(|b| *b == b'\n').unwrap_or(start);
    let mut all = Vec::new();
    for (column, name) in header.names.iter().enumerate() {
        let name = String::from_utf8_lossy(name);
        if !LAMMPS_CATEGORIES.contains(&&*name) {
            continue;
        }
        let rows = Lines::new(bytes, start..end.max(start)).take(header.count);
        let mut names = rows.map_while(|row| {
            let is_row = !row.text.starts_with(ITEM);
            is_row.then(|| text::words(row.text).nth(column)).flatten()
        });
        all.extend(of(&name, &mut names));
    }
    all
}
