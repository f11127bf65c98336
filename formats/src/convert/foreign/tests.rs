//! A mapped source has the same particles as the reader of its format.

mod damage;
mod made;

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::*;
use crate::{FrameFile, RawParticles};
use spherule_frame::with_values;

/// The files in a folder of the repository's `tests`.
fn files_under(folder: &str) -> Vec<PathBuf> {
    let root = format!("{}/../tests/{folder}", env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![PathBuf::from(root)];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of the repository") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

fn read_whole(path: &Path) -> Result<RawParticles, FrameError> {
    FrameFile::open(path)?.read(0)
}

/// Compares a source with the result of the reader, in runs of `run` particles.
#[track_caller]
fn same_in_runs(source: &dyn ParticleSource, raw: &RawParticles, run: usize) {
    let count = raw.positions.len();
    // Compare the positions
    for first in (0..count).step_by(run) {
        let mut positions = vec![DVec3::NAN; run.min(count - first)];
        let read = source.read_positions(first as u64, &mut positions);
        read.expect("these particles are there");
        for (i, position) in positions.iter().enumerate() {
            let bits = |p: DVec3| p.to_array().map(f64::to_bits);
            let expected = raw.positions.get(first + i);
            assert_eq!(bits(*position), bits(expected), "{position} {expected}");
        }
    }
    // Compare the attributes
    for (number, attribute) in raw.attributes.iter().enumerate() {
        let all: Vec<u8> = with_values!(&attribute.data, values => {
            values.iter().flat_map(|value| value.to_le_bytes()).collect()
        });
        let width = source.attributes()[number].width();
        for (at, expected) in all.chunks(run * width).enumerate() {
            let mut values = vec![0x55; expected.len()];
            let read = source.read_values(number, (at * run) as u64, &mut values);
            read.expect("these values are there");
            assert!(values == expected, "{} from {}", attribute.name, at * run);
        }
    }
}

/// Compares a source with the reader of its format.
#[track_caller]
fn same(source: &dyn ParticleSource, raw: &RawParticles) {
    assert_eq!(source.count(), raw.positions.len() as u64);
    assert_eq!(source.time(), raw.time);
    assert_eq!(source.step(), raw.step);
    let described = |a: &crate::Attribute| (a.name.clone(), a.components, a.data.scalar_type());
    let expected: Vec<_> = raw.attributes.iter().map(described).collect();
    let found: Vec<_> =
        source.attributes().iter().map(|a| (a.name.clone(), a.components, a.scalar)).collect();
    assert_eq!(found, expected);
    for run in [1009, 4097, 100_003] {
        same_in_runs(source, raw, run);
    }
    source.check().expect("nobody touched it");
}

#[test]
fn samples_stream_as_they_are_read() {
    let mut streamed = Vec::new();
    for path in files_under("data") {
        let Ok(Some(source)) = open_source(&path) else {
            continue;
        };
        same(&*source, &read_whole(&path).expect("a good file"));
        streamed.push(path.file_name().expect("a file").to_string_lossy().into_owned());
    }
    for name in [
        "le.ply",
        "be.ply",
        "color.ply",
        "double.ply",
        "pos.npy",
        "f64.npy",
        "fortran.npy",
        "struct.npy",
        "legacy_polydata-4.2.vtk",
        "legacy_polydata-5.1-meta.vtk",
        "legacy_double.vtk",
        "ParticleData_Fluid_1.vtk",
        "ParticleData_Fluid_3.vtk",
        "raw.xyz",
    ] {
        assert!(streamed.iter().any(|s| s == name), "{name} of {streamed:?}");
    }
}

#[test]
fn unsupported_layouts_fall_back_to_the_readers() {
    for name in ["ascii.ply", "legacy_ascii.vtk", "plain.npz", "mol.xyz", "plain.csv", "raw.vtu"] {
        let path = format!("{}/../tests/data/single_frames/{name}", env!("CARGO_MANIFEST_DIR"));
        let source = open_source(Path::new(&path));
        assert!(source.expect("a good file").is_none(), "{name}");
    }
}

#[test]
fn run_beyond_the_end_is_rejected() {
    let path = format!("{}/../tests/data/single_frames/le.ply", env!("CARGO_MANIFEST_DIR"));
    let source = open_source(Path::new(&path)).expect("a good file").expect("binary");
    let mut to = [DVec3::ZERO; 2];
    assert!(source.read_positions(1198, &mut to).is_ok());
    for first in [1199, 1200, u64::MAX] {
        let error = source.read_positions(first, &mut to).expect_err("beyond the end");
        assert!(error.to_string().contains("the file has 1200"), "{error}");
    }
    assert!(source.read_values(0, 1199, &mut [0; 12]).is_ok());
    assert!(source.read_values(0, 1199, &mut [0; 24]).is_err());
    assert!(source.read_values(0, 0, &mut [0; 11]).is_err());
    assert!(source.read_values(7, 0, &mut [0; 12]).is_err());
}
