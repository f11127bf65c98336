//! Signatures. `formats/tests/compression.rs` reads files.

use std::io::Cursor;

use super::*;

#[test]
fn signatures_decide() {
    for (head, format) in [
        (&b"\x1f\x8b\x08\0"[..], Some(StreamFormat::Gzip)),
        (b"\x1f\x8b\x08\xe0", None),
        (b"\x28\xb5\x2f\xfd\x04", Some(StreamFormat::Zstd)),
        (b"\xfd7zXZ\0\0\x04", Some(StreamFormat::Xz)),
        (b"\x04\x22\x4d\x18\x64", Some(StreamFormat::Lz4)),
        (b"scf1\0\0", Some(StreamFormat::Scf)),
        (b"BZh91AY&SY", Some(StreamFormat::Bzip2)),
        (b"BZh9\x17\x72\x45\x38\x50\x90", Some(StreamFormat::Bzip2)),
        (b"BZh01AY&SY", None),
        (b"BZhello you", None),
        (b"\x5a\x2a\x4d\x18\x02\0\0\0xx\x28\xb5\x2f\xfd", Some(StreamFormat::Zstd)),
        (b"\x50\x2a\x4d\x18\0\0\0\0\x04\x22\x4d\x18", Some(StreamFormat::Lz4)),
        (b"\x50\x2a\x4d\x18\xff\xff\xff\xff\x04\x22\x4d\x18", None),
        (b"", None),
    ] {
        assert_eq!(StreamFormat::of(head), format, "{head:x?}");
        let found = Compression::detect(&mut Cursor::new(head)).expect("readable");
        assert_eq!(found.is_some(), format.is_some());
    }
}

#[test]
fn extensions_are_stripped() {
    for (name, stripped) in [
        ("a_7.vtk.gz", "a_7.vtk"),
        ("a_7.vtk.zst", "a_7.vtk"),
        ("a_7.bgeo.sc", "a_7.bgeo"),
        ("a.zip", "a"),
        ("a.npz", "a.npz"),
        ("a.gz.xz", "a.gz"),
    ] {
        assert_eq!(strip_extension(name), stripped);
    }
}

#[test]
fn damaged_archives_are_left_to_the_readers() {
    let damaged = b"PK\x03\x04 and no directory";
    let found = Compression::detect(&mut Cursor::new(damaged));
    assert!(matches!(found, Ok(None)));
    assert!(!is_compressed(damaged));
}

/// The library has one file for each name, so that particles would be lost silently.
#[test]
fn archives_with_a_name_twice_are_refused() {
    let mut writer = ::zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored = ::zip::write::SimpleFileOptions::default()
        .compression_method(::zip::CompressionMethod::Stored);
    for name in ["frame1.csv", "frame2.csv"] {
        writer.start_file(name, stored).expect("a member");
        std::io::Write::write_all(&mut writer, b"x,y,z\n1,2,3\n").expect("written");
    }
    let bytes = writer.finish().expect("an archive").into_inner();
    // Names of equal lengths: the second becomes the first, also in the directory
    let text: String = bytes.iter().map(|byte| char::from(*byte)).collect();
    let bytes: Vec<u8> = text
        .replace("frame2.csv", "frame1.csv")
        .chars()
        .map(|c| u8::try_from(u32::from(c)).expect("a byte"))
        .collect();
    let error = Compression::detect(&mut Cursor::new(bytes)).expect_err("two files");
    let error = format!("{error:?}");
    assert!(error.contains("a name twice, frame1.csv"), "{error}");
}
