//! The picture does not depend on the acceleration structure: the same bytes from all of them, on
//! what simulations wrote and on random particles, with one sample a pixel and with four.
//!
//! A test renders each frame eight times: by four structures, with both numbers of samples.

use std::fs;

use glam::Vec3;
use spherule::accel::Structure;

use crate::harness::{Workshop, npy, sample};

/// Transparent, so that rays go on inside, with light and shadows of several kinds.
const GLASS: &[&str] = &["--set", "material.transmission=0.8", "--set", "render.max_depth=5"];
/// Everything that can be in an image.
const ALL_CHANNELS: &[&str] = &["--set", r#"output.channels=["RGBA","Z","N","P","id","albedo"]"#];

/// Renders `input` with every structure and compares the images.
#[track_caller]
fn same_from_all(workshop: &Workshop, input: &str, options: &[&str]) {
    same_with_samples(workshop, input, &["1", "4"], options);
}

/// The same with these numbers of samples.
#[track_caller]
fn same_with_samples(workshop: &Workshop, input: &str, counts: &[&str], options: &[&str]) {
    for samples in counts {
        let images = Structure::ALL.map(|structure| {
            let out = format!("{structure}-{samples}/f.####.exr");
            let image = [
                &["render", input, "-o", &out, "--accelerator", structure.name()][..],
                &["--width", "112", "--height", "63", "--samples", samples],
                options,
            ]
            .concat();
            let ran = workshop.run(&image);
            assert_eq!(ran.code(), Some(0), "{}", ran.errors());
            let folder = workshop.join(format!("{structure}-{samples}"));
            let mut paths: Vec<_> = fs::read_dir(folder)
                .expect("images")
                .map(|entry| entry.expect("an entry").path())
                .filter(|path| path.extension().is_some_and(|e| e == "exr"))
                .collect();
            paths.sort();
            assert!(!paths.is_empty(), "{structure}: no image");
            let read = |path| fs::read(path).expect("an image");
            (structure, paths.into_iter().map(read).collect::<Vec<_>>())
        });
        let (first, expected) = &images[0];
        for (structure, bytes) in &images[1..] {
            assert!(
                bytes == expected,
                "{input}, {samples} samples: {structure} differs from {first}"
            );
        }
    }
}

/// A file of the samples.
#[track_caller]
fn same_on_sample(file: &str, options: &[&str]) {
    let path = sample(file);
    same_from_all(&Workshop::new(), path.to_str().expect("a path in UTF-8"), options);
}

#[test]
fn dam_break() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/dam-break/ParticleData_Fluid_9.bgeo");
    same_from_all(&Workshop::new(), path, ALL_CHANNELS);
}

#[test]
fn glassy_emitter() {
    same_on_sample("emitter_sph/ParticleData_Fluid_10.bgeo", GLASS);
}

#[test]
fn dam_break_of_pysph() {
    let lamps = ["--set", "render.ground=true"];
    same_on_sample("pysph/dam_break_3d_fluid_00100.vtu", &lamps);
}

#[test]
fn dam_break_in_a_studio() {
    let look = ["--look", "studio"];
    same_on_sample("pysph/dam_break_3d_fluid_00100.vtu", &look);
}

#[test]
fn molecules() {
    same_on_sample("lammps_drop/steps", ALL_CHANNELS);
}

#[test]
fn random_box() {
    let workshop = Workshop::new();
    npy(&workshop.join("box.npy"), 30_000, 1, Vec3::ZERO);
    same_from_all(&workshop, "box.npy", ALL_CHANNELS);
}

#[test]
fn random_glass_far_from_the_origin() {
    let workshop = Workshop::new();
    npy(&workshop.join("box.npy"), 3_000, 2, Vec3::new(1e4, -2e4, 500.0));
    let wide = [GLASS, &["--radius", "0.15"]].concat();
    same_from_all(&workshop, "box.npy", &wide);
}

/// Radii that vary a thousandfold: boxes hold spheres, and large ones reach into many of them.
#[test]
fn radii_of_their_own() {
    let workshop = Workshop::new();
    let mut text = "x,y,z,r\n".to_owned();
    for i in 0..2_000_u32 {
        let part = |salt: u32| f64::from((i * 7919 + salt).wrapping_mul(2_654_435_761) >> 8) / 2e7;
        let radius = if i % 100 == 0 { 0.1 } else { 1e-4 + part(4) * 0.01 };
        text += &format!("{},{},{},{radius}\n", part(1), part(2), part(3));
    }
    fs::write(workshop.join("p.csv"), text).expect("a file");
    let own = r#"input.radius={attribute="r"}"#;
    same_from_all(&workshop, "p.csv", &[GLASS, &["--set", own]].concat());
}

#[test]
fn water_as_a_union() {
    let path = sample("emitter_sph/ParticleData_Fluid_10.bgeo");
    let file = path.to_str().expect("a path in UTF-8");
    // The light on the ground takes most of the time of such small images: once is enough. Of a smooth surface, only the
    // spray is in a structure.
    for (surface, photons, counts) in [("union", 0, &["1", "4"][..]), ("smooth", 5_000, &["4"])] {
        let caustics = format!("render.caustics={{photons={photons}}}");
        let look = ["--look", "water", "--set", &caustics];
        let water = [&look[..], &["--spray", "--surface", surface]].concat();
        let options = [&water[..], ALL_CHANNELS].concat();
        same_with_samples(&Workshop::new(), file, counts, &options);
    }
}

#[test]
fn normals_of_neighbours() {
    let smooth = ["--set", r#"surface.normals="pca""#];
    same_on_sample("emitter_sph/ParticleData_Fluid_10.bgeo", &[&smooth[..], ALL_CHANNELS].concat());
}
