use exr::meta::MetaData;
use exr::prelude::{
    Blocks, Encoding, FlatSamples, IntegerBounds, LineOrder, ReadChannels, ReadLayers, Vec2, f16,
    read,
};
use glam::Vec3;

use super::*;
use crate::render::{Channels, FilmPlane};

/// Planes of vectors.
const VECTORS: [FilmPlane; 4] =
    [FilmPlane::Normal, FilmPlane::Position, FilmPlane::Velocity, FilmPlane::Albedo];

/// All compression methods.
pub(super) const COMPRESSIONS: [Compression; 5] =
    [Compression::None, Compression::Rle, Compression::Zip, Compression::Zips, Compression::Piz];

/// A film whose values depend on pixel and channel, so that misplaced samples are found.
fn film(width: u32, height: u32, channels: Channels) -> Film {
    let mut film = Film::new(width, height, channels);
    let value = |i: usize| i as f32 * 0.25;
    for (i, color) in film.color.iter_mut().enumerate() {
        *color = [value(i), value(i) + 0.5, 1.0, 0.125];
    }
    for (plane, add) in VECTORS.into_iter().zip([0.1, 0.2, 0.3, 0.4]) {
        for (i, v) in film.plane_mut::<Vec3>(plane).into_iter().flatten().enumerate() {
            *v = Vec3::new(value(i), value(i) * 3.0, -1.0) + add;
        }
    }
    for (i, z) in film.plane_mut::<f32>(FilmPlane::Depth).into_iter().flatten().enumerate() {
        if i % 3 != 0 {
            *z = value(i) + 1e-3;
        }
    }
    for (i, id) in (0_u32..).zip(film.plane_mut::<u32>(FilmPlane::Id).into_iter().flatten()) {
        if i % 2 == 0 {
            *id = 4_000_000_000 + i;
        }
    }
    film
}

fn options() -> ExrOptions {
    ExrOptions {
        frames_per_second: Some((24_000, 1001)),
        world_to_camera: Some(std::array::from_fn(|i| i as f32)),
        world_to_ndc: Some(std::array::from_fn(|i| 2.0 * i as f32)),
        screen_window_width: Some(0.7),
        field_of_view: Some([60.0, 40.0]),
        comments: Some("frame 7".to_owned()),
        custom: Some(CustomAttribute {
            name: "spherule".to_owned(),
            json: "{\"frame\":7}".to_owned(),
        }),
        ..ExrOptions::default()
    }
}

/// The channels of a file in its order, the attributes of the layer, and the encoding.
fn decode(bytes: &[u8]) -> (Vec<(String, FlatSamples)>, LayerAttributes, Encoding) {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .unwrap();
    let layer = image.layer_data;
    let list = layer.channel_data.list.into_iter();
    let channels = list.map(|c| (c.name.to_string(), c.sample_data)).collect();
    (channels, layer.attributes, layer.encoding)
}

#[test]
fn round_trips_with_types_and_values() {
    let film = film(37, 21, Channels::ALL);
    for compression in COMPRESSIONS {
        let options = ExrOptions { compression, ..options() };
        let encoded = encode_exr(&film, &options).unwrap();
        assert_eq!(encoded.clamped, 0);
        let (channels, attributes, encoding) = decode(&encoded.bytes);
        let names: Vec<&str> = channels.iter().map(|(name, _)| name.as_str()).collect();
        let expected = [
            "A", "B", "G", "N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "R", "V.X", "V.Y", "V.Z", "Z",
            "albedo.B", "albedo.G", "albedo.R", "id.I",
        ];
        assert_eq!(names, expected);
        for (name, samples) in &channels {
            check_channel(&film, name, samples);
        }
        assert_eq!(encoding.compression, compression.codec());
        assert_eq!(encoding.blocks, Blocks::ScanLines);
        assert_eq!(encoding.line_order, LineOrder::Increasing);
        check_attributes(&attributes);
    }
}

#[test]
fn windows_are_those_of_the_options() {
    let film = film(37, 21, Channels::ALL);
    for compression in COMPRESSIONS {
        for [left, top] in [[100, 3], [-7, -20]] {
            let window = DataWindow { left, top, image: [160, 90] };
            let options = ExrOptions { compression, window: Some(window), ..options() };
            let bytes = encode_exr(&film, &options).unwrap().bytes;
            let meta = MetaData::read_from_buffered(Cursor::new(&bytes), true).unwrap();
            let header = &meta.headers[0];
            let data = IntegerBounds::new(Vec2(left, top), Vec2(37, 21));
            assert_eq!(header.data_window(), data);
            let display = IntegerBounds::from_dimensions((160, 90));
            assert_eq!(header.shared_attributes.display_window, display);
            let primaries = header.shared_attributes.chromaticities.unwrap();
            assert_eq!((primaries.red, primaries.white), (Vec2(0.64, 0.33), Vec2(0.3127, 0.3290)));
            for (name, samples) in &decode(&bytes).0 {
                check_channel(&film, name, samples);
            }
        }
    }
}

