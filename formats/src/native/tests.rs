//! There and back, and every way to damage a file.

use std::fs;
use std::path::PathBuf;

use super::*;
use crate::{FrameError, ParticleFrame, Radius};

fn frame(count: u8, origin: DVec3) -> ParticleFrame {
    let positions: Vec<Vec3> = (0..count)
        .map(|i| Vec3::new(f32::from(i), -0.0, 1.0 / f32::from(i + 1)))
        .collect();
    let ids = (0..u64::from(count)).map(|i| u64::MAX - i).collect();
    ParticleFrame {
        attributes: vec![
            Attribute {
                name: "velocity".into(),
                components: 3,
                data: AttributeData::F32(positions.iter().flat_map(Vec3::to_array).collect()),
            },
            Attribute {
                name: "id".into(),
                components: 1,
                data: AttributeData::U64(ids),
            },
        ],
        positions,
        origin,
        radius: None,
        time: Some(0.25),
        dropped: 3,
        file_index: None,
    }
}

struct Written {
    _dir: tempfile::TempDir,
    path: PathBuf,
}

fn written(frame: &ParticleFrame) -> Written {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    write(&path, frame, Some(7)).expect("writable");
    Written { _dir: dir, path }
}

fn bytes(frame: &ParticleFrame) -> Vec<u8> {
    fs::read(&written(frame).path).expect("readable")
}

fn read_back(bytes: &[u8]) -> Result<RawParticles, ParseError> {
    let steps = steps(bytes)?;
    read(bytes, &steps[0])
}

#[test]
fn frames_come_back_as_they_were() {
    for count in [0, 1, 15, 16, 17, 100] {
        let frame = frame(count, DVec3::ZERO);
        let raw = read_back(&bytes(&frame)).expect("whole");
        assert_eq!(
            raw.positions,
            Positions::F32(frame.positions.clone()),
            "{count}"
        );
        assert_eq!(raw.attributes, frame.attributes);
        assert_eq!((raw.time, raw.step), (Some(0.25), Some(7)));
    }
}

#[test]
fn the_origin_is_added_again() {
    let origin = DVec3::new(1e6, 0.0, -3.0);
    let frame = frame(3, origin);
    let raw = read_back(&bytes(&frame)).expect("whole");
    assert_eq!(raw.positions.get(2), frame.positions[2].as_dvec3() + origin);
    let again = ParticleFrame::from_raw(raw, origin);
    assert_eq!(again.positions[0], frame.positions[0]);
}

#[test]
fn radii_come_back() {
    for radius in [
        Radius::Common(0.5),
        Radius::PerParticle(vec![0.5, 0.25, 0.125]),
    ] {
        let mut frame = frame(3, DVec3::ZERO);
        frame.radius = Some(radius.clone());
        let raw = read_back(&bytes(&frame)).expect("whole");
        assert_eq!(
            ParticleFrame::from_raw(raw, DVec3::ZERO).radius,
            Some(radius)
        );
    }
}

#[test]
fn radii_that_an_attribute_has_are_stored_once() {
    let mut frame = frame(64, DVec3::ZERO);
    let radii: Vec<f32> = (1..=64u8).map(f32::from).collect();
    frame.attributes.push(Attribute {
        name: "radius".into(),
        components: 1,
        data: AttributeData::F32(radii.clone()),
    });
    let without = bytes(&frame).len();
    frame.radius = Some(Radius::PerParticle(radii));
    assert_eq!(bytes(&frame).len(), without);
}

#[test]
fn mapped_and_read_files_give_blocks_in_place() {
    let frame = frame(17, DVec3::ZERO);
    let written = written(&frame);
    for access in [Access::Map, Access::Read] {
        let file = NativeFile::open(&written.path, access).expect("whole");
        let view = file.frame().expect("unchanged");
        view.verify().expect("undamaged");
        let blocks = view.blocks().expect("little-endian and aligned");
        assert_eq!(blocks.len(), 2);
        assert_eq!((blocks[1].x, blocks[0].z[1]), ([16.0; 16], 0.5));
        assert_eq!((view.index().count, view.index().dropped), (17, 3));
        assert_eq!((view.index().min[0], view.index().max[0]), (0.0, 16.0));
        let id = view.attribute("id").expect("named").expect("whole");
        assert_eq!(id.data, frame.attributes[1].data);
        assert!(view.attribute("none").is_none());
    }
}

