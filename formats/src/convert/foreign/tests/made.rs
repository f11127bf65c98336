//! Generated files with cases that the sample files lack: axes of different types, two axes, integers, times, bits.

use super::*;

/// Streams `bytes` as a file named `name`; returns whether that was possible.
#[track_caller]
fn streams(name: &str, bytes: &[u8]) -> bool {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join(name);
    fs::write(&path, bytes).expect("writable");
    let raw = read_whole(&path).expect("a good file");
    let source = open_source(&path).expect("a good file");
    source.is_some_and(|source| {
        same(&*source, &raw);
        true
    })
}

/// This many bytes without a pattern.
fn noise(len: usize) -> Vec<u8> {
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state.to_be_bytes()[0]
    };
    (0..len).map(|_| next()).collect()
}

fn npy(descr: &str, fortran: &str, shape: &str, bytes: usize) -> Vec<u8> {
    let head = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    let mut file = b"\x93NUMPY\x01\0".to_vec();
    file.extend(u16::try_from(head.len()).expect("short").to_le_bytes());
    file.extend(head.bytes());
    file.extend(noise(bytes));
    file
}

#[test]
fn arrays_of_every_type_and_order() {
    const N: usize = 9001;
    for (code, size) in [
        ("|i1", 1),
        ("|u1", 1),
        ("<i2", 2),
        (">u2", 2),
        ("<i4", 4),
        (">u4", 4),
        ("<i8", 8),
        (">u8", 8),
        ("<f4", 4),
        (">f4", 4),
        ("<f8", 8),
        (">f8", 8),
    ] {
        let descr = format!("'{code}'");
        for (fortran, shape, numbers) in [
            ("False", "(9001, 3)", 3),
            ("True", "(9001, 3)", 3),
            ("False", "(3, 9001)", 3),
            ("False", "(9001, 2)", 2),
            ("True", "(1, 9001, 3)", 3),
        ] {
            let file = npy(&descr, fortran, shape, N * numbers * size);
            assert!(streams("a.npy", &file), "{code} {shape}");
        }
    }
}

#[test]
fn structures_with_odd_fields() {
    let descr = "[('id', '>u8'), ('x', '<f4'), ('y', '>f8'), ('m', '|i1', (3,)), ('z', '<i2'), ('s', '|S3')]";
    let each = 8 + 4 + 8 + 3 + 2 + 3;
    let file = npy(descr, "False", "(5000,)", 5000 * each);
    assert!(streams("a.npy", &file));
    assert!(streams("a.npy", &npy(descr, "False", "(0,)", 0)));
    assert!(streams("a.npy", &npy(descr, "False", "()", each)));
}

#[test]
fn arrays_of_several_steps_fall_back_to_the_reader() {
    assert!(!streams("a.npy", &npy("'<f4'", "False", "(2, 10, 3)", 240)));
}

#[test]
fn vertices_with_mixed_property_types() {
    for order in ["little", "big"] {
        let head = |list: &str| {
            format!(
                "ply\nformat binary_{order}_endian 1.0\nelement camera 3\nproperty int a\n{list}\
                 element vertex 5000\nproperty uchar red\nproperty float z\nproperty double x\n\
                 property short y\nproperty uchar green\nproperty uchar blue\nproperty int64 id\n\
                 end_header\n"
            )
        };
        let body = noise(12 + 5000 * (1 + 4 + 8 + 2 + 1 + 1 + 8));
        assert!(streams("a.ply", &[head("").into_bytes(), body].concat()));
    }
}

#[test]
fn vertices_with_lists_fall_back_to_the_reader() {
    let head = "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n\
                property float y\nproperty float z\nproperty list uchar float w\nend_header\n";
    let body = vec![0; 2 * 13];
    assert!(!streams("a.ply", &[head.as_bytes(), &body].concat()));
}

fn vtk(points: &str, point_bytes: usize, more: &[(&str, usize)]) -> Vec<u8> {
    let mut file = b"# vtk DataFile Version 4.1\ntitle\nBINARY\nDATASET POLYDATA\n".to_vec();
    file.extend(b"FIELD FieldData 1\nTIME 1 1 double\n");
    file.extend(2.5_f64.to_be_bytes());
    file.extend(format!("\nPOINTS {points}\n").bytes());
    file.extend(noise(point_bytes));
    for (line, bytes) in more {
        file.extend(format!("\n{line}\n").bytes());
        file.extend(noise(*bytes));
    }
    file
}

#[test]
fn legacy_files_with_time_and_cells() {
    const N: usize = 4500;
    let arrays: [(&str, usize); 5] = [
        ("VERTICES 1 4501", 4 * 4501),
        ("POINT_DATA 4500", 0),
        ("SCALARS id unsigned_int 1\nLOOKUP_TABLE default", 4 * N),
        ("FIELD FieldData 1\nq 5 4500 short", 10 * N),
        ("VECTORS velocity double", 24 * N),
    ];
    assert!(streams("a.vtk", &vtk("4500 float", 12 * N, &arrays)));
    assert!(streams("a.vtk", &vtk("4500 short", 6 * N, &[])));
    assert!(streams("a.vtk", &vtk("4500 int", 12 * N, &[])));
}

#[test]
fn legacy_files_with_bits_or_huge_width_fall_back_to_the_reader() {
    let bits = [("POINT_DATA 8", 0), ("SCALARS on bit", 1)];
    assert!(!streams("a.vtk", &vtk("8 float", 96, &bits)));
    let wide = [("POINT_DATA 0", 0), ("FIELD f 1\nwide 60000 0 float", 0)];
    assert!(!streams("a.vtk", &vtk("0 float", 0, &wide)));
}

#[test]
fn homogeneous_coordinates_are_divided_by_w() {
    const N: u32 = 5000;
    let mut file = b"BgeoV\0\0\0\x05".to_vec();
    for number in [N, 0, 0, 0, 2, 0, 0, 0] {
        file.extend(number.to_be_bytes());
    }
    for (name, components, kind) in [("v", 3_u16, 5_u32), ("id", 1, 1)] {
        file.extend(u16::try_from(name.len()).expect("short").to_be_bytes());
        file.extend(name.bytes());
        file.extend(components.to_be_bytes());
        file.extend(kind.to_be_bytes());
        file.extend(vec![0; 4 * usize::from(components)]);
    }
    for i in 0..N {
        let w = [1.0, 0.0, 3.0, 0.7][(i % 4) as usize];
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let i = i as f32;
        for number in [i, i * 0.1, -i, w, 1.0, 2.0, 3.0, 4.0] {
            file.extend(number.to_be_bytes());
        }
    }
    assert!(streams("a.bgeo", &file));
}
