//! Styles through the program: options, jobs, native frames, and what is refused.

use std::fmt::Write as _;
use std::fs;

use crate::harness::{Ran, Workshop};

/// Three layers of particles of the types 1, 2 and 3.
fn layers() -> Workshop {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    let mut csv = "id,x,y,z,type,vx,vy,vz\n".to_owned();
    for i in 0..192 {
        let (x, y, layer) = (i % 8, i / 8 % 8, i / 64);
        let _ = writeln!(csv, "{},{x},{y},{layer},{},{y},0,0", 5 * i, layer + 1);
    }
    fs::write(workshop.join("in/f_1.csv"), csv).expect("a file");
    workshop
}

const STYLES: [&str; 6] = [
    "--style",
    "type == 1: smooth, radius 0.6, color red",
    "--style",
    "type == 2: spheres, radius 0.3, color_by speed, map viridis",
    "--style",
    "x < 2: balls-and-sticks, radius 0.2, bonds { find = 1.1 }",
];

fn still(workshop: &Workshop, input: &str, options: &[&str]) -> Ran {
    let size = ["--width", "96", "--height", "54", "--samples", "2", "--radius", "0.4"];
    let command = ["still", input, "-o"];
    workshop.run(&[&command[..], options, &size].concat())
}

#[test]
fn native_frames_have_the_same_styles() {
    let workshop = layers();
    workshop.run(&["convert", "in", "-o", "f32", "--encoding", "f32"]).expect(0);
    let options = [&["a.png"][..], &STYLES].concat();
    still(&workshop, "in", &options)
        .expect(0)
        .prints("style `type == 2`: colour by `speed`, range 0 to 7");
    still(&workshop, "f32", &[&["b.png"][..], &STYLES].concat()).expect(0);
    let image = |name: &str| fs::read(workshop.join(name)).expect("an image");
    assert!(image("a.png") == image("b.png"));
    still(&workshop, "in", &["plain.png"]).expect(0);
    assert!(image("a.png") != image("plain.png"));
}

#[test]
fn styles_share_the_scale_of_colors_without_a_style() {
    let workshop = layers();
    let by_speed = ["a.png", "--color-by", "vx", "--style", "y > 3.5: spheres, radius 0.3"];
    let ran = still(&workshop, "in", &by_speed).expect(0).prints("colour by `vx`, range 0 to 7");
    assert!(!ran.errors().contains("style `y > 3.5`: colour"), "{}", ran.errors());
    let own = ["b.png", "--color-by", "vx", "--style", "y > 3.5: spheres, color_by vx"];
    still(&workshop, "in", &own).expect(0).prints("style `y > 3.5`: colour by `vx`, range 4 to 7");
}

#[test]
fn styles_are_settings_of_a_job() {
    let workshop = layers();
    let style = ["--style", "type == 2: spheres, color red"];
    workshop.render(&style).expect(0);
    let manifest = fs::read_to_string(workshop.join("out/job.toml")).expect("a manifest");
    assert!(
        manifest.contains("[[style]]\n") && manifest.contains("where = \"type == 2\""),
        "{manifest}"
    );
    // It goes on with the same, and not with another colour
    workshop.render(&style).expect(0);
    let other = ["--style", "type == 2: spheres, color blue"];
    workshop.render(&other).expect(2).prints("style.0.color");
    // Moving particles have styles, too
    let blurred = ["--set", "camera.shutter=0.5", "--set", "output.frame_time=0.04"];
    workshop.render_to("blurred", &[&STYLES[..], &blurred].concat()).expect(0);
}

#[test]
fn arrows_and_hidden_particles() {
    let workshop = layers();
    let arrows = "type == 1: arrows, arrows { attribute = \"velocity\", scale = 0.1 }";
    let options = ["a.png", "--style", arrows, "--style", "type == 3: hidden"];
    still(&workshop, "in", &options).expect(0).prints("1 frame, up to 128 particles");
    let near = ["b.png", "--where", "within 1.01 of (type == 3)", "--unwrap"];
    still(&workshop, "in", &near).expect(2).prints("no simulation cell");
    still(&workshop, "in", &near[..3]).expect(0).prints("up to 128 particles");
    still(&workshop, "in", &["c.png", "--outline", "2", "--depth-cue", "0.5"]).expect(0);
}

#[test]
fn grains_have_the_orientation_of_the_file() {
    let workshop = Workshop::new();
    let rows = [
        "0,0,0,0,0.6,0.2,0.2,1,0,0,0",
        "1,2,0,0,0.6,0.2,0.2,0,0,0,0",
        "2,4,0,0,0.6,0.2,-1,1,0,0,1",
    ];
    let head = "id,x,y,z,shapex,shapey,shapez,quat1,quat2,quat3,quat4";
    fs::write(workshop.join("a.csv"), format!("{head}\n{}\n", rows.join("\n"))).expect("a file");
    let ran = still(&workshop, "a.csv", &["a.png", "--style", ": grains, name rods"]).expect(0);
    for what in [
        "grains of style `rods` by quat1, quat2, quat3, quat4, shapex",
        "style `rods`: 1 grains without an orientation, drawn upright",
        "style `rods`: 1 grains left out: a semi-axis is not above 0",
    ] {
        assert!(ran.errors().contains(what), "{what}: {}", ran.errors());
    }
    let named = "orientation { euler = ['quat1', 'quat2', 'quat5'] }";
    let style = format!(": grains, shape cylinder, size [0.1, 0.1, 0.5], {named}");
    still(&workshop, "a.csv", &["b.png", "--style", &style]).expect(1).prints("did you mean `quat");
}

