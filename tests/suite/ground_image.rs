//! Pictures on the ground: their place as seen from above, what is refused, and what a job does when they change.

use std::fs;
use std::path::Path;

use exr::prelude::write_rgb_file;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::harness::{Ran, Workshop, images};
use crate::picture::Picture;

/// Looks down at the ground from a height of 10.5, +x to the right and +y up; particles are far away from the view.
const VIEW: [&str; 20] = [
    "--width",
    "64",
    "--height",
    "36",
    "--radius",
    "0.5",
    "--set",
    "input.up=z",
    "--set",
    "camera.mode=fixed",
    "--set",
    "camera.eye=[0, 0, 10]",
    "--set",
    "camera.look_at=[0, 0, 0]",
    "--set",
    "camera.up=[0, 1, 0]",
    "--set",
    "camera.fov=40",
    "--set",
    "render.denoise=false",
];

/// Light that shows a matte surface in its base colour.
const WHITE: [&str; 6] =
    ["--set", "environment.type=constant", "--set", "render.bounces=0", "--samples", "16"];

fn particles(frames: u32) -> Workshop {
    let workshop = Workshop::new();
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    for frame in 1..=frames {
        let csv = "x,y,z\n-20,-20,0\n20,-20,0\n-20,20,0\n20,20,0\n";
        fs::write(workshop.join(format!("in/f_{frame}.csv")), csv).expect("a file");
    }
    workshop
}

/// Red and green above blue and white, in 4 by 4 pixels.
const COLORS: [[u8; 3]; 4] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];

fn quadrant(pixel: usize) -> [u8; 3] {
    let (x, y) = (pixel % 4, pixel / 4);
    COLORS[x / 2 + 2 * (y / 2)]
}

fn png(path: &Path, bytes: &[u8], kind: ExtendedColorType) {
    let file = fs::File::create(path).expect("a file");
    let encoder = PngEncoder::new(file);
    encoder.write_image(bytes, 4, 4, kind).expect("a PNG image");
}

/// The picture as a PNG of 8 bits.
fn png8(path: &Path) {
    let bytes: Vec<u8> = (0..16).flat_map(quadrant).collect();
    png(path, &bytes, ExtendedColorType::Rgb8);
}

/// The same with 16 bits and alpha, opaque.
fn png16(path: &Path) {
    let codes = (0..16).flat_map(|i| {
        let [r, g, b] = quadrant(i).map(|c| u16::from(c) * 257);
        [r, g, b, u16::MAX]
    });
    let bytes: Vec<u8> = codes.flat_map(u16::to_ne_bytes).collect();
    png(path, &bytes, ExtendedColorType::Rgba16);
}

fn exr(path: &Path, change: impl Fn(usize) -> Option<f32> + Sync) {
    let pixel = |x: usize, y: usize| {
        let place = 4 * y + x;
        let [r, g, b] = quadrant(place).map(|c| f32::from(c) / 255.0);
        (change(place).unwrap_or(r), g, b)
    };
    write_rgb_file(path, 4, 4, pixel).expect("an EXR image");
}

fn hdr(path: &Path) {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 4\n".to_vec();
    for pixel in 0..16 {
        // Mantissas of 256ths, exponent 1: 1 is 128
        bytes.extend(quadrant(pixel).map(|c| c / 255 * 128));
        bytes.push(128 + 1);
    }
    fs::write(path, bytes).expect("a file");
}

fn render(workshop: &Workshop, out: &str, ground: &str, options: &[&str]) -> Ran {
    let pattern = format!("{out}/f.####.exr");
    let ground = format!("render.ground={ground}");
    let command = ["render", "in", "-o", &pattern, "--set", &ground];
    workshop.run(&[&command[..], &VIEW, &WHITE, options].concat())
}

/// The colours at x and y of about 2 on both sides of the middle: top left, top right, bottom left, bottom right.
fn quarters(path: &Path) -> [[f32; 3]; 4] {
    let picture = Picture::open(path);
    let at = |x: usize, y: usize| {
        ["R", "G", "B"].map(|channel| picture.floats(channel)[y * picture.width + x])
    };
    [at(22, 9), at(41, 9), at(22, 26), at(41, 26)]
}

#[track_caller]
fn check(path: &Path, order: [usize; 4]) {
    for (found, index) in quarters(path).iter().zip(order) {
        for (found, wanted) in found.iter().zip(COLORS[index]) {
            let wanted = f32::from(wanted) / 255.0;
            assert!((found - wanted).abs() < 0.1, "{found} {wanted}");
        }
    }
}

// Starts the program seven times: for each format and each place of the picture.
#[test]
fn pictures_of_all_formats_lie_as_seen_from_above() {
    let workshop = particles(1);
    png8(&workshop.join("a.png"));
    png16(&workshop.join("b.png"));
    exr(&workshop.join("c.exr"), |_| None);
    hdr(&workshop.join("d.hdr"));
    for name in ["a.png", "b.png", "c.exr", "d.hdr"] {
        let ground = format!(
            "{{ type = \"image\", image = \"{name}\", width = 8.0, center = [0, 0, 0], repeat = false }}"
        );
        let out = format!("out-{name}");
        render(&workshop, &out, &ground, &[]).expect(0);
        check(&workshop.join(out).join("f.0001.exr"), [0, 1, 2, 3]);
    }
    // Turned by a right angle, counterclockwise
    let ground =
        "{ type = \"image\", image = \"a.png\", width = 8.0, center = [0, 0, 0], rotation = 90 }";
    render(&workshop, "turned", ground, &[]).expect(0);
    check(&workshop.join("turned/f.0001.exr"), [1, 3, 0, 2]);
    // Moved by half its width to the right: the left half is the plain colour, or another tile
    let moved = "type = \"image\", image = \"a.png\", width = 8.0, center = [4, 0, 0]";
    render(&workshop, "tiles", &format!("{{ {moved} }}"), &[]).expect(0);
    check(&workshop.join("tiles/f.0001.exr"), [1, 0, 3, 2]);
    let plain = ["--set", "render.ground_color=[0, 0, 1]"];
    let once = format!("{{ {moved}, repeat = false }}");
    render(&workshop, "once", &once, &plain).expect(0);
    check(&workshop.join("once/f.0001.exr"), [2, 0, 2, 2]);
}

