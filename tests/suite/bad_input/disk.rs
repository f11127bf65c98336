//! A disk that is full, played by a small file system in a namespace of its own.
#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::harness::{SMALL, Workshop, dam_break, images, ledger, natives, no_leftovers};

type Files = BTreeMap<String, Vec<u8>>;

const FRAMES: usize = 5;

/// Renders into a file system of `$2`, keeps what it left as `after`, makes room, renders again.
const SCRIPT: &str = r#"
program=$1; size=$2; shift 2
mkdir -p full
mount -t tmpfs -o size=$size none full || exit 99
"$program" "$@" 2> errors; echo $? > code
cp -a full after
mount -o remount,size=64m full || exit 99
"$program" "$@" 2> errors-again; echo $? > code-again
cp -a full again
"#;

/// How this user may mount, if at all.
fn namespace() -> Option<&'static [&'static str]> {
    let ways: [&[&str]; 2] = [&["-r", "-m"], &["-m"]];
    ways.into_iter().find(|options| {
        Command::new("unshare")
            .args(*options)
            .args(["mount", "-t", "tmpfs", "none", "/mnt"])
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    })
}

// Starts the program 17 times: the size of the disk decides which file is the first without room.
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test is reported")]
fn full_disk_is_reported_without_partial_files() {
    let Some(namespace) = namespace() else {
        eprintln!("left out: no file system may be mounted here");
        return;
    };
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    workshop.run(&[&["render", "in", "-o", "whole/f.####.exr"][..], &SMALL].concat()).expect(0);
    let whole = images(&workshop.join("whole"));
    // Room for the plan only; for some of the first image; for some images.
    for (size, code) in [
        ("8k", 2),
        ("16k", 2),
        ("24k", 2),
        ("28k", 2),
        ("32k", 2),
        ("40k", 2),
        ("48k", 1),
        ("68k", 1),
    ] {
        let place = Workshop::new();
        dam_break(&place.join("in"), 1..=FRAMES);
        let render = [&["render", "in", "-o", "full/f.####.exr"][..], &SMALL].concat();
        run_in_small(&place, namespace, size, &render, code);
        whatever_is_there_is_whole(&place.join("after"), &images(&place.join("after")), &whole);
        assert!(images(&place.join("again")) == whole, "{size}");
    }
}

#[test]
#[expect(clippy::print_stderr, reason = "a skipped test is reported")]
fn full_disk_stops_a_conversion_which_resumes() {
    let Some(namespace) = namespace() else {
        eprintln!("left out: no file system may be mounted here");
        return;
    };
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    workshop.run(&["convert", "in", "-o", "whole"]).expect(0);
    let whole = natives(&workshop.join("whole"));
    let largest = whole.values().map(Vec::len).max().expect("frames");
    // Room for some of the first frame; for some frames.
    for size in [largest / 2, 3 * largest] {
        let place = Workshop::new();
        dam_break(&place.join("in"), 1..=FRAMES);
        let convert = ["convert", "in", "-o", "full"];
        run_in_small(&place, namespace, &size.to_string(), &convert, 1);
        whatever_is_there_is_whole(&place.join("after"), &natives(&place.join("after")), &whole);
        assert!(natives(&place.join("again")) == whole, "{size}");
    }
}

/// Runs the program with these arguments in a file system of so many bytes, where it ends with `code`, and
/// again with more room.
#[track_caller]
fn run_in_small(place: &Workshop, namespace: &[&str], size: &str, arguments: &[&str], code: i32) {
    let status = Command::new("unshare")
        .args(namespace)
        .args(["sh", "-c", SCRIPT, "sh"])
        .args([env!("CARGO_BIN_EXE_spherule"), size])
        .args(arguments)
        .current_dir(place.path())
        .status();
    assert!(status.expect("unshare starts").success());
    let text = |name: &str| std::fs::read_to_string(place.join(name)).expect(name);
    let errors = text("errors");
    assert_eq!(text("code").trim(), code.to_string(), "{size}: {errors}");
    let is_error = |line: &&str| line.starts_with("error: ");
    let lines: Vec<&str> = errors.lines().filter(is_error).collect();
    assert_eq!(lines.len(), 1, "{size}: {errors}");
    assert!(lines[0].contains("/full/") && lines[0].contains(": no space left; free some"));
    let again = text("code-again");
    assert_eq!(again.trim(), "0", "{size}: {}", text("errors-again"));
    no_leftovers(&place.join("again"));
}

/// `made` is what there is in `dir` of `whole`.
#[track_caller]
fn whatever_is_there_is_whole(dir: &Path, made: &Files, whole: &Files) {
    no_leftovers(dir);
    for (name, bytes) in made {
        assert!(whole.get(name) == Some(bytes), "{name} is not whole");
    }
    for (name, length) in ledger(dir).done() {
        assert_eq!(made.get(&name).map(|b| b.len() as u64), Some(length), "{name}");
    }
}

// Renders nine frames twice: only the largest image is beyond the limit.
/// Files may not grow beyond some limit: the frame fails, the others do not.
#[test]
fn an_image_that_cannot_be_written_costs_one_frame() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=9);
    // Large enough for images to be larger than the manifest, which must be written
    let size = ["--width", "96", "--height", "54", "--samples", "1"];
    let render = |out: &str| {
        let pattern = format!("{out}/f.####.exr");
        workshop.run(&[&["render", "in", "-o", &pattern][..], &size].concat())
    };
    render("whole").expect(0);
    let whole = images(&workshop.join("whole"));
    let largest = whole.values().map(Vec::len).max().expect("images");
    // In blocks of 512 bytes; the signal about the limit is ignored.
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", (largest - 1) / 512);
    let output = Command::new("sh")
        .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_spherule")])
        .args(["render", "in", "-o", "out/f.####.exr"])
        .args(size)
        .current_dir(workshop.path())
        .output()
        .expect("sh starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(
        errors.contains("error: frame 9: ") && errors.contains("/out/f.0009.exr: "),
        "{errors}"
    );
    assert!(errors.contains("8 of 9 frames done") && errors.contains("failed: 9"), "{errors}");
    let out = workshop.join("out");
    whatever_is_there_is_whole(&out, &images(&out), &whole);
    let ran = render("out").expect(0);
    assert_eq!(ran.rendered(), [9]);
    assert!(images(&workshop.join("out")) == whole);
}
