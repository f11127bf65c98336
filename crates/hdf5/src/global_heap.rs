//! Objects of the global heap, without copying the others of their collection. Layout: HDF5 File Format Specification
//! 3.0, III.E.

use hdf5_reader::error::Error;
use hdf5_reader::io::Cursor;

use super::header_patch::{Addressing, ListPlace};

/// The bytes of the object at `place` in the file `bytes`; `None` if its collection does not have it.
///
/// # Errors
/// [`Error`] if the collection is damaged or not in the file.
pub(super) fn heap_object(
    bytes: &[u8],
    place: ListPlace,
    addressing: Addressing,
) -> Result<Option<&[u8]>, Error> {
    let start = place.collection.saturating_add(addressing.base);
    let mut cursor = Cursor::new(bytes);
    cursor.set_position(start);
    if cursor.read_bytes(4)? != b"GCOL" {
        return Err(Error::InvalidGlobalHeapSignature);
    }
    // Version and reserved bytes
    cursor.skip(4)?;
    let end = start.saturating_add(cursor.read_length(addressing.length_size)?);
    let head_len = 8 + u64::from(addressing.length_size);
    while cursor.position().saturating_add(head_len) <= end {
        let index = cursor.read_u16_le()?;
        // Number of references and reserved bytes
        cursor.skip(6)?;
        let len = cursor.read_length(addressing.length_size)?;
        let len = usize::try_from(len).unwrap_or(usize::MAX);
        if index == place.index {
            return cursor.read_bytes(len).map(Some);
        }
        // The object 0 is free space up to the end
        if index == 0 {
            break;
        }
        cursor.skip(len.saturating_add(7) & !7)?;
    }
    Ok(None)
}
