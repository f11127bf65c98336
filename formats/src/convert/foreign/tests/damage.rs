//! Damaged files, and files that change while they are read.

use proptest::prelude::*;
use proptest::sample::Index;

use super::*;

#[test]
fn damaged_files_give_the_same_error_as_the_reader() {
    let mut errors = 0;
    for path in files_under("damaged") {
        match (open_source(&path), read_whole(&path)) {
            (Ok(None), _) => {}
            (Ok(Some(source)), Ok(raw)) => same(&*source, &raw),
            (Err(error), Err(expected)) => {
                assert_eq!(error.to_string(), expected.to_string());
                errors += 1;
            }
            (Ok(Some(_)), Err(error)) => panic!("streamed, but not read: {error}"),
            (Err(error), Ok(_)) => panic!("read, but not streamed: {error}"),
        }
    }
    assert!(errors > 40, "{errors}");
}

/// For any bytes, the streamed particles equal those of the reader.
fn streams_as_read(name: &str, bytes: &[u8]) {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join(name);
    fs::write(&path, bytes).expect("writable");
    match (open_source(&path), read_whole(&path)) {
        (Ok(None), _) => {}
        (Ok(Some(source)), Ok(raw)) => same(&*source, &raw),
        (Err(error), Err(expected)) => assert_eq!(error.to_string(), expected.to_string()),
        (Ok(Some(_)), Err(error)) => panic!("streamed, but not read: {error}"),
        (Err(error), Ok(_)) => panic!("read, but not streamed: {error}"),
    }
}

fn sample() -> impl Strategy<Value = (&'static str, Vec<u8>)> {
    let names =
        ["le.ply", "color.ply", "fortran.npy", "struct.npy", "legacy_polydata-5.1-meta.vtk"];
    prop::sample::select(names.to_vec()).prop_map(|name| {
        let path = format!("{}/../tests/data/single_frames/{name}", env!("CARGO_MANIFEST_DIR"));
        (name, fs::read(path).expect("a sample"))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn changed_bytes_stream_as_they_are_read(
        (name, mut bytes) in sample(),
        changes in prop::collection::vec((0_usize..400, any::<u8>()), 1..4),
    ) {
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        streams_as_read(name, &bytes);
    }

    #[test]
    fn truncated_files_stream_as_they_are_read((name, bytes) in sample(), end in any::<Index>()) {
        streams_as_read(name, &bytes[..end.index(bytes.len())]);
    }
}

#[cfg(all(target_os = "linux", not(miri)))]
#[test]
fn truncation_during_streaming_is_detected() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("points.xyz");
    fs::write(&path, vec![0x80; 12 * 100_000]).expect("writable");
    let source = open_source(&path).expect("readable").expect("raw");
    let file = fs::OpenOptions::new().write(true).open(&path);
    file.and_then(|file| file.set_len(24)).expect("writable");
    let mut to = vec![DVec3::NAN; 10];
    source.read_positions(90_000, &mut to).expect("zeros stand for what is gone");
    assert_eq!(to, [DVec3::ZERO; 10]);
    let error = source.check().expect_err("cut short").to_string();
    assert!(error.contains("points.xyz") && error.contains("mapped"), "{error}");
}
