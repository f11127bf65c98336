//! `verify`: what is finished is opened and decoded, and nothing is touched.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Ran, Workshop, dam_break, images, npy, stamps};

/// Three frames in `out`, of which `frames` are rendered.
fn rendered(frames: &str) -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    workshop.render(&["--frames", frames]).expect(0);
    workshop
}

/// Turns a bit in the middle of a file, which keeps its length.
fn flip(path: &Path) {
    let mut bytes = fs::read(path).expect("a file");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(path, bytes).expect("a file");
}

fn objects(ran: &Ran) -> Vec<Value> {
    let parse = |line: &str| serde_json::from_str(line).expect("a line is JSON");
    ran.text().lines().map(parse).collect()
}

#[test]
fn intact_job_by_directory_or_manifest() {
    let workshop = rendered("all");
    let before = stamps(&workshop.join("out"));
    for job in ["out", "out/job.toml"] {
        let ran = workshop.run(&["verify", job]).expect(0);
        assert_eq!(ran.text(), "sound              3 (1-3)\n");
    }
    // The manifest of the user contains the directory of the images.
    let mine = "input.path = \"../in\"\noutput.path = \"../out/f.####.exr\"\n";
    fs::create_dir(workshop.join("mine")).expect("a directory");
    fs::write(workshop.join("mine/my.toml"), mine).expect("a file");
    let ran = workshop.run(&["verify", "mine/my.toml", "--json", "--threads", "1"]).expect(0);
    let objects = objects(&ran);
    assert_eq!(objects.len(), 3);
    assert_eq!(objects[0]["frame"], 1);
    assert_eq!(objects[0]["status"], "sound");
    assert_eq!(objects[0]["files"][0]["path"], "f.0001.exr");
    assert_eq!(objects[0]["files"][1]["status"], "sound");
    assert_eq!(stamps(&workshop.join("out")), before);
}

#[test]
fn pending_frames_are_not_faults() {
    let workshop = rendered("2");
    // Only frame 2 was asked for
    let ran = workshop.run(&["verify", "out"]).expect(0);
    assert_eq!(ran.text(), "sound              1 (2)\n");
    let all = ["verify", "out", "--frames", "1-3"];
    let ran = workshop.run(&all).expect(0);
    assert_eq!(ran.text(), "sound              1 (2)\npending            2 (1,3)\n");
    let ran = workshop.run(&[&all[..], &["--json"]].concat()).expect(0);
    let states: Vec<Value> = objects(&ran).iter().map(|o| o["status"].clone()).collect();
    assert_eq!(states, ["pending", "sound", "pending"]);
}

#[test]
fn each_fault_is_named() {
    let workshop = rendered("all");
    flip(&workshop.join("out/f.0001.exr"));
    fs::remove_file(workshop.join("out/f.0002.png")).expect("a file");
    let longer = workshop.join("out/f.0003.exr");
    let mut bytes = fs::read(&longer).expect("a file");
    let written = bytes.len();
    bytes.push(0);
    fs::write(&longer, bytes).expect("a file");
    let ran = workshop.run(&["verify", "out"]).expect(1);
    let text = ran.text();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 6, "{text}");
    assert!(lines[0].starts_with("frame 1: f.0001.exr: damaged: cannot be decoded: "), "{text}");
    assert_eq!(lines[1], "frame 2: f.0002.png: missing: does not exist");
    let longer =
        format!("frame 3: f.0003.exr: length: has {} bytes, {written} were written", written + 1);
    assert_eq!(lines[2], longer);
    assert_eq!(
        &lines[3..],
        ["damaged            1 (1)", "missing            1 (2)", "of another length  1 (3)"]
    );
    let ran = workshop.run(&["verify", "out", "--json", "--frames", "2"]);
    let objects = objects(&ran.expect(1));
    assert_eq!(objects.len(), 1);
    assert_eq!(objects[0]["status"], "missing");
    assert_eq!(objects[0]["files"][0]["status"], "sound");
    assert_eq!(objects[0]["files"][1]["reason"], "does not exist");
}

#[test]
fn damaged_preview_is_detected() {
    let workshop = rendered("1");
    flip(&workshop.join("out/f.0001.png"));
    let ran = workshop.run(&["verify", "out"]).expect(1);
    assert!(ran.text().starts_with("frame 1: f.0001.png: damaged: "));
}

