//! Jobs of one body with spray: the same on any number of threads and when they are resumed, and what the
//! surface is reported separately.

use std::fs;

use serde_json::Value;

use crate::harness::{SMALL, Workshop, dam_break, images};

const WATER: [&str; 6] = [
    "--look",
    "water",
    "--spray",
    "--channels",
    "RGBA,Z,N,P,V,id,albedo",
    "--set=render.max_depth=5",
];

#[test]
fn jobs_of_spheres_as_one_body_with_spray() {
    // The light on the ground takes most of the time of such small images: once is enough
    jobs_with_spray("union", &["--set", "render.caustics={photons=0}"]);
}

// Seven images, each with photons: their light must not depend on threads or resuming, either.
#[test]
fn jobs_of_a_smooth_surface_with_spray() {
    jobs_with_spray("smooth", &["--set", "render.caustics={photons=20000}"]);
}

fn jobs_with_spray(surface: &str, caustics: &[&str]) {
    let shop = Workshop::new();
    // When it splashes.
    dam_break(&shop.join("in"), 6..=8);
    let render = |out: &str, options: &[&str]| {
        let pattern = format!("{out}/f.####.exr");
        let arguments = ["render", "in", "-o", &pattern];
        let surface = ["--surface", surface];
        shop.run(&[&arguments[..], &SMALL, &WATER, &surface, caustics, options].concat()).expect(0)
    };
    render("one", &["--threads", "1"]);
    render("many", &["--threads", "3"]);
    let expected = images(&shop.join("one"));
    assert!(expected == images(&shop.join("many")), "threads change the image");

    // What is lost is made again.
    fs::remove_file(shop.join("many/f.0007.exr")).expect("an image");
    render("many", &["--threads", "3"]);
    assert!(expected == images(&shop.join("many")), "resuming changes the image");

    let report = shop.report("one");
    let frames = report["frames"].as_array().expect("frames");
    assert_eq!(frames.len(), 3);
    let seconds = |frame: &Value| frame["seconds"]["surface"].as_f64();
    let bytes = |frame: &Value| frame["bytes"]["surface"].as_u64();
    assert!(frames.iter().all(|frame| seconds(frame) > Some(0.0)));
    assert!(frames.iter().all(|frame| bytes(frame).is_some()));
    assert!(frames.iter().any(|frame| bytes(frame) > Some(0)));
}
