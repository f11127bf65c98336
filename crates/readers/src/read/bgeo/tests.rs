//! Real BGEO files, and ones made by hand for what these do not have.

use proptest::prelude::*;

use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, mutate, names, numbers, sample};
use spherule_frame::AttributeData;

const READER: TestedReader = TestedReader {
    steps: |bytes| FORMAT.steps(bytes),
    read: |bytes, step| FORMAT.read(bytes, step),
};

/// A file with `count` points in its header, `definitions` and `points` as they are.
fn file(count: i32, attributes: i32, definitions: &[u8], points: &[u8]) -> Vec<u8> {
    let mut bytes = b"BgeoV".to_vec();
    for number in [5, count, 0, 0, 0, attributes, 0, 0, 0] {
        bytes.extend(i32::to_be_bytes(number));
    }
    bytes.extend(definitions);
    bytes.extend(points);
    bytes.extend([0, 0xff]);
    bytes
}

fn definition(name: &str, components: u16, kind: i32) -> Vec<u8> {
    let mut bytes = u16::try_from(name.len()).unwrap().to_be_bytes().to_vec();
    bytes.extend(name.as_bytes());
    bytes.extend(components.to_be_bytes());
    bytes.extend(kind.to_be_bytes());
    bytes.extend(vec![0xff; 4 * usize::from(components)]);
    bytes
}

fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
}

#[test]
fn reads_files_of_partio() {
    let particles = READER.one(&sample("public_partio/test.bgeo"));
    let expected: Vec<[f64; 3]> =
        [[0.0, 0.1, 0.2], [0.1, 0.2, 0.3], [0.2, 0.3, 0.4], [0.3, 0.4, 0.5], [0.4, 0.5, 0.6]]
            .map(|p: [f32; 3]| p.map(f64::from))
            .to_vec();
    assert_eq!(coordinates(&particles.positions), expected);
    let life = attribute(&particles, "life");
    assert_eq!(life.components, 2);
    let lives: Vec<f32> = vec![-1.2, 10.0, -0.2, 10.0, 0.8, 10.0, 1.8, 10.0, 2.8, 10.0];
    assert_eq!(life.data, AttributeData::F32(lives));
    let ids = attribute(&particles, "id");
    assert_eq!(ids.data, AttributeData::I32(vec![0, 1, 2, 3, 4]));
}

#[test]
fn reads_every_public_sample() {
    for (name, count, attributes) in [
        ("base", 5, 2),
        ("baseidsfaceid", 8, 2),
        ("delta", 3, 3),
        ("json", 5, 3),
        ("scatter", 25, 3),
    ] {
        let particles = READER.one(&sample(&format!("public_partio/{name}.bgeo")));
        assert_eq!(particles.positions.len(), count, "{name}");
        assert_eq!(particles.attributes.len(), attributes, "{name}");
    }
}

#[test]
fn indexed_strings_are_their_indices() {
    let particles = READER.one(&sample("public_partio/scatter.bgeo"));
    assert_eq!(names(&particles), ["id", "Cd", "test"]);
    assert_eq!(attribute(&particles, "Cd").components, 3);
    let AttributeData::I32(indices) = &attribute(&particles, "test").data else {
        panic!("indices are i32");
    };
    assert_eq!(indices[..5], [0, 1, 0, 0, 2]);
    assert!(indices.iter().all(|i| (0..3).contains(i)));
}

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn names_keep_their_spaces_and_velocity_is_a_vector() {
    let particles = READER.one(&sample("emitter_sph/ParticleData_Fluid_3.bgeo"));
    assert_eq!(names(&particles), ["id", "density", "velocity", "pressure acceleration"]);
    assert_eq!(particles.positions.len(), 90);
    let velocity = attribute(&particles, "velocity");
    assert_eq!((velocity.components, velocity.data.len()), (3, 270));
    assert_eq!(numbers(&velocity.data)[..3], [2.5, 0.0, 0.0]);
    let AttributeData::I32(ids) = &attribute(&particles, "id").data else {
        panic!("ids are i32");
    };
    assert_eq!(*ids, (0..90).collect::<Vec<i32>>());
}

#[test]
fn a_file_before_the_emitter_starts_is_empty() {
    let particles = READER.one(&sample("emitter_sph/ParticleData_Fluid_1.bgeo"));
    assert!(particles.positions.is_empty());
    assert_eq!(particles.attributes.len(), 4);
}

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn reads_the_splashsurf_dam_break() {
    let bytes = sample("public_splashsurf/dam_break_frame_9_6859_particles.bgeo");
    let particles = READER.one(&bytes);
    assert_eq!(particles.positions.len(), 6859);
    assert!(coordinates(&particles.positions).as_flattened().iter().all(|c| c.abs() < 10.0));
    let end_of_points = bytes.len() - 2;
    READER.survives_truncation(&bytes, &[5, 9, 13, 41, 42, end_of_points], end_of_points);
}

