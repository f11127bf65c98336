//! Caches of Houdini and parts of DualSPHysics: damaged files with their errors, limits of memory, sequences.
//! `reference.rs` compares good files with what was written.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use spherule_formats::open::{detect_file, notes};
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
            (Cut(3), "byte 0: named like a bgeo file, but does not begin like one: bytes 7f 4e 53"),
            (
                Lose(100),
                "byte 2352: 11 bytes expected here, file has 2 left: the file is cut short, perhaps still being written",
            ),
            (
                At(5, b"\x05"),
                "byte 5: 0x05 is not a token of binary JSON: the file is damaged here",
            ),
            // A name that is not defined, a length of a reserved kind
            (
                Replace(b"&\x03", b"&\x63"),
                "byte 63: the name 99 is not defined: the file is damaged here",
            ),
            (
                Replace(b"\x0bfileversion", b"\xf3fileversion"),
                "byte 8: 0xf3 does not begin a length: the file is damaged here",
            ),
            // The number of points
            (Replace(b"&\x03\x11\x19", b"&\x03\x11\xff"), "byte 64: the count -1"),
            (
                Replace(b"&\x03\x11\x19", b"&\x03\x13\xff\xff\xff\x7f"),
                "byte 561: attribute `P` has 75 numbers, which do not fit 2147483647 points of 3 components",
            ),
            (
                Replace(b"&\x03\x11\x19", b"&\x03\x30"),
                "byte 64: a count expected here: the file is damaged here",
            ),
            (Replace(b"pointcount", b"pointcourt"), "byte 2454: the file has no number of points"),
            (Replace(b"fpreal32", b"fpreal99"), "byte 558: numbers of the unknown type `fpreal99`"),
            (
                Replace(b"\x01P&", b"\x01Q&"),
                "byte 2454: the points have no positions (attribute P)",
            ),
            (
                Replace(b"\x0bPolygon_run", b"\x0ePackedGeometry"),
                "geometry with packed primitives (PackedGeometry), whose points are not read; unpack it in Houdini before \
                 it is saved (Unpack node)",
            ),
            (
                Replace(b"numeric", b"numbers"),
                "byte 2454: the points have no positions (attribute P)",
            ),
            // Length, flags and numbers of pages
            (
                Replace(b"\x12\x00\x04", b"\x12\x00\x00"),
                "byte 558: attribute `P` has pages of 0 points",
            ),
            (
                Replace(b"@\x10\x01\x01\0\0\0", b"@\x10\x02\x01\0\0\0"),
                "byte 1356: attribute `pscale` does not have a flag for each of its 1 pages",
            ),
            (
                Replace(b"@\x19\x01", b"@\x19\xf0"),
                "byte 2319: a name expected here: the file is damaged here",
            ),
            (
                Replace(b"&\x1b@\x19\x4b", b"&\x1b@\x77\x4b"),
                "byte 559: an array of elements of the unknown type 0x77",
            ),
        ],
    );
    check(
        "houdini/pages.bgeo",
        &[
            (
                Replace(b"@\x21\x02\x03\x01", b"@\x21\x02\x03\x02"),
                "byte 584: the packing of attribute `P` is not that of 4 components",
            ),
            (
                Replace(b"@\x21\x02\x03\x01", b"@\x21\x02\x04\x00"),
                "byte 584: the packing of attribute `P` is not that of 4 components",
            ),
            (
                Replace(b"\x11\x1d", b"\x11\x1e"),
                "byte 584: attribute `P` has 102 numbers, which do not fit 30 points of 4 components",
            ),
        ],
    );
}

