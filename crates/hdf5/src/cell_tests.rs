//! Simulation cells of HDF5 files, against cells computed by hand.

use glam::DVec3;
use spherule_frame::SimulationCell;

use super::FORMAT;

fn sample(name: &str) -> Vec<u8> {
    let path = format!("{}/../../tests/data/hdf5/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(path).expect("a sample")
}

/// The cells of all steps of `bytes`.
fn cells(bytes: &[u8]) -> Vec<Option<SimulationCell>> {
    let steps = FORMAT.steps(bytes).expect("steps");
    let cell = |step| FORMAT.read(bytes, step).expect("particles").cell;
    steps.iter().map(cell).collect()
}

/// A periodic cube.
fn cube(edge: f64) -> Option<SimulationCell> {
    SimulationCell::new(
        DVec3::ZERO,
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| edge * axis),
        [true; 3],
    )
}

#[test]
fn h5md_files_have_cells_that_may_change() {
    let read = |name: &str| cells(&sample(&format!("cell-{name}.h5md")));
    let moving = |step: f64| {
        [
            DVec3::new(4.0 + step, 0.0, 0.0),
            DVec3::new(0.5, 3.0, 0.0),
            DVec3::new(0.25, 0.75, 2.0 - 0.5 * step),
        ]
    };
    let cell = |vectors, periodic| SimulationCell::new(DVec3::ZERO, vectors, periodic);
    let expected = [0.0, 1.0, 2.0].map(|step| cell(moving(step), [true, false, true]));
    assert_eq!(read("moving"), expected);
    assert_eq!(read("fixed"), [cell(moving(1.0), [true; 3]); 3]);
    let lengths = [3.0 * DVec3::X, 2.5 * DVec3::Y, 2.0 * DVec3::Z];
    assert_eq!(read("lengths"), [cell(lengths, [false; 3]); 3]);
    // A group `box` without edges
    assert_eq!(cells(&sample("polymer.h5md")), [None; 3]);
}

#[test]
fn gadget_snapshots_have_cells_by_the_size_of_their_box() {
    let read = |bytes: &[u8]| cells(bytes)[0];
    assert_eq!(read(&sample("swift.hdf5")), cube(2.0));
    let bytes = sample("gadget.hdf5");
    assert_eq!(read(&bytes), cube(10.0));
    for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let (old, mut damaged) = (10.0_f64.to_le_bytes(), bytes.clone());
        let at = bytes.windows(8).position(|eight| eight == old).expect("the size");
        damaged[at..at + 8].copy_from_slice(&size.to_le_bytes());
        assert_eq!(read(&damaged), None, "{size}");
    }
}
