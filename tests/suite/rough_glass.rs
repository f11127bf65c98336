//! Rough glass and water: a white furnace, and what the settings mean.

use std::fs;

use crate::harness::{Ran, Workshop, images};
use crate::picture::Picture;

/// A ball of radius 1 in surroundings of radiance 1.
fn ball() -> Workshop {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    fs::write(workshop.join("in/f_1.csv"), "x,y,z\n0,0,0\n").expect("a file");
    workshop
}

const FURNACE: &[&str] = &[
    "--width",
    "32",
    "--height",
    "32",
    "--radius",
    "1",
    "--ground=none",
    "--set",
    "render.background=[0, 0, 0]",
    "--set",
    "render.denoise=false",
    "--set",
    "render.max_depth=17",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0, -9, 0]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "camera.fov=12",
];

fn render(workshop: &Workshop, out: &str, options: &[&str]) -> Ran {
    let pattern = format!("{out}/f.####.exr");
    let command = ["render", "in", "-o", &pattern];
    workshop.run(&[&command[..], FURNACE, options].concat())
}

/// The mean over pixels that the ball covers.
fn mean(workshop: &Workshop, out: &str, options: &[&str]) -> f32 {
    render(workshop, out, &[options, &["--samples", "256"]].concat()).expect(0);
    let picture = Picture::open(&workshop.join(out).join("f.0001.exr"));
    let covered = picture.floats("R").iter().zip(picture.floats("A"));
    let covered: Vec<f32> =
        covered.filter(|(_, alpha)| **alpha > 0.999).map(|(red, _)| *red).collect();
    assert!(covered.len() > 300, "{}", covered.len());
    covered.iter().sum::<f32>() / covered.len() as f32
}

// Nine images with 256 samples a pixel and long paths: the least tolerance is 0.2 percent.
#[test]
fn a_rough_ball_in_white_surroundings_is_nearly_white() {
    let workshop = ball();
    let mut found = Vec::new();
    for (roughness, least, most) in [("0", 0.998, 1.002), ("0.4", 0.985, 1.015), ("1", 0.95, 1.05)]
    {
        let key = format!("material.roughness={roughness}");
        for (kind, surface) in [("glass", "spheres"), ("glass", "union"), ("water", "spheres")] {
            let out = format!("{kind}-{surface}-{roughness}");
            let material = format!("material.type={kind}");
            let white = "environment.type=constant";
            let keys = ["--set", &key, "--set", &material, "--set", white];
            let options = [&keys[..], &["--surface", surface]].concat();
            let mean = mean(&workshop, &out, &options);
            found.push(format!("{out}: {mean}"));
            assert!((least..=most).contains(&mean), "{found:#?}");
        }
    }
}

// Starts the program eight times: each setting, number of threads and structure.
#[test]
fn glass_is_smooth_by_default_and_rough_images_do_not_depend_on_threads() {
    let workshop = ball();
    let made = |out: &str, options: &[&str]| {
        let glass = ["--set", "material.type=glass", "--samples", "4"];
        render(&workshop, out, &[&glass[..], options].concat()).expect(0);
        images(&workshop.join(out)).into_values().collect::<Vec<_>>()
    };
    let smooth = made("smooth", &[]);
    assert!(smooth == made("default", &["--set", "material.roughness=0.55"]));
    assert!(smooth == made("zero", &["--set", "material.roughness=0"]));
    let rough = ["--set", "material.roughness=0.3", "--set", "environment.type=studio"];
    let one = made("one", &[&rough[..], &["--threads", "1"]].concat());
    let three = made("three", &[&rough[..], &["--threads", "3"]].concat());
    assert!(one == three && one != smooth);
    for structure in ["kdtree", "bvh", "sbvh"] {
        let other = made(structure, &[&rough[..], &["--accelerator", structure]].concat());
        assert!(other == one, "{structure}");
    }
}
