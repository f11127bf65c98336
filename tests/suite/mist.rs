//! Mist from outside: what its keys mean, what it covers, where it is refused, and jobs without it.

use std::fmt::Write as _;
use std::fs;

use crate::harness::{SMALL, Workshop, images};
use crate::picture::Picture;

/// A row of white spheres 10 before the camera, which looks along y, 1 above the ground.
fn wall() -> Workshop {
    let workshop = Workshop::new();
    let mut csv = "x,y,z\n".to_owned();
    for i in -4..=4 {
        let _ = writeln!(csv, "{},11,1", 2 * i);
    }
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    fs::write(workshop.join("in/f_1.csv"), csv).expect("a file");
    workshop
}

const VIEW: &str = "output.preview = false
output.transparent = true
render = { ground = \"plain\", ground_height = 0.0, ground_reach = \"far\", denoise = false, bounces = 0 }
material.color = [1, 1, 1]
";

const CAMERA: &str = "image = { width = 16, height = 16, samples = 256 }
camera = { mode = \"fixed\", eye = [0, 0, 1], look_at = [0, 11, 1], up = [0, 0, 1], fov = 0.4 }
";

fn render(workshop: &Workshop, out: &str, text: &str) -> Picture {
    let input = "input = { path = \"in\", radius = 1.0, up = \"z\" }";
    let text = format!("{input}\noutput.path = \"{out}/f.####.exr\"\n{VIEW}{text}");
    fs::write(workshop.join("job.toml"), text).expect("a manifest");
    workshop.run(&["render", "job.toml"]).expect(0);
    Picture::open(&workshop.join(out).join("f.0001.exr"))
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

/// The light of a sphere through black mist, by the law of Beer and Lambert.
#[test]
fn visibility_and_height_are_lengths_of_the_scene() {
    let workshop = wall();
    let of = |out: &str, mist: &str| {
        let picture = render(&workshop, out, &format!("{CAMERA}{mist}"));
        mean(picture.floats("R"))
    };
    let lamp = "environment.intensity = 0\n[[light]]\ntype = \"point\"\nposition = [0, 9.9, 1]\n";
    let [near, far] = [("near", "0"), ("far", "8")].map(|(out, visibility)| {
        let mist = match visibility {
            "0" => String::new(),
            own => format!("mist = {{ visibility = {own}, height = 2.0, color = \"black\" }}\n"),
        };
        of(out, &format!("{mist}{lamp}"))
    });
    // Ten lengths at the density of the eye, and a tenth from the lamp
    let expected = (-3.912_f32 / 8.0 * (-0.5_f32).exp() * 10.1).exp();
    assert!((far / near / expected - 1.0).abs() < 0.03, "{far} {near} {expected}");
}

#[test]
fn mist_covers_the_background_in_each_projection() {
    let workshop = wall();
    let up = "image = { width = 16, height = 16, samples = 256 }\nselect.where = \"index == 0\"\n\
              mist = { visibility = 3.912, height = 0.8, color = [1.0, 0.9, 0.8] }\n";
    // Straight up from the ground, the optical depth is the height
    let expected = 1.0 - (-0.8_f32).exp();
    let camera = "mode = \"fixed\", eye = [0, 0, 0.001], look_at = [0, 0, 9], up = [0, 1, 0]";
    for (out, camera) in [
        ("perspective", format!("camera = {{ {camera}, fov = 1.0 }}\n")),
        (
            "orthographic",
            format!("camera = {{ {camera}, projection = \"orthographic\", height = 0.01 }}\n"),
        ),
    ] {
        let picture = render(&workshop, out, &format!("{up}{camera}"));
        let found = mean(picture.floats("A"));
        assert!((found - expected).abs() < 0.02, "{out}: {found} {expected}");
        // Colours are multiplied by it, in those of the mist
        let [red, blue] = ["R", "B"].map(|name| mean(picture.floats(name)));
        assert!(blue > 0.0 && blue < 0.95 * red, "{red} {blue}");
    }
    // All around, it is densest at the horizon, and below the horizon is the ground
    let around = "image = { width = 32, height = 16, samples = 64 }\nselect.where = \"index == 0\"\n\
                  camera = { projection = \"equirectangular\", mode = \"fixed\", eye = [0, 0, 0.5], \
                  look_at = [0, 9, 0.5], up = [0, 0, 1] }\n\
                  mist = { visibility = 8.0, height = 0.8 }\n";
    let picture = render(&workshop, "around", around);
    let row = |y: usize| mean(&picture.floats("A")[32 * y..32 * (y + 1)]);
    assert!(row(0) > 0.05 && row(0) < row(4) && row(4) < row(7), "{} {}", row(0), row(4));
    assert!(row(7) > 0.7 && row(12) == 1.0, "{} {}", row(7), row(12));
}

#[test]
fn bytes_do_not_depend_on_threads_and_without_mist_nothing_changes() {
    let workshop = wall();
    let of = |out: &str, options: &[&str]| {
        let pattern = format!("{out}/f.####.exr");
        let command = ["render", "in", "-o", &pattern, "--radius=1", "--ground"];
        workshop.run(&[&command[..], &SMALL, options].concat()).expect(0);
        images(&workshop.join(out))
    };
    let mist = "--set=mist.visibility=5";
    let one = of("one", &[mist, "--threads=1"]);
    assert_eq!(one, of("five", &[mist, "--threads=5"]));
    let clear = of("clear", &[]);
    assert_ne!(one, clear);
    assert_eq!(clear, of("colour", &["--set=mist.color=[1,0,0]", "--set=mist.anisotropy=0"]));
    // A job goes on only with the same mist
    let other = ["render", "in", "-o", "one/f.####.exr", "--radius=1", "--ground"];
    let ran = workshop.run(&[&other[..], &SMALL, &["--set=mist.visibility=6"]].concat());
    ran.expect(2).prints("mist.visibility");
}

#[test]
fn what_is_impossible_is_explained() {
    let workshop = wall();
    let still = ["still", "in", "-o", "a.png", "--radius=1"];
    for (options, expected) in [
        (
            &["--set=mist.visibility=3", "--integrator=whitted"][..],
            "mist.visibility=3: render.integrator = \"whitted\" has no mist; choose \"path\"",
        ),
        (&["--set=mist.visibility=0"], "mist.visibility=0: "),
        (&["--set=mist.visibility=-2"], "mist.visibility=-2: "),
        (&["--set=mist.visibility=nan"], "mist.visibility=nan: "),
        (&["--set=mist.visibility=3", "--set=mist.height=0"], "mist.height=0: "),
    ] {
        workshop.run(&[&still[..], &SMALL, options].concat()).expect(2).prints(expected);
    }
    // Lengths that are much larger or smaller than the scene
    for extreme in ["visibility=1e30", "visibility=1e-30", "height=1e-30", "height=1e30"] {
        let options = ["--set=mist.visibility=3", &format!("--set=mist.{extreme}")];
        workshop.run(&[&still[..], &SMALL, &options].concat()).expect(0);
    }
    let ran = workshop.run(&[&still[..], &SMALL, &["--set=mist.height=2"]].concat());
    ran.expect(0).prints("mist.height=2: has no effect: there is no mist; set mist.visibility");
}
