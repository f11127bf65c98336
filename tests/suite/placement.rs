//! Molecules that stay whole, and groups of particles that stay in place, in the pictures of jobs.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::harness::Workshop;
use crate::picture::Picture;

/// Number of frames.
const FRAMES: usize = 3;

/// A molecule of five carbon atoms, angstroms.
const MOLECULE: [[f64; 3]; 5] =
    [[0.0, 0.0, 0.0], [1.4, 0.0, 0.0], [2.1, 0.0, 1.2], [3.5, 0.0, 1.2], [2.1, 1.4, 1.9]];

/// The edge of the periodic cell.
const EDGE: f64 = 12.0;

/// Looks along +y at the cell: 6 pixels per angstrom, lower left corner at the origin.
const VIEW: [&str; 21] = [
    "--width=72",
    "--height=72",
    "--samples=1",
    "--radius=0.4",
    "--ground=none",
    "--look=none",
    "--where=element == 6",
    "--set",
    "render.denoise=false",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.projection=orthographic",
    "--set",
    "camera.eye=[6, -20, 6]",
    "--set",
    "camera.look_at=[6, 0, 6]",
    "--set",
    "camera.height=12",
    "--set=output.channels=[\"RGBA\", \"id\"]",
    "--color=white",
];

/// Three frames in which the molecule moves through the boundary, and turns about the y axis if `turns`; some argon atoms.
/// All atoms are in the cell.
fn workshop(turns: bool) -> Workshop {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    for frame in 0..FRAMES {
        let step = frame as f64;
        let mut text = format!(
            "8\nLattice=\"{EDGE} 0 0 0 {EDGE} 0 0 0 {EDGE}\" pbc=\"T T T\" Properties=species:S:1:pos:R:3:id:I:1\n"
        );
        let (sine, cosine) = if turns { (step * 0.7).sin_cos() } else { (0.0, 1.0) };
        let mut atom = |species: &str, place: [f64; 3], id: usize| {
            let [x, y, z] = place.map(|x| x.rem_euclid(EDGE));
            let _ = writeln!(text, "{species} {x:.9} {y:.9} {z:.9} {id}");
        };
        for (i, [x, y, z]) in MOLECULE.into_iter().enumerate() {
            let (x, z) = (cosine * x - sine * z, sine * x + cosine * z);
            atom("C", [x + 4.0 + 2.6 * step, y + 11.5, z + 3.0 - 1.7 * step], i + 1);
        }
        for i in 0..3 {
            atom("Ar", [step + 3.0 * i as f64, 5.0, 7.0], i + 6);
        }
        fs::write(workshop.join(format!("in/f_{frame}.xyz")), text).expect("a file");
    }
    workshop
}

/// The middle of the pixels of each atom of the molecule, by frame and id; NaN if it is not in the picture.
fn places(dir: &Path) -> Vec<Vec<[f64; 2]>> {
    let of_frame = |frame: usize| {
        let picture = Picture::open(&dir.join(format!("f.{frame:04}.exr")));
        let ids = picture.integers("id.I");
        let place = |id: u32| {
            let own: Vec<usize> = (0..ids.len()).filter(|pixel| ids[*pixel] == id).collect();
            let mean = |of: fn(usize) -> usize| {
                own.iter().map(|pixel| of(*pixel) as f64 + 0.5).sum::<f64>() / own.len() as f64
            };
            [mean(|pixel| pixel % 72), mean(|pixel| pixel / 72)]
        };
        (1..=5).map(place).collect()
    };
    (0..FRAMES).map(of_frame).collect()
}

/// Renders the frames in `input`, and returns the places of the atoms.
fn rendered(workshop: &Workshop, input: &str, out: &str, options: &[&str]) -> Vec<Vec<[f64; 2]>> {
    let pattern = format!("{out}/f.####.exr");
    let command = ["render", input, "-o", &pattern];
    workshop.run(&[&command[..], &VIEW, options].concat()).expect(0);
    places(&workshop.join(out))
}

/// The largest distance of an atom from its place in the first frame, pixels.
fn motion(places: &[Vec<[f64; 2]>]) -> f64 {
    let distance = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let frames = places.iter().flat_map(|frame| frame.iter().zip(&places[0]));
    // NaN is an atom that is missing
    frames.map(|(a, b)| distance(a, b)).fold(0.0, |m, d| if d <= m { m } else { d })
}

/// Whether the molecule is whole, with its centre in the middle of the picture.
#[track_caller]
fn is_in_the_middle(places: &[Vec<[f64; 2]>]) {
    for frame in places {
        let mean = |axis: usize| frame.iter().map(|place| place[axis]).sum::<f64>() / 5.0;
        assert!((mean(0) - 36.0).abs() < 1.0 && (mean(1) - 36.0).abs() < 1.0, "{frame:?}");
        let extent = frame.iter().map(|place| (place[0] - mean(0)).abs()).fold(0.0, f64::max);
        assert!(extent < 2.0 * 6.0, "{frame:?}");
    }
}

