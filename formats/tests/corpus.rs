//! The committed corpus of the fuzz targets, replayed with what the targets check.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use spherule_formats::{Attribute, AttributeData, ParticleFrame, Radius, native};

#[path = "../../fuzz/src/lib.rs"]
#[expect(unreachable_pub, reason = "a library of its own for the fuzz targets")]
mod targets;

use targets::{TARGETS, Target};

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus")
}

/// Files below `dir`, in order of their names.
fn inputs(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).expect("every target has a corpus");
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.expect("readable").path())
        .collect();
    paths.sort();
    paths
}

/// Runs all inputs of a target and counts those that gave particles.
fn replay(name: &str, target: Target) -> usize {
    let paths = inputs(&corpus().join(name));
    let gave = |path: &&PathBuf| target(&fs::read(path).expect("readable")) > 0;
    paths.iter().filter(gave).count()
}

#[test]
fn every_target_replays_its_corpus() {
    for (name, target) in TARGETS {
        // With fewer, the targets would check nothing but errors.
        assert!(replay(name, target) > 0, "nothing is read for {name}");
    }
}

#[test]
fn every_folder_has_its_target() {
    let found: Vec<PathBuf> = inputs(&corpus());
    let mut wanted: Vec<PathBuf> = TARGETS.map(|(name, _)| corpus().join(name)).to_vec();
    wanted.sort();
    assert_eq!(found, wanted);
}

fn frame(radius: Option<Radius>, origin: DVec3, count: u8) -> ParticleFrame {
    let positions: Vec<Vec3> = (0..count)
        .map(|i| Vec3::new(f32::from(i), -0.5, 1.0))
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
        dropped: 3,
        file_index: None,
    }
}

/// After a change of the native layout: `cargo test -p spherule-formats --test corpus -- --ignored`.
#[test]
#[ignore = "writes into the corpus"]
fn write_the_native_corpus() {
    let origin = DVec3::new(1e6, 0.0, -3.0);
    let radii = Radius::PerParticle(vec![0.5, 0.25, 0.125]);
    for (name, frame) in [
        ("plain", frame(None, DVec3::ZERO, 17)),
        ("origin", frame(Some(Radius::Common(0.5)), origin, 2)),
        ("radii", frame(Some(radii), DVec3::ZERO, 3)),
        ("zero", frame(None, DVec3::ZERO, 0)),
    ] {
        let dir = corpus().join("native");
        fs::create_dir_all(&dir).expect("writable");
        native::write(&dir.join(name), &frame, Some(7)).expect("writable");
    }
}
