//! Memory and compression.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use spherule_formats::mesh::{parse_mesh, read_mesh};
use spherule_formats::{FrameError, MemoryBudget, ParseError};

use crate::make;

/// A grid of `n` by `n` quads as OBJ.
fn grid(n: usize) -> String {
    let mut text = String::new();
    for i in 0..=n {
        for j in 0..=n {
            text += &format!("v {i} {j} 0\n");
        }
    }
    for i in 0..n {
        for j in 0..n {
            let a = i * (n + 1) + j + 1;
            text += &format!("f {a} {} {} {}\n", a + 1, a + n + 2, a + n + 1);
        }
    }
    text
}

#[test]
fn gzip_is_unpacked() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for (name, extension, bytes) in make::whole() {
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(&bytes).expect("memory takes all");
        let path = directory.path().join(format!("{name}.{extension}.gz"));
        fs::write(&path, packed.finish().expect("memory takes all")).expect("writable");
        let mesh = read_mesh(&path, MemoryBudget::UNLIMITED).expect(name);
        assert_eq!(mesh.triangles.len(), 2, "{name}");
    }
}

/// Some budget is enough, a little less gives an error, and none a panic.
#[test]
fn every_format_keeps_its_budget() {
    let grid = grid(60).into_bytes();
    let mut files = make::whole();
    files.push(("grid", "obj", grid));
    for (name, extension, bytes) in files {
        let path = format!("a.{extension}");
        let mut failed = 0;
        for bits in 0..24 {
            let budget = MemoryBudget::new(1 << bits, "raise the limit");
            match parse_mesh(&bytes, Path::new(&path), budget) {
                Ok(mesh) => {
                    let held = mesh.vertices.len() * 24 + mesh.triangles.len() * 12;
                    assert!(held as u64 <= budget.bytes(), "{name}: {held} bytes in 2^{bits}");
                }
                Err(ParseError::TooLarge { what }) => {
                    assert!(what.ends_with("raise the limit"), "{name}: {what}");
                    assert_eq!(failed, bits, "{name}: more memory was not enough");
                    failed += 1;
                }
                Err(error) => panic!("{name}: {error}"),
            }
        }
        assert!((5..20).contains(&failed), "{name}: 2^{failed} bytes are enough");
    }
}

#[test]
fn the_bytes_of_a_file_keep_the_budget() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("a.obj");
    fs::write(&path, grid(100)).expect("writable");
    let error =
        read_mesh(&path, MemoryBudget::new(100_000, "raise the limit")).expect_err("too large");
    assert!(matches!(error, FrameError::TooLarge { .. }), "{error}");
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(&vec![b'\n'; 10 << 20]).expect("memory takes all");
    let path = directory.path().join("b.obj");
    fs::write(&path, packed.finish().expect("memory takes all")).expect("writable");
    let error =
        read_mesh(&path, MemoryBudget::new(1 << 20, "raise the limit")).expect_err("too large");
    assert!(error.to_string().contains("decompressed it is larger"), "{error}");
}
