//! Light channels add up to the colour, and light is in the channel of its first interaction.
//!
//! Each case is rendered twice, with light channels and without.

use crate::harness::{Workshop, dam_break};
use crate::picture::Picture;

const CLASSES: [&str; 6] =
    ["diffuse", "specular", "reflection", "refraction", "emission", "background"];

/// Renders frame 6 of the dam break as a still.
fn picture(workshop: &Workshop, name: &str, channels: &str, options: &[&str]) -> Picture {
    let arguments = ["still", "in", "-o", name, "--width", "96", "--height", "54"];
    let more = ["--samples", "4", "--channels", channels];
    workshop.run(&[&arguments[..], &more, options].concat()).expect(0);
    Picture::open(&workshop.join(name))
}

/// Whether a channel has light anywhere. A shadow catcher leaves a thousandth of noise in the background.
fn is_lit(picture: &Picture, class: &str) -> bool {
    let planes = ["R", "G", "B"].map(|axis| picture.floats(&format!("{class}.{axis}")));
    planes.into_iter().flatten().any(|v| *v > 5e-3)
}

/// Checks that the light channels add up, and that just `expected` have light.
#[track_caller]
fn check(workshop: &Workshop, options: &[&str], expected: &[&str]) {
    let options = [options, &["--set", "render.denoise=false"]].concat();
    let lights = picture(workshop, "lights.exr", "RGBA,lights", &options);
    for axis in ["R", "G", "B"] {
        let planes = CLASSES.map(|class| lights.floats(&format!("{class}.{axis}")));
        for (pixel, color) in lights.floats(axis).iter().enumerate() {
            let sum: f32 = planes.iter().map(|plane| plane[pixel]).sum();
            let size: f32 = planes.iter().map(|plane| plane[pixel].abs()).sum();
            // All values are half-floats
            assert!((sum - color).abs() <= 1e-3 * size + 1e-5, "{options:?}: {sum} of {color}");
        }
    }
    let lit: Vec<&str> = CLASSES.into_iter().filter(|class| is_lit(&lights, class)).collect();
    assert_eq!(lit, expected, "{options:?}");
    // The colour does not depend on the channels
    let plain = picture(workshop, "plain.exr", "RGBA", &options);
    for axis in ["R", "G", "B", "A"] {
        assert_eq!(plain.planes[axis], lights.planes[axis], "{options:?}");
    }
}

const MATTE: [&str; 2] = ["--set", "material.type=\"matte\""];
const PATH: [&str; 2] = ["--integrator", "path"];

#[test]
fn light_channels_of_whitted_add_up() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let usual = ["diffuse", "specular", "reflection"];
    let with_background = [&usual[..], &["background"]].concat();
    let check = |options: &[&str], expected: &[&str]| {
        let whitted = ["--integrator", "whitted"];
        check(&workshop, &[&whitted[..], options].concat(), expected);
    };
    check(&["--ground"], &with_background);
    check(&["--set", "output.transparent=true"], &usual);
    let glass = ["--set", "material.transmission=0.8"];
    let classes = ["diffuse", "specular", "reflection", "refraction", "background"];
    check(&glass, &classes);
    let matte = ["--set", "material.reflection=0", "--set", "material.specular=0"];
    check(&matte, &["diffuse", "background"]);
}

#[test]
fn light_channels_of_path_add_up() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let studio = ["--look", "studio"];
    check(&workshop, &[&studio[..], &MATTE].concat(), &["diffuse", "background"]);
    let plastic = ["--set", "material.type=\"plastic\""];
    check(&workshop, &[&studio[..], &plastic].concat(), &["diffuse", "specular", "background"]);
    let metal = ["--set", "material.type=\"metal\"", "--set", "output.transparent=true"];
    check(&workshop, &[&studio[..], &metal].concat(), &["specular"]);
    let water = ["--look", "water"];
    // Wet ground is glossy
    let clear = ["diffuse", "specular", "reflection", "refraction", "background"];
    check(&workshop, &[&water[..], &PATH].concat(), &clear);
    // The last ray of a path leaves a pane, and sees the environment
    let ball = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/meshes/sphere-binary.stl");
    let pane = [
        "--mesh",
        ball,
        "--set",
        "mesh.0.material=glass",
        "--set",
        "mesh.0.translate=[-2.0, 0.5, 1.0]",
        "--max-depth",
        "1",
    ];
    let classes = ["diffuse", "reflection", "background"];
    check(&workshop, &[&studio[..], &MATTE, &pane].concat(), &classes);
    // Direct light only: the last ray of a path is a shadow ray
    let direct = ["--set", "render.bounces=0"];
    let classes = ["diffuse", "specular", "background"];
    check(&workshop, &[&studio[..], &plastic, &direct].concat(), &classes);
}

#[test]
fn denoising_leaves_the_noisy_colour() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let noisy = ["--look", "studio", "--set", "render.denoise=false"];
    let noisy = picture(&workshop, "noisy.exr", "RGBA,lights,noisy", &noisy);
    let denoised = ["--look", "studio", "--denoise"];
    let denoised = picture(&workshop, "denoised.exr", "RGBA,lights,noisy", &denoised);
    for axis in ["R", "G", "B"] {
        let name = format!("noisy.{axis}");
        assert_eq!(noisy.planes[axis], noisy.planes[&name]);
        assert_eq!(noisy.planes[axis], denoised.planes[&name]);
        assert_ne!(denoised.planes[axis], denoised.planes[&name]);
        for class in CLASSES {
            let name = format!("{class}.{axis}");
            assert_eq!(noisy.planes[&name], denoised.planes[&name]);
        }
    }
}

#[test]
fn shadows_are_the_fraction_of_direct_light_that_arrives() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    for options in [
        &["--ground", "--integrator", "whitted"][..],
        &["--ground", "--integrator", "path", "--set", "environment.type=\"sky\""],
        &["--look", "studio"],
    ] {
        let picture = picture(&workshop, "shadow.exr", "RGBA,shadow", options);
        let shadow = picture.floats("shadow");
        assert!(shadow.iter().all(|v| (0.0..=1.0).contains(v)), "{options:?}");
        let count = |is: fn(f32) -> bool| shadow.iter().filter(|v| is(**v)).count();
        let (lit, dark) = (count(|v| v > 0.99), count(|v| v < 0.5));
        assert!(lit > 100 && dark > 20, "{options:?}: {lit}, {dark}");
    }
}
