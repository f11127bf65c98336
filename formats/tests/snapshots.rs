//! Snapshots of GADGET that are divided among several files.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::Path;

use spherule_formats::sequence::PART_ATTRIBUTE;
use spherule_formats::{RawParticles, Sequence, SequenceInput};

/// The pieces with these names in a new directory: each has three particles, and says that there are three of them.
fn pieces(names: &[&str]) -> tempfile::TempDir {
    let seed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/gadget/little-format1");
    let mut bytes = fs::read(seed).expect("a snapshot");
    bytes[128..132].copy_from_slice(&3_i32.to_le_bytes());
    let dir = tempfile::tempdir().expect("a directory");
    for name in names {
        fs::write(dir.path().join(name), &bytes).expect("writable");
    }
    dir
}

/// The frame of `input`, which has one, and the notes; or the error.
fn frame(input: SequenceInput) -> Result<(RawParticles, String), String> {
    let sequence = Sequence::open(&input).expect("a sequence");
    assert_eq!(sequence.frames().len(), 1);
    assert_eq!(sequence.frames()[0].number, 7);
    let particles = sequence.load_raw(0).map_err(|error| error.to_string())?;
    Ok((particles, sequence.notes().join("; ")))
}

#[test]
fn pieces_of_a_binary_snapshot_are_one_frame() {
    let dir = pieces(&["snap_007.0", "snap_007.1", "snap_007.2"]);
    for input in [
        SequenceInput::Directory(dir.path().into()),
        SequenceInput::Pattern(dir.path().join("snap_#.*")),
        SequenceInput::Files((0..3).map(|n| dir.path().join(format!("snap_007.{n}"))).collect()),
    ] {
        let (particles, notes) = frame(input).expect("three pieces");
        assert_eq!(particles.positions.len(), 9);
        let part = particles.attributes.iter().find(|a| a.name == PART_ATTRIBUTE).expect("types");
        let types: Vec<f64> = (0..9).map(|index| part.data.get_f64(index)).collect();
        assert_eq!(types, [0.0, 0.0, 1.0].repeat(3));
        assert!(!notes.contains("belongs to a step"), "{notes}");
    }
}

#[test]
fn a_missing_piece_is_named() {
    for (names, missing) in [
        (&["snap_007.0", "snap_007.2"][..], "snap_007.1"),
        (&["snap_007.1", "snap_007.2"], "snap_007.0"),
        (&["snap_007.0"], "snap_007.1"),
        (&["snap_007.00", "snap_007.02"], "snap_007.01"),
        // Numbers from 1 on
        (&["snap_007.1", "snap_007.2", "snap_007.3"], ""),
    ] {
        let dir = pieces(names);
        let found = frame(SequenceInput::Directory(dir.path().into()));
        if missing.is_empty() {
            assert!(found.is_ok(), "{names:?}");
            continue;
        }
        let error = found.expect_err("a piece is missing");
        assert!(error.contains(&format!("{missing}: does not exist; ")), "{error}");
        assert!(error.contains("its step has 3 files"), "{error}");
    }
}

#[test]
fn a_piece_may_be_read_alone() {
    let dir = pieces(&["snap_007.0", "snap_007.1"]);
    let alone = || SequenceInput::Files(vec![dir.path().join("snap_007.1")]);
    // Frames of a single file have its last number
    let sequence = Sequence::open(&alone()).expect("a piece");
    let particles = sequence.load_raw(0).expect("readable");
    assert_eq!(particles.positions.len(), 3);
    let notes = sequence.notes().join("; ");
    assert!(notes.contains("of 3 files, but only 1 of them is used"), "{notes}");
    // Others exist that the pattern leaves out
    fs::copy(dir.path().join("snap_007.0"), dir.path().join("snap_007.2")).expect("a copy");
    let pattern = SequenceInput::Pattern(dir.path().join("snap_#.0"));
    let (particles, notes) = frame(pattern).expect("readable");
    assert_eq!(particles.positions.len(), 3);
    assert!(notes.contains("only 1 of them is used"), "{notes}");
}
