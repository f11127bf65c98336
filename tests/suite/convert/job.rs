//! The directory is a job: the same command does nothing, another setting or input is refused by name,
//! frames that come later or failed are made.

use std::fs;

use glam::Vec3;
use serde_json::Value;

use super::{convert, inspected, number};
use crate::harness::{Workshop, dam_break, ledger, natives, npy, stamps};

const Q16: [&str; 2] = ["--encoding", "q16"];

fn five_frames() -> Workshop {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=5);
    shop
}

#[test]
fn repeated_command_does_nothing() {
    let shop = five_frames();
    let ran = convert(&shop, &Q16).expect(0).prints("5 of 5 frames done");
    assert_eq!(ran.rendered(), [1, 2, 3, 4, 5]);
    let out = shop.join("out");
    let before = stamps(&out);
    // The frames, plan and ledger.
    assert_eq!(before.len(), 5 + 2);
    // The default bound given explicitly, and options that do not change the frames.
    for options in [
        &Q16[..],
        &["--encoding", "q16", "--max-error", "0.02"],
        &["--encoding", "q16", "--threads", "1", "--memory", "2GiB"],
        &["--encoding", "q16", "--attributes", "*:keep"],
    ] {
        let ran = convert(&shop, options).expect(0).prints("5 of 5 frames are done already");
        assert!(ran.rendered().is_empty());
        assert_eq!(stamps(&out), before, "{options:?}");
    }
    // Moved, the directory goes on where it is.
    fs::rename(&out, shop.join("moved")).expect("a rename");
    shop.run(&[&["convert", "in", "-o", "moved"][..], &Q16].concat())
        .expect(0)
        .prints("5 of 5 frames are done already");
}

#[test]
fn changed_settings_are_rejected_with_both_values() {
    let shop = five_frames();
    convert(&shop, &Q16).expect(0);
    let before = stamps(&shop.join("out"));
    for (options, message) in [
        (&["--encoding", "q10"][..], "encoding: q16 -> q10;"),
        (&["--encoding", "q16", "--max-error", "0.1"], "max-error: 0.02 -> 0.1;"),
        (&["--encoding", "q16", "--radius", "0.5"], "radius: auto -> 0.5;"),
        (&["--encoding", "q16", "--no-attributes"], "attributes: *:keep -> *:off;"),
    ] {
        let ran = convert(&shop, options)
            .expect(2)
            .prints("out: settings have changed since this job began: ")
            .prints(message)
            .prints("--force starts over, --keep-done keeps what is there");
        let errors = ran.errors();
        let error_lines = errors.lines().filter(|line| line.starts_with("error:"));
        assert_eq!(error_lines.count(), 1, "{errors}");
        assert_eq!(stamps(&shop.join("out")), before, "{options:?}");
    }
}

#[test]
fn force_starts_over_and_keep_done_continues() {
    let shop = five_frames();
    convert(&shop, &[&Q16[..], &["--frames", "1-3"]].concat()).expect(0);
    let old = natives(&shop.join("out"));
    let fresh = ["convert", "in", "-o", "fresh", "--encoding", "q10"];
    shop.run(&fresh).expect(0);
    let fresh = natives(&shop.join("fresh"));

    let q10 = ["--encoding", "q10"];
    let ran = convert(&shop, &[&q10[..], &["--keep-done"]].concat()).expect(0);
    assert_eq!(ran.rendered(), [4, 5]);
    let mixed = natives(&shop.join("out"));
    assert_eq!(mixed.len(), 5);
    for (name, bytes) in &mixed {
        assert!(old.get(name).or(fresh.get(name)) == Some(bytes), "{name}");
    }

    let ran = convert(&shop, &[&q10[..], &["--force"]].concat()).expect(0);
    assert_eq!(ran.rendered(), [1, 2, 3, 4, 5]);
    assert!(natives(&shop.join("out")) == fresh);
    // Nothing is forgotten for a job that cannot be.
    let before = stamps(&shop.join("out"));
    convert(&shop, &["--attributes", "nosuch:off", "--force"]).expect(2);
    assert_eq!(stamps(&shop.join("out")), before);
}

#[test]
fn changed_input_is_rejected_by_name() {
    let shop = five_frames();
    convert(&shop, &Q16).expect(0);
    fs::copy(shop.join("in/f_5.bgeo"), shop.join("in/f_2.bgeo")).expect("a copy");
    convert(&shop, &Q16)
        .expect(2)
        .prints("inputs of finished frames have changed: frame 2: in/f_2.bgeo: ");
    let ran = convert(&shop, &[&Q16[..], &["--keep-done"]].concat()).expect(0);
    assert!(ran.rendered().is_empty());
}