#[test]
fn grains_turn_during_the_exposure() {
    let workshop = Workshop::new();
    // Three rods along x, of which the first makes a quarter turn about z while the shutter is open
    let write = |name: &str, speeds: [&str; 3]| {
        let row = |(i, speed): (usize, &&str)| {
            format!("{i},{},0,0,0,0,0,0,0,{speed},0.8,0.1,0.1,1,0,0,0\n", 4 * i)
        };
        let rows: String = speeds.iter().enumerate().map(row).collect();
        let head =
            "id,x,y,z,vx,vy,vz,omegax,omegay,omegaz,shapex,shapey,shapez,quat1,quat2,quat3,quat4";
        fs::write(workshop.join(name), format!("{head}\n{rows}")).expect("a file");
    };
    write("turning.csv", ["3.141592653589793", "0", "0"]);
    write("resting.csv", ["0", "0", "0"]);
    write("broken.csv", ["nan", "inf", "0"]);
    let blurred = |input: &str, image: &str, columns: &str| {
        let style = format!(": grains, name rods{columns}");
        let motion = ["--set", "camera.shutter=0.5", "--set", "output.frame_time=1"];
        still(&workshop, input, &[&[image, "--style", &style][..], &motion].concat())
    };
    let picture = |image: &str| fs::read(workshop.join(image)).expect("a picture");
    let turning = blurred("turning.csv", "a.png", "").expect(0);
    let note = "grains of style `rods` turn by omegax, omegay, omegaz";
    assert!(turning.errors().contains(note), "{}", turning.errors());
    blurred("resting.csv", "b.png", "").expect(0);
    assert_ne!(picture("a.png"), picture("b.png"));
    // Numbers that are not finite count as none
    let broken = blurred("broken.csv", "c.png", "").expect(0);
    let note = "style `rods`: 2 grains with a velocity or an angular velocity that is not finite";
    assert!(broken.errors().contains(note), "{}", broken.errors());
    assert_eq!(picture("b.png"), picture("c.png"));
    // Native frames keep the column
    workshop.run(&["convert", "turning.csv", "-o", "native"]).expect(0);
    blurred("native", "d.png", "").expect(0);
    assert_eq!(picture("a.png"), picture("d.png"));
    // Other columns may be named
    let named = |x: &str| format!(", angular_velocity ['{x}', 'omegax', 'omegay']");
    blurred("turning.csv", "e.png", &named("omegaz")).expect(0);
    assert_ne!(picture("a.png"), picture("e.png"));
    blurred("turning.csv", "f.png", &named("wx")).expect(1).prints("no column `wx`");
}

/// A tetrahedron.
const OBJ: &str = "v 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n";

#[test]
fn grains_have_the_shape_of_a_mesh() {
    let workshop = Workshop::new();
    let rows = "x,y,z,type,radius\n0,0,0,1,0.5\n3,0,0,2,0.5\n";
    fs::write(workshop.join("a.csv"), rows).expect("a file");
    fs::write(workshop.join("grain.obj"), OBJ).expect("a file");
    let open = OBJ.replace("f 2 4 3\n", "");
    fs::write(workshop.join("open.obj"), &open).expect("a file");
    let style = |text: &str| still(&workshop, "a.csv", &["a.png", "--style", text]);
    style(": grains, mesh grain.obj").expect(0).prints("drawn upright");
    style("type == 1: grains, mesh grain.obj, size [1, 2, 1]").expect(0);
    let large = OBJ.replace("v 1 ", "v 1000 ").replace("v -1", "v -1000");
    fs::write(workshop.join("large.obj"), large).expect("a file");
    style(": grains, mesh large.obj").expect(0).prints("times larger than the particles");
    style(": grains, shape convex-hull, mesh open.obj, size radius").expect(0);
    // Errors name the file and what to do, and come before a picture
    let refused = |text: &str, parts: [&str; 2]| {
        let ran = style(text).expect(2);
        assert!(parts.iter().all(|part| ran.errors().contains(part)), "{}", ran.errors());
    };
    let open = ["style.0.mesh: ", "open.obj: the mesh of a grain is not closed"];
    refused(": grains, mesh open.obj", open);
    refused(": grains, mesh open.obj", ["shape = \"convex-hull\"", ""]);
    refused(": grains, mesh none.obj", ["style.0.mesh: ", "none.obj"]);
    refused(": grains, shape mesh", ["style.0.mesh: ", "which file"]);
    refused(": spheres, mesh grain.obj", ["belongs to a style with draw = \"grains\"", ""]);
    refused(": grains, shape cuboid, mesh grain.obj", ["belongs to shape = \"mesh\"", ""]);
    refused(": grains, mesh grain.##.obj", ["has the number of a frame", ""]);
}

