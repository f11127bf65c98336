//! Caches of Houdini and parts of DualSPHysics: damaged files with their errors, limits of memory, sequences.
//! `reference.rs` compares good files with what was written.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use spherule_formats::open::{detect_file, remarks};
use spherule_formats::sequence::PART_ATTRIBUTE;
use spherule_formats::{FrameError, FrameFile, MemoryBudget, Sequence, SequenceInput};

fn data(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("../tests/data").join(name)
}

/// What is done to a sample.
#[derive(Clone, Copy)]
enum Damage {
    /// Only the first bytes are left.
    Cut(usize),
    /// The last bytes are missing.
    Lose(usize),
    /// Other bytes in place of the first such bytes.
    Replace(&'static [u8], &'static [u8]),
    /// Other bytes at an offset.
    At(usize, &'static [u8]),
    /// Other bytes at an offset from the end.
    FromEnd(usize, &'static [u8]),
}
use Damage::{At, Cut, FromEnd, Lose, Replace};

impl Damage {
    fn of(self, name: &str) -> Vec<u8> {
        let mut bytes = fs::read(data(name)).expect("a sample");
        match self {
            Cut(len) => bytes.truncate(len),
            Lose(len) => bytes.truncate(bytes.len() - len),
            Replace(old, new) => {
                let place = bytes.windows(old.len()).position(|w| w == old);
                let at = place.expect("the bytes are in the sample");
                bytes.splice(at..at + old.len(), new.iter().copied());
            }
            At(at, new) => bytes[at..at + new.len()].copy_from_slice(new),
            FromEnd(at, new) => {
                let at = bytes.len() - at;
                bytes[at..at + new.len()].copy_from_slice(new);
            }
        }
        bytes
    }
}

/// The error of reading `bytes` as a file of this name; empty for none.
fn outcome(name: &str, bytes: Vec<u8>) -> String {
    let path = Path::new(name).file_name().expect("a file name");
    // The least that readers are called with
    let budget = MemoryBudget::new(64 << 20, "take care");
    let read =
        FrameFile::from_bytes_within(Path::new(path), bytes, budget).and_then(|file| file.read(0));
    match read {
        Ok(_) => String::new(),
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains(char::is_control), "{message}");
            let prefix = format!("{}: ", path.to_string_lossy());
            let what = message.strip_prefix(&prefix);
            what.expect("an error begins with the path").to_owned()
        }
    }
}

/// Compares the error of each line of a table.
#[track_caller]
fn check(name: &str, table: &[(Damage, &str)]) {
    let mut wrong = String::new();
    for (index, (damage, message)) in table.iter().enumerate() {
        let found = outcome(name, damage.of(name));
        if found != *message {
            wrong += &format!("\n{index}: {found}");
        }
    }
    assert!(wrong.is_empty(), "{name}:{wrong}");
}

#[test]
fn damaged_houdini_geometry() {
    check(
        "houdini/flip_12.bgeo",
        &[
            (Cut(3), "a"),
            (Lose(100), "b"),
            (At(5, b"\x05"), "c"),
            // A name that is not defined, a length of a reserved kind
            (Replace(b"&\x03", b"&\x63"), "d"),
            (Replace(b"\x0afileversion", b"\xf3fileversion"), "e"),
            (Replace(b"&\x02\x11\x19", b"&\x02\x11\xff"), "f"),
            (Replace(b"&\x02\x11\x19", b"&\x02\x13\xff\xff\xff\x7f"), "g"),
            (Replace(b"&\x02\x11\x19", b"&\x02\x30"), "h"),
            (Replace(b"fpreal32", b"fpreal99"), "i"),
            (Replace(b"\x01P&", b"\x01Q&"), "j"),
            (Replace(b"\x0bPolygon_run", b"\x0ePackedGeometry"), "k"),
            (Replace(b"numeric", b"numbers"), "l"),
            (Replace(b"\x12\x00\x04", b"\x12\x00\x00"), "m"),
            (
                Replace(b"@\x10\x01\x01\x00\x00\x00", b"@\x10\x02\x01\x00\x00\x00"),
                "n",
            ),
            (Replace(b"@\x19\x4b", b"@\x19\xf0"), "o"),
        ],
    );
    check(
        "houdini/pages.bgeo",
        &[
            (Replace(b"@\x21\x02\x03\x01", b"@\x21\x02\x03\x02"), "a"),
            (Replace(b"@\x21\x02\x03\x01", b"@\x21\x02\x04\x00"), "b"),
            (Replace(b"\x11\x1d", b"\x11\x1e"), "c"),
        ],
    );
}

