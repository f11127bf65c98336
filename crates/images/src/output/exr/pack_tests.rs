//! Compares packed blocks with the codec and the writer of the crate `exr`, to the bit.

use std::io::{self, Cursor, Seek, Write};
use std::sync::mpsc;

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, ImageAttributes, Layer,
    LineOrder, ReadChannels, ReadLayers, WritableImage, f16, read,
};

use super::super::layout::PRIMARIES;
use super::super::planes::{PlaneNames, Source, channels_in_file};
use super::super::tests::COMPRESSIONS;
use super::super::{ExrOptions, TextAttribute, attributes, encode_exr, write_blocks, write_exr};
use super::*;
use crate::render::planes::PlaneKind;
use crate::render::{Channels, Film, FilmPlane};

/// Pseudorandom numbers (splitmix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Any bits, including infinite values and all kinds of NaN.
    fn wild(&mut self) -> f32 {
        match self.next() % 16 {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => f32::NEG_INFINITY,
            3 => -0.0,
            4 => f32::from_bits(0xffc1_2345),
            _ => f32::from_bits((self.next() >> 32) as u32),
        }
    }
}

/// A film with random values in its lower half, so that compression does not shorten the blocks there.
fn wild_film(width: u32, height: u32, channels: Channels) -> Film {
    let mut numbers = Numbers(u64::from(width) << 32 | u64::from(height));
    let mut film = Film::new(width, height, channels);
    let half = film.color.len() / 2;
    for color in &mut film.color[half..] {
        *color = std::array::from_fn(|_| numbers.wild());
    }
    for plane in FilmPlane::all() {
        if let Some(words) = film.plane_mut::<u32>(plane) {
            let half = words.len() / 2;
            words[half..].fill_with(|| match plane {
                FilmPlane::Id => (numbers.next() >> 32) as u32,
                _ => numbers.wild().to_bits(),
            });
        }
    }
    film
}

/// All samples of `film` from `source`. Colours are converted one by one, by the portable conversion.
fn samples(film: &Film, source: Source) -> FlatSamples {
    let half = |value: f32| {
        let value = if value.is_nan() { 0.0 } else { value };
        f16::from_f32_const(value.clamp(-65_504.0, 65_504.0))
    };
    match source {
        Source::Color(c) => FlatSamples::F16(film.color.iter().map(|v| half(v[c])).collect()),
        Source::Plane(plane, component) => {
            let words = film.plane::<u32>(plane).unwrap().iter().copied();
            let words = words.skip(component).step_by(film.channels.components(plane));
            match plane.kind() {
                PlaneKind::Light => FlatSamples::F16(words.map(f32::from_bits).map(half).collect()),
                PlaneKind::Id => FlatSamples::U32(words.collect()),
                _ => FlatSamples::F32(words.map(f32::from_bits).collect()),
            }
        }
    }
}

fn bits(samples: &FlatSamples) -> Vec<u32> {
    match samples {
        FlatSamples::F16(values) => values.iter().map(|v| u32::from(v.to_bits())).collect(),
        FlatSamples::F32(values) => values.iter().map(|v| v.to_bits()).collect(),
        FlatSamples::U32(values) => values.clone(),
    }
}

/// The file that the crate `exr` writes on its own.
fn written_by_exr(film: &Film, options: &ExrOptions) -> Vec<u8> {
    let size = (film.width as usize, film.height as usize);
    let planes = channels_in_file(film.channels(), &PlaneNames::default()).into_iter();
    let list = planes.map(|plane| AnyChannel::new(&*plane.name, samples(film, plane.source)));
    let encoding = Encoding {
        compression: options.compression.codec(),
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let channels = AnyChannels::sort(list.collect());
    let layer = Layer::new(size, attributes(options).unwrap(), encoding, channels);
    let window = IntegerBounds::from_dimensions(size);
    let shared =
        ImageAttributes { chromaticities: Some(PRIMARIES), ..ImageAttributes::new(window) };
    let image = Image::empty(shared).with_layer(layer);
    let mut file = Cursor::new(Vec::new());
    image.write().to_buffered(&mut file).unwrap();
    file.into_inner()
}

fn decoded(file: &[u8]) -> Vec<(String, Vec<u32>)> {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(file))
        .unwrap();
    let list = image.layer_data.channel_data.list.into_iter();
    list.map(|c| (c.name.to_string(), bits(&c.sample_data))).collect()
}