#[test]
fn appended_frames_are_converted_as_the_first_ones_were() {
    let shop = Workshop::new();
    let far = Vec3::new(1000.0, 0.0, 0.0);
    for frame in 1..=2 {
        npy(&shop.join(format!("in/f_{frame}.npy")), 3000, frame, far);
    }
    convert(&shop, &Q16).expect(0);
    let resolved = || {
        let text = fs::read(shop.join("out/job.plan.json")).expect("the plan");
        let plan: Value = serde_json::from_slice(&text).expect("JSON");
        plan["plan"]["resolved"].clone()
    };
    let settled = resolved();
    // Alone it would have another origin and another radius.
    npy(&shop.join("in/f_3.npy"), 9000, 3, 3.0 * far);
    let ran = convert(&shop, &Q16).expect(0).prints("2 of 3 frames are done already");
    assert_eq!(ran.rendered(), [3]);
    assert_eq!(resolved(), settled);
    let radius = |file: &str| number(&inspected(&shop, file)["radius"]);
    let [first, third] = ["out/frame.0001.spf", "out/frame.0003.spf"].map(radius);
    assert_eq!(first, third);
    fs::create_dir(shop.join("alone")).expect("a directory");
    fs::rename(shop.join("in/f_3.npy"), shop.join("alone/f_3.npy")).expect("a rename");
    shop.run(&["convert", "alone", "-o", "alone-out"]).expect(0);
    assert_ne!(radius("alone-out/frame.0003.spf"), first);
}

#[test]
fn one_damaged_frame_costs_one_frame() {
    let shop = five_frames();
    let file = shop.join("in/f_3.bgeo");
    let good = fs::read(&file).expect("a frame");
    fs::write(&file, &good[..good.len() / 2]).expect("a file");
    let ran = convert(&shop, &Q16)
        .expect(1)
        .prints("error: frame 3: in/f_3.bgeo: byte ")
        .prints("4 of 5 frames done")
        .prints("failed: 3");
    assert_eq!(ran.rendered(), [1, 2, 4, 5]);
    assert_eq!(ran.errors().matches("error:").count(), 1);
    assert_eq!(natives(&shop.join("out")).len(), 4);

    let before = stamps(&shop.join("out"));
    let ran = convert(&shop, &Q16).expect(1).prints("failed: 3");
    assert!(ran.rendered().is_empty());
    fs::write(&file, &good).expect("a file");
    let ran = convert(&shop, &Q16).expect(0).prints("5 of 5 frames done");
    assert_eq!(ran.rendered(), [3]);
    let after = stamps(&shop.join("out"));
    for (name, stamp) in before.iter().filter(|(name, _)| name.ends_with(".spf")) {
        assert_eq!(after.get(name), Some(stamp), "{name}");
    }
}

#[test]
fn lost_and_truncated_frames_are_redone() {
    let shop = five_frames();
    convert(&shop, &Q16).expect(0);
    let whole = natives(&shop.join("out"));
    fs::remove_file(shop.join("out/frame.0002.spf")).expect("a frame");
    let bytes = &whole["frame.0004.spf"];
    fs::write(shop.join("out/frame.0004.spf"), &bytes[..bytes.len() / 2]).expect("a file");
    let ran = convert(&shop, &Q16).expect(0);
    assert_eq!(ran.rendered(), [2, 4]);
    assert!(natives(&shop.join("out")) == whole);
}

#[test]
fn conversion_options_take_effect() {
    let shop = five_frames();
    for (range, frames) in [("3-4", &[3, 4][..]), ("5,1", &[5, 1]), ("1-9", &[2])] {
        let ran = convert(&shop, &["--frames", range]).expect(0);
        assert_eq!(ran.rendered(), frames, "{range}");
    }
    assert_eq!(ledger(&shop.join("out")).lines.len(), 5);
    shop.run(&["convert", "in", "-o", "whole"]).expect(0);
    assert!(natives(&shop.join("out")) == natives(&shop.join("whole")));
}

#[test]
fn any_number_of_threads_makes_the_same_frames() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), [1, 5, 9]);
    npy(&shop.join("large/f_1.npy"), 150_000, 7, Vec3::ZERO);
    for input in ["in", "large"] {
        let made = |threads: &str| {
            let out = format!("{input}-{threads}");
            let options = ["--max-error", "0.02", "--threads", threads];
            shop.run(&[&["convert", input, "-o", &out][..], &options].concat()).expect(0);
            natives(&shop.join(out))
        };
        let one = made("1");
        assert!(!one.is_empty());
        assert!(one == made("4"), "{input}");
    }
}
