//! Round trips, and every kind of damage to a file.

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use glam::{DVec3, Vec3};

use super::layout::{RadiiIndex, RadiusIndex};
use super::*;
use crate::{
    Attribute, AttributeData, FrameError, Labels, ParticleFrame, Positions, Radius, RawParticles,
    SimulationCell,
};

/// Miri is too slow to try every byte.
const STRIDE: usize = if cfg!(miri) { 37 } else { 1 };

fn frame(count: u8, origin: DVec3) -> ParticleFrame {
    let positions: Vec<Vec3> =
        (0..count).map(|i| Vec3::new(f32::from(i), -0.0, 1.0 / f32::from(i + 1))).collect();
    let ids = (0..u64::from(count)).map(|i| u64::MAX - i).collect();
    ParticleFrame {
        attributes: vec![
            Attribute {
                name: "velocity".into(),
                components: 3,
                data: AttributeData::F32(positions.iter().flat_map(Vec3::to_array).collect()),
            },
            Attribute { name: "id".into(), components: 1, data: AttributeData::U64(ids) },
        ],
        positions,
        origin,
        radius: None,
        time: Some(0.25),
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 3,
        file_index: None,
    }
}

struct WrittenFrame {
    _dir: tempfile::TempDir,
    path: PathBuf,
}

fn written(frame: &ParticleFrame) -> WrittenFrame {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    write(&path, frame, Some(7)).expect("writable");
    WrittenFrame { _dir: dir, path }
}

fn bytes(frame: &ParticleFrame) -> Vec<u8> {
    fs::read(&written(frame).path).expect("readable")
}

fn read_back(bytes: &[u8]) -> Result<RawParticles, ParseError> {
    let steps = FORMAT.steps(bytes)?;
    FORMAT.read(bytes, &steps[0])
}

/// Positions and velocities of the particles in the order of their ids, which count down from the largest.
fn by_id(raw: &RawParticles, count: usize) -> Vec<(DVec3, [f64; 3])> {
    let named = |name: &str| {
        let found = raw.attributes.iter().find(|a| a.name == name);
        &found.expect("kept").data
    };
    let AttributeData::U64(ids) = named("id") else { panic!("ids changed their type") };
    let mut all = vec![None; count];
    for (i, id) in ids.iter().enumerate() {
        let velocity = [0, 1, 2].map(|c| named("velocity").get_f64(3 * i + c));
        let place = usize::try_from(u64::MAX - id).expect("an id of ours");
        assert!(all[place].replace((raw.positions.get(i), velocity)).is_none());
    }
    all.into_iter().map(|p| p.expect("every id once")).collect()
}

#[test]
fn frames_round_trip_in_tree_order() {
    for count in [0, 1, 15, 16, 17, 100] {
        let frame = frame(count, DVec3::ZERO);
        let raw = read_back(&bytes(&frame)).expect("whole");
        assert!(matches!(raw.positions, Positions::F32(_)));
        for (i, (position, velocity)) in by_id(&raw, frame.len()).into_iter().enumerate() {
            let expected = frame.positions[i].as_dvec3();
            assert_eq!((position, velocity), (expected, expected.to_array()));
        }
        assert_eq!((raw.time, raw.step), (Some(0.25), Some(7)));
    }
}

#[test]
fn the_origin_is_added_again() {
    let origin = DVec3::new(1e6, 0.0, -3.0);
    let frame = frame(3, origin);
    let raw = read_back(&bytes(&frame)).expect("whole");
    let positions = by_id(&raw, 3);
    assert_eq!(positions[2].0, frame.positions[2].as_dvec3() + origin);
}

#[test]
fn radii_round_trip() {
    let mut common = frame(3, DVec3::ZERO);
    common.radius = Some(Radius::Common(0.5));
    let raw = read_back(&bytes(&common)).expect("whole");
    let again = ParticleFrame::from_raw(raw, DVec3::ZERO);
    assert_eq!(again.radius, Some(Radius::Common(0.5)));

    let mut own = frame(40, DVec3::ZERO);
    let radii: Vec<f32> = (1..=40u8).map(f32::from).collect();
    own.radius = Some(Radius::PerParticle(radii.clone()));
    let raw = read_back(&bytes(&own)).expect("whole");
    let again = ParticleFrame::from_raw(raw, DVec3::ZERO);
    let Some(Radius::PerParticle(found)) = &again.radius else { panic!("radii of their own") };
    // x is the index of the particle.
    for (position, radius) in again.positions.iter().zip(found) {
        assert_eq!(*radius, position.x + 1.0);
    }
}