#[track_caller]
fn check_channel(film: &Film, name: &str, samples: &FlatSamples) {
    let color = |c: usize| film.color.iter().map(|v| f16::from_f32(v[c])).collect();
    let axis = |plane: FilmPlane, a: usize| {
        let vectors = film.plane::<Vec3>(plane).unwrap();
        FlatSamples::F32(vectors.iter().map(|v| v[a]).collect())
    };
    let expected = match name {
        "R" => FlatSamples::F16(color(0)),
        "G" => FlatSamples::F16(color(1)),
        "B" => FlatSamples::F16(color(2)),
        "A" => FlatSamples::F16(color(3)),
        "Z" => FlatSamples::F32(film.plane(FilmPlane::Depth).unwrap().to_vec()),
        "id.I" => FlatSamples::U32(film.plane(FilmPlane::Id).unwrap().to_vec()),
        "N.X" => axis(FilmPlane::Normal, 0),
        "N.Y" => axis(FilmPlane::Normal, 1),
        "N.Z" => axis(FilmPlane::Normal, 2),
        "P.X" => axis(FilmPlane::Position, 0),
        "P.Y" => axis(FilmPlane::Position, 1),
        "P.Z" => axis(FilmPlane::Position, 2),
        "V.X" => axis(FilmPlane::Velocity, 0),
        "V.Y" => axis(FilmPlane::Velocity, 1),
        "V.Z" => axis(FilmPlane::Velocity, 2),
        "albedo.R" => axis(FilmPlane::Albedo, 0),
        "albedo.G" => axis(FilmPlane::Albedo, 1),
        "albedo.B" => axis(FilmPlane::Albedo, 2),
        _ => panic!("unexpected channel {name}"),
    };
    assert_eq!(*samples, expected, "{name}");
}

#[track_caller]
fn check_attributes(attributes: &LayerAttributes) {
    let software = attributes.software_name.as_ref().unwrap().to_string();
    assert_eq!(software, concat!("spherule ", env!("CARGO_PKG_VERSION")));
    assert_eq!(attributes.frames_per_second, Some((24_000, 1001)));
    assert_eq!(attributes.world_to_camera.unwrap()[13], 13.0);
    assert_eq!(attributes.world_to_normalized_device.unwrap()[13], 26.0);
    assert_eq!(attributes.screen_window_width, 0.7);
    let fields = [attributes.horizontal_field_of_view, attributes.vertical_field_of_view];
    assert_eq!(fields, [Some(60.0), Some(40.0)]);
    assert_eq!(attributes.comments.as_ref().unwrap().to_string(), "frame 7");
    assert_eq!(attributes.capture_date, None);
    assert_eq!(attributes.other.len(), 1);
    let (name, value) = attributes.other.iter().next().unwrap();
    assert_eq!(name.to_string(), "spherule");
    assert_eq!(*value, AttributeValue::Text(Text::from("{\"frame\":7}")));
}

#[test]
fn colours_without_options_are_encoded() {
    let encoded = encode_exr(&film(3, 2, Channels::COLOR), &ExrOptions::default()).unwrap();
    let (channels, attributes, _) = decode(&encoded.bytes);
    assert_eq!(channels.len(), 4);
    assert!(attributes.other.is_empty());
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let film = film(200, 300, Channels::ALL);
    for compression in COMPRESSIONS {
        let options = ExrOptions { compression, ..options() };
        let first = encode_exr(&film, &options).unwrap();
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let again = pool.build().unwrap().install(|| encode_exr(&film, &options).unwrap());
            assert!(again == first, "{compression:?} on {threads} threads");
        }
    }
}

#[test]
fn values_outside_the_range_of_half_floats_are_clamped_and_counted() {
    let mut film = film(2, 2, Channels::COLOR);
    film.color[0] = [65_504.0, 65_505.0, f32::INFINITY, 1.0];
    film.color[1] = [-1e9, f32::NAN, 0.0, 1.0];
    let encoded = encode_exr(&film, &ExrOptions::default()).unwrap();
    assert_eq!(encoded.clamped, 4);
    let (channels, ..) = decode(&encoded.bytes);
    let value = |name: &str, i: usize| {
        let (_, samples) = channels.iter().find(|(n, _)| n == name).unwrap();
        samples.value_by_flat_index(i).to_f32()
    };
    assert_eq!(value("R", 0), 65_504.0);
    assert_eq!(value("G", 0), 65_504.0);
    assert_eq!(value("B", 0), 65_504.0);
    assert_eq!(value("R", 1), -65_504.0);
    assert_eq!(value("G", 1), 0.0);
}

#[test]
fn texts_may_be_empty_long_or_not_ascii() {
    for json in [String::new(), "\u{6c34}\u{e9}".to_owned(), "x".repeat(100_000)] {
        let options = ExrOptions {
            comments: Some(json.clone()),
            custom: Some(CustomAttribute { name: "n".repeat(255), json: json.clone() }),
            ..ExrOptions::default()
        };
        let encoded = encode_exr(&film(1, 1, Channels::COLOR), &options).unwrap();
        let (_, attributes, _) = decode(&encoded.bytes);
        let (_, value) = attributes.other.iter().next().unwrap();
        let AttributeValue::Text(text) = value else {
            panic!("{value:?} is no text");
        };
        assert_eq!(text.as_slice(), json.as_bytes());
    }
}

#[test]
fn oversized_attributes_are_rejected() {
    let film = film(1, 1, Channels::COLOR);
    let with = |name: &str, json: &str| ExrOptions {
        custom: Some(CustomAttribute { name: name.to_owned(), json: json.to_owned() }),
        ..ExrOptions::default()
    };
    for options in [with("", "{}"), with(&"x".repeat(256), "{}"), with("\u{6c34}", "{}")] {
        let error = encode_exr(&film, &options).unwrap_err();
        assert!(matches!(error, OutputError::Attribute { .. }), "{error}");
    }
}

#[test]
fn a_far_depth_replaces_infinite_ones() {
    let film = film(7, 5, Channels::ALL);
    let options = ExrOptions { far_depth: Some(1e10), ..options() };
    let (channels, ..) = decode(&encode_exr(&film, &options).unwrap().bytes);
    let (_, depths) = channels.iter().find(|(name, _)| name == "Z").unwrap();
    let stored = film.plane::<f32>(FilmPlane::Depth).unwrap().iter();
    let expected = stored.map(|z| if z.is_finite() { *z } else { 1e10 }).collect();
    assert_eq!(*depths, FlatSamples::F32(expected));
}
