//! `inspect` on native frames: all that the index has, bytes by part, and `--verify`.

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value;

use crate::harness::{Workshop, dam_break, sample};

/// A frame with velocities, and without a radius of its own.
fn converted(options: &[&str]) -> Workshop {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), [5]);
    let arguments = [&["convert", "in", "-o", "out"][..], options].concat();
    shop.run(&arguments).expect(0);
    shop
}

const FILE: &str = "out/frame.0005.spf";

fn inspected(shop: &Workshop, options: &[&str]) -> Value {
    let arguments = [&["inspect", "--json", FILE][..], options].concat();
    let ran = shop.run(&arguments).expect(0);
    serde_json::from_str(&ran.text()).expect("one line of JSON")
}

#[track_caller]
fn whole(value: &Value) -> u64 {
    value.as_u64().expect("a whole number")
}

#[track_caller]
fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn index_is_printed_and_parts_add_up() {
    for encoding in ["f32", "q16", "q10"] {
        let shop = converted(&["--encoding", encoding]);
        let object = inspected(&shop, &[]);
        let native = &object["native"];
        let count = whole(&object["count"]);
        assert_eq!(object["encoding"], encoding);
        assert_eq!(object["error_bound"], native["max_error"]);
        assert_eq!(native["blocks"], count.div_ceil(16));
        assert_eq!(native["nodes"], count.div_ceil(128));
        assert_eq!(native["sample"], Value::Null);

        let length = fs::metadata(shop.join(FILE)).expect("a frame").len();
        assert_eq!(native["file_bytes"], length);
        let mut ends = 64;
        let sections = native["sections"].as_array().expect("a list");
        let names: Vec<&str> = sections.iter().filter_map(|s| s["name"].as_str()).collect();
        assert_eq!(names[..3], ["positions", "wide blocks", "nodes"]);
        let mut places: Vec<(u64, u64)> =
            sections.iter().map(|s| (whole(&s["offset"]), whole(&s["bytes"]))).collect();
        places.sort_unstable();
        for (offset, bytes) in places {
            assert!(offset >= ends && offset + bytes < length);
            ends = offset + bytes;
        }

        let each = &native["bytes_per_particle"];
        let parts = ["positions", "radii", "attributes", "nodes", "rest"];
        let sum: f64 = parts.iter().map(|part| number(&each[part])).sum();
        assert!((sum - number(&each["all"])).abs() < 1e-9);
        assert!((number(&each["all"]) * count as f64 - length as f64).abs() < 1e-3);
        let positions = number(&each["positions"]);
        let least = match encoding {
            "f32" => 12.0,
            "q16" => 6.0,
            _ => 4.0,
        };
        assert!((least..least + 12.0).contains(&positions), "{positions}");
        assert_eq!(each["thesis_positions_and_structure"], 350.0);

        let stored = native["attributes"].as_array().expect("a list");
        let attributes = object["attributes"].as_array().expect("a list");
        for of in stored {
            let same = attributes.iter().find(|a| a["name"] == of["name"]);
            assert_eq!(same.expect("listed")["type"], of["stored"]);
            assert_eq!(of["max_error"], 0.0);
        }

        let text = shop.run(&["inspect", FILE]).expect(0).text();
        for words in [
            &format!("{encoding} positions: {count} particles")[..],
            "k-d order",
            "in all",
            "(thesis: 350 bytes per particle)",
            "nodes: ",
            "velocity stored as f32, largest error 0e0",
        ] {
            assert!(text.contains(words), "nothing of `{words}` in:\n{text}");
        }
        assert!(!text.contains("verified"));
    }
}

