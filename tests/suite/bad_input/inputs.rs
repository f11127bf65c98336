//! Inputs that are no sequence of particles.

use std::fs;

use glam::Vec3;
use serde_json::Value;

use super::refused;
use crate::harness::{SMALL, Workshop, dam_break, npy};

#[track_caller]
fn no_sequence(workshop: &Workshop, input: &str, expected: &[&str]) {
    refused(workshop, &["render", input, "-o", "out/f.####.exr"], expected);
    assert!(!workshop.join("out").exists());
    refused(workshop, &["init", input], &expected[..1]);
}

#[test]
fn missing_paths_are_named() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    no_sequence(&workshop, "no-such-place", &["error: no-such-place: no such file or directory"]);
    no_sequence(&workshop, "in/f_7.bgeo", &["in/f_7.bgeo: no such file", "f_1.bgeo"]);
    no_sequence(
        &workshop,
        "in/nothing_#.bgeo",
        &["in/nothing_#.bgeo: no file name fits this pattern", "f_1.bgeo"],
    );
    no_sequence(&workshop, "nowhere/f_#.bgeo", &["nowhere"]);
    refused(&workshop, &["render", "in/job.toml"], &["in/job.toml: "]);
}

#[test]
fn only_similar_names_are_suggested() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("dump"), 1..=3);
    fs::write(workshop.join("picture.files.exr"), b"").expect("a file");
    no_sequence(
        &workshop,
        "dunp",
        &["error: dunp: no such file or directory; closest in `.`: dump"],
    );
    let ran = workshop.run(&["render", "elsewhere"]).expect(2);
    assert!(!ran.errors().contains("picture.files.exr"), "{}", ran.errors());
    for arguments in [
        &["render", "dump", "--mesh", "tank.stl"][..],
        &["render", "dump", "--topology", "tank.stl"],
        &["render", "dump", "--camera-path", "tank.stl"],
    ] {
        fs::write(workshop.join("tonk.stl"), b"").expect("a file");
        refused(
            &workshop,
            arguments,
            &["tank.stl: no such file or directory; closest in `", "`: tonk.stl"],
        );
    }
    let ran = workshop.run(&["inspect", "dump/f_9.bgeo"]).expect(1);
    ran.prints("dump/f_9.bgeo: no such file or directory; closest in `dump`: f_1.bgeo");
}

#[test]
fn a_job_is_continued_by_its_manifest() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    workshop.render(&["--frames", "1"]).expect(0);
    refused(
        &workshop,
        &["render", "out"],
        &["out: the directory of a render job; continue it with: spherule render out/job.toml"],
    );
    fs::rename(workshop.join("in"), workshop.join("moved")).expect("a directory");
    refused(
        &workshop,
        &["render", "out/job.toml"],
        &[
            "out/job.toml: input.path: out/../in: no such file or directory",
            "if the files have moved: spherule render NEW_PLACE -o out/f.####.exr",
        ],
    );
    let inspected = workshop.run(&["inspect", "out/job.toml"]).expect(1);
    inspected.prints("out/job.toml: a manifest, not particles; check it with: spherule check");
}

#[test]
fn inspect_continues_after_a_missing_path() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1, 2]);
    let arguments = ["nowhere/f_#.bgeo", "in/f_7.bgeo", "in/f_#.bgeo"];
    let ran = workshop.run(&[&["inspect", "--json"], &arguments[..]].concat()).expect(1);
    let lines: Vec<Value> =
        ran.text().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines.len(), 4);
    for (line, argument) in lines.iter().zip(&arguments[..2]) {
        assert_eq!(line["file"], *argument);
        assert!(line["error"].is_string(), "{line}");
    }
    assert_eq!((&lines[2]["frame"], &lines[3]["frame"]), (&1.into(), &2.into()));

    let ran = workshop
        .run(&[&["inspect"], &arguments[..]].concat())
        .expect(1)
        .prints("error: nowhere")
        .prints("error: in/f_7.bgeo: ");
    assert_eq!(ran.text().matches("10422 particles").count(), 2);
}

#[test]
fn directories_without_particles_list_their_content() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.join("empty")).expect("a directory");
    no_sequence(&workshop, "empty", &["empty: no particle files here; the directory is empty"]);
    fs::create_dir(workshop.join("papers")).expect("a directory");
    for name in ["a.txt", "b.txt", "c.json"] {
        fs::write(workshop.join("papers").join(name), "words").expect("a file");
    }
    no_sequence(
        &workshop,
        "papers",
        &["papers: no particle files here; it has ", "2 .txt", "1 .json"],
    );
}

#[test]
fn unknown_formats_show_the_first_bytes() {
    let workshop = Workshop::new();
    let render = |file: &str, expected: &[&str]| {
        refused(&workshop, &["render", file, "-o", "out/f.exr"], expected);
        assert!(!workshop.join("out").exists());
        let error = workshop.run(&["inspect", file]).expect(1).errors();
        assert!(expected[1..].iter().all(|text| error.contains(text)), "{error}");
    };
    fs::write(workshop.join("words.dat"), "garbage here").expect("a file");
    render(
        "words.dat",
        &[
            "error: no frame can be read: ",
            "words.dat: byte 0: no particle format begins with `garbage `",
            "vtk",
        ],
    );
    fs::write(workshop.join("wrong.bgeo"), [0x91, 3, 7, 200, 11, 90, 1, 2]).expect("a file");
    render(
        "wrong.bgeo",
        &[
            "error: no frame can be read: ",
            "wrong.bgeo: byte 0: named like a bgeo file, but does not begin like one",
        ],
    );
    fs::write(workshop.join("none.vtk"), "").expect("a file");
    render("none.vtk", &["error: no frame can be read: ", "none.vtk: "]);
}

#[test]
fn two_sequences_in_a_directory_need_a_pattern() {
    let workshop = Workshop::new();
    for (name, frames) in [("fluid", 1..4), ("snow", 50..55)] {
        for frame in frames {
            npy(&workshop.join(format!("in/{name}_{frame}.npy")), 50, 1, Vec3::ZERO);
        }
    }
    no_sequence(
        &workshop,
        "in",
        &[
            "in: 2 sequences are here; give the pattern of one: ",
            "snow_",
            "fluid_",
            "(5 frames)",
            "(3 frames)",
        ],
    );
    let arguments = [&["render", "in/fluid_#.npy", "-o", "out/f.####.exr"][..], &SMALL].concat();
    assert_eq!(workshop.run(&arguments).expect(0).rendered(), [1, 2, 3]);
}

#[test]
fn manifest_excludes_other_inputs() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    fs::write(workshop.join("job.toml"), "[input]\npath = \"in\"\n").expect("a file");
    refused(
        &workshop,
        &["render", "job.toml", "in"],
        &["job.toml: a manifest must be the only input; its input.path names the particles"],
    );
}
