//! Compressed files of other programs (`tests/data/compressed`): each reads as the plain file, damage and bombs are
//! refused.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use spherule_formats::open::{detect_file, unpacked_len};
use spherule_formats::{
    FrameError, FrameFile, MemoryBudget, RawParticles, Sequence, SequenceInput,
};

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/compressed")
}

fn bytes_of(name: &str) -> Vec<u8> {
    fs::read(directory().join(name)).expect("a file of the repository")
}

/// Compressed copies of `drop.csv`.
const COPIES: [&str; 16] = [
    "drop.csv.gz",
    "drop.csv.zst",
    "drop-plain.csv.zst",
    "drop-frames.csv.zst",
    "drop.csv.bz2",
    "drop-streams.csv.bz2",
    "drop.csv.xz",
    "drop-sha256.csv.xz",
    "drop-none.csv.xz",
    "drop-streams.csv.xz",
    "drop.csv.lz4",
    "drop-linked.csv.lz4",
    "drop-frames.csv.lz4",
    "drop.csv.zip",
    "drop-stored.zip",
    "drop.csv",
];

/// Copies without a checksum of the content, in which changed bytes may pass.
const UNCHECKED: [&str; 5] =
    ["drop-plain.csv.zst", "drop-none.csv.xz", "drop.csv.lz4", "drop-frames.csv.lz4", "drop.csv"];

fn read(path: &Path) -> Result<RawParticles, FrameError> {
    FrameFile::open(path)?.read(0)
}

fn read_bytes(name: &str, bytes: &[u8]) -> Result<RawParticles, FrameError> {
    FrameFile::from_bytes(Path::new(name), bytes.to_vec())?.read(0)
}

#[test]
fn copies_read_as_the_plain_file() {
    let plain = read(&directory().join("drop.csv")).expect("a table");
    let text = bytes_of("drop.csv");
    assert_eq!(plain.positions.len(), 7000);
    for name in COPIES {
        let path = directory().join(name);
        assert!(read(&path).expect(name) == plain, "{name} from the disk");
        let file = FrameFile::from_bytes(&path, bytes_of(name)).expect(name);
        assert!(file.bytes() == text, "{name} from memory");
        assert!(file.notes().is_empty(), "{name}: {:?}", file.notes());
        assert_eq!(detect_file(&path).expect(name).name(), "csv");
        let sequence = Sequence::open(&SequenceInput::from_path(&path)).expect(name);
        assert!(sequence.load_raw(0).expect(name) == plain, "{name}");
        // An estimate, and the length of the text for small files
        let len = unpacked_len(&path).expect(name);
        assert_eq!(len, text.len() as u64, "{name}");
    }
}

#[test]
fn names_without_compression_make_sequences() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for (index, extension) in ["gz", "zst", "bz2", "xz", "lz4", "zip"].into_iter().enumerate() {
        let name = format!("drop_{index}.csv.{extension}");
        let bytes = bytes_of(&format!("drop.csv.{extension}"));
        fs::write(directory.path().join(name), bytes).expect("writable");
    }
    let input = SequenceInput::from_path(directory.path());
    let sequence = Sequence::open(&input).expect("one sequence");
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [0, 1, 2, 3, 4, 5]);
}

#[test]
fn truncated_copies_are_detected() {
    let plain = bytes_of("drop.csv");
    for name in COPIES {
        if name == "drop.csv" {
            continue;
        }
        let bytes = bytes_of(name);
        let step = (bytes.len() / 97).max(1);
        for len in (40..bytes.len()).step_by(step).chain([bytes.len() - 1]) {
            let Err(error) = read_bytes(name, &bytes[..len]) else {
                // Between two streams, and where only padding or frames to skip are missing
                let file = FrameFile::from_bytes(Path::new(name), bytes[..len].to_vec())
                    .expect("was read");
                let has_several = name.contains("frames") || name.contains("streams");
                let is_between = has_several && plain.starts_with(file.bytes());
                let is_complete = file.bytes() == plain;
                assert!(is_between || is_complete, "{name} of {len} bytes was read");
                continue;
            };
            let text = error.to_string();
            let is_zip = name.ends_with("zip");
            assert!(
                is_zip || text.contains("perhaps it is still being written"),
                "{name} of {len} bytes: {text}"
            );
        }
    }
}

