//! Cryptomatte layers, decoded by the steps of the specification: attributes by prefix, layers of four channels,
//! objects as bits of floats, names from the manifest.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::AttributeValue;
use serde_json::Value;

use crate::harness::{Workshop, dam_break, images};
use crate::picture::Picture;

/// A layer as a compositor sees it.
struct Layer {
    /// Objects with their coverage, for each pixel.
    pixels: Vec<Vec<(u32, f32)>>,
    /// Objects by name; None without a manifest.
    manifest: Option<BTreeMap<String, u32>>,
}

/// The text attributes of an image.
fn attributes(path: &Path) -> BTreeMap<String, String> {
    let meta = MetaData::read_from_file(path, true).expect("an EXR");
    let other = meta.headers[0].own_attributes.other.iter();
    let texts = other.filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
        _ => None,
    });
    texts.collect()
}

/// All Cryptomatte layers of an image by name.
fn layers(path: &Path) -> BTreeMap<String, Layer> {
    let attributes = attributes(path);
    let picture = Picture::open(path);
    let mut layers = BTreeMap::new();
    for (key, name) in &attributes {
        let Some(key) = key.strip_suffix("/name") else {
            continue;
        };
        let prefix = key.strip_prefix("cryptomatte/").expect("a layer");
        assert_eq!(prefix.len(), 7);
        assert!(prefix.bytes().all(|b| b.is_ascii_hexdigit()));
        assert_eq!(attributes[&format!("{key}/hash")], "MurmurHash3_32");
        assert_eq!(attributes[&format!("{key}/conversion")], "uint32_to_float32");
        let manifest = attributes.get(&format!("{key}/manifest")).map(|json| {
            let names: BTreeMap<String, String> = serde_json::from_str(json).expect("JSON");
            let bits = |hex: &String| u32::from_str_radix(hex, 16).expect("hexadecimal digits");
            names.iter().map(|(name, hex)| (name.clone(), bits(hex))).collect()
        });
        // Combine channel pairs to ranks
        let mut pixels = vec![Vec::new(); picture.width * picture.height];
        for number in 0.. {
            let channel = |axis: &str| format!("{name}{number:02}.{axis}");
            if !picture.planes.contains_key(&channel("R")) {
                break;
            }
            for [object, coverage] in [["R", "G"], ["B", "A"]] {
                let objects = picture.floats(&channel(object));
                let coverages = picture.floats(&channel(coverage));
                for (pixel, (object, coverage)) in
                    pixels.iter_mut().zip(objects.iter().zip(coverages))
                {
                    pixel.push((object.to_bits(), *coverage));
                }
            }
        }
        layers.insert(name.clone(), Layer { pixels, manifest });
    }
    layers
}

/// Renders the frames in `in`.
fn render(workshop: &Workshop, out: &str, options: &[&str]) {
    let pattern = format!("{out}/f.####.exr");
    let arguments = ["render", "in", "-o", &pattern];
    workshop.run(&[&arguments, options].concat()).expect(0);
}

/// Renders frame 6 of the dam break.
fn rendered(workshop: &Workshop, out: &str, options: &[&str]) {
    dam_break(&workshop.join("in"), 6..=6);
    let size = ["--width", "64", "--height", "36", "--samples", "16"];
    render(workshop, out, &[&size, options].concat());
}

#[track_caller]
fn check_layers(path: &Path) {
    let layers = layers(path);
    let names: Vec<&str> = layers.keys().map(String::as_str).collect();
    assert_eq!(names, ["crypto_material", "crypto_part", "crypto_particle"]);
    let alpha = Picture::open(path);
    let alpha = alpha.floats("A");
    let (mut covered, mut several) = (0, 0);
    for (name, layer) in &layers {
        let manifest = layer.manifest.as_ref().expect("a manifest");
        let known: Vec<u32> = manifest.values().copied().collect();
        for (pixel, alpha) in layer.pixels.iter().zip(alpha) {
            assert_eq!(pixel.len(), 6);
            // Ranks are sorted, and objects are there once
            for pair in pixel.windows(2) {
                assert!(pair[0].1 >= pair[1].1, "{name}: {pixel:?}");
                assert!(pair[1].1 == 0.0 || pair[0].0 != pair[1].0, "{name}: {pixel:?}");
            }
            let used: Vec<_> = pixel.iter().filter(|(_, coverage)| *coverage > 0.0).collect();
            for (object, _) in &used {
                assert!(known.contains(object), "{name}: {object:08x}");
                assert!(f32::from_bits(*object).is_normal());
            }
            // All levels are in use only if there may be more objects
            let sum: f32 = used.iter().map(|(_, coverage)| coverage).sum();
            if used.len() < 6 {
                assert!((sum - alpha).abs() < 1e-3, "{name}: {sum} of {alpha}");
            } else {
                assert!(sum < alpha + 1e-3, "{name}: {sum} of {alpha}");
            }
            covered += usize::from(!used.is_empty());
            several += usize::from(used.len() > 1);
        }
    }
    assert!(covered > 300 && several > 100, "{covered}, {several}");
}