#[test]
fn a_job_does_not_go_on_with_another_mesh_of_grains() {
    let workshop = layers();
    fs::write(workshop.join("grain.obj"), OBJ).expect("a file");
    let style = ["--style", "type == 1: grains, mesh grain.obj"];
    workshop.render(&style).expect(0);
    workshop.render(&style).expect(0);
    fs::write(workshop.join("grain.obj"), OBJ.replace("v 1 1 1", "v 1 1 2")).expect("a file");
    workshop.render(&style).expect(2).prints("style.0.mesh");
}

#[test]
fn particles_with_shapes_are_drawn_as_grains() {
    let workshop = Workshop::new();
    let head = "x,y,z,shapex,shapey,shapez,quatw,quati,quatj,quatk";
    let rows = "0,0,0,1,2,1,1,0,0,0\n3,0,0,2,1,1,1,0,0,0\n";
    fs::write(workshop.join("a.csv"), format!("{head}\n{rows}")).expect("a file");
    let size = ["--width", "96", "--height", "54", "--samples", "2"];
    let still = |options: &[&str]| {
        workshop.run(&[&["still", "a.csv", "-o"], options, &size].concat()).expect(0)
    };
    let grains = still(&["a.png"]);
    assert!(grains.errors().contains("by `quatw`, `quati`"), "{}", grains.errors());
    assert!(grains.errors().contains("--style ': spheres' draws spheres"), "{}", grains.errors());
    still(&["b.png", "--style", ": grains"]);
    let same = ["a.png", "b.png"].map(|name| fs::read(workshop.join(name)).expect("a picture"));
    assert_eq!(same[0], same[1]);
    let spheres = still(&["c.png", "--style", ": spheres"]);
    assert!(!spheres.errors().contains("drawn with their shapes"), "{}", spheres.errors());
}

#[test]
fn impossible_styles_are_refused_and_empty_ones_are_noted() {
    let workshop = layers();
    let refused = |style: &str, what: &str| {
        still(&workshop, "in", &["a.png", "--style", style]).expect(2).prints(what);
    };
    refused("kind == 2: spheres", "style.0.where: character 1: no value `kind`");
    refused("type == : spheres", "--style: style.0.where: character 8");
    refused("type == 2: sphere", "did you mean spheres?");
    refused("type == 2: spheres, colour red", "did you mean");
    refused("type == 2", "a condition, how its particles are drawn");
    refused("type == 2: spheres, color_by pressure", "no attribute `pressure`");
    let sticks = ["a.png", "--style", "type == 2: sticks"];
    still(&workshop, "in", &sticks).expect(0).prints("no bonds");
    let twice = ["a.png", "--style", "type == 2: spheres", "--style", "type == 2: union"];
    still(&workshop, "in", &twice).expect(0).prints("no particle is of style `type == 2`");
    let none = ["a.png", "--style", "type > 7: hidden", "--style", "type == 9: smooth"];
    still(&workshop, "in", &none).expect(0).prints("no particle is of style `type == 9`");
}

#[test]
fn several_styles_are_clear_bodies() {
    let workshop = layers();
    let water = ["--style", "type == 1: smooth, radius 0.6, ior 1.33, material water"];
    let image = |name: &str| fs::read(workshop.join(name)).expect("an image");
    for (name, oil) in [
        ("a.png", "type == 2: union, radius 0.7, ior 1.47, absorption [0.9, 0.6, 0.1]"),
        ("b.png", "type == 2: union, radius 0.7, ior 1.47"),
        ("c.png", "type == 2: union, radius 0.7, ior 1.47, roughness 0.3"),
    ] {
        still(&workshop, "in", &[&[name][..], &water, &["--style", oil]].concat()).expect(0);
    }
    assert!(image("a.png") != image("b.png") && image("b.png") != image("c.png"));
    let oil = ["d.png", "--style", "type == 2: spheres, material glass"];
    still(&workshop, "in", &[&oil[..], &water].concat())
        .expect(2)
        .prints("set style.0.draw = \"smooth\" or \"union\"");
}

#[test]
fn clear_bodies_have_the_colours_of_their_particles() {
    let workshop = layers();
    let picture = |image: &str, draw: &str, absorption: &str| {
        let style = format!(
            ": {draw}, radius 0.8, color_by x, map viridis, \
             material {{ type = 'water', absorption_length = 2{absorption} }}"
        );
        still(&workshop, "in/f_1.csv", &[image, "--style", &style]).expect(0);
        fs::read(workshop.join(image)).expect("a picture")
    };
    for draw in ["smooth", "union"] {
        let clear = picture("a.png", draw, "");
        assert_ne!(picture("b.png", draw, ", absorption = 'color'"), clear, "{draw}");
        assert_eq!(picture("c.png", draw, ", absorption = [1, 1, 1]"), clear, "{draw}");
    }
}
