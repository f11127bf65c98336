//! Jobs of one body with spray or whitewater: the same on any number of threads and when they are resumed, and what the
//! surface is reported separately.

use std::fs;
use std::path::Path;

use glam::Vec3;
use serde_json::Value;

use crate::harness::{SMALL, Workshop, dam_break, images, npy};
use crate::picture::Picture;

const WATER: [&str; 5] =
    ["--look", "water", "--channels", "RGBA,Z,N,P,V,id,albedo", "--set=render.max_depth=5"];

#[test]
fn jobs_of_spheres_as_one_body_with_spray() {
    // The light on the ground takes most of the time of such small images: once is enough
    jobs_with_spray("union", &["--spray", "--set", "render.caustics={photons=0}"]);
}

// Five images, each with photons: their light must not depend on threads or resuming, either.
#[test]
fn jobs_of_a_smooth_surface_with_spray() {
    jobs_with_spray("smooth", &["--spray", "--set", "render.caustics={photons=5000}"]);
}

#[test]
fn jobs_of_a_smooth_surface_with_whitewater() {
    jobs_with_spray("smooth", &["--whitewater", "--set", "render.caustics={photons=0}"]);
}

/// Number of pixels of the particles' foam, spray and bubbles, and of all particles, in `image`.
fn white_pixels(image: &Path) -> (usize, usize) {
    let image = Picture::open(image);
    let [red, green, blue] = ["R", "G", "B"].map(|name| image.floats(&format!("albedo.{name}")));
    let depths = image.floats("Z");
    let is_white = |pixel: &usize| {
        let least = red[*pixel].min(green[*pixel]).min(blue[*pixel]);
        least > 0.8 && depths[*pixel].is_finite()
    };
    let count = depths.len();
    let particles = (0..count).filter(|pixel| depths[*pixel].is_finite()).count();
    ((0..count).filter(is_white).count(), particles)
}

#[test]
fn whitewater_is_where_water_is_violent() {
    let shop = Workshop::new();
    // At the start, the water is at rest; later, it splashes
    dam_break(&shop.join("in"), [1, 8]);
    let render = |out: &str, options: &[&str]| {
        let pattern = format!("{out}/f.####.exr");
        let dark = ["--set", "render.caustics={photons=0}"];
        // Drops of usual sizes are smaller than the pixels
        let large = ["--set", "surface.whitewater_size=3"];
        let common = [&["render", "in", "-o", &pattern][..], &dark, &large].concat();
        shop.run(&[&common[..], &SMALL, &WATER, options].concat()).expect(0);
        [1, 8].map(|frame| white_pixels(&shop.join(format!("{out}/f.{frame:04}.exr"))))
    };
    let [calm, violent] = render("white", &["--whitewater"]);
    assert!(calm.0 * 50 <= calm.1, "{calm:?}");
    assert!(violent.0 * 25 > violent.1, "{violent:?}");
    // More or less of it
    let speed = ["--whitewater", "--set", "surface.whitewater_speed=20"];
    let [_, slower] = render("slower", &speed);
    assert!(slower.0 * 2 < violent.0, "{slower:?} {violent:?}");
    let amount = ["--whitewater", "--set", "surface.whitewater_amount=0.2"];
    let [_, fewer] = render("fewer", &amount);
    assert!(fewer.0 < violent.0 && fewer.0 > 0, "{fewer:?} {violent:?}");
    let [_, none] = render("none", &[]);
    assert_eq!(none.0, 0);
    // The integrator without soft drops draws spheres
    let [_, spheres] = render("spheres", &["--whitewater", "--integrator", "whitted"]);
    assert!(spheres.0 > 0, "{spheres:?}");
}

#[test]
fn whitewater_needs_velocities() {
    let shop = Workshop::new();
    npy(&shop.join("in/f_1.npy"), 500, 1, Vec3::ZERO);
    let arguments = ["render", "in", "-o", "out/f.####.exr", "--look", "water", "--whitewater"];
    let ran = shop.run(&[&arguments[..], &SMALL].concat()).expect(2);
    let errors = ran.errors();
    let expected = "surface.whitewater: whitewater needs velocities, an attribute with three components called velocity";
    assert!(errors.contains(expected), "{errors}");
    // A frame without them fails alone
    let rows = |more: &str| {
        let row =
            |i: u32| format!("{},{},{}{more}\n", 0.1 * f64::from(i % 5), 0.1 * f64::from(i / 5), 0);
        (0..25).map(row).collect::<String>()
    };
    fs::create_dir(shop.join("mixed")).expect("a directory");
    let with = format!("x,y,z,vx,vy,vz\n{}", rows(",1,0,0"));
    fs::write(shop.join("mixed/f_6.csv"), with).expect("a file");
    fs::write(shop.join("mixed/f_7.csv"), format!("x,y,z\n{}", rows(""))).expect("a file");
    let arguments = ["render", "mixed", "-o", "out/f.####.exr", "--look", "water", "--whitewater"];
    let ran = shop.run(&[&arguments[..], &SMALL].concat()).expect(1);
    let errors = ran.errors();
    assert!(errors.contains("velocity") && errors.contains("surface.whitewater"), "{errors}");
    assert!(shop.join("out/f.0006.exr").exists());
}

fn jobs_with_spray(surface: &str, more: &[&str]) {
    let shop = Workshop::new();
    // When it splashes.
    dam_break(&shop.join("in"), 7..=8);
    let render = |out: &str, options: &[&str]| {
        let pattern = format!("{out}/f.####.exr");
        let arguments = ["render", "in", "-o", &pattern];
        let surface = ["--surface", surface];
        shop.run(&[&arguments[..], &SMALL, &WATER, &surface, more, options].concat()).expect(0)
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
    assert_eq!(frames.len(), 2);
    let seconds = |frame: &Value| frame["seconds"]["surface"].as_f64();
    let bytes = |frame: &Value| frame["bytes"]["surface"].as_u64();
    assert!(frames.iter().all(|frame| seconds(frame) > Some(0.0)));
    assert!(frames.iter().all(|frame| bytes(frame).is_some()));
    assert!(frames.iter().any(|frame| bytes(frame) > Some(0)));
}
