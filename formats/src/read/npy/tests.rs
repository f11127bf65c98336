use std::io::{Cursor, Write as _};

use glam::Vec3;
use proptest::prelude::*;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::read::damage::{Reader, attribute, coordinates, mutate, names, numbers, sample};
use crate::{AttributeData, Positions};

const READER: Reader = Reader { steps, read };

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
    let options = SimpleFileOptions::default()
        .compression_method(method)
        .large_file(true);
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
fn all_single_arrays_hold_the_same_particles() {
    let expected = READER.one(&single("pos.npy"));
    assert_eq!(expected.positions.len(), 1200);
    assert!(expected.attributes.is_empty());
    let ply = crate::read::ply::read(&single("le.ply"), &Step::whole(0)).unwrap();
    assert_eq!(expected.positions, ply.positions);
    assert_eq!(READER.one(&single("fortran.npy")), expected);

    let wide = READER.one(&single("f64.npy"));
    assert!(matches!(wide.positions, Positions::F64(_)));
    assert_eq!(
        coordinates(&wide.positions),
        coordinates(&expected.positions)
    );

    let records = READER.one(&single("struct.npy"));
    assert_eq!(records.positions, expected.positions);
    assert_eq!(names(&records), ["vel", "id"]);
    assert_eq!(
        attribute(&records, "vel").data,
        attribute(&ply, "velocity").data
    );
    assert_eq!(attribute(&records, "id").data, attribute(&ply, "id").data);
}

#[test]
fn archives_hold_the_same_particles() {
    let ply = crate::read::ply::read(&single("le.ply"), &Step::whole(0)).unwrap();
    let plain = READER.one(&single("plain.npz"));
    assert_eq!(plain.positions, ply.positions);
    assert_eq!(names(&plain), ["velocities", "ids", "density"]);
    assert_eq!(attribute(&plain, "velocities").components, 3);
    assert_eq!(
        attribute(&plain, "velocities").data,
        attribute(&ply, "velocity").data
    );
    assert_eq!(attribute(&plain, "ids").data, attribute(&ply, "id").data);
    assert!(plain.time.is_some());
    assert_eq!(steps(&single("plain.npz")).unwrap()[0].time, plain.time);
    assert_eq!(READER.one(&single("compressed.npz")), plain);
}

#[test]
fn pysph_archives_are_refused_by_name() {
    let bytes = sample("pysph/dam_break_3d_00300.npz");
    let error = READER.error(&bytes);
    assert!(matches!(error, ParseError::Unsupported { .. }));
    assert_eq!(
        error.to_string(),
        "npz members [particles, solver_data] are pickled python objects ('|O'), which \
         are never unpickled; save plain arrays with numpy.savez (from pysph: convert with `pysph \
         dump_vtk`)"
    );
    assert_eq!(steps(&bytes), Err(error));
}

#[test]
fn pickles_are_refused_only_where_they_are_needed() {
    let pickle = || npy("'|O'", "(3,)", b"\x80\x04.");
    for bytes in [
        pickle(),
        npy("[('pos', '<f4', (3,)), ('tag', '|O')]", "(1,)", &[0; 20]),
        stored(&[("arr_0.npy", pickle())]),
        stored(&[("positions.npy", pickle()), ("a.npy", three())]),
        stored(&[
            ("b.npy", pickle()),
            ("a.npy", npy("'<f4'", "(3,)", &counting(3))),
        ]),
    ] {
        let text = READER.error(&bytes).to_string();
        assert!(
            text.contains("never unpickled; save plain arrays with numpy.savez"),
            "{text}"
        );
    }
    let beside = stored(&[("meta.npy", pickle()), ("pos.npy", three())]);
    assert!(READER.one(&beside).attributes.is_empty());
}

