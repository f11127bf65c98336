//! Readers that go away and logs that cannot be written.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::process::Stdio;

use glam::Vec3;

use crate::harness::{SMALL, Workshop, dam_break, images, npy};

#[test]
fn closed_pipe_is_not_an_error() {
    let workshop = Workshop::new();
    // More than a pipe holds, so that the program does notice.
    for frame in 0..500 {
        npy(&workshop.join(format!("in/f_{frame}.npy")), 8, frame, Vec3::ZERO);
    }
    for arguments in [&["inspect", "--json", "in"][..], &["inspect", "in"]] {
        let mut child = workshop
            .command(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        let mut stdout = BufReader::new(child.stdout.take().expect("it is piped"));
        stdout.read_line(&mut line).expect("a line");
        drop(stdout);
        assert!(line.contains("f_0.npy"), "{line}");
        let output = child.wait_with_output().expect("it ends");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{errors}");
        assert!(errors.is_empty(), "{errors}");
    }
}

// Renders four frames three times: each kind of messages is printed by other code.
/// A job does not end because nobody reads its messages.
#[test]
fn job_continues_without_standard_error() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=4);
    for progress in ["plain", "json", "openjd"] {
        let arguments = ["render", "in", "-o", "out/f.####.exr", "--force", "--progress", progress];
        let mut child = workshop
            .command(&[&arguments[..], &SMALL].concat())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        drop((child.stdout.take(), child.stderr.take()));
        assert_eq!(child.wait().expect("it ends").code(), Some(0), "{progress}");
        assert_eq!(images(&workshop.join("out")).len(), 8);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_log_on_a_full_disk_does_not_end_a_job() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let full = || File::options().write(true).open("/dev/full").expect("/dev/full");
    let arguments = [&["render", "in", "-o", "out/f.####.exr"][..], &SMALL].concat();
    let mut command = workshop.command(&arguments);
    let status = command.stderr(full()).status().expect("the program starts");
    assert_eq!(status.code(), Some(0));
    assert_eq!(images(&workshop.join("out")).len(), 4);

    for arguments in [&["inspect", "--json", "in"][..], &["init", "in"]] {
        let mut command = workshop.command(arguments);
        let output = command.stdout(full()).output().expect("the program starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains("standard output: no space left"), "{errors}");
    }
}
