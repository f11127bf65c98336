//! `--progress json`: standard output has only events, as documented in `docs/progress.md`.

use std::fs;

use serde_json::Value;

use crate::harness::{Ran, SMALL, Workshop, dam_break};

const MANUAL: &str = include_str!("../../docs/progress.md");

/// The schema in the manual.
fn schema() -> Value {
    let (_, rest) = MANUAL.split_once("```json\n").expect("a schema");
    let (schema, _) = rest.split_once("```").expect("its end");
    serde_json::from_str(schema).expect("JSON")
}

/// The events of a run, each held against the manual.
#[track_caller]
fn events(ran: &Ran) -> Vec<Value> {
    let schema = schema();
    assert!(jsonschema::meta::is_valid(&schema));
    let validator = jsonschema::validator_for(&schema).expect("a schema");
    let parse = |line: &str| serde_json::from_str(line).expect("nothing but JSON");
    let events: Vec<Value> = ran.text().lines().map(parse).collect();
    for event in &events {
        let errors: Vec<String> = validator.iter_errors(event).map(|e| e.to_string()).collect();
        assert!(errors.is_empty(), "{event}: {errors:?}");
        for field in event.as_object().expect("an object").keys() {
            let is_explained = MANUAL
                .lines()
                .any(|line| line.starts_with('|') && line.contains(&format!("`{field}`")));
            assert!(is_explained, "{field}");
        }
    }
    let errors = ran.errors();
    assert!(!errors.lines().any(|line| line.starts_with('{')), "{errors}");
    let last = events.last().expect("an event");
    assert_eq!(last["event"], "end");
    assert_eq!(last["exit_code"].as_i64(), ran.code().map(i64::from));
    events
}

fn kinds(events: &[Value]) -> Vec<&str> {
    events.iter().filter_map(|e| e["event"].as_str()).collect()
}

/// Three frames, the second damaged.
fn one_damaged() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    let file = workshop.join("in/f_2.bgeo");
    fs::write(&file, &fs::read(&file).expect("a frame")[..100]).expect("a file");
    workshop
}

#[test]
fn a_render_from_start_to_end() {
    for options in [&[][..], &["--isolate"]] {
        let workshop = one_damaged();
        let ran = workshop
            .render(&[&["--progress", "json"], options].concat())
            .expect(1)
            .prints("error: frame 2: ");
        let events = events(&ran);
        assert_eq!(kinds(&events), ["start", "frame_done", "frame_failed", "frame_done", "end"]);
        assert_eq!(events[0]["command"], "render");
        assert_eq!(events[0]["total"], 3);
        assert_eq!(events[0]["output"], "out/f.####.exr");
        assert!(events[2]["reason"].as_str().expect("why").contains("f_2.bgeo"));
        assert_eq!(events[4]["done"], 2);
        assert_eq!(events[4]["failed"], serde_json::json!([2]));
        assert!(ran.errors().contains("2 of 3 frames done"));
    }
}

#[test]
fn notes_and_errors() {
    let workshop = one_damaged();
    // Frame 7 makes a gap, which is noted.
    fs::copy(workshop.join("in/f_3.bgeo"), workshop.join("in/f_7.bgeo")).expect("a file");
    let ran = workshop.render(&["--progress", "json", "--frames", "7", "--threads", "1000"]);
    let found = events(&ran.expect(0));
    assert_eq!(kinds(&found).iter().filter(|k| **k == "start").count(), 1);
    let notes: Vec<&str> =
        found.iter().filter(|e| e["event"] == "note").filter_map(|e| e["text"].as_str()).collect();
    assert!(notes.iter().any(|note| note.starts_with("--threads 1000: ")), "{notes:?}");

    let ran = workshop.render(&["--progress", "json", "--force", "--color-by", "nosuch"]);
    let events = events(&ran.expect(2));
    assert_eq!(kinds(&events).last(), Some(&"end"));
    let reason = events.last().expect("an event")["errors"][0].as_str();
    assert!(reason.is_some_and(|r| r.contains("nosuch")), "{reason:?}");
}

#[test]
fn manifest_can_enable_events() {
    let workshop = one_damaged();
    let ran = workshop.render(&["--set", "job.progress=json", "--frames", "1,3"]);
    assert_eq!(kinds(&events(&ran.expect(0))), ["start", "frame_done", "frame_done", "end"]);
}

#[test]
fn followed_frames() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let follow = ["--follow", "--settle", "0.1", "--idle", "0.5"];
    let options = [&["--progress", "json"][..], &follow].concat();
    let found = events(&workshop.render(&options).expect(0));
    assert_eq!(kinds(&found), ["start", "frame_done", "frame_done", "end"]);
}

#[test]
fn a_conversion_and_an_experiment() {
    let workshop = one_damaged();
    let ran = workshop.run(&["convert", "in", "-o", "native", "--progress", "json"]);
    let found = events(&ran.expect(1));
    let frames = ["frame_done", "frame_failed", "frame_done"];
    let mut found_kinds = kinds(&found);
    found_kinds.retain(|kind| *kind != "note");
    assert_eq!(found_kinds, [&["start"], &frames[..], &["end"]].concat());
    assert_eq!(found[0]["command"], "convert");

    let tiny = "scale --particles 100 --structures lbvh,kdtree --motions both --images 1 --width 16 --height 9";
    let arguments: Vec<&str> = tiny.split(' ').chain(["--progress", "json"]).collect();
    let ran = workshop.run(&arguments).expect(0).prints("Images per second");
    let found = events(&ran);
    assert_eq!(kinds(&found), ["start", "cell_done", "cell_done", "end"]);
    assert_eq!(found[3]["done"], 2);
}

#[cfg(target_os = "linux")]
#[test]
fn events_that_cannot_be_written_do_not_end_a_job() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let full = fs::File::options().write(true).open("/dev/full");
    let arguments = ["render", "in", "-o", "out/f.####.exr", "--progress", "json"];
    let mut command = workshop.command(&[&arguments[..], &SMALL].concat());
    command.stdout(full.expect("/dev/full"));
    let ran = Ran(command.output().expect("the program starts")).expect(0);
    let note = "note: standard output: no space left";
    assert_eq!(ran.errors().matches(note).count(), 1, "{}", ran.errors());
}

#[test]
fn quiet_prints_errors_alone() {
    let shop = one_damaged();
    let still = ["still", "in", "--frame", "1", "-o", "a.png", "-q"];
    let ran = shop.run(&[&still[..], &SMALL].concat()).expect(0);
    assert_eq!(ran.errors(), "");
    let ran =
        shop.run(&[&["render", "--quiet", "in", "-o", "out/f.####.exr"], &SMALL[..]].concat());
    let errors = ran.errors();
    assert_eq!(errors.lines().count(), 1, "{errors}");
    assert!(errors.starts_with("error: frame 2: "), "{errors}");
    // The end of a frame is no error
    assert!(!shop.run(&["still", "in", "--frame", "2", "-o", "b.png"]).errors().is_empty());
}
