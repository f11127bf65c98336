//! The files of `tests/data/meshes`, written by VTK, meshio and trimesh, against `expected.tsv`, which numpy and
//! trimesh computed from the shapes (`make.py`).

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use spherule_formats::MemoryBudget;
use spherule_formats::mesh::{Mesh, read_mesh};

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/meshes")
}

/// A line of the table.
struct Expected {
    name: String,
    vertices: usize,
    triangles: usize,
    /// Lowest and highest coordinates, area, volume.
    numbers: Vec<f64>,
}

fn table() -> Vec<Expected> {
    let text = fs::read_to_string(directory().join("expected.tsv")).expect("the table");
    let line = |line: &str| {
        let cells: Vec<&str> = line.split('\t').collect();
        Expected {
            name: cells[0].to_owned(),
            vertices: cells[1].parse().expect("a count"),
            triangles: cells[2].parse().expect("a count"),
            numbers: cells[3..].iter().map(|cell| cell.parse().expect("a number")).collect(),
        }
    };
    text.lines().map(line).collect()
}

/// Bounds, area, and the volume as the integral of x over the surface, as trimesh computes it.
fn measure(mesh: &Mesh) -> Vec<f64> {
    let point = |index: u32| DVec3::from_array(mesh.vertices[index as usize]);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for vertex in &mesh.vertices {
        low = low.min(DVec3::from_array(*vertex));
        high = high.max(DVec3::from_array(*vertex));
    }
    let (mut area, mut volume) = (0.0, 0.0);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(point);
        let normal = (b - a).cross(c - a);
        area += normal.length() / 2.0;
        volume += normal.x * (a.x + b.x + c.x) / 6.0;
    }
    let mut numbers = low.to_array().to_vec();
    numbers.extend(high.to_array());
    numbers.extend([area, volume]);
    numbers
}

#[test]
fn meshes_of_other_libraries_have_their_measures() {
    let table = table();
    let listed: BTreeSet<String> = table.iter().map(|expected| expected.name.clone()).collect();
    let entries = fs::read_dir(directory()).expect("the directory");
    let names = entries.map(|entry| entry.expect("readable").file_name());
    let mut there: BTreeSet<String> = names.map(|n| n.to_string_lossy().into_owned()).collect();
    for other in ["README.md", "expected.tsv", "make.py"] {
        assert!(there.remove(other), "{other}");
    }
    assert_eq!(there, listed, "the files and the table");
    for expected in table {
        let name = &expected.name;
        let mesh = read_mesh(&directory().join(name), MemoryBudget::UNLIMITED).expect(name);
        let counts = (mesh.vertices.len(), mesh.triangles.len());
        assert_eq!(counts, (expected.vertices, expected.triangles), "{name}");
        // Some files have single precision, or text of six digits. The box has double precision in all of them.
        for (place, (found, expected)) in
            measure(&mesh).into_iter().zip(expected.numbers).enumerate()
        {
            let close = (found - expected).abs() <= 1e-9 * expected.abs() + 2e-6;
            assert!(close, "{name}: number {place} is {found}, not {expected}");
        }
    }
}
