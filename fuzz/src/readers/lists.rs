//! Lists of files: ParaView collections, file series, indices of pieces and blocks.

use spherule_formats::sequence::lists_of;

use super::check_error;

/// One list; the files in it are not opened.
pub fn lists(bytes: &[u8]) -> usize {
    match lists_of(bytes) {
        Ok(count) => {
            assert!(count > 0 && count <= bytes.len(), "{count} files");
            1
        }
        Err(error) => {
            check_error(&error, bytes.len() as u64);
            0
        }
    }
}