#[test]
fn radii_of_an_attribute_are_stored_once() {
    let mut frame = frame(64, DVec3::ZERO);
    let radii: Vec<f32> = (1..=64u8).map(f32::from).collect();
    frame.attributes.push(Attribute {
        name: "radius".into(),
        components: 1,
        data: AttributeData::F32(radii.clone()),
    });
    frame.radius = Some(Radius::PerParticle(radii));
    let with = read_back(&bytes(&frame)).expect("whole");
    frame.attributes.pop();
    assert_eq!(read_back(&bytes(&frame)).expect("whole"), with);
    let radius = with.attributes.iter().filter(|a| a.name == "radius");
    assert_eq!(radius.count(), 1);
}

#[test]
#[cfg_attr(miri, ignore = "maps a file")]
fn mapped_and_read_files_give_leaves_in_place() {
    let frame = frame(17, DVec3::ZERO);
    let written = written(&frame);
    for access in [Access::Map, Access::Read] {
        let file = NativeFile::open(&written.path, access).expect("whole");
        let view = file.frame().expect("unchanged");
        view.verify().expect("undamaged");
        let leaves = view.leaves().expect("little-endian and aligned");
        assert_eq!((leaves.block_count(), leaves.nodes.len()), (2, 1));
        assert_eq!((view.index().count, view.index().dropped), (17, 3));
        assert_eq!((view.index().min[0], view.index().max[0]), (0.0, 16.0));
        let id = view.attribute("ID").expect("named alike");
        let x = leaves.center(5).x;
        let place = id.low_bits(5).map(|bits| f64::from(u32::MAX - bits));
        assert_eq!(place, Some(f64::from(x)));
        let velocity = view.attribute("velocity").expect("named");
        assert_eq!(velocity.get(5, 0), f64::from(x));
        assert!(view.attribute("none").is_none());
    }
}

#[test]
#[cfg_attr(miri, ignore = "maps a file")]
fn truncation_of_a_mapped_file_is_detected() {
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
    for len in (0..whole.len()).step_by(STRIDE) {
        assert!(matches!(read_back(&whole[..len]), Err(ParseError::Malformed { .. })), "{len}");
    }
    let longer = [whole, vec![0]].concat();
    assert!(read_back(&longer).is_err());
}

#[test]
fn every_flipped_byte_is_an_error_or_padding() {
    let whole = bytes(&frame(17, DVec3::ZERO));
    let expected = read_back(&whole).expect("whole");
    for at in (0..whole.len()).step_by(STRIDE) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x10;
        match read_back(&damaged) {
            Err(ParseError::Malformed { .. }) => {}
            Err(other) => panic!("byte {at}: {other}"),
            // Damaged zeros between sections have no effect.
            Ok(raw) => assert!(at >= layout::HEADER_LEN && raw == expected, "byte {at}"),
        }
    }
}

/// A false index with correct checksums.
#[track_caller]
fn forged(change: impl FnOnce(&mut FrameIndex)) -> ParseError {
    static WHOLE: LazyLock<Vec<u8>> = LazyLock::new(|| bytes(&frame(17, DVec3::ZERO)));
    let mut index = layout::parse(&WHOLE).expect("whole");
    change(&mut index);
    forge(&WHOLE, &index).expect_err("a lie")
}

/// Reads `whole` with another index and correct checksums.
fn forge(whole: &[u8], index: &FrameIndex) -> Result<RawParticles, ParseError> {
    let (index, details) = layout::index_bytes(index).expect("memory");
    forge_bytes(whole, &index, details)
}

