//! Files made by hand for the NumPy reader, and the damage it must survive.

mod archives;
mod arrays;

use std::io::{Cursor, Write as _};

use glam::Vec3;
use proptest::prelude::*;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, mutate, names, numbers, sample};
use crate::read::pieces;
use spherule_frame::{AttributeData, Positions};

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(NPY, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(NPY, bytes, step)
}

const READER: TestedReader = TestedReader { steps, read };

fn single(name: &str) -> Vec<u8> {
    sample(&format!("single_frames/{name}"))
}

/// A file of version `major` with this dictionary, padded as numpy does.
fn npy_version(major: u8, dictionary: &str, data: &[u8]) -> Vec<u8> {
    let preamble = if major == 1 { 10 } else { 12 };
    let len = (preamble + dictionary.len() + 1).next_multiple_of(64) - preamble;
    let mut bytes = [header::MAGIC, &[major, 0]].concat();
    if major == 1 {
        bytes.extend(u16::try_from(len).unwrap().to_le_bytes());
    } else {
        bytes.extend(u32::try_from(len).unwrap().to_le_bytes());
    }
    bytes.extend(dictionary.bytes());
    bytes.resize(preamble + len - 1, b' ');
    bytes.push(b'\n');
    bytes.extend(data);
    bytes
}

/// A version 1 file in C order; `descr` and `shape` as Python.
fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dictionary = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
    npy_version(1, &dictionary, data)
}

fn f32s(numbers: impl IntoIterator<Item = f32>) -> Vec<u8> {
    numbers.into_iter().flat_map(f32::to_le_bytes).collect()
}

fn counting(count: u8) -> Vec<u8> {
    f32s((0..count).map(f32::from))
}

