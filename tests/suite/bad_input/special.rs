//! Pipes and devices where files are expected: an error at once, never a wait.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::refused;
use crate::harness::{SMALL, Workshop, dam_break, ledger_path};

fn pipe(path: &Path) {
    let _ = fs::remove_file(path);
    let made = Command::new("mkfifo").arg(path).status();
    assert!(made.expect("mkfifo").success());
}

fn two_frames() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    workshop
}

const PIPE: &str = "is not a regular file but a pipe";

#[test]
fn pipes_as_manifests() {
    let workshop = two_frames();
    pipe(&workshop.join("job.toml"));
    for command in ["render", "check", "init", "status", "verify"] {
        refused(&workshop, &[command, "job.toml"], &["job.toml: ", PIPE]);
    }
    refused(&workshop, &["export", "openjd", "job.toml"], &["job.toml: ", PIPE]);
    fs::create_dir(workshop.join("out")).expect("a directory");
    pipe(&workshop.join("out/job.toml"));
    let render = ["render", "in", "-o", "out/f.####.exr"];
    refused(&workshop, &render, &["out/job.toml: this job would write its manifest here"]);
    // A manifest without an end.
    let endless = fs::File::create(workshop.join("long.toml")).expect("a file");
    endless.set_len(1 << 40).expect("a hole");
    refused(&workshop, &["render", "long.toml"], &["long.toml: has more than 16777216 bytes"]);
}

#[test]
fn pipes_among_the_files_of_a_job() {
    let workshop = two_frames();
    workshop.render(&[]).expect(0);
    let out = workshop.join("out");
    let again = [&["render", "in", "-o", "out/f.####.exr"][..], &SMALL].concat();
    for path in [ledger_path(&out), out.join("job.plan.json")] {
        let bytes = fs::read(&path).expect("a file of the job");
        pipe(&path);
        for arguments in [&again[..], &["status", "out"], &["verify", "out"]] {
            refused(&workshop, arguments, &[PIPE]);
        }
        fs::remove_file(&path).expect("the pipe");
        fs::write(&path, bytes).expect("a file");
    }
    // Neither workers nor reports are behind these.
    fs::create_dir(out.join("job.work")).expect("a directory");
    for name in ["frame.2.0", "lock.0", "x.worker"] {
        pipe(&out.join("job.work").join(name));
    }
    pipe(&out.join("report.html"));
    pipe(&out.join("job.schema.json"));
    fs::remove_file(out.join("f.0002.exr")).expect("an image");
    workshop.run(&["status", "out"]).expect(75);
    let ran = workshop.render(&[]).expect(0);
    assert_eq!(ran.rendered(), [2]);
    assert!(out.join("report.html").is_file());
}

#[test]
fn pipes_as_camera_paths() {
    let workshop = two_frames();
    pipe(&workshop.join("shot.json"));
    for command in ["render", "check"] {
        let arguments = [command, "in", "--camera-path", "shot.json"];
        refused(&workshop, &arguments, &["shot.json: ", PIPE]);
    }
}

#[test]
fn pipes_among_the_particles() {
    let workshop = two_frames();
    pipe(&workshop.join("in/f_3.bgeo"));
    let ran = workshop.render(&[]).expect(0);
    assert_eq!(ran.rendered(), [1, 2], "in a directory it is passed by");
    let given = ["in/f_1.bgeo", "in/f_2.bgeo", "in/f_3.bgeo"];
    let small = [&["-o", "new/f.####.exr"][..], &SMALL].concat();
    for (command, options) in [("render", &small[..]), ("convert", &["-o", "native"])] {
        let arguments = [&[command], &given[..], options].concat();
        let ran = workshop.run(&arguments);
        assert_ne!(ran.code(), Some(0), "{}", ran.errors());
        assert!(ran.errors().contains("f_3.bgeo: "), "{}", ran.errors());
    }
    for options in [&["inspect", "in/f_3.bgeo"][..], &["inspect", "--verify", "in/f_3.bgeo"]] {
        let ran = workshop.run(options);
        assert!(ran.errors().contains("regular file"), "{}", ran.errors());
    }
}