#[test]
fn shapes_are_understood() {
    let rows = [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]];
    for (shape, count, expected) in [
        ("(2, 3)", 6, vec![rows[0], rows[1]]),
        ("(3, 3)", 9, rows.to_vec()),
        ("(3, 1)", 3, vec![rows[0]]),
        (
            "(3, 4)",
            12,
            vec![
                [0.0, 4.0, 8.0],
                [1.0, 5.0, 9.0],
                [2.0, 6.0, 10.0],
                [3.0, 7.0, 11.0],
            ],
        ),
        ("(2, 2)", 4, vec![[0.0, 1.0, 0.0], [2.0, 3.0, 0.0]]),
        (
            "(3L, 2L)",
            6,
            vec![[0.0, 1.0, 0.0], [2.0, 3.0, 0.0], [4.0, 5.0, 0.0]],
        ),
        ("(0, 3)", 0, vec![]),
        ("(3, 0)", 0, vec![]),
        ("(0,)", 0, vec![]),
        ("(1, 2, 3)", 6, vec![rows[0], rows[1]]),
        ("(1, 3, 1)", 3, vec![rows[0]]),
    ] {
        let particles = READER.one(&npy("'<f4'", shape, &counting(count)));
        assert_eq!(coordinates(&particles.positions), expected, "{shape}");
        assert!(matches!(particles.positions, Positions::F32(_)));
    }
    for shape in [
        "()",
        "(3,)",
        "(5, 7)",
        "(2, 4)",
        "(1, 2, 4)",
        "(1, 1, 2, 3)",
    ] {
        let error = READER.error(&npy("'<f4'", shape, &counting(64)));
        assert!(
            error.to_string().contains("save shape (N, 3)"),
            "{shape}: {error}"
        );
    }
    let text = READER
        .error(&npy("'<f4'", "(3,)", &counting(3)))
        .to_string();
    assert!(
        text.starts_with("an array of shape (3,) is no list of positions"),
        "{text}"
    );
}

#[test]
fn a_dimension_before_holds_time_steps() {
    let expected = [
        vec![[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
        vec![[6.0, 7.0, 8.0], [9.0, 10.0, 11.0]],
    ];
    let check = |bytes: &[u8]| {
        let all = READER.all(bytes).unwrap();
        let found: Vec<_> = all.iter().map(|p| coordinates(&p.positions)).collect();
        assert_eq!(found, expected);
        let late = Step {
            index: 2,
            ..Step::whole(bytes.len())
        };
        assert!(matches!(
            read(bytes, &late),
            Err(ParseError::Malformed { .. })
        ));
    };
    check(&npy("'<f4'", "(2, 2, 3)", &counting(12)));
    // frame + 2 * particle + 4 * coordinate
    let fortran = [0, 6, 3, 9, 1, 7, 4, 10, 2, 8, 5, 11].map(|n: u8| f32::from(n));
    let dictionary = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 2, 3), }";
    check(&npy_version(1, dictionary, &f32s(fortran)));
    check(&npy(
        "[('x', '<f4'), ('y', '<f4'), ('z', '<f4')]",
        "(2, 2)",
        &counting(12),
    ));

    let archive = stored(&[
        ("pos.npy", npy("'<f4'", "(2, 2, 3)", &counting(12))),
        (
            "times.npy",
            npy(
                "'<f8'",
                "(2,)",
                &[1.5_f64, 2.5].map(f64::to_le_bytes).concat(),
            ),
        ),
        ("rho.npy", npy("'<f4'", "(2, 2)", &counting(4))),
        ("ids.npy", npy("'<u2'", "(2,)", &[7, 0, 9, 0])),
    ]);
    check(&archive);
    let times: Vec<_> = steps(&archive).unwrap().iter().map(|s| s.time).collect();
    // A (2,) array named times tells the steps; ids has one number a particle.
    assert_eq!(times, [Some(1.5), Some(2.5)]);
    let second = &READER.all(&archive).unwrap()[1];
    assert_eq!(second.time, Some(2.5));
    assert_eq!(names(second), ["rho", "ids"]);
    assert_eq!(numbers(&attribute(second, "rho").data), [2.0, 3.0]);
    assert_eq!(
        attribute(second, "ids").data,
        AttributeData::U16(vec![7, 9])
    );
}

