//! `check` predicts what `render` would do, and changes nothing.

use std::fs;

use serde_json::json;

use super::answer;
use crate::harness::{JOB, Ran, Workshop, dam_break, files, stamps};

fn check(workshop: &Workshop, options: &[&str]) -> Ran {
    let arguments = ["check", "in", "-o", "out/f.####.exr"];
    workshop.run(&[&arguments[..], &JOB, options].concat())
}

fn frames() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    workshop
}

#[test]
fn check_describes_a_new_job_without_starting_it() {
    let workshop = frames();
    let ran = check(&workshop, &["--json"]).expect(0);
    assert!(!workshop.join("out").exists(), "nothing is touched");
    let answer = answer(&ran);
    assert_eq!(answer["problems"], json!([]));
    assert_eq!(answer["frames"]["to_do"], json!([1, 2, 3]));
    assert_eq!(answer["frames"]["done"], json!([]));
    assert_eq!(answer["image"]["width"], 64);
    assert_eq!(answer["structure"], "lbvh");
    assert_eq!(answer["most_particles"], 10422);
    let images = answer["images"].as_array().expect("images");
    let last = images[2].as_str().expect("a path");
    assert!(last.ends_with("out/f.0003.exr"), "{last}");
    let memory = &answer["memory"];
    let parts = ["program", "reading", "particles", "tree", "surface", "images", "encoding"];
    let sum: u64 = parts.iter().filter_map(|p| memory[p].as_u64()).sum();
    assert_eq!(memory["total"], sum);
    assert!(memory["images"].as_u64() >= Some(64 * 36 * 36));
    assert!(answer["time"]["estimate"].as_f64() > Some(0.0));
    assert!(answer["disk"]["estimate"].as_u64() > Some(0));
    assert!(answer["camera"]["eye"].is_array() && answer["radius"].is_number());

    let text = check(&workshop, &[]).expect(0).text();
    for line in ["frames     3 (1-3)", "64x36", "memory     about", "time       about"] {
        assert!(text.contains(line), "nothing of `{line}` in:\n{text}");
    }
}

#[test]
fn check_does_not_change_a_started_job() {
    let workshop = frames();
    let bad = workshop.join("in/f_2.bgeo");
    let good = fs::read(&bad).expect("a frame");
    fs::write(&bad, &good[..100]).expect("a file");
    workshop.render(&[]).expect(1);
    let out = workshop.join("out");
    let before = (files(&out), stamps(&out));
    let ran = check(&workshop, &["--json"]).expect(0);
    let json = answer(&ran);
    assert_eq!(json["frames"]["done"], json!([1, 3]));
    assert_eq!(json["frames"]["failed"], json!([2]));
    assert_eq!(json["frames"]["to_do"], json!([2]));
    // As the manifest too.
    let ran = workshop.run(&["check", "out/job.toml", "--json"]).expect(0);
    assert_eq!(answer(&ran)["frames"], json["frames"]);
    check(&workshop, &["--max-depth", "5"])
        .expect(2)
        .prints("error: ")
        .prints("render.max_depth: 3 -> 5");
    check(&workshop, &["--max-depth", "5", "--force"]).expect(0);
    check(&workshop, &["--max-depth", "5", "--keep-done"]).expect(0);
    assert_eq!(before, (files(&out), stamps(&out)));
}

#[test]
fn finished_job_needs_no_time() {
    let workshop = frames();
    workshop.render(&[]).expect(0);
    let json = answer(&check(&workshop, &["--json"]).expect(0));
    assert_eq!(json["frames"]["to_do"], json!([]));
    assert_eq!(json["frames"]["done"], json!([1, 2, 3]));
    assert_eq!(json["time"]["estimate"], json!(null));
}

#[test]
fn check_names_reasons_why_render_fails() {
    let workshop = frames();
    let ran = check(&workshop, &["--memory-limit", "1MiB"]).expect(2);
    assert!(!ran.text().contains("\nmemory "), "{}", ran.text());
    ran.prints("error: no frame fits into memory");
    fs::write(workshop.join("out"), "a file").expect("a file");
    check(&workshop, &[])
        .expect(2)
        .prints("out: is a file, but a directory for the images is needed");
    fs::remove_file(workshop.join("out")).expect("the file");
    fs::create_dir(workshop.join("out")).expect("a directory");
    fs::write(workshop.join("out/job.toml"), "theirs = true\n").expect("a file");
    let ran = check(&workshop, &["--json"])
        .expect(2)
        .prints("out/job.toml: this job would write its manifest here");
    let json = answer(&ran);
    assert_eq!(json["problems"].as_array().map(Vec::len), Some(1));
    assert_eq!(files(&workshop.join("out")).len(), 1);
}

#[cfg(unix)]
#[test]
fn a_directory_without_permission() {
    use std::os::unix::fs::PermissionsExt;
    let workshop = frames();
    let out = workshop.join("out");
    fs::create_dir(&out).expect("a directory");
    fs::set_permissions(&out, fs::Permissions::from_mode(0o555)).expect("permissions");
    // Root may write anywhere: then there is nothing to see here.
    if fs::write(out.join("probe"), "").is_err() {
        check(&workshop, &[]).expect(2).prints("cannot be written").prints("check its permissions");
    }
}
