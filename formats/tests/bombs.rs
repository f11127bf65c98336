//! Small files that expand to a large size: each fails within its budget with an error that names it. Files
//! that fit give their usual results.
//!
//! Texts are several times as large as the budget, or as the pieces in which they are read.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fmt::Write as _;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use flate2::write::{GzEncoder, ZlibEncoder};
use flate2::{Compression, Crc};
use spherule_formats::{FrameError, FrameFile, MemoryBudget, RawParticles};
use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Much less than any of the files needs.
const BUDGET: MemoryBudget = MemoryBudget::new(8 << 20, "take care");

/// Size of an expanded file, bytes.
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

/// Checks that the file is small and cannot be read within [`BUDGET`], neither from the disk nor from memory.
#[track_caller]
fn bomb(name: &str, bytes: &[u8], words: &str) {
    assert!(bytes.len() < LARGE / 40, "{name}: {} bytes", bytes.len());
    let dir = Dir::new();
    let path = dir.file(name, bytes);
    let in_memory =
        FrameFile::from_bytes_within(&path, bytes.to_vec(), BUDGET).and_then(|file| file.read(0));
    for (from, result) in [("disk", read(&path, BUDGET)), ("memory", in_memory)] {
        let error = result.expect_err("a bomb");
        assert!(matches!(error, FrameError::TooLarge { .. }), "{from}: {error}");
        let text = error.to_string();
        assert!(text.starts_with(&format!("{}: ", path.display())), "{from}: {text}");
        assert!(text.contains(words) && text.ends_with("MiB; take care"), "{from}: {text}");
    }
}

fn csv(bytes: usize) -> Vec<u8> {
    format!("x,y,z\n{}", "1,2,3\n".repeat(bytes / 6)).into_bytes()
}

#[test]
fn tables_in_gzip() {
    bomb("a.csv.gz", &gz(&csv(LARGE)), "larger than");
    bomb("a.xyz.gz", &gz("1 2 3\n".repeat(LARGE / 6).as_bytes()), "larger than");
    // The length at the end of the file is only that of its last member.
    let members = [gz(&csv(LARGE)), gz(b"1,2,3\n")].concat();
    bomb("a.csv.gz", &members, "larger than");
    bomb("a.csv.gz", &gz(&[csv(600), vec![b'1'; LARGE]].concat()), "larger than");
    bomb("a.csv.gz", &gz(&vec![b'1'; LARGE]), "decompressed it is larger than 4");
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
    // Texts with too many rows
    let rows = "1 2 3\n";
    let count = LARGE / 6;
    let rows_of = |head: String| gz((head + &rows.repeat(count)).as_bytes());
    bomb("dump.0.gz", &gz(&dump(&rows.repeat(count), count)), "larger than");
    bomb(
        "a.xyz.gz",
        &gz(format!("{count}\n\n{}", "H 1 2 3\n".repeat(count)).as_bytes()),
        "larger than",
    );
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
         property float z\nend_header\n"
    );
    bomb("a.ply.gz", &rows_of(ply), "larger than");
    let vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n";
    let points = format!("{vtk}POINTS {count} float\n");
    bomb("a.vtk.gz", &rows_of(points), "larger than");
    // The text fits, but its numbers do not.
    let few = 500_000;
    bomb("dump.0.gz", &gz(&dump(&rows.repeat(few), few)), "its numbers in memory are");
    // The list of steps is too large.
    bomb("dump.0.gz", &gz("ITEM: TIMESTEP\n".repeat(LARGE / 15).as_bytes()), "larger than");
    bomb("a.xyz.gz", &gz("0\n\n".repeat(LARGE / 3).as_bytes()), "larger than");
    // One line is too long.
    let line = "ITEM: ATOMS x".to_owned() + &" y".repeat(LARGE / 2);
    bomb("dump.0.gz", &gz(&dump(&line, 3)), "larger than");
    bomb("a.npy.gz", &gz(&npy(LARGE / 12)), "decompressed it is");
}

#[test]
fn huge_counts_in_gzip() {
    let dir = Dir::new();
    let rows = "1 2 3\n".repeat(500_000);
    let count = usize::MAX / 32;
    let vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n";
    let ply = "ply\nformat ascii 1.0\n";
    let properties = "property float x\nproperty float y\nproperty float z\nend_header\n";
    for (name, text, words) in [
        (
            "dump.0.gz",
            format!("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{count}\nITEM: ATOMS x y z\n{rows}"),
            "500000 lines follow",
        ),
        (
            "a.ply.gz",
            format!("{ply}element vertex {count}\n{properties}{rows}"),
            "file ends before",
        ),
        ("a.vtk.gz", format!("{vtk}POINTS {count} float\n{rows}"), "the text ends after 1500000"),
    ] {
        let path = dir.file(name, &gz(text.as_bytes()));
        let budget = MemoryBudget::new(64 << 20, "take care");
        let error = read(&path, budget).expect_err("absurd").to_string();
        assert!(error.contains(words), "{name}: {error}");
    }
}

