//! A torn last line is dropped; any other damage is an error and never a fresh start.
//!
//! Tests start the program several times: for a job of three frames, and after each damage.

use std::fs;

use crate::harness::{Workshop, dam_break, images, ledger, ledger_path, stamps};

fn three_frames() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    workshop.render(&[]).expect(0);
    workshop
}

#[test]
fn a_torn_last_line_costs_its_frame() {
    let workshop = three_frames();
    let whole = images(&workshop.join("out"));
    let path = ledger_path(&workshop.join("out"));
    let text = fs::read_to_string(&path).expect("a ledger");
    fs::write(&path, &text[..text.len() - 40]).expect("a file");
    assert!(ledger(&workshop.join("out")).torn);
    let ran = workshop.render(&[]).expect(0);
    assert_eq!(ran.rendered(), [3]);
    let now = ledger(&workshop.join("out"));
    // Nobody else writes the file of a worker that has ended.
    assert!(now.torn && now.lines.len() == 3);
    assert!(images(&workshop.join("out")) == whole);
}

#[test]
fn a_damaged_line_is_named_and_nothing_is_touched() {
    let workshop = three_frames();
    let path = ledger_path(&workshop.join("out"));
    let text = fs::read_to_string(&path).expect("a ledger");
    let damaged = text.replacen("\"frame\":2", "\"fr", 1);
    assert_ne!(damaged, text);
    fs::write(&path, &damaged).expect("a file");
    let before = stamps(&workshop.join("out"));
    let ran = workshop
        .render(&[])
        .expect(2)
        .prints("out/job.ledger.")
        .prints(".jsonl: line 2: not a ledger entry")
        .prints("remove that line to repeat its frame, or start over with --force");
    assert_eq!(ran.errors().matches("error:").count(), 1);
    assert_eq!(stamps(&workshop.join("out")), before);

    // The remedy that the message names works.
    let mut lines: Vec<&str> = damaged.lines().collect();
    lines.remove(1);
    fs::write(&path, lines.join("\n") + "\n").expect("a file");
    let ran = workshop.render(&[]).expect(0);
    assert_eq!(ran.rendered(), [2]);
}

#[test]
fn a_damaged_or_missing_plan_is_no_fresh_start() {
    let workshop = three_frames();
    let plan = workshop.join("out/job.plan.json");
    let text = fs::read(&plan).expect("a plan");
    let before = stamps(&workshop.join("out"));
    fs::write(&plan, &text[..text.len() / 2]).expect("a file");
    workshop
        .render(&[])
        .expect(2)
        .prints("out/job.plan.json: not a readable plan")
        .prints("--force");
    fs::remove_file(&plan).expect("a plan");
    workshop
        .render(&[])
        .expect(2)
        .prints("the ledger has lines but job.plan.json is missing")
        .prints("--force");
    fs::write(&plan, &text).expect("a file");
    workshop.render(&[]).expect(0).prints("3 of 3 frames are done already");
    let mut after = stamps(&workshop.join("out"));
    after.insert("job.plan.json".to_owned(), before["job.plan.json"]);
    assert_eq!(after, before);

    fs::write(&plan, "{}").expect("a file");
    let ran = workshop.render(&["--force"]).expect(0);
    assert_eq!(ran.rendered(), [1, 2, 3]);
}

/// The camera, and everything else that "auto" turned into, is as safe as the settings.
#[test]
fn one_damaged_byte_of_the_plan_is_no_other_camera() {
    let workshop = three_frames();
    fs::remove_file(workshop.join("out/f.0003.exr")).expect("an image");
    let plan = workshop.join("out/job.plan.json");
    let text = fs::read_to_string(&plan).expect("a plan");
    let at = text.find("\"resolved\"").expect("resolved values");
    let digit = at + text[at..].find(|c: char| c.is_ascii_digit()).expect("a number");
    let mut damaged = text.clone().into_bytes();
    damaged[digit] = if damaged[digit] == b'7' { b'8' } else { b'7' };
    fs::write(&plan, &damaged).expect("a file");
    let before = stamps(&workshop.join("out"));
    workshop
        .render(&[])
        .expect(2)
        .prints("out/job.plan.json: the plan does not match its checksum")
        .prints("restore it, or start over with --force");
    assert_eq!(stamps(&workshop.join("out")), before);
    fs::write(&plan, text).expect("a file");
    assert_eq!(workshop.render(&[]).expect(0).rendered(), [3]);
}

#[test]
fn a_plan_of_version_1_goes_on() {
    let workshop = three_frames();
    let whole = images(&workshop.join("out"));
    fs::remove_file(workshop.join("out/f.0002.exr")).expect("an image");
    let path = workshop.join("out/job.plan.json");
    let bytes = fs::read(&path).expect("a plan");
    let sealed: serde_json::Value = serde_json::from_slice(&bytes).expect("JSON");
    let mut plan = sealed["plan"].clone();
    let pairs: Vec<(String, String)> =
        serde_json::from_value(plan["settings"].clone()).expect("settings");
    plan["version"] = 1.into();
    plan["settings_blake3"] = spherule_jobs::settings_hash(&pairs).into();
    plan.as_object_mut().expect("an object").remove("input_dirs");
    fs::write(&path, format!("{plan:#}\n")).expect("a file");
    workshop.run(&["status", "out"]).expect(75);
    assert_eq!(workshop.render(&[]).expect(0).rendered(), [2]);
    assert!(images(&workshop.join("out")) == whole);
    assert_eq!(fs::read(&path).expect("a plan"), bytes, "it has a checksum now");
}

/// Details are read when the report is written; by then it is too late to complain.
#[test]
fn details_that_cannot_be_read_are_found_with_their_line() {
    let workshop = three_frames();
    let path = ledger_path(&workshop.join("out"));
    let text = fs::read_to_string(&path).expect("a ledger");
    let (start, rest) = text.split_once("\"particles\":").expect("a number");
    let (_, rest) = rest.split_once(',').expect("more");
    let nested = "[".repeat(300) + &"]".repeat(300);
    for value in ["203E616", "1e999", "\"\\ud800\"", nested.as_str()] {
        fs::write(&path, format!("{start}\"particles\":{value},{rest}")).expect("a file");
        for arguments in [&["status", "out"][..], &["verify", "out"], &["render", "out/job.toml"]] {
            let ran = workshop.run(arguments).expect(2);
            let errors = ran.errors();
            assert!(errors.contains(".jsonl: line 1: not a ledger entry"), "{errors}");
            assert!(!errors.contains("panicked"), "{errors}");
        }
    }
}
