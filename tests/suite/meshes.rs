//! Meshes next to particles: what hides what, and what a job does when their files change.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::Vec3;
use spherule::accel::Structure;
use spherule::render::NO_ID;
use spherule_formats::write;

use crate::harness::{Ran, Workshop, files, images};
use crate::picture::Picture;

/// Looks along +y at the particles from a distance of 6.
const VIEW: [&str; 16] = [
    "--width",
    "64",
    "--height",
    "36",
    "--samples",
    "1",
    "--radius",
    "0.3",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0, -6, 0]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "output.channels=[\"RGBA\", \"Z\", \"N\", \"P\", \"id\"]",
];

/// A cube of 27 particles around the origin, in `frames` frames.
fn particles(frames: u32) -> Workshop {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    let at = |i: u32| 0.5 * (i as f32 - 1.0);
    let centers: Vec<Vec3> =
        (0..27).map(|i| Vec3::new(at(i % 3), at(i / 3 % 3), at(i / 9))).collect();
    for frame in 1..=frames {
        let path = workshop.join(format!("in/f_{frame}.npy"));
        write::npy::write(&path, &centers).expect("a file");
    }
    workshop
}

/// Two triangles: the parallelogram at `corner`, whose front is the side of `u` x `v`.
fn side(corner: Vec3, u: Vec3, v: Vec3) -> [[Vec3; 3]; 2] {
    let (b, c, d) = (corner + u, corner + u + v, corner + v);
    [[corner, b, c], [corner, c, d]]
}

fn stl(path: &Path, triangles: &[[Vec3; 3]]) {
    let mut text = "solid test\n".to_owned();
    for triangle in triangles {
        text += "facet normal 0 0 0\nouter loop\n";
        for corner in triangle {
            let _ = writeln!(text, "vertex {} {} {}", corner.x, corner.y, corner.z);
        }
        text += "endloop\nendfacet\n";
    }
    text += "endsolid test\n";
    fs::write(path, text).expect("a file");
}

/// A wall at `y` across the left half of the view, facing the camera.
fn wall(path: &Path, y: f32) {
    stl(path, &side(Vec3::new(-9.0, y, -9.0), 9.0 * Vec3::X, 18.0 * Vec3::Z));
}

/// A closed box from -2 to 2 with outward triangles.
fn tank(path: &Path) {
    let low = Vec3::splat(-2.0);
    let [x, y, z] = [4.0 * Vec3::X, 4.0 * Vec3::Y, 4.0 * Vec3::Z];
    let sides = [
        side(low, y, x),
        side(low, z, y),
        side(low, x, z),
        side(low + z, x, y),
        side(low + x, y, z),
        side(low + y, z, x),
    ];
    stl(path, sides.as_flattened());
}

fn render(workshop: &Workshop, out: &str, options: &[&str]) -> Ran {
    let pattern = format!("{out}/f.#.exr");
    let command = ["render", "in", "-o", pattern.as_str()];
    workshop.run(&[&command[..], &VIEW, options].concat())
}

/// The first frame with these options.
#[track_caller]
fn picture(workshop: &Workshop, out: &str, options: &[&str]) -> Picture {
    render(workshop, out, options).expect(0);
    Picture::open(&workshop.join(format!("{out}/f.1.exr")))
}

// Starts the program eight times: no wall and three kinds of walls, with both integrators.
#[test]
fn a_wall_hides_particles_behind_it() {
    let workshop = particles(1);
    wall(&workshop.join("wall.stl"), -2.0);
    for integrator in ["whitted", "path"] {
        let with = |out: &str, options: &[&str]| {
            // A mesh may lower the ground
            let usual = ["--integrator", integrator, "--ground=none"];
            let options = [&usual[..], options].concat();
            picture(&workshop, &format!("{integrator}-{out}"), &options)
        };
        let without = with("plain", &[]);
        let found = with("wall", &["--mesh", "wall.stl"]);
        for (pixel, id) in found.integers("id.I").iter().enumerate() {
            let is_left = pixel % 64 < 32;
            let value = |name: &str| found.floats(name)[pixel];
            if is_left {
                assert_eq!(*id, NO_ID);
                assert!((value("Z") - 4.0).abs() < 1e-5, "{}", value("Z"));
                assert_eq!([value("N.X"), value("N.Y"), value("N.Z")], [0.0, -1.0, 0.0]);
                assert!((value("P.Y") + 2.0).abs() < 1e-5);
                assert_eq!(value("A"), 1.0);
                assert!(integrator == "path" || value("R") > 0.05);
            } else {
                assert_eq!(*id, without.integers("id.I")[pixel]);
                assert_eq!(value("Z"), without.floats("Z")[pixel]);
            }
        }
        assert!(without.integers("id.I").iter().any(|id| *id != NO_ID));
        // A holdout is a hole in front of the particles
        let hole = with("hole", &["--mesh", "wall.stl", "--set", "mesh.0.holdout=true"]);
        for pixel in 0..64 * 36 {
            let color = ["R", "G", "B", "A"].map(|name| hole.floats(name)[pixel]);
            let shown = ["R", "G", "B", "A"].map(|name| found.floats(name)[pixel]);
            if pixel % 64 < 32 {
                assert_eq!(color, [0.0; 4]);
            } else if integrator == "whitted" {
                assert_eq!(color, shown);
            }
        }
        // Through glass, the particles are there
        let glass = with("glass", &["--mesh", "wall.stl", "--set", "mesh.0.material=glass"]);
        assert_eq!(glass.floats("Z"), without.floats("Z"));
    }
}

