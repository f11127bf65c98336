//! The native frame: read like any other format, and in place, where sections are not verified.

use std::fs;

use spherule_formats::detect::Format;
use spherule_formats::native::{Access, MAGIC, NativeFile, NativeFrame, layout};

use super::{check_message, check_particles, prepare, read_all};

/// A native frame: the bytes as they are, and with the checksums of header and index put right,
/// which mutation would never hit.
pub fn native(bytes: &[u8]) -> usize {
    let read = read_all(Format::Spf, bytes, 1);
    read + repaired(bytes).map_or(0, |bytes| usize::from(in_place(&bytes)))
}

/// `bytes` under a header that is right for the index they state.
fn repaired(bytes: &[u8]) -> Option<Vec<u8>> {
    let stated = u64::from_le_bytes(*bytes.get(24..)?.first_chunk()?);
    let index = bytes.get(usize::try_from(stated).ok()?..)?;
    let (_, body) = bytes.split_at_checked(layout::HEADER_LEN)?;
    let header = layout::header(bytes.len() as u64, stated, index);
    bytes.starts_with(MAGIC).then(|| [&header, body].concat())
}

/// True if the file opens; then every way to look at it must agree.
fn in_place(bytes: &[u8]) -> bool {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    fs::write(&path, bytes).expect("writable");
    match NativeFile::open(&path, Access::Read) {
        Ok(file) => {
            agree(file.frame().expect("unchanged"), bytes.len() as u64);
            true
        }
        Err(error) => {
            check_message(&error.to_string());
            false
        }
    }
}

fn agree(frame: NativeFrame<'_>, len: u64) {
    if let Err(error) = frame.verify() {
        check_message(&error.to_string());
    }
    let particles = frame.to_raw().expect("an index that was checked");
    check_particles(&particles, len);
    let count = particles.positions.len();
    assert_eq!(count as u64, frame.index().count);
    let blocks = frame.blocks().expect("aligned");
    assert_eq!(blocks.len(), count.div_ceil(layout::BLOCK));
    assert!(frame.radii().is_none_or(|radii| radii.len() == count));
    for attribute in &frame.index().attributes {
        let found = frame.attribute(&attribute.name).expect("in the index");
        found.expect("an index that was checked");
    }
    prepare(particles);
}
