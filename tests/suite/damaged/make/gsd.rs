//! GSD files.

use super::base::{Base, find};
use super::{Made, NAN, WHOLE, little};

/// A chunk of frame 0: name, code of its type, rows and columns, numbers.
type Chunk<'a> = (&'a str, u8, [u64; 2], Vec<u8>);

/// Header, index of 8 entries, names, numbers.
fn layers(chunks: &[Chunk<'_>]) -> Vec<u8> {
    let names: Vec<&str> = chunks.iter().map(|chunk| chunk.0).collect();
    let mut list = names.join("\0").into_bytes();
    list.resize(128, 0);
    let mut file = [0xdf, 0x65].repeat(4);
    file.extend([256, 8, 512, 2].into_iter().flat_map(u64::to_le_bytes));
    file.extend([0x1_0004, 0x2_0001].into_iter().flat_map(u32::to_le_bytes));
    for (text, end) in [("tests", 112), ("hoomd", 256)] {
        file.extend(text.bytes());
        file.resize(end, 0);
    }
    let mut location = 512 + list.len() as u64;
    for ((_, kind, [rows, columns], numbers), name) in chunks.iter().zip(0_u8..) {
        let columns = u8::try_from(*columns).expect("a few columns");
        file.extend([0, *rows, location].into_iter().flat_map(u64::to_le_bytes));
        file.extend([columns, 0, 0, 0, name, 0, *kind, 0]);
        location += numbers.len() as u64;
    }
    file.resize(512, 0);
    file.extend(list);
    file.extend(chunks.iter().flat_map(|chunk| &chunk.3));
    file
}

fn gsd_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let n = points.len() as u64;
    layers(&[
        ("configuration/step", 4, [1, 1], 7_u64.to_le_bytes().to_vec()),
        ("particles/N", 3, [1, 1], n.to_le_bytes()[..4].to_vec()),
        ("particles/position", 9, [n, 3], little(points)),
        ("particles/velocity", 9, [n, 3], little(points)),
    ])
}

pub(super) fn gsd() -> Vec<Made> {
    let whole = gsd_bytes(&WHOLE);
    let length = whole.len();
    // Entries of the index: of the number of particles, of positions, of velocities
    let [count, positions, velocities] = [1, 2, 3].map(|entry| 256 + 32 * entry);
    let number = find(&whole, b"\x07\0\0\0\0\0\0\0\x03\0\0\0") + 8;
    Base::new("hoomd", "gsd", whole)
        .patch("magic", 0, &[0xde])
        .patch("big-endian", 0, &[0x65, 0xdf].repeat(4))
        .patch("version", 46, &[3])
        .patch("schema-version", 42, &[9])
        .replace("schema", "hoomd", "other")
        .cut_at("cut-in-head", 100)
        .cut_at("cut-in-index", 300)
        .cut_at("cut-in-names", 600)
        .cut_at("cut-in-velocities", length - 5)
        .patch("absurd-index", 16, &[0xff; 8])
        .patch("absurd-names", 32, &[0xff; 8])
        .patch("absurd-particles", number, &[0xff; 4])
        .patch("absurd-rows", positions + 8, &[0xff; 8])
        .patch("far-positions", positions + 16, &[0xff; 7])
        .patch("absurd-frame", velocities, &[0xff; 8])
        .patch("type", positions + 30, &[99])
        .patch("integers", positions + 30, &[7])
        .patch("columns", positions + 24, &[2])
        .patch("name", velocities + 28, &[9])
        .patch("twice", velocities + 28, &[1])
        .patch("no-positions", positions + 28, &[3])
        .patch("signed-count", count + 30, &[7])
        .file("nan", gsd_bytes(&NAN))
        .file("zero", gsd_bytes(&[]))
        .made
}
