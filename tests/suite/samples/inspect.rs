//! `inspect --json` on every sample: the object that scripts rely on.

use serde_json::Value;

use super::data_files;
use crate::harness::{Workshop, sample};

const KEYS: [&str; 18] = [
    "attributes",
    "bonds",
    "bounds",
    "bytes_per_particle",
    "cell",
    "count",
    "dropped",
    "encoding",
    "error_bound",
    "file",
    "format",
    "frame",
    "mean",
    "notes",
    "parts",
    "radius",
    "time",
    "topology",
];
const ATTRIBUTE_KEYS: [&str; 8] =
    ["components", "labels", "max", "mean", "min", "name", "sum", "type"];

/// Runs `inspect --json` on `files` and parses each line.
#[track_caller]
fn inspect(files: &[String], code: i32) -> Vec<Value> {
    let arguments: Vec<&str> =
        ["inspect", "--json"].into_iter().chain(files.iter().map(String::as_str)).collect();
    let ran = Workshop::new().run(&arguments).expect(code);
    let lines = ran.text();
    let parsed = lines.lines().map(|l| serde_json::from_str(l).expect(l));
    parsed.collect()
}

fn paths(directory: &str) -> Vec<String> {
    let full = |name| sample(&format!("{directory}/{name}")).display().to_string();
    data_files(directory).into_iter().map(full).collect()
}

