//! Indices and headers with false numbers and correct checksums.

use super::*;
use layout::{RadiusIndex, Section};

/// Sizes that overflow in additions, multiplications, alignment or conversion to a signed number.
const HUGE: [u64; 10] = [
    u64::MAX,
    u64::MAX - 1,
    u64::MAX - 15,
    u64::MAX - 63,
    (u64::MAX - 63) / 12,
    u64::MAX / 64,
    1 << 63,
    (1 << 63) - 64,
    1 << 60,
    1 << 40,
];

/// A number of an index that a file could state falsely.
type Field = fn(&mut FrameIndex) -> Option<&mut u64>;

fn radii(index: &mut FrameIndex) -> Option<&mut Section> {
    match &mut index.radius {
        RadiusIndex::PerParticle(radii) => Some(&mut radii.section),
        RadiusIndex::None | RadiusIndex::Common(_) => None,
    }
}

const FIELDS: [Field; 13] = [
    |i| Some(&mut i.count),
    |i| Some(&mut i.positions.offset),
    |i| Some(&mut i.positions.len),
    |i| Some(&mut i.wide.offset),
    |i| Some(&mut i.wide.len),
    |i| Some(&mut i.nodes.offset),
    |i| Some(&mut i.nodes.len),
    |i| radii(i).map(|s| &mut s.offset),
    |i| radii(i).map(|s| &mut s.len),
    |i| i.attributes.first_mut().map(|a| &mut a.section.offset),
    |i| i.attributes.first_mut().map(|a| &mut a.section.len),
    |i| i.attributes.last_mut().map(|a| &mut a.section.offset),
    |i| i.attributes.last_mut().map(|a| &mut a.section.len),
];

#[test]
fn overflowing_sizes_are_rejected() {
    for stored in frames::all() {
        for field in FIELDS {
            for huge in HUGE {
                let mut index = stored.index.clone();
                let Some(number) = field(&mut index) else {
                    continue;
                };
                *number = huge;
                let bytes = stored.under(&index);
                let len = bytes.len();
                check_error(&read(bytes).expect_err("not in the file"), len);
            }
        }
    }
}

/// All lengths match the count, as far as they can be computed.
#[test]
fn inconsistent_counts_are_rejected() {
    for stored in frames::all() {
        for count in HUGE.into_iter().chain([0, 1, 151, 1000, u64::from(u32::MAX)]) {
            let mut index = stored.index.clone();
            index.count = count;
            let lanes = layout::blocks_of(count).wrapping_mul(16);
            let positions = layout::positions_len(count, index.encoding());
            index.positions.len = positions.unwrap_or(lanes.wrapping_mul(12));
            index.nodes.len = layout::nodes_len(count).unwrap_or(0);
            for attribute in &mut index.attributes {
                let width = attribute.section.len / 150;
                attribute.section.len = count.wrapping_mul(width);
            }
            if let Some(section) = radii(&mut index) {
                section.len = lanes.wrapping_mul(section.len / 160);
            }
            let bytes = stored.under(&index);
            let len = bytes.len();
            // Fewer particles fit into the file, but the sections then differ from the ones written.
            check_error(&read(bytes).expect_err("another count"), len);
        }
    }
}

#[test]
fn inconsistent_headers_are_rejected() {
    let stored = &frames::all()[0];
    let index = stored.index_range();
    for lie in HUGE.into_iter().chain([0, 1, 63, 64, index.start as u64 + 1]) {
        for at in [16, 24, 32] {
            let mut bytes = stored.bytes.clone();
            bytes[at..at + 8].copy_from_slice(&lie.to_le_bytes());
            let sum = xxhash_rust::xxh3::xxh3_64(&bytes[..56]);
            bytes[56..64].copy_from_slice(&sum.to_le_bytes());
            let len = bytes.len();
            check_error(&read(bytes).expect_err("a lie"), len);
        }
    }
    let mut newer = stored.bytes.clone();
    newer[8] += 1;
    let sum = xxhash_rust::xxh3::xxh3_64(&newer[..56]);
    newer[56..64].copy_from_slice(&sum.to_le_bytes());
    let error = read(newer).expect_err("another version");
    assert!(matches!(error, FrameError::Unsupported { .. }), "{error}");
}

/// Any index that passes the checks can be accessed, and verified data equals the data that was written.
#[test]
fn changed_index_with_valid_checksum_never_panics() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let all = frames::all();
    let mut numbers = Numbers(0x1e5);
    let mut opened = 0;
    for round in 0..4000 {
        let stored = &all[round % all.len()];
        let mut index = stored.bytes[stored.index_range()].to_vec();
        for _ in 0..=numbers.below(2) {
            let at = numbers.below(index.len());
            index[at] ^= FLIPS[numbers.below(FLIPS.len())];
        }
        let bytes = stored.under_bytes(&index);
        if let Err(error) = layout::parse(&bytes) {
            assert!(!error.to_string().contains(char::is_control), "{error:?}");
            continue;
        }
        opened += 1;
        fs::write(&path, &bytes).expect("writable");
        let file = NativeFile::open(&path, Access::Read).expect("it was parsed");
        touch(file.frame().expect("unchanged"));
    }
    // With fewer opened files, the test would check nothing.
    assert!(opened > 400, "{opened}");
}
