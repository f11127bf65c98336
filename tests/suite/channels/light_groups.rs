//! Layers of light groups in files: their names, their sum, and what they depend on.

use std::fs;

use crate::harness::{Workshop, dam_break};
use crate::picture::Picture;

const LAYERS: [&str; 4] = ["light_default", "light_fill-2", "light_key", "light_sky"];

/// A manifest with light groups. `key` and `fill` are the intensities of its lights.
fn manifest(key: f32, fill: f32, rest: &str) -> String {
    format!(
        r#"
[input]
path = "in"
[image]
width = 96
height = 54
samples = 4
[render]
ground = true
{rest}
[environment]
type = "sky"
group = "sky"
[output]
path = "out/f.####.exr"
channels = ["RGBA", "noisy", "light_groups", "Z"]
[[light]]
type = "directional"
direction = [1.0, -1.0, 0.5]
intensity = {key}
group = "key"
[[light]]
type = "point"
position = [2.0, 9.0, 2.0]
intensity = {fill}
group = "fill-2"
[[light]]
type = "directional"
direction = [0.0, -1.0, -0.2]
"#
    )
}

/// Renders frame 6 of the dam break in a job of its own.
fn rendered(text: &str) -> (Workshop, Picture) {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    fs::write(workshop.join("job.toml"), text).expect("a manifest");
    workshop.run(&["render", "job.toml"]).expect(0);
    let picture = Picture::open(&workshop.join("out/f.0006.exr"));
    (workshop, picture)
}

/// Checks that the layers add up to the colour before denoising.
#[track_caller]
fn check_sum(picture: &Picture, total: &str) {
    for axis in ["R", "G", "B"] {
        let planes = LAYERS.map(|layer| picture.floats(&format!("{layer}.{axis}")));
        for (pixel, color) in picture.floats(&format!("{total}{axis}")).iter().enumerate() {
            let sum: f32 = planes.iter().map(|plane| plane[pixel]).sum();
            let size: f32 = planes.iter().map(|plane| plane[pixel].abs()).sum();
            // All values are half-floats
            assert!((sum - color).abs() <= 1e-3 * size + 1e-5, "{sum} of {color}");
        }
    }
}

fn is_lit(picture: &Picture, layer: &str) -> bool {
    let planes = ["R", "G", "B"].map(|axis| picture.floats(&format!("{layer}.{axis}")));
    planes.into_iter().flatten().any(|v| *v > 1e-3)
}

#[test]
fn layers_add_up_to_the_colour_before_denoising() {
    let (workshop, picture) = rendered(&manifest(1.0, 0.5, ""));
    check_sum(&picture, "noisy.");
    assert!(LAYERS.iter().all(|layer| is_lit(&picture, layer)));
    workshop.run(&["verify", "out"]).expect(0);
    // A catcher shows the background, darker
    let (_, picture) = rendered(&manifest(1.0, 0.5, "").replace("= true", "= \"shadow_catcher\""));
    check_sum(&picture, "noisy.");
    // The environment gives no light to whitted
    let whitted = "integrator = \"whitted\"\ndenoise = false";
    let (workshop, picture) = rendered(&manifest(1.0, 0.5, whitted));
    check_sum(&picture, "");
    let lit = LAYERS.map(|layer| is_lit(&picture, layer));
    assert_eq!(lit, [true, true, true, false]);
    workshop.run(&["verify", "out"]).expect(0);
}

// Renders two jobs with all layers and four samples a pixel, one of them with a brighter light.
#[test]
fn brighter_lights_change_only_their_own_layer() {
    let (_, dim) = rendered(&manifest(1.0, 0.5, ""));
    let (_, bright) = rendered(&manifest(2.0, 0.5, ""));
    let mut changed = Vec::new();
    for (name, plane) in &dim.planes {
        if bright.planes[name] != *plane {
            changed.push(name.split('.').next().expect("a layer"));
        }
    }
    changed.dedup();
    assert_eq!(changed, ["B", "G", "R", "light_key", "noisy"]);
    // A factor of two is exact
    for axis in ["R", "G", "B"] {
        let of = |picture: &Picture| picture.floats(&format!("light_key.{axis}")).to_vec();
        let doubled: Vec<f32> = of(&dim).iter().map(|v| 2.0 * v).collect();
        // But for the smallest half-floats
        let pairs = doubled.iter().zip(of(&bright));
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
    }
}

// Starts the program four times: with the channel and without, before and after a change.
#[test]
fn groups_are_settings_of_jobs_with_their_channel() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=7);
    let text = manifest(1.0, 0.5, "");
    let write = |text: &str| fs::write(workshop.join("job.toml"), text).expect("a manifest");
    write(&text);
    workshop.run(&["render", "job.toml"]).expect(0);
    write(&text.replace("fill-2", "fill-3"));
    let ran = workshop.run(&["render", "job.toml"]).expect(2);
    assert!(ran.errors().contains("light.1.group"), "{}", ran.errors());
    // Without the channel, no image depends on them
    let text = text.replace(", \"light_groups\"", "").replace("out/", "plain/");
    write(&text);
    workshop.run(&["render", "job.toml"]).expect(0);
    write(&text.replace("fill-2", "fill-3"));
    workshop.run(&["render", "job.toml"]).expect(0);
}

#[test]
fn names_that_cannot_be_layers_are_refused() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    for (group, message) in [
        ("default", "\"default\" is the layer of light without a group"),
        ("a b", "expected a name of 1 to 64 letters, digits"),
        ("key.R", "expected a name of 1 to 64 letters, digits"),
        ("", "expected a name of 1 to 64 letters, digits"),
    ] {
        let text = manifest(1.0, 0.5, "").replace("fill-2", group);
        fs::write(workshop.join("job.toml"), text).expect("a manifest");
        let ran = workshop.run(&["render", "job.toml"]).expect(2);
        for part in ["light.1.group", message, "line 26"] {
            assert!(ran.errors().contains(part), "{}", ran.errors());
        }
    }
    // More groups than there can be layers
    let many: String = (0..64)
        .map(|i| {
            format!("[[light]]\ntype = \"directional\"\ndirection = [0, 0, -1]\ngroup = \"g{i}\"\n")
        })
        .collect();
    fs::write(workshop.join("job.toml"), manifest(1.0, 0.5, "") + &many).expect("a manifest");
    let ran = workshop.run(&["render", "job.toml"]).expect(2);
    assert!(ran.errors().contains("at most 63"), "{}", ran.errors());
}