#[test]
fn number_types_and_versions_are_understood() {
    let one = |descr: &str, data: &[u8]| READER.one(&npy(descr, "(1, 3)", data)).positions;
    let wanted = [[1.0, -2.0, 3.5]];
    let big: Vec<u8> = [1.0_f32, -2.0, 3.5].map(f32::to_be_bytes).concat();
    assert_eq!(coordinates(&one("'>f4'", &big)), wanted);
    let big: Vec<u8> = [1.0_f64, -2.0, 3.5].map(f64::to_be_bytes).concat();
    assert_eq!(coordinates(&one("'>f8'", &big)), wanted);
    let exact: Vec<u8> = [i64::from(i32::MAX), -1, 5].map(i64::to_le_bytes).concat();
    assert_eq!(
        coordinates(&one("'<i8'", &exact)),
        [[2_147_483_647.0, -1.0, 5.0]]
    );
    assert_eq!(
        one("'|u1'", &[1, 2, 255]),
        Positions::F32(vec![Vec3::new(1.0, 2.0, 255.0)])
    );
    for descr in [
        "'<f2'",
        "'<c16'",
        "'|S4'",
        "'<U2'",
        "'<f16'",
        "'<M8[ns]'",
        "'|V12'",
    ] {
        let error = READER.error(&npy(descr, "(1, 3)", &[0; 64]));
        assert!(
            matches!(error, ParseError::Unsupported { .. }),
            "{descr}: {error}"
        );
    }
    let dictionary = r#"{"shape": (1, 3), "fortran_order": False, "descr": "<f4"}"#;
    for major in [1, 2, 3] {
        let bytes = npy_version(major, dictionary, &counting(3));
        assert_eq!(
            coordinates(&READER.one(&bytes).positions),
            [[0.0, 1.0, 2.0]]
        );
    }
    let error = READER.error(&npy_version(4, dictionary, &counting(3)));
    assert!(error.to_string().contains("npy version 4"), "{error}");
}

#[test]
fn structures_are_flattened() {
    let descr = "[('id', '<i8'), ('', '|V4'), (('where it is', 'Position'), '>f4', (3,)), \
                 ('name', '|S3'), ('inner', [('a', '<u2'), ('b', '|i1', (2,))]), ('m', '<f4', 2), \
                 ('skipped', [('c', '|u1')], (2,)), ('vx', '<f8'), ('vy', '<f8'), ('vz', '<f8')]";
    let mut item = (-5_i64).to_le_bytes().to_vec();
    item.extend([0xee; 4]);
    item.extend([1.0_f32, 2.0, 3.0].map(f32::to_be_bytes).concat());
    item.extend(b"abc");
    item.extend([2, 1, 0xff, 0x01]);
    item.extend(f32s([8.0, 9.0]));
    item.extend([0xee; 2]);
    item.extend([4.0_f64, 5.0, 6.0].map(f64::to_le_bytes).concat());
    let particles = READER.one(&npy(descr, "(5000,)", &item.repeat(5000)));
    assert_eq!(
        coordinates(&particles.positions),
        vec![[1.0, 2.0, 3.0]; 5000]
    );
    assert_eq!(
        names(&particles),
        ["id", "inner.a", "inner.b", "m", "velocity"]
    );
    let last = |name| {
        let found = attribute(&particles, name);
        numbers(&found.data).split_off(4999 * found.components)
    };
    assert_eq!(last("id"), [-5.0]);
    assert_eq!(last("inner.a"), [258.0]);
    assert_eq!(last("inner.b"), [-1.0, 1.0]);
    assert_eq!(last("m"), [8.0, 9.0]);
    assert_eq!(last("velocity"), [4.0, 5.0, 6.0]);

    let plane = READER.one(&npy(
        "[('X', '<f4'), ('Y', '<f8')]",
        "()",
        &[[0; 4].as_slice(), &1.5_f64.to_le_bytes()].concat(),
    ));
    assert_eq!(coordinates(&plane.positions), [[0.0, 1.5, 0.0]]);
    let error = READER.error(&npy("[('a', '<f4'), ('b', '<f4')]", "(1,)", &[0; 8]));
    assert!(
        error.to_string().contains("among its fields [a, b]"),
        "{error}"
    );
}