fn keys(object: &Value) -> Vec<&str> {
    let map = object.as_object().expect("an object");
    let mut keys: Vec<&str> = map.keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

/// The shape that every object has, whatever is in it.
#[track_caller]
fn check_shape(object: &Value) {
    assert_eq!(keys(object), KEYS, "{object}");
    for key in ["count", "dropped"] {
        assert!(object[key].is_u64(), "{object}");
    }
    let empty = object["count"] == 0;
    for key in ["bounds", "mean"] {
        assert_eq!(object[key].is_null(), empty, "{object}");
    }
    for attribute in object["attributes"].as_array().expect("a list") {
        assert_eq!(keys(attribute), ATTRIBUTE_KEYS, "{attribute}");
        let components = attribute["components"].as_u64().expect("a number");
        let is_float = attribute["type"].as_str().expect("a name").starts_with('f');
        for key in ["min", "max", "mean", "sum"] {
            let values = attribute[key].as_array().expect("a list");
            assert_eq!(values.len() as u64, components, "{attribute}");
            for value in values.iter().filter(|_| !empty) {
                assert!(value.is_number(), "{attribute}");
                let is_whole = key != "mean" && !is_float;
                assert_eq!(value.is_i64() || value.is_u64(), is_whole, "{attribute}");
            }
        }
    }
}

#[test]
fn one_frame_in_every_format() {
    let objects = inspect(&paths("single_frames"), 0);
    assert_eq!(objects.len(), data_files("single_frames").len());
    for object in objects {
        check_shape(&object);
        assert_eq!(object["count"], 1200, "{object}");
        assert_eq!(object["dropped"], 0, "{object}");
        assert_eq!(object["error_bound"], 0.0, "{object}");
        let mean = [0.222_775, 0.508_420, 0.041_543_5];
        for (found, expected) in object["mean"].as_array().expect("a list").iter().zip(mean) {
            let found = found.as_f64().expect("a number");
            assert!((found - expected).abs() < 1e-6, "{object}");
        }
        // The ids are 15..10421 with gaps; their sum is exact. LAMMPS counts from 1.
        let expected = if object["format"] == "lammps" { 10_022_102 } else { 10_020_902 };
        let attributes = object["attributes"].as_array().expect("a list");
        let ids = attributes.iter().find(|a| {
            let name = a["name"].as_str().expect("a name");
            ["id", "ids", "Idp"].contains(&name)
        });
        if let Some(ids) = ids {
            assert_eq!(ids["sum"], serde_json::json!([expected]), "{object}");
        }
    }
}

#[test]
fn files_that_cannot_be_read_are_objects_too() {
    for (directory, refused) in [
        ("public_partio", vec!["test.geo", "test.pdb"]),
        ("public_splashsurf", vec!["cube_normals.ply"]),
        ("pysph", vec!["dam_break_3d_00300.npz"]),
    ] {
        let files = paths(directory);
        let objects = inspect(&files, 1);
        assert_eq!(objects.len(), files.len());
        for (file, object) in files.iter().zip(&objects) {
            assert_eq!(object["file"], file.as_str());
            if refused.iter().any(|name| file.ends_with(name)) {
                assert_eq!(keys(object), ["error", "file"]);
            } else {
                check_shape(object);
            }
        }
    }
}

/// A file by itself has the number that `render` would give its image.
#[test]
fn frame_numbers_are_those_of_the_images() {
    for (file, frame) in [
        ("emitter_sph/ParticleData_Fluid_10.bgeo", 10),
        ("lammps_drop/dump.drop.1200.lammps.gz", 1200),
        ("pysph/dam_break_3d_fluid_00100.vtu", 100),
        ("public_splashsurf/dam_break_frame_9_6859_particles.bgeo", 9),
        ("public_splashsurf/double_dam_break_frame_26_4732_particles.vtk", 26),
    ] {
        let objects = inspect(&[sample(file).display().to_string()], 0);
        assert_eq!(objects.len(), 1);
        assert_eq!(objects[0]["frame"], frame, "{file}");
    }
    let workshop = Workshop::new();
    std::fs::copy(sample("lammps_drop/steps/dump.drop.400.lammps"), workshop.join("dump.400"))
        .expect("a copy");
    let ran = workshop.run(&["inspect", "--json", "dump.400"]).expect(0);
    let object: Value = serde_json::from_str(&ran.text()).expect("one object");
    assert_eq!(object["frame"], 400);
}

#[test]
fn a_file_of_several_steps_gives_an_object_each() {
    let file = sample("lammps_drop/drop_4frames.lammpstrj").display().to_string();
    let objects = inspect(&[file], 0);
    let frames: Vec<i64> = objects.iter().filter_map(|o| o["frame"].as_i64()).collect();
    assert_eq!(frames, [0, 400, 800, 1200]);
    for object in &objects {
        check_shape(object);
        assert_eq!(object["count"], 200);
        assert_eq!(object["attributes"][0]["sum"][0], 200 * 201 / 2);
    }
}

/// Scripts see the cell and the notes that people see.
#[test]
fn cells_and_notes_are_in_the_object() {
    let objects = inspect(&[sample("molecules/water.gro").display().to_string()], 0);
    check_shape(&objects[0]);
    let vectors = objects[0]["cell"]["vectors"].as_array().expect("vectors");
    assert_eq!(vectors.len(), 3);
    assert!(vectors[0][0].as_f64().is_some_and(|length| length > 0.0));
    assert_eq!(objects[0]["cell"]["periodic"], serde_json::json!([true, true, true]));
    assert!(!objects[0]["notes"].as_array().expect("notes").is_empty());
    // Also of files that are read in blocks
    let objects = inspect(&[sample("hdf5/gadget.hdf5").display().to_string()], 0);
    assert!(objects[0]["cell"]["vectors"].is_array(), "{}", objects[0]);
}

/// Parts have their numbers and names, and bonds and the topology are there.
#[test]
fn parts_bonds_and_the_topology_are_in_the_object() {
    let objects = inspect(&[sample("hdf5/gadget.hdf5").display().to_string()], 0);
    let parts = objects[0]["parts"].as_array().expect("parts");
    assert!(parts.iter().any(|part| part["number"] == 0 && part["name"] == "PartType0"));
    let file = sample("molecules/water.gro").display().to_string();
    let objects = inspect(std::slice::from_ref(&file), 0);
    assert!(objects[0]["parts"].is_null() && objects[0]["topology"].is_null());
    assert_eq!(objects[0]["bonds"], 0);
    let arguments = ["inspect", "--json", &file, "--topology", &file];
    let text = Workshop::new().run(&arguments).expect(0).text();
    let first = text.lines().next().expect("a frame");
    let object: Value = serde_json::from_str(first).expect("an object");
    assert_eq!(object["topology"], file.as_str());
}

/// As text, steps that are like the one before are counted.
#[test]
fn a_long_trajectory_has_its_first_and_last_step_as_text() {
    let workshop = Workshop::new();
    let step = |number: usize, count: usize| {
        let atoms: String = (0..count).map(|i| format!("C {i} {number} 0\n")).collect();
        format!("{count}\nstep\n{atoms}")
    };
    let steps: String =
        (0..40).map(|number| step(number, if number == 20 { 4 } else { 3 })).collect();
    std::fs::write(workshop.join("long.xyz"), steps).expect("a file");
    let text = workshop.run(&["inspect", "long.xyz"]).expect(0).text();
    let shown = text.lines().filter(|line| line.starts_with("long.xyz"));
    assert_eq!(shown.count(), 4, "{text}");
    for skipped in ["... 19 steps with as many", "... 17 steps with as many"] {
        assert!(text.contains(skipped), "{text}");
    }
    assert!(text.ends_with("  all 40 steps: 3 to 4 particles, the same attributes\n"), "{text}");
}

/// So do the files of a directory, with what differs.
#[test]
fn a_long_sequence_of_files_has_its_first_and_last_as_text() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.join("run")).expect("a directory");
    for number in 0..10 {
        let comment = if number < 5 {
            format!("Lattice=\"{} 0 0 0 9 0 0 0 9\" Time={number}", number + 9)
        } else {
            format!("Time={number}")
        };
        let text = format!("1\n{comment}\nC 0 0 0\n");
        std::fs::write(workshop.join(format!("run/f_{number}.xyz")), text).expect("a file");
    }
    let text = workshop.run(&["inspect", "run"]).expect(0).text();
    let shown: Vec<&str> = text.lines().filter(|line| line.starts_with("run/")).collect();
    assert_eq!(shown.len(), 3, "{text}");
    assert!(shown[1].starts_with("run/f_5.xyz") && shown[2].starts_with("run/f_9.xyz"), "{text}");
    let end = "  all 10 files: 1 particles each, time 0 to 9, the same attributes, 5 with a cell\n";
    assert!(text.contains("... 4 files with as many") && text.ends_with(end), "{text}");
    let objects = workshop.run(&["inspect", "run", "--json"]).expect(0).text();
    assert_eq!(objects.lines().count(), 10);
    // A damaged one is named, whichever it is
    std::fs::write(workshop.join("run/f_3.xyz"), "x").expect("a file");
    workshop.run(&["inspect", "run"]).expect(1).prints("run/f_3.xyz");
}

#[test]
fn a_pattern_gives_its_sequence_with_frames_without_particles() {
    let pattern = sample("emitter_sph").join("ParticleData_Fluid_#.bgeo");
    let objects = inspect(&[pattern.display().to_string()], 0);
    let found: Vec<(i64, u64)> = objects
        .iter()
        .map(|o| (o["frame"].as_i64().expect("a frame"), o["count"].as_u64().expect("a count")))
        .collect();
    assert_eq!(found, [(1, 0), (2, 0), (3, 90), (4, 300), (5, 480), (10, 1410)]);
    for object in &objects {
        check_shape(object);
        let count = object["count"].as_i64().expect("a count");
        // An emitter numbers what it makes: 0, 1, 2...
        assert_eq!(object["attributes"][0]["sum"][0], count * (count - 1) / 2);
    }
}
