//! Places where images cannot go.

use std::fs;
#[cfg(target_os = "linux")]
use std::process::Command;

use super::refused;
#[cfg(target_os = "linux")]
use crate::harness::{Running, images, no_leftovers};
use crate::harness::{SMALL, Workshop, dam_break, files, sample};

fn three_frames() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    workshop
}

#[track_caller]
fn not_there(workshop: &Workshop, pattern: &str, expected: &[&str]) {
    let before = fs::read_dir(workshop.path()).expect("the directory").count();
    let arguments = [&["render", "in", "-o", pattern][..], &SMALL].concat();
    refused(workshop, &arguments, expected);
    let after = fs::read_dir(workshop.path()).expect("the directory").count();
    assert_eq!(before, after, "a refused job leaves nothing");
}

#[test]
fn invalid_output_names() {
    let workshop = three_frames();
    not_there(
        &workshop,
        "out/f.exr",
        &[
            "output.path: out/f.exr for 3 frames: several frames would get the same name; put #### into the name",
        ],
    );
    // One of those chosen will do if only one is there.
    let several = |frames| ["render", "in", "-o", "one/f.exr", "--frames", frames];
    refused(
        &workshop,
        &several("2-9"),
        &["output.path: one/f.exr for 2 frames: several frames would get the same name"],
    );
    workshop.run(&[&several("3-9")[..], &SMALL].concat()).expect(0).prints("1 of 1 frames done");
    assert!(workshop.join("one/f.exr").is_file());
    fs::remove_dir_all(workshop.join("one")).expect("the job");
    let ending = "--output: must end in .exr or .png (example: out/frame.####.exr)";
    for pattern in ["out/f.####.jpg", "out/", "out", "", "out/f.####"] {
        not_there(&workshop, pattern, &[ending]);
    }
    not_there(
        &workshop,
        "out/%q.exr",
        &["--output: invalid frame number `%q.exr`; use #### or %04d"],
    );
    not_there(&workshop, "out/##.##.exr", &["--output: has places for two numbers"]);
    not_there(
        &workshop,
        "out.####/f.####.exr",
        &["belongs into the file's name, not a directory's"],
    );
}

// Starts the program for many commands: what is refused depends on what others have made.
#[test]
fn one_frame_needs_no_number_in_its_name() {
    let workshop = three_frames();
    let one = ["render", "in", "-o", "one/f.exr", "--frames", "2"];
    let arguments = [&one[..], &SMALL].concat();
    let check = [&["check"], &arguments[1..]].concat();
    workshop.run(&check).expect(0);
    workshop.run(&arguments).expect(0).prints("1 of 1 frames");
    // The picture is that of the whole sequence.
    let all = [&["render", "in", "-o", "all/f.####.exr"][..], &SMALL].concat();
    workshop.run(&all).expect(0);
    let image = |name: &str| fs::read(workshop.join(name)).expect("an image");
    let made = image("one/f.exr");
    assert!(made == image("all/f.0002.exr"));
    // The same command finds it done, and so does its manifest.
    workshop.run(&arguments).expect(0).prints("1 of 1 frames are done already");
    workshop.run(&["render", "one/job.toml"]).expect(0);
    // Another frame would take the place of the first.
    let mut other = arguments.clone();
    other[5] = "3";
    refused(
        &workshop,
        &other,
        &["one: this job was made from other files", "f_3.bgeo", "choose another output"],
    );
    assert!(made == image("one/f.exr"));
    for frames in ["1-2", "all"] {
        let several = ["render", "in", "-o", "two/f.exr", "--frames", frames];
        refused(&workshop, &several, &["put #### into the name"]);
    }
    let follow = ["render", "in", "-o", "two/f.exr", "--follow"];
    refused(&workshop, &follow, &["put #### into the name"]);
}

#[test]
fn one_converted_frame_has_the_name_it_was_given() {
    let workshop = three_frames();
    let one = ["convert", "in", "-o", "native/one.spf"];
    workshop.run(&[&one[..], &["--frames", "2"]].concat()).expect(0);
    assert!(workshop.join("native/one.spf").is_file());
    refused(&workshop, &one, &["one.spf: one file name for 3 frames", "--frames"]);
}

