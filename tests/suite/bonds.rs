//! Bonds in pictures: between which particles, their colours, over the boundaries of a periodic cell, and data without.

use std::fs;

use spherule::render::NO_ID;

use crate::harness::{Workshop, sample};
use crate::picture::Picture;

/// Oxygen in the middle, hydrogen to its right, and hydrogen to its left that is too far away for a covalent bond.
const ATOMS: &str = "3\nProperties=species:S:1:pos:R:3\nO 0 0 0\nH 1 0 0\nH -1.4 0 0\n";

/// Carbon and nitrogen at the sides of a periodic cell of width 3, with their nearest images 0.8 apart.
const PERIODIC: &str = "2\nLattice=\"3 0 0 0 9 0 0 0 9\" Origin=\"-1.5 -4.5 -4.5\" pbc=\"T T T\" \
                        Properties=species:S:1:pos:R:3\nC -1 0 0\nN 1.2 0 0\n";

/// Looks along +y from a distance of 4 at a field 2.5 units high at the atoms: 24 pixels per unit.
const VIEW: [&str; 17] = [
    "--width=90",
    "--height=60",
    "--samples=1",
    "--radius=0.2",
    "--ground=none",
    "--color-by=elements",
    "--set",
    "render.denoise=false",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0, -4, 0]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "camera.fov=34.71",
    "--set=output.channels=[\"RGBA\", \"Z\", \"albedo\", \"id\"]",
];

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    fs::write(workshop.join("in.xyz"), ATOMS).expect("a file");
    fs::write(workshop.join("periodic.xyz"), PERIODIC).expect("a file");
    workshop
}

fn picture(workshop: &Workshop, input: &str, options: &[&str]) -> Picture {
    let command = ["still", input, "-o", "out.exr"];
    let ran = workshop.run(&[&command[..], &VIEW, options].concat());
    ran.expect(0);
    Picture::open(&workshop.join("out.exr"))
}

/// The pixel that shows the point (x, 0, 0).
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a place in the picture"
)]
fn pixel(x: f64) -> usize {
    30 * 90 + (45.0 + 24.0 * x) as usize
}

/// The colour of the bond at the point (x, 0, 0), if there is one.
fn bond(picture: &Picture, x: f64) -> Option<[f32; 3]> {
    let pixel = pixel(x);
    let is_bond = picture.integers("id.I")[pixel] == NO_ID && picture.floats("A")[pixel] == 1.0;
    let color = ["albedo.R", "albedo.G", "albedo.B"].map(|name| picture.floats(name)[pixel]);
    is_bond.then_some(color)
}

/// Colours of Jmol, linear RGB.
const RED: [f32; 3] = [1.0, 0.004, 0.004];
const WHITE: [f32; 3] = [1.0, 1.0, 1.0];

#[track_caller]
fn near(found: Option<[f32; 3]>, expected: [f32; 3]) {
    let found = found.expect("a bond");
    let is_near = |(a, b): (&f32, &f32)| (a - b).abs() < 2e-3;
    assert!(found.iter().zip(&expected).all(is_near), "{found:?}");
}

#[test]
fn covalent_bonds_have_halves_in_the_colours_of_their_atoms() {
    let workshop = workshop();
    assert_eq!(bond(&picture(&workshop, "in.xyz", &[]), 0.4), None);
    let found = picture(&workshop, "in.xyz", &["--bonds=covalent"]);
    near(bond(&found, 0.3), RED);
    near(bond(&found, 0.7), WHITE);
    assert_eq!(bond(&found, -0.7), None);
    // A third of the radius of the particles thick; the pixel is half a pixel beside the axis
    let depth = found.floats("Z")[pixel(0.5)];
    assert!((depth - (4.0 - 0.2 / 3.0)).abs() < 6e-3, "{depth}");
}

#[test]
fn bonds_by_distance_have_a_radius_and_a_colour() {
    let workshop = workshop();
    let options =
        ["--bonds=1.5", "--set", "bonds.radius=0.05", "--set", "bonds.color=[0.1, 0.2, 0.3]"];
    let found = picture(&workshop, "in.xyz", &options);
    for x in [-0.7, 0.3, 0.7] {
        near(bond(&found, x), [0.1, 0.2, 0.3]);
    }
    let depth = found.floats("Z")[pixel(0.5)];
    assert!((depth - 3.95).abs() < 6e-3, "{depth}");
    // Particles that are left out have none
    let options = ["--bonds=1.5", "--where", "x < 0.5"];
    let found = picture(&workshop, "in.xyz", &options);
    assert!(bond(&found, -0.7).is_some() && bond(&found, 0.7).is_none());
}

