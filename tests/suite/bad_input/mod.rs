//! What people type wrong: one clear message, the right exit code, nothing half-written.

use crate::harness::{Workshop, sample};

#[test]
fn a_missing_directory_is_named() {
    let workshop = Workshop::new();
    let ran = workshop
        .run(&["render", "no-such-place", "-o", "out/frame.####.exr"])
        .expect(2);
    assert!(ran.errors().contains("no-such-place"), "{}", ran.errors());
    assert!(ran.text().is_empty());
    assert!(!workshop.join("out").exists());
}

#[test]
fn one_frame_makes_one_image() {
    let workshop = Workshop::new();
    let input = sample("single_frames/raw.xyz");
    let input = input.to_str().expect("UTF-8");
    let size = ["--width", "32", "--height", "18", "--samples", "1"];
    let arguments = [&["render", input, "-o", "still.exr"][..], &size].concat();
    let mut command = workshop.command(&arguments);
    assert_eq!(
        command.status().expect("the program starts").code(),
        Some(0)
    );
    assert!(workshop.path().join("still.exr").exists());
}
