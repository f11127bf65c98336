//! Radii and colours of chemical elements, and tables of users, in pictures.

use std::fs;

use crate::harness::{Ran, Workshop};
use crate::picture::Picture;

/// Carbon, oxygen and hydrogen, 6 apart along x.
const ATOMS: &str = "3\nwater and more\nC -6 0 0\nO 0 0 0\nH 6 0 0\n";

/// Looks along +y at 20 units, one for each 8 pixels, with the atoms in the middles of pixels.
const VIEW: [&str; 18] = [
    "--width=161",
    "--height=81",
    "--samples=1",
    "--ground=none",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.projection=orthographic",
    "--set",
    "camera.height=10.125",
    "--set",
    "camera.eye=[0, -10, 0]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "output.channels=[\"RGBA\", \"Z\", \"albedo\"]",
    "--set",
    "output.transparent=true",
];

/// Pixels in the middles of the atoms.
const PIXELS: [usize; 3] = [40 * 161 + 32, 40 * 161 + 80, 40 * 161 + 128];

fn still(shop: &Workshop, input: &str, options: &[&str]) -> Ran {
    shop.run(&[&["still", input, "-o", "f.exr"], &VIEW[..], options].concat())
}

/// Radii of the three atoms in the picture.
fn radii(shop: &Workshop) -> [f32; 3] {
    let picture = Picture::open(&shop.join("f.exr"));
    let depths = picture.floats("Z");
    PIXELS.map(|pixel| 10.0 - depths[pixel])
}

#[track_caller]
fn assert_near(found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len());
    let near = found.iter().zip(expected).into_iter().all(|(a, b)| (a - b).abs() < 2e-3);
    assert!(near, "{found:?} instead of {expected:?}");
}

#[test]
fn atoms_have_radii_and_colours_of_their_elements() {
    let shop = Workshop::new();
    fs::write(shop.join("in.xyz"), ATOMS).expect("a file");
    for (radius, expected) in [
        ("--radius=vdw", [1.70, 1.52, 1.20]),
        ("--radius=covalent", [0.76, 0.66, 0.31]),
        ("input.radius={table=\"vdw\", scale=0.5}", [0.85, 0.76, 0.6]),
        ("input.radius={attribute=\"element\", values={6=1, 8=0.5, 1=0.25}}", [1.0, 0.5, 0.25]),
    ] {
        let set = if radius.starts_with("--") { &[][..] } else { &["--set"] };
        let options = [set, &[radius, "--color-by", "elements"]].concat();
        still(&shop, "in.xyz", &options).expect(0);
        assert_near(&radii(&shop), &expected);
    }
    // Colours of Jmol: 909090, ff0d0d, ffffff
    let picture = Picture::open(&shop.join("f.exr"));
    let planes = ["albedo.R", "albedo.G", "albedo.B"].map(|name| picture.floats(name));
    let color = |pixel: usize| planes.each_ref().map(|plane| plane[pixel]);
    assert_near(&color(PIXELS[0]), &[0.2789; 3]);
    assert_near(&color(PIXELS[1]), &[1.0, 0.0040, 0.0040]);
    assert_near(&color(PIXELS[2]), &[1.0; 3]);
    // Colours of users; elements without one are grey
    let colors = "material.color={attribute=\"element\", values={6=[0.1, 0.2, 0.3], 8=[1, 0, 0]}}";
    still(&shop, "in.xyz", &["--set", colors, "--radius=vdw"]).expect(0);
    let picture = Picture::open(&shop.join("f.exr"));
    let red = picture.floats("albedo.R");
    assert_near(&PIXELS.map(|pixel| red[pixel]), &[0.1, 1.0, 0.18]);
}

#[test]
fn radii_have_the_unit_of_the_format() {
    let shop = Workshop::new();
    // Coordinates in nm, and a site that is no element
    let atom = |number: i32, name: &str, x: f64| {
        format!("{number:5}{:<5}{name:>5}{number:5}{x:8.3}{:8.3}{:8.3}\n", "SOL", 0.0, 0.0)
    };
    let atoms = atom(1, "OW", -6.0) + &atom(1, "HW1", 0.0) + &atom(1, "MW", 6.0);
    let text = format!("water\n    3\n{atoms}   9.0   9.0   9.0\n");
    fs::write(shop.join("in.gro"), text).expect("a file");
    let ran = still(
        &shop,
        "in.gro",
        &["--look", "none", "--set", "input.radius={table=\"vdw\", scale=10}"],
    );
    ran.expect(0)
        .prints("van der Waals radii of elements in `element`, angstroms x 1")
        .prints("1 particles have no element with a known radius");
    assert_near(&radii(&shop), &[1.52, 1.20, 1.0]);
}

#[test]
fn absent_elements_and_radii_are_errors_with_a_remedy() {
    let shop = Workshop::new();
    fs::write(shop.join("in.csv"), "x,y,z,type\n0,0,0,1\n2,0,0,3\n").expect("a file");
    let table = "input.radius={attribute=\"type\", values={1=0.5}}";
    still(&shop, "in.csv", &["--set", table])
        .expect(1)
        .prints("input.radius.values has no radius for `type` = 3; add one, such as 3 = 0.5");
    for (option, key) in
        [("--radius=vdw", "input.radius"), ("--color-by=elements", "material.color.attribute")]
    {
        still(&shop, "in.csv", &[option])
            .expect(2)
            .prints(&format!("{key}: no attribute `element` in the sampled frames"));
    }
    for (set, message) in [
        (
            "input.radius={table=\"vdw\", attribute=\"type\", values={1=0.5}}",
            "the radii are in `table`; leave one of the two out",
        ),
        ("input.radius=vdv", "did you mean vdw?"),
        ("input.radius={attribute=\"type\", values={1=0}}", "expected lengths above 0 of integers"),
        (
            "material.color={attribute=\"type\", values={1=[1, 0, 0]}, map=\"jmol\"}",
            "the colours are in `values`; leave one of the two out",
        ),
    ] {
        still(&shop, "in.csv", &["--set", set]).expect(2).prints(message);
    }
}
