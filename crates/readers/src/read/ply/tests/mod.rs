//! PLY files made by hand, in every shape that writers give them.

mod damage;

use proptest::prelude::*;

use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, mutate, names, numbers, sample};
use crate::read::pieces;
use spherule_frame::{AttributeData, MemoryBudget, Positions};

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(FORMAT, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(FORMAT, bytes, step)
}

const READER: TestedReader = TestedReader { steps, read };

fn single(name: &str) -> Vec<u8> {
    sample(&format!("single_frames/{name}.ply"))
}

/// A header with these lines between `ply` and `end_header`.
fn header(lines: &[&str]) -> Vec<u8> {
    format!("ply\n{}\nend_header\n", lines.join("\n")).into_bytes()
}

/// An ascii file: header lines without the format, then the body.
fn ascii(lines: &[&str], body: &str) -> Vec<u8> {
    let mut bytes = header(&[&["format ascii 1.0"], lines].concat());
    bytes.extend(body.as_bytes());
    bytes
}

const XYZ: [&str; 3] = ["property float x", "property float y", "property float z"];

fn vertices(count: &str, more: &[&str]) -> Vec<String> {
    let first = [format!("element vertex {count}")];
    let rest = XYZ.iter().chain(more).map(|line| (*line).to_owned());
    first.into_iter().chain(rest).collect()
}

fn points(count: &str, more: &[&str], body: &str) -> Vec<u8> {
    let lines = vertices(count, more);
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    ascii(&lines, body)
}

#[test]
fn all_encodings_contain_the_same_particles() {
    let expected = READER.one(&single("le"));
    assert_eq!(expected.positions.len(), 1200);
    assert_eq!(names(&expected), ["velocity", "id"]);
    assert!(matches!(attribute(&expected, "id").data, AttributeData::U32(_)));
    assert_eq!(attribute(&expected, "velocity").components, 3);
    assert_eq!(READER.one(&single("be")), expected);
    // Nine digits distinguish any two f32, so even the text is exact.
    assert_eq!(READER.one(&single("ascii")), expected);

    let color = READER.one(&single("color"));
    assert_eq!(color.positions, expected.positions);
    assert_eq!(color.attributes[..2], expected.attributes);
    assert_eq!(names(&color), ["velocity", "id", "color"]);
    assert!(matches!(&attribute(&color, "color").data, AttributeData::U8(v) if v.len() == 3600));

    let double = READER.one(&single("double"));
    assert!(matches!(double.positions, Positions::F64(_)));
    let (wide, narrow) = (coordinates(&double.positions), coordinates(&expected.positions));
    assert_eq!(wide, narrow);
    assert_eq!(double.attributes, expected.attributes);
}

/// The particles of `bytes`, vertices of meshes among them.
fn with_mesh_points(bytes: &[u8]) -> RawParticles {
    let mut source = ByteSource::whole(bytes);
    source.set_mesh_points(true);
    let step = Step::whole(bytes.len());
    FORMAT.read_within(&mut source, &step, MemoryBudget::UNLIMITED).expect("a mesh")
}