#[test]
fn archives_find_their_positions() {
    let line = |first: f32| {
        npy(
            "'<f8'",
            "(2,)",
            &[f64::from(first), 9.0].map(f64::to_le_bytes).concat(),
        )
    };
    let axes = stored(&[
        ("x.npy", line(1.0)),
        ("y.npy", line(2.0)),
        ("z.npy", line(3.0)),
        ("r.npy", line(4.0)),
        ("t.npy", npy("'<i4'", "()", &7_i32.to_le_bytes())),
        ("box.npy", npy("'<f4'", "(3, 2)", &counting(6))),
        ("readme.txt", b"no array".to_vec()),
    ]);
    let particles = READER.one(&axes);
    assert_eq!(
        coordinates(&particles.positions),
        [[1.0, 2.0, 3.0], [9.0; 3]]
    );
    // A radius, not positions called r.
    assert_eq!(names(&particles), ["r"]);
    assert_eq!(particles.time, Some(7.0));

    let planes = stored(&[
        ("coordinates.npy", npy("'<f4'", "(3, 4)", &counting(12))),
        ("vel.npy", npy("'<f4'", "(3, 4)", &counting(12))),
        ("force.npy", npy("'<f4'", "(4, 3)", &counting(12))),
        ("stress.npy", npy("'<f4'", "(4, 1, 2)", &counting(8))),
    ]);
    let particles = READER.one(&planes);
    assert_eq!(names(&particles), ["vel", "force", "stress"]);
    assert_eq!(
        numbers(&attribute(&particles, "vel").data)[..3],
        [0.0, 4.0, 8.0]
    );
    assert_eq!(
        numbers(&attribute(&particles, "force").data)[..3],
        [0.0, 1.0, 2.0]
    );
    assert_eq!(attribute(&particles, "stress").components, 2);

    let only = npz(&[("arr_0.npy", three())], CompressionMethod::Deflated);
    assert_eq!(READER.one(&only).positions.len(), 3);
    let none = stored(&[
        ("a.npy", three()),
        ("b.npy", npy("'<f4'", "()", &counting(1))),
    ]);
    let text = READER.error(&none).to_string();
    assert!(
        text.contains("[a (3, 3), b ()]: save an (N, 3) array named positions"),
        "{text}"
    );
    assert!(matches!(
        READER.error(&stored(&[])),
        ParseError::Unsupported { .. }
    ));
}

#[test]
fn damaged_archives_are_refused() {
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let good = npz(
            &[("pos.npy", npy("'<f4'", "(30, 3)", &counting(90)))],
            method,
        );
        assert_eq!(READER.one(&good).positions.len(), 30);
        // A changed byte of the contents, which end before the central directory.
        let directory = good.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        let mut changed = good.clone();
        changed[directory - 8] ^= 0x55;
        assert!(matches!(
            READER.error(&changed),
            ParseError::Malformed { .. }
        ));
        // The uncompressed size in the central directory.
        for size in [0_u32, 300, 0x7fff_ffff] {
            let mut changed = good.clone();
            changed[directory + 24..directory + 28].copy_from_slice(&size.to_le_bytes());
            let error = READER.error(&changed);
            assert!(
                matches!(error, ParseError::Malformed { .. }),
                "{size}: {error}"
            );
        }
        for cut in 0..good.len() {
            assert!(READER.all(&good[..cut]).is_err(), "cut at {cut}");
        }
    }
    let mut other_method = stored(&[("pos.npy", three())]);
    let directory = other_method
        .windows(4)
        .position(|w| w == b"PK\x01\x02")
        .unwrap();
    other_method[directory + 10] = 12;
    let error = READER.error(&other_method);
    assert!(matches!(error, ParseError::Unsupported { .. }), "{error}");
}

#[test]
fn truncation_is_refused() {
    for name in [
        "pos.npy",
        "f64.npy",
        "fortran.npy",
        "struct.npy",
        "plain.npz",
        "compressed.npz",
    ] {
        let bytes = single(name);
        READER.survives_truncation(&bytes, &[6, 8, 10, 12, 127, 128, 129], bytes.len());
    }
}

