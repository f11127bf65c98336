//! Replays the committed corpus of the fuzz targets with the checks of the targets.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use spherule_formats::native::{Bound, Encoding, RadiusCode, StoreSettings, StoredType, layout};
use spherule_formats::{Attribute, AttributeData, ParticleFrame, Radius, native};

#[path = "../../../fuzz/src/readers/mod.rs"]
#[expect(unreachable_pub, reason = "a library of its own for the fuzz targets")]
mod targets;

mod mutations;

use targets::{TARGETS, Target};

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus")
}

/// The files below `dir`, sorted by name.
fn inputs(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).expect("every target has a corpus");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    paths.sort();
    paths
}

/// Runs all inputs of a target and counts those that give particles.
fn replay(name: &str, target: Target) -> usize {
    let paths = inputs(&corpus().join(name));
    let gave = |path: &&PathBuf| target(&fs::read(path).expect("readable")) > 0;
    paths.iter().filter(gave).count()
}

#[test]
fn every_target_replays_its_corpus() {
    for (name, target) in TARGETS {
        // With fewer successes, the targets would check nothing but errors.
        assert!(replay(name, target) > 0, "nothing is read for {name}");
    }
}

/// The contents of the seeds: a row of `count` particles, a few of them far away.
fn frame(radius: Option<Radius>, origin: DVec3, count: u8) -> ParticleFrame {
    let positions: Vec<Vec3> = (0..count)
        .map(|i| Vec3::new(f32::from(i), -0.5, if i == 40 { 1e4 } else { 1.0 }))
        .collect();
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
                data: AttributeData::U64((0..u64::from(count)).collect()),
            },
        ],
        positions,
        origin,
        radius,
        time: Some(0.25),
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 3,
        file_index: None,
    }
}

fn own_radii(count: u8) -> Radius {
    Radius::PerParticle((0..count).map(|i| 0.5 / f32::from(i + 1)).collect())
}

/// Checks a frame with attributes in fewer bits.
fn shrunk(path: &Path) {
    let range = [[-1.0, 1.0]].to_vec();
    let attribute = |name: &str, stored, ranges| native::AttributeSpec {
        name: name.into(),
        stored,
        components: 1,
        ranges,
        max_error: 0.01,
    };
    let spec = native::FrameSpec {
        is_y_up: false,
        count: 3,
        encoding: Encoding::Q10,
        bound: Bound::None,
        origin: DVec3::ZERO,
        rounding: 0.0,
        radius: native::RadiusSpec::None,
        attributes: vec![
            attribute("half", StoredType::Half, Vec::new()),
            attribute("coded", StoredType::Ranged, range),
        ],
        time: None,
        step: None,
        dropped: 0,
        details: native::FrameDetails::default(),
    };
    let mut writer = native::FrameWriter::create(path, spec).expect("writable");
    let run = native::Run {
        positions: &[Vec3::ZERO, Vec3::X, Vec3::ONE],
        radii: None,
        attributes: &[&[0, 60, 0, 56, 0, 188], &[0, 128, 255]],
    };
    writer.push(&run).expect("writable");
    writer.finish().expect("writable");
}

/// Run it after a change of the native layout: `cargo test -p spherule-formats --test corpus -- --ignored`.
#[test]
#[ignore = "writes into the corpus"]
fn write_the_native_corpus() {
    let dir = corpus().join("native");
    fs::create_dir_all(&dir).expect("writable");
    let far = DVec3::new(1e6, 0.0, -3.0);
    let coded = |encoding, bound| StoreSettings { encoding: Some(encoding), bound, rounding: 0.0 };
    let exact = StoreSettings::EXACT;
    let common = Some(Radius::Common(0.5));
    for (name, frame, settings) in [
        ("plain", frame(None, DVec3::ZERO, 17), exact),
        ("origin", frame(common.clone(), far, 2), exact),
        ("radii", frame(Some(own_radii(3)), DVec3::ZERO, 3), exact),
        ("zero", frame(None, DVec3::ZERO, 0), exact),
        ("wide", frame(common, DVec3::ZERO, 50), coded(Encoding::Q10, Bound::Length(1e-2))),
        (
            "coded_radii",
            frame(Some(own_radii(20)), DVec3::ZERO, 20),
            coded(Encoding::Q16, Bound::Length(1e-2)),
        ),
    ] {
        native::store(&dir.join(name), &frame, Some(7), &settings).expect("writable");
    }
    shrunk(&dir.join("shrunk"));
}

/// The seeds cover the cases of the target: blocks stored as f32, and coded radii.
#[test]
fn the_native_corpus_has_every_kind_of_block() {
    let index = |name: &str| {
        let bytes = fs::read(corpus().join("native").join(name)).expect("readable");
        layout::parse(&bytes).expect("whole")
    };
    let wide = index("wide");
    assert!(wide.encoding() == Encoding::Q10 && wide.wide.len > 0);
    let coded = index("coded_radii");
    let is_coded = |radii: &layout::RadiiIndex| radii.code != RadiusCode::F32.code();
    assert_eq!(coded.encoding(), Encoding::Q16);
    assert!(matches!(&coded.radius, layout::RadiusIndex::PerParticle(radii) if is_coded(radii)));
    assert_eq!(index("shrunk").attributes.len(), 2);
}
