//! The simulation cell in pictures: where its edges are, what the channels have there, and files without one.

use std::fs;

use spherule::render::NO_ID;

use crate::harness::Workshop;
use crate::picture::Picture;

/// One atom in the middle of a cube with edges of length 4 from -2 to 2, and the edge of the cube at the front on the
/// left, which leans to the right by 1.
const TILTED: &str = "1\nLattice=\"4 0 0 0 4 0 1 0 4\" Origin=\"-2 -2 -2\" Properties=species:S:1:pos:R:3\nO 0 0 0\n";

/// Looks along +y from a distance of 10 at a field 5 units high at the front of the cell.
const VIEW: [&str; 15] = [
    "--width=90",
    "--height=60",
    "--samples=1",
    "--radius=0.5",
    "--ground=none",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0, -10, 0]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "camera.fov=34.71",
    "--set",
    "output.channels=[\"RGBA\", \"Z\", \"N\", \"id\"]",
];

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    fs::write(workshop.join("in.xyz"), TILTED).expect("a file");
    workshop
}

fn picture(workshop: &Workshop, out: &str, options: &[&str]) -> Picture {
    picture_of(workshop, "in.xyz", out, options)
}

fn picture_of(workshop: &Workshop, input: &str, out: &str, options: &[&str]) -> Picture {
    let command = ["still", input, "-o", out];
    let ran = workshop.run(&[&command[..], &VIEW, options].concat());
    ran.expect(0);
    Picture::open(&workshop.join(out))
}

/// Columns and rows of pixels at edges of the cell in its front, y = -2, 8 units from the camera. The picture is 5
/// units high there, with 12 pixels per unit.
const EDGES: [[usize; 2]; 6] = [
    // The left edge leans from x = -2 at the bottom to -1 at the top: at z = -1, 0 and 1
    [24, 42],
    [27, 30],
    [30, 18],
    // The right one at z = 0, the lower one at x = 0, the upper one at x = 1
    [75, 30],
    [45, 54],
    [57, 6],
];

/// Index of a pixel.
const fn index([column, row]: [usize; 2]) -> usize {
    row * 90 + column
}

#[test]
fn edges_of_a_tilted_cell_are_where_the_file_has_them() {
    let workshop = workshop();
    for integrator in ["whitted", "path"] {
        let with = |name: &str, options: &[&str]| {
            let out = format!("{name}-{integrator}.exr");
            picture(&workshop, &out, &[options, &["--integrator", integrator]].concat())
        };
        let cell = with("cell", &["--cell", "--set", "cell.radius=0.15"]);
        let plain = with("plain", &[]);
        for pixel in EDGES.map(index) {
            assert_eq!(cell.integers("id.I")[pixel], NO_ID, "{pixel}");
            let depth = cell.floats("Z")[pixel];
            assert!((7.84..8.01).contains(&depth), "{pixel}: {depth}");
            assert!(cell.floats("N.Y")[pixel] < -0.3, "{pixel}");
            assert_eq!(cell.floats("A")[pixel], 1.0);
            assert_eq!(plain.floats("A")[pixel], 0.0);
        }
        // Where neither has anything, there is no difference
        let background = index([33, 14]);
        assert_eq!(cell.floats("A")[background], 0.0);
        // The atom is in front of the edges behind it
        let middle = index([45, 30]);
        assert_eq!(cell.floats("Z")[middle], plain.floats("Z")[middle]);
        assert_ne!(cell.integers("id.I")[middle], NO_ID);
    }
}

#[test]
fn native_frames_keep_the_cell() {
    let workshop = workshop();
    workshop.run(&["convert", "in.xyz", "-o", "native"]).expect(0);
    let options = ["--cell", "--set", "cell.radius=0.15", "--integrator", "whitted"];
    let expected = picture(&workshop, "file.exr", &options);
    for access in [&[][..], &["--no-mmap"], &["--where", "x == 0"]] {
        let found = picture_of(&workshop, "native", "native.exr", &[&options[..], access].concat());
        assert_eq!(found.floats("Z"), expected.floats("Z"), "{access:?}");
    }
}

#[test]
fn files_without_a_cell_are_noted() {
    let workshop = Workshop::new();
    fs::write(workshop.join("in.xyz"), "1\nno cell\nO 0 0 0\n").expect("a file");
    let command = ["render", "in.xyz", "-o", "out.exr", "--cell", "--radius=1"];
    let ran = workshop.run(&[&command[..], &VIEW[..3]].concat());
    ran.expect(0).prints("no simulation cell in the file");
    let ran = workshop.run(&[&command[..], &["--set", "cell.radius=0"]].concat());
    ran.expect(2).prints("cell.radius");
}