#[test]
fn a_centred_molecule_stays_in_the_middle() {
    let workshop = workshop(false);
    let plain = rendered(&workshop, "in", "plain", &[]);
    assert!(motion(&plain) > 12.0, "{plain:?}");
    let center = ["--unwrap", "--center", "element == 6"];
    let centred = rendered(&workshop, "in", "out", &center);
    is_in_the_middle(&centred);
    assert!(motion(&centred) < 0.5, "{centred:?}");
    // By particles, without molecules
    let loose = rendered(&workshop, "in", "loose", &center[1..]);
    is_in_the_middle(&loose);
    // Native frames are placed as well
    workshop.run(&["convert", "in", "-o", "native"]).expect(0);
    let native = rendered(&workshop, "native", "from-native", &center);
    is_in_the_middle(&native);
    assert!(motion(&native) < 0.5, "{native:?}");
    // One thread gives the same bytes, and so does a job of another part of the frames
    let image = |name: &str| fs::read(workshop.join(name)).expect("an image");
    rendered(&workshop, "in", "serial", &[&center[..], &["--threads", "1"]].concat());
    assert!(image("serial/f.0001.exr") == image("out/f.0001.exr"));
}

#[test]
fn an_aligned_molecule_does_not_turn() {
    let workshop = workshop(true);
    let center = ["--unwrap", "--center", "element == 6"];
    let align = [&center[..], &["--align", "element == 6"]].concat();
    assert!(motion(&rendered(&workshop, "in", "turning", &center)) > 4.0);
    let aligned = rendered(&workshop, "in", "out", &align);
    is_in_the_middle(&aligned);
    assert!(motion(&aligned) < 0.5, "{aligned:?}");
    workshop.run(&["convert", "in", "-o", "native"]).expect(0);
    let native = rendered(&workshop, "native", "from-native", &align);
    assert!(motion(&native) < 0.5, "{native:?}");
    // Those without ids have the particles in another order
    let without_ids = workshop.join("unnumbered");
    fs::create_dir_all(&without_ids).expect("a directory");
    for frame in 0..FRAMES {
        let name = format!("f_{frame}.xyz");
        let text = fs::read_to_string(workshop.join("in").join(&name)).expect("a file");
        fs::write(without_ids.join(name), text.replace(":id:I:1", ":number:I:1")).expect("a file");
    }
    let numbered = ["render", "unnumbered", "-o", "by-order/f.####.exr"];
    workshop.run(&[&numbered[..], &VIEW, &align].concat()).expect(0);
    workshop.run(&["convert", "unnumbered", "-o", "unnumbered-native"]).expect(0);
    let native = ["still", "unnumbered-native", "-o", "a.exr"];
    let ran = workshop.run(&[&native[..], &VIEW, &align].concat());
    assert_ne!(ran.code(), Some(0));
    ran.prints("cell.align needs ids in native frames");
    // The first frame is that of the input, whatever a run renders
    let pattern = "late/f.####.exr";
    let late = ["render", "in", "-o", pattern, "--frames", "2"];
    workshop.run(&[&late[..], &VIEW, &align].concat()).expect(0);
    let image = |name: &str| fs::read(workshop.join(name)).expect("an image");
    assert!(image("late/f.0002.exr") == image("out/f.0002.exr"));
    // It is part of the plan
    fs::remove_file(workshop.join("in/f_0.xyz")).expect("a file");
    let again = ["render", "in", "-o", "out/f.####.exr"];
    workshop.run(&[&again[..], &VIEW, &align].concat()).prints("cell.reference");
}

#[test]
fn groups_that_cannot_be_placed_are_errors_of_their_frames() {
    let workshop = workshop(false);
    let fails = |options: &[&str]| {
        let command = ["still", "in/f_0.xyz", "-o", "a.png", "--width=16", "--height=16"];
        let ran = workshop.run(&[&command[..], options].concat());
        assert_ne!(ran.code(), Some(0), "{options:?}");
        ran.errors()
    };
    let error = fails(&["--center", "element == 92"]);
    assert!(error.contains("cell.center: none of 8 particles meets element == 92"), "{error}");
    let error = fails(&["--center", "residue == 3"]);
    assert!(error.contains("cell.center: character 1: no value `residue`"), "{error}");
    let error = fails(&["--align", "id < 3"]);
    assert!(error.contains("cell.align takes 2 particles"), "{error}");
    let error = fails(&["--align", "element == 18"]);
    assert!(error.contains("on a line"), "{error}");
    // Another number of atoms costs its frame alone
    let text = fs::read_to_string(workshop.join("in/f_1.xyz")).expect("a file");
    let shorter = text.replace("8\n", "7\n").lines().take(9).collect::<Vec<_>>().join("\n");
    fs::write(workshop.join("in/f_1.xyz"), shorter + "\n").expect("a file");
    let ran = workshop.render(&["--align", "id > 0"]).expect(1);
    let errors = ran.errors();
    assert!(errors.contains("takes 7 particles here, but 8 in the first frame"), "{errors}");
    assert!(workshop.join("out/f.0002.exr").exists() && !workshop.join("out/f.0001.exr").exists());
}
