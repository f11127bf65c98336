//! Native frames are traced where they lie: the pictures are those of decoded particles, damage costs the
//! frame, and memory does not grow with the particles.
//!
//! Most tests render each case in all ways in which particles come to be traced: mapped, read, decoded, by several
//! structures.

use std::fs;
use std::path::Path;

use glam::Vec3;

use crate::harness::{Ran, Workshop, dam_break, images, npy};

const SMALL: [&str; 6] = ["--width", "96", "--height", "54", "--samples", "2"];
/// Everything that can be in an image.
const ALL: [&str; 2] = ["--channels", "RGBA,Z,N,P,V,id,albedo"];

/// Renders `input` into `out`; the options are added.
fn render(shop: &Workshop, input: &str, out: &str, options: &[&str]) -> Ran {
    let pattern = format!("{out}/f.####.exr");
    shop.run(&[&["render", input, "-o", &pattern][..], &SMALL, options].concat())
}

/// The images of `native` traced in place, read instead of mapped, and decoded for another structure are
/// the same, to the byte.
#[track_caller]
fn same_as_decoded(shop: &Workshop, native: &str, options: &[&str]) {
    let needs_copy = |way: &str| way.ends_with("bvh") && way != "lbvh";
    same_in_all_ways(shop, native, options, needs_copy);
}

/// The images of `native` are the same, to the byte, however its particles come to be traced; `is_decoded` says in
/// which ways the user must be messages that they are decoded.
#[track_caller]
fn same_in_all_ways(
    shop: &Workshop,
    native: &str,
    options: &[&str],
    is_decoded: impl Fn(&str) -> bool,
) {
    let options = [&ALL[..], options].concat();
    let mut first = None;
    for (way, how) in [
        ("auto", &[][..]),
        ("lbvh", &["--accelerator", "lbvh"]),
        ("read", &["--no-mmap"]),
        ("bvh", &["--accelerator", "bvh"]),
        ("sbvh", &["--accelerator", "sbvh"]),
    ] {
        let out = format!("{native}-{way}");
        let ran = render(shop, native, &out, &[&options, how].concat()).expect(0);
        let is_reported = ran.errors().contains("decoded before they are traced");
        assert_eq!(is_reported, is_decoded(way), "{way}");
        let made = images(&shop.join(&out));
        assert!(!made.is_empty());
        let expected = first.get_or_insert_with(|| made.clone());
        assert!(*expected == made, "{native}: {way} differs");
    }
}

#[test]
fn pictures_are_those_of_decoded_particles() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=1);
    for encoding in ["f32", "q16", "q10"] {
        let options = ["--encoding", encoding, "--max-error", "0.05"];
        shop.run(&[&["convert", "in", "-o", encoding][..], &options].concat()).expect(0);
        same_as_decoded(&shop, encoding, &["--color-by", "velocity"]);
    }
}

#[test]
fn bodies_and_smooth_normals_are_those_of_decoded_particles() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=1);
    let options = ["--encoding", "q16", "--max-error", "0.05"];
    for (name, surface) in [
        (
            "water",
            // Light on the ground takes long, and does not depend on how particles are stored
            &["--look", "water", "--surface", "union", "--set", "render.caustics={photons=0}"][..],
        ),
        ("pca", &["--set", "surface.normals=\"pca\""]),
    ] {
        shop.run(&[&["convert", "in", "-o", name][..], &options].concat()).expect(0);
        same_as_decoded(&shop, name, surface);
    }
    // Whatever the structure, that sorts a copy.
    shop.run(&[&["convert", "in", "-o", "smooth"][..], &options].concat()).expect(0);
    let photons = ["--set", "render.caustics={photons=5000}"];
    let smooth = [&["--look", "water", "--color-by", "velocity"][..], &photons].concat();
    same_in_all_ways(&shop, "smooth", &smooth, |_| true);
}

/// Radii over a hundredfold, so that boxes hold spheres; ids that are not the places in the file.
#[test]
fn per_particle_radii_and_ids() {
    let shop = Workshop::new();
    let mut text = "x,y,z,radius,id\n".to_owned();
    for i in 0..3_000_u32 {
        let part = |salt: u32| f64::from((i * 7919 + salt).wrapping_mul(2_654_435_761) >> 8) / 2e7;
        let radius = if i % 100 == 0 { 0.1 } else { 1e-3 + part(4) * 0.01 };
        text += &format!("{},{},{},{radius},{}\n", part(1), part(2), part(3), 100_000 - i);
    }
    fs::create_dir_all(shop.join("in")).expect("a directory");
    fs::write(shop.join("in/p_1.csv"), text).expect("a file");
    for encoding in ["f32", "q16", "q10"] {
        let options = ["--encoding", encoding, "--max-error", "0.05"];
        shop.run(&[&["convert", "in", "-o", encoding][..], &options].concat()).expect(0);
        let glass = ["--set", "material.transmission=0.8"];
        same_as_decoded(&shop, encoding, &glass);
    }
}