#[test]
fn the_camera_shows_all_of_the_meshes_on_request() {
    let workshop = particles(1);
    tank(&workshop.join("tank.stl"));
    for frame_meshes in [false, true] {
        let out = format!("{frame_meshes}/f.#.exr");
        let set = format!("camera.frame_meshes={frame_meshes}");
        let scene = ["--radius", "0.3", "--mesh", "tank.stl", "--ground=none"];
        let image = ["--width", "64", "--height", "36", "--samples", "1"];
        let command = ["render", "in", "-o", &out, "--channels", "RGBA,Z", "--set", &set];
        workshop.run(&[&command[..], &scene, &image].concat()).expect(0);
        let image = Picture::open(&workshop.join(format!("{frame_meshes}/f.1.exr")));
        let is_mesh = |x: usize, y: usize| image.floats("Z")[64 * y + x].is_finite();
        // The tank reaches beyond the picture, or fills most of its height and touches no edge
        let at_sides = (0..36).any(|y| is_mesh(0, y) || is_mesh(63, y));
        let at_ends = (0..64).any(|x| is_mesh(x, 0) || is_mesh(x, 35));
        assert_eq!(at_sides || at_ends, !frame_meshes);
        let rows = (0..36).filter(|y| (0..64).any(|x| is_mesh(x, *y))).count();
        assert!(rows > 24, "{frame_meshes}: {rows}");
    }
}

#[test]
fn one_looks_into_a_tank_with_visible_backs() {
    let workshop = particles(1);
    tank(&workshop.join("tank.stl"));
    let middle = 18 * 64 + 32;
    // Beside the particles, one sees the rear wall
    let depth = |faces: &str| {
        let set = format!("mesh.0.faces={faces}");
        let image = picture(&workshop, faces, &["--mesh", "tank.stl", "--set", &set]);
        let z = image.floats("Z");
        [z[middle], z[middle - 9]]
    };
    let near = |found: [f32; 2], wanted: [f32; 2]| {
        let far = |(a, b): (&f32, &f32)| (a - b).abs() > 0.02;
        assert!(!found.iter().zip(&wanted).any(far), "{found:?} {wanted:?}");
    };
    near(depth("both"), [4.0, 4.0]);
    near(depth("front"), [4.0, 4.0]);
    near(depth("back"), [5.2, 8.0]);
}

#[test]
fn units_and_places_are_those_of_the_manifest() {
    let workshop = particles(1);
    fs::create_dir_all(workshop.join("jobs/meshes")).expect("a directory");
    // In thousandths of the unit of the particles
    let corner = 1000.0 * Vec3::new(-9.0, -2.0, -9.0);
    let wall = side(corner, 9000.0 * Vec3::X, 18_000.0 * Vec3::Z);
    stl(&workshop.join("jobs/meshes/wall.stl"), &wall);
    let mesh = "[[mesh]]\npath = \"meshes/wall.stl\"\nscale = 0.001\ntranslate = [0, -0.5, 0]\n";
    let job = format!("input.path = \"../in\"\noutput.path = \"../out/f.#.exr\"\n{mesh}");
    fs::write(workshop.join("jobs/a.toml"), job).expect("a file");
    workshop.run(&[&["render", "jobs/a.toml"][..], &VIEW].concat()).expect(0);
    let z = Picture::open(&workshop.join("out/f.1.exr"));
    assert!((z.floats("Z")[18 * 64 + 31] - 3.5).abs() < 1e-4);
    // The manifest next to the images names the same file
    let written = fs::read_to_string(workshop.join("out/job.toml")).expect("a manifest");
    assert!(written.contains("path = \"../jobs/meshes/wall.stl\""), "{written}");
    workshop.run(&["render", "out/job.toml"]).expect(0).prints("1 of 1 frames are done already");
    // Without the factor, the unit is doubtful
    let note = "times larger than the particles; if it is in another unit, set mesh.scale";
    let mesh = ["--mesh", "jobs/meshes/wall.stl"];
    render(&workshop, "raw", &mesh).expect(0).prints(note);
    let scaled = [&mesh[..], &["--set", "mesh.0.scale=0.001"]].concat();
    let ran = render(&workshop, "scaled", &scaled).expect(0);
    assert!(!ran.errors().contains("mesh.scale"), "{}", ran.errors());
}

