//! What is printed: every result arrives or is missed, and nothing that comes from outside controls the terminal or
//! forges a line.

use std::fs;

use spherule_formats::is_control;

use crate::harness::{Ran, SMALL, Workshop, dam_break};

/// Clears the screen, begins a line of its own, and turns the direction of what follows; one byte of the C1 set
/// begins a sequence, too.
const HOSTILE: &str = "a\u{1b}[2J\nforged: b\r\u{9b}31m\u{202e}c";

/// Fails the test if anything of [`HOSTILE`] arrived as it is.
#[track_caller]
fn clean(ran: &Ran) {
    for text in [ran.text(), ran.errors()] {
        let found = text.chars().find(|c| is_control(*c) && *c != '\n');
        assert_eq!(found, None, "{text:?}");
        let forged = text.lines().find(|line| line.starts_with("forged"));
        assert_eq!(forged, None, "{text}");
    }
}

/// The escaped form of [`HOSTILE`].
const TOLD: &str = "\\nforged: b";

#[cfg(unix)]
// Starts the program 18 times: every command prints names in its own way.
#[test]
fn external_names_are_printed_escaped() {
    let workshop = Workshop::new();
    dam_break(&workshop.join(HOSTILE), 1..=3);
    let damaged = workshop.join(HOSTILE).join("f_2.bgeo");
    fs::write(&damaged, &fs::read(&damaged).expect("a frame")[..100]).expect("a file");
    let output = format!("{HOSTILE}-out/f.####.exr");
    let render = ["render", HOSTILE, "-o", &output];
    for progress in ["plain", "openjd", "json"] {
        let options = ["--force", "--progress", progress];
        let ran = workshop.run(&[&render[..], &SMALL, &options].concat());
        clean(&ran.expect(1));
    }
    let job = format!("{HOSTILE}-out");
    let manifest = format!("{job}/job.toml");
    let native = format!("{HOSTILE}-native");
    for (arguments, code) in [
        (&["inspect", HOSTILE][..], 1),
        (&["inspect", "--json", HOSTILE], 1),
        (&["status", &job], 1),
        (&["status", &job, "--json"], 1),
        (&["verify", &job], 0),
        (&["verify", &job, "--json"], 0),
        (&["check", &manifest], 0),
        (&["check", &manifest, "--json"], 0),
        (&["init", HOSTILE], 0),
        (&["convert", HOSTILE, "-o", &native], 1),
        (&["inspect", &native, "--verify"], 0),
        (&["export", "slurm", &manifest], 2),
        (&["export", "openjd", &manifest], 2),
    ] {
        let ran = workshop.run(arguments).expect(code);
        clean(&ran);
    }
    // What is escaped means what it meant.
    let init = workshop.run(&["init", HOSTILE]).expect(0).text();
    let table: toml::Table = init.parse().expect("TOML");
    assert_eq!(table["input"]["path"].as_str(), Some(HOSTILE));
    let status = workshop.run(&["status", &job, "--json"]).expect(1).text();
    let status: serde_json::Value = serde_json::from_str(&status).expect("JSON");
    assert!(status["directory"].as_str().expect("a path").contains(HOSTILE));
}

