//! Files that are truncated while they are mapped: missing pages read as zeros, and the check detects it.
#![cfg(all(target_os = "linux", not(miri)))]

use super::*;

/// Truncates a mapped file to each length and accesses all of it.
#[test]
fn truncated_files_do_not_crash_later_reads() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    for stored in frames::all() {
        let len = stored.bytes.len() as u64;
        for cut in [0, 1, 63, 64, 4095, 4096, 4097, len - 1] {
            let path = dir.path().join("a.spf");
            fs::write(&path, &stored.bytes).expect("writable");
            let file = NativeFile::open(&path, Access::Map).expect("whole");
            let frame = file.frame().expect("unchanged");
            let handle = fs::OpenOptions::new().write(true).open(&path);
            handle.and_then(|h| h.set_len(cut)).expect("writable");
            touch(frame);
            let error = file.check().expect_err("cut").to_string();
            assert!(error.contains(&format!("has {cut} now")), "{error}");
            assert!(error.contains("read it instead of mapping it"), "{error}");
            assert!(file.frame().is_err());
        }
    }
}

/// A file that is restored to its length has still lost its bytes.
#[test]
fn lost_pages_stay_lost() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    for stored in frames::all() {
        fs::write(&path, &stored.bytes).expect("writable");
        let file = NativeFile::open(&path, Access::Map).expect("whole");
        let modified = fs::metadata(&path).and_then(|m| m.modified());
        let frame = file.frame().expect("unchanged");
        let handle = fs::OpenOptions::new().write(true).open(&path).expect("writable");
        handle.set_len(0).expect("writable");
        touch(frame);
        handle.set_len(stored.bytes.len() as u64).expect("writable");
        handle.set_modified(modified.expect("a time")).expect("writable");
        let error = file.check().expect_err("lost").to_string();
        assert!(error.contains("cut short while it was mapped"), "{error}");
    }
}
