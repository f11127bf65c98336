//! Damage and variants. `formats/tests/reference.rs` reads whole files.

use proptest::prelude::*;

use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, mutate, names, numbers, sample};

const READER: TestedReader = TestedReader {
    steps: |bytes| FORMAT.steps(bytes),
    read: |bytes, step| FORMAT.read(bytes, step),
};

/// The sample `name` with `new` in place of the first `old`.
fn changed(name: &str, old: &str, new: &str) -> Vec<u8> {
    let mut bytes = sample(&format!("dualsphysics/{name}"));
    let places = bytes.windows(old.len());
    let at = places.into_iter().position(|w| w == old.as_bytes()).expect("it is there");
    bytes.splice(at..at + old.len(), new.bytes());
    bytes
}

#[test]
fn types_follow_from_the_ids() {
    let particles = READER.one(&sample("dualsphysics/Part_0000.bi4"));
    assert_eq!(names(&particles), ["Idp", "Vel", "Rhop", "radius", "part"]);
    let ids = numbers(&attribute(&particles, "Idp").data);
    let parts = numbers(&attribute(&particles, "part").data);
    for (id, part) in ids.into_iter().zip(parts) {
        let expected = match id {
            0.0..7.0 => 0.0,
            7.0..11.0 => 1.0,
            11.0..14.0 => 2.0,
            _ => 3.0,
        };
        assert_eq!(part, expected, "{id}");
    }
    assert_eq!(attribute(&particles, "radius").data, AttributeData::F32(vec![0.01; 30]));
    assert_eq!((particles.time, particles.step), (Some(0.0), Some(0)));
    // Without the numbers of the case
    let particles = READER.one(&changed("Part_0000.bi4", "CaseNmoving", "CaseMmoving"));
    assert_eq!(names(&particles), ["Idp", "Vel", "Rhop", "radius"]);
}

#[test]
fn both_byte_orders_are_alike() {
    let little = READER.one(&sample("dualsphysics/Part_0000.bi4"));
    let big = READER.one(&sample("dualsphysics/big-endian.bi4"));
    assert_eq!(little.attributes, big.attributes);
    assert_eq!(coordinates(&little.positions), coordinates(&big.positions));
}

#[test]
fn notes_name_program_and_pieces() {
    let notes = Bi4.notes(&sample("dualsphysics/Part_p00_0003.bi4"));
    assert_eq!(notes[0], "written by DualSPHysics5 v5.4.355");
    assert!(notes[1].starts_with("attribute `part` is the type"), "{}", notes[1]);
    assert!(notes[2].ends_with("Dp = 0.02"), "{}", notes[2]);
    assert!(notes[3].starts_with("the file is one of 2 pieces"), "{}", notes[3]);
    assert!(Bi4.notes(b"#FileJBD JPartDataBi4").is_empty());
}

#[test]
fn other_content_is_refused_by_name() {
    for (name, content) in [
        ("Part_Head.ibi4", "JPartDataHead"),
        ("Part_Info", "JPartDataBi4_Info"),
        ("PartOut_000.obi4", "JPartOutBi4Save"),
    ] {
        let head = format!("#FileJBD {content:49}\n\0");
        let error = Bi4.sniff(head.as_bytes()).expect_err(name).to_string();
        assert!(error.contains(content) && error.contains("Part_####.bi4"), "{error}");
    }
}

#[test]
fn truncated_files_are_detected() {
    for name in ["Part_0000.bi4", "Part_0001.bi4", "big-endian.bi4"] {
        let bytes = sample(&format!("dualsphysics/{name}"));
        READER.survives_truncation(&bytes, &[0, 9, 60, 64, 68], bytes.len());
        for len in 0..bytes.len() {
            READER.error_inside(&bytes[..len]);
        }
    }
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = READER.all(&bytes);
        let head = sample("dualsphysics/Part_0000.bi4");
        let _ = READER.all(&[&head[..64], &bytes].concat());
    }

    #[test]
    fn mutations_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let _ = READER.all(&mutate(&sample("dualsphysics/Part_0001.bi4"), &changes));
    }
}
