//! `spherule scale` from outside: what it prints and leaves, and what it refuses.

use std::fs;
use std::path::Path;

use glam::Vec3;
use serde_json::Value;
use spherule_formats::write;

use crate::harness::{Ran, Workshop, dam_break, files, no_leftovers};

/// Cells that take a few milliseconds, one a structure.
const TINY: [&str; 9] =
    ["scale", "--images", "2", "--width", "64", "--height", "36", "--motions", "both"];

fn run(workshop: &Workshop, options: &[&str]) -> Ran {
    workshop.run(&[&TINY, options].concat())
}

#[track_caller]
fn report(workshop: &Workshop) -> Value {
    let text = fs::read(workshop.join("scale/scale.json")).expect("a report");
    serde_json::from_slice(&text).expect("JSON")
}

/// Checks that nothing starts, with this reason, and that no files remain.
#[track_caller]
fn refused(workshop: &Workshop, options: &[&str], expected: &str) {
    let before = files(workshop.path());
    let ran = run(workshop, options).expect(2).prints(expected);
    assert!(ran.text().is_empty(), "{}", ran.text());
    assert!(!ran.errors().contains("panicked"), "{}", ran.errors());
    assert!(!workshop.join("scale").exists());
    assert_eq!(files(workshop.path()), before);
}

#[test]
fn tables_and_files_of_a_tiny_run() {
    let workshop = Workshop::new();
    let arguments =
        ["scale", "--particles", "0,1,1e3", "--images", "2", "--width", "64", "--height", "36"];
    let ran = workshop.run(&arguments).expect(0);
    let text = ran.text();
    for heading in [
        "Images per second, rotation: mean (standard deviation)",
        "Images per second, translation",
        "Images per second, both",
        "Build time, s",
        "Peak memory",
    ] {
        assert!(text.contains(heading), "{text}");
    }
    let report = report(&workshop);
    let cells = report["cells"].as_array().expect("cells");
    let structures = report["settings"]["structures"].as_array().expect("names");
    assert_eq!(cells.len(), 3 * 3 * structures.len());
    assert_eq!(report["planned"], cells.len());
    for cell in cells {
        assert_eq!(cell["status"], "done", "{cell}");
        assert_eq!(cell["images"], 2);
        assert_eq!(cell["rays"]["primary"], 2 * 64 * 36);
        let positive = |value: &Value| value.as_f64().is_some_and(|v| v > 0.0);
        let rate = &cell["images_per_second"];
        assert!(positive(&rate["mean"]) && positive(&rate["min"]), "{cell}");
        assert!(rate["sd"].is_f64());
        assert!(positive(&cell["build_seconds"]["median"]));
        assert!(positive(&cell["rays_per_second"]["primary"]));
        if cfg!(target_os = "linux") {
            assert!(positive(&cell["rss"]["anonymous_peak"]));
            assert!(positive(&cell["rss"]["total_peak"]));
        }
        let none = cell["particles"] == 0;
        assert_eq!(cell["bytes_per_particle"].is_null(), none, "{cell}");
    }
    let left = files(&workshop.join("scale"));
    let names: Vec<&str> = left.keys().map(String::as_str).collect();
    assert_eq!(names, ["scale.csv", "scale.html", "scale.json"]);
    let rows = String::from_utf8_lossy(&left["scale.csv"]).lines().count();
    assert_eq!(rows, 1 + cells.len());
    let page = String::from_utf8_lossy(&left["scale.html"]);
    assert!(page.contains("id=\"plot-memory\"") && page.ends_with("</html>\n"));
    no_leftovers(&workshop.join("scale"));

    // Our own results give way to new ones.
    run(&workshop, &["--particles", "10", "--progress", "none"]).expect(0);
    assert_eq!(self::report(&workshop)["settings"]["particles"][0], 10);
}

