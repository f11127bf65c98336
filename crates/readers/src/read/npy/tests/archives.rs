//! Archives of arrays: which member is what, and pickles.

use super::*;

#[test]
fn archives_contain_the_same_particles() {
    let ply = crate::read::ply::FORMAT.read(&single("le.ply"), &Step::whole(0)).unwrap();
    let plain = READER.one(&single("plain.npz"));
    assert_eq!(plain.positions, ply.positions);
    assert_eq!(names(&plain), ["velocities", "ids", "density"]);
    assert_eq!(attribute(&plain, "velocities").components, 3);
    assert_eq!(attribute(&plain, "velocities").data, attribute(&ply, "velocity").data);
    assert_eq!(attribute(&plain, "ids").data, attribute(&ply, "id").data);
    assert!(plain.time.is_some());
    assert_eq!(steps(&single("plain.npz")).unwrap()[0].time, plain.time);
    assert_eq!(READER.one(&single("compressed.npz")), plain);
}

#[test]
fn pysph_archives_are_rejected_by_name() {
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
fn pickles_are_rejected_only_where_needed() {
    let pickle = || npy("'|O'", "(3,)", b"\x80\x04.");
    for bytes in [
        pickle(),
        npy("[('pos', '<f4', (3,)), ('tag', '|O')]", "(1,)", &[0; 20]),
        stored(&[("arr_0.npy", pickle())]),
        stored(&[("positions.npy", pickle()), ("a.npy", three())]),
        stored(&[("b.npy", pickle()), ("a.npy", npy("'<f4'", "(3,)", &counting(3)))]),
    ] {
        let text = READER.error(&bytes).to_string();
        assert!(text.contains("never unpickled; save plain arrays with numpy.savez"), "{text}");
    }
    let beside = stored(&[("meta.npy", pickle()), ("pos.npy", three())]);
    assert!(READER.one(&beside).attributes.is_empty());
}

#[test]
fn archives_find_their_positions() {
    let line =
        |first: f32| npy("'<f8'", "(2,)", &[f64::from(first), 9.0].map(f64::to_le_bytes).concat());
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
    assert_eq!(coordinates(&particles.positions), [[1.0, 2.0, 3.0], [9.0; 3]]);
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
    assert_eq!(numbers(&attribute(&particles, "vel").data)[..3], [0.0, 4.0, 8.0]);
    assert_eq!(numbers(&attribute(&particles, "force").data)[..3], [0.0, 1.0, 2.0]);
    assert_eq!(attribute(&particles, "stress").components, 2);

    let only = npz(&[("arr_0.npy", three())], CompressionMethod::Deflated);
    assert_eq!(READER.one(&only).positions.len(), 3);
    let none = stored(&[("a.npy", three()), ("b.npy", npy("'<f4'", "()", &counting(1)))]);
    let text = READER.error(&none).to_string();
    assert!(text.contains("[a (3, 3), b ()]: save an (N, 3) array named positions"), "{text}");
    assert!(matches!(READER.error(&stored(&[])), ParseError::Unsupported { .. }));
}

#[test]
fn damaged_archives_are_rejected() {
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let good = npz(&[("pos.npy", npy("'<f4'", "(30, 3)", &counting(90)))], method);
        assert_eq!(READER.one(&good).positions.len(), 30);
        // A changed byte of the contents, which end before the central directory.
        let directory = good.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        let mut changed = good.clone();
        changed[directory - 8] ^= 0x55;
        assert!(matches!(READER.error(&changed), ParseError::Malformed { .. }));
        // The uncompressed size in the central directory.
        for size in [0_u32, 300, 0x7fff_ffff] {
            let mut changed = good.clone();
            changed[directory + 24..directory + 28].copy_from_slice(&size.to_le_bytes());
            let error = READER.error(&changed);
            assert!(matches!(error, ParseError::Malformed { .. }), "{size}: {error}");
        }
        for cut in 0..good.len() {
            assert!(READER.all(&good[..cut]).is_err(), "cut at {cut}");
        }
    }
    let mut other_method = stored(&[("pos.npy", three())]);
    let directory = other_method.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
    other_method[directory + 10] = 12;
    let error = READER.error(&other_method);
    assert!(matches!(error, ParseError::Unsupported { .. }), "{error}");
}

#[test]
fn member_names_are_escaped() {
    let name = format!("\u{1b}[2J\n{}.npy", "x".repeat(5000));
    for array in [b"\x93NUMPY\x09".to_vec(), b"\x93NUMPY\x01".to_vec()] {
        let text = READER.error(&stored(&[(&name, array)])).to_string();
        assert!(text.contains(r"member \u{1b}[2J\nxxx"), "{text}");
    }
}
