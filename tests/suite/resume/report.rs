//! `report.json` has what scripts rely on (DESIGN 3.2), and `report.html` shows the same.

use std::fs;

use serde_json::Value;

use crate::harness::{Workshop, dam_break};

fn page(workshop: &Workshop) -> String {
    fs::read_to_string(workshop.join("out/report.html")).expect("a page")
}

fn keys(value: &Value) -> Vec<&str> {
    let object = value.as_object().expect("an object");
    object.keys().map(String::as_str).collect()
}

#[track_caller]
fn has(value: &Value, expected: &[&str]) {
    let keys = keys(value);
    for key in expected {
        assert!(keys.contains(key), "no `{key}` among {keys:?}");
    }
}

#[test]
fn frames_totals_settings_and_machine() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=4);
    let file = workshop.join("in/f_2.bgeo");
    let good = fs::read(&file).expect("a frame");
    fs::write(&file, &good[..100]).expect("a file");
    workshop.render(&["--frames", "1-3", "--threads", "2"]).expect(1);
    let first = workshop.report("out");
    has(&first, &["frames", "totals", "slowest", "settings", "machine"]);
    let frames = first["frames"].as_array().expect("frames");
    let status: Vec<&str> = frames.iter().filter_map(|f| f["status"].as_str()).collect();
    assert_eq!(status, ["done", "failed", "done", "pending"]);
    let numbers: Vec<i64> = frames.iter().filter_map(|f| f["frame"].as_i64()).collect();
    assert_eq!(numbers, [1, 2, 3, 4]);
    let failed = frames[1]["reason"].as_str().expect("a reason");
    assert!(failed.contains("f_2.bgeo"), "{failed}");
    for (frame, image) in frames.iter().zip(1..) {
        assert_eq!(frame["image"], format!("f.{image:04}.exr"));
    }
    done_frame(&frames[0]);
    done_frame(&frames[2]);

    let totals = &first["totals"];
    assert_eq!((&totals["frames"], &totals["done"]), (&4.into(), &2.into()));
    assert_eq!(totals["failed"], serde_json::json!([2]));
    assert_eq!(totals["pending"], 1);
    for key in ["primary", "shadow", "reflection", "refraction"] {
        let sum: u64 = frames.iter().filter_map(|f| f["rays"][key].as_u64()).sum();
        assert_eq!(totals["rays"][key], sum, "{key}");
    }
    let wall: f64 = frames.iter().filter_map(|f| f["seconds"]["wall"].as_f64()).sum();
    assert_eq!(totals["seconds"]["wall"], wall);
    assert_eq!(first["slowest"].as_array().map(Vec::len), Some(2));
    assert_eq!(first["settings"]["render.max_depth"], "3");
    assert_eq!(first["settings"]["image.width"], "64");
    assert_eq!(first["machine"]["threads"], 2);
    let shown = page(&workshop);
    assert!(shown.contains("2 of 4 done") && shown.contains("1 frame failed"));
    assert!(shown.contains("f_2.bgeo") && shown.contains("id=\"plot-stages\""));

    // It tells of the whole job, not of the last run.
    fs::write(&file, good).expect("a file");
    workshop.render(&["--threads", "2"]).expect(0);
    let second = workshop.report("out");
    let frames = second["frames"].as_array().expect("frames");
    assert!(frames.iter().all(|f| f["status"] == "done"));
    assert_eq!(frames[0], first["frames"][0]);
    assert_eq!(second["totals"]["done"], 4);
    let shown = page(&workshop);
    assert!(shown.contains("4 of 4 done") && !shown.contains("f_2.bgeo"));
}

#[test]
fn a_job_with_failures_only_has_a_page_that_names_them() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=1);
    workshop.render(&[]).expect(0);
    let old = page(&workshop);
    let unchanged = fs::metadata(workshop.join("out/report.html")).and_then(|m| m.modified());
    workshop.render(&[]).expect(0);
    assert_eq!(page(&workshop), old);
    let now = fs::metadata(workshop.join("out/report.html")).and_then(|m| m.modified());
    assert_eq!(now.expect("a time"), unchanged.expect("a time"));

    fs::remove_file(workshop.join("out/f.0001.exr")).expect("an image");
    let file = workshop.join("in/f_1.bgeo");
    fs::write(&file, &fs::read(&file).expect("a frame")[..100]).expect("a file");
    workshop.render(&[]).expect(1);
    let shown = page(&workshop);
    assert!(shown.contains("0 of 1 done") && shown.contains("No frame is finished yet"));
    assert!(shown.contains("in/f_1.bgeo"), "{shown}");
}

#[test]
fn lost_images_are_not_called_done() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    workshop.render(&[]).expect(0);
    fs::remove_file(workshop.join("out/f.0002.exr")).expect("an image");
    workshop.render(&["--frames", "1"]).expect(0);
    let report = workshop.report("out");
    assert_eq!(report["frames"][0]["status"], "done");
    assert_eq!(report["frames"][1]["status"], "pending");
    assert_eq!(report["frames"][1]["particles"], Value::Null);
    assert_eq!(report["totals"]["done"], 2);
    assert_eq!(report["totals"]["particles"], 2 * 10422);
}

#[track_caller]
fn done_frame(frame: &Value) {
    assert_eq!(frame["particles"], 10422);
    has(&frame["seconds"], &["read", "build", "trace", "encode", "wall"]);
    has(&frame["build"], &["order", "nodes"]);
    let parts = ["positions", "structure", "attributes", "scratch"];
    has(&frame["bytes"], &parts);
    has(&frame["bytes"], &["build_peak", "file", "per_particle"]);
    has(&frame["rays"], &["primary", "shadow", "reflection", "refraction"]);
    has(&frame["rss"], &["anonymous_peak", "file_peak"]);
    assert_eq!(frame["rays"]["primary"], 64 * 36);
    assert!(frame["bytes"]["positions"].as_u64() >= Some(10422 * 12));
    let bytes = frame["bytes"]["positions"].as_f64().zip(frame["bytes"]["structure"].as_f64());
    let (positions, structure) = bytes.expect("numbers");
    assert_eq!(frame["bytes"]["per_particle"], (positions + structure) / 10422.0);
    assert!(frame["rays_per_second"].as_f64() > Some(0.0));
    assert!(frame["build"]["nodes"].as_u64() > Some(0));
    for stage in ["read", "build", "trace", "encode"] {
        assert!(frame["seconds"][stage].as_f64() > Some(0.0), "{stage}");
    }
}

#[test]
fn progress_for_programs_tells_each_frame() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    let file = workshop.join("in/f_2.bgeo");
    fs::write(&file, &fs::read(&file).expect("a frame")[..100]).expect("a file");
    let ran = workshop.render(&["--progress", "json"]).expect(1);
    let lines: Vec<Value> =
        ran.text().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let messages: Vec<(i64, &str)> =
        lines.iter().filter_map(|l| Some((l["frame"].as_i64()?, l["event"].as_str()?))).collect();
    assert_eq!(messages, [(1, "frame_done"), (2, "frame_failed"), (3, "frame_done")]);

    let ran = workshop.render(&["--progress", "openjd", "--force"]).expect(1);
    let progress: Vec<String> = ran.text().lines().map(str::to_owned).collect();
    assert!(progress.contains(&"openjd_progress: 100.0".to_owned()), "{progress:?}");

    let ran = workshop.render(&["--progress", "none", "--force"]).expect(1);
    assert!(ran.rendered().is_empty());
    assert!(ran.errors().contains("error: frame 2: in/f_2.bgeo"));
}
