//! Files that are cut short, lie about counts, or are random; and round trips of random particles.

use proptest::prelude::*;

use super::made::{NASTY, TestFile, modern, splish};
use super::{attribute, good, malformed, parse, read, sample, steps};
use crate::read::Step;
use spherule_frame::{AttributeData, ParseError, Positions};

#[test]
fn huge_counts_are_rejected_without_allocation() {
    for count in [
        "2147483648",
        "4294967296",
        "9223372036854775808",
        "18446744073709551615",
        "99999999999999999999999",
        "6148914691236517206",
        "-1",
        "-9223372036854775808",
        "1e9",
        "x",
        "",
    ] {
        for encoding in ["BINARY", "ASCII"] {
            let head = format!("# vtk DataFile Version 4.1\nt\n{encoding}\nDATASET POLYDATA\n");
            for line in [
                format!("POINTS {count} float\n"),
                format!("POINTS 0 float\nVERTICES 1 {count}\n"),
                format!("POINTS 0 float\nCELL_TYPES {count}\n"),
                format!("POINTS 0 float\nPOINT_DATA {count}\nVECTORS v float\n"),
                format!("POINTS 0 float\nCELL_DATA {count}\nVECTORS v float\n"),
                format!("POINTS 0 float\nPOINT_DATA 0\nLOOKUP_TABLE t {count}\n"),
                format!("POINTS 0 float\nPOINT_DATA 0\nFIELD f 1\na 3 {count} float\n"),
                format!("POINTS 0 float\nPOINT_DATA 0\nFIELD f 1\na 1 {count} bit\n"),
                format!("POINTS 0 float\nPOINT_DATA 0\nFIELD f 1\na {count} 0 float\n"),
                format!("POINTS 0 float\nPOINT_DATA 0\nFIELD f 1\na 1 {count} string\n"),
            ] {
                malformed(format!("{head}{line}0 0 0 0 0 0 0 0\n").as_bytes());
            }
        }
    }
}

#[test]
fn errors_have_offset_and_required_size() {
    let (at, what) = malformed(
        &TestFile::new("4.1").text("DATASET POLYDATA\nPOINTS 9 float\n").floats(&NASTY).0,
    );
    assert_eq!(at, 72);
    assert_eq!(what, "POINTS: 27 numbers of type f32 need 108 bytes, 36 are left");
    let (_, what) =
        malformed(&TestFile::new("4.1").three_points("POLYDATA").text("POINT_DATA 4\n").0);
    assert_eq!(what, "POINT_DATA for 4 points, POINTS has 3");
}

/// A file cut short is refused, or, where it is cut between sections, gives a part of the whole.
#[track_caller]
fn check_cuts(bytes: &[u8], cuts: impl Iterator<Item = usize>) {
    let whole = good(bytes);
    let (mut cut_count, mut refused) = (0, 0);
    for cut in cuts {
        cut_count += 1;
        match parse(&bytes[..cut]) {
            Ok(part) => {
                assert_eq!(part.positions, whole.positions, "cut at {cut}");
                assert!(whole.attributes.starts_with(&part.attributes), "cut at {cut}");
            }
            Err(ParseError::Malformed { .. }) => refused += 1,
            Err(error) => panic!("cut at {cut}: {error}"),
        }
    }
    assert!(refused * 10 >= cut_count * 6, "{refused} of {cut_count}");
}

#[test]
fn truncation_is_detected() {
    let points: Vec<[f32; 3]> = (0..12).map(|i| [i as f32, 0.5, -1.0]).collect();
    let ids: Vec<u32> = (0..12).collect();
    for bytes in [splish(&points, &ids, &points), modern(&points, &ids, &points)] {
        check_cuts(&bytes, 0..bytes.len());
    }
    let large = sample("emitter_sph/ParticleData_Fluid_3.vtk");
    check_cuts(&large, (0..large.len()).step_by(97));
}

/// Of a known length or not: a count of cells that the rest of the file has no room for is as wrong as a smaller one.
#[test]
fn wrong_counts_of_cells_are_read_in_pieces_too() {
    let whole = sample("public_splashsurf/cube_8_particles.vtk");
    let text = String::from_utf8(whole.clone()).unwrap();
    let wrong = text.replace("CELLS 9 8", "CELLS 9 80");
    assert_ne!(text, wrong);
    assert_eq!(good(wrong.as_bytes()).positions, good(&whole).positions);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn written_particles_are_read_back(
        particles in prop::collection::vec((any::<[u32; 3]>(), any::<u32>(), any::<[u32; 3]>()), 0..40)
    ) {
        let floats = |bits: [u32; 3]| bits.map(f32::from_bits);
        let points: Vec<[f32; 3]> = particles.iter().map(|p| floats(p.0)).collect();
        let ids: Vec<u32> = particles.iter().map(|p| p.1).collect();
        let velocity: Vec<[f32; 3]> = particles.iter().map(|p| floats(p.2)).collect();
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        for file in [splish(&points, &ids, &velocity), modern(&points, &ids, &velocity)] {
            let found = parse(&file).unwrap();
            let Positions::F32(read) = &found.positions else { panic!("floats are f32") };
            let read: Vec<f32> = read.iter().flat_map(|p| p.to_array()).collect();
            prop_assert_eq!(bits(&read), bits(points.as_flattened()));
            prop_assert_eq!(&attribute(&found, "id").data, &AttributeData::U32(ids.clone()));
            let AttributeData::F32(read) = &attribute(&found, "velocity").data else {
                panic!("floats are f32")
            };
            prop_assert_eq!(bits(read), bits(velocity.as_flattened()));
        }
    }

    #[test]
    fn random_bytes_do_not_panic(tail in prop::collection::vec(any::<u8>(), 0..400), ascii in any::<bool>()) {
        let _ = read(&tail, &Step::whole(tail.len()));
        let kind = if ascii { "ASCII" } else { "BINARY" };
        let mut bytes = format!("# vtk DataFile Version 5.1\n\n{kind}\nDATASET POLYDATA\nPOINTS 1 float\n").into_bytes();
        bytes.extend(tail);
        let _ = steps(&bytes);
        let _ = read(&bytes, &Step::whole(bytes.len()));
    }

    #[test]
    fn random_damage_does_not_panic(
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<bool>()), 1..6),
        kind in 0..3_usize,
    ) {
        let points = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let mut bytes = match kind {
            0 => splish(&points, &[1, 2], &points),
            1 => modern(&points, &[1, 2], &points),
            _ => sample("public_splashsurf/cube_8_particles.vtk"),
        };
        for (place, value, digit) in damage {
            let at = place.index(bytes.len());
            bytes[at] = if digit { b'0' + value % 10 } else { value };
        }
        let _ = steps(&bytes);
        let _ = read(&bytes, &Step::whole(bytes.len()));
    }
}