// Four images with 16 samples a pixel: several particles have to share pixels.
#[test]
fn coverage_adds_up_to_alpha_and_names_are_in_the_manifest() {
    let workshop = Workshop::new();
    for (out, options) in [
        ("plain", &[][..]),
        ("ground", &["--ground", "--set", "output.transparent=true"]),
        // Light on the ground is in no layer
        ("water", &["--look", "water", "--set", "render.caustics={photons=0}"]),
        ("path", &["--look", "studio"]),
    ] {
        let channels = ["--channels", "RGBA,cryptomatte"];
        rendered(&workshop, out, &[&channels, options].concat());
        check_layers(&workshop.join(out).join("f.0006.exr"));
    }
}

#[test]
fn layers_are_chosen_with_their_levels() {
    let workshop = Workshop::new();
    let options = ["--channels", "crypto_particle", "--set", "output.cryptomatte_levels=3"];
    rendered(&workshop, "out", &options);
    let layers = layers(&workshop.join("out/f.0006.exr"));
    assert_eq!(layers.keys().collect::<Vec<_>>(), ["crypto_particle"]);
    assert!(layers["crypto_particle"].pixels.iter().all(|pixel| pixel.len() == 4));
    workshop.run(&["verify", "out"]).expect(0);
}

#[test]
fn particles_have_the_names_of_their_ids_and_parts_those_of_their_attribute() {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    let csv = "x,y,z,id,type,radius\n0,0,0,70,2,0.5\n3,0,0,4000000000,5,0.5\n";
    fs::write(workshop.join("in/f.0001.csv"), csv).expect("a file");
    let channels = ["--channels", "cryptomatte,id"];
    let size = ["--width", "64", "--height", "36"];
    render(&workshop, "out", &[&channels[..], &size].concat());
    let path = workshop.join("out/f.0001.exr");
    let layers = layers(&path);
    let names =
        |layer: &str| layers[layer].manifest.as_ref().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(names("crypto_particle"), ["p4000000000", "p70"]);
    assert_eq!(names("crypto_part"), ["type2", "type5"]);
    assert_eq!(names("crypto_material"), ["particles", "spray"]);
    // Where one particle covers the pixel, its id and its object agree
    let picture = Picture::open(&path);
    let ids = picture.integers("id.I");
    let manifest = layers["crypto_particle"].manifest.as_ref().unwrap();
    let parts = layers["crypto_part"].manifest.as_ref().unwrap();
    let mut checked = 0;
    for (pixel, id) in ids.iter().enumerate() {
        let (object, coverage) = layers["crypto_particle"].pixels[pixel][0];
        if coverage == 1.0 {
            assert_eq!(object, manifest[&format!("p{id}")]);
            let part = if *id == 70 { "type2" } else { "type5" };
            assert_eq!(layers["crypto_part"].pixels[pixel][0], (parts[part], 1.0));
            checked += 1;
        }
    }
    assert!(checked > 50, "{checked}");
}

#[test]
fn large_manifests_are_left_out() {
    let workshop = Workshop::new();
    crate::harness::npy(&workshop.join("in/f.0001.npy"), 100_001, 3, glam::Vec3::ZERO);
    let channels = ["--channels", "cryptomatte"];
    let size = ["--width", "16", "--height", "9", "--samples", "4"];
    render(&workshop, "out", &[&channels[..], &size].concat());
    let layers = layers(&workshop.join("out/f.0001.exr"));
    assert!(layers["crypto_particle"].manifest.is_none());
    assert!(layers["crypto_material"].manifest.is_some());
}

// Four images with 16 samples a pixel and many layers, one by each structure.
#[test]
fn layers_do_not_depend_on_threads_or_structures() {
    let workshop = Workshop::new();
    let channels = ["--channels", "RGBA,cryptomatte,lights,noisy,shadow"];
    let mut first = None;
    for (out, threads, structure) in
        [("a", "1", "lbvh"), ("b", "3", "kdtree"), ("c", "2", "bvh"), ("d", "2", "sbvh")]
    {
        let options = ["--threads", threads, "--accelerator", structure, "--look", "studio"];
        rendered(&workshop, out, &[&channels, &options[..]].concat());
        let found = images(&workshop.join(out));
        assert!(*first.get_or_insert_with(|| found.clone()) == found, "{structure}");
    }
}

#[test]
fn manifests_are_plain_json() {
    let workshop = Workshop::new();
    rendered(&workshop, "out", &["--channels", "crypto_material", "--ground"]);
    let attributes = attributes(&workshop.join("out/f.0006.exr"));
    let manifest = attributes.iter().find(|(name, _)| name.ends_with("/manifest"));
    let manifest: Value = serde_json::from_str(manifest.expect("a manifest").1).expect("JSON");
    // Computed with the package mmh3 of Python, and the conversion of the specification
    assert_eq!(manifest["particles"], "0e1773d0");
}
