//! `spherule convert` from outside: foreign frames become native ones and still show the same.

use std::fs;

use serde_json::Value;

use crate::harness::{Ran, Workshop, dam_break};

mod job;
mod options;
mod stopped;

/// Converts `in` to `out` with these options.
fn convert(shop: &Workshop, options: &[&str]) -> Ran {
    shop.run(&[&["convert", "in", "-o", "out"], options].concat())
}

/// The output of `inspect --json` for the file.
fn inspected(shop: &Workshop, file: &str) -> Value {
    let ran = shop.run(&["inspect", "--json", file]).expect(0);
    serde_json::from_str(&ran.text()).expect("one line of JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn native_frames_contain_the_source_data() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=2);
    for (encoding, options) in [
        ("f32", &["--encoding", "f32"][..]),
        ("q16", &["--encoding", "q16"][..]),
        ("q10", &["--encoding", "q10", "--max-error", "0.05"][..]),
    ] {
        let arguments = [&["convert", "in", "-o", encoding][..], options].concat();
        shop.run(&arguments).expect(0).prints("2 of 2 frames");
        for frame in 1..=2 {
            let from = inspected(&shop, &format!("in/f_{frame}.bgeo"));
            let to = inspected(&shop, &format!("{encoding}/frame.000{frame}.spf"));
            assert_eq!((&to["format"], &to["count"]), (&"spf".into(), &from["count"]));
            assert_eq!(to["encoding"], encoding);
            let bound = number(&to["error_bound"]);
            assert_eq!(bound == 0.0, encoding == "f32");
            for axis in 0..3 {
                for side in ["min", "max"] {
                    let [a, b] = [&from, &to].map(|i| number(&i["bounds"][side][axis]));
                    assert!((a - b).abs() <= bound, "{side} {axis}: {a} {b}, {bound}");
                }
            }
            let names = |of: &Value| {
                let attributes = of["attributes"].as_array().expect("a list");
                let named = attributes.iter().map(|a| a["name"].to_string());
                named.filter(|n| n != "\"radius\"").collect::<Vec<_>>()
            };
            assert_eq!(names(&from), names(&to));
        }
    }
}

#[test]
fn renders_of_exact_frames_are_those_of_the_originals() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=1);
    shop.run(&["convert", "in", "-o", "native", "--radius", "0.02"]).expect(0);
    let pixels = |input: &str| {
        let image = format!("{input}-out/f.#.exr");
        let size = ["--width", "64", "--height", "36", "--samples", "1"];
        // What is up is known of both.
        let options = ["--radius", "0.02", "--channels", "RGBA,Z,N"];
        let arguments = [&["render", input, "-o", &image][..], &size, &options].concat();
        shop.run(&arguments).expect(0);
        let found = fs::read_dir(shop.join(format!("{input}-out"))).expect("readable");
        let png = found
            .map(|entry| entry.expect("readable").path())
            .find(|path| path.extension().is_some_and(|e| e == "png"));
        fs::read(png.expect("a preview")).expect("readable")
    };
    assert!(pixels("in") == pixels("native"));
}
