//! Targets behind a checksum, which mutation alone would never get past: the archive and the gzip
//! stream are made here, around bytes that the fuzzer may change freely.

use std::io::{Cursor, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use spherule_formats::read;
use spherule_formats::{FrameError, FrameFile, MemoryBudget};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::{DEFLATE_RATIO, check_message, check_particles, prepare, read_all};

/// Names that mean something to the reader; the byte before an array picks one.
const MEMBERS: [&str; 8] = ["positions", "x", "y", "z", "time", "velocity", "id", "meta"];
/// Set in that byte: the member is deflated, not stored.
const DEFLATED: u8 = 0x10;
const NUMPY: &[u8] = b"\x93NUMPY";

/// An NPZ: the bytes as they are if they begin like a zip archive, else the arrays among them,
/// each with a byte before it with name and compression.
pub fn npz(bytes: &[u8]) -> usize {
    if bytes.starts_with(b"PK") {
        return read_all(read::npy::NPZ, bytes, DEFLATE_RATIO);
    }
    read_all(read::npy::NPZ, &archive(bytes), DEFLATE_RATIO)
}

fn archive(bytes: &[u8]) -> Vec<u8> {
    let starts: Vec<usize> = bytes
        .windows(NUMPY.len())
        .enumerate()
        .filter(|(at, window)| *at > 0 && *window == NUMPY)
        .map(|(at, _)| at)
        .collect();
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (number, start) in starts.iter().enumerate() {
        // The byte before the next array is that array's.
        let end = starts.get(number + 1).map_or(bytes.len(), |next| next - 1);
        let tag = bytes[start - 1];
        let method = match tag & DEFLATED {
            0 => CompressionMethod::Stored,
            _ => CompressionMethod::Deflated,
        };
        let options = SimpleFileOptions::default().compression_method(method);
        let name = MEMBERS[usize::from(tag) % MEMBERS.len()];
        // A name that was there before is refused by the writer; the reader has targets for that.
        if zip.start_file(format!("{name}.npy"), options).is_ok() {
            zip.write_all(&bytes[*start..end.max(*start)]).expect("memory takes all");
        }
    }
    zip.finish().expect("memory takes all").into_inner()
}

/// File names that promise something, or nothing; the first byte picks one.
const NAMES: [&str; 12] = [
    "a", "a.vtk", "a.vtu", "a.bgeo", "a.ply", "a.xyz", "dump.7", "a.npy", "a.npz", "a.csv",
    "a.spf", "a.bin",
];

/// Compressed files: the first byte picks a format and says whether a signature goes before the rest, so that most
/// inputs reach a decoder. What can be decompressed is detected and read.
pub fn compressed(bytes: &[u8]) -> usize {
    let Some((choice, bytes)) = bytes.split_first() else {
        return 0;
    };
    let signature = SIGNATURES[usize::from(choice >> 1) % SIGNATURES.len()];
    let bytes = match choice & 1 {
        0 => bytes.to_vec(),
        _ => [signature, bytes].concat(),
    };
    let budget = MemoryBudget::new(DECOMPRESSED, "get more");
    match FrameFile::from_bytes_within(Path::new("a.xyz"), bytes, budget) {
        Ok(file) => {
            assert!(file.bytes().len() as u64 <= DECOMPRESSED);
            file.notes().iter().for_each(|note| check_message(note));
            usize::from(file.read(0).is_ok())
        }
        Err(error) => {
            check_message(&error.to_string());
            0
        }
    }
}

/// Geometry of Houdini, in which a few numbers may stand for pages of points. Any bytes are understood.
pub fn houdini(bytes: &[u8]) -> usize {
    let budget = MemoryBudget::new(DECOMPRESSED, "get more");
    match FrameFile::from_bytes_within(Path::new("a.bgeo"), bytes.to_vec(), budget) {
        Ok(file) if !file.steps().is_empty() => match file.read(0) {
            Ok(particles) => {
                check_particles(&particles, DECOMPRESSED);
                prepare(particles);
                1
            }
            Err(error) => {
                check_message(&error.to_string());
                0
            }
        },
        Ok(_) => 0,
        Err(error) => {
            check_message(&error.to_string());
            0
        }
    }
}

/// Beginnings of compressed files.
const SIGNATURES: [&[u8]; 7] = [
    b"\x1f\x8b\x08\0",
    b"\x28\xb5\x2f\xfd",
    b"BZh91AY&SY",
    b"\xfd7zXZ\0",
    b"\x04\x22\x4d\x18",
    b"PK\x03\x04",
    b"scf1\0\0\0\0\0\0\0\0",
];

/// Most bytes that an input may become.
const DECOMPRESSED: u64 = 32 << 20;

/// Detection and gzip: the first byte picks a name, the others are the file. The same bytes in gzip
/// must be understood alike.
pub fn open(bytes: &[u8]) -> usize {
    let Some((name, bytes)) = bytes.split_first() else {
        return 0;
    };
    let path = Path::new(NAMES[usize::from(*name) % NAMES.len()]);
    let plain = opened(path, bytes.to_vec());
    // What is compressed already would be compressed twice
    if !SIGNATURES.iter().any(|signature| bytes.starts_with(&signature[..2]))
        && !is_skippable(bytes)
    {
        match (&plain, &opened(path, gzip(bytes))) {
            (Ok(a), Ok(b)) => {
                assert_eq!(a.bytes(), b.bytes());
                assert_eq!((a.format(), a.steps()), (b.format(), b.steps()));
            }
            (Err(a), Err(b)) => assert_eq!(a.to_string(), b.to_string()),
            (a, b) => panic!("plain {a:?}, in gzip {b:?}"),
        }
    }
    plain.map_or(0, |file| usize::from(read_first(&file)))
}

/// Whether `bytes` begin with a frame that zstd and LZ4 skip.
fn is_skippable(bytes: &[u8]) -> bool {
    bytes.get(1..4) == Some(b"\x2a\x4d\x18")
}

fn opened(path: &Path, bytes: Vec<u8>) -> Result<FrameFile, FrameError> {
    let opened = FrameFile::from_bytes(path, bytes);
    match &opened {
        Ok(file) => file.notes().iter().for_each(|note| check_message(note)),
        Err(error) => check_message(&error.to_string()),
    }
    opened
}

/// True if the file has a step and its first can be read.
fn read_first(file: &FrameFile) -> bool {
    if file.steps().is_empty() {
        return false;
    }
    match file.read(0) {
        Ok(particles) => {
            check_particles(&particles, file.bytes().len() as u64 * super::XZ_RATIO);
            prepare(particles);
            true
        }
        Err(error) => {
            check_message(&error.to_string());
            false
        }
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}
