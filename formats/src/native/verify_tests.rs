//! Frames with correct checksums whose numbers cannot belong to a frame.

use glam::{DVec3, Vec3};

use super::super::layout::{self, FrameIndex};
use super::super::*;
use super::*;
use crate::{Attribute, AttributeData, ParticleFrame, Radius};

/// 300 particles in blocks of two different sizes, so that tight bounds store some blocks as f32.
fn stored(encoding: Encoding, own_radii: bool) -> Vec<u8> {
    // Make positions, a few of them far away
    let positions: Vec<Vec3> = (0..300_u16)
        .map(|i| {
            let far = if i % 50 == 0 { 40.0 } else { 1.0 };
            Vec3::new(f32::from(i) * 0.37 % 1.0, f32::from(i) * 0.71 % far, f32::from(i) * 1e-3)
        })
        .collect();
    let radius = if own_radii {
        let radii = (0..300_u16).map(|i| 0.01 + f32::from(i % 7) * 1e-3);
        Radius::PerParticle(radii.collect())
    } else {
        Radius::Common(0.01)
    };
    let frame = ParticleFrame {
        attributes: vec![Attribute {
            name: "id".into(),
            components: 1,
            data: AttributeData::U8((0..300_u16).map(|i| i.to_le_bytes()[0]).collect()),
        }],
        positions,
        origin: DVec3::ZERO,
        radius: Some(radius),
        time: None,
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 0,
        file_index: None,
    };
    // Store the frame and read its bytes
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let settings =
        StoreSettings { encoding: Some(encoding), bound: Bound::Length(1e-3), rounding: 0.0 };
    store(&path, &frame, None, &settings).expect("writable");
    std::fs::read(path).expect("readable")
}

/// `bytes` after `harm` changed them, with correct checksums.
fn forged(bytes: &[u8], harm: impl FnOnce(&mut FrameIndex, &mut [u8])) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut index = layout::parse(&bytes).expect("whole");
    harm(&mut index, &mut bytes);
    // Update the checksums of the sections
    let sum = |section: &mut Section| {
        let found = section_of(&bytes, section).expect("inside");
        section.xxh3 = xxh3_64(found);
    };
    sum(&mut index.positions);
    sum(&mut index.wide);
    sum(&mut index.nodes);
    if let RadiusIndex::PerParticle(radii) = &mut index.radius {
        sum(&mut radii.section);
    }
    for attribute in &mut index.attributes {
        sum(&mut attribute.section);
    }
    // Replace the index and the header
    let (packed, details) = layout::index_bytes(&index).expect("memory");
    let offset = u64::from_le_bytes(bytes[24..32].try_into().expect("8 bytes"));
    bytes.truncate(usize::try_from(offset).expect("small"));
    bytes.extend_from_slice(&packed);
    let header = layout::header(bytes.len() as u64, offset, &packed, details);
    bytes[..HEADER_LEN].copy_from_slice(&header);
    bytes
}

/// Checks that the fault that `harm` makes is reported with this message at this place.
#[track_caller]
fn fails_with(
    bytes: &[u8],
    words: &str,
    place: impl Fn(&FrameIndex) -> u64,
    harm: impl FnOnce(&mut FrameIndex, &mut [u8]),
) {
    let bytes = forged(bytes, harm);
    let expected = place(&layout::parse(&bytes).expect("good"));
    match super::super::verify(&bytes).expect_err(words) {
        ParseError::Malformed { at, what } => {
            assert_eq!(at, expected, "{what}");
            assert!(what.contains(words) && what.ends_with("convert again"), "{what}");
        }
        other => panic!("{other}"),
    }
}

fn at(section: &Section, by: usize) -> usize {
    usize::try_from(section.offset).expect("small") + by
}

#[test]
fn intact_frames_pass_verification() {
    for encoding in Encoding::ALL {
        for own_radii in [false, true] {
            let bytes = stored(encoding, own_radii);
            super::super::verify(&bytes).expect("whole");
            let again = forged(&bytes, |_, _| ());
            super::super::verify(&again).expect("forging alone does no harm");
        }
    }
}

#[test]
fn every_flipped_byte_of_a_frame_is_detected() {
    let whole = stored(Encoding::Q10, true);
    let offset = u64::from_le_bytes(whole[24..32].try_into().expect("8 bytes"));
    let mut aligned = AlignedVec::<64>::new();
    for at in HEADER_LEN..usize::try_from(offset).expect("small") {
        aligned.clear();
        aligned.extend_from_slice(&whole);
        aligned[at] ^= 0x10;
        let index = layout::parse(&aligned).expect("header and index are whole");
        let result = NativeFrame::with_index(&aligned, &index).verify_all();
        assert!(matches!(result, Err(ParseError::Malformed { .. })), "byte {at}");
    }
}

