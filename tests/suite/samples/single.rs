//! One dam-break frame in every format and encoding: all files give the same 1200 particles.

use std::fs;

use spherule_formats::{Attribute, FrameFile, RawParticles, Sequence, SequenceInput};

use super::data_files;
use crate::harness::sample;

const COUNT: usize = 1200;
const DIRECTORY: &str = "single_frames";

/// How well a file keeps the numbers.
#[derive(Debug, Clone, Copy)]
enum Kept {
    /// To the last bit of f32.
    Exactly,
    /// As decimal text with so many significant digits.
    Digits(i32),
    /// Not at all.
    Not,
}
use Kept::{Digits, Exactly, Not};

/// What a file holds beside the positions, under the names that its tool gives.
struct Holds {
    positions: Kept,
    velocity: (&'static str, Kept),
    density: (&'static str, Kept),
    /// Name, and what is added to the ids.
    id: Option<(&'static str, i64)>,
}

const VTK: Holds = Holds {
    positions: Exactly,
    velocity: ("velocity", Exactly),
    density: ("density", Exactly),
    id: Some(("id", 0)),
};
/// VTK's ASCII and ParaView's default.
const SIX_DIGITS: Holds = Holds {
    positions: Digits(6),
    velocity: ("velocity", Digits(6)),
    density: ("density", Digits(6)),
    ..VTK
};
const PLY: Holds = Holds { density: ("", Not), ..VTK };
const NPZ: Holds = Holds { velocity: ("velocities", Exactly), id: Some(("ids", 0)), ..VTK };
const DUALSPHYSICS: Holds = Holds {
    positions: Digits(8),
    velocity: ("Vel", Digits(8)),
    density: ("Rhop", Digits(8)),
    id: Some(("Idp", 0)),
};
const BARE: Holds = Holds { positions: Exactly, velocity: ("", Not), density: ("", Not), id: None };
const BARE_TEXT: Holds = Holds { positions: Digits(7), ..BARE };

/// Every file of the directory.
const FILES: &[(&str, Holds)] = &[
    ("ascii.ply", PLY),
    ("ascii.vtp", VTK),
    ("ascii.vtu", VTK),
    ("base64-zlib.vtp", VTK),
    ("base64-zlib.vtu", VTK),
    ("base64.vtp", VTK),
    ("base64.vtu", VTK),
    ("be.ply", PLY),
    ("color.ply", PLY),
    ("compressed.npz", NPZ),
    (
        "custom.lammpstrj",
        Holds {
            positions: Digits(7),
            velocity: ("velocity", Digits(6)),
            density: ("", Not),
            // LAMMPS counts from 1.
            id: Some(("id", 1)),
        },
    ),
    ("double.ply", PLY),
    ("dualsphysics-comma.csv", DUALSPHYSICS),
    ("dualsphysics.csv", DUALSPHYSICS),
    (
        "ext.xyz",
        Holds {
            positions: Digits(7),
            velocity: ("velo", Digits(6)),
            density: ("", Not),
            id: Some(("id", 0)),
        },
    ),
    ("f64.npy", BARE),
    ("fortran.npy", BARE),
    ("inline-zlib.vtp", VTK),
    ("inline-zlib.vtu", VTK),
    ("inline.vtp", VTK),
    ("inline.vtu", VTK),
    ("le.ply", PLY),
    ("legacy_ascii.vtk", SIX_DIGITS),
    ("legacy_double.vtk", VTK),
    ("legacy_polydata-4.2.vtk", VTK),
    ("legacy_polydata-5.1-meta.vtk", VTK),
    ("legacy_polydata-5.1.vtk", VTK),
    ("mol.xyz", BARE_TEXT),
    ("paraview.csv", SIX_DIGITS),
    ("plain.csv", BARE_TEXT),
    ("plain.npz", NPZ),
    ("pos.npy", BARE),
    ("raw-lz4.vtu", VTK),
    ("raw-lzma.vtu", VTK),
    ("raw-zlib.vtp", VTK),
    ("raw-zlib.vtu", VTK),
    ("raw-zlib_u64_f64.vtu", VTK),
    ("raw.vtp", VTK),
    ("raw.vtu", VTK),
    ("raw.xyz", BARE),
    ("struct.npy", Holds { velocity: ("vel", Exactly), ..PLY }),
];

/// The particles, cut out of two files by hand.
struct Truth {
    positions: Vec<f32>,
    velocity: Vec<f32>,
    density: Vec<f32>,
    id: Vec<u32>,
}

impl Truth {
    fn new() -> Self {
        let raw = fs::read(sample("single_frames/raw.xyz")).expect("raw.xyz");
        let vtk = fs::read(sample("single_frames/legacy_polydata-4.2.vtk")).expect("a VTK file");
        let after = |line: &[u8]| {
            let start = vtk.windows(line.len()).position(|w| w == line);
            &vtk[start.expect("the line is there") + line.len()..]
        };
        let words = |bytes: &[u8], count: usize| -> Vec<[u8; 4]> {
            bytes.as_chunks().0.iter().take(count).copied().collect()
        };
        let floats = |line: &[u8], count: usize| {
            let words = words(after(line), count);
            words.into_iter().map(f32::from_be_bytes).collect()
        };
        Self {
            positions: words(&raw, 3 * COUNT).into_iter().map(f32::from_le_bytes).collect(),
            velocity: floats(b"velocity 3 1200 float\n", 3 * COUNT),
            density: floats(b"density 1 1200 float\n", COUNT),
            id: words(after(b"id 1 1200 unsigned_int\n"), COUNT)
                .into_iter()
                .map(u32::from_be_bytes)
                .collect(),
        }
    }
}

#[test]
fn every_file_is_listed() {
    let listed: Vec<&str> = FILES.iter().map(|(name, _)| *name).collect();
    assert_eq!(data_files(DIRECTORY), listed);
}

#[test]
fn all_files_contain_the_same_particles() {
    let truth = Truth::new();
    for (name, holds) in FILES {
        let path = sample(&format!("{DIRECTORY}/{name}"));
        let file = FrameFile::open(&path).expect(name);
        assert_eq!(file.steps().len(), 1, "{name}");
        let particles = file.read(0).expect(name);
        check(name, &particles, holds, &truth);

        let sequence = Sequence::open(&SequenceInput::from_path(&path)).expect(name);
        assert_eq!(sequence.frames().len(), 1, "{name}");
        let again = sequence.load_raw(0).expect(name);
        assert!(again == particles, "{name} differs as a sequence");
    }
}

#[track_caller]
fn check(name: &str, particles: &RawParticles, holds: &Holds, truth: &Truth) {
    assert_eq!(particles.positions.len(), COUNT, "{name}");
    let positions: Vec<f64> =
        (0..COUNT).flat_map(|i| particles.positions.get(i).to_array()).collect();
    compare(name, "positions", &positions, &truth.positions, holds.positions);
    for (what, (attribute, kept), values) in
        [("velocity", holds.velocity, &truth.velocity), ("density", holds.density, &truth.density)]
    {
        if !matches!(kept, Not) {
            let found = find(name, particles, attribute);
            assert_eq!(found.components, values.len() / COUNT, "{name}: {what}");
            compare(name, what, &numbers(found), values, kept);
        }
    }
    if let Some((attribute, shift)) = holds.id {
        let found = numbers(find(name, particles, attribute));
        let ids = truth.id.iter().map(|id| f64::from(*id) + shift as f64);
        assert!(found.iter().copied().eq(ids), "{name}: ids");
    }
}

#[track_caller]
fn find<'a>(name: &str, particles: &'a RawParticles, attribute: &str) -> &'a Attribute {
    let found = particles.attributes.iter().find(|a| a.name == attribute);
    found.unwrap_or_else(|| panic!("{name}: no attribute {attribute}"))
}

fn numbers(attribute: &Attribute) -> Vec<f64> {
    (0..attribute.data.len()).map(|i| attribute.data.get_f64(i)).collect()
}

#[track_caller]
fn compare(name: &str, what: &str, found: &[f64], truth: &[f32], kept: Kept) {
    assert_eq!(found.len(), truth.len(), "{name}: {what}");
    for (index, (found, truth)) in found.iter().zip(truth).enumerate() {
        let truth = f64::from(*truth);
        let allowed = match kept {
            Exactly | Not => 0.0,
            // Half a unit of the last digit, and the text may be kept in f32.
            Digits(digits) => {
                let last = 10_f64.powi(1 - digits) * 10_f64.powf(truth.abs().log10().floor());
                0.5 * last + truth.abs() * f64::from(f32::EPSILON)
            }
        };
        let off = (found - truth).abs();
        // Also fails for NaN.
        assert!(off <= allowed, "{name}: {what} {index} is {found}, not {truth}");
    }
}
