//! Trails in pictures: where particles were, and frames in which they cannot be found.

use std::fs;

use spherule::render::NO_ID;

use crate::harness::{Workshop, images};
use crate::picture::Picture;

/// The view of `arrows.rs`: 9.6 pixels per unit at the particles.
const VIEW: [&str; 15] = [
    "--width=90",
    "--height=60",
    "--samples=1",
    "--radius=0.5",
    "--ground=none",
    "--set",
    "render.denoise=false",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0, -10, 0]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "camera.fov=34.71",
];

const CHANNELS: [&str; 2] = ["--set", "output.channels=[\"RGBA\", \"Z\", \"id\"]"];

/// A frame of atoms with ids and places along x, at a height by id: 1 in the middle, 2 at z = 2.
fn write(workshop: &Workshop, frame: u32, cell: &str, atoms: &[(u32, f32)]) {
    let mut text = format!("{}\n{cell}Properties=species:S:1:pos:R:3:id:I:1\n", atoms.len());
    for (id, x) in atoms {
        text += &format!("O {x} 0 {} {id}\n", 2 * (id - 1));
    }
    fs::write(workshop.join(format!("f_{frame}.xyz")), text).expect("a file");
}

/// Atom 1 moves from x = -4 to 4 by 2 in each frame; atom 2 does not move, and has another place in each second file.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    for frame in 0..5_u8 {
        let mut atoms = [(1, f32::from(frame) * 2.0 - 4.0), (2, 0.0)];
        if frame % 2 == 1 {
            atoms.reverse();
        }
        write(&workshop, frame.into(), "", &atoms);
    }
    workshop
}

fn picture(workshop: &Workshop, frame: &str, options: &[&str]) -> Picture {
    let command = ["still", "f_#.xyz", "--frame", frame, "-o", "out.exr"];
    let options = [&command[..], &VIEW, &CHANNELS, options].concat();
    workshop.run(&options).expect(0);
    Picture::open(&workshop.join("out.exr"))
}

/// Whether there is something without an id where the atom 1 is at x.
fn has_trail(picture: &Picture, x: f32) -> bool {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in the picture")]
    let column = (45.0 + 9.6 * x) as usize;
    // The axis is between two rows
    let is_trail = |pixel: usize| {
        picture.floats("A")[pixel] == 1.0 && picture.integers("id.I")[pixel] == NO_ID
    };
    is_trail(29 * 90 + column) || is_trail(30 * 90 + column)
}

#[test]
fn trails_pass_where_particles_were() {
    let workshop = workshop();
    let at = |picture: &Picture| [-3.0, -1.0, 1.0, 3.0].map(|x| has_trail(picture, x));
    let trails = |frames: &str| format!("trails={{frames={frames}, radius=0.6}}");
    let with = |frame: &str, frames: &str| picture(&workshop, frame, &["--set", &trails(frames)]);
    assert_eq!(at(&with("4", "0")), [false; 4]);
    assert_eq!(at(&with("4", "2")), [false, false, true, true]);
    assert_eq!(at(&with("4", "4")), [true; 4]);
    // Early frames have short trails, the first one has none
    assert_eq!(at(&with("1", "4")), [true, false, false, false]);
    assert_eq!(at(&with("0", "4")), [false; 4]);
    // The trail gets thinner: how many pixels it covers 0.5 and 3.5 frames ago
    let long = picture(&workshop, "4", &["--set", "trails.frames=4", "--set", "trails.radius=0.6"]);
    let rows = |x: usize| (0..60).filter(|row| long.floats("A")[row * 90 + x] == 1.0).count();
    let [thin, thick] = [rows(16), rows(73)];
    assert!((1..=3).contains(&thin) && (9..=11).contains(&thick), "{thin} {thick}");
}

#[test]
fn pictures_do_not_depend_on_the_other_frames_of_a_job() {
    let workshop = workshop();
    let render = |out: &str, options: &[&str]| {
        let output = format!("{out}/f.#.exr");
        let command = ["render", "f_#.xyz", "-o", &output, "--set", "trails.frames=3"];
        workshop.run(&[&command[..], &VIEW, options].concat()).expect(0);
        images(&workshop.join(out))
    };
    let all = render("all", &[]);
    let one = render("one", &["--frames", "4"]);
    assert_eq!(all.get("f.4.exr"), one.get("f.4.exr"));
    assert!(one.contains_key("f.4.exr"));
}

#[test]
fn jumps_over_a_boundary_are_cut() {
    let workshop = Workshop::new();
    let cell = "Lattice=\"8 0 0 0 8 0 0 0 8\" Origin=\"-4 -4 -4\" pbc=\"T T T\" ";
    for (frame, x) in [1.5, 3.5, -2.5, -0.5].into_iter().enumerate() {
        write(&workshop, u32::try_from(frame).unwrap(), cell, &[(1, x)]);
    }
    let found = picture(&workshop, "3", &["--set", "trails={frames=3, radius=0.6}"]);
    let at = [-1.5, 0.5, 2.5].map(|x| has_trail(&found, x));
    assert_eq!(at, [true, false, true]);
}

#[test]
fn particles_that_cannot_be_found_have_clear_messages() {
    let workshop = workshop();
    let command = ["still", "f_#.xyz", "--frame=4", "-o", "out.exr", "--set", "trails.frames=3"];
    let run = || workshop.run(&[&command[..], &VIEW, &CHANNELS].concat());
    // A damaged file is passed over, and the trail goes on behind it
    fs::write(workshop.join("f_3.xyz"), "2\nbroken").expect("a file");
    run().expect(0).prints("trails pass over a frame that cannot be read");
    let found = Picture::open(&workshop.join("out.exr"));
    assert!(has_trail(&found, 3.0) && has_trail(&found, 1.0));
    fs::remove_file(workshop.join("f_3.xyz")).expect("a file");
    run().expect(0).prints("trails cross a gap between the frames 2 and 4");
    // Without ids, the number of particles must not change
    for (frame, atoms) in [(2, "1\n\nO 0 0 0\n"), (4, "2\n\nO 0 0 0\nO 0 0 2\n")] {
        fs::write(workshop.join(format!("f_{frame}.xyz")), atoms).expect("a file");
    }
    run().expect(1).prints("no attribute `id` for trails, since the number of particles changes");
}