#[test]
fn attributes_are_printed_escaped() {
    let workshop = Workshop::new();
    // VTK files can spell any character.
    let spell = |c: char| {
        let mut bytes = [0; 4];
        let bytes = c.encode_utf8(&mut bytes).bytes();
        bytes.map(|b| format!("%{b:02X}")).collect::<String>()
    };
    let name: String = HOSTILE.chars().map(spell).collect();
    let head = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n";
    let vtk = format!(
        "{head}POINTS 2 float\n0 0 0 1 1 1\nPOINT_DATA 2\nSCALARS {name} float\nLOOKUP_TABLE default\n1 2\n"
    );
    fs::write(workshop.join("a.vtk"), vtk).expect("a file");
    let ran = workshop.run(&["inspect", "a.vtk"]).expect(0);
    clean(&ran);
    assert!(ran.text().contains(TOLD), "{}", ran.text());
    let ran = workshop.run(&["inspect", "a.vtk", "--json"]).expect(0);
    clean(&ran);
    let json: serde_json::Value = serde_json::from_str(&ran.text()).expect("JSON");
    assert_eq!(json["attributes"][0]["name"], HOSTILE);
    let render = ["render", "a.vtk", "-o", "out/f.exr"];
    let unknown = [&render[..], &SMALL, &["--color-by", "nosuch"]].concat();
    clean(&workshop.run(&unknown).expect(2).prints(TOLD));
    let known = [&render[..], &SMALL, &["--color-by", HOSTILE]].concat();
    clean(&workshop.run(&known).expect(0).prints(TOLD));
    for command in [&["check", "out/job.toml"][..], &["init", "out/job.toml"]] {
        clean(&workshop.run(command).expect(0));
    }
    let converted = workshop.run(&["convert", "a.vtk", "-o", "native"]);
    clean(&converted.expect(0));
    clean(&workshop.run(&["inspect", "native"]).expect(0));
}

#[test]
fn arguments_and_manifests_are_quoted_escaped() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    let key = "a\\u001b[2J\\nforged: b\\u009b\\u202e";
    let manifests = [
        format!("input.path = \"in\"\n\"{key}\" = 1\n"),
        format!("input.path = \"in\"\nrender.surface = \"{key}\"\n"),
        format!("input.path = \"in\"\nmaterial.color = {{ attribute = \"v\", map = \"{key}\" }}\n"),
        format!("input.path = \"{key}\"\n"),
        format!("input.path = \"in\"\n\"render.{key}\".x = 1\n"),
    ];
    for text in manifests {
        fs::write(workshop.join("hostile.toml"), &text).expect("a file");
        let ran = workshop.run(&["render", "hostile.toml"]).expect(2);
        clean(&ran.prints("forged: b"));
    }
    let flag = format!("--{HOSTILE}");
    let value = format!("--width={HOSTILE}");
    let set = format!("{HOSTILE}=3");
    for arguments in [
        &[HOSTILE][..],
        &["render", HOSTILE],
        &["render", "in", &flag],
        &["render", "in", &value],
        &["render", "in", "--progress", HOSTILE],
        &["render", "in", "--set", &set],
        &["render", "in", "--frames", HOSTILE],
        &["render", "in", "--shard", HOSTILE],
        &["render", "in", "--look", HOSTILE],
        &["generate", "box", "--particles", HOSTILE, "-o", "a.npy"],
        &["scale", "--structures", HOSTILE],
        &["status", HOSTILE],
        &["export", "slurm", HOSTILE],
    ] {
        let ran = workshop.run(arguments).expect(2);
        assert!(ran.errors().contains(TOLD), "{}", ran.errors());
        clean(&ran);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_result_that_cannot_be_written_is_an_error() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    workshop.render(&[]).expect(0);
    let scale =
        "scale --particles 10 --structures lbvh --motions both --images 1 --width 16 --height 9";
    let scale: Vec<&str> = scale.split(' ').collect();
    for arguments in [
        &["status", "out"][..],
        &["status", "out", "--json"],
        &["status", "out", "--watch"],
        &["inspect", "in"],
        &["inspect", "in", "--json"],
        &["check", "out/job.toml"],
        &["check", "out/job.toml", "--json"],
        &["verify", "out"],
        &["verify", "out", "--json"],
        &["init", "in"],
        &["schema"],
        &["export", "slurm", "out/job.toml"],
        &["export", "openjd", "out/job.toml"],
        &scale,
        &["--help"],
        &["-h"],
        &["--version"],
        &["help", "render"],
        &["render", "--help"],
    ] {
        let full = fs::File::options().write(true).open("/dev/full");
        let mut command = workshop.command(arguments);
        command.stdout(full.expect("/dev/full"));
        let ran = Ran(command.output().expect("the program starts"));
        assert_eq!(ran.code(), Some(2), "{arguments:?}: {}", ran.errors());
        ran.prints("error: standard output: no space left");
    }
}