#[test]
fn native_frames_are_traced_in_place() {
    let workshop = Workshop::new();
    let counts = ["--particles", "0,1,1e4"];
    let representations = ["--representations", "memory,f32,q16,q10"];
    let structures = ["--structures", "lbvh,kdtree"];
    let ran = run(&workshop, &[counts, representations, structures].concat())
        .expect(0)
        .prints("native frames (f32, q16, q10) are traced in place");
    for expected in ["kdtree, q10 file", "Memory by part", "Native frames: converted"] {
        assert!(ran.text().contains(expected), "{}", ran.text());
    }
    let report = report(&workshop);
    let cells = report["cells"].as_array().expect("cells");
    assert_eq!(cells.len(), 3 * 5);
    for cell in cells {
        assert_eq!(cell["status"], "done", "{cell}");
        let in_memory = cell["representation"] == "memory";
        assert_eq!(cell["conversion"].is_null(), in_memory, "{cell}");
        assert!(in_memory || cell["structure"] == "kdtree");
        if !in_memory {
            assert!(cell["conversion"]["file_bytes"].as_u64() > Some(0));
            assert!(cell["conversion"]["seconds"].as_f64() > Some(0.0));
        }
    }
    // The parts add up, and only levels above the stored nodes are in memory.
    let large = |name: &str| {
        let is = |c: &&Value| c["particles"] == 10_000 && c["representation"] == name;
        cells.iter().rfind(is).expect("a cell")
    };
    let share = |name: &str, part: &str| {
        let shares = &large(name)["bytes_per_particle"];
        shares[part].as_f64().expect("a number")
    };
    for (name, least, most) in [("f32", 12.0, 12.8), ("q16", 6.0, 6.9), ("q10", 4.0, 4.9)] {
        let held = share(name, "anonymous") + share(name, "file");
        let parts = ["positions", "structure", "attributes"].map(|part| share(name, part));
        assert!((held - parts.iter().sum::<f64>()).abs() < 1e-9, "{name}");
        assert!((least..most).contains(&held), "{name}: {held}");
        assert!(share(name, "anonymous") < 0.2, "{name}");
        assert!(share(name, "file") >= share(name, "positions"), "{name}");
        let error = &large(name)["conversion"]["max_error_of_radius"];
        assert!(error.as_f64().expect("a number") <= 0.02, "{name}");
    }
    assert_eq!(share("memory", "file"), 0.0);
    assert_eq!(large("f32")["rays"], large("memory")["rays"]);
    let names: Vec<String> = files(&workshop.join("scale")).into_keys().collect();
    assert_eq!(names, ["scale.csv", "scale.html", "scale.json"]);
    no_leftovers(&workshop.join("scale"));
}

#[test]
fn user_frames_are_traced_in_place() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=1);
    // What a run that was killed has left goes.
    let left = workshop.join("scale/.scale-frames");
    fs::create_dir_all(&left).expect("a directory");
    fs::write(left.join("particles.spf"), "half").expect("a file");
    let options = ["--input", "in", "--particles", "500,1e7"];
    let representations = ["--representations", "q10"];
    run(&workshop, &[&options[..], &representations].concat()).expect(0);
    let report = report(&workshop);
    let cells = report["cells"].as_array().expect("cells");
    assert_eq!(cells.len(), 2);
    for cell in cells {
        assert_eq!(cell["structure"], "kdtree");
        assert!(cell["rays"]["shadow"].as_u64() > Some(0), "{cell}");
    }
    no_leftovers(&workshop.join("scale"));
}

#[test]
fn representations_need_a_structure() {
    let workshop = Workshop::new();
    refused(
        &workshop,
        &["--structures", "bvh,sbvh", "--representations", "memory,q10"],
        "--representations q10: native frames can only be traced with kdtree; add kdtree to --structures",
    );
}

/// A disk that is full costs the cells that need it.
#[cfg(target_os = "linux")]
#[test]
fn unwritable_frame_is_reported() {
    let workshop = Workshop::new();
    let program = env!("CARGO_BIN_EXE_spherule");
    // Files of at most 512 blocks: reports fit, a frame of 1e5 does not.
    let script = format!(
        "trap '' XFSZ; ulimit -f 512 && exec {program} scale --particles 1e5 --structures kdtree \
         --representations memory,q16 --motions both --images 1 --width 16 --height 9"
    );
    let output = std::process::Command::new("sh")
        .args(["-c", &script])
        .current_dir(workshop.path())
        .output()
        .expect("a shell");
    Ran(output).expect(1).prints(
        "error: 100000 particles, kdtree in a q16 file, both: cannot make the native frame: ",
    );
    let report = report(&workshop);
    assert_eq!(report["cells"][0]["status"], "done");
    assert_eq!(report["cells"][1]["status"], "failed");
    no_leftovers(&workshop.join("scale"));
}

