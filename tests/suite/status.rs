//! `spherule status` for jobs that run, have failures, were killed, or are done.

use std::fs;

use serde_json::Value;

use crate::harness::{SMALL, Workshop, dam_break};

fn status(workshop: &Workshop, code: i32) -> Value {
    let ran = workshop.run(&["status", "out", "--json"]).expect(code);
    serde_json::from_str(&ran.text()).expect("JSON")
}

// Starts the program nine times: the status is asked for at each stage of a job.
#[test]
fn status_from_first_to_last_frame() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=6);
    workshop.run(&["status", "out"]).expect(2).prints("out: no job here");
    let path = workshop.join("in/f_2.bgeo");
    let bytes = fs::read(&path).expect("a frame");
    fs::write(&path, &bytes[..bytes.len() / 2]).expect("a file");
    workshop.render(&["--frames", "1-3"]).expect(1);
    let json = status(&workshop, 75);
    assert_eq!(json["frames"], 6);
    assert_eq!(json["done"], serde_json::json!([1, 3]));
    assert_eq!(json["pending"], serde_json::json!([4, 5, 6]));
    assert_eq!(json["failed"][0]["frame"], 2);
    assert!(json["failed"][0]["reason"].as_str().expect("a reason").contains("f_2.bgeo"));
    assert_eq!(json["workers"], serde_json::json!([]));
    assert!(json["seconds_left"].is_null());

    workshop.render(&[]).expect(1);
    assert_eq!(status(&workshop, 1)["failed"][0]["frame"], 2);
    fs::write(&path, bytes).expect("a file");
    workshop.render(&[]).expect(0);
    fs::remove_file(workshop.join("out/f.0005.exr")).expect("an image");
    let json = status(&workshop, 75);
    assert_eq!(json["missing"], serde_json::json!([5]));
    workshop.render(&[]).expect(0);
    // By its manifest, too; and nothing is touched.
    let before = crate::harness::stamps(&workshop.join("out"));
    let text = workshop.run(&["status", "out/job.toml"]).expect(0).text();
    assert!(text.contains("done      6 (1-6)"), "{text}");
    assert_eq!(crate::harness::stamps(&workshop.join("out")), before);
}

// Images take a while, so that a worker is seen at work.
#[test]
fn status_lists_live_and_dead_workers() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=4);
    let slow = ["--width", "640", "--height", "360", "--samples", "64"];
    let arguments = [&["render", "in", "-o", "out/f.####.exr"][..], &slow].concat();
    let mut running = workshop.start(&arguments);
    assert!(running.wait_for_line("] frame 1:"));
    let json = status(&workshop, 75);
    let worker = &json["workers"][0];
    assert_eq!(worker["pid"], running.id());
    assert_eq!(worker["has_ended"], false);
    assert!(json["running"].as_array().is_some_and(|frames| !frames.is_empty()), "{json}");
    assert!(json["frames_per_second"].as_f64().is_some_and(|rate| rate > 0.0), "{json}");
    running.kill();
    running.end();
    let json = status(&workshop, 75);
    assert_eq!(json["workers"][0]["has_ended"], true, "{json}");
    assert_eq!(json["running"], serde_json::json!([]));
    let text = workshop.run(&["status", "out"]).expect(75).text();
    assert!(text.contains("has died; the next worker takes over"), "{text}");
}

// Watches a job from its first frame to its end.
#[test]
fn watching_ends_with_the_job() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    let arguments = [&["render", "in", "-o", "out/f.####.exr"][..], &SMALL].concat();
    let mut running = workshop.start(&arguments);
    assert!(running.wait_for_line("] frame 1:"));
    let text = workshop.run(&["status", "out", "--watch", "--json"]).text();
    running.end();
    let last: Value = serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    assert!(last["pending"].as_array().is_some_and(Vec::is_empty), "{text}");
}
