//! Selections and clips from outside: how many particles are drawn, which ids they have, and what messages say.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;

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
    let report = workshop.report(out);
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
    workshop.run(&[&native[..], &small, &OPTIONS, &by].concat()).expect(0);
    assert_eq!(counts(&workshop, "of_native"), [32, 512]);
    let seen = ids(&workshop, "of_native");
    assert!(seen.len() > 10 && seen.iter().all(|id| id % 4 == 1 && *id < 1128));
}

#[test]
fn clips_and_slices_leave_out_particles() {
    let workshop = particles(NAMES);
    for (name, text, count) in [
        ("slab", "[select]\nslab = { axis = \"y\", center = 3, thickness = 2.5 }", 192),
        ("every", "[select]\nevery = 8\nids = \"1000-1255\"", 32),
        ("plane", "[[clip]]\ntype = \"plane\"\nnormal = \"-x\"\noffset = -3", 320),
        (
            "box",
            "[[clip]]\ntype = \"box\"\nmin = [0, 0, 0]\nmax = [3, 3, 3]\nkeep = \"outside\"",
            448,
        ),
        ("height", "input.up = \"y\"\n[select]\nwhere = \"height >= 6 && z < 2\"", 32),
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
        workshop.run(&[&["render", "job.toml"][..], &small, &OPTIONS].concat()).expect(0);
        assert_eq!(counts(&workshop, name), [count, 512], "{name}");
    }
}

/// Spheres are cut in frames that are read and in native ones, which are traced where they are.
#[test]
fn cuts_draw_the_same_picture_of_native_frames() {
    let workshop = particles(NAMES);
    workshop.run(&["convert", "in", "-o", "native"]).expect(0);
    let cut = "[[clip]]\ntype = \"plane\"\nnormal = [1, -2, 0.5]\npoint = [3.3, 3.4, 3.5]\nmode = \"cut\"\n\
               [[clip]]\ntype = \"box\"\nmin = [-1, -1, 1.2]\nmax = [9, 9, 6.3]\nmode = \"cut\"";
    let camera = "[camera]\neye = [14, -16, 12]\nlook_at = [3.5, 3.5, 3.5]\nup = [0, 0, 1]";
    let options = [&crate::harness::SMALL[..], &OPTIONS].concat();
    for input in ["in", "native"] {
        let text = format!(
            "input.path = \"{input}\"\noutput.path = \"{input}_out/f.####.exr\"\n{cut}\n{camera}\n"
        );
        fs::write(workshop.join("job.toml"), text).expect("a manifest");
        workshop.run(&[&["render", "job.toml"][..], &options].concat()).expect(0);
        assert_eq!(counts(&workshop, &format!("{input}_out")), [512, 512]);
    }
    let report = fs::read_to_string(workshop.join("native_out/report.json")).expect("a report");
    assert!(report.contains("kdtree"), "{report}");
    let picture = |name: &str| Picture::open(&workshop.join(name).join("f.0001.exr"));
    assert_eq!(picture("in_out").planes.keys().len(), 5);
    // Positions in native frames are rounded
    let pairs = [("in_out", "native_out")].map(|(a, b)| (picture(a), picture(b)));
    for (of_file, of_native) in pairs {
        let ids = of_file.integers("id.I").iter().zip(of_native.integers("id.I"));
        let different = ids.filter(|(a, b)| a != b).count();
        assert!(different < 5, "{different}");
    }
    // The lowest layer, with z = 0, is cut away; that of z = 1 shows its upper half
    let seen = ids(&workshop, "in_out");
    assert!(seen.iter().all(|id| *id >= 1064), "{seen:?}");
}

#[test]
fn cuts_that_are_not_possible_are_explained() {
    let workshop = particles(NAMES);
    let with = |clip: &str| {
        let text =
            format!("input.path = \"in\"\noutput.path = \"out/f.####.exr\"\n[[clip]]\n{clip}\n");
        fs::write(workshop.join("job.toml"), text).expect("a manifest");
    };
    with("type = \"box\"\nmin = [0, 0, 0]\nmax = [3, 3, 3]\nkeep = \"outside\"\nmode = \"cut\"");
    let failed = workshop.run(&["render", "job.toml"]).expect(2);
    failed.prints("clip.keep: \"outside\" has no cut faces");
    with("type = \"plane\"\nnormal = \"x\"\nmode = \"cut\"");
    let failed = workshop.run(&["render", "job.toml", "--surface", "smooth"]).expect(2);
    failed.prints("clip.mode: \"cut\" is for spheres");
    with("type = \"plane\"\nnormal = \"x\"\nmode = \"open\"");
    let failed = workshop.run(&["render", "job.toml"]).expect(2);
    failed.prints("particles");
}

#[test]
fn impossible_selections_are_explained() {
    let workshop = particles(NAMES);
    for (condition, message) in [
        (
            "typ == 1",
            "select.where: character 1: no value `typ` in the sampled frames (did you mean `type`?)",
        ),
        ("x > 1 && velocity.x > 2", "character 10: no value `velocity.x`"),
        (
            "depth > 1",
            "no value `depth` in the sampled frames (it depends on the camera, which depends on the particles; \
             conditions have x, y, z and height); available: `height`, `id`, `index`, `part`, `type`, `x`, `y`, `z`",
        ),
        ("x > (1", "--where: character 7: expected `)`"),
        ("(x > 1) > 2", "character 1: `>` needs a number here, and this is a condition"),
    ] {
        workshop.render(&["--where", condition]).expect(2).prints(message);
    }
    // No particle at all
    workshop
        .render(&[&OPTIONS[..], &["--where", "1 / (type - type) < 0"]].concat())
        .expect(0)
        .prints("none of 512 particles is selected");
    assert_eq!(counts(&workshop, "out"), [0, 512]);
    assert_eq!(ids(&workshop, "out"), BTreeSet::new());
}
