//! A torn last line is dropped; any other damage is an error and never a fresh start.

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
        .tells("out/job.ledger.")
        .tells(".jsonl: line 2: not a ledger entry")
        .tells("remove that line to do its frame again, or start over with --force");
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
        .tells("out/job.plan.json: this is no readable plan")
        .tells("--force");
    fs::remove_file(&plan).expect("a plan");
    workshop
        .render(&[])
        .expect(2)
        .tells("the ledger has lines but job.plan.json is missing")
        .tells("--force");
    fs::write(&plan, &text).expect("a file");
    workshop
        .render(&[])
        .expect(0)
        .tells("3 of 3 frames are done already");
    let mut after = stamps(&workshop.join("out"));
    after.insert("job.plan.json".to_owned(), before["job.plan.json"]);
    assert_eq!(after, before);

    fs::write(&plan, "{}").expect("a file");
    let ran = workshop.render(&["--force"]).expect(0);
    assert_eq!(ran.rendered(), [1, 2, 3]);
}