#[test]
fn a_picture_of_another_job_is_damage() {
    let workshop = rendered("1");
    let other = ["--channels", "RGBA,Z", "--force"];
    workshop.render_to("other", &other).expect(0);
    let from = workshop.join("other/f.0001.exr");
    let to = workshop.join("out/f.0001.exr");
    let length = fs::metadata(&to).expect("a file").len();
    // Padded to the original length: only the header shows the damage.
    let mut bytes = fs::read(from).expect("a file");
    bytes.resize(usize::try_from(length).expect("it is short"), 0);
    fs::write(&to, bytes).expect("a file");
    let ran = workshop.run(&["verify", "out"]).expect(1);
    let text = ran.text();
    assert!(text.contains("f.0001.exr: damaged: has the channels"), "{text}");
}

#[test]
fn native_frames_are_verified_as_by_inspect() {
    let workshop = Workshop::new();
    for frame in 1..=2 {
        let path = workshop.join(format!("in/p_{frame}.npy"));
        npy(&path, 500, frame, glam::Vec3::ZERO);
    }
    workshop.run(&["convert", "in", "-o", "frames", "--encoding", "q16"]).expect(0);
    let ran = workshop.run(&["verify", "frames"]).expect(0);
    assert_eq!(ran.text(), "sound              2 (1-2)\n");
    flip(&workshop.join("frames/frame.0002.spf"));
    let ran = workshop.run(&["verify", "frames"]).expect(1);
    let text = ran.text();
    let inspected = workshop.run(&["inspect", "--verify", "frames/frame.0002.spf"]);
    let reason = inspected.errors();
    let reason = reason.split("frame.0002.spf: ").nth(1).expect("a reason");
    let expected = format!("frame 2: frame.0002.spf: damaged: {reason}");
    assert!(text.starts_with(&expected), "{text}\n{expected}");
}

#[test]
fn directory_without_a_job() {
    let workshop = rendered("1");
    let refused = |arguments: &[&str], what: &str| {
        let ran = workshop.run(&[&["verify"][..], arguments].concat());
        ran.expect(2).prints(what);
    };
    refused(&["in"], "in: no job here (no job.plan.json)");
    refused(&["none"], "none: no job here");
    refused(&["none.toml"], "none.toml: ");
    refused(&["out", "--frames", "9"], "--frames: 9 contains none of the job's frames: 1-3");
    fs::write(workshop.join("bad.toml"), "[inptu]\n").expect("a file");
    refused(&["bad.toml"], "did you mean `input`?");
    fs::write(workshop.join("out/job.plan.json"), "{").expect("a file");
    refused(&["out"], "job.plan.json: not a readable plan");
}

#[test]
fn damaged_frames_are_redone_on_request() {
    let workshop = rendered("all");
    let out = workshop.join("out");
    let good = images(&out);
    flip(&workshop.join("out/f.0001.exr"));
    flip(&workshop.join("out/f.0003.png"));
    // Looking alone changes nothing: the job still counts its frames as done.
    workshop.run(&["verify", "out"]).expect(1);
    assert_eq!(workshop.render(&[]).expect(0).rendered(), [0_i64; 0]);
    let damaged = images(&out);
    let ran = workshop.run(&["verify", "out", "--requeue-bad"]);
    ran.expect(1).prints("requeued: 1,3; the next run of the job repeats them");
    assert_eq!(images(&out), damaged);
    let ran = workshop.run(&["verify", "out", "--json"]).expect(0);
    let first = &objects(&ran)[0];
    assert_eq!(first["status"], "failed");
    let reason = first["reason"].as_str().expect("a reason");
    assert!(reason.starts_with("verify: f.0001.exr: cannot"), "{reason}");
    let mut rendered = workshop.render(&[]).expect(0).rendered();
    rendered.sort_unstable();
    assert_eq!(rendered, [1, 3]);
    assert_eq!(images(&out), good);
    workshop.run(&["verify", "out"]).expect(0);
    let ran = workshop.run(&["verify", "out", "--requeue-bad"]).expect(0);
    assert_eq!(ran.errors(), "");
}
