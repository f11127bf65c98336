//! Selections and clips from outside: how many particles are drawn, which ids they have, and what messages say.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;

use serde_json::Value;

use crate::harness::Workshop;
use crate::picture::Picture;

/// A frame of 512 particles on a grid, with the types 0 to 3 and ids from 1000 on; `header` replaces their names.
fn particles(header: &str) -> Workshop {
    let workshop = Workshop::new();
    let mut csv = format!("{header}\n");
    for i in 0..512 {
        let (x, y, z) = (i % 8, i / 8 % 8, i / 64);
        let _ = writeln!(csv, "{x},{y},{z},{},{}", i % 4, 1000 + i);
    }
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    fs::write(workshop.join("in/f_1.csv"), csv).expect("a file");
    workshop
}

const NAMES: &str = "x,y,z,type,id";

const OPTIONS: [&str; 4] = ["--radius", "0.4", "--channels", "RGBA,id"];

/// The numbers of particles that are drawn and that are read, from `report.json`.
fn counts(workshop: &Workshop, out: &str) -> [u64; 2] {
    let text = fs::read_to_string(workshop.join(out).join("report.json")).expect("a report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    ["particles", "particles_read"].map(|key| {
        let number = report["totals"][key].as_u64();
        number.unwrap_or_else(|| panic!("no {key}: {report}"))
    })
}

fn ids(workshop: &Workshop, out: &str) -> BTreeSet<u32> {
    let picture = Picture::open(&workshop.join(out).join("f.0001.exr"));
    let ids = picture.integers("id.I").iter().copied();
    ids.filter(|id| *id != u32::MAX).collect()
}

#[test]
fn selected_particles_are_drawn_with_their_ids() {
    let workshop = particles(NAMES);
    workshop.run(&["convert", "in", "-o", "native"]).expect(0);
    let by = ["--where", "type == 1 && z < 2"];
    workshop.render(&[&OPTIONS[..], &by].concat()).expect(0);
    assert_eq!(counts(&workshop, "out"), [32, 512]);
    let seen = ids(&workshop, "out");
    assert!(seen.len() > 10, "{seen:?}");
    assert!(seen.iter().all(|id| id % 4 == 1 && *id < 1128), "{seen:?}");
    let native = ["render", "native", "-o", "of_native/f.####.exr"];
    let small = crate::harness::SMALL;
    workshop
        .run(&[&native[..], &small, &OPTIONS, &by].concat())
        .expect(0);
    assert_eq!(counts(&workshop, "of_native"), [32, 512]);
    let seen = ids(&workshop, "of_native");
    assert!(seen.len() > 10 && seen.iter().all(|id| id % 4 == 1 && *id < 1128));
}

#[test]
fn clips_and_slices_leave_out_particles() {
    let workshop = particles(NAMES);
    for (name, text, count) in [
        (
            "slab",
            "[select]\nslab = { axis = \"y\", center = 3, thickness = 2.5 }",
            192,
        ),
        ("every", "[select]\nevery = 8\nids = \"1000-1255\"", 32),
        (
            "plane",
            "[[clip]]\ntype = \"plane\"\nnormal = \"-x\"\noffset = -3",
            320,
        ),
        (
            "box",
            "[[clip]]\ntype = \"box\"\nmin = [0, 0, 0]\nmax = [3, 3, 3]\nkeep = \"outside\"",
            448,
        ),
        (
            "both",
            "[[clip]]\ntype = \"plane\"\nnormal = [1, 1, 0]\npoint = [1, 0, 0]\n\
             [[clip]]\ntype = \"plane\"\nnormal = \"z\"",
            3,
        ),
    ] {
        let text = format!("input.path = \"in\"\noutput.path = \"{name}/f.####.exr\"\n{text}\n");
        fs::write(workshop.join("job.toml"), text).expect("a manifest");
        let small = crate::harness::SMALL;
        workshop
            .run(&[&["render", "job.toml"][..], &small, &OPTIONS].concat())
            .expect(0);
        assert_eq!(counts(&workshop, name), [count, 512], "{name}");
    }
}

#[test]
fn impossible_selections_are_explained() {
    let workshop = particles(NAMES);
    for (condition, message) in [
        (
            "typ == 1",
            "select.where: character 1: no value `typ` in the sampled frames (did you mean `type`?)",
        ),
        (
            "x > 1 && velocity.x > 2",
            "character 10: no value `velocity.x`",
        ),
        ("x > (1", "select.where: character 7: expected `)`"),
        (
            "(x > 1) > 2",
            "character 1: `>` needs a number here, and this is a condition",
        ),
    ] {
        workshop
            .render(&["--where", condition])
            .expect(2)
            .prints(message);
    }
    // No particle at all
    workshop
        .render(&[&OPTIONS[..], &["--where", "1 / (type - type) < 0"]].concat())
        .expect(0)
        .prints("none of 512 particles is selected");
    assert_eq!(counts(&workshop, "out"), [0, 512]);
    assert_eq!(ids(&workshop, "out"), BTreeSet::new());
}