#[test]
fn verify_detects_damage_that_reading_does_not() {
    let shop = converted(&["--encoding", "q16"]);
    assert_eq!(inspected(&shop, &["--verify"])["verified"], true);
    let text = shop.run(&["inspect", "--verify", FILE]).expect(0).text();
    assert!(text.contains("verified: checksums, nodes, positions"), "{text}");

    let object = inspected(&shop, &[]);
    let mut sections = object["native"]["sections"].as_array().expect("a list").clone();
    sections.retain(|s| whole(&s["bytes"]) > 0);
    let bytes = fs::read(shop.join(FILE)).expect("a frame");
    let padding = sections
        .iter()
        .map(|s| whole(&s["offset"]) + whole(&s["bytes"]))
        .find(|end| !end.is_multiple_of(64))
        .expect("a section that does not end with a line");
    let harm = |at: u64| {
        let mut damaged = bytes.clone();
        damaged[usize::try_from(at).expect("small")] ^= 1;
        fs::write(shop.join(FILE), damaged).expect("a file");
    };
    // Between sections: nobody reads that.
    harm(padding);
    shop.run(&["inspect", FILE]).expect(0);
    let ran = shop.run(&["inspect", "--verify", FILE]).expect(1);
    let message = format!("error: {FILE}: byte {padding}: between the sections are numbers");
    let ran = ran.prints(&message).prints("convert again");
    assert!(ran.text().is_empty());
    // Nor is it overlooked when the frame is packed.
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    let damaged = fs::read(shop.join(FILE)).expect("a frame");
    packed.write_all(&damaged).expect("memory takes all");
    let packed = packed.finish().expect("memory takes all");
    fs::write(shop.join("packed.spf.gz"), packed).expect("a file");
    let ran = shop.run(&["inspect", "packed.spf.gz"]).expect(0);
    assert!(ran.text().contains("bytes per particle"));
    shop.run(&["inspect", "--verify", "packed.spf.gz"])
        .expect(1)
        .prints("error: packed.spf.gz: byte ");
    // In a section: all of a small frame is read and compared.
    for section in &sections {
        let at = whole(&section["offset"]);
        harm(at + whole(&section["bytes"]) / 2);
        for options in [&["inspect", FILE][..], &["inspect", "--verify", FILE]] {
            shop.run(options)
                .expect(1)
                .prints(&format!("error: {FILE}: byte {at}: "))
                .prints("are damaged: the checksum differs; convert again");
        }
    }
}

// Only frames of more than 4,000,000 particles are sampled.
#[test]
fn large_frames_are_sampled() {
    let shop = Workshop::new();
    let count = 4_000_001;
    let particles = count.to_string();
    shop.run(&["generate", "box", "--particles", &particles, "-o", "a.spf"]).expect(0);
    let inspect = |options: &[&str]| shop.run(&[&["inspect", "a.spf"], options].concat());
    let json = |options: &[&str]| -> Value {
        let ran = inspect(&[&["--json"], options].concat()).expect(0);
        serde_json::from_str(&ran.text()).expect("JSON")
    };
    let object = json(&[]);
    assert_eq!(object["count"], count);
    let sample = whole(&object["native"]["sample"]);
    assert!((1000..40_000).contains(&sample), "{sample}");
    // Bounds are those of all particles, and the box is full; the mean is that of the sample.
    for (axis, [low, high]) in [[3.0, 7.0], [5.0, 8.0], [-2.0, 2.0]].into_iter().enumerate() {
        let [min, max] = ["min", "max"].map(|side| number(&object["bounds"][side][axis]));
        assert!(min - low < 1e-5 && high - max < 1e-5, "{min} {max}");
        assert!((number(&object["mean"][axis]) - 0.5 * (low + high)).abs() < 0.1);
    }
    let text = inspect(&[]).expect(0).text();
    let words = format!("from a sample of {sample} particles");
    assert!(text.contains(&words), "{text}");

    // A number that the sample does not have is noticed when asked for only.
    let mut bytes = fs::read(shop.join("a.spf")).expect("a frame");
    bytes[64 + 192 * 3 + 7] ^= 0x7f;
    fs::write(shop.join("a.spf"), bytes).expect("a file");
    assert_eq!(json(&[])["bounds"], object["bounds"]);
    inspect(&["--verify"]).expect(1).prints(
        "error: a.spf: byte 64: the positions are damaged: the checksum differs; convert again",
    );
}

/// Foreign files are read whole anyway; that it is asked for is messages.
#[test]
fn verify_reads_other_formats() {
    let shop = Workshop::new();
    let file = sample("single_frames/raw.xyz").display().to_string();
    let ran = shop.run(&["inspect", "--json", "--verify", &file]).expect(0);
    let object: Value = serde_json::from_str(&ran.text()).expect("JSON");
    assert_eq!(object["verified"], true);
    assert!(object.get("native").is_none());
    fs::write(shop.join("a.xyz"), "2\n\nA 0 0 0\nA 0 x 0\n").expect("a file");
    shop.run(&["inspect", "--verify", "a.xyz"]).expect(1).prints("error: a.xyz: byte ");
}

#[test]
fn the_cell_is_that_of_the_source() {
    let shop = Workshop::new();
    let source = sample("lammps_drop/steps/dump.drop.400.lammps");
    shop.run(&["convert", source.to_str().expect("a path"), "-o", "out"]).expect(0);
    let mut files = fs::read_dir(shop.join("out")).expect("a directory").flatten();
    let native = files.find(|file| file.path().extension().is_some_and(|name| name == "spf"));
    let native = native.expect("a frame").path();
    let [source, native] = [source, native].map(|path| {
        let ran = shop.run(&["inspect", "--json", path.to_str().expect("a path")]).expect(0);
        serde_json::from_str::<Value>(&ran.text()).expect("one line of JSON")
    });
    assert_eq!(native["cell"], source["cell"]);
    assert_eq!(source["cell"]["vectors"].as_array().expect("vectors").len(), 3);
}
