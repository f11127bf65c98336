//! Places where images cannot go.

use std::fs;

use super::refused;
use crate::harness::{SMALL, Workshop, dam_break, files, sample};

fn three_frames() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    workshop
}

#[track_caller]
fn not_there(workshop: &Workshop, pattern: &str, wanted: &[&str]) {
    let before = fs::read_dir(workshop.path())
        .expect("the directory")
        .count();
    let arguments = [&["render", "in", "-o", pattern][..], &SMALL].concat();
    refused(workshop, &arguments, wanted);
    let after = fs::read_dir(workshop.path())
        .expect("the directory")
        .count();
    assert_eq!(before, after, "a refused job leaves nothing");
}

#[test]
fn names_that_will_not_do() {
    let workshop = three_frames();
    not_there(
        &workshop,
        "out/f.exr",
        &[
            "output.path: out/f.exr for 3 frames: several frames would get the same name; put #### into it",
        ],
    );
    let ending = "--output: output.path: must end in .exr, as in out/frame.####.exr";
    for pattern in ["out/f.####.png", "out/", "out", "", "out/f.####"] {
        not_there(&workshop, pattern, &[ending]);
    }
    not_there(
        &workshop,
        "out/%q.exr",
        &["output.path: `%q.exr` is no frame number; use #### or %04d"],
    );
    not_there(
        &workshop,
        "out/##.##.exr",
        &["output.path: has room for two numbers"],
    );
    not_there(
        &workshop,
        "out.####/f.####.exr",
        &["belongs into the file's name, not a directory's"],
    );
}

#[test]
fn a_file_in_the_place_of_the_directory() {
    let workshop = three_frames();
    fs::write(workshop.join("out"), "a file").expect("a file");
    let wanted = "out: is a file where a directory for the images should be; choose another output";
    not_there(&workshop, "out/f.####.exr", &[wanted]);
    not_there(&workshop, "out/deep/er/f.####.exr", &[wanted]);
    assert_eq!(fs::read(workshop.join("out")).expect("a file"), b"a file");
}

#[cfg(target_os = "linux")]
#[test]
fn a_place_where_even_root_may_not_write() {
    let workshop = three_frames();
    not_there(&workshop, "/proc/nope/f.####.exr", &["error: /proc/nope: "]);
}

#[cfg(unix)]
#[test]
fn a_directory_without_permission() {
    use std::os::unix::fs::PermissionsExt;
    let workshop = three_frames();
    let out = workshop.join("out");
    fs::create_dir(&out).expect("a directory");
    fs::set_permissions(&out, fs::Permissions::from_mode(0o555)).expect("permissions");
    // Root may write anywhere: then there is nothing to see here.
    if fs::write(out.join("probe"), "").is_err() {
        not_there(
            &workshop,
            "out/f.####.exr",
            &["out/", "cannot be written", "check its permissions"],
        );
    }
}

#[test]
fn a_manifest_of_somebody_else_is_not_overwritten() {
    let workshop = three_frames();
    fs::create_dir(workshop.join("out")).expect("a directory");
    let theirs = "# not spherule's\nbuild = true\n";
    fs::write(workshop.join("out/job.toml"), theirs).expect("a file");
    let ran = workshop
        .render(&[])
        .expect(2)
        .tells("out/job.toml: is in the way of this job's own manifest")
        .tells("choose another output directory, or overwrite it with --force");
    assert!(ran.rendered().is_empty());
    let left = files(&workshop.join("out"));
    assert_eq!(left.len(), 1, "{:?}", left.keys());
    assert_eq!(left["job.toml"], theirs.as_bytes());
    workshop.render(&["--force"]).expect(0);
    workshop.render(&[]).expect(0);
}

#[test]
fn one_frame_makes_one_image() {
    let workshop = Workshop::new();
    let input = sample("single_frames/raw.xyz");
    let input = input.to_str().expect("UTF-8");
    let arguments = [&["render", input, "-o", "still.exr"][..], &SMALL].concat();
    workshop.run(&arguments).expect(0);
    assert!(workshop.join("still.exr").exists());
}