/// Many particles in few places, each with an id of its own: which of them is seen goes by their order in the source,
/// so all pictures are those of the source.
#[test]
fn coincident_particles_have_the_ids_of_the_source() {
    let shop = Workshop::new();
    // Exact in f32, so that both have the same camera.
    let part = |i: u32, salt: u32| {
        f64::from(((i % 150) * 7919 + salt).wrapping_mul(2_654_435_761) >> 22) / 1024.0
    };
    let row = |i: u32| format!("{},{},{},{}\n", part(i, 1), part(i, 2), part(i, 3), 5_000 + i);
    let rows: String = (0..3_000).map(row).collect();
    fs::create_dir_all(shop.join("in")).expect("a directory");
    fs::write(shop.join("in/p_1.csv"), format!("x,y,z,id\n{rows}")).expect("a file");
    shop.run(&["convert", "in", "-o", "native"]).expect(0);
    let mut first = None;
    for input in ["in", "native"] {
        for structure in ["lbvh", "kdtree", "bvh", "sbvh"] {
            let out = format!("{input}-{structure}");
            // Whether so few places are those of a gas, which has no floor, depends on their order
            let how = ["--accelerator", structure, "--radius", "0.02", "--ground", "none"];
            render(&shop, input, &out, &[&ALL[..], &how].concat()).expect(0);
            let made: Vec<Vec<u8>> = images(&shop.join(&out)).into_values().collect();
            let expected = first.get_or_insert_with(|| made.clone());
            assert!(*expected == made, "{input}: {structure} differs");
        }
    }
}

#[test]
fn damage_costs_the_frame_and_is_named() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=3);
    shop.run(&["convert", "in", "-o", "native", "--encoding", "q10"]).expect(0);
    let file = |number: u32| shop.join(format!("native/frame.{number:04}.spf"));
    // A byte of the positions, which begin behind the header; then of the attribute at the end.
    flip(&file(2), 4096 + 100);
    render(&shop, "native", "out", &[])
        .expect(1)
        .prints("frame.0002.spf")
        .prints("the positions are damaged")
        .prints("convert again");
    assert_eq!(images(&shop.join("out")).len(), 2 * 2);
    // Cut off.
    let bytes = fs::read(file(3)).expect("readable");
    fs::write(file(3), &bytes[..bytes.len() / 2]).expect("writable");
    render(&shop, "native", "cut", &[]).expect(1).prints("frame.0003.spf");
    assert_eq!(images(&shop.join("cut")).len(), 2);
}

fn flip(path: &Path, at: usize) {
    let mut bytes = fs::read(path).expect("readable");
    bytes[at] ^= 0x10;
    fs::write(path, bytes).expect("writable");
}

#[test]
fn far_from_zero() {
    let shop = Workshop::new();
    for frame in 1..=2 {
        let path = shop.join(format!("in/f_{frame}.npy"));
        npy(&path, 500, frame, Vec3::splat(1e6));
    }
    shop.run(&["convert", "in", "-o", "native", "--radius", "1"]).expect(0);
    let ran = render(&shop, "native", "out", &[]).expect(0);
    assert!(!ran.errors().contains("decoded"), "{}", ran.errors());
    // Converted apart, each has an origin of its own.
    npy(&shop.join("in/f_2.npy"), 500, 2, Vec3::splat(-3e6));
    for frame in ["1", "2"] {
        let file = format!("in/f_{frame}.npy");
        shop.run(&["convert", &file, "-o", frame, "--radius", "1"]).expect(0);
    }
    for frame in ["1", "2"] {
        let mut found = fs::read_dir(shop.join(frame))
            .expect("readable")
            .map(|entry| entry.expect("readable").path());
        let native = found.find(|p| p.extension().is_some_and(|e| e == "spf"));
        let to = shop.join(format!("apart/frame.{frame}.spf"));
        fs::create_dir_all(shop.join("apart")).expect("a directory");
        fs::copy(native.expect("a frame"), &to).expect("copied");
    }
    render(&shop, "apart", "apart-out", &[]).expect(0).prints("another origin");
}

/// Memory for the program and the image, not for two million particles: as plain numbers they and a tree
/// over them would take three times as much as is allowed.
#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_the_particles() {
    const PARTICLES: usize = 2_000_000;
    /// Kibibytes of data and stacks, of which threads reserve 2 MiB each.
    const ALLOWED: usize = 26 << 10;
    let shop = Workshop::new();
    npy(&shop.join("in/f_1.npy"), PARTICLES, 1, Vec3::ZERO);
    let options = ["--encoding", "q10", "--radius", "0.012"];
    shop.run(&[&["convert", "in", "-o", "native"][..], &options].concat()).expect(0);
    let limited = |out: &str, how: &str| {
        let program = env!("CARGO_BIN_EXE_spherule");
        let arguments = "--width 160 --height 90 --samples 1 --threads 2 --look whitted";
        let command = format!(
            "ulimit -d {ALLOWED} && exec {program} render native -o {out}/f.#.exr {arguments} {how}"
        );
        let mut shell = std::process::Command::new("sh");
        shell.current_dir(shop.path()).args(["-c", &command]);
        shell.output().expect("a shell")
    };
    let in_place = limited("in-place", "");
    assert!(in_place.status.success(), "{in_place:?}");
    // The same limit is too little where particles are copied.
    let decoded = limited("decoded", "--accelerator=bvh");
    assert!(!decoded.status.success(), "{decoded:?}");
}
