//! Samples of other projects: counts and bounds, or the error that names what the file is.

use spherule_formats::FrameFile;
use spherule_formats::stats::FrameStats;

use super::data_files;
use crate::harness::sample;

/// What a file must come out as.
enum Is {
    /// Particles, and the corners of their box to six digits.
    Particles(u64, [f64; 3], [f64; 3]),
    /// Rejected with this message.
    Refused(&'static str),
}
use Is::{Particles, Refused};

const PARTIO: &[(&str, Is)] = &[
    ("base.bgeo", Particles(5, [0.0, 0.1, 0.2], [0.4, 0.5, 0.6])),
    ("baseidsfaceid.bgeo", Particles(8, [-0.5; 3], [0.5; 3])),
    ("delta.bgeo", Particles(3, [0.1, 0.2, 0.3], [0.5, 0.6, 0.7])),
    ("json.bgeo", Particles(5, [0.0, 0.1, 0.2], [0.4, 0.5, 0.6])),
    ("scatter.bgeo", Particles(25, [-1.40815, -1.39196, -1.43791], [1.38595, 1.41138, 1.42019])),
    ("test.bgeo", Particles(5, [0.0, 0.1, 0.2], [0.4, 0.5, 0.6])),
    ("test.geo", Refused("a Houdini text .geo, which is not read")),
    ("test.pdb", Refused("a PDB particle file, which is not read")),
];

const SPLASHSURF: &[(&str, Is)] = &[
    ("cube_8_particles.vtk", Particles(8, [0.5, 0.49951, 0.5], [1.0, 0.99951, 1.0])),
    ("cube_8_particles.vtu", Particles(8, [0.5, 0.49951, 0.5], [1.0, 0.99951, 1.0])),
    ("cube_normals.ply", Refused("a mesh with 12 faces, not particles")),
    (
        "dam_break_frame_9_6859_particles.bgeo",
        Particles(6859, [-1.95163, 0.0356821, -0.710432], [-0.387622, 0.68165, 0.710896]),
    ),
    (
        "double_dam_break_frame_01_4732_particles.vtk",
        Particles(4732, [-1.45, 0.0499902, -1.45], [1.45, 0.69999, 1.45]),
    ),
    (
        "double_dam_break_frame_26_4732_particles.vtk",
        Particles(4732, [-1.51527, -0.0152515, -1.51509], [1.51521, 1.01685, 1.51523]),
    ),
    (
        "fluid_250_particles.vtu",
        Particles(250, [0.113318, 0.147773, 0.109714], [5.07079, 1.1394, 1.09019]),
    ),
    (
        "fluid_encoded_250_particles.vtu",
        Particles(250, [0.113318, 0.147773, 0.109714], [5.07079, 1.1394, 1.09019]),
    ),
    (
        "free_particles_125_particles.vtk",
        Particles(125, [154.847, 28.3771, 128.54], [164.518, 35.4659, 136.759]),
    ),
    (
        "hilbert2_7954_particles.vtk",
        Particles(7954, [-0.670118, -0.652979, 0.00318272], [0.666072, 0.666563, 1.34228]),
    ),
];

const PYSPH: &[(&str, Is)] = &[
    ("dam_break_3d_00100_gzip.hdf5", Particles(8716, [-0.06, -0.56, -0.06], [3.24, 0.52, 1.02])),
    ("dam_break_3d_00300.npz", Refused("pickled python objects ('|O'), which are never unpickled")),
    (
        "dam_break_3d_fluid_00100.vtu",
        Particles(2880, [0.0566783, -0.443256, 0.056489], [1.2196, 0.463895, 0.537251]),
    ),
    ("dam_break_3d_obstacle_00100.vtu", Particles(36, [2.46, -0.14, 0.06], [2.58, 0.16, 0.12])),
];

#[test]
fn partio() {
    check("public_partio", PARTIO);
}

#[test]
fn splashsurf() {
    check("public_splashsurf", SPLASHSURF);
}

#[test]
fn pysph() {
    check("pysph", PYSPH);
}

#[track_caller]
fn check(directory: &str, files: &[(&str, Is)]) {
    let listed: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    assert_eq!(data_files(directory), listed);
    for (name, is) in files {
        let read = FrameFile::open(&sample(&format!("{directory}/{name}"))).and_then(|f| f.read(0));
        match (is, read) {
            (Particles(count, min, max), Ok(raw)) => {
                let stats = FrameStats::of(&raw);
                assert_eq!((stats.count, stats.dropped), (*count, 0), "{name}");
                let (low, high) = stats.bounds.expect(name);
                near(name, low.to_array(), *min);
                near(name, high.to_array(), *max);
            }
            (Refused(what), Err(error)) => {
                let message = error.to_string();
                assert!(message.contains(name) && message.contains(what), "{message}");
            }
            (Particles(..), Err(error)) => panic!("{name}: {error}"),
            (Refused(_), Ok(raw)) => panic!("{name}: {} particles", raw.positions.len()),
        }
    }
}

#[track_caller]
fn near(name: &str, found: [f64; 3], expected: [f64; 3]) {
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs();
        assert!(off <= 5e-6 * expected.abs().max(0.1), "{name}: {found}, not {expected}");
    }
}