#[test]
fn the_ground_is_below_a_tank() {
    let workshop = particles(1);
    tank(&workshop.join("tank.stl"));
    let options = [
        "--mesh",
        "tank.stl",
        "--ground",
        "--set",
        "input.up=z",
        "--set",
        "camera.eye=[0, -30, 4]",
    ];
    let image = picture(&workshop, "out", &options);
    let (height, normal) = (image.floats("P.Z"), image.floats("N.Z"));
    let lowest = height.iter().copied().fold(0.0, f32::min);
    assert!(lowest < -2.0 && lowest > -2.01, "{lowest}");
    let floor = height.iter().zip(normal).filter(|(z, _)| **z < -2.0);
    assert!(floor.clone().count() > 50 && floor.into_iter().all(|(_, n)| *n == 1.0));
}

// Starts the program eight times, each time after other changes of the files.
#[test]
fn each_frame_may_have_its_own_mesh() {
    let workshop = particles(3);
    for (frame, y) in [(1, -2.0), (2, -3.0)] {
        wall(&workshop.join(format!("wall.{frame:03}.stl")), y);
    }
    let options = ["--mesh", "wall.###.stl"];
    let z = |frame: u32| {
        let image = Picture::open(&workshop.join(format!("out/f.{frame}.exr")));
        image.floats("Z")[18 * 64 + 31]
    };
    // A frame without its mesh fails alone
    let ran = render(&workshop, "out", &options).expect(1);
    let message = ran.errors();
    assert!(message.contains("wall.003.stl: the mesh of the frame does not exist"), "{message}");
    assert!(message.contains("input.frames"), "{message}");
    assert!((z(1) - 4.0).abs() < 1e-5 && (z(2) - 3.0).abs() < 1e-5);
    wall(&workshop.join("wall.003.stl"), -4.0);
    let ran = render(&workshop, "out", &options).expect(0);
    assert_eq!(ran.rendered(), [3]);
    assert!((z(3) - 2.0).abs() < 1e-5);
    render(&workshop, "out", &options).expect(0).prints("3 of 3 frames are done already");
    // Isolated frames read the same meshes
    let isolated = [&options[..], &["--isolate"]].concat();
    render(&workshop, "isolated", &isolated).expect(0);
    assert!(images(&workshop.join("isolated")) == images(&workshop.join("out")));
    // Meshes do not make other particles the same input
    fs::create_dir_all(workshop.join("other")).expect("a directory");
    write::npy::write(&workshop.join("other/f_1.npy"), &[Vec3::ZERO; 9]).expect("a file");
    let other = ["render", "other", "-o", "out/f.#.exr"];
    workshop.run(&[&other[..], &VIEW, &options].concat()).expect(2).prints("other");
    // One that changed after its image was made
    wall(&workshop.join("wall.002.stl"), -3.5);
    let ran = render(&workshop, "out", &options);
    let message = ran.errors();
    assert_ne!(ran.code(), Some(0), "{message}");
    assert!(message.contains("wall.002.stl"), "{message}");
    let keep = [&options[..], &["--keep-done"]].concat();
    render(&workshop, "out", &keep).expect(0);
    let force = [&options[..], &["--force"]].concat();
    render(&workshop, "out", &force).expect(0);
    assert!((z(2) - 2.5).abs() < 1e-5);
}

#[test]
fn another_mesh_is_another_job() {
    let workshop = particles(1);
    wall(&workshop.join("wall.stl"), -2.0);
    let options = ["--mesh", "wall.stl"];
    render(&workshop, "out", &options).expect(0);
    // The same mesh elsewhere
    fs::rename(workshop.join("wall.stl"), workshop.join("moved.stl")).expect("a rename");
    render(&workshop, "out", &["--mesh", "moved.stl"])
        .expect(0)
        .prints("1 of 1 frames are done already");
    wall(&workshop.join("wall.stl"), -3.0);
    render(&workshop, "out", &options).expect(2).prints("mesh.0.path");
    render(&workshop, "out", &[]).expect(2).prints("mesh.0.path");
}

