//! Small files that become very large: each fails by name within its budget, and nothing else is said of
//! files that fit.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fmt::Write as _;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use spherule_formats::{FrameError, FrameFile, MemoryBudget, RawParticles};
use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Far less than any of the bombs needs.
const BUDGET: MemoryBudget = MemoryBudget::new(8 << 20, "take care");

/// Bytes of a bomb once it is unpacked.
const LARGE: usize = 40 << 20;

fn gz(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}

struct Dir(TempDir);

impl Dir {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary directory"))
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).expect("writable");
        path
    }
}

fn read(path: &Path, budget: MemoryBudget) -> Result<RawParticles, FrameError> {
    FrameFile::open_within(path, budget)?.read(0)
}

/// The file cannot be read within [`BUDGET`], from the disk or from memory, and is small.
#[track_caller]
fn bomb(name: &str, bytes: &[u8], words: &str) {
    assert!(bytes.len() < LARGE / 40, "{name}: {} bytes", bytes.len());
    let dir = Dir::new();
    let path = dir.file(name, bytes);
    let in_memory = FrameFile::from_bytes_within(&path, bytes.to_vec(), BUDGET);
    let in_memory = in_memory.and_then(|file| file.read(0));
    for (from, result) in [("disk", read(&path, BUDGET)), ("memory", in_memory)] {
        let error = result.expect_err("a bomb");
        assert!(
            matches!(error, FrameError::TooLarge { .. }),
            "{from}: {error}"
        );
        let text = error.to_string();
        assert!(
            text.starts_with(&format!("{}: ", path.display())),
            "{from}: {text}"
        );
        assert!(
            text.contains(words) && text.ends_with("MiB; take care"),
            "{from}: {text}"
        );
    }
}

fn csv(bytes: usize) -> Vec<u8> {
    format!("x,y,z\n{}", "1,2,3\n".repeat(bytes / 6)).into_bytes()
}

#[test]
fn tables_in_gzip() {
    bomb("a.csv.gz", &gz(&csv(LARGE)), "larger than");
    bomb(
        "a.xyz.gz",
        &gz("1 2 3\n".repeat(LARGE / 6).as_bytes()),
        "larger than",
    );
    // The length at the end of the file is that of its last member.
    let members = [gz(&csv(LARGE)), gz(b"1,2,3\n")].concat();
    bomb("a.csv.gz", &members, "larger than");
    bomb(
        "a.csv.gz",
        &gz(&[csv(600), vec![b'1'; LARGE]].concat()),
        "larger than",
    );
    bomb(
        "a.csv.gz",
        &gz(&vec![b'1'; LARGE]),
        "decompressed it is larger than 4",
    );
    let empty = format!(
        "x,y,z{}\n{}",
        ",a".repeat(50),
        format!("1,2,3{}\n", ",".repeat(50)).repeat(1 << 19)
    );
    bomb("a.csv.gz", &gz(empty.as_bytes()), "larger than");
}

#[test]
fn other_formats_in_gzip() {
    let dump = |rows: &str, count: usize| {
        let head = format!("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{count}\nITEM: ATOMS x y z");
        format!("{head}\n{rows}").into_bytes()
    };
    let rows = "1 2 3\n";
    bomb(
        "dump.0.gz",
        &gz(&dump(&rows.repeat(LARGE / 6), LARGE / 6)),
        "decompressed it is",
    );
    // The text fits, its numbers do not.
    let count = 500_000;
    bomb(
        "dump.0.gz",
        &gz(&dump(&rows.repeat(count), count)),
        "in memory its numbers are",
    );
    let vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 9000000 float\n";
    bomb(
        "a.vtk.gz",
        &gz(format!("{vtk}{}", "1 ".repeat(LARGE / 2)).as_bytes()),
        "decompressed it is",
    );
    bomb("a.npy.gz", &gz(&npy(LARGE / 12)), "decompressed it is");
}

#[test]
fn gzip_in_gzip_is_not_unpacked() {
    let dir = Dir::new();
    // What is inside is too large as well.
    let inner: Vec<u8> = std::iter::repeat_n(gz(&csv(LARGE)), 400)
        .flatten()
        .collect();
    let path = dir.file("a.csv.gz", &gz(&inner));
    let error = read(&path, BUDGET).expect_err("refused").to_string();
    assert!(error.contains("gzip inside gzip"), "{error}");
}

fn npy(count: usize) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 3), }}\n");
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend(u16::try_from(header.len()).expect("short").to_le_bytes());
    file.extend(header.bytes());
    file.resize(file.len() + 12 * count, 0);
    file
}

fn npz(members: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        zip.start_file(format!("{name}.npy"), SimpleFileOptions::default())
            .expect("memory takes all");
        zip.write_all(bytes).expect("memory takes all");
    }
    zip.finish().expect("memory takes all").into_inner()
}