#[test]
fn user_particles() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let ran = run(&workshop, &["--input", "in", "--particles", "1,500,1e6,1e7", "--frame", "2"]);
    ran.expect(0).prints("particles, which replace 1000000, 10000000");
    let report = report(&workshop);
    assert_eq!(report["settings"]["input"]["frame"], 2);
    let all = &report["settings"]["input"]["particles"];
    let counts = report["settings"]["particles"].as_array().expect("counts");
    assert_eq!(counts[..], [1.into(), 500.into(), all.clone()]);
    for cell in report["cells"].as_array().expect("cells") {
        assert_eq!(cell["status"], "done", "{cell}");
        assert!(cell["rays"]["shadow"].as_u64() > Some(0), "no particle is visible: {cell}");
    }
    run(&workshop, &["--input", "in", "--particles", "1"])
        .expect(0)
        .prints("has 2 frames; measuring frame 1 (--frame selects another)");
}

#[test]
fn one_particle_and_coincident_particles() {
    for count in [1, 100] {
        let workshop = Workshop::new();
        npy(&workshop.join("one.npy"), &vec![[3.0, 4.0, 5.0]; count]);
        run(&workshop, &["--input", "one.npy"]).expect(0);
        let report = report(&workshop);
        let cells = report["cells"].as_array().expect("cells");
        assert!(!cells.is_empty());
        for cell in cells {
            assert_eq!(cell["particles"], count);
            assert!(cell["rays"]["shadow"].as_u64() > Some(0), "no particle is visible: {cell}");
        }
    }
}

#[test]
fn options_have_ranges() {
    let workshop = Workshop::new();
    for (option, value, expected) in [
        ("--particles", "-5", "expected a particle count, such as 100000 or 1e5, found \"-5\""),
        (
            "--particles",
            "1e3,many",
            "expected a particle count, such as 100000 or 1e5, found \"many\"",
        ),
        ("--particles", "", "expected a particle count"),
        ("--particles", "1e10", "expected fewer than 2^32 particles"),
        ("--structures", "lbhv", "did you mean lbvh?"),
        ("--motions", "rotate", "expected one of rotation, translation, both"),
        ("--representations", "f16", "expected one of memory, f32, q16, q10"),
        ("--images", "0", "0 is not in 1.."),
        ("--images", "-1", "-1 is not in 1.."),
        ("--width", "0", "expected a number of pixels from 1 to 65536"),
        ("--height", "-1", "expected a number of pixels from 1 to 65536"),
        ("--samples", "0", "0 is not in 1..=4096"),
        ("--max-depth", "0", "0 is not in 1..=64"),
        ("--depth", "65", "65 is not in 1..=64"),
        ("--threads", "0", "--threads"),
        ("--frame", "3", "--input"),
    ] {
        // Given twice, the fault in the second one would be that it is given twice.
        let options: Vec<&str> = TINY[1..]
            .chunks(2)
            .filter(|pair| pair[0] != option)
            .flatten()
            .copied()
            .chain([option, value])
            .collect();
        let ran = workshop.run(&[&["scale"], &options[..]].concat());
        ran.expect(2).prints(expected);
    }
    for seconds in ["0", "-1", "nan", "inf"] {
        let ran = workshop.run(&["scale", "--seconds", seconds]).expect(2);
        ran.prints("expected seconds above 0");
    }
    refused(&workshop, &["--seconds", "1"], "cannot be used with");
    assert!(files(workshop.path()).is_empty());
}