#[test]
fn meshes_that_cannot_be_rendered_are_named() {
    let workshop = particles(1);
    render(&workshop, "out", &["--mesh", "nothing.stl"])
        .expect(2)
        .prints("mesh.0.path: ")
        .prints("nothing.stl");
    let bad = "v nan 0 0\nv 1 0 0\nv 0 0 1\nv 0 1 0\n";
    fs::write(workshop.join("nan.obj"), format!("{bad}f 1 2 3\n")).expect("a file");
    render(&workshop, "out", &["--mesh", "nan.obj"])
        .expect(2)
        .prints("nan.obj: no triangle can be rendered: 1 have a coordinate that is not finite");
    let some = format!("{bad}f 1 2 3\nf 2 3 4\nf 2 2 4\n");
    fs::write(workshop.join("some.obj"), some).expect("a file");
    render(&workshop, "out", &["--mesh", "some.obj"])
        .expect(0)
        .prints("some.obj: 1 of 3 triangles left out: a coordinate is not finite")
        .prints("some.obj: 1 of 3 triangles left out: without an area");
    assert!(!files(&workshop.join("out")).is_empty());
}

// Starts the program nine times: each structure on two numbers of threads, with eight samples a pixel.
#[test]
fn images_depend_on_neither_threads_nor_structures() {
    let workshop = particles(1);
    tank(&workshop.join("tank.stl"));
    let sets = ["mesh.0.faces=back", "mesh.1.material=glass", "mesh.1.scale=0.5"];
    let mut options = vec!["--mesh", "tank.stl", "--mesh", "tank.stl", "--integrator", "path"];
    options.extend(sets.iter().flat_map(|set| ["--set", set]));
    options.extend(["--set", "image.samples=8"]);
    let mut all = Vec::new();
    for threads in ["1", "3"] {
        for structure in Structure::ALL {
            let out = format!("{structure}-{threads}");
            let run = ["--threads", threads, "--accelerator", structure.name()];
            render(&workshop, &out, &[&options[..], &run].concat()).expect(0);
            all.push(images(&workshop.join(out)));
        }
    }
    assert!(all.iter().all(|images| *images == all[0]));
    // A single frame without a job is the same
    let still = [&["still", "in", "-o", "a.exr"][..], &VIEW, &options].concat();
    workshop.run(&still).expect(0);
    let image = fs::read(workshop.join("a.exr")).expect("an image");
    assert!(image == all[0]["f.1.exr"]);
}

#[test]
fn meshes_move_to_those_of_the_next_frame() {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    for frame in 1..=3 {
        let text = "1\nProperties=pos:R:3:velo:R:3\n0 0 30 0 0 0\n";
        fs::write(workshop.join(format!("in/f_{frame}.xyz")), text).expect("a file");
        // The edge of the wall moves by 1 to the right
        let corner = Vec3::new(frame as f32 - 11.0, 0.0, -9.0);
        let path = workshop.join(format!("wall_{frame}.stl"));
        stl(&path, &side(corner, 9.0 * Vec3::X, 18.0 * Vec3::Z));
    }
    let options = [
        "--mesh",
        "wall_%d.stl",
        "--ground=none",
        "--set",
        "output.transparent=true",
        "--set",
        "output.frame_time=1",
        "--set",
        "camera.shutter=1",
        "--set",
        "camera.shutter_offset=0",
    ];
    // More samples
    let view = VIEW.map(|argument| if argument == "1" { "64" } else { argument });
    let render = |out: &str| {
        let pattern = format!("{out}/f.#.exr");
        let command = ["render", "in", "-o", pattern.as_str()];
        workshop.run(&[&command[..], &view, &options].concat())
    };
    let ran = render("out");
    let told = ran.expect(0).errors();
    assert!(!told.contains("not blurred"), "{told}");
    // The part of the time for which the wall covers each pixel of the middle row, whose height is 2 tan(22.5 deg) 6
    let pixel = 12.0 * 22.5_f32.to_radians().tan() / 36.0;
    for frame in 1..=3 {
        let picture = Picture::open(&workshop.join(format!("out/f.{frame}.exr")));
        let row = &picture.floats("A")[18 * 64..][..64];
        for (x, found) in (0_u8..).zip(row) {
            let at = (f32::from(x) + 0.5 - 32.0) * pixel;
            let edge = frame as f32 - 2.0;
            let expected = (edge + 1.0 - at).clamp(0.0, 1.0);
            assert!((found - expected).abs() < 0.1, "{frame} {x}: {found} {expected}");
        }
    }
    // Meshes with other triangles stay where they are
    tank(&workshop.join("wall_2.stl"));
    let ran = render("other");
    let told = ran.expect(0).errors();
    assert!(told.contains("wall_2.stl has other triangles"), "{told}");
}
