//! `--isolate`: a process that dies costs one frame.

use std::fs;
use std::process::Command;

use crate::harness::{JOB, Workshop, dam_break, images, ledger, no_leftovers, npy};

const FRAMES: usize = 5;

/// Images that take a while.
const LONG: [&str; 8] =
    ["--width", "320", "--height", "180", "--samples", "32", "--integrator", "whitted"];

fn long<'a>(options: &[&'a str]) -> Vec<&'a str> {
    let render = ["render", "in", "-o", "out/f.####.exr", "--isolate"];
    [&render[..], &LONG, options].concat()
}

fn arguments<'a>(options: &[&'a str]) -> Vec<&'a str> {
    let render = ["render", "in", "-o", "out/f.####.exr", "--isolate"];
    [&render[..], &JOB, options].concat()
}

// Renders five frames twice, once with a process for each.
#[test]
fn the_images_are_the_same() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    workshop.render_to("whole", &["--frames", "1-3"]).expect(0);
    workshop.render_to("whole", &[]).expect(0);
    let ran = workshop.run(&arguments(&[])).expect(0);
    assert_eq!(ran.rendered(), [1, 2, 3, 4, 5]);
    no_leftovers(&workshop.join("out"));
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
    // How the work is gone about is no property of the job.
    workshop.render(&[]).expect(0).prints("5 of 5 frames are done already");
}

// 3,000,000 positions are larger than the ceiling; in the end they are rendered without one.
#[test]
fn a_frame_beyond_the_ceiling_costs_one_frame() {
    let workshop = Workshop::new();
    for frame in 1..=3 {
        npy(&workshop.join(format!("in/f_{frame}.npy")), 2_000, frame, glam::Vec3::ZERO);
    }
    npy(&workshop.join("in/f_2.npy"), 3_000_000, 2, glam::Vec3::ZERO);
    // Nothing is asked of the particles
    let quick = ["--radius", "0.01", "--look", "none"];
    let options = [&quick[..], &["--memory-ceiling", "32MiB", "--threads", "2"]].concat();
    let ran = workshop
        .run(&arguments(&options))
        .expect(1)
        .prints("error: frame 2: ")
        .prints("f_2.npy: the frame needs about")
        .prints("failed: 2");
    assert_eq!(ran.rendered(), [1, 3]);
    no_leftovers(&workshop.join("out"));
    let lines = ledger(&workshop.join("out")).lines;
    assert!(lines.iter().any(|l| l["status"] == "failed" && l["frame"] == 2));
    // More room, and the same job goes on.
    let ran = workshop.run(&arguments(&quick)).expect(0);
    assert_eq!(ran.rendered(), [2]);
    workshop
        .run(&["render", "in", "-o", "x/f.####.exr", "--memory-ceiling", "1GiB"])
        .expect(2)
        .prints("--memory-ceiling: applies to the process of a frame");
}

/// The process that makes the frame, once there is one.
#[cfg(target_os = "linux")]
fn child_of(id: u32) -> Option<i64> {
    let listed = fs::read_to_string(format!("/proc/{id}/task/{id}/children")).ok()?;
    listed.split_ascii_whitespace().next()?.parse().ok()
}

/// The processor time that a process has used, in clock ticks (usually 10 ms); None once it is gone.
#[cfg(target_os = "linux")]
fn used_ticks(id: i64) -> Option<u64> {
    let stat = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    // Fields 14 and 15 of proc(5); the first after the name is field 3
    let fields = stat.rsplit_once(')')?.1.split_ascii_whitespace();
    let times = fields.skip(11).take(2).map(|field| field.parse::<u64>());
    times.sum::<Result<u64, _>>().ok()
}

#[cfg(target_os = "linux")]
// Images take a while: eight processes are killed, each further in its work than the one before.
#[test]
fn a_killed_process_is_tried_again() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    let whole = [&["render", "in", "-o", "whole/f.####.exr"][..], &LONG].concat();
    workshop.run(&whole).expect(0);
    let mut running = workshop.start(&long(&["--retries", "50"]));
    let mut kills = 0;
    while kills < 8 {
        let parent = running.id();
        if !running.wait_until(|| child_of(parent).is_some()) {
            break;
        }
        let Some(id) = child_of(parent) else { continue };
        // Each a little further in its work than the one before
        running.wait_until(|| used_ticks(id).is_none_or(|ticks| ticks >= kills));
        let killed = Command::new("kill").args(["-9", &id.to_string()]).output();
        kills += u64::from(killed.expect("kill is there").status.success());
    }
    let (messages, status) = running.end();
    assert_eq!(status.code(), Some(0), "{messages}");
    assert!(messages.contains("killed by the system"), "{messages}");
    no_leftovers(&workshop.join("out"));
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
}

#[test]
fn a_damaged_frame_is_reported_by_its_own_reason_and_not_tried_again() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    let path = workshop.join("in/f_2.bgeo");
    let bytes = fs::read(&path).expect("a frame");
    fs::write(&path, &bytes[..bytes.len() / 2]).expect("a file");
    let ran = workshop.run(&arguments(&[])).expect(1);
    assert_eq!(ran.rendered(), [1, 3]);
    assert!(!ran.errors().contains("the process died"), "{}", ran.errors());
    assert_eq!(ledger(&workshop.join("out")).lines.len(), 3);
}

// Images take a while, so that the signal comes before the last frame.
#[test]
fn term_ends_after_the_frame_in_hand() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    let mut running = workshop.start(&long(&[]));
    assert!(running.wait_for_line("] frame 1:"));
    running.signal("TERM");
    let (messages, status) = running.end();
    assert_eq!(status.code(), Some(75), "{messages}");
    let done = ledger(&workshop.join("out")).lines.len();
    assert!((1..FRAMES).contains(&done), "{messages}");
    no_leftovers(&workshop.join("out"));
}
