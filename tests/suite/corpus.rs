//! The committed corpus of the fuzz targets, replayed with what the targets check.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use spherule::output::{Compression, ExrOptions, PreviewOptions, encode_exr, encode_preview};
use spherule::render::{Channels, Film};
use spherule_formats::native::{Bound, Encoding, StoreSettings, store};
use spherule_formats::{ParticleFrame, Radius};

#[path = "../../fuzz/src/program/mod.rs"]
#[expect(unreachable_pub, reason = "part of a library of its own for the fuzz targets")]
mod targets;

use crate::simd::tested_levels;
use targets::{TARGETS, Target};

fn fuzz(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz").join(name)
}

/// Files below `dir`, in order of their names.
fn inputs(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).expect("every target has a corpus");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    paths.sort();
    paths
}

/// Runs all inputs of a target; whether one of them was accepted.
fn replay(name: &str, target: Target) -> bool {
    let accepts = |path: &PathBuf| target(&fs::read(path).expect("readable")) > 0;
    inputs(&fuzz("corpus").join(name)).iter().filter(|path| accepts(path)).count() > 0
}

#[test]
fn every_target_replays_its_corpus() {
    // The target `trace` uses every level.
    tested_levels();
    for (name, target) in TARGETS {
        // Else the target would check nothing but errors.
        assert!(replay(name, target), "nothing is accepted for {name}");
    }
}

/// Those of the readers are replayed by `formats/tests/corpus`.
#[test]
fn every_folder_has_its_target() {
    let readers = fs::read_to_string(fuzz("src/readers/mod.rs")).expect("readable");
    let is_reader = |name: &str| readers.contains(&format!("(\"{name}\", "));
    let found = inputs(&fuzz("corpus"));
    let found = found.iter().filter_map(|path| path.file_name()?.to_str());
    let found: BTreeSet<&str> = found.filter(|name| !is_reader(name)).collect();
    assert_eq!(found, TARGETS.iter().map(|(name, _)| *name).collect());
}

/// After a change of images or of native frames: `cargo test --test suite corpus -- --ignored`.
#[test]
#[ignore = "writes into the corpus"]
fn write_images_and_frames() {
    for (name, choice, bytes) in images() {
        let folder = if name.ends_with("png") { "png" } else { "exr" };
        write(folder, &name, choice, &bytes);
    }
    for path in inputs(&fuzz("corpus/native")) {
        let name = path.file_name().and_then(|name| name.to_str()).expect("a name");
        // Frames without radii need one.
        write("trace", name, 1, &fs::read(&path).expect("readable"));
        write("trace", &format!("{name}_own"), 0x80, &fs::read(&path).expect("readable"));
    }
    for (name, encoding) in [("deep_q10", Encoding::Q10), ("deep_f32", Encoding::F32)] {
        write("trace", name, 1, &frame(encoding));
    }
}

fn write(folder: &str, name: &str, choice: u8, bytes: &[u8]) {
    let dir = fuzz("corpus").join(folder);
    fs::create_dir_all(&dir).expect("writable");
    fs::write(dir.join(name), [&[choice], bytes].concat()).expect("writable");
}

/// Images of the shapes that the targets know, with their number.
fn images() -> Vec<(String, u8, Vec<u8>)> {
    let mut images = Vec::new();
    let color = film(5, 3, Channels::COLOR);
    for compression in
        [Compression::None, Compression::Rle, Compression::Zip, Compression::Zips, Compression::Piz]
    {
        let name = format!("{compression:?}").to_lowercase();
        images.push((name, 0, exr(&color, compression)));
    }
    images.push(("all_channels".into(), 1, exr(&film(5, 3, Channels::ALL), Compression::Zip)));
    images.push(("blocks".into(), 2, exr(&film(40, 37, Channels::COLOR), Compression::Zip)));
    for (name, choice, film) in
        [("small_png", 0, color), ("large_png", 2, film(40, 37, Channels::COLOR))]
    {
        let bytes = encode_preview(&film, &PreviewOptions::default(), &[]).expect("an image");
        images.push((name.into(), choice, bytes));
    }
    images
}

fn film(width: u32, height: u32, channels: Channels) -> Film {
    let mut film = Film::new(width, height, channels);
    for (at, color) in film.color.iter_mut().enumerate() {
        *color = [(at % 7) as f32 / 7.0, 0.5, 0.25, 1.0];
    }
    film
}

fn exr(film: &Film, compression: Compression) -> Vec<u8> {
    let options = ExrOptions { compression, ..ExrOptions::default() };
    encode_exr(film, &options).expect("an image").bytes
}

/// A frame with three levels of nodes.
fn frame(encoding: Encoding) -> Vec<u8> {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let count = if encoding == Encoding::F32 { 300 } else { 1100 };
    let place = |i: u16| Vec3::new(f32::from(i % 11), f32::from(i / 11 % 10), f32::from(i / 110));
    let frame = ParticleFrame {
        positions: (0..count).map(place).collect(),
        origin: DVec3::ZERO,
        radius: Some(Radius::Common(0.4)),
        attributes: Vec::new(),
        time: None,
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 0,
        file_index: None,
    };
    let settings = StoreSettings { encoding: Some(encoding), bound: Bound::None, rounding: 0.0 };
    store(&path, &frame, None, &settings).expect("writable");
    fs::read(path).expect("readable")
}