#[test]
fn damaged_compressed_geometry() {
    check(
        "houdini/cache_0012.bgeo.sc",
        &[
            (Cut(10), "a"),
            (Cut(200), "b"),
            (Cut(12 + 4620), "c"),
            (Lose(30), "d"),
            (Lose(1), "e"),
            // Version, flags, lengths of the first frame
            (At(12, b"\x09"), "f"),
            (At(14, b"\x01"), "g"),
            (At(14, b"\x81"), "h"),
            (At(14, b"\x24"), "i"),
            (At(16, b"\xff\xff\xff\x7f"), "j"),
            (At(24, b"\xff\xff\xff\x7f"), "k"),
            (At(28, b"\xff\xff\xff\x7f"), "l"),
            (At(32, b"\xff\xff\xff\x7f"), "m"),
            (At(60, b"\xff\xff\xff\xff\xff\xff\xff\xff"), "n"),
            // Length of the index, of the last frame
            (FromEnd(5, b"\x07"), "o"),
            (FromEnd(13, b"\x07"), "p"),
            (
                Replace(b"scf1\0\0\0\0\0\0\0\0", b"scf1\0\0\0\0\0\xff\0\0"),
                "q",
            ),
        ],
    );
}

#[test]
fn damaged_dualsphysics_parts() {
    check(
        "dualsphysics/Part_0000.bi4",
        &[
            (Cut(30), "a"),
            (Cut(100), "b"),
            (Lose(5), "c"),
            (At(60, b"\x07"), "d"),
            (At(61, b"\x01"), "e"),
            (Replace(b"\nITEM\n", b"\nITEX\n"), "f"),
            (Replace(b"\nVALUES", b"\nVALVES"), "g"),
            (Replace(b"Npiece\x08", b"Npiece\x63"), "h"),
            (Replace(b"PART_0000", b"BART_0000"), "i"),
            (Replace(b"Npok", b"Npox"), "j"),
            (Replace(b"Npok\x08\0\0\0\x1e", b"Npok\x08\0\0\0\x1f"), "k"),
            (
                Replace(b"\x03\0\0\0Pos\0\0\0\0", b"\x03\0\0\0Pox\0\0\0\0"),
                "l",
            ),
            (
                Replace(b"Idp\0\0\0\0\x08\0\0\0\x1e", b"Idp\0\0\0\0\x08\0\0\0\x1f"),
                "m",
            ),
            (
                Replace(
                    b"Rhop\0\0\0\0\x0b\0\0\0\x1e\0\0\0\x78\0\0\0",
                    b"Rhop\0\0\0\0\x0b\0\0\0\0\0\0\x40\0\0\0\0",
                ),
                "n",
            ),
            (Replace(b"JPartDataBi4 ", b"JPartDataHead"), "o"),
        ],
    );
}

