//! Single arrays: types, shapes, structures, the header's literal.

use super::*;

#[test]
fn all_single_arrays_contain_the_same_particles() {
    let expected = READER.one(&single("pos.npy"));
    assert_eq!(expected.positions.len(), 1200);
    assert!(expected.attributes.is_empty());
    let ply = crate::read::ply::FORMAT.read(&single("le.ply"), &Step::whole(0)).unwrap();
    assert_eq!(expected.positions, ply.positions);
    assert_eq!(READER.one(&single("fortran.npy")), expected);

    let wide = READER.one(&single("f64.npy"));
    assert!(matches!(wide.positions, Positions::F64(_)));
    assert_eq!(coordinates(&wide.positions), coordinates(&expected.positions));

    let records = READER.one(&single("struct.npy"));
    assert_eq!(records.positions, expected.positions);
    assert_eq!(names(&records), ["vel", "id"]);
    assert_eq!(attribute(&records, "vel").data, attribute(&ply, "velocity").data);
    assert_eq!(attribute(&records, "id").data, attribute(&ply, "id").data);
}

#[test]
fn array_shapes_are_recognised() {
    let rows = [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]];
    for (shape, count, expected) in [
        ("(2, 3)", 6, vec![rows[0], rows[1]]),
        ("(3, 3)", 9, rows.to_vec()),
        ("(3, 1)", 3, vec![rows[0]]),
        ("(3, 4)", 12, vec![[0.0, 4.0, 8.0], [1.0, 5.0, 9.0], [2.0, 6.0, 10.0], [3.0, 7.0, 11.0]]),
        ("(2, 2)", 4, vec![[0.0, 1.0, 0.0], [2.0, 3.0, 0.0]]),
        ("(3L, 2L)", 6, vec![[0.0, 1.0, 0.0], [2.0, 3.0, 0.0], [4.0, 5.0, 0.0]]),
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
    for shape in ["()", "(3,)", "(5, 7)", "(2, 4)", "(1, 2, 4)", "(1, 1, 2, 3)"] {
        let error = READER.error(&npy("'<f4'", shape, &counting(64)));
        assert!(error.to_string().contains("save shape (N, 3)"), "{shape}: {error}");
    }
    let text = READER.error(&npy("'<f4'", "(3,)", &counting(3))).to_string();
    assert!(text.starts_with("an array of shape (3,) is not a list of positions"), "{text}");
}

#[test]
fn leading_dimension_is_time() {
    let expected =
        [vec![[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]], vec![[6.0, 7.0, 8.0], [9.0, 10.0, 11.0]]];
    let check = |bytes: &[u8]| {
        let all = READER.all(bytes).unwrap();
        let found: Vec<_> = all.iter().map(|p| coordinates(&p.positions)).collect();
        assert_eq!(found, expected);
        let late = Step::with_key(2, 2);
        assert!(matches!(read(bytes, &late), Err(ParseError::Malformed { .. })));
    };
    check(&npy("'<f4'", "(2, 2, 3)", &counting(12)));
    // frame + 2 * particle + 4 * coordinate
    let fortran = [0, 6, 3, 9, 1, 7, 4, 10, 2, 8, 5, 11].map(|n: u8| f32::from(n));
    let dictionary = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 2, 3), }";
    check(&npy_version(1, dictionary, &f32s(fortran)));
    check(&npy("[('x', '<f4'), ('y', '<f4'), ('z', '<f4')]", "(2, 2)", &counting(12)));

    let archive = stored(&[
        ("pos.npy", npy("'<f4'", "(2, 2, 3)", &counting(12))),
        ("times.npy", npy("'<f8'", "(2,)", &[1.5_f64, 2.5].map(f64::to_le_bytes).concat())),
        ("rho.npy", npy("'<f4'", "(2, 2)", &counting(4))),
        ("ids.npy", npy("'<u2'", "(2,)", &[7, 0, 9, 0])),
    ]);
    check(&archive);
    let times: Vec<_> = steps(&archive).unwrap().iter().map(|s| s.time).collect();
    // A (2,) array named `times` belongs to the steps; `ids` has one number per particle.
    assert_eq!(times, [Some(1.5), Some(2.5)]);
    let second = &READER.all(&archive).unwrap()[1];
    assert_eq!(second.time, Some(2.5));
    assert_eq!(names(second), ["rho", "ids"]);
    assert_eq!(numbers(&attribute(second, "rho").data), [2.0, 3.0]);
    assert_eq!(attribute(second, "ids").data, AttributeData::U16(vec![7, 9]));
}

