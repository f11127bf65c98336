//! Materials of parts of the particles: in all ways to trace them, and what is refused.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::AttributeValue;
use spherule::accel::Structure;

use crate::harness::{Ran, Workshop, images};

const SMALL: [&str; 10] = [
    "--width",
    "64",
    "--height",
    "36",
    "--samples",
    "4",
    "--radius",
    "0.5",
    "--channels",
    "RGBA,Z,cryptomatte",
];

/// Three layers of particles of the parts 1, 2 and 3 in `frames` frames.
fn particles(frames: u32) -> Workshop {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    for frame in 1..=frames {
        let mut csv = "x,y,z,type\n".to_owned();
        for i in 0..192 {
            let (x, y, layer) = (i % 8, i / 8 % 8, i / 64);
            let _ = writeln!(csv, "{x},{y},{layer},{}", layer + 1);
        }
        fs::write(workshop.join(format!("in/f_{frame}.csv")), csv).expect("a file");
    }
    workshop
}

const PARTS: &str = r#"
input.path = "in"
[[material.part]]
parts = [2]
type = "metal"
roughness = 0.2
color = [0.9, 0.6, 0.4]
[[material.part]]
parts = [3]
type = "plastic"
"#;

fn job(workshop: &Workshop, text: &str) {
    fs::write(workshop.join("job.toml"), text).expect("a manifest");
}

fn render(workshop: &Workshop, input: &str, out: &str, options: &[&str]) -> Ran {
    let pattern = format!("{out}/f.####.exr");
    let path = format!("input.path={input:?}");
    let command = ["render", "job.toml", "-o", &pattern, "--set", &path];
    workshop.run(&[&command[..], &SMALL, options].concat())
}

// Starts the program 15 times: each of three inputs is traced in four ways.
#[test]
fn images_do_not_depend_on_how_particles_are_traced() {
    let workshop = particles(1);
    job(&workshop, PARTS);
    for (native, options) in [("f32", &[][..]), ("q16", &["--max-error", "0.05"])] {
        let convert = ["convert", "in", "-o", native, "--encoding", native];
        workshop.run(&[&convert[..], options].concat()).expect(0);
    }
    // Native frames have other ids of particles, and those of 16 bits other positions
    let mut first: BTreeMap<&str, _> = BTreeMap::new();
    for input in ["in", "f32", "q16"] {
        let others = [&["--threads", "1"][..], &["--threads", "3"], &["--isolate"], &["--no-mmap"]];
        let ways = Structure::ALL.iter().zip(others);
        for (number, (structure, other)) in ways.enumerate() {
            let way = &[&["--accelerator", structure.name()], other].concat();
            let out = format!("{input}-{number}");
            let ran = render(&workshop, input, &out, way).expect(0);
            assert!(!ran.errors().contains("no particle is of style"));
            let made = images(&workshop.join(&out));
            assert!(!made.is_empty());
            let made: Vec<_> = made.into_values().collect();
            let expected = first.entry(input).or_insert_with(|| made.clone());
            assert!(*expected == made, "{input} {way:?}");
        }
    }
    // They differ from images of one material
    job(&workshop, "input.path = \"in\"");
    render(&workshop, "in", "plain", &[]).expect(0);
    let plain: Vec<_> = images(&workshop.join("plain")).into_values().collect();
    assert!(plain != first["in"]);
}

/// The names in the manifest of the layer of materials.
fn material_names(path: &Path) -> Vec<String> {
    let meta = MetaData::read_from_file(path, true).expect("an EXR");
    let texts: BTreeMap<String, String> = (meta.headers[0].own_attributes.other.iter())
        .filter_map(|(name, value)| match value {
            AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
            _ => None,
        })
        .collect();
    let name = texts.iter().find(|(_, text)| *text == "crypto_material");
    let key = name.expect("a layer").0.replace("/name", "/manifest");
    let names: BTreeMap<String, String> = serde_json::from_str(&texts[&key]).expect("JSON");
    names.into_keys().collect()
}

#[test]
fn cryptomatte_names_the_materials_of_parts() {
    let workshop = particles(1);
    job(&workshop, PARTS);
    render(&workshop, "in", "out", &[]).expect(0);
    let names = material_names(&workshop.join("out/f.0001.exr"));
    assert_eq!(names[..2], ["material0", "material1"]);
    assert!(names.contains(&"particles".to_owned()));
}

// Starts the program seven times: some faults show in a frame only.
#[test]
fn absent_parts_are_reported_and_missing_attributes_refused() {
    let workshop = particles(1);
    job(&workshop, &format!("{PARTS}[[material.part]]\nparts = [76, 77]\n"));
    let absent = "frame 1: no particle is of style `material.part.2`";
    let ran = render(&workshop, "in", "absent", &[]).expect(0);
    assert!(ran.errors().contains(absent), "{}", ran.errors());
    workshop.run(&["convert", "in", "-o", "native"]).expect(0);
    let ran = render(&workshop, "native", "absent-native", &[]).expect(0);
    assert!(ran.errors().contains(absent), "{}", ran.errors());
    // What cannot have parts is refused before anything is rendered
    for (options, message) in [
        (
            &["--integrator", "whitted"][..],
            "material.part: render.integrator = \"whitted\" has one material",
        ),
        (&["--surface", "union"], "material.part: one body has one material"),
    ] {
        let ran = render(&workshop, "in", "refused", options).expect(2);
        assert!(ran.errors().contains(message), "{}", ran.errors());
    }
    fs::create_dir_all(workshop.join("plain")).expect("a directory");
    fs::write(workshop.join("plain/f_1.csv"), "x,y,z,kind\n1,2,3,4\n2,3,4,5\n").expect("a file");
    let ran = render(&workshop, "plain", "none", &[]).expect(2);
    let message = "no attribute says which part a particle is of: it would be called one of `part`, `type`, `phase`";
    assert!(ran.errors().contains(message), "{}", ran.errors());
    // Fractions are no parts
    fs::write(workshop.join("plain/f_1.csv"), "x,y,z,type\n1,2,3,2.5\n2,3,4,3\n").expect("a file");
    let ran = render(&workshop, "plain", "fractions", &[]).expect(0);
    let message = "no particle is of style `material.part.0`";
    assert!(ran.errors().contains(message), "{}", ran.errors());
}

#[test]
fn a_changed_part_stops_a_job() {
    let workshop = particles(2);
    job(&workshop, PARTS);
    render(&workshop, "in", "out", &["--frames", "1"]).expect(0);
    job(&workshop, &PARTS.replace("0.2", "0.3"));
    let ran = render(&workshop, "in", "out", &[]).expect(2);
    assert!(ran.errors().contains("material.part.0.roughness"), "{}", ran.errors());
}