#[test]
fn absurd_sizes_are_refused() {
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
            assert!(
                matches!(error, ParseError::Malformed { .. }),
                "{shape}: {error}"
            );
            assert_eq!(steps(&bytes), Err(error));
        }
    }
    let text = READER
        .error(&npy("'<f4'", "(2147483647, 3)", &[0; 64]))
        .to_string();
    assert_eq!(
        text,
        "byte 128: an array of shape (2147483647, 3) needs 25769803764 bytes, file has 64 left"
    );
    let fields = [
        "[('pos', '<f4', (9223372036854775807, 9))]",
        "[('pos', '<U9223372036854775807')]",
    ];
    for descr in fields {
        assert!(matches!(
            READER.error(&npy(descr, "(0,)", &[])),
            ParseError::Malformed { .. }
        ));
    }
    // No items bound the width of a field; it is left out, and so there is no position.
    let error = READER.error(&npy("[('pos', '<f4', (1099511627776,))]", "(0,)", &[]));
    assert!(error.to_string().contains("no position"), "{error}");
    let long = [header::MAGIC, &[2, 0, 0xff, 0xff, 0xff, 0xff]].concat();
    assert!(READER.error(&long).to_string().contains("4294967295 bytes"));
}

#[test]
fn broken_headers_are_named() {
    for (dictionary, words) in [
        ("[]", "no dictionary"),
        ("{'shape': (1, 3), 'fortran_order': False}", "no descr"),
        ("{'descr': '<f4', 'shape': (1, 3)}", "no fortran_order"),
        (
            "{'descr': '<f4', 'fortran_order': 0, 'shape': (1, 3)}",
            "no fortran_order",
        ),
        ("{'descr': '<f4', 'fortran_order': False}", "no shape"),
        (
            "{'descr': '<f4', 'fortran_order': False, 'shape': ('a',)}",
            "no shape",
        ),
        (
            "{'descr': '<q4', 'fortran_order': False, 'shape': (1, 3)}",
            "`<q4` is no dtype",
        ),
        (
            "{'descr': '', 'fortran_order': False, 'shape': (1, 3)}",
            "`` is no dtype",
        ),
        (
            "{'descr': [('a',)], 'fortran_order': False, 'shape': (1,)}",
            "neither 2 nor 3",
        ),
        (
            "{'descr': ['a'], 'fortran_order': False, 'shape': (1,)}",
            "no tuple",
        ),
        ("{'descr' '<f4'}", "expected `:`"),
        ("{'descr': '<f4' 'shape'}", "expected `,`"),
        (
            "{'descr': __import__('os')}",
            "expected a value, found `__import__",
        ),
        ("{'descr': 'unfinished", "the end of a string"),
        ("{} {}", "the end of the npy header"),
    ] {
        let text = READER
            .error(&npy_version(1, dictionary, &[0; 64]))
            .to_string();
        assert!(text.contains(words), "{dictionary}: {text}");
    }
    let deep = READER
        .error(&npy_version(2, &"[".repeat(100_000), &[]))
        .to_string();
    assert!(deep.contains("less nesting"), "{deep}");
    assert!(
        READER
            .error(b"\x93NUMPX")
            .to_string()
            .contains("does not begin with")
    );
}

#[test]
fn strings_keep_their_escapes() {
    let text = r#"{u'a\'b\\': "c\x41\u00e9", b'n': None, 't': (True, -3, [])}"#;
    let parsed = literal::parse(text, 0).unwrap();
    let text = |s: &str| literal::Value::Text(s.to_owned());
    let items = vec![
        literal::Value::Bool(true),
        literal::Value::Integer(-3),
        literal::Value::Sequence(vec![]),
    ];
    let expected = vec![
        (text("a'b\\"), text("cAé")),
        (text("n"), literal::Value::None),
        (text("t"), literal::Value::Sequence(items)),
    ];
    assert_eq!(parsed, literal::Value::Dict(expected));
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
        npy(
            "[('pos', '<f4', (3,)), ('', '|V2'), ('id', '>u2')]",
            "(3,)",
            &[5; 48],
        ),
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