#[test]
fn number_types_and_versions_are_supported() {
    let one = |descr: &str, data: &[u8]| READER.one(&npy(descr, "(1, 3)", data)).positions;
    let expected = [[1.0, -2.0, 3.5]];
    let big: Vec<u8> = [1.0_f32, -2.0, 3.5].map(f32::to_be_bytes).concat();
    assert_eq!(coordinates(&one("'>f4'", &big)), expected);
    let big: Vec<u8> = [1.0_f64, -2.0, 3.5].map(f64::to_be_bytes).concat();
    assert_eq!(coordinates(&one("'>f8'", &big)), expected);
    let exact: Vec<u8> = [i64::from(i32::MAX), -1, 5].map(i64::to_le_bytes).concat();
    assert_eq!(coordinates(&one("'<i8'", &exact)), [[2_147_483_647.0, -1.0, 5.0]]);
    assert_eq!(one("'|u1'", &[1, 2, 255]), Positions::F32(vec![Vec3::new(1.0, 2.0, 255.0)]));
    for descr in ["'<f2'", "'<c16'", "'|S4'", "'<U2'", "'<f16'", "'<M8[ns]'", "'|V12'"] {
        let error = READER.error(&npy(descr, "(1, 3)", &[0; 64]));
        assert!(matches!(error, ParseError::Unsupported { .. }), "{descr}: {error}");
    }
    let dictionary = r#"{"shape": (1, 3), "fortran_order": False, "descr": "<f4"}"#;
    for major in [1, 2, 3] {
        let bytes = npy_version(major, dictionary, &counting(3));
        assert_eq!(coordinates(&READER.one(&bytes).positions), [[0.0, 1.0, 2.0]]);
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
    assert_eq!(coordinates(&particles.positions), vec![[1.0, 2.0, 3.0]; 5000]);
    assert_eq!(names(&particles), ["id", "inner.a", "inner.b", "m", "velocity"]);
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
    assert!(error.to_string().contains("among its fields [a, b]"), "{error}");
}

#[test]
fn strings_keep_their_escapes() {
    let text = r#"{u'a\'b\\': "c\x41\u00e9", b'n': None, 't': (True, -3, [])}"#;
    let parsed = literal::parse(text, str::len).unwrap();
    let text = |s: &str| literal::Literal::Text(s.to_owned());
    let items = vec![
        literal::Literal::Bool(true),
        literal::Literal::Integer(-3),
        literal::Literal::Sequence(vec![]),
    ];
    let expected = vec![
        (text("a'b\\"), text("cAé")),
        (text("n"), literal::Literal::None),
        (text("t"), literal::Literal::Sequence(items)),
    ];
    assert_eq!(parsed, literal::Literal::Dict(expected));
}

#[test]
fn error_offsets_are_in_bytes() {
    // Bytes above 127: one character each before version 3, of two bytes in memory.
    let place = |version: u8| {
        let text = format!("{{'{}': ?", "\u{e9}".repeat(20));
        let mut bytes = npy_version(version, "", &[]);
        let text: Vec<u8> = match version {
            1 => text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect(),
            _ => [text.as_bytes(), b"\xff"].concat(),
        };
        let start = if version == 1 { 10 } else { 12 };
        bytes.truncate(start);
        bytes[8..10].copy_from_slice(&u16::try_from(text.len()).unwrap().to_le_bytes());
        bytes.extend(&text);
        let ParseError::Malformed { at, what } = READER.error_inside(&bytes) else {
            panic!("a header that breaks off");
        };
        assert!(what.contains("expected a value"), "{what}");
        bytes[usize::try_from(at).unwrap()]
    };
    assert_eq!((place(1), place(3)), (b'?', b'?'));
}

#[test]
fn names_from_the_file_are_escaped() {
    let dtype = r"[('a\n\x1b[2J', '<f4'), ('b', '<f4')]";
    let text = READER.error(&npy(dtype, "(1,)", &[0; 8])).to_string();
    assert!(text.contains(r"[a\n\u{1b}[2J, b]"), "{text}");
    let fields: String = (0..300).map(|i| format!("('{i}', '<f4'), ")).collect();
    let text = READER.error(&npy_version(
        2,
        &format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': (0,)}}"),
        &[],
    ));
    assert!(text.to_string().contains("characters left out"), "{text}");
}
