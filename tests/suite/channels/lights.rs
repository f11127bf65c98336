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
    // One pass of adaptive sampling above a shadow catcher, and several, which are joined
    for noise in ["5", "0.1"] {
        let options = [&studio[..], &MATTE, &["--noise", noise]].concat();
        check(&workshop, &options, &["diffuse", "background"]);
    }
    let metal = ["--set", "material.type=\"metal\"", "--set", "output.transparent=true"];
    check(&workshop, &[&studio[..], &metal].concat(), &["specular"]);
    // Few photons: they add light that is diffuse, however many
    let water = ["--look", "water", "--set", "render.caustics={photons=20000}"];
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
fn direct_light_has_one_interaction() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let lit = |options: &[&str]| {
        let noisy = [&["--set", "render.denoise=false"], options].concat();
        let picture = picture(&workshop, "direct.exr", "RGBA,direct,indirect", &noisy);
        let mut sums = [0.0; 2];
        for axis in ["R", "G", "B"] {
            let [direct, indirect] =
                ["direct", "indirect"].map(|class| picture.floats(&format!("{class}.{axis}")));
            for (pixel, color) in picture.floats(axis).iter().enumerate() {
                let (direct, indirect) = (direct[pixel], indirect[pixel]);
                let size = direct.abs() + indirect.abs();
                assert!((direct + indirect - color).abs() <= 2e-3 * size + 1e-5, "{options:?}");
                // A shadow catcher leaves some noise
                assert!(direct > -0.05 && indirect > -5e-3, "{options:?}: {direct} {indirect}");
                sums = [sums[0] + direct, sums[1] + indirect];
            }
        }
        sums
    };
    let matte = [&["--look", "studio"], &MATTE[..]].concat();
    let [direct, indirect] = lit(&matte);
    // Most of it is the background
    assert!(indirect > 0.005 * direct && indirect < 0.5 * direct, "{direct} {indirect}");
    // Without further reflections, the same direct light alone
    let [alone, none] = lit(&[&matte[..], &["--set", "render.bounces=0"]].concat());
    assert!((alone / direct - 1.0).abs() < 0.01 && none.abs() < 0.01 * indirect, "{alone} {none}");
    // What is seen through water has been refracted twice, and caustics come through it
    let [direct, indirect] = lit(&["--look", "water"]);
    assert!(indirect > 0.1 * direct, "{direct} {indirect}");
    // The model of the thesis: reflected particles are indirect, reflected background is not
    let whitted = ["--integrator", "whitted", "--set", "render.background=[1,1,1]"];
    let [_, some] = lit(&whitted);
    let [_, less] = lit(&[&whitted[..], &["--max-depth", "1"]].concat());
    assert!(some > 0.0 && less == 0.0, "{some} {less}");
}

/// The shadow catcher of a studio: `shadow_catcher` times a plate is the plate with shadows.
#[test]
fn shadow_catchers_have_a_pass() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let studio = ["--look", "studio", "--set", "render.background=[0.25,0.5,1]"];
    let channels = "RGBA,shadow_catcher,id";
    let noisy = [&studio[..], &["--set", "render.denoise=false"]].concat();
    let opaque = picture(&workshop, "opaque.exr", channels, &noisy);
    let clear = ["--set", "output.transparent=true"];
    let transparent = picture(&workshop, "clear.exr", channels, &[&noisy[..], &clear].concat());
    let clean = picture(&workshop, "clean.exr", channels, &[&studio[..], &clear].concat());
    let pass = |picture: &Picture, axis| picture.floats(&format!("shadow_catcher.{axis}")).to_vec();
    // The shadow in the coverage has its luminance
    let [r, g, b] = ["R", "G", "B"].map(|axis| pass(&transparent, axis));
    for (pixel, alpha) in transparent.floats("A").iter().enumerate() {
        let arriving = 0.2126 * r[pixel] + 0.7152 * g[pixel] + 0.0722 * b[pixel];
        if opaque.floats("A")[pixel] == 0.0 {
            assert!((1.0 - arriving - alpha).abs() < 0.01, "{arriving} {alpha}");
        }
    }
    let mut dark = 0;
    for (axis, plate) in [("R", 0.25), ("G", 0.5), ("B", 1.0)] {
        let arriving = pass(&opaque, axis);
        assert_eq!(arriving, pass(&transparent, axis));
        for (pixel, part) in arriving.iter().enumerate() {
            if opaque.floats("A")[pixel] == 0.0 {
                assert!((part * plate - opaque.floats(axis)[pixel]).abs() < 2e-3);
                dark += usize::from(*part < 0.8);
            } else if opaque.floats("A")[pixel] == 1.0 {
                assert_eq!(*part, 1.0, "particles are no shadows");
            }
        }
        // It is as clean as the coverage
        let [noisy_alpha, clean_alpha] = [&transparent, &clean].map(|p| p.floats("A").to_vec());
        for (pixel, part) in pass(&clean, axis).iter().enumerate() {
            let expected = arriving[pixel] + noisy_alpha[pixel] - clean_alpha[pixel];
            assert!((part - expected.max(0.0)).abs() < 3e-3, "{part} {expected}");
        }
    }
    assert!(dark > 50, "{dark}");
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
