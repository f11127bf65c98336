use std::path::Path;

use exr::prelude::*;

use super::*;

const WIDTH: usize = 16;
const HEIGHT: usize = 8;

fn value(x: usize, y: usize, component: usize) -> f32 {
    // Exact in half precision, and in RGBE, whose components share an exponent.
    [2.0, 1.0, 0.5][component] * (1 + (x + 3 * y) % 7) as f32
}

fn write_exr(path: &Path, change: impl Fn(usize, usize) -> Option<f32> + Sync) {
    let pixel = |Vec2(x, y): Vec2<usize>| {
        let of = |component| change(x, y).unwrap_or(value(x, y, component));
        (of(0), of(1), of(2))
    };
    let image = Image::from_encoded_channels(
        (WIDTH, HEIGHT),
        Encoding::SMALL_LOSSLESS,
        SpecificChannels::rgb(pixel),
    );
    image.write().to_file(path).unwrap();
}

/// An uncompressed Radiance file.
fn radiance_bytes(width: usize, height: usize) -> Vec<u8> {
    let mut bytes =
        format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        // Mantissas of 256ths, exponent 4: values up to 16.
        let mantissa = |component| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "below 256"
            )]
            let byte = (value(x, y, component) * 16.0) as u8;
            byte
        };
        bytes.extend([mantissa(0), mantissa(1), mantissa(2), 128 + 4]);
    }
    bytes
}

fn message(path: &Path) -> String {
    let message = read_radiance_map(path).unwrap_err().to_string();
    let name = path.display().to_string();
    let rest = message.strip_prefix(&name).expect("messages begin with the file");
    rest.to_owned()
}

fn expected() -> RadianceMap {
    let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let pixels = places.map(|(x, y)| glam::Vec3::from_array([0, 1, 2].map(|c| value(x, y, c))));
    RadianceMap::new(WIDTH, HEIGHT, pixels.collect()).unwrap()
}

#[test]
fn both_formats_have_their_pixels_whatever_their_name() {
    let dir = tempfile::tempdir().unwrap();
    let exr = dir.path().join("a.picture");
    write_exr(&exr, |_, _| None);
    assert_eq!(read_radiance_map(&exr).unwrap(), expected());
    let hdr = dir.path().join("b.picture");
    std::fs::write(&hdr, radiance_bytes(WIDTH, HEIGHT)).unwrap();
    assert_eq!(read_radiance_map(&hdr).unwrap(), expected());
}

#[test]
fn channels_are_found_among_others_and_in_tiles() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let samples = |component: usize| {
        let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        places.map(move |(x, y)| value(x, y, component))
    };
    let half = |component| FlatSamples::F16(samples(component).map(f16::from_f32).collect());
    let list = [
        AnyChannel::new("A", FlatSamples::F32(vec![1.0; WIDTH * HEIGHT])),
        AnyChannel::new("B", half(2)),
        AnyChannel::new("G", FlatSamples::F32(samples(1).collect())),
        AnyChannel::new("R", half(0)),
        AnyChannel::new("id", FlatSamples::U32(vec![7; WIDTH * HEIGHT])),
    ];
    let encoding = Encoding {
        compression: Compression::ZIP1,
        blocks: Blocks::Tiles(Vec2(5, 3)),
        line_order: LineOrder::Unspecified,
    };
    let channels = AnyChannels::sort(list.into_iter().collect());
    let layer = Layer::new((WIDTH, HEIGHT), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(&path).unwrap();
    assert_eq!(read_radiance_map(&path).unwrap(), expected());
}

#[test]
fn bad_images_are_refused_by_name_and_reason() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    assert!(matches!(read_radiance_map(&dir.path().join("none")), Err(ImageReadError::Io { .. })));
    assert!(matches!(read_radiance_map(dir.path()), Err(ImageReadError::Io { .. })));
    assert!(message(&at("a.hdr", b"")).contains("neither an OpenEXR nor"));
    assert!(message(&at("b.hdr", b"\x89PNG\r\n\x1a\n")).contains("convert it"));
    assert!(message(&at("c.hdr", &radiance_bytes(12, 11))).contains("twice as wide"));
    // A header alone: huge, and cut off
    let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 200000 +X 400000\n";
    assert!(message(&at("d.hdr", huge)).contains("at most"));
    let whole = radiance_bytes(WIDTH, HEIGHT);
    assert!(!message(&at("e.hdr", &whole[..whole.len() - 3])).is_empty());
    // One pixel that is no radiance
    let path = dir.path().join("f.exr");
    write_exr(&path, |x, y| (x == 3 && y == 2).then_some(f32::NAN));
    assert!(message(&path).contains("column 3 and row 2 is NaN or infinite"));
    write_exr(&path, |x, y| (x == 3 && y == 2).then_some(-1.0));
    assert_eq!(read_radiance_map(&path).unwrap().negative(), 1);
}

#[test]
fn damage_anywhere_is_no_panic() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    write_exr(&path, |_, _| None);
    for original in [std::fs::read(&path).unwrap(), radiance_bytes(WIDTH, HEIGHT)] {
        for at in 0..original.len().min(700) {
            for bits in [0xff, 0x01] {
                let mut damaged = original.clone();
                damaged[at] ^= bits;
                std::fs::write(&path, &damaged).unwrap();
                // Whether it is noticed depends on the place.
                let _ = read_radiance_map(&path);
            }
        }
        for len in (0..original.len()).step_by(7) {
            std::fs::write(&path, &original[..len]).unwrap();
            assert!(read_radiance_map(&path).is_err(), "{len}");
        }
    }
}