#[test]
fn no_attributes_are_valid() {
    let particles = READER.one(&file(1, 0, &[], &floats(&[1.0, 2.0, 3.0, 1.0])));
    assert_eq!(coordinates(&particles.positions), [[1.0, 2.0, 3.0]]);
    assert!(particles.attributes.is_empty());
}

#[test]
fn w_divides_unless_it_is_zero_or_one() {
    let points = floats(&[2.0, 4.0, 6.0, 2.0, 2.0, 4.0, 6.0, 0.0, 2.0, 4.0, 6.0, 1.0]);
    let particles = READER.one(&file(3, 0, &[], &points));
    assert_eq!(
        coordinates(&particles.positions),
        [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [2.0, 4.0, 6.0]]
    );
}

#[test]
fn float_triples_and_vectors_are_alike() {
    let point = floats(&[0.0, 0.0, 0.0, 1.0, 7.0, 8.0, 9.0]);
    let read = |kind| READER.one(&file(1, 1, &definition("v", 3, kind), &point));
    assert_eq!(read(0), read(5));
    assert_eq!(numbers(&attribute(&read(0), "v").data), [7.0, 8.0, 9.0]);
}

#[test]
fn related_formats_are_rejected_by_name() {
    for (bytes, words) in [
        (&b"\x7fNSJb"[..], "binary json"),
        (b"scf1....", "blosc"),
        (&sample("public_partio/test.geo"), "text form"),
        (b"[\n\"fileversion\"", "text json"),
        (b"BgeoV\0\0\0\x04", "version 4"),
    ] {
        let error = READER.error(bytes);
        assert!(matches!(error, ParseError::Unsupported { .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains(words) && text.contains("bhclassic"), "{text}");
        assert_eq!(FORMAT.steps(bytes), Err(error));
    }
    assert!(matches!(
        READER.error(&sample("public_partio/test.pdb")),
        ParseError::Malformed { at: 0, .. }
    ));
}

#[test]
fn string_attributes_are_rejected() {
    let error = READER.error(&file(0, 1, &definition("s", 1, 2), &[]));
    assert!(error.to_string().contains("`s` is of type string"), "{error}");
    let error = READER.error(&file(0, 1, &definition("s", 1, 77), &[]));
    assert!(matches!(error, ParseError::Malformed { at: 46, .. }), "{error}");
}

#[test]
fn huge_counts_are_rejected() {
    let absurd_strings = {
        let mut bytes = definition("s", 1, 4);
        let end = bytes.len() - 4;
        bytes.truncate(end);
        bytes.extend(i32::MAX.to_be_bytes());
        bytes
    };
    for (bytes, at) in [
        (file(i32::MAX, 0, &[], &[]), 41),
        (file(-1, 0, &[], &[]), 9),
        (file(0, i32::MAX, &[], &[]), 43),
        (file(0, -7, &[], &[]), 25),
        (file(0, 1, &absurd_strings, &[]), 56),
    ] {
        let error = READER.error(&bytes);
        assert!(matches!(error, ParseError::Malformed { at: found, .. } if found == at), "{error}");
    }
    let text = READER.error(&file(i32::MAX, 0, &[], &[])).to_string();
    assert_eq!(text, "byte 41: 2147483647 particles need 34359738352 bytes, file has 2 left");
}

#[test]
fn error_offsets_are_inside_truncated_files() {
    let one = file(1, 1, &definition("s", 1, 0), &[]);
    let none = file(1, 0, &[], &[]);
    for whole in [one, none] {
        for len in 5..whole.len() {
            READER.error_inside(&whole[..len]);
        }
    }
}

#[test]
fn names_from_the_file_are_escaped() {
    let error = READER.error(&file(0, 1, &definition("\u{1b}[2J\n", 1, 77), &[]));
    assert!(error.to_string().contains(r"`\u{1b}[2J\n`"), "{error}");
}

#[test]
fn width_without_points_is_rejected() {
    let mut wide = definition("s", 0, 4);
    wide[3..5].copy_from_slice(&u16::MAX.to_be_bytes());
    wide.extend([0; 4]);
    let many: Vec<u8> = wide.repeat(1000);
    let particles = READER.one(&file(0, 1000, &many, &[]));
    assert!(particles.attributes.is_empty());
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = READER.all(&bytes);
        let _ = READER.all(&[b"BgeoV\0\0\0\x05\0\0\0".as_slice(), &bytes].concat());
    }

    #[test]
    fn mutations_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let _ = READER.all(&mutate(&sample("public_partio/scatter.bgeo"), &changes));
    }
}
