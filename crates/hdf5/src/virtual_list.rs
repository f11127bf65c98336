//! The list in the header of a virtual data set that maps ranges of its elements to data sets in other files.
//!
//! Layout of the list and of selections: HDF5 File Format Specification 3.0, III.I and VIII.

use std::ops::Range;
use std::sync::Arc;

use hdf5_reader::error::Error;
use hdf5_reader::io::Cursor;

/// Most dimensions that HDF5 has.
const MAX_DIMENSIONS: u32 = 32;

/// Elements of a virtual data set that are those of another one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct VirtualPart {
    /// The file as it is called in this one; `.` is this one.
    pub(super) file: Arc<str>,
    /// Path of the data set in that file.
    pub(super) dataset: Arc<str>,
    /// Which of its elements.
    pub(super) source: Selection,
    /// Which elements of the virtual data set they are.
    pub(super) target: Selection,
}

/// Elements of a data set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Selection {
    /// None.
    None,
    /// All.
    All,
    /// Along each dimension, the first one and their number; all that follow if `None`.
    Box(Vec<(u64, Option<u64>)>),
    /// Several boxes, or single elements.
    Scattered,
}

impl Selection {
    /// The elements as a range of all elements of a data set of this shape, in their order in memory; `None` if they
    /// are not one range of it.
    pub(super) fn range(&self, shape: &[u64]) -> Option<Range<u64>> {
        let count = shape.iter().try_fold(1_u64, |count, size| count.checked_mul(*size))?;
        let sides = match self {
            Self::None => return Some(0..0),
            Self::All => return Some(0..count),
            Self::Scattered => return None,
            Self::Box(sides) if sides.len() == shape.len() => sides,
            Self::Box(_) => return None,
        };
        let (mut first, mut len) = (0_u64, 1_u64);
        for ((start, size), all) in sides.iter().zip(shape) {
            let left = all.checked_sub(*start)?;
            let size = size.unwrap_or(left);
            // Behind a part of a dimension, the elements of several rows are only together if the rows are whole
            if size > left || (len > 1 && size != *all) {
                return None;
            }
            first = first.checked_mul(*all)?.checked_add(*start)?;
            len = len.checked_mul(size)?;
        }
        Some(first..first.checked_add(len)?)
    }
}

/// Reads the list of at most `most` parts in the object `bytes` of the global heap of a file with lengths of
/// `length_size` bytes.
///
/// # Errors
/// [`Error`] if it is damaged or of a later version.
pub(super) fn read_list(
    bytes: &[u8],
    length_size: u8,
    most: usize,
) -> Result<Vec<VirtualPart>, Error> {
    let mut cursor = Cursor::new(bytes);
    let version = cursor.read_u8()?;
    if version > 1 {
        let what = format!("virtual data sets of version {version}");
        return Err(Error::UnsupportedEncoding(what));
    }
    let count = cursor.read_length(length_size)?;
    if count > most as u64 {
        let what = format!("{count} parts of a virtual data set, at most {most} more are read");
        return Err(Error::InvalidData(what));
    }
    let mut parts: Vec<VirtualPart> = Vec::new();
    for _ in 0..count {
        let flags = if version == 1 { cursor.read_u8()? } else { 0 };
        // Names may be those of an earlier part
        let mut name = |is_shared: bool, of: fn(&VirtualPart) -> &Arc<str>| {
            if is_shared {
                let index = cursor.read_length(length_size)?;
                let part = usize::try_from(index).ok().and_then(|index| parts.get(index));
                let missing = || Error::InvalidData(format!("the name of part {index} is missing"));
                part.map(|part| Arc::clone(of(part))).ok_or_else(missing)
            } else {
                cursor.read_null_terminated_string().map(Arc::from)
            }
        };
        let file =
            if flags & 4 != 0 { ".".into() } else { name(flags & 1 != 0, |part| &part.file)? };
        let dataset = name(flags & 2 != 0, |part| &part.dataset)?;
        let source = read_selection(&mut cursor)?;
        let target = read_selection(&mut cursor)?;
        parts.push(VirtualPart { file, dataset, source, target });
    }
    Ok(parts)
}

/// Reads a selection of version 1 to 3.
fn read_selection(cursor: &mut Cursor<'_>) -> Result<Selection, Error> {
    let kind = cursor.read_u32_le()?;
    let version = cursor.read_u32_le()?;
    match (kind, version) {
        (0 | 3, 1) => {
            cursor.skip(8)?;
            Ok(if kind == 0 { Selection::None } else { Selection::All })
        }
        (1 | 2, 1) => {
            cursor.skip(4)?;
            let len = cursor.read_u32_le()? as usize;
            let bytes = cursor.read_bytes(len)?;
            match kind {
                1 => Ok(Selection::Scattered),
                _ => blocks(&mut Cursor::new(bytes), 4),
            }
        }
        (2, 2) => {
            let flags = cursor.read_u8()?;
            cursor.skip(4)?;
            hyperslab(cursor, flags, 8)
        }
        (2, 3) => {
            let flags = cursor.read_u8()?;
            let size = cursor.read_u8()?;
            hyperslab(cursor, flags, usize::from(size))
        }
        _ => {
            let what = format!("a selection of type {kind} and version {version}");
            Err(Error::UnsupportedEncoding(what))
        }
    }
}

