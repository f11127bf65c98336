//! A small file that becomes very large costs its own frame and no other, within little memory.
//!
//! Bombs unpack to some hundred megabytes: they have to be much larger than the memory that is allowed.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::AWAY;
use crate::harness::{Ran, Workshop, ledger};

/// Data of the process in KiB: half of what the bomb takes as text, a quarter as numbers.
const ALLOWED: usize = 64 << 10;

const SMALL: [&str; 8] = ["--width", "32", "--height", "18", "--samples", "1", "--threads", "2"];

fn gz(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}

/// Three frames of which the second is a bomb; gzip states the length of its last part only, so that nothing
/// is known before it is unpacked.
fn frames(dir: &Path) {
    fs::create_dir_all(dir).expect("a directory");
    let good = |frame: usize| format!("x,y,z\n0,0,0\n1,0,{frame}\n0,1,0\n");
    let piece = gz("1,2,3\n".repeat(1 << 20).as_bytes());
    let mut bomb = gz(b"x,y,z\n");
    (0..20).for_each(|_| bomb.extend(&piece));
    bomb.extend(gz(b"1,2,3\n"));
    assert!(bomb.len() < 1 << 19, "{} bytes", bomb.len());
    for (frame, bytes) in [(1, gz(good(1).as_bytes())), (2, bomb), (3, gz(good(3).as_bytes()))] {
        fs::write(dir.join(format!("f_{frame}.csv.gz")), bytes).expect("a file");
    }
}

/// Runs the program with so little memory for its data.
fn limited(workshop: &Workshop, kibibytes: usize, arguments: &[&str]) -> Ran {
    let script = format!("ulimit -d {kibibytes} && exec \"$0\" \"$@\"");
    let output = Command::new("sh")
        .current_dir(workshop.path())
        .args(["-c", &script, env!("CARGO_BIN_EXE_spherule")])
        .args(arguments)
        .output();
    Ran(output.expect("a shell"))
}

#[test]
fn a_bomb_costs_one_frame() {
    for options in [
        &[][..],
        &["--memory-limit", "48MiB"],
        &["--memory-limit", "48MiB", "--isolate", "--memory-ceiling", "48MiB"],
    ] {
        let workshop = Workshop::new();
        frames(&workshop.join("in"));
        let render = ["render", "in", "-o", "out/f.####.exr", "--radius", "0.1"];
        let ran = limited(&workshop, ALLOWED, &[&render[..], &SMALL, &AWAY, options].concat())
            .expect(1)
            .prints("f_2.csv.gz: its numbers in memory are larger than")
            .prints("failed: 2");
        assert_eq!(ran.rendered(), [1, 3], "{options:?}");
        let lines = ledger(&workshop.join("out")).lines;
        let failed = lines.iter().filter(|l| l["status"] == "failed");
        assert_eq!(failed.count(), 1);
    }
}

#[test]
fn check_and_inspect_name_a_bomb() {
    let workshop = Workshop::new();
    frames(&workshop.join("in"));
    let check = ["check", "in", "-o", "out/f.####.exr"];
    let ran = limited(&workshop, ALLOWED, &[&check[..], &SMALL, &AWAY].concat());
    assert!(matches!(ran.code(), Some(0 | 1)), "{}", ran.errors());
    let ran = limited(&workshop, ALLOWED, &["inspect", "in"]).expect(1);
    let output = ran.text() + &ran.errors();
    assert!(output.contains("f_2.csv.gz") && output.contains("larger than"), "{output}");
}

/// The text of 200 000 particles in numbers of so many digits that it takes 40 MB, twenty times of what they take.
fn wide_rows(prefix: &str) -> String {
    let number = "0".repeat(66) + "1.5";
    format!("{prefix}{number} {number} {number}\n").repeat(200_000)
}

// Four formats of 40 MB of text or more: less would fit into the memory as a whole.
#[test]
fn compressed_text_is_streamed() {
    let count = 200_000;
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
         property float z\nend_header\n"
    );
    let vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n";
    let dump = |step: usize| {
        format!("ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{count}\nITEM: ATOMS x y z\n")
    };
    let rows = wide_rows("");
    let atoms = wide_rows("He ");
    for (name, text) in [
        ("a.ply.gz", [&ply, &rows].map(|s| &**s).concat()),
        ("a.vtk.gz", format!("{vtk}POINTS {count} float\n{rows}")),
        ("a.xyz.gz", format!("{count}\n\n{atoms}{count}\n\n{atoms}")),
        ("dump.0.gz", [&dump(0), &rows, &dump(1), &rows].map(|s| &**s).concat()),
    ] {
        let workshop = Workshop::new();
        fs::write(workshop.join(name), gz(text.as_bytes())).expect("a file");
        drop(text);
        let ran = limited(&workshop, 32 << 10, &["inspect", name, "--json"]).expect(0);
        assert!(ran.text().contains("200000"), "{name}: {}", ran.text());
    }
}

#[test]
fn the_memory_of_a_conversion_bounds_reading() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.join("in")).expect("a directory");
    // 6 MB and 84 MB of positions; at least 64 MiB are used
    for (name, count) in [("f_1.csv", 500_000), ("f_2.csv", 7_000_000)] {
        let text = format!("x,y,z\n{}", "1,2,3\n".repeat(count));
        fs::write(workshop.join("in").join(name), text).expect("a file");
    }
    let convert = ["convert", "in", "-o", "out", "--radius", "0.1"];
    let ran = workshop.run(&[&convert[..], &["--memory", "1KiB"]].concat());
    ran.expect(1).prints("f_2.csv: its numbers in memory are larger than").prints("raise --memory");
    assert!(workshop.join("out/frame.0001.spf").exists());
    assert!(!workshop.join("out/frame.0002.spf").exists());
}