#[test]
fn bombs_are_refused_within_the_budget() {
    // Frames of zeros, each the same block: 48 MiB in some KiB
    let frame_len: u32 = 1 << 20;
    let block = lz4_zeros(frame_len as usize);
    let body_len = 4 + 4 + u32::try_from(block.len()).expect("small");
    let mut frame = vec![2, 1, 0x30, 1];
    for number in [frame_len, frame_len, 16 + body_len, 20, body_len - 8] {
        frame.extend(number.to_le_bytes());
    }
    frame.extend(block);
    let count = 48;
    let mut bytes = b"scf1\0\0\0\0\0\0\0\0".to_vec();
    bytes.extend(frame.repeat(count));
    for _ in 1..count {
        bytes.extend([0; 8]);
    }
    for number in [frame_len.into(), frame_len.into(), 8 * (count as u64 + 1)] {
        bytes.extend(u64::to_be_bytes(number));
    }
    bytes.extend(b"1fcs");
    assert!(bytes.len() < 1 << 18);
    let open = |budget| FrameFile::from_bytes_within(Path::new("a.xyz.sc"), bytes.clone(), budget);
    let error = open(MemoryBudget::new(32 << 20, "take care")).expect_err("a bomb");
    assert!(matches!(error, FrameError::TooLarge { .. }), "{error}");
    let text = error.to_string();
    assert!(
        text.ends_with("decompressed it is larger than 16 MiB; take care"),
        "{text}"
    );
    // Less than the decoder needs
    let error = open(MemoryBudget::new(1 << 20, "take care")).expect_err("a bomb");
    assert!(matches!(error, FrameError::TooLarge { .. }), "{error}");
    let file = open(MemoryBudget::UNLIMITED).expect("zeros");
    assert_eq!(file.bytes().len(), count << 20);
}

/// `len` zeros as an LZ4 block: a literal, and a match that repeats it.
fn lz4_zeros(len: usize) -> Vec<u8> {
    let mut block = vec![0x1f, 0, 1, 0];
    // The last five bytes are literals
    let mut more = len - 1 - 5 - 19;
    while more >= 255 {
        block.push(255);
        more -= 255;
    }
    block.push(u8::try_from(more).expect("less than 255"));
    block.extend([0x50, 0, 0, 0, 0, 0]);
    block
}

#[test]
fn names_and_content_tell_the_formats() {
    for (name, format) in [
        ("houdini/flip_12.bgeo", "houdini"),
        ("houdini/cache_0012.bgeo.sc", "houdini"),
        ("houdini/pages.bgeo", "houdini"),
        ("public_partio/test.bgeo", "bgeo"),
        ("dualsphysics/Part_0000.bi4", "bi4"),
    ] {
        assert_eq!(detect_file(&data(name)).expect(name).name(), format);
    }
    let error = detect_file(&data("dualsphysics/Part_Head.ibi4")).expect_err("no particles");
    assert!(error.to_string().contains("JPartDataHead"), "{error}");
    let notes = remarks(&data("houdini/cache_0012.bgeo.sc"));
    assert_eq!(notes[0], "geometry of Houdini 20.0.547");
}

#[test]
fn files_make_sequences_by_number() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let copy = |from: &str, to: &str| {
        fs::copy(data(from), directory.path().join(to)).expect("writable");
    };
    for number in [9, 10, 12] {
        copy(
            "houdini/split.bgeo.sc",
            &format!("fluid.{number:04}.bgeo.sc"),
        );
    }
    let numbers = |input: &SequenceInput| -> Vec<i64> {
        let sequence = Sequence::open(input).expect("a sequence");
        sequence.frames().iter().map(|frame| frame.number).collect()
    };
    let input = SequenceInput::from_path(directory.path());
    assert_eq!(numbers(&input), [9, 10, 12]);
    // Other files of DualSPHysics are beside the parts
    let parts = data("dualsphysics").join("Part_####.bi4");
    assert_eq!(numbers(&SequenceInput::from_path(parts)), [0, 1]);
}

#[test]
fn pieces_of_a_time_step_are_one_frame() {
    let input = SequenceInput::from_path(data("dualsphysics").join("Part_p*_#.bi4"));
    let sequence = Sequence::open(&input).expect("a sequence");
    assert_eq!(sequence.frames().len(), 1);
    let particles = sequence.load_raw(0).expect("two pieces");
    assert_eq!(particles.positions.len(), 30);
    let part = particles
        .attributes
        .iter()
        .find(|a| a.name == PART_ATTRIBUTE);
    assert!(part.is_some());
}
