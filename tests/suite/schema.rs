//! The manifest's schema, and the files that refer to it; how the work is gone about is kept beside the images.

use std::fs;

use crate::harness::{SMALL, Workshop, dam_break};

const SNAPSHOT: &str = include_str!("../../docs/job.schema.json");

const FIRST_LINE: &str = "#:schema ./job.schema.json\n";

#[test]
fn schema_is_printed_and_stored_beside_the_manifest() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    assert_eq!(workshop.run(&["schema"]).expect(0).text(), SNAPSHOT);
    let init = workshop.run(&["init", "in"]).expect(0).text();
    assert!(init.starts_with(FIRST_LINE), "{init}");
    workshop.render(&[]).expect(0);
    let read = |name: &str| fs::read_to_string(workshop.join(name)).expect("a file");
    assert!(read("out/job.toml").starts_with(FIRST_LINE));
    assert_eq!(read("out/job.schema.json"), SNAPSHOT);
    // A manifest that was given is left alone, and what it refers to need not be there.
    fs::write(workshop.join("my.toml"), init).expect("a file");
    let arguments = [&["render", "my.toml", "-o", "own/f.####.exr"][..], &SMALL].concat();
    workshop.run(&arguments).expect(0);
    assert!(!workshop.join("job.schema.json").exists());
}

#[test]
fn job_settings_are_kept_and_may_change() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let job = workshop.join("out/job.toml");
    let kept = || fs::read_to_string(&job).expect("a manifest");
    let ask = ["--frames", "1", "--threads", "2", "--progress", "plain", "--settle", "3"];
    workshop.render(&ask).expect(0);
    let first = kept();
    for line in ["threads = 2 ", "progress = \"plain\" ", "settle = 3.0 "] {
        assert!(first.contains(&format!("\n{line}")), "{line}\n{first}");
    }
    // Other flags over the manifest that was written are no changed setting, and stay out of it.
    let again = ["render", "out/job.toml", "--frames", "2", "--threads", "1", "--progress", "json"];
    let ran = workshop.run(&again).expect(0);
    assert!(ran.text().contains("{\"done\":1,"), "{}", ran.text());
    assert_eq!(kept(), first);
    workshop.render(&["--progress", "sideways"]).expect(2).prints("sideways");
    workshop
        .render(&["--threads", "-3"])
        .expect(2)
        .prints("--threads: expected \"all\" or a whole number from 1");
}
