//! Files with two parts: colours and data with compressions of their own.
//!
//! Tests render three frames with twelve channels several times.

use std::fs;

use exr::meta::MetaData;
use exr::prelude::AttributeValue;

use crate::harness::{Workshop, dam_break, images};
use crate::picture::Picture;

const SIZE: [&str; 6] = ["--width", "97", "--height", "50", "--samples", "2"];
const CHANNELS: [&str; 2] = [
    "--channels",
    "RGBA,Z,N,P,V,id,albedo,noisy,light_groups,shadow,crypto_particle,attribute:velocity",
];
/// A part of the image, with overscan.
const CROP: [&str; 3] = ["--crop=-5,10,90,52", "--set", "image.overscan=8"];
const PARTS: [&str; 4] =
    ["--set", "output.compression=piz", "--set", "output.data_compression=zip"];

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 5..=7);
    workshop
}

fn render(workshop: &Workshop, out: &str, options: &[&str]) {
    let pattern = format!("{out}/f.####.exr");
    let render = ["render", "in", "-o", &pattern];
    let options = [&render[..], &SIZE, &CHANNELS, &CROP, options].concat();
    workshop.run(&options).expect(0);
}

#[test]
fn two_parts_have_the_pixels_of_one() {
    let workshop = workshop();
    render(&workshop, "single", &["--threads", "1"]);
    render(&workshop, "parts", &[&PARTS[..], &["--threads", "1"]].concat());
    render(&workshop, "again", &[&PARTS[..], &["--threads", "4"]].concat());
    let [parts, again] = ["parts", "again"].map(|out| images(&workshop.join(out)));
    assert_eq!(parts.len(), 6);
    assert!(parts == again);
    for frame in 5..=7 {
        let [single, parts] = ["single", "parts"]
            .map(|out| Picture::open(&workshop.join(format!("{out}/f.{frame:04}.exr"))));
        assert_eq!(single, parts);
        assert!(parts.facts.is_some());
    }
    workshop.run(&["verify", "parts"]).expect(0);
}

#[test]
fn each_part_has_its_compression_and_attributes() {
    let workshop = workshop();
    render(&workshop, "parts", &PARTS);
    let path = workshop.join("parts/f.0006.exr");
    let meta = MetaData::read_from_file(path, true).expect("an EXR");
    assert!(meta.requirements.has_multiple_layers);
    let mut names = Vec::new();
    for header in &meta.headers {
        let own = &header.own_attributes;
        names.push(own.layer_name.as_ref().expect("a name").to_string());
        assert!(own.world_to_camera.is_some());
        let is_matte = |name: &str| name.starts_with("cryptomatte/");
        let mattes = own.other.iter().filter(|(name, value)| {
            is_matte(&name.to_string()) && matches!(value, AttributeValue::Text(_))
        });
        let channels: Vec<String> =
            header.channels.list.iter().map(|c| c.name.to_string()).collect();
        let has = |name: &str| channels.iter().any(|channel| channel == name);
        if names.len() == 1 {
            assert_eq!(header.compression, exr::compression::Compression::PIZ);
            assert_eq!(mattes.count(), 0);
            assert!(has("R") && has("noisy.G") && has("light_default.B") && !has("Z"));
        } else {
            assert_eq!(header.compression, exr::compression::Compression::ZIP16);
            assert_eq!(mattes.count(), 4);
            assert!(has("Z") && has("id.I") && has("crypto_particle00.R") && !has("R"));
        }
    }
    assert_eq!(names, ["color", "data"]);
}

#[test]
fn jobs_with_two_parts_resume() {
    let workshop = workshop();
    render(&workshop, "whole", &PARTS);
    render(&workshop, "parts", &[&PARTS[..], &["--frames", "5-6"]].concat());
    render(&workshop, "parts", &[&PARTS[..], &["--force"]].concat());
    fs::remove_file(workshop.join("parts/f.0006.exr")).expect("removed");
    render(&workshop, "parts", &PARTS);
    let [whole, parts] = ["whole", "parts"].map(|out| images(&workshop.join(out)));
    assert!(whole == parts);
    // Another compression is another job
    let pattern = ["render", "in", "-o", "parts/f.####.exr"];
    let other = ["--set", "output.compression=piz", "--set", "output.data_compression=rle"];
    let ran = workshop.run(&[&pattern[..], &SIZE, &CHANNELS, &CROP, &other].concat()).expect(2);
    assert!(ran.errors().contains("output.data_compression"), "{}", ran.errors());
}