#[test]
fn damaged_compressed_geometry() {
    check(
        "houdini/cache_0012.bgeo.sc",
        &[
            (
                Cut(10),
                "byte 0: the blosc stream ends early here; perhaps it is still being written",
            ),
            (
                Cut(200),
                "byte 0: the blosc stream ends early here; perhaps it is still being written",
            ),
            (
                Cut(12 + 4620),
                "byte 16384: the blosc stream ends early here; perhaps it is still being written",
            ),
            (
                Lose(30),
                "byte 89980: the blosc stream ends early here; perhaps it is still being written",
            ),
            (
                Lose(1),
                "byte 89980: the blosc stream ends early here; perhaps it is still being written",
            ),
            // Version, flags, lengths of the first frame
            (
                At(12, b"\x09"),
                "byte 0: the blosc stream is damaged: what follows its frames is neither a frame nor the index",
            ),
            (
                At(14, b"\x01"),
                "its blosc frames are compressed with BloscLZ, which is not read; compress it with LZ4, as `hsc` of Houdini does",
            ),
            (
                At(14, b"\x81"),
                "its blosc frames are compressed with zstd, which is not read; compress it with LZ4, as `hsc` of Houdini does",
            ),
            (
                At(14, b"\x24"),
                "its blosc frames are shuffled by bits, which is not read; compress it with LZ4, as `hsc` of Houdini does",
            ),
            (
                At(16, b"\xff\xff\xff\x7f"),
                "its blosc stream needs more memory to be decompressed than is allowed; compress it with a smaller window or dictionary, or allow more",
            ),
            (
                At(24, b"\xff\xff\xff\x7f"),
                "byte 0: the blosc stream is damaged: a frame is longer than its content",
            ),
            (
                At(28, b"\xff\xff\xff\x7f"),
                "byte 0: the blosc stream is damaged: a block is outside its frame",
            ),
            (
                At(32, b"\xff\xff\xff\x7f"),
                "byte 0: the blosc stream is damaged: a block ends within a stream",
            ),
            (
                At(60, b"\xff\xff\xff\xff\xff\xff\xff\xff"),
                "byte 104: 0xff is not a token of binary JSON: the file is damaged here",
            ),
            // Length of the index, of the last frame
            (
                FromEnd(5, b"\x07"),
                "byte 89980: the blosc stream is damaged: what follows its frames is neither a frame nor the index",
            ),
            (
                FromEnd(13, b"\x07"),
                "byte 89980: the blosc stream is damaged: its frames have another length than the index states",
            ),
            (
                Replace(b"scf1\0\0\0\0\0\0\0\0", b"scf1\0\0\0\0\0\xff\0\0"),
                "byte 0: the blosc stream ends early here; perhaps it is still being written",
            ),
        ],
    );
}

#[test]
fn damaged_dualsphysics_parts() {
    check(
        "dualsphysics/Part_0000.bi4",
        &[
            (
                Cut(30),
                "byte 0: 60 bytes expected here, file has 30 left: the file is cut short, perhaps still being written",
            ),
            (
                Cut(100),
                "byte 94: 8 bytes expected here, file has 6 left: the file is cut short, perhaps still being written",
            ),
            (
                Lose(5),
                "byte 2037: 120 bytes expected here, file has 115 left: the file is cut short, perhaps still being written",
            ),
            (At(60, b"\x07"), "byte 60: the byte order 7 is not known: the file is damaged here"),
            (At(61, b"\x01"), "byte 60: the byte order 0 is not known: the file is damaged here"),
            (
                Replace(b"\nITEM\n", b"\nITEX\n"),
                "byte 68: ITEM expected here: the file is damaged here",
            ),
            (
                Replace(b"\nVALUES", b"\nVALVES"),
                "byte 131: VALUES expected here: the file is damaged here",
            ),
            (
                Replace(b"Npiece\x08", b"Npiece\x63"),
                "byte 173: the type 99 is not known: the file is damaged here",
            ),
            (
                Replace(b"PART_0000", b"BART_0000"),
                "byte 2157: the file has no item PART_####, and no particles",
            ),
            (Replace(b"Npok", b"Npox"), "byte 752: the item has no number of particles (Npok)"),
            (
                Replace(b"Npok\x08\0\0\0\x1e", b"Npok\x08\0\0\0\x1f"),
                "byte 1085: the array `Idp` has 30 elements of 31 particles",
            ),
            (
                Replace(b"\x03\0\0\0Pos\0\0\0\0", b"\x03\0\0\0Pox\0\0\0\0"),
                "byte 752: the item has no positions (Pos or Posd)",
            ),
            (
                Replace(b"Idp\0\0\0\0\x08\0\0\0\x1e", b"Idp\0\0\0\0\x08\0\0\0\x1f"),
                "byte 1073: the array `Idp` of 31 elements has 120 bytes: the file is damaged here",
            ),
            (
                Replace(
                    b"Rhop\0\0\0\0\x0b\0\0\0\x1e\0\0\0\x78\0\0\0",
                    b"Rhop\0\0\0\0\x0b\0\0\0\0\0\0\x40\0\0\0\0",
                ),
                "byte 2025: the array `Rhop` of 1073741824 elements has 0 bytes: the file is damaged here",
            ),
            (
                Replace(b"JPartDataBi4 ", b"JPartDataHead"),
                "a DualSPHysics file of JPartDataHead, which has no particles of a time step; give the files Part_####.bi4",
            ),
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
    assert!(text.ends_with("decompressed it is larger than 16 MiB; take care"), "{text}");
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
    let notes = notes(&data("houdini/cache_0012.bgeo.sc"));
    assert_eq!(notes[0], "geometry of Houdini 20.0.547");
}

#[test]
fn files_make_sequences_by_number() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let copy = |from: &str, to: &str| {
        fs::copy(data(from), directory.path().join(to)).expect("writable");
    };
    for number in [9, 10, 12] {
        copy("houdini/split.bgeo.sc", &format!("fluid.{number:04}.bgeo.sc"));
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
    let part = particles.attributes.iter().find(|a| a.name == PART_ATTRIBUTE);
    assert!(part.is_some());
}