#[test]
fn vertices_of_meshes_are_particles_if_they_are_asked_for() {
    let found = with_mesh_points(&sample("public_splashsurf/cube_normals.ply"));
    assert_eq!((found.positions.len(), names(&found)), (24, vec!["normal", "s", "t"]));
    assert_eq!(found.notes, ["a mesh with 12 faces: its vertices are read as particles"]);
    // Faces before the vertices, and points without any
    let header = "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 2\n\
                  property float x\nproperty float y\nproperty float z\nend_header\n3 0 1 0\n1 2 3\n4 5 6\n";
    let found = with_mesh_points(header.as_bytes());
    assert_eq!(coordinates(&found.positions), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert!(with_mesh_points(&points("1", &[], "1 2 3\n")).notes.is_empty());
}

#[test]
fn mesh_is_rejected() {
    let error = READER.error(&sample("public_splashsurf/cube_normals.ply"));
    assert_eq!(
        error,
        ParseError::unsupported(
            "a mesh with 12 faces, not particles: draw it with --mesh, or read its vertices as particles with \
             --mesh-points (input.mesh_points = true)"
        )
    );
    let strips = points(
        "1",
        &["element tristrips 1", "property list int int vertex_indices"],
        "1 2 3\n3 0 0 0\n",
    );
    let error = READER.error(&strips).to_string();
    assert!(
        error.starts_with("a mesh with triangle strips, not particles: read its vertices"),
        "{error}"
    );
    let faceless =
        points("1", &["element face 0", "property list uchar int vertex_indices"], "1 2 3\n");
    assert_eq!(READER.one(&faceless).positions.len(), 1);
}

#[test]
fn properties_come_in_any_order_and_type() {
    let bytes = ascii(
        &[
            "comment made by hand",
            "element vertex 2",
            "property float32 nz",
            "property double z",
            "property uint8 red",
            "property float32 nx",
            "property float32 x",
            "obj_info whatever",
            "property uint8 blue",
            "property float32 ny",
            "property int16 y",
            "property uint8 green",
            "property uint8 alpha",
            "property float scalar_Density",
        ],
        "0.3 3.5 10 0.1 1.5 30 0.2 -2 20 40 1000\n-0.3 1e300 11 -0.1 nan 31 -0.2 2 21 41 -1.#INF\n",
    );
    let particles = READER.one(&bytes);
    let found = coordinates(&particles.positions);
    assert_eq!(found[0], [1.5, -2.0, 3.5]);
    assert!(found[1][0].is_nan() && found[1][2] == 1e300);
    assert_eq!(names(&particles), ["normal", "color", "Density"]);
    let normal = attribute(&particles, "normal");
    assert_eq!(normal.data, AttributeData::F32(vec![0.1, 0.2, 0.3, -0.1, -0.2, -0.3]));
    let color = attribute(&particles, "color");
    assert_eq!(color.data, AttributeData::U8(vec![10, 20, 30, 40, 11, 21, 31, 41]));
    let density = attribute(&particles, "Density");
    assert_eq!(density.data, AttributeData::F32(vec![1000.0, f32::NEG_INFINITY]));
}

#[test]
fn unrelated_components_are_not_joined() {
    let particles = READER.one(&points(
        "1",
        &[
            "property float u",
            "property float v",
            "property float w",
            "property float vx",
            "property double vy",
            "property float vz",
        ],
        "0 0 0 1 2 3 4 5 6",
    ));
    assert_eq!(names(&particles), ["u", "v", "w", "vx", "vy", "vz"]);
    let open3d =
        ["property float scalar_vx", "property float scalar_vy", "property float scalar_vz"];
    let particles = READER.one(&points("1", &open3d, "0 0 0 4 5 6"));
    assert_eq!(numbers(&attribute(&particles, "velocity").data), [4.0, 5.0, 6.0]);
}

/// Two cameras with a list, then two vertices with a list in the middle.
fn with_lists(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = header(&[
        &format!("format binary_{order}_endian 1.0"),
        "element camera 2",
        "property list ushort double lens",
        "property uchar on",
        "element vertex 2",
        "property float x",
        "property list uchar short ring",
        "property float y",
        "property float z",
    ]);
    let two = |n: u16| {
        if big { n.to_be_bytes() } else { n.to_le_bytes() }
    };
    let four = |n: f32| {
        if big { n.to_be_bytes() } else { n.to_le_bytes() }
    };
    bytes.extend(two(1));
    bytes.extend([7; 8]);
    bytes.push(1);
    bytes.extend(two(0));
    bytes.push(0);
    for vertex in [1.0, 4.0] {
        bytes.extend(four(vertex));
        bytes.push(2);
        bytes.extend([9; 4]);
        bytes.extend(four(vertex + 1.0));
        bytes.extend(four(vertex + 2.0));
    }
    bytes
}

#[test]
fn lists_before_and_within_vertices_are_skipped() {
    for big in [false, true] {
        let bytes = with_lists(big);
        let particles = READER.one(&bytes);
        assert_eq!(coordinates(&particles.positions), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert!(particles.attributes.is_empty());
        for cut in 0..bytes.len() {
            assert!(READER.all(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }
    let text = ascii(
        &[
            "element camera 1",
            "property list uchar int lens",
            "element vertex 1",
            "property float x",
            "property list uchar int ring",
            "property float y",
            "property float z",
        ],
        "2 8 9\n\n1 3 7 7 7 2 3\n",
    );
    assert_eq!(coordinates(&READER.one(&text).positions), [[1.0, 2.0, 3.0]]);
}

#[test]
fn line_ends_do_not_shift_the_data() {
    let body: Vec<u8> =
        [0x0a0d_0a0d_u32, 0x0d0a_0d0a, 0x0a0a_0a0a].iter().flat_map(|n| n.to_le_bytes()).collect();
    let lines = "ply\nformat binary_little_endian 1.0  \nelement vertex 1\nproperty float x\n\
                 property float y\nproperty float z\nend_header\n";
    let expected: Vec<[f64; 3]> =
        vec![[0x0a0d_0a0d, 0x0d0a_0d0a, 0x0a0a_0a0a].map(|n| f64::from(f32::from_bits(n)))];
    for end in ["\n", "\r\n", "\r"] {
        let mut bytes = lines.replace('\n', end).into_bytes();
        bytes.extend(&body);
        let particles = READER.one(&bytes);
        assert_eq!(coordinates(&particles.positions), expected, "{end:?}");
    }
    let text = points("2", &[], "1 2 3\n4 5 6\n");
    let dos = String::from_utf8(text.clone()).unwrap().replace('\n', "\r\n");
    assert_eq!(READER.one(dos.as_bytes()), READER.one(&text));
}

#[test]
fn zero_vertices_are_valid() {
    let empty = READER.one(&points("0", &["property float vx"], ""));
    assert!(empty.positions.is_empty());
    assert_eq!(names(&empty), ["vx"]);
}

/// What the writer of the round trip was given: position, velocity, density, id of each particle.
type Row = ([f64; 3], [f32; 3], f32, i32);

fn write(rows: &[Row], big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = header(&[
        &format!("format binary_{order}_endian 1.0"),
        &format!("element vertex {}", rows.len()),
        "property int id",
        "property double x",
        "property double y",
        "property double z",
        "property float density",
        "property float vx",
        "property float vy",
        "property float vz",
    ]);
    let mut push = |mut number: Vec<u8>| {
        if big {
            number.reverse();
        }
        bytes.extend(number);
    };
    for (position, velocity, density, id) in rows {
        push(id.to_le_bytes().to_vec());
        position.iter().for_each(|c| push(c.to_le_bytes().to_vec()));
        push(density.to_le_bytes().to_vec());
        velocity.iter().for_each(|c| push(c.to_le_bytes().to_vec()));
    }
    bytes
}

proptest! {
    #[test]
    fn binary_round_trips(
        seed in prop::collection::vec((any::<[i32; 3]>(), any::<[i16; 3]>(), any::<i16>(), any::<i32>()), 0..40),
        copies in 1..300_usize,
        big in any::<bool>(),
    ) {
        let row = |(p, v, d, id): &([i32; 3], [i16; 3], i16, i32)| -> Row {
            (p.map(|c| f64::from(c) * 1e-3 + 1e6), v.map(f32::from), f32::from(*d), *id)
        };
        // Repeated past the size of a decoding block.
        let rows: Vec<Row> = seed.iter().map(row).collect::<Vec<_>>().repeat(copies);
        let particles = READER.one(&write(&rows, big));
        prop_assert_eq!(names(&particles), ["id", "density", "velocity"]);
        let expected: Vec<[f64; 3]> = rows.iter().map(|r| r.0).collect();
        prop_assert_eq!(coordinates(&particles.positions), expected);
        let expected: Vec<f32> = rows.iter().flat_map(|r| r.1).collect();
        prop_assert_eq!(&attribute(&particles, "velocity").data, &AttributeData::F32(expected));
        let expected: Vec<f32> = rows.iter().map(|r| r.2).collect();
        prop_assert_eq!(&attribute(&particles, "density").data, &AttributeData::F32(expected));
        let expected: Vec<i32> = rows.iter().map(|r| r.3).collect();
        prop_assert_eq!(&attribute(&particles, "id").data, &AttributeData::I32(expected));
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = READER.all(&bytes);
        let _ = READER.all(&[b"ply\n".as_slice(), &bytes].concat());
        for big in [false, true] {
            let file = with_lists(big);
            let body = PlyHeader::parse(&file).unwrap().body;
            let _ = READER.all(&[&file[..body], &bytes].concat());
        }
    }

    #[test]
    fn mutations_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let _ = READER.all(&mutate(&with_lists(false), &changes));
        let text = points("3", &["property list uchar int l", "property int id"], "1 2 3 1 2 3\n4 5 6 0 7\n7 8 9 2 1 2 8");
        let _ = READER.all(&mutate(&text, &changes));
    }
}
