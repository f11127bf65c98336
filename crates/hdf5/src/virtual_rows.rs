//! Finds the data sets, and the rows in them, that have the rows of a virtual data set.

use std::ops::Range;
use std::sync::Arc;

use super::node::Node;
use super::slice::Slice;
use super::stored::{Storage, Stored};
use super::types::Field;
use super::virtual_list::VirtualPart;
use spherule_frame::ParseError;

/// Rows of a virtual data set, and where they are.
#[derive(Debug)]
pub(super) struct SourceRows {
    /// Counted from the first row that is wanted.
    pub(super) rows: Range<u64>,
    /// The data set that has them.
    pub(super) stored: Arc<Stored>,
    /// The same rows in it.
    pub(super) slice: Slice,
}

/// The rows of a virtual data set that are wanted.
#[derive(Debug, Clone)]
pub(super) struct WantedRows {
    /// A field of a compound type; `None` for all numbers of a row.
    pub(super) field: Option<Field>,
    /// The first element among all elements of the data set.
    pub(super) first: u64,
    /// Number of rows.
    pub(super) count: u64,
    /// Elements of a row.
    pub(super) elements: u64,
}

/// Finds the `wanted` rows of `stored`, whose elements are in `parts`, in their order.
///
/// # Errors
/// [`ParseError::Unsupported`] if a file is missing or the parts are not whole rows of the same type;
/// [`ParseError::Malformed`] if rows are in no part or in two.
pub(super) fn source_rows(
    stored: &Stored,
    parts: &[VirtualPart],
    wanted: &WantedRows,
) -> Result<Vec<SourceRows>, ParseError> {
    let size = wanted.elements.max(1);
    let end = wanted.first + wanted.count * size;
    let not_rows = |part| {
        let why = "but not of whole rows one after the other; copy it with h5py";
        refused(stored, part, why)
    };
    // Find the wanted elements of each part
    let mut found = Vec::new();
    for part in parts {
        let target = part.target.range(&stored.shape).ok_or_else(|| not_rows(part))?;
        let start = target.start.max(wanted.first);
        let len = target.end.min(end).saturating_sub(start);
        if len == 0 {
            continue;
        }
        let place = start - wanted.first;
        if !(place.is_multiple_of(size) && len.is_multiple_of(size)) {
            return Err(not_rows(part));
        }
        found.push((place / size..(place + len) / size, part, target));
    }
    check_once(stored, &mut found, wanted.count)?;
    // Find the same elements where they are
    let mut sources = Vec::with_capacity(found.len());
    for (rows, part, target) in found {
        let source = open_source(stored, part)?;
        let from = part.source.range(&source.shape).ok_or_else(|| not_rows(part))?;
        if from.end - from.start != target.end - target.start {
            return Err(refused(stored, part, "but another number of them; copy it with h5py"));
        }
        let first = from.start + (wanted.first + rows.start * size - target.start);
        let len = (rows.end - rows.start) * size;
        let slice = slice_of(&source.shape, first, len, size).ok_or_else(|| not_rows(part))?;
        let field = wanted.field;
        if field.is_some() && source.datatype != stored.datatype {
            return Err(refused(stored, part, "which has other fields; copy it with h5py"));
        }
        sources.push(SourceRows { rows, stored: source, slice: Slice { field, ..slice } });
    }
    Ok(sources)
}

/// The error for a virtual data set with a `part` that is not read.
fn refused(stored: &Stored, part: &VirtualPart, why: &str) -> ParseError {
    let (path, dataset, file) = (&stored.path, &part.dataset, &part.file);
    ParseError::unsupported(format!(
        "{path}: a virtual data set with values of `{dataset}` in `{file}`, {why}"
    ))
}

/// Rows, the part that has them, and its elements.
type PartRows<'a> = (Range<u64>, &'a VirtualPart, Range<u64>);

/// Sorts `found` by rows, and checks that each of `count` rows is there once.
fn check_once(stored: &Stored, found: &mut [PartRows<'_>], count: u64) -> Result<(), ParseError> {
    found.sort_by_key(|(rows, ..)| rows.start);
    let mut next = 0;
    for (rows, ..) in &*found {
        if rows.start < next {
            return Err(stored.bad("rows of this virtual data set are in two others"));
        }
        if rows.start > next {
            break;
        }
        next = rows.end;
    }
    if next < count {
        return Err(stored.bad("rows of this virtual data set are in no other one"));
    }
    Ok(())
}

/// Opens the data set of `part`.
fn open_source(stored: &Stored, part: &VirtualPart) -> Result<Arc<Stored>, ParseError> {
    let file = stored
        .file
        .other(&part.file)
        .map_err(|e| e.map_message(|what| format!("{}: {what}", stored.path)))?;
    let dataset = Node::root(&file)?
        .dataset_at(&part.dataset)?
        .ok_or_else(|| refused(stored, part, "where it is not"))?;
    let source = Stored::of(&part.dataset, &dataset)?;
    if matches!(source.place, Storage::Virtual(_)) {
        return Err(refused(stored, part, "which is virtual as well; copy it with h5py"));
    }
    Ok(Arc::new(source))
}

/// `len` elements from `first` on of a data set of this shape, as rows of `size` elements; `None` if they are not rows
/// of it.
fn slice_of(shape: &[u64], first: u64, len: u64, size: u64) -> Option<Slice> {
    if !first.is_multiple_of(size) {
        return None;
    }
    let rows = first / size..(first + len) / size;
    match *shape {
        [_] if size > 1 => Some(Slice { stride: Some(size), ..Slice::rows(rows) }),
        [_] => Some(Slice::rows(rows)),
        [_, elements] if elements == size => Some(Slice::rows(rows)),
        // Frames of rows
        [_, count] if size == 1 => framed(rows, count),
        [_, count, elements] if elements == size => framed(rows, count),
        _ => None,
    }
}

/// `rows` of all frames of `count` rows each, if they are of one frame.
fn framed(rows: Range<u64>, count: u64) -> Option<Slice> {
    let frame = rows.start.checked_div(count)?;
    let start = frame * count;
    let own = rows.start - start..rows.end - start;
    (own.end <= count).then(|| Slice { frame: Some(frame), ..Slice::rows(own) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn slices(shape: &[u64], first: u64, len: u64, size: u64, expected: Option<&str>) {
        let slice = slice_of(shape, first, len, size);
        let shown = slice.map(|slice| {
            let rows = slice.rows.expect("rows");
            format!("{:?} {:?} {:?}", slice.frame, rows, slice.stride)
        });
        assert_eq!(shown.as_deref(), expected);
    }

    #[test]
    fn rows_are_found_in_other_shapes() {
        slices(&[8, 3], 6, 9, 3, Some("None 2..5 None"));
        slices(&[8, 3], 5, 9, 3, None);
        slices(&[24], 6, 9, 3, Some("None 2..5 Some(3)"));
        slices(&[8], 2, 3, 1, Some("None 2..5 None"));
        slices(&[2, 8, 3], 24, 24, 3, Some("Some(1) 0..8 None"));
        slices(&[2, 8, 3], 27, 6, 3, Some("Some(1) 1..3 None"));
        slices(&[2, 8, 3], 21, 6, 3, None);
        slices(&[2, 8], 8, 8, 1, Some("Some(1) 0..8 None"));
        slices(&[8, 2], 0, 6, 3, None);
    }
}
