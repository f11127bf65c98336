//! Orthographic pictures, panoramas and stereo pairs of the program: the same bytes however they are made, and what the
//! files say about themselves.
//!
//! Tests render each of three projections in several ways.

use std::fs;

use exr::meta::MetaData;
use exr::meta::attribute::EnvironmentMap;

use crate::harness::{SMALL, Workshop, dam_break, images, natives};
use crate::picture::{Picture, Plane};

/// Options of each projection; pictures are 64x36 for each eye.
const KINDS: [(&str, &[&str]); 3] = [
    ("ortho", &["--projection", "orthographic", "--view", "iso"]),
    ("around", &["--projection", "equirectangular"]),
    ("pair", &["--set", "camera.stereo=true"]),
];

/// Everything that asks the camera.
const CHANNELS: [&str; 2] = ["--channels", "RGBA,Z,N,P,id"];

fn shop() -> Workshop {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=1);
    shop
}

fn render(shop: &Workshop, input: &str, out: &str, options: &[&str]) {
    let pattern = format!("{out}/f.####.exr");
    let arguments = ["render", input, "-o", &pattern];
    let all = [&arguments[..], &SMALL, &CHANNELS, options].concat();
    shop.run(&all).expect(0);
}

#[test]
fn same_bytes_from_all_structures_and_threads() {
    let shop = shop();
    for (name, options) in KINDS {
        let ways: [&[&str]; 3] = [
            &["--accelerator", "lbvh", "--threads", "1"],
            &["--accelerator", "bvh", "--threads", "3"],
            &["--accelerator", "sbvh", "--threads", "2"],
        ];
        let mut first = None;
        for (way, how) in ways.into_iter().enumerate() {
            let out = format!("{name}-{way}");
            render(&shop, "in", &out, &[options, how].concat());
            let made = images(&shop.join(&out));
            let expected = first.get_or_insert_with(|| made.clone());
            assert!(!made.is_empty() && *expected == made, "{out}");
        }
        // The size is the one that the plan says
        shop.run(&["verify", &format!("{name}-0")]).expect(0);
    }
}

#[test]
fn native_frames_in_place_give_the_same_pictures() {
    let shop = shop();
    shop.run(&["convert", "in", "-o", "native", "--encoding", "f32"]).expect(0);
    assert!(!natives(&shop.join("native")).is_empty());
    for (name, options) in KINDS {
        render(&shop, "native", name, options);
        let decoded = format!("{name}-decoded");
        render(&shop, "native", &decoded, &[options, &["--accelerator", "bvh"]].concat());
        assert!(images(&shop.join(name)) == images(&shop.join(&decoded)), "{name}");
    }
}

#[test]
fn stereo_pairs_have_two_images_and_two_overlays() {
    let shop = shop();
    let text = r#"overlay=[{ type = "text", text = "A", corner = "top-left", size = 0.2 }]"#;
    render(&shop, "in", "pair", &["--set", "camera.stereo=true", "--set", text]);
    let image = Picture::open(&shop.join("pair/f.0001.exr"));
    assert_eq!((image.width, image.height), (128, 36));
    let preview = image::open(shop.join("pair/f.0001.png")).expect("a preview").into_rgb8();
    assert_eq!((preview.width(), preview.height()), (128, 36));
    let dark = |from: u32| {
        let columns = (from..from + 12).flat_map(|x| (0..12).map(move |y| (x, y)));
        columns.filter(|(x, y)| preview.get_pixel(*x, *y)[1] < 60).count()
    };
    assert!(dark(0) > 4 && dark(0).abs_diff(dark(64)) < 3, "{} {}", dark(0), dark(64));
    // Near particles are farther to the right in the image of the left eye, far ones farther to the left
    let Some(Plane::Uint(ids)) = image.planes.get("id.I") else {
        panic!("ids are integers");
    };
    let halves: [Vec<u32>; 2] = [0, 64].map(|from| {
        let rows = ids.chunks(128);
        rows.flat_map(|row| row[from..from + 64].to_vec()).collect()
    });
    assert_ne!(halves[0], halves[1]);
}

#[test]
fn panoramas_say_that_they_are_some() {
    let shop = shop();
    render(&shop, "in", "around", KINDS[1].1);
    let meta = MetaData::read_from_file(shop.join("around/f.0001.exr"), false).expect("an EXR");
    let attributes = &meta.headers[0].own_attributes;
    assert_eq!(attributes.environment_map, Some(EnvironmentMap::LatitudeLongitude));
}

#[test]
fn print_sizes_are_in_the_files() {
    let shop = shop();
    let pattern = ["render", "in", "-o", "paper/f.####.exr", "--samples", "1"];
    let size = ["--width", "20mm", "--height", "0.5in", "--dpi", "100"];
    shop.run(&[&pattern[..], &size].concat()).expect(0);
    let image = Picture::open(&shop.join("paper/f.0001.exr"));
    assert_eq!((image.width, image.height), (79, 50));
    let meta = MetaData::read_from_file(shop.join("paper/f.0001.exr"), false).expect("an EXR");
    assert_eq!(meta.headers[0].own_attributes.horizontal_density, Some(100.0));
    let file = fs::File::open(shop.join("paper/f.0001.png")).expect("a preview");
    let reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let density = reader.info().pixel_dims.expect("a density");
    assert_eq!((density.xppu, density.yppu), (3937, 3937));
    assert_eq!(density.unit, png::Unit::Meter);
    shop.run(&["verify", "paper"]).expect(0);
}