/// Texts of `rows` particles in every format except tables, some with two steps, with numbers of many digits.
fn texts(rows: usize) -> [(&'static str, String); 4] {
    let zeros = "0".repeat(40);
    let row = |i: usize| format!("{zeros}{i}.25 {zeros}{}e-1 -{zeros}7", i * 3);
    let [mut dump, mut xyz] = [String::new(), String::new()];
    let mut points = String::new();
    for i in 0..rows {
        writeln!(points, "{}", row(i)).expect("memory takes all");
    }
    for step in 0..2 {
        write!(
            dump,
            "ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{rows}\nITEM: ATOMS x y z id element\n"
        )
        .expect("memory takes all");
        writeln!(xyz, "{rows}\nTime={step}.5").expect("memory takes all");
        for i in 0..rows {
            let text = row(i + step);
            writeln!(dump, "{text} {i} He").expect("memory takes all");
            writeln!(xyz, "He {text}").expect("memory takes all");
        }
    }
    let properties = "property float x\nproperty double y\nproperty float z\n";
    let ply = format!(
        "ply\nformat ascii 1.0\nelement camera 2\nproperty int a\nelement vertex {rows}\n\
         {properties}end_header\n1\n2\n\n{points}"
    );
    let vtk = format!(
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nFIELD FieldData 1\nTIME 1 1 double\n2.5\n\
         POINTS {rows} float\n{points}METADATA\nCOMPONENT_NAMES\nX\nY\nZ\n\nVERTICES 1 2\n1 0\n\
         POINT_DATA {rows}\nVECTORS velocity double\n{points}"
    );
    [("dump.0", dump), ("a.xyz", xyz), ("a.ply", ply), ("a.vtk", vtk)]
}

/// Reads all steps of the text.
fn all(file: Result<FrameFile, FrameError>) -> Result<Vec<RawParticles>, FrameError> {
    let file = file?;
    (0..file.steps().len()).map(|step| file.read(step)).collect()
}

#[test]
fn chunked_text_reads_as_whole_text() {
    let dir = Dir::new();
    for (name, text) in texts(30_000) {
        let whole = FrameFile::from_bytes(Path::new(name), text.clone().into_bytes());
        let expected = all(whole).expect(name);
        let plain = dir.file(name, text.as_bytes());
        let gz = dir.file(&format!("{name}.gz"), &gz(text.as_bytes()));
        for path in [plain, gz] {
            let file = FrameFile::open(&path).expect(name);
            assert!(file.bytes().len() < text.len(), "{name} is in pieces");
            // Read the steps forwards, backwards, and once more.
            let steps = 0..file.steps().len();
            for index in steps.clone().chain(steps.clone().rev()).chain(steps) {
                let particles = file.read(index).expect(name);
                assert_eq!(particles.positions.len(), 30_000);
                assert!(particles == expected[index], "{name} {index}");
            }
            assert_eq!(file.unpacked_len(), text.len() as u64, "{name}");
        }
    }
}

#[test]
fn texts_may_be_larger_than_the_budget() {
    let dir = Dir::new();
    let budget = MemoryBudget::new(12 << 20, "take care");
    for (name, text) in texts(90_000) {
        assert!(text.len() as u64 > budget.bytes(), "{name}: {}", text.len());
        let plain = dir.file(name, text.as_bytes());
        let gz = dir.file(&format!("{name}.gz"), &gz(text.as_bytes()));
        for path in [plain, gz] {
            let particles = read(&path, budget).expect(name);
            assert_eq!(particles.positions.len(), 90_000);
        }
    }
}

#[test]
fn errors_in_chunked_text_have_the_file_offset() {
    let dir = Dir::new();
    for (name, text) in texts(30_000) {
        // Damage one line, and truncate the text
        let at = text.len() - 100_000;
        let line = text[..at].rfind('\n').expect("a line") + 1;
        let mut word = text.clone();
        word.replace_range(line..line + 1, "?");
        let mut long = text.clone();
        long.insert_str(line, "1 2 3 4 5 6 7\n1\n");
        let cut = text[..text.len() - 9].to_owned();
        let half = text[..text.len() / 2].to_owned();
        for bad in [word, long, cut, half] {
            let whole = FrameFile::from_bytes(Path::new(name), bad.clone().into_bytes());
            let expected = all(whole).map_err(|e| e.to_string());
            let plain = dir.file(name, bad.as_bytes());
            let found = all(FrameFile::open(&plain))
                .map_err(|e| e.to_string().replace(&*plain.to_string_lossy(), name));
            assert!(found == expected, "{name}: {:?} {:?}", found.err(), expected.err());
        }
        // A truncated stream, a damaged checksum, and a stream with trailing bytes.
        let packed = gz(text.as_bytes());
        let path = dir.file(&format!("{name}.gz"), &packed[..packed.len() - 99]);
        let error = all(FrameFile::open(&path)).expect_err("cut").to_string();
        assert!(error.contains("still being written"), "{error}");
        let mut sum = packed.clone();
        let crc = sum.len() - 8;
        sum[crc] ^= 1;
        let path = dir.file(&format!("{name}.gz"), &sum);
        let error = all(FrameFile::open(&path)).expect_err("damaged").to_string();
        assert!(error.contains("damaged"), "{name}: {error}");
        let path = dir.file(&format!("{name}.gz"), &[packed, b"junk".to_vec()].concat());
        let file = FrameFile::open(&path).expect(name);
        file.read(0).expect(name);
        assert_eq!(file.notes(), ["4 bytes after the gzip stream are ignored"]);
    }
}

#[test]
fn gzip_in_gzip_is_not_unpacked() {
    let dir = Dir::new();
    // The decompressed content is too large as well.
    let inner: Vec<u8> = std::iter::repeat_n(gz(&csv(LARGE)), 400).flatten().collect();
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
    bomb("a.npz", &npz(&[("pos", &large)]), "npz member pos: decompressed it is");
    // No member alone is too large.
    let few = npy((2 << 20) / 12);
    let names = ["pos", "a", "b", "c", "d", "e", "f", "g"];
    let members: Vec<(&str, &[u8])> = names.iter().map(|name| (*name, few.as_slice())).collect();
    bomb("a.npz", &npz(&members), "decompressed it is");
}

/// Points of zeros as one block of `unpacked` bytes, or as several equal blocks.
fn vtp(compressor: &str, blocks: &[&[u8]], unpacked: usize) -> Vec<u8> {
    let points = blocks.len() * unpacked / 12;
    let head = format!(
        "<VTKFile type=\"PolyData\" compressor=\"{compressor}\"><PolyData>\
         <Piece NumberOfPoints=\"{points}\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" \
         format=\"appended\" offset=\"0\"/></Points></Piece></PolyData><AppendedData encoding=\"raw\">_"
    );
    let mut file = head.into_bytes();
    let lens = blocks.iter().map(|block| block.len());
    for number in [blocks.len(), unpacked, 0].into_iter().chain(lens) {
        file.extend(u32::try_from(number).expect("short").to_le_bytes());
    }
    file.extend(blocks.concat());
    file.extend(b"</AppendedData></VTKFile>");
    file
}

/// `bytes` as an xz stream with one uncompressed chunk and a dictionary of 2^`bits` bytes.
fn xz(bytes: &[u8], bits: u8) -> Vec<u8> {
    let crc = |bytes: &[u8]| {
        let mut crc = Crc::new();
        crc.update(bytes);
        crc.sum().to_le_bytes()
    };
    let with_crc = |bytes: &[u8]| [bytes, &crc(bytes)].concat();
    let flags = [0, 0];
    let head = [&b"\xfd7zXZ\0"[..], &with_crc(&flags)].concat();
    let block = with_crc(&[2, 0, 0x21, 1, 2 * (bits - 12), 0, 0, 0]);
    let len = u16::try_from(bytes.len() - 1).expect("short").to_be_bytes();
    let chunk = [&[1][..], &len, bytes, &[0]].concat();
    let padding = vec![0; chunk.len().next_multiple_of(4) - chunk.len()];
    let mut index = vec![0, 1];
    for mut number in [block.len() + chunk.len(), bytes.len()] {
        while number > 0x7f {
            index.push(0x80 | u8::try_from(number & 0x7f).expect("seven bits"));
            number >>= 7;
        }
        index.push(u8::try_from(number).expect("seven bits"));
    }
    index.resize(index.len().next_multiple_of(4), 0);
    let index = with_crc(&index);
    let words = u32::try_from(index.len() / 4 - 1).expect("short");
    let sizes = [&words.to_le_bytes()[..], &flags].concat();
    let foot = [&crc(&sizes)[..], &sizes, b"YZ"].concat();
    [head, block, chunk, padding, index, foot].concat()
}

#[test]
fn blocks_of_vtk_xml() {
    let len = LARGE / 12 * 12;
    let zeros = vec![0; len];
    let words = "decompressed its arrays are";
    let zlib = zlib(&zeros);
    bomb("a.vtp", &vtp("vtkZLibDataCompressor", &[&zlib], len), words);
    let lz4 = lz4_flex::block::compress(&zeros);
    bomb("a.vtp", &vtp("vtkLZ4DataCompressor", &[&lz4], len), words);
    // Before decompression, only the declared length is checked.
    let mut xz = b"\xfd7zXZ\0".to_vec();
    xz.resize(8192, 0);
    bomb("a.vtp", &vtp("vtkLZMADataCompressor", &[&xz], len), words);
}

#[test]
fn dictionaries_of_xz() {
    const LEN: usize = 12 << 10;
    let vtp = |block: &[u8], count: usize| vtp("vtkLZMADataCompressor", &vec![block; count], LEN);
    let dir = Dir::new();
    // Decoders of 4 MiB fit one at a time.
    for (bits, count) in [(12, 1), (20, 50), (22, 20)] {
        let path = dir.file("a.vtp", &vtp(&xz(&[0; LEN], bits), count));
        let particles = read(&path, BUDGET).expect("enough memory");
        assert_eq!(particles.positions.len(), count * LEN / 12);
    }
    for (bits, needed) in [(23, 9), (26, 65)] {
        let words = format!("needs {needed} MiB for its dictionary, which is larger than");
        bomb("a.vtp", &vtp(&xz(&[0; LEN], bits), 3), &words);
    }
    for budget in [BUDGET, MemoryBudget::UNLIMITED] {
        let path = dir.file("b.vtp", &vtp(&xz(&[0; LEN], 30), 1));
        let error = read(&path, budget).expect_err("absurd").to_string();
        let words = "needs 1025 MiB for its dictionary, presets of xz no more than 80 MiB";
        assert!(error.contains(words), "{error}");
    }
}

/// A table whose columns change from integers to fractions and to text at row `turn`.
fn table(rows: usize, turn: usize) -> String {
    let mut text = String::from("# made by a test\nx;y;z;id;kind;v_x;v_y;v_z\n");
    for i in 0..rows {
        let number = i as f64 * 0.5;
        let id = if i < turn { i.to_string() } else { format!("{i}.5") };
        let kind = if i == turn { "fluid" } else { "7" };
        writeln!(text, "{number};{number};1e-3;{id};{kind};1;2;{i}").expect("memory takes all");
        if i % 1000 == 3 {
            text += "// a note; between; rows\n\n";
        }
    }
    text
}

#[test]
fn chunked_tables_read_as_whole_tables() {
    let dir = Dir::new();
    let rows = 150_000;
    for turn in [0, rows / 2, rows - 1, rows] {
        let text = table(rows, turn);
        let packed = [gz(&text.as_bytes()[..1 << 21]), gz(&text.as_bytes()[1 << 21..])].concat();
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
fn errors_in_chunked_tables_have_the_file_offset() {
    let dir = Dir::new();
    let text = table(150_000, 150_000);
    let at = text.len() - 100_000;
    let line = text[..at].rfind('\n').expect("a line") + 1;
    let harm = |place: usize, with: &str| {
        let mut text = text.clone();
        text.replace_range(place..place + with.len(), with);
        text
    };
    for bad in [harm(line, "?"), harm(line, ";;;;;;;"), text[..text.len() - 9].to_owned()] {
        let plain = dir.file("a.csv", bad.as_bytes());
        let whole = FrameFile::from_bytes(&plain, bad.clone().into_bytes());
        let expected = whole.and_then(|file| file.read(0)).expect_err("damaged");
        let found = FrameFile::open(&plain).and_then(|file| file.read(0));
        assert_eq!(found.expect_err("damaged").to_string(), expected.to_string());
    }
    // A truncated stream, and a stream with trailing bytes.
    let packed = gz(text.as_bytes());
    let cut = dir.file("a.csv.gz", &packed[..packed.len() - 99]);
    let error = FrameFile::open(&cut).and_then(|file| file.read(0)).expect_err("cut");
    assert!(error.to_string().contains("still being written"), "{error}");
    let more = dir.file("b.csv.gz", &[packed, b"junk".to_vec()].concat());
    let file = FrameFile::open(&more).expect("a table");
    assert!(file.notes().is_empty());
    file.read(0).expect("a table");
    assert_eq!(file.notes(), ["4 bytes after the gzip stream are ignored"]);
}