/// Reads `whole` with its index replaced by `index`, whose first bytes are so many `details`.
fn forge_bytes(whole: &[u8], index: &[u8], details: usize) -> Result<RawParticles, ParseError> {
    let offset = 24..32;
    let offset = u64::from_le_bytes(whole[offset].try_into().expect("8 bytes"));
    let mut forged = whole[..usize::try_from(offset).expect("small")].to_vec();
    forged.extend_from_slice(index);
    let header = layout::header(forged.len() as u64, offset, index, details);
    forged[..layout::HEADER_LEN].copy_from_slice(&header);
    read_back(&forged)
}

#[test]
fn names_of_values_and_the_cell_are_kept() {
    let whole = bytes(&frame(17, DVec3::ZERO));
    let mut index = layout::parse(&whole).expect("whole");
    assert_eq!(index.details, FrameDetails::default());
    let vectors = [DVec3::X, DVec3::new(0.1, 2.0, 0.0), DVec3::new(0.0, 1e-3, 1.0 / 3.0)];
    let cell = SimulationCell::new(DVec3::splat(-0.1), vectors, [true, false, true]);
    let names = [(-3, "wall \"a\"\n".to_owned()), (i64::MAX, "é".to_owned())];
    let labels = Labels::from([("part".to_owned(), names.into())]);
    index.details = FrameDetails { labels: labels.clone(), cell };
    let raw = forge(&whole, &index).expect("valid");
    assert_eq!((raw.labels, raw.cell), (labels, cell));
}

#[test]
fn damaged_details_are_an_error() {
    let whole = bytes(&frame(17, DVec3::ZERO));
    let index = layout::parse(&whole).expect("whole");
    let (rest, _) = layout::index_bytes(&index).expect("memory");
    let far = "{\"cell\":{\"origin\":[0,0,0],\"vectors\":[[1e308,0,0],[1e308,1,0],[0,0,1]],\"periodic\":[true,true,true]}}";
    for (details, message) in [
        ("{\"labels\":{\"part\":{\"x\":\"a\"}}}", "names of values are damaged"),
        ("{\"lables\":{}}", "names of values are damaged"),
        (&"[".repeat(4096)[..], "names of values are damaged"),
        (far, "cell"),
    ] {
        let mut bytes = details.as_bytes().to_vec();
        bytes.resize(bytes.len().next_multiple_of(16), b' ');
        let len = bytes.len();
        bytes.extend_from_slice(&rest);
        let error = forge_bytes(&whole, &bytes, len).expect_err("a lie").to_string();
        assert!(error.contains(message) && error.contains("convert it again"), "{error}");
    }
    for len in [1, 16, rest.len() + 16, usize::MAX] {
        let error = forge_bytes(&whole, &rest, len).expect_err("a lie");
        assert!(matches!(error, ParseError::Malformed { .. }), "{len}: {error}");
    }
}

#[test]
fn inconsistent_index_is_an_error() {
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
    malformed(forged(|i| i.nodes.len += 64));
    malformed(forged(|i| {
        let twice = i.attributes[0].clone();
        i.attributes.extend(vec![twice; 1000]);
    }));
    malformed(forged(|i| i.wide.len = 192));
    malformed(forged(|i| i.min[1] = f32::NAN));
    malformed(forged(|i| i.origin[2] = f64::INFINITY));
    malformed(forged(|i| i.attributes[0].ranges = vec![[0.0, 1.0]]));
    malformed(forged(|i| {
        i.radius = RadiusIndex::PerParticle(RadiiIndex {
            code: RadiusCode::F32.code(),
            low: 1.0,
            high: 2.0,
            max_error: 0.0,
            section: i.positions,
        });
    }));
    let unsupported = |e: ParseError| assert!(matches!(e, ParseError::Unsupported { .. }), "{e}");
    unsupported(forged(|i| i.encoding = 3));
    unsupported(forged(|i| i.block = 32));
    unsupported(forged(|i| i.attributes[0].stored = 99));
}

#[test]
fn frames_that_do_not_fit_together_are_not_written() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let mut frame = frame(3, DVec3::ZERO);
    frame.attributes[1].data = AttributeData::U64(vec![1]);
    assert!(write(&dir.path().join("a.spf"), &frame, None).is_err());
    let mut frame = self::frame(3, DVec3::ZERO);
    frame.positions[1].y = f32::NAN;
    assert!(write(&dir.path().join("a.spf"), &frame, None).is_err());
    assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 0);
}