#[test]
fn invalid_node_links() {
    let bytes = stored(Encoding::F32, false);
    let second = |i: &FrameIndex| i.nodes.offset + 64;
    fails_with(&bytes, "node 1 has children 01111111 for 8 blocks", second, |i, b| {
        b[at(&i.nodes, 64 + 15)] = 0x7f;
    });
    fails_with(&bytes, "child 0 of node 1 has no box", second, |i, b| {
        b[at(&i.nodes, 64)..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    });
    fails_with(&bytes, "child 0 of node 1 has no box", second, |i, b| {
        b[at(&i.nodes, 64 + 12)] = 255;
    });
    fails_with(&bytes, "child 3 of node 1 has no box", second, |i, b| {
        // The lower plane is above the upper plane on the last axis.
        let planes = at(&i.nodes, 64 + 16 + 2 * 16);
        b[planes + 3] = 200;
        b[planes + 8 + 3] = 100;
    });
}

#[test]
fn invalid_positions() {
    // Positions that are not finite, or outside the box of the node
    let bytes = stored(Encoding::F32, false);
    let third = |i: &FrameIndex| i.positions.offset + 2 * 192;
    let set = |value: f32| {
        move |i: &mut FrameIndex, b: &mut [u8]| {
            b[at(&i.positions, 2 * 192 + 4)..][..4].copy_from_slice(&value.to_le_bytes());
        }
    };
    fails_with(&bytes, "block 2 has a position that is not finite", third, set(f32::NAN));
    fails_with(&bytes, "block 2 has a position that is not finite", third, set(f32::INFINITY));
    fails_with(&bytes, "block 2 has a particle outside its box", third, set(1e6));
    // Positions outside the bounds of the frame
    let first = |i: &FrameIndex| i.positions.offset;
    fails_with(&bytes, "block 0 has a particle outside the bounds", first, |i, _| {
        i.max = i.min;
    });
    // Of the 300 particles, 12 are in the last block, followed by four copies of the last one.
    let last = |i: &FrameIndex| i.positions.offset + 18 * 192;
    fails_with(&bytes, "block 18 has particles beyond the last one", last, |i, b| {
        let place = at(&i.positions, 18 * 192);
        let first: [u8; 4] = b[place..place + 4].try_into().expect("4 bytes");
        b[place + 4 * 15..][..4].copy_from_slice(&first);
    });
}

#[test]
fn dangling_references() {
    let bytes = stored(Encoding::Q10, false);
    let index = layout::parse(&bytes).expect("whole");
    let wide = index.wide.len / 192;
    assert!(wide > 0 && wide < 19, "{wide} of 19 blocks are kept as they are");
    let reference = (0..19)
        .find(|block| {
            let lane = |lane: usize| {
                let place = at(&index.positions, block * 64 + 4 * lane);
                u32::from_le_bytes(bytes[place..place + 4].try_into().expect("4 bytes"))
            };
            lane(0) >> 22 > lane(15) >> 22
        })
        .expect("a reference");
    let place = |i: &FrameIndex| i.positions.offset + 64 * reference as u64;
    fails_with(&bytes, "refers to wide block 4096", place, |i, b| {
        b[at(&i.positions, 64 * reference + 4)..][..4].copy_from_slice(&4096_u32.to_le_bytes());
    });
}

#[test]
fn invalid_radii() {
    let bytes = stored(Encoding::F32, true);
    let section = |i: &FrameIndex| match &i.radius {
        RadiusIndex::PerParticle(radii) => radii.section,
        _ => panic!("radii of their own"),
    };
    let second = |i: &FrameIndex| section(i).offset + 64;
    for (value, words) in [
        (f32::NAN, "block 1 has a radius that is negative or no number"),
        (-1.0, "block 1 has a radius that is negative or no number"),
    ] {
        fails_with(&bytes, words, second, |i, b| {
            b[at(&section(i), 64)..][..4].copy_from_slice(&value.to_le_bytes());
        });
    }
    let positions = |i: &FrameIndex| i.positions.offset + 192;
    fails_with(&bytes, "block 1 has a particle outside its box", positions, |i, b| {
        b[at(&section(i), 64)..][..4].copy_from_slice(&9.0_f32.to_le_bytes());
    });
}

#[test]
fn non_zero_padding() {
    let bytes = stored(Encoding::F32, false);
    let end = |i: &FrameIndex| i.attributes[0].section.offset + i.attributes[0].section.len;
    fails_with(&bytes, "between the sections", end, |i, b| {
        b[at(&i.attributes[0].section, 300)] = 1;
    });
    fails_with(
        &bytes,
        "attribute id overlap the section before",
        |i| i.positions.offset,
        |i, _| {
            i.attributes[0].section.offset = i.positions.offset;
        },
    );
    let last = |i: &FrameIndex| {
        let ends = i.sections().into_iter().map(|(_, s)| s.offset + s.len);
        ends.max().expect("sections")
    };
    fails_with(&bytes, "a largest error is not a number", last, |i, _| {
        i.attributes[0].max_error = -1.0;
    });
}