/// A hyperslab with numbers of `size` bytes.
fn hyperslab(cursor: &mut Cursor<'_>, flags: u8, size: usize) -> Result<Selection, Error> {
    if flags & 1 == 0 {
        return blocks(cursor, size);
    }
    let unlimited = u64::MAX >> 64_usize.saturating_sub(8 * size).min(63);
    let mut sides = Some(Vec::new());
    for _ in 0..dimensions(cursor)? {
        let [start, stride, count, block] = [
            cursor.read_uvar(size)?,
            cursor.read_uvar(size)?,
            cursor.read_uvar(size)?,
            cursor.read_uvar(size)?,
        ];
        let len = match (count, block) {
            (count, block) if count == unlimited || block == unlimited => Some(None),
            (count, block) => count.checked_mul(block).map(Some),
        };
        let is_together = count == 1 || stride == block;
        sides = match (sides, len) {
            (Some(mut sides), Some(len)) if is_together => {
                sides.push((start, len));
                Some(sides)
            }
            _ => None,
        };
    }
    Ok(sides.map_or(Selection::Scattered, Selection::Box))
}

/// A list of blocks by their first and last elements, with numbers of `size` bytes.
fn blocks(cursor: &mut Cursor<'_>, size: usize) -> Result<Selection, Error> {
    let rank = dimensions(cursor)? as usize;
    let count = cursor.read_uvar(size)?;
    if count != 1 {
        let len = usize::try_from(count).ok().and_then(|count| count.checked_mul(2 * rank * size));
        cursor.skip(len.unwrap_or(usize::MAX))?;
        return Ok(Selection::Scattered);
    }
    let mut read = || (0..rank).map(|_| cursor.read_uvar(size)).collect();
    let (first, last): (Result<Vec<u64>, Error>, Result<Vec<u64>, Error>) = (read(), read());
    let sides = first?.into_iter().zip(last?).map(|(first, last)| {
        let len = last.checked_sub(first).and_then(|len| len.checked_add(1));
        let damaged = || Error::InvalidData(format!("a block from {first} to {last}"));
        len.map(|len| (first, Some(len))).ok_or_else(damaged)
    });
    sides.collect::<Result<_, _>>().map(Selection::Box)
}

fn dimensions(cursor: &mut Cursor<'_>) -> Result<u32, Error> {
    let rank = cursor.read_u32_le()?;
    if rank > MAX_DIMENSIONS {
        return Err(Error::InvalidData(format!("{rank} dimensions")));
    }
    Ok(rank)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn ranges(sides: &[(u64, Option<u64>)], shape: &[u64], expected: Option<Range<u64>>) {
        assert_eq!(Selection::Box(sides.to_vec()).range(shape), expected);
    }

    #[test]
    fn boxes_of_whole_rows_are_ranges() {
        ranges(&[(2, Some(3)), (0, Some(3))], &[8, 3], Some(6..15));
        ranges(&[(2, None), (0, Some(3))], &[8, 3], Some(6..24));
        ranges(&[(1, Some(1)), (4, Some(2)), (0, Some(3))], &[2, 8, 3], Some(36..42));
        ranges(&[(5, Some(3))], &[8], Some(5..8));
        ranges(&[(5, Some(1)), (1, Some(1))], &[8, 3], Some(16..17));
    }

    #[test]
    fn other_boxes_are_not() {
        // Columns, rows of several frames, more than there is, another number of dimensions
        ranges(&[(0, Some(8)), (0, Some(2))], &[8, 3], None);
        ranges(&[(0, Some(2)), (4, Some(2)), (0, Some(3))], &[2, 8, 3], None);
        ranges(&[(6, Some(3))], &[8], None);
        ranges(&[(9, Some(0))], &[8], None);
        ranges(&[(0, Some(1))], &[8, 3], None);
        ranges(&[(0, Some(1)), (1, Some(1))], &[u64::MAX, 3], None);
        assert_eq!(Selection::Scattered.range(&[8]), None);
        assert_eq!(Selection::All.range(&[8, 3]), Some(0..24));
        assert_eq!(Selection::None.range(&[8]), Some(0..0));
    }

    #[test]
    fn damaged_lists_are_errors() {
        let all = [&3_u32.to_le_bytes()[..], &1_u32.to_le_bytes(), &[0; 8]].concat();
        let good = [&[0][..], &1_u64.to_le_bytes(), b"a\0x\0", &all, &all].concat();
        assert_eq!(&*read_list(&good, 8, 9).expect("good")[0].file, "a");
        assert!(read_list(&good, 8, 0).is_err());
        for len in 0..good.len() {
            assert!(read_list(&good[..len], 8, 9).is_err(), "{len}");
        }
        let mut bad = good.clone();
        bad[0] = 2;
        assert!(read_list(&bad, 8, 9).is_err());
        bad.clone_from(&good);
        bad[4] = 1;
        assert!(read_list(&bad, 8, 9).is_err());
        bad.clone_from(&good);
        bad[13] = 9;
        assert!(read_list(&bad, 8, 9).is_err());
    }

    #[test]
    fn later_parts_may_share_names() {
        let all = [&3_u32.to_le_bytes()[..], &1_u32.to_le_bytes(), &[0; 8]].concat();
        let count = 3_u64.to_le_bytes();
        let zero = 0_u64.to_le_bytes();
        let first = [&[0][..], b"a\0x\0", &all, &all].concat();
        let second = [&[3][..], &zero, &zero, &all, &all].concat();
        let third = [&[4][..], b"y\0", &all, &all].concat();
        let list = [&[1][..], &count, &first, &second, &third].concat();
        let parts = read_list(&list, 8, 9).expect("good");
        let names = parts.iter().map(|part| (&*part.file, &*part.dataset));
        assert!(names.eq([("a", "x"), ("a", "x"), (".", "y")]));
        let forward = [&[1][..], &count, &second, &second, &second].concat();
        assert!(read_list(&forward, 8, 9).is_err());
    }
}