/// Particles in a few clusters, some of them flat, and distant outliers.
pub(crate) fn clustered(count: u32) -> Vec<Vec3> {
    let unit = |i: u32, k: u32| {
        let hash = (i * 3 + k).wrapping_mul(0x9e37_79b9).rotate_left(13);
        hash.wrapping_mul(0x85eb_ca6b) as f32 / u32::MAX as f32
    };
    let place = |i: u32| {
        let inside = Vec3::new(unit(i, 0), unit(i, 1), unit(i, 2));
        match i % 100 {
            0 => 1e4 * (inside - 0.5),
            1..20 => inside * Vec3::new(1.0, 1.0, 0.0) + 50.0,
            20..50 => Vec3::new(-300.0, 2.0, 7.0) + 0.01 * inside,
            _ => inside,
        }
    };
    (0..count).map(place).collect()
}

/// Stores `positions` with ids and reads them back. Checks that they are within the error that the file states.
fn stored_within(
    positions: Vec<Vec3>,
    radius: Option<Radius>,
    settings: StoreSettings,
) -> FrameIndex {
    // Store the frame
    let ids = (0..positions.len() as u64).collect();
    let frame = ParticleFrame {
        attributes: vec![Attribute {
            name: "id".into(),
            components: 1,
            data: AttributeData::U64(ids),
        }],
        positions,
        origin: DVec3::ZERO,
        radius,
        time: None,
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 0,
        file_index: None,
    };
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let index = store(&path, &frame, None, &settings).expect("writable");
    // Read it back
    let access = if cfg!(miri) { Access::Read } else { Access::Map };
    let file = NativeFile::open(&path, access).expect("whole");
    assert_eq!(file.index(), &index);
    let view = file.frame().expect("unchanged");
    view.verify().expect("undamaged");
    let leaves = view.leaves().expect("in place");
    let raw = view.to_raw().expect("whole");
    let AttributeData::U64(ids) = &raw.attributes[0].data else { panic!("ids changed their type") };
    // Compare each particle with the given one
    let mut visited = vec![false; frame.len()];
    let mut largest = 0.0_f64;
    for (slot, id) in ids.iter().enumerate() {
        let id = usize::try_from(*id).expect("an id of ours");
        assert!(!std::mem::replace(&mut visited[id], true));
        let found = raw.positions.get(slot);
        assert_eq!(found, leaves.center(slot).as_dvec3());
        largest = largest.max(found.distance(frame.positions[id].as_dvec3()));
        // Check the box of the leaf
        let (node, block) = (slot / 128, slot / 16);
        let center = leaves.center(slot);
        let own = leaves.radii.load(block).map_or(0.0, |r| r.0[slot % 16]);
        let sphere = crate::blocks::Aabb { min: center, max: center }.padded(own);
        let sphere = if own > 0.0 { sphere.rounded_outwards() } else { sphere };
        assert!(leaves.nodes[node].child_holds(block % 8, &sphere), "{slot}");
        // Check the radius
        if let Some(Radius::PerParticle(radii)) = &frame.radius {
            let RadiusIndex::PerParticle(coded) = index.radius else {
                panic!("radii of their own")
            };
            assert!((own - radii[id]).abs() <= coded.max_error);
        }
    }
    assert!(visited.into_iter().all(|s| s));
    assert!(largest <= index.max_error, "{largest} {}", index.max_error);
    index
}

