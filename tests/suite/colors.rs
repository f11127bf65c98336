//! Attributes with colours are used as colours, and a note says so.

use std::fs;

use crate::harness::{Ran, SMALL, Workshop, images};
use crate::picture::Picture;

/// A ball in front of the camera, behind others that it hides.
const POINTS: usize = 3;

/// A table of points with these columns after the positions.
fn table(shop: &Workshop, columns: &str, values: &str) {
    let rows = (0..POINTS).map(|i| format!("0,{i},0,{values}\n"));
    let text = format!("x,y,z,{columns}\n{}", rows.collect::<String>());
    fs::create_dir_all(shop.join("in")).expect("a directory");
    fs::write(shop.join("in/p_1.csv"), text).expect("a file");
}

fn render(shop: &Workshop, input: &str, options: &[&str]) -> Ran {
    let arguments = ["render", input, "-o", "f.exr", "--force", "--radius", "0.5"];
    let channels = ["--channels", "RGBA,albedo"];
    shop.run(&[&arguments[..], &channels, &SMALL, options].concat()).expect(0)
}

/// The base colour that most of the covered pixels have.
#[track_caller]
fn albedo(shop: &Workshop) -> [f32; 3] {
    let picture = Picture::open(&shop.join("f.exr"));
    let planes = ["albedo.R", "albedo.G", "albedo.B"].map(|name| picture.floats(name));
    let alpha = picture.floats("A");
    let inside = alpha.iter().position(|a| *a == 1.0).expect("a particle");
    planes.map(|plane| plane[inside])
}

#[track_caller]
fn assert_near(found: [f32; 3], expected: [f32; 3]) {
    let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3);
    assert!(near, "{found:?} instead of {expected:?}");
}

#[test]
fn colours_of_the_particles_are_used() {
    let shop = Workshop::new();
    table(&shop, "Cd[0],Cd[1],Cd[2]", "0.25,0.5,0.75");
    render(&shop, "in", &[]).prints("colour by the RGB attribute `Cd` (linear)");
    assert_near(albedo(&shop), [0.25, 0.5, 0.75]);
    // Whoever names a map or a range means the length.
    for options in [&["--map", "greys"][..], &["--range", "0", "1"]] {
        let by = [&["--color-by", "cd"][..], options].concat();
        render(&shop, "in", &by).prints("colour by `cd`, range");
    }
    // Bytes are sRGB: 188 of 255 is half the light.
    table(&shop, "red,green,blue", "188,0,255");
    render(&shop, "in", &[]).prints("colour by the RGB attribute `color` (8-bit sRGB)");
    assert_near(albedo(&shop), [0.5029, 0.0, 1.0]);
}

#[test]
fn bytes_of_vtk_and_ply_are_colours() {
    let shop = Workshop::new();
    let vtk = "# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n0 0 0 0 1 0\n\
               POINT_DATA 2\nCOLOR_SCALARS tint 3\n1 0.7373 0 1 0.7373 0\n";
    fs::write(shop.join("a.vtk"), vtk).expect("a file");
    render(&shop, "a.vtk", &[]).prints("colour by the RGB attribute `tint` (8-bit sRGB)");
    assert_near(albedo(&shop), [1.0, 0.5029, 0.0]);
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n\
               0 0 0 0 188 255\n0 1 0 0 188 255\n";
    fs::write(shop.join("a.ply"), ply).expect("a file");
    render(&shop, "a.ply", &[]).prints("colour by the RGB attribute `color`");
    assert_near(albedo(&shop), [0.0, 0.5029, 1.0]);
}

#[test]
fn speed_has_precedence_over_unnamed_colours() {
    let shop = Workshop::new();
    table(&shop, "vx,vy,vz,rgb_x,rgb_y,rgb_z", "1,2,3,0.25,0.5,0.75");
    render(&shop, "in", &[]).prints("colour by `speed`, range");
    render(&shop, "in", &["--color-by", "RGB"]).prints("colour by the RGB attribute `RGB`");
    assert_near(albedo(&shop), [0.25, 0.5, 0.75]);
    render(&shop, "in", &["--set", "material.color=[0.1,0.2,0.3]"]);
    assert_near(albedo(&shop), [0.1, 0.2, 0.3]);
}

// Starts the program twelve times: each name, from text and from native frames.
#[test]
fn conditions_and_colours_know_the_same_names() {
    let shop = Workshop::new();
    table(&shop, "vx,vy,vz", "1,2,2");
    shop.run(&["convert", "in", "-o", "native"]).expect(0);
    for input in ["in", "native"] {
        for (name, range) in [
            ("speed", "0 to 3"),
            ("vy", "2 to 2"),
            ("velocity.y", "2 to 2"),
            ("y", "0 to 2"),
            ("index", "0 to 2"),
        ] {
            let condition = format!("{name} >= 0");
            render(&shop, input, &["--color-by", name, "--where", &condition])
                .prints(&format!("colour by `{name}`, range {range}"));
        }
    }
    render(&shop, "in", &["--color-by", "velocity"]).prints("colour by `speed`, range 0 to 3");
}

#[test]
fn native_frames_show_the_same_colours() {
    let shop = Workshop::new();
    table(&shop, "Cd[0],Cd[1],Cd[2]", "0.25,0.5,0.75");
    shop.run(&["convert", "in", "-o", "native"]).expect(0);
    let mut first = None;
    for (input, structure) in [
        ("in", "lbvh"),
        ("native", "lbvh"),
        ("native", "kdtree"),
        ("native", "bvh"),
        ("native", "sbvh"),
    ] {
        render(&shop, input, &["--accelerator", structure]).prints("RGB attribute `Cd`");
        assert_near(albedo(&shop), [0.25, 0.5, 0.75]);
        let made = images(shop.path());
        assert_eq!(*first.get_or_insert_with(|| made.clone()), made, "{input} {structure}");
    }
    // A smooth surface blends them.
    render(&shop, "native", &["--surface", "smooth"]).prints("RGB attribute `Cd`");
    assert_near(albedo(&shop), [0.25, 0.5, 0.75]);
}