#[test]
fn inputs_without_particles() {
    let workshop = Workshop::new();
    refused(&workshop, &["--input", "no.vtk"], "no.vtk");
    fs::create_dir(workshop.join("empty")).expect("a directory");
    refused(&workshop, &["--input", "empty"], "empty");
    fs::write(workshop.join("empty.npy"), "").expect("a file");
    refused(&workshop, &["--input", "empty.npy"], "empty.npy");
    npy(&workshop.join("none.npy"), &[]);
    refused(&workshop, &["--input", "none.npy"], "has no particles");
    npy(&workshop.join("nan.npy"), &[[f32::NAN; 3]; 5]);
    refused(&workshop, &["--input", "nan.npy"], "has no particles");
    npy(&workshop.join("two.npy"), &[[0.0; 3], [1.0; 3]]);
    refused(&workshop, &["--input", "two.npy", "--frame", "7"], "--frame 7: ");
}

#[test]
fn unwritable_output_directories() {
    let workshop = Workshop::new();
    fs::write(workshop.join("file"), "mine").expect("a file");
    for place in ["file", "file/deeper"] {
        let expected = "file: is a file, but a directory for the results is needed";
        refused(&workshop, &["-o", place], expected);
    }
    if cfg!(target_os = "linux") {
        refused(&workshop, &["-o", "/proc/nope"], "/proc/nope: cannot be written");
    }
    fs::create_dir(workshop.join("theirs")).expect("a directory");
    for name in ["scale.json", "scale.csv", "scale.html"] {
        fs::write(workshop.join("theirs").join(name), "theirs").expect("a file");
        refused(
            &workshop,
            &["-o", "theirs"],
            &format!("{name}: exists and was not written by `spherule scale`"),
        );
        fs::remove_file(workshop.join("theirs").join(name)).expect("a file");
    }
}

/// A cell that the system gives no memory costs that cell alone.
#[cfg(target_os = "linux")]
#[test]
fn cell_beyond_memory_is_listed_as_failed() {
    let workshop = Workshop::new();
    let program = env!("CARGO_BIN_EXE_spherule");
    // 48 GB of positions in 8 GB of addresses.
    let script = format!(
        "ulimit -v 8000000 && exec {program} scale --particles 100,4e9 --structures lbvh \
         --motions both --images 1 --width 16 --height 9 --threads 2"
    );
    let output = std::process::Command::new("sh")
        .args(["-c", &script])
        .current_dir(workshop.path())
        .output()
        .expect("a shell");
    let ran = Ran(output)
        .expect(1)
        .prints("error: 4000000000 particles, lbvh in memory, both: out of memory: ");
    assert!(ran.text().contains("failed: 4000000000 particles"), "{}", ran.text());
    let report = report(&workshop);
    assert_eq!(report["cells"][0]["status"], "done");
    assert_eq!(report["cells"][1]["status"], "failed");
    let reason = report["cells"][1]["reason"].as_str().expect("a reason");
    assert!(reason.starts_with("out of memory: "), "{reason}");
}

#[cfg(unix)]
#[test]
fn interrupted_runs_keep_finished_cells() {
    let workshop = Workshop::new();
    let counts: Vec<String> = (10..40).map(|n| n.to_string()).collect();
    let arguments = [
        &TINY[..1],
        &TINY[3..],
        &["--structures", "lbvh", "--progress", "plain"],
        &["--seconds", "0.5", "--particles", &counts.join(",")],
    ];
    let mut running = workshop.start(&arguments.concat());
    assert!(running.wait_for_line("[1/30] 10 particles, lbvh in memory, both: build "));
    running.signal("TERM");
    let (errors, status) = running.end();
    assert_eq!(status.code(), Some(75), "{errors}");
    assert!(errors.contains("stopping; finished cells are kept"), "{errors}");
    let report = report(&workshop);
    assert_eq!(report["planned"], 30);
    let cells = report["cells"].as_array().map_or(0, Vec::len);
    assert!((1..30).contains(&cells), "{cells}");
    let page = fs::read_to_string(workshop.join("scale/scale.html")).expect("a page");
    assert!(page.contains(&format!("{} of 30 cells were not measured", 30 - cells)));
    no_leftovers(&workshop.join("scale"));
}

/// Particles where a test wants them.
fn npy(path: &Path, centers: &[[f32; 3]]) {
    let centers: Vec<Vec3> = centers.iter().copied().map(Vec3::from_array).collect();
    write::npy::write(path, &centers).expect("a file");
}
