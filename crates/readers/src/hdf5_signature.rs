//! The signature of HDF5 files.

/// What every HDF5 file has at byte 0, or at 512, 1024... after a user block.
const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Where the signature is looked for.
const PLACES: [usize; 4] = [0, 512, 1024, 2048];

/// Whether `head`, the beginning of a file, is that of an HDF5 file. A file that is shorter than the signature may be
/// one.
pub fn is_hdf5(head: &[u8]) -> bool {
    let is_at = |at: &usize| head.get(*at..).is_some_and(|b| b.starts_with(SIGNATURE));
    head.starts_with(b"\x89HDF") || PLACES.iter().any(is_at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signature_may_follow_a_user_block() {
        for before in [0, 512, 2048] {
            assert!(is_hdf5(&[&vec![b' '; before], SIGNATURE].concat()));
        }
        assert!(is_hdf5(b"\x89HDF"));
        assert!(!is_hdf5(&[&[b' '; 100], SIGNATURE].concat()));
        assert!(!is_hdf5(b"x,y,z\n"));
    }
}
