//! The native frame: read like any other format, and in place, where sections are not verified.

use std::fs;
use std::hint::black_box;

use spherule_formats::blocks::{BLOCK_SIZE, WIDTH};
use spherule_formats::native::{Access, FORMAT, MAGIC, NativeFile, NativeFrame, layout};

use super::{check_error, check_particles, prepare, read_all};

/// Particles that a sample of a frame takes.
const SAMPLE: usize = 100;

/// A native frame: the bytes as they are, and with the checksums of header and index put right,
/// which mutation would never hit.
pub fn native(bytes: &[u8]) -> usize {
    let read = read_all(FORMAT, bytes, 1);
    read + repaired(bytes).map_or(0, |bytes| usize::from(in_place(&bytes)))
}

/// `bytes` under a header that is right for the index they state.
fn repaired(bytes: &[u8]) -> Option<Vec<u8>> {
    let stated = u64::from_le_bytes(*bytes.get(24..)?.first_chunk()?);
    let index = bytes.get(usize::try_from(stated).ok()?..)?;
    let (_, body) = bytes.split_at_checked(layout::HEADER_LEN)?;
    let header = layout::header(bytes.len() as u64, stated, index, 0);
    bytes.starts_with(MAGIC).then(|| [&header, body].concat())
}

/// True if the file opens; then every way to look at it must agree.
fn in_place(bytes: &[u8]) -> bool {
    if let Err(error) = layout::parse(bytes) {
        // Most inputs end here, and a file for each would be slow.
        check_error(&error, bytes.len() as u64);
        return false;
    }
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    fs::write(&path, bytes).expect("writable");
    let file = NativeFile::open(&path, Access::Read).expect("as its bytes were parsed");
    agree(file.frame().expect("unchanged"), bytes.len() as u64);
    true
}

fn agree(frame: NativeFrame<'_>, len: u64) {
    for verified in [frame.verify(), frame.verify_nodes()] {
        if let Err(error) = verified {
            check_error(&error, len);
        }
    }
    let particles = frame.to_raw().expect("an index that was checked");
    check_particles(&particles, len);
    let count = particles.positions.len();
    assert_eq!(count as u64, frame.index().count);
    touch_leaves(frame, count);
    touch_attributes(frame, count);
    let sample = frame.sample(SAMPLE).expect("an index that was checked");
    assert!(sample.positions.len() <= SAMPLE.max(BLOCK_SIZE));
    prepare(sample);
    prepare(particles);
}

/// Every block, node and radius, as rays would meet them.
fn touch_leaves(frame: NativeFrame<'_>, count: usize) {
    let leaves = frame.leaves().expect("aligned");
    assert_eq!(leaves.block_count(), count.div_ceil(BLOCK_SIZE));
    assert_eq!(leaves.nodes.len(), leaves.block_count().div_ceil(WIDTH));
    for block in 0..leaves.block_count() {
        let node = &leaves.nodes[block / WIDTH];
        let positions = leaves.block(block);
        let sphere = match leaves.radii.load(block) {
            Some(radii) => positions.sphere_bounds(&radii),
            None => positions.bounds(),
        };
        black_box(node.child_holds(block % WIDTH, &sphere));
    }
}

/// Each attribute of the index by its name, at the first particle, the last, and beyond.
fn touch_attributes(frame: NativeFrame<'_>, count: usize) {
    let views = frame.attributes();
    assert_eq!(views.len(), frame.index().attributes.len());
    for attribute in &frame.index().attributes {
        let view = frame.attribute(&attribute.name).expect("in the index");
        for place in [0, count.saturating_sub(1)] {
            black_box((view.magnitude(place), view.low_bits(place)));
        }
        assert!(view.get(count, 0).is_nan() && view.low_bits(count).is_none());
        assert!(view.get(usize::MAX, view.components() - 1).is_nan());
    }
}
