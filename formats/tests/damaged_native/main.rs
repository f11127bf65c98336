//! Damages native frames at every place: reading gives an error that names the file, or the damage has no effect.

use std::fs;
use std::hint::black_box;
use std::path::Path;

use spherule_formats::native::{Access, FORMAT, FrameIndex, NativeFile, NativeFrame, layout};
use spherule_formats::{FrameError, FrameFile, ParseError, RawParticles};

mod frames;
mod lies;
mod shrinking;

use frames::{Numbers, Stored};

/// Changes to a byte: each bit alone, several bits, all bits.
const FLIPS: [u8; 11] = [1, 2, 4, 8, 16, 32, 64, 128, 0x81, 0x3c, 0xff];

/// Reads a whole file from memory and verifies every section.
fn read(bytes: Vec<u8>) -> Result<RawParticles, FrameError> {
    FrameFile::from_bytes(Path::new("a.spf"), bytes)?.read(0)
}

/// Checks that the error names the file, a place in it, and a remedy.
#[track_caller]
fn check_error(error: &FrameError, len: usize) {
    let FrameError::Malformed { path, at, what } = error else {
        panic!("{error}");
    };
    assert_eq!(path, Path::new("a.spf"));
    assert!(*at <= len as u64, "{error}: {len} bytes");
    let remedies = ["again", "still being", "does not begin like one"];
    assert!(remedies.iter().any(|r| what.contains(r)), "{error}");
}

/// Accesses everything in a view without verification.
fn touch(frame: NativeFrame<'_>) {
    let _ = black_box((frame.verify(), frame.verify_nodes()));
    let leaves = frame.leaves().expect("lengths were checked");
    for block in 0..leaves.block_count() {
        black_box((leaves.block(block), leaves.radii.load(block)));
    }
    let count = usize::try_from(leaves.count).expect("it is in memory");
    for attribute in frame.attributes() {
        for particle in 0..=count {
            black_box((attribute.magnitude(particle), attribute.low_bits(particle)));
        }
    }
    black_box(frame.sample(32).expect("lengths were checked"));
    let raw = frame.to_raw().expect("lengths were checked");
    assert_eq!(raw.positions.len(), count);
}

#[test]
fn every_byte_of_header_and_index_is_covered() {
    for stored in frames::all() {
        assert!(read(stored.bytes.clone()).is_ok(), "{}", stored.name);
        for at in (0..layout::HEADER_LEN).chain(stored.index_range()) {
            for flip in FLIPS {
                let mut damaged = stored.bytes.clone();
                damaged[at] ^= flip;
                let len = damaged.len();
                let error = read(damaged).expect_err("a checksum covers it");
                check_error(&error, len);
            }
        }
    }
}

/// Reads `damaged`, which differs from `stored` at `places` in its sections.
#[track_caller]
fn named_or_same(stored: &Stored, damaged: &[u8], places: &[usize]) {
    let whole = FORMAT.steps(&stored.bytes).and_then(|s| FORMAT.read(&stored.bytes, &s[0]));
    let hit: Vec<_> = places.iter().filter_map(|at| stored.section_at(*at)).collect();
    let index = layout::parse(damaged).expect("header and index are whole");
    assert_eq!(index, stored.index);
    let step = &FORMAT.steps(damaged).expect("whole")[0];
    match FORMAT.read(damaged, step) {
        Ok(raw) => assert!(hit.is_empty() && Ok(raw) == whole, "{places:?}"),
        Err(ParseError::Malformed { at, what }) => {
            let is_named = |(name, offset): &(String, u64)| *offset == at && what.starts_with(name);
            assert!(hit.iter().any(is_named), "{at} {what}: {places:?}");
            assert!(what.ends_with("convert again"), "{what}");
        }
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn every_flipped_byte_names_its_section() {
    for stored in frames::all() {
        for at in layout::HEADER_LEN..stored.index_range().start {
            let mut damaged = stored.bytes.clone();
            damaged[at] ^= FLIPS[at % FLIPS.len()];
            named_or_same(&stored, &damaged, &[at]);
        }
    }
}

#[test]
fn random_flips_name_a_section() {
    let all = frames::all();
    let mut numbers = Numbers(0x5eed);
    for round in 0..10_000 {
        let stored = &all[round % all.len()];
        let mut damaged = stored.bytes.clone();
        let room = stored.index_range().start - layout::HEADER_LEN;
        for _ in 0..=numbers.below(4) {
            let at = layout::HEADER_LEN + numbers.below(room);
            damaged[at] ^= FLIPS[numbers.below(FLIPS.len())];
        }
        let differ = |at: &usize| damaged[*at] != stored.bytes[*at];
        let places: Vec<usize> = (0..damaged.len()).filter(differ).collect();
        named_or_same(stored, &damaged, &places);
    }
}

#[test]
fn nodes_are_verified_alone() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    for stored in frames::all() {
        for section in [&stored.index.nodes, &stored.index.positions] {
            let mut damaged = stored.bytes.clone();
            damaged[usize::try_from(section.offset).expect("small")] ^= 1;
            fs::write(&path, damaged).expect("writable");
            let file = NativeFile::open(&path, Access::Read).expect("header and index are whole");
            let frame = file.frame().expect("unchanged");
            let is_nodes = section == &stored.index.nodes;
            assert_eq!(frame.verify_nodes().is_err(), is_nodes);
            assert!(frame.verify().is_err());
            touch(frame);
        }
    }
}

#[test]
fn every_truncation_is_rejected() {
    for stored in frames::all() {
        for len in 0..stored.bytes.len() {
            let error = read(stored.bytes[..len].to_vec()).expect_err("cut short");
            check_error(&error, len);
        }
        for more in [1, 64, 4096] {
            let longer = [&stored.bytes[..], &vec![0; more]].concat();
            check_error(&read(longer).expect_err("too long"), stored.bytes.len());
        }
    }
}

#[test]
fn truncation_at_section_borders_is_rejected() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    for stored in frames::all() {
        let sections = stored.index.sections();
        let ends = sections.iter().flat_map(|(_, s)| [s.offset, s.offset + s.len]);
        let index = stored.index_range();
        let ends = ends.chain([0, 8, 16, 56, 64, index.start as u64, index.end as u64 - 1]);
        for len in ends {
            let len = usize::try_from(len).expect("small");
            fs::write(&path, &stored.bytes[..len]).expect("writable");
            for access in [Access::Map, Access::Read] {
                let error = NativeFile::open(&path, access).expect_err("cut short");
                assert!(error.to_string().starts_with(&*path.to_string_lossy()));
            }
        }
    }
}