#[test]
fn changed_bytes_are_detected() {
    let plain = bytes_of("drop.csv");
    for name in COPIES {
        if UNCHECKED.contains(&name) {
            continue;
        }
        let bytes = bytes_of(name);
        let step = (bytes.len() / 211).max(1);
        for at in (0..bytes.len()).step_by(step) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            // Some bytes of headers mean nothing: names, times, padding, the operating system
            if let Ok(file) = FrameFile::from_bytes(Path::new(name), changed) {
                let is_first = plain.starts_with(file.bytes()) && !file.notes().is_empty();
                assert!(file.bytes() == plain || is_first, "{name}: byte {at} may change");
            }
        }
    }
}

#[test]
fn bombs_are_refused_within_the_budget() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for extension in ["zst", "bz2", "xz", "lz4", "zip"] {
        let name = format!("bomb.xyz.{extension}");
        let packed = bytes_of(&format!("{name}.gz"));
        let mut bytes = Vec::new();
        let unpacked = GzDecoder::new(&packed[..]).read_to_end(&mut bytes);
        unpacked.expect("gzip");
        let path = directory.path().join(&name);
        fs::write(&path, &bytes).expect("writable");
        let budget = MemoryBudget::new(32 << 20, "take care");
        let in_memory = FrameFile::from_bytes_within(&path, bytes, budget);
        let on_disk = FrameFile::open_within(&path, budget);
        for result in [in_memory, on_disk] {
            let error = result.expect_err("a bomb");
            assert!(matches!(error, FrameError::TooLarge { .. }), "{error}");
            let text = error.to_string();
            assert!(text.ends_with("decompressed it is larger than 16 MiB; take care"), "{text}");
        }
        // Less than the decoder needs
        let little = MemoryBudget::new(100 << 10, "take care");
        let error = FrameFile::open_within(&path, little).expect_err("a bomb");
        assert!(matches!(error, FrameError::TooLarge { .. }), "{error}");
    }
}

#[test]
fn archives_of_several_files_name_them() {
    let error = read(&directory().join("several.zip")).expect_err("several");
    let text = error.to_string();
    let names = "drop_0.csv, drop_1.csv, drop_2.csv, drop_3.csv, drop_4.csv and 2 more";
    let expected =
        format!("a zip archive of several files ({names}), which is not read; unpack it");
    assert!(text.contains(&expected), "{text}");
}

#[test]
fn other_bytes_after_a_stream_are_reported() {
    for (extension, format) in [("zst", "zstd"), ("bz2", "bzip2"), ("xz", "xz"), ("lz4", "LZ4")] {
        let name = format!("drop.csv.{extension}");
        let junk = [bytes_of(&name), b"junk".to_vec()].concat();
        let file = FrameFile::from_bytes(Path::new(&name), junk).expect("ignored");
        let note = format!("4 bytes after the {format} stream are ignored");
        assert_eq!(file.notes(), [note]);
        let zeros = [bytes_of(&name), vec![0; 512]].concat();
        let file = FrameFile::from_bytes(Path::new(&name), zeros).expect("padding");
        assert!(file.notes().is_empty());
    }
}

#[test]
fn compression_in_compression_is_refused() {
    let inner = bytes_of("drop.csv.zst");
    let mut outer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut outer, &inner).expect("memory takes all");
    let outer = outer.finish().expect("memory takes all");
    let error = read_bytes("a.csv.gz", &outer).expect_err("refused").to_string();
    assert!(error.contains("zstd inside another compression"), "{error}");
}