#[track_caller]
fn check(film: &Film, compression: Compression) {
    let options = ExrOptions { compression, ..ExrOptions::default() };
    let file = encode_exr(film, &options).unwrap().bytes;
    let reference = written_by_exr(film, &options);
    let size = (film.width, film.height);
    if !matches!(compression, Compression::Zip | Compression::Zips) {
        assert!(file == reference, "{compression:?} {size:?}");
    }
    let expected: Vec<_> = channels_in_file(film.channels(), &PlaneNames::default())
        .iter()
        .map(|plane| (plane.name.to_string(), bits(&samples(film, plane.source))))
        .collect();
    assert!(decoded(&file) == expected, "{compression:?} {size:?}");
}

#[test]
fn films_round_trip_and_match_the_exr_crate() {
    for (width, height) in [(1, 1), (17, 33), (1, 50), (50, 1), (40, 16), (31, 64)] {
        for compression in COMPRESSIONS {
            check(&wild_film(width, height, Channels::ALL), compression);
            check(&wild_film(width, height, Channels::COLOR), compression);
        }
    }
    for bits in 0..64_u32 {
        let is_given = |plane: &FilmPlane| bits >> *plane as u32 & 1 == 1;
        let planes: Vec<_> = FilmPlane::all().filter(is_given).collect();
        let channels = Channels::COLOR.with(&planes);
        check(&wild_film(9, 20, channels), Compression::Zip);
    }
}

#[test]
fn layers_round_trip() {
    for compression in COMPRESSIONS {
        let names = ["lights", "noisy", "shadow", "motion", "cryptomatte"];
        let channels = Channels::from_names(names).unwrap();
        check(&wild_film(17, 33, channels), compression);
        let channels = Channels::from_names(["shadow", "crypto_part"]).unwrap();
        check(&wild_film(5, 20, channels), compression);
    }
}

/// The names of the parts of a file, and the samples of all channels.
fn decoded_parts(file: &[u8]) -> (Vec<String>, Vec<(String, Vec<u32>)>) {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(file))
        .unwrap();
    let (mut names, mut channels) = (Vec::new(), Vec::new());
    for part in image.layer_data {
        names.extend(part.attributes.layer_name.map(|name| name.to_string()));
        for channel in part.channel_data.list {
            channels.push((channel.name.to_string(), bits(&channel.sample_data)));
        }
    }
    channels.sort();
    (names, channels)
}

#[test]
fn colours_and_data_have_compressions_of_their_own() {
    let version = |file: &[u8]| u32::from_le_bytes(file[4..8].try_into().unwrap());
    for (width, height) in [(1, 1), (17, 33), (40, 16), (31, 65)] {
        let film = wild_film(width, height, Channels::ALL);
        for compression in COMPRESSIONS {
            let plain = ExrOptions { compression, ..ExrOptions::default() };
            let single = encode_exr(&film, &plain).unwrap();
            let (names, expected) = decoded_parts(&single.bytes);
            assert!(names.is_empty() && version(&single.bytes) & 1 << 12 == 0);
            for data in COMPRESSIONS {
                let options = ExrOptions { data_compression: Some(data), ..plain.clone() };
                let file = encode_exr(&film, &options).unwrap();
                assert_eq!(file.clamped, single.clamped);
                if data == compression {
                    assert!(file == single);
                    continue;
                }
                let (names, found) = decoded_parts(&file.bytes);
                assert_eq!(names, ["color", "data"]);
                assert!(found == expected, "{compression:?} {data:?}");
                assert_eq!(version(&file.bytes), 2 | 1 << 12);
            }
        }
        // Without data, there is one part
        let options =
            ExrOptions { data_compression: Some(Compression::None), ..ExrOptions::default() };
        let film = wild_film(width, height, Channels::COLOR);
        let [with, without] = [options, ExrOptions::default()];
        assert!(encode_exr(&film, &with).unwrap() == encode_exr(&film, &without).unwrap());
    }
}

