//! Frames larger than memory: made within what is allowed, as the system counts it.

use std::process::Command;

use spherule_formats::native::{Access, NativeFile};

use crate::harness::{Ran, Workshop};

/// Runs the program where it may have `mib` MiB of memory of its own.
fn within(workshop: &Workshop, mib: u32, arguments: &[&str]) -> Ran {
    let limited = format!("ulimit -d {}; exec \"$0\" \"$@\"", mib * 1024);
    let output = Command::new("sh")
        .current_dir(workshop.path())
        .args(["-c", &limited, env!("CARGO_BIN_EXE_spherule")])
        .args(arguments)
        // Each thread has a stack that counts.
        .env("RAYON_NUM_THREADS", "2")
        .output();
    Ran(output.expect("a shell"))
}

// Five million particles: many fewer would fit into the memory that is allowed.
#[test]
fn generates_frames_larger_than_memory() {
    let workshop = Workshop::new();
    let make = |memory: &str| {
        let arguments = ["generate", "block", "--particles", "5e6", "-o", "a.spf"];
        let options = ["--encoding", "q10", "--memory", memory];
        within(&workshop, 112, &[&arguments[..], &options].concat())
    };
    // All of them at once need some 170 MB: so the limit is one.
    assert_ne!(make("2GiB").code(), Some(0));
    make("64MiB").expect(0).prints("temporary files");
    let file = NativeFile::open(&workshop.join("a.spf"), Access::Map).expect("whole");
    let frame = file.frame().expect("unchanged");
    frame.verify().expect("undamaged");
    assert_eq!(frame.index().count, 5_000_000);
    std::fs::remove_file(workshop.join("a.spf")).expect("there");
}

#[test]
fn signal_leaves_no_files() {
    let workshop = Workshop::new();
    let arguments = ["generate", "box", "--particles", "1e8", "-o", "a.npy"];
    let mut running = workshop.start(&arguments);
    let entries = || std::fs::read_dir(workshop.path()).map_or(0, Iterator::count);
    assert!(running.wait_until(|| entries() > 0));
    running.signal("TERM");
    let (errors, status) = running.end();
    assert_eq!(status.code(), Some(75), "{errors}");
    assert_eq!(entries(), 0);
}