#[test]
fn both_integrators_and_all_threads_have_the_picture() {
    let workshop = particles(1);
    png8(&workshop.join("a.png"));
    let ground = "{ type = \"image\", image = \"a.png\", width = 0.7 }";
    let slanted = ["--set", "camera.eye=[0, -9, 1]"];
    for integrator in ["path", "whitted"] {
        let mut first = None;
        for threads in ["1", "3"] {
            let out = format!("{integrator}-{threads}");
            let options = ["--integrator", integrator, "--threads", threads];
            render(&workshop, &out, ground, &[&options[..], &slanted].concat()).expect(0);
            let made: Vec<_> = images(&workshop.join(&out)).into_values().collect();
            assert!(*first.get_or_insert_with(|| made.clone()) == made);
        }
    }
    // From above, the Whitted integrator has the same places
    let ground = "{ type = \"image\", image = \"a.png\", width = 8.0, center = [0, 0, 0] }";
    render(&workshop, "above", ground, &["--integrator", "whitted"]).expect(0);
    let [red, green, blue, white] = quarters(&workshop.join("above/f.0001.exr"));
    assert!(red[0] > 10.0 * red[1] && green[1] > 10.0 * green[2] && blue[2] > 10.0 * blue[0]);
    assert!(white[0] > 0.1 && (white[0] - white[1]).abs() < 0.1 * white[0]);
}

#[test]
fn water_stands_on_the_picture() {
    let workshop = particles(1);
    let bytes: Vec<u8> = (0..16).flat_map(|_| [255, 0, 0]).collect();
    png(&workshop.join("red.png"), &bytes, ExtendedColorType::Rgb8);
    let ground = "render.ground={ type = \"image\", image = \"red.png\" }";
    let command = ["render", "in", "-o", "out/f.####.exr", "--set", ground];
    let water = ["--look", "water", "--surface", "spheres", "--samples", "4"];
    let water = [&water[..], &["--set", "render.caustics.photons=10000"]].concat();
    workshop.run(&[&command[..], &VIEW, &water].concat()).expect(0);
    for color in quarters(&workshop.join("out/f.0001.exr")) {
        assert!(color[0] > 0.1 && color[1] < 0.01 * color[0], "{color:?}");
    }
}

#[test]
fn files_that_are_no_pictures_are_refused() {
    let workshop = particles(1);
    let at = |name: &str| workshop.join(name);
    png8(&at("whole.png"));
    let whole = fs::read(at("whole.png")).expect("a file");
    fs::write(at("cut.png"), &whole[..whole.len() - 20]).expect("a file");
    fs::write(at("text.png"), "no image").expect("a file");
    exr(&at("nan.exr"), |i| (i == 6).then_some(f32::NAN));
    exr(&at("negative.exr"), |i| (i == 9).then_some(-0.5));
    // A header alone: huge
    let mut huge = whole.clone();
    huge[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    fs::write(at("huge.png"), crc_fixed(huge)).expect("a file");
    fs::create_dir_all(at("folder.png")).expect("a directory");
    for (name, message) in [
        ("none.png", "none.png: "),
        ("folder.png", "folder.png: "),
        ("cut.png", "cut.png: "),
        ("text.png", "text.png: is neither"),
        ("nan.exr", "column 2 and row 1 is NaN or infinite"),
        ("negative.exr", "column 1 and row 2 is negative"),
        ("huge.png", "65536x65536 pixels; it needs at least 1x1 and at most"),
    ] {
        let ground = format!("{{ type = \"image\", image = \"{name}\" }}");
        let ran = render(&workshop, "out", &ground, &[]).expect(2);
        let errors = ran.errors();
        assert!(errors.contains("render.ground.image: "), "{errors}");
        assert!(errors.contains(message), "{name}: {errors}");
    }
    let ran = render(&workshop, "out", "\"image\"", &[]).expect(2);
    assert!(ran.errors().contains("needs a file"), "{}", ran.errors());
}

/// A PNG file with the checksum of its changed header.
fn crc_fixed(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut crc = u32::MAX;
    for byte in &bytes[12..29] {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
        }
    }
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    bytes
}

#[test]
fn a_changed_picture_stops_a_job_and_a_moved_one_does_not() {
    let workshop = particles(2);
    png8(&workshop.join("a.png"));
    let ground = |name: &str| format!("{{ type = \"image\", image = \"{name}\" }}");
    render(&workshop, "out", &ground("a.png"), &["--frames", "1"]).expect(0);
    fs::create_dir_all(workshop.join("other")).expect("a directory");
    fs::rename(workshop.join("a.png"), workshop.join("other/b.png")).expect("a file");
    render(&workshop, "out", &ground("other/b.png"), &[]).expect(0);
    png16(&workshop.join("other/b.png"));
    let ran = render(&workshop, "out", &ground("other/b.png"), &[]).expect(2);
    assert!(ran.errors().contains("render.ground.image: "), "{}", ran.errors());
    let turned = "{ type = \"image\", image = \"other/b.png\", rotation = 5 }";
    let ran = render(&workshop, "out", turned, &[]).expect(2);
    assert!(ran.errors().contains("render.ground: "), "{}", ran.errors());
}