#[test]
fn attributes_of_data_are_in_their_part() {
    let film = wild_film(5, 4, Channels::ALL);
    let options = ExrOptions {
        data_compression: Some(Compression::None),
        world_to_camera: Some([1.0; 16]),
        texts: vec![TextAttribute {
            name: "cryptomatte/1234567/name".to_owned(),
            text: "crypto_part".to_owned(),
        }],
        ..ExrOptions::default()
    };
    let file = encode_exr(&film, &options).unwrap().bytes;
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(file), true).unwrap();
    let [color, data] = &meta.headers[..] else {
        panic!("{} parts", meta.headers.len());
    };
    let count = |header: &exr::meta::header::Header| header.own_attributes.other.len();
    assert_eq!((count(color), count(data)), (0, 1));
    assert_eq!(color.own_attributes.world_to_camera, Some([1.0; 16]));
    assert_eq!(data.own_attributes.world_to_camera, Some([1.0; 16]));
}

#[test]
fn wide_rows_round_trip() {
    check(&wild_film(3000, 17, Channels::ALL), Compression::Zip);
    check(&wild_film(40_000, 2, Channels::ALL), Compression::Zip);
}

#[test]
fn pieces_follow_the_kinds_of_planes() {
    let layout =
        |width, channels| ExrLayout::new(width, 40, channels, &ExrOptions::default()).unwrap();
    let lengths = |layout: &ExrLayout, rows| -> Vec<(usize, bool)> {
        let pieces = layout.parts[0].pieces(rows);
        pieces.map(|piece| (piece.length, piece.is_searched)).collect()
    };
    let all = layout(10, Channels::ALL);
    // A B G, N, P, R, V, Z, albedo and id.
    let row = |positions, particles| {
        [
            (30, false),
            (60, false),
            (60, positions),
            (10, false),
            (60, particles),
            (20, positions),
            (80, particles),
        ]
    };
    let rows = [row(false, true), row(false, true), row(true, true), row(true, true)];
    assert_eq!(lengths(&all, 2), rows.concat());
    assert_eq!(4 * 320, all.parts[0].bytes(2));
    // A block of one row has no row above
    assert_eq!(lengths(&all, 1), [row(false, false), row(true, false)].concat());
    assert_eq!(lengths(&layout(10, Channels::COLOR), 1), [(40, false); 2]);
    // In wide images, the row above is out of reach
    let wide = layout(1025, Channels::ALL);
    assert!(wide.parts[0].bytes(1) / 2 > WINDOW);
    assert!(!lengths(&wide, 2)[6].1);
    assert!(lengths(&layout(1024, Channels::ALL), 2)[6].1);
}

#[test]
fn blocks_that_do_not_shrink_are_stored_plain() {
    let mut numbers = Numbers(7);
    let mut film = Film::new(50, 32, Channels::COLOR);
    for color in &mut film.color[50 * 16..] {
        // Only finite half-floats
        *color = std::array::from_fn(|_| {
            let bits = (numbers.next() >> 48) as u16;
            f16::from_bits((bits % 0x7c00) | (bits & 0x8000)).to_f32()
        });
    }
    film.color[50 * 32 - 1] = [f32::NAN, f32::INFINITY, -1e9, 1.0];
    let layout = ExrLayout::of(&film, &ExrOptions::default()).unwrap();
    let mut buffers = PackBuffers::default();
    let blocks: Vec<PackedBlock> = layout
        .blocks(film.rows())
        .map(|rows| pack_block(&rows, &layout, &mut buffers).unwrap())
        .collect();
    let tops: Vec<u32> = blocks.iter().map(|block| block.y).collect();
    assert_eq!(tops, [0, 16]);
    assert!(blocks[0].bytes.len() < layout.parts[0].bytes(16) / 10);
    assert_eq!(blocks[1].bytes.len(), layout.parts[0].bytes(16));
    assert_eq!((blocks[0].clamped, blocks[1].clamped), (0, 3));
    check(&film, Compression::Zip);
}