#[test]
fn bonds_go_on_at_the_other_side_of_a_periodic_cell() {
    let workshop = workshop();
    let found = picture(&workshop, "periodic.xyz", &["--bonds=covalent"]);
    for (x, is_bond) in
        [(-1.37, true), (-1.45, false), (-0.6, false), (0.8, false), (1.57, true), (1.65, false)]
    {
        assert_eq!(bond(&found, x).is_some(), is_bond, "{x}");
    }
    // Not where the cell does not repeat
    let once = PERIODIC.replace("T T T", "F T T");
    fs::write(workshop.join("once.xyz"), once).expect("a file");
    let found = picture(&workshop, "once.xyz", &["--bonds=covalent"]);
    assert_eq!(bond(&found, 1.57), None);
    // In copies of the cell, the bond over their boundary is whole; seen from farther away
    let options = ["--bonds=covalent", "--replicate=2,1,1", "--set", "camera.eye=[1.5, -8, 0]"];
    let options = [&options[..], &["--set", "camera.look_at=[1.5, 0, 0]"]].concat();
    let found = picture(&workshop, "periodic.xyz", &options);
    // The middle of the bond from 1.2 to 2, 12 pixels per unit
    assert!(bond(&found, (1.6 - 1.5) / 2.0).is_some());
    assert!(bond(&found, (0.2 - 1.5) / 2.0).is_none());
}

#[test]
fn impossible_bonds_are_refused() {
    let workshop = workshop();
    let run = |input: &str, options: &[&str]| {
        let command = ["render", input, "-o", "out.exr", "--radius=0.2"];
        workshop.run(&[&command[..], &VIEW[..3], options].concat())
    };
    for (find, part) in [
        ("0", "--bonds: expected a distance above 0"),
        ("covalentt", "--bonds: expected a distance above 0"),
    ] {
        let ran = run("in.xyz", &[&format!("--bonds={find}")]);
        ran.expect(2).prints(part);
    }
    fs::write(workshop.join("plain.csv"), "x,y,z\n0,0,0\n1,0,0\n").expect("a file");
    let ran = run("plain.csv", &["--bonds=covalent"]);
    ran.expect(2).prints("bonds.find: no attribute `element`").prints(
        "give a file that has elements with --topology, or a distance, such as --bonds 1.8",
    );
    // Far too many, and none
    let line = |i: usize| format!("{},0,0\n", i);
    let many: String = (0..100).map(line).collect();
    fs::write(workshop.join("many.csv"), format!("x,y,z\n{many}")).expect("a file");
    let ran = run("many.csv", &["--bonds=50"]);
    ran.expect(1).prints("bonds.find gives more than 8 bonds for each of 100 particles");
    let ran = run("many.csv", &["--bonds=0.5", "--force"]);
    ran.expect(0).prints("no bonds: no particles are so near each other");
}

#[test]
fn bonds_of_a_file_are_drawn() {
    let workshop = workshop();
    fs::write(
        workshop.join("in.psf"),
        "PSF\n\n 3 !NATOM\n 1 S 1 M O O 0 16 0\n 2 S 1 M H H 0 1 0\n 3 S 1 M H H 0 1 0\n\n 1 !NBOND\n 3 1\n",
    )
    .expect("a file");
    let found = picture(&workshop, "in.xyz", &["--bonds=file", "--topology=in.psf"]);
    assert!(bond(&found, -0.7).is_some() && bond(&found, 0.5).is_none());
    let command = ["render", "in.xyz", "-o", "o.exr", "--bonds=file"];
    let ran = workshop.run(&[&command[..], &VIEW[..4]].concat());
    ran.expect(0).prints("no bonds: the file lists none");
    // A chain of 40 beads
    let polymer = sample("gsd/polymer.gsd");
    let command = ["still", polymer.to_str().expect("a path"), "-o", "out.exr"];
    let with = |bonds: &str| {
        let options = [bonds, "--radius=0.02", "--set", "bonds.radius=0.1"];
        workshop.run(&[&command[..], &VIEW[..3], &options].concat()).expect(0);
        Picture::open(&workshop.join("out.exr")).floats("A").iter().sum::<f32>()
    };
    assert!(with("--bonds=file") > 2.0 * with("--bonds=none"));
}