fn npz(members: &[(&str, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method).large_file(true);
    for (name, contents) in members {
        writer.start_file(*name, options).unwrap();
        writer.write_all(contents).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn stored(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    npz(members, CompressionMethod::Stored)
}

fn three() -> Vec<u8> {
    npy("'<f4'", "(3, 3)", &counting(9))
}

#[test]
fn truncation_is_rejected() {
    for name in ["pos.npy", "f64.npy", "fortran.npy", "struct.npy", "plain.npz", "compressed.npz"] {
        let bytes = single(name);
        READER.survives_truncation(&bytes, &[6, 8, 10, 12, 127, 128, 129], bytes.len());
    }
}

#[test]
fn huge_sizes_are_rejected() {
    for shape in [
        "(2147483647, 3)",
        "(-1, 3)",
        "(9223372036854775808, 3)",
        "(99999999999999999999999999999999999999999, 3)",
        "(9223372036854775807, 9223372036854775807, 3)",
        "(0, 9223372036854775807, 9223372036854775807)",
        "(1099511627776, 0, 3)",
    ] {
        let bytes = npy("'<f4'", shape, &[0; 64]);
        for bytes in [stored(&[("pos.npy", bytes.clone())]), bytes] {
            let error = READER.error(&bytes);
            assert!(matches!(error, ParseError::Malformed { .. }), "{shape}: {error}");
            assert_eq!(steps(&bytes), Err(error));
        }
    }
    let text = READER.error(&npy("'<f4'", "(2147483647, 3)", &[0; 64])).to_string();
    assert_eq!(
        text,
        "byte 128: an array of shape (2147483647, 3) needs 25769803764 bytes, file has 64 left"
    );
    let fields =
        ["[('pos', '<f4', (9223372036854775807, 9))]", "[('pos', '<U9223372036854775807')]"];
    for descr in fields {
        assert!(matches!(READER.error(&npy(descr, "(0,)", &[])), ParseError::Malformed { .. }));
    }
    // No items bound the width of a field; it is left out, and so there is no position.
    let error = READER.error(&npy("[('pos', '<f4', (1099511627776,))]", "(0,)", &[]));
    assert!(error.to_string().contains("no position"), "{error}");
    let long = [header::MAGIC, &[2, 0, 0xff, 0xff, 0xff, 0xff]].concat();
    assert!(READER.error(&long).to_string().contains("4294967295 bytes"));
}

#[test]
fn invalid_headers_are_described() {
    for (dictionary, words) in [
        ("[]", "not a dictionary"),
        ("{'shape': (1, 3), 'fortran_order': False}", "no descr"),
        ("{'descr': '<f4', 'shape': (1, 3)}", "no fortran_order"),
        ("{'descr': '<f4', 'fortran_order': 0, 'shape': (1, 3)}", "no fortran_order"),
        ("{'descr': '<f4', 'fortran_order': False}", "no shape"),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': ('a',)}", "no shape"),
        ("{'descr': '<q4', 'fortran_order': False, 'shape': (1, 3)}", "`<q4` is not a dtype"),
        ("{'descr': '', 'fortran_order': False, 'shape': (1, 3)}", "`` is not a dtype"),
        ("{'descr': [('a',)], 'fortran_order': False, 'shape': (1,)}", "neither 2 nor 3"),
        ("{'descr': ['a'], 'fortran_order': False, 'shape': (1,)}", "not a tuple"),
        ("{'descr' '<f4'}", "expected `:`"),
        ("{'descr': '<f4' 'shape'}", "expected `,`"),
        ("{'descr': __import__('os')}", "expected a value, found `__import__"),
        ("{'descr': 'unfinished", "the end of a string"),
        ("{} {}", "the end of the npy header"),
    ] {
        let text = READER.error(&npy_version(1, dictionary, &[0; 64])).to_string();
        assert!(text.contains(words), "{dictionary}: {text}");
    }
    let deep = READER.error(&npy_version(2, &"[".repeat(100_000), &[])).to_string();
    assert!(deep.contains("less nesting"), "{deep}");
    assert!(READER.error(b"\x93NUMPX").to_string().contains("does not begin with"));
}

/// A small valid file of each kind.
fn kinds() -> [Vec<u8>; 4] {
    let members = [
        ("pos.npy", three()),
        ("time.npy", npy("'<f8'", "()", &[0; 8])),
        ("id.npy", npy("'<u4'", "(3,)", &[1; 12])),
    ];
    [
        three(),
        npy("[('pos', '<f4', (3,)), ('', '|V2'), ('id', '>u2')]", "(3,)", &[5; 48]),
        stored(&members),
        npz(&members, CompressionMethod::Deflated),
    ]
}

proptest! {
    #[test]
    fn arrays_round_trip(
        rows in prop::collection::vec(any::<[i32; 3]>(), 0..40),
        copies in 1..300_usize,
        big in any::<bool>(),
        fortran in any::<bool>(),
        double in any::<bool>(),
    ) {
        let rows: Vec<[f64; 3]> = rows
            .iter()
            .map(|r| r.map(|c| f64::from(if double { c } else { c >> 8 }) / 1024.0))
            .collect::<Vec<_>>()
            .repeat(copies);
        let mut data = Vec::new();
        let mut push = |number: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "24 bits fit f32")]
            let mut bytes = if double {
                number.to_le_bytes().to_vec()
            } else {
                (number as f32).to_le_bytes().to_vec()
            };
            if big {
                bytes.reverse();
            }
            data.extend(bytes);
        };
        if fortran {
            (0..3).for_each(|axis| rows.iter().for_each(|r| push(r[axis])));
        } else {
            rows.as_flattened().iter().for_each(|n| push(*n));
        }
        let dictionary = format!(
            "{{'descr': '{}f{}', 'fortran_order': {}, 'shape': ({}, 3), }}",
            if big { '>' } else { '<' },
            if double { 8 } else { 4 },
            if fortran { "True" } else { "False" },
            rows.len(),
        );
        let particles = READER.one(&npy_version(1, &dictionary, &data));
        prop_assert_eq!(matches!(particles.positions, Positions::F64(_)), double);
        prop_assert_eq!(coordinates(&particles.positions), rows);
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), text in "[\\[\\](){}'a-zA-Z0-9:, <>|]{0,60}") {
        let _ = READER.all(&bytes);
        let _ = READER.all(&[header::MAGIC, b"\x01\0\x20\0", &bytes].concat());
        let _ = READER.all(&[b"PK\x03\x04".as_slice(), &bytes].concat());
        let _ = READER.all(&npy_version(1, &text, &bytes));
        let _ = READER.all(&npy_version(1, &format!("{{'descr':{text}, 'fortran_order': True, 'shape': (1,)}}"), &bytes));
        let _ = READER.all(&stored(&[("pos.npy", bytes)]));
    }

    #[test]
    fn mutations_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        for good in kinds() {
            let _ = READER.all(&mutate(&good, &changes));
        }
    }
}
