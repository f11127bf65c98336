//! Options of `spherule convert`, and combinations that are rejected.

use std::fs;

use super::{convert, inspected};
use crate::harness::{Workshop, dam_break, files, ledger_path, natives, npy};

fn names(shop: &Workshop, file: &str) -> Vec<String> {
    let object = inspected(shop, file);
    let attributes = object["attributes"].as_array().expect("a list");
    let name = |a: &serde_json::Value| a["name"].as_str().expect("a name").to_owned();
    let mut names: Vec<String> = attributes.iter().map(name).collect();
    names.sort();
    names
}

#[test]
fn attributes_are_omitted_by_name_or_wildcard() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), [1]);
    convert(&shop, &[]).expect(0);
    let all = names(&shop, "out/frame.0001.spf");
    assert!(all.contains(&"density".to_owned()), "{all:?}");
    for (choices, kept) in [
        (&["--attributes", "Density:off,*:keep"][..], {
            let mut all = all.clone();
            all.retain(|name| name != "density");
            all
        }),
        (&["--attributes", "density:keep,*:off"], vec!["density".to_owned(), "radius".to_owned()]),
        (&["--no-attributes"], vec!["radius".to_owned()]),
    ] {
        convert(&shop, &[choices, &["--force"]].concat()).expect(0);
        // The radius is none of them: frames without would be drawn otherwise.
        assert_eq!(names(&shop, "out/frame.0001.spf"), kept, "{choices:?}");
    }
    convert(&shop, &["--attributes", "pressure:off", "--force"])
        .expect(2)
        .prints("--attributes: no frame has `pressure`; there are ")
        .prints("`density`");
}

#[test]
fn attributes_are_stored_in_fewer_bits() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), [1]);
    for (choices, stored) in [
        ("velocity:f16,density:u8", ["i32", "8-bit", "f16"]),
        ("*:f16", ["i32", "f16", "f16"]),
        ("*:u8,velocity:keep,id:off", ["", "8-bit", "f32"]),
    ] {
        convert(&shop, &["--attributes", choices, "--force"]).expect(0);
        let object = inspected(&shop, "out/frame.0001.spf");
        let list = object["native"]["attributes"].as_array().expect("a list");
        for (name, expected) in ["id", "density", "velocity"].into_iter().zip(stored) {
            let found = list
                .iter()
                .find(|a| a["name"] == name)
                .map_or("", |a| a["stored"].as_str().expect("a name"));
            assert_eq!(found, expected, "{choices}: {name}");
        }
    }
    convert(&shop, &["--attributes", "id:f16", "--force"])
        .expect(1)
        .prints("attribute id holds ids");
}

/// Native frames are in another order than their files.
#[test]
fn file_indices_are_stored_as_ids_on_request() {
    let shop = Workshop::new();
    npy(&shop.join("in/f_1.npy"), 3000, 1, glam::Vec3::ZERO);
    convert(&shop, &[]).expect(0);
    assert!(!names(&shop, "out/frame.0001.spf").contains(&"id".to_owned()));
    convert(&shop, &["--ids", "--force"]).expect(0);
    let object = inspected(&shop, "out/frame.0001.spf");
    let list = object["attributes"].as_array().expect("a list");
    let id = list.iter().find(|a| a["name"] == "id").expect("ids");
    assert_eq!((&id["min"][0], &id["max"][0]), (&0.into(), &2999.into()), "{id}");
}

#[test]
fn contradictory_options_are_rejected() {
    let shop = Workshop::new();
    shop.run(&["convert", "nothing", "-o", "x"]).expect(2);
    dam_break(&shop.join("in"), 1..=1);
    for (options, message) in [
        (&["--encoding", "q11"][..], "f32, q16, q10"),
        (&["--max-error", "-1"], "-1"),
        (&["--attributes", "velocity"], "write NAME:HOW"),
        (&["--attributes", "velocity:f64"], "keep, f32, f16, u8, off"),
        (&["--no-attributes", "--attributes", "a:off"], "cannot be used with"),
        (&["--memory", "much"], "expected a size, such as 4GiB"),
        (&["--frames", "7-9"], "--frames: 7-9 contains none of the frames of the input: 1"),
        (&["--frames", "x"], "--frames"),
        (&["--force", "--keep-done"], "cannot be used with"),
    ] {
        convert(&shop, options).expect(2).prints(message);
        assert!(!shop.join("out").exists(), "{options:?}");
    }
}

#[test]
fn foreign_output_directory_is_rejected() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=2);
    fs::write(shop.join("out"), "a file").expect("a file");
    convert(&shop, &[])
        .expect(2)
        .prints("out: is a file, but a directory for the frames is needed");
    fs::remove_file(shop.join("out")).expect("a file");

    // A job that renders, and the other way round.
    shop.render(&[]).expect(0);
    let before = files(&shop.join("out"));
    convert(&shop, &[])
        .expect(2)
        .prints("out: contains a job of `render`, not of `convert`; choose another directory");
    assert!(files(&shop.join("out")) == before);
    shop.run(&["convert", "in", "-o", "native"]).expect(0);
    shop.render_to("native", &[])
        .expect(2)
        .prints("native: contains a job of `convert`, not of `render`");

    // Frames are not converted onto themselves.
    let before = natives(&shop.join("native"));
    fs::remove_file(shop.join("native/job.plan.json")).expect("the plan");
    fs::remove_file(ledger_path(&shop.join("native"))).expect("the ledger");
    for (input, message) in [
        ("native", "native: is the input; choose another directory"),
        (
            "native/frame.#.spf",
            "native/frame.0001.spf: the conversion would overwrite its own input",
        ),
    ] {
        shop.run(&["convert", input, "-o", "native"]).expect(2).prints(message);
    }
    assert!(natives(&shop.join("native")) == before);
}

#[cfg(target_os = "linux")]
#[test]
fn unwritable_file_system() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=1);
    shop.run(&["convert", "in", "-o", "/proc/nope/frames"]).expect(2).prints("error: /proc/nope");
}

#[test]
fn progress_modes() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=2);
    let text = convert(&shop, &["--progress", "json"]).expect(0).text();
    let mut objects: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    objects.retain(|object| object["event"] == "frame_done");
    assert_eq!(objects.len(), 2, "{text}");
    for (object, frame) in objects.iter().zip(1..) {
        assert_eq!(object["frame"], frame);
        assert_eq!((&object["done"], &object["total"]), (&frame.into(), &2.into()));
        assert!(object["particles"].as_u64() > Some(0), "{object}");
        let output = object["output"].as_str().expect("a path");
        assert!(output.ends_with(&format!("/out/frame.000{frame}.spf")), "{output}");
    }
    let ran = convert(&shop, &["--progress", "openjd", "--force"]).expect(0);
    assert!(ran.text().contains("openjd_progress: 100.0"), "{}", ran.text());
    let quiet = convert(&shop, &["--progress", "none", "--force"]).expect(0);
    assert!(quiet.rendered().is_empty());
}
