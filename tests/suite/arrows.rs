//! Arrows in pictures: where they are, whose they are, their colours, and data that have none.

use std::fs;

use spherule::render::NO_ID;

use crate::harness::Workshop;
use crate::picture::Picture;

/// An atom with a force to the right in the middle, one on the left without a force, and one above it with a force that is
/// no number.
const ATOMS: &str = "3\nProperties=species:S:1:pos:R:3:force:R:3:charge:R:1:id:I:1\n\
                     O 0 0 0 2 0 0 1 4\nO -2 0 0 0 0 0 2 6\nO -2 0 1.5 nan 0 0 3 8\n";

/// Looks along +y from a distance of 10 at a field 6.25 units high at the atoms: 9.6 pixels per unit.
const VIEW: [&str; 19] = [
    "--width=90",
    "--height=60",
    "--samples=1",
    "--radius=0.5",
    "--ground=none",
    "--set",
    "render.denoise=false",
    "--set",
    "material.color=[0.1, 0.2, 0.7]",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0, -10, 0]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "camera.fov=34.71",
    "--set",
    "output.channels=[\"RGBA\", \"Z\", \"albedo\", \"id\"]",
];

/// Pixels, as indices: the head of the arrow at x = 1.2, its shaft at x = 0.57, beside the shaft, and beyond the tip.
const HEAD: usize = 30 * 90 + 56;
const SHAFT: usize = 29 * 90 + 50;
const BESIDE: usize = 27 * 90 + 50;
const BEYOND: usize = 30 * 90 + 65;

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    fs::write(workshop.join("in.xyz"), ATOMS).expect("a file");
    workshop
}

fn picture(workshop: &Workshop, input: &str, arrows: &str, options: &[&str]) -> Picture {
    let arrows = format!("arrows=[{{ attribute = \"force\", radius = 0.2, {arrows} }}]");
    let command = ["still", input, "-o", "out.exr", "--set", &arrows];
    let ran = workshop.run(&[&command[..], &VIEW, options].concat());
    ran.expect(0);
    Picture::open(&workshop.join("out.exr"))
}

/// The pixels that arrows cover: where there is no id.
fn covered(picture: &Picture) -> Vec<usize> {
    let (ids, alpha) = (picture.integers("id.I"), picture.floats("A"));
    let is_arrow = |pixel: &usize| ids[*pixel] == NO_ID && alpha[*pixel] == 1.0;
    (0..ids.len()).filter(is_arrow).collect()
}

fn albedo(picture: &Picture, pixel: usize) -> [f32; 3] {
    ["albedo.R", "albedo.G", "albedo.B"].map(|name| picture.floats(name)[pixel])
}

#[track_caller]
fn near(found: [f32; 3], expected: [f32; 3]) {
    let is_near = |(a, b): (&f32, &f32)| (a - b).abs() < 2e-3;
    assert!(found.iter().zip(&expected).all(is_near), "{found:?}");
}

#[test]
fn arrows_begin_at_particles_and_follow_vectors() {
    let workshop = workshop();
    for integrator in ["whitted", "path"] {
        let with = |arrows: &str| {
            let options = ["--integrator", integrator];
            picture(&workshop, "in.xyz", arrows, &options)
        };
        let found = with("scale = 1, color = [0.8, 0.1, 0.05]");
        let arrow = covered(&found);
        assert!(arrow.contains(&HEAD) && arrow.contains(&SHAFT));
        assert!(!arrow.contains(&BESIDE) && !arrow.contains(&BEYOND));
        // The only arrow is on the right
        assert!(arrow.iter().all(|pixel| pixel % 90 > 45), "{arrow:?}");
        near(albedo(&found, HEAD), [0.8, 0.1, 0.05]);
        // The shaft is nearest at y = -0.2
        let depth = found.floats("Z")[SHAFT];
        assert!((9.8..9.85).contains(&depth), "{depth}");
        // Half as long, and around the atom
        let half = covered(&with("scale = 0.5"));
        assert!(!half.contains(&HEAD) && !half.is_empty());
        let around = covered(&with("scale = 1, anchor = \"center\""));
        assert!(!around.contains(&HEAD) && around.iter().any(|pixel| pixel % 90 < 40));
        // Colours of the particle, and of a value; viridis ends yellow
        near(albedo(&with("scale = 1, color = \"auto\""), HEAD), [0.1, 0.2, 0.7]);
        let mapped =
            "scale = 1, color = { attribute = \"charge\", map = \"viridis\", range = [0, 1] }";
        let [red, _, blue] = albedo(&with(mapped), SHAFT);
        assert!(red > 0.9 && blue < 0.1, "{red} {blue}");
    }
}

#[test]
fn only_some_particles_have_arrows() {
    let workshop = workshop();
    let has_arrow = |arrows: &str, options: &[&str]| {
        let arrows = format!("scale = 1, {arrows}");
        !covered(&picture(&workshop, "in.xyz", &arrows, options)).is_empty()
    };
    assert!(has_arrow("every = 4", &[]) && !has_arrow("every = 3", &[]));
    assert!(has_arrow("every = 1", &["--where", "charge < 2"]));
    assert!(!has_arrow("every = 1", &["--where", "charge > 1"]));
}

#[test]
fn native_frames_have_the_same_arrows() {
    let workshop = workshop();
    workshop.run(&["convert", "in.xyz", "-o", "native"]).expect(0);
    let arrows = "scale = 1, color = [0.8, 0.1, 0.05]";
    let original = picture(&workshop, "in.xyz", arrows, &[]);
    let native = picture(&workshop, "native", arrows, &[]);
    assert_eq!(covered(&native), covered(&original));
}

#[test]
fn impossible_arrows_are_refused_and_bad_vectors_are_noted() {
    let workshop = workshop();
    let run = |arrows: &str| {
        let arrows = format!("arrows=[{{ {arrows} }}]");
        let command = ["render", "in.xyz", "-o", "out.exr", "--set", &arrows];
        workshop.run(&[&command[..], &VIEW].concat())
    };
    for (arrows, part) in [
        (
            "attribute = \"forse\", scale = 1",
            "arrows.attribute: no attribute `forse` in the sampled frames (did you mean `force`?)",
        ),
        (
            "attribute = \"charge\", scale = 1",
            "arrows.attribute: `charge` has 1 number per particle, but arrows need",
        ),
        (
            "attribute = \"force\", scale = 1, color = { attribute = \"charge\" }",
            "arrows.color: the range of `charge` is not known; give it as range = [low, high]",
        ),
    ] {
        run(arrows).expect(2).prints(part);
    }
    run("attribute = \"force\", scale = 1").expect(0).prints("1 vectors of `force` are not finite");
}