#[test]
fn members_of_archives() {
    let large = npy(LARGE / 12);
    bomb(
        "a.npz",
        &npz(&[("pos", &large)]),
        "npz member pos: decompressed it is",
    );
    // None alone is too large.
    let few = npy((2 << 20) / 12);
    let names = ["pos", "a", "b", "c", "d", "e", "f", "g"];
    let members: Vec<(&str, &[u8])> = names.iter().map(|name| (*name, few.as_slice())).collect();
    bomb("a.npz", &npz(&members), "decompressed it is");
}

#[test]
fn blocks_of_vtk_xml() {
    let vtu = |compressor: &str, block: &[u8], unpacked: usize| {
        let points = unpacked / 12;
        let head = format!(
            "<VTKFile type=\"PolyData\" compressor=\"{compressor}\"><PolyData>\
             <Piece NumberOfPoints=\"{points}\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" \
             format=\"appended\" offset=\"0\"/></Points></Piece></PolyData><AppendedData encoding=\"raw\">_"
        );
        let mut file = head.into_bytes();
        for number in [1, unpacked, 0, block.len()] {
            file.extend(u32::try_from(number).expect("short").to_le_bytes());
        }
        file.extend(block);
        file.extend(b"</AppendedData></VTKFile>");
        file
    };
    let len = LARGE / 12 * 12;
    let zeros = vec![0; len];
    let words = "decompressed its arrays are";
    bomb(
        "a.vtp",
        &vtu("vtkZLibDataCompressor", &zlib(&zeros), len),
        words,
    );
    bomb(
        "a.vtp",
        &vtu(
            "vtkLZ4DataCompressor",
            &lz4_flex::block::compress(&zeros),
            len,
        ),
        words,
    );
    // No more than its length counts before it is unpacked.
    let mut xz = b"\xfd7zXZ\0".to_vec();
    xz.resize(8192, 0);
    bomb("a.vtp", &vtu("vtkLZMADataCompressor", &xz, len), words);
}

/// Rows of which columns turn from integers to fractions and to text where `turn` says.
fn table(rows: usize, turn: usize) -> String {
    let mut text = String::from("# made by a test\nx;y;z;id;kind;v_x;v_y;v_z\n");
    for i in 0..rows {
        let number = i as f64 * 0.5;
        let id = if i < turn {
            i.to_string()
        } else {
            format!("{i}.5")
        };
        let kind = if i == turn { "fluid" } else { "7" };
        writeln!(text, "{number};{number};1e-3;{id};{kind};1;2;{i}").expect("memory takes all");
        if i % 1000 == 3 {
            text += "// a remark; between; rows\n\n";
        }
    }
    text
}

#[test]
fn tables_in_pieces_are_what_they_are_as_a_whole() {
    let dir = Dir::new();
    let rows = 150_000;
    for turn in [0, rows / 2, rows - 1, rows] {
        let text = table(rows, turn);
        let packed = [
            gz(&text.as_bytes()[..1 << 21]),
            gz(&text.as_bytes()[1 << 21..]),
        ]
        .concat();
        let plain = dir.file("a.csv", text.as_bytes());
        let gz = dir.file("b.csv.gz", &packed);
        let whole = FrameFile::from_bytes(&plain, text.clone().into_bytes());
        let expected = whole.and_then(|file| file.read(0)).expect("a table");
        assert_eq!(expected.positions.len(), rows);
        for path in [plain, gz] {
            let file = FrameFile::open(&path).expect("a table");
            assert!(file.bytes().len() < text.len(), "it is in pieces");
            assert!(file.read(0).expect("a table") == expected);
            assert_eq!(file.unpacked_len(), text.len() as u64);
            assert!(file.read(0).expect("once more") == expected);
        }
    }
}

#[test]
fn faults_in_pieces_are_told_at_their_place() {
    let dir = Dir::new();
    let text = table(150_000, 150_000);
    let at = text.len() - 100_000;
    let line = text[..at].rfind('\n').expect("a line") + 1;
    let harm = |place: usize, with: &str| {
        let mut text = text.clone();
        text.replace_range(place..place + with.len(), with);
        text
    };
    for bad in [
        harm(line, "?"),
        harm(line, ";;;;;;;"),
        text[..text.len() - 9].to_owned(),
    ] {
        let plain = dir.file("a.csv", bad.as_bytes());
        let whole = FrameFile::from_bytes(&plain, bad.clone().into_bytes());
        let expected = whole.and_then(|file| file.read(0)).expect_err("damaged");
        let found = FrameFile::open(&plain).and_then(|file| file.read(0));
        assert_eq!(
            found.expect_err("damaged").to_string(),
            expected.to_string()
        );
    }
    // A stream that breaks off, and one with something behind it.
    let packed = gz(text.as_bytes());
    let cut = dir.file("a.csv.gz", &packed[..packed.len() - 99]);
    let error = FrameFile::open(&cut)
        .and_then(|file| file.read(0))
        .expect_err("cut");
    assert!(error.to_string().contains("still being written"), "{error}");
    let more = dir.file("b.csv.gz", &[packed, b"junk".to_vec()].concat());
    let file = FrameFile::open(&more).expect("a table");
    assert!(file.notes().is_empty());
    file.read(0).expect("a table");
    assert_eq!(file.notes(), ["4 bytes after the gzip stream are ignored"]);
}