/// FNV-1a, written out so that no update of a crate can change it.
fn fnv(bytes: &[u8]) -> u64 {
    let start = 0xcbf2_9ce4_8422_2325_u64;
    bytes.iter().fold(start, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// The bytes of a smooth picture do not depend on the instruction sets of the machine.
#[test]
fn the_bytes_are_the_same_on_every_machine() {
    let hash = |channels| {
        let mut film = Film::new(150, 40, channels);
        for (at, color) in (0_u16..).zip(&mut film.color) {
            let (x, y) = (f32::from(at % 150), f32::from(at / 150));
            *color = [x * y / 256.0, x / 128.0, y / 64.0, 1.0];
        }
        for (at, id) in (0..).zip(film.plane_mut::<u32>(FilmPlane::Id).into_iter().flatten()) {
            *id = at / 7 * 7;
        }
        let layout = ExrLayout::of(&film, &ExrOptions::default()).unwrap();
        let mut buffers = PackBuffers::default();
        let blocks = layout.blocks(film.rows());
        let bytes: Vec<u8> = blocks
            .flat_map(|rows| pack_block(&rows, &layout, &mut buffers).unwrap().bytes)
            .collect();
        fnv(&bytes)
    };
    assert_eq!(hash(Channels::COLOR), 0xda8e_f38b_2150_c4f0);
    assert_eq!(hash(Channels::ALL), 0x0e48_6c25_e9ed_5de7);
}

#[test]
fn the_film_is_returned_without_waiting_for_a_busy_pool() {
    let film = wild_film(40, 200, Channels::ALL);
    let expected = encode_exr(&film, &ExrOptions::default()).unwrap().bytes;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2);
    let (file, returned) = pool.build().unwrap().install(|| {
        let (free, busy) = mpsc::channel::<()>();
        let (begins, has_begun) = mpsc::channel();
        rayon::spawn(move || {
            begins.send(()).unwrap();
            let _ = busy.recv();
        });
        has_begun.recv().unwrap();
        let mut file = Cursor::new(Vec::new());
        let (returned, _) = write_exr(film.clone(), &ExrOptions::default(), &mut file).unwrap();
        drop(free);
        (file.into_inner(), returned)
    });
    assert!(file == expected);
    assert_eq!(returned.plane::<u32>(FilmPlane::Id), film.plane::<u32>(FilmPlane::Id));
}

/// A file that accepts only `room` bytes.
struct LimitedFile {
    file: Cursor<Vec<u8>>,
    room: u64,
    kind: io::ErrorKind,
}

impl Write for LimitedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.file.position() + bytes.len() as u64 > self.room {
            return Err(self.kind.into());
        }
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for LimitedFile {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

#[test]
fn a_full_disk_gives_the_error_of_the_operating_system() {
    let film = wild_film(64, 100, Channels::COLOR);
    let length = encode_exr(&film, &ExrOptions::default()).unwrap().bytes.len() as u64;
    for kind in [io::ErrorKind::StorageFull, io::ErrorKind::BrokenPipe] {
        for room in [0, 100, 500, length / 2, length - 1] {
            let mut file = LimitedFile { file: Cursor::new(Vec::new()), room, kind };
            let error = write_exr(film.clone(), &ExrOptions::default(), &mut file).unwrap_err();
            assert_eq!(error.into_io().unwrap().kind(), kind, "{room} of {length}");
        }
    }
}

#[test]
fn a_missing_block_is_an_error() {
    let film = wild_film(8, 40, Channels::COLOR);
    let layout = ExrLayout::of(&film, &ExrOptions::default()).unwrap();
    let mut buffers = PackBuffers::default();
    let blocks = layout.blocks(film.rows()).map(|rows| pack_block(&rows, &layout, &mut buffers));
    let mut file = Cursor::new(Vec::new());
    assert!(write_blocks(&mut file, &layout, blocks.take(2)).is_err());
}