#[test]
fn file_in_place_of_the_directory() {
    let workshop = three_frames();
    fs::write(workshop.join("out"), "a file").expect("a file");
    let expected =
        "out: is a file, but a directory for the images is needed; choose another output";
    not_there(&workshop, "out/f.####.exr", &[expected]);
    not_there(&workshop, "out/deep/er/f.####.exr", &[expected]);
    assert_eq!(fs::read(workshop.join("out")).expect("a file"), b"a file");
}

#[cfg(target_os = "linux")]
#[test]
fn unwritable_file_system() {
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

/// The user that runs the program: root may write anywhere, so then it is nobody.
#[cfg(target_os = "linux")]
fn as_plain_user(command: Command) -> Option<Command> {
    let is_root =
        fs::metadata("/proc/self").is_ok_and(|m| std::os::unix::fs::MetadataExt::uid(&m) == 0);
    if !is_root {
        return Some(command);
    }
    let ids = ["--reuid=65534", "--regid=65534", "--clear-groups"];
    let can = Command::new("setpriv").args(ids).arg("true").status();
    can.is_ok_and(|status| status.success()).then(|| {
        let mut plain = Command::new("setpriv");
        plain.args(ids).arg(command.get_program()).args(command.get_args());
        plain.current_dir(command.get_current_dir().expect("it is set"));
        plain
    })
}

#[cfg(target_os = "linux")]
// Images take a while, so that the directory is closed before the last of them.
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test is reported")]
fn a_directory_that_is_closed_while_a_job_runs() {
    use std::os::unix::fs::PermissionsExt;
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=6);
    let long = ["--width", "320", "--height", "180", "--samples", "12"];
    let whole = [&["render", "in", "-o", "whole/f.####.exr"][..], &long].concat();
    workshop.run(&whole).expect(0);
    let out = workshop.join("out");
    fs::create_dir(&out).expect("a directory");
    let open = |mode| {
        fs::set_permissions(&out, fs::Permissions::from_mode(mode)).expect("permissions");
    };
    for dir in [workshop.path(), &workshop.join("in")] {
        fs::set_permissions(dir, fs::Permissions::from_mode(0o755)).expect("permissions");
    }
    for options in [&[][..], &["--isolate"]] {
        open(0o777);
        let render = ["render", "in", "-o", "out/f.####.exr"];
        let arguments = [&render[..], &long, options].concat();
        let Some(command) = as_plain_user(workshop.command(&arguments)) else {
            eprintln!("left out: nobody but root is here");
            return;
        };
        let mut running = Running::new(command);
        assert!(running.wait_for_line("] frame 1:"));
        open(0o555);
        let (errors, status) = running.end();
        open(0o777);
        assert_eq!(status.code(), Some(1), "{errors}");
        assert!(errors.contains("cannot be written") && errors.contains("check its permissions"));
        assert!(!errors.contains("failed:"), "no frame is at fault: {errors}");
        workshop.run(&arguments).expect(0);
        assert!(images(&out) == images(&workshop.join("whole")));
        no_leftovers(&out);
        fs::remove_dir_all(&out).expect("a directory");
        fs::create_dir(&out).expect("a directory");
    }
}

#[test]
fn existing_manifest_is_not_overwritten() {
    let workshop = three_frames();
    fs::create_dir(workshop.join("out")).expect("a directory");
    let theirs = "# not spherule's\nbuild = true\n";
    fs::write(workshop.join("out/job.toml"), theirs).expect("a file");
    let ran = workshop
        .render(&[])
        .expect(2)
        .prints("out/job.toml: this job would write its manifest here")
        .prints("choose another output directory, or move the file away");
    assert!(ran.rendered().is_empty());
    workshop.render(&["--force"]).expect(2);
    let left = files(&workshop.join("out"));
    assert_eq!(left.len(), 1, "{:?}", left.keys());
    assert_eq!(left["job.toml"], theirs.as_bytes());
    fs::remove_file(workshop.join("out/job.toml")).expect("a file");
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