#[test]
#[cfg_attr(miri, ignore = "too many particles for an interpreter")]
fn position_errors_are_within_the_stored_maximum() {
    for encoding in Encoding::ALL {
        for count in [0, 1, 2, 15, 16, 17, 127, 128, 129, 1025, 20_000] {
            for bound in [Bound::None, Bound::Length(1e-4), Bound::OfRadius(0.02)] {
                let settings = StoreSettings { encoding: Some(encoding), bound, rounding: 0.0 };
                let radius = Some(Radius::Common(0.01));
                let index = stored_within(clustered(count), radius, settings);
                assert!(index.max_error <= bound.length(Some(0.01)));
                assert!(encoding != Encoding::F32 || index.max_error == 0.0);
            }
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too many particles for an interpreter")]
fn per_particle_radii_are_stored_within_the_bound() {
    let radii = |count: u32| (0..count).map(|i| 0.001 * 100_f32.powf((i % 97) as f32 / 97.0));
    for encoding in Encoding::ALL {
        for bound in [Bound::None, Bound::OfRadius(0.1), Bound::OfRadius(0.001)] {
            let settings = StoreSettings { encoding: Some(encoding), bound, rounding: 0.0 };
            let own = Some(Radius::PerParticle(radii(5000).collect()));
            let index = stored_within(clustered(5000), own, settings);
            let RadiusIndex::PerParticle(coded) = index.radius else {
                panic!("radii of their own")
            };
            assert!(f64::from(coded.max_error) <= bound.length(Some(0.001)));
            assert!(encoding != Encoding::F32 || coded.max_error == 0.0);
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too many particles for an interpreter")]
fn flat_and_coincident_particles_are_stored() {
    let sets = [
        vec![Vec3::splat(0.3); 300],
        (0..300u16).map(|i| Vec3::new(f32::from(i), 0.1, 0.7)).collect(),
        (0..300u16).map(|i| Vec3::splat(1e6 + f32::from(i) * 1e-3)).collect(),
    ];
    for positions in sets {
        for encoding in Encoding::ALL {
            let settings =
                StoreSettings { encoding: Some(encoding), bound: Bound::None, rounding: 0.0 };
            stored_within(positions.clone(), None, settings);
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too many particles for an interpreter")]
fn smallest_encoding_within_the_bound_is_chosen() {
    let even = crate::generate::fill_box(&crate::generate::BoxSettings::thesis(50_000, 1));
    let taken = |bound: Bound| {
        let settings = StoreSettings { encoding: None, bound, rounding: 0.0 };
        let index = stored_within(even.clone(), Some(Radius::Common(0.05)), settings);
        (index.encoding(), index.max_error <= bound.length(Some(0.05)))
    };
    assert_eq!(taken(Bound::OfRadius(0.02)), (Encoding::Q10, true));
    assert_eq!(taken(Bound::OfRadius(2e-4)), (Encoding::Q16, true));
    assert_eq!(taken(Bound::Length(0.0)), (Encoding::F32, true));
}

#[test]
#[cfg_attr(miri, ignore = "too many particles for an interpreter")]
fn a_file_does_not_depend_on_threads() {
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.spf");
        let mut frame = frame(0, DVec3::ZERO);
        frame.attributes.clear();
        frame.positions = clustered(100_000);
        let settings = StoreSettings {
            encoding: Some(Encoding::Q10),
            bound: Bound::Length(1e-3),
            rounding: 0.0,
        };
        let stored = || store(&path, &frame, None, &settings).expect("writable");
        pool.expect("threads").install(stored);
        fs::read(path).expect("readable")
    };
    assert!(bytes(1) == bytes(3));
}

/// A file that is truncated while it is mapped: missing bytes read as zeros, and the check detects it.
#[cfg(all(target_os = "linux", not(miri)))]
#[test]
fn lost_pages_read_as_zeros_and_are_reported() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let mut frame = frame(0, DVec3::ZERO);
    frame.attributes.clear();
    frame.positions = clustered(50_000);
    write(&path, &frame, None).expect("writable");
    let file = NativeFile::open(&path, Access::Map).expect("whole");
    let view = file.frame().expect("unchanged");
    let handle = fs::OpenOptions::new().write(true).open(&path);
    handle.and_then(|h| h.set_len(8192)).expect("writable");
    let leaves = view.leaves().expect("lengths fit");
    assert_eq!(leaves.center(40_000), Vec3::ZERO);
    let error = file.check().expect_err("cut").to_string();
    assert!(error.contains("8192 now"), "{error}");
}

#[test]
fn empty_frame_cannot_request_memory() {
    let whole = bytes(&frame(0, DVec3::ZERO));
    let mut index = layout::parse(&whole).expect("whole");
    index.attributes[0].components = u32::MAX;
    assert!(matches!(forge(&whole, &index), Err(ParseError::Malformed { .. })));
}