#[test]
fn a_file_cut_short_under_the_map_is_noticed() {
    let written = written(&frame(100, DVec3::ZERO));
    let file = NativeFile::open(&written.path, Access::Map).expect("whole");
    let handle = fs::OpenOptions::new().write(true).open(&written.path);
    handle.and_then(|h| h.set_len(100)).expect("writable");
    let error = file.frame().expect_err("cut short");
    assert!(matches!(error, FrameError::Malformed { .. }) && error.to_string().contains("100 now"));
    for access in [Access::Map, Access::Read] {
        assert!(NativeFile::open(&written.path, access).is_err());
    }
}

#[test]
fn every_truncation_is_an_error() {
    let whole = bytes(&frame(17, DVec3::ZERO));
    for len in 0..whole.len() {
        assert!(
            matches!(read_back(&whole[..len]), Err(ParseError::Malformed { .. })),
            "{len}"
        );
    }
    let longer = [whole, vec![0]].concat();
    assert!(read_back(&longer).is_err());
}

#[test]
fn every_flipped_byte_is_an_error_or_padding() {
    let whole = bytes(&frame(17, DVec3::ZERO));
    let expected = read_back(&whole).expect("whole");
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x10;
        match read_back(&damaged) {
            Err(ParseError::Malformed { .. }) => {}
            Err(other) => panic!("byte {at}: {other}"),
            // Zeros between sections mean nothing.
            Ok(raw) => assert!(at >= layout::HEADER_LEN && raw == expected, "byte {at}"),
        }
    }
}

/// An index that lies, under valid checksums.
#[track_caller]
fn forged(change: impl FnOnce(&mut FrameIndex)) -> ParseError {
    let whole = bytes(&frame(17, DVec3::ZERO));
    let mut index = layout::parse(&whole).expect("whole");
    change(&mut index);
    let index = rkyv::to_bytes::<rkyv::rancor::Error>(&index).expect("memory");
    let offset = 24..32;
    let offset = u64::from_le_bytes(whole[offset].try_into().expect("8 bytes"));
    let mut forged = whole[..usize::try_from(offset).expect("small")].to_vec();
    forged.extend_from_slice(&index);
    let header = layout::header(forged.len() as u64, offset, &index);
    forged[..layout::HEADER_LEN].copy_from_slice(&header);
    read_back(&forged).expect_err("a lie")
}

#[test]
fn an_index_that_lies_is_an_error() {
    let malformed = |e: ParseError| assert!(matches!(e, ParseError::Malformed { .. }), "{e}");
    malformed(forged(|i| i.count = u64::MAX));
    malformed(forged(|i| i.count = 1 << 60));
    malformed(forged(|i| i.count = 33));
    malformed(forged(|i| i.positions.offset = u64::MAX));
    malformed(forged(|i| i.positions.offset = 0));
    malformed(forged(|i| i.positions.offset += 4));
    malformed(forged(|i| i.positions.len = u64::MAX));
    malformed(forged(|i| i.attributes[0].components = u32::MAX));
    malformed(forged(|i| i.attributes[0].components = 0));
    malformed(forged(|i| i.attributes[1].section.len -= 8));
    malformed(forged(|i| i.radius = RadiusIndex::PerParticle(i.positions)));
    let unsupported = |e: ParseError| assert!(matches!(e, ParseError::Unsupported { .. }), "{e}");
    unsupported(forged(|i| i.encoding = 2));
    unsupported(forged(|i| i.block = 32));
    unsupported(forged(|i| i.attributes[0].scalar = 99));
}

#[test]
fn frames_that_do_not_fit_together_are_not_written() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let mut frame = frame(3, DVec3::ZERO);
    frame.attributes[1].data = AttributeData::U64(vec![1]);
    assert!(write(&dir.path().join("a.spf"), &frame, None).is_err());
    assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 0);
}
