//! The same two parts, wherever they come from, become the same columns with the same note.

use std::fs;
use std::path::{Path, PathBuf};

use spherule_formats::convert::open_source;
use spherule_formats::sequence::{Sequence, SequenceInput};
use spherule_formats::{AttributeData, RawParticles};

/// A piece of XML: two particles of fluid with `rho` of f32 and `Vel`, or one of the wall with `rho` of f64.
fn piece(is_fluid: bool) -> &'static str {
    if is_fluid {
        "<Piece NumberOfPoints=\"2\"><PointData>\
         <DataArray type=\"Float32\" Name=\"rho\">1 2</DataArray>\
         <DataArray type=\"Float32\" Name=\"Vel\" NumberOfComponents=\"3\">3 0 0 0 4 0</DataArray></PointData>\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">0 0 0 1 0 0</DataArray></Points></Piece>"
    } else {
        "<Piece NumberOfPoints=\"1\"><PointData>\
         <DataArray type=\"Float64\" Name=\"rho\">0.1</DataArray></PointData>\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">0 1 0</DataArray></Points></Piece>"
    }
}

fn vtu(pieces: &str) -> String {
    format!(
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>{pieces}</UnstructuredGrid></VTKFile>"
    )
}

const USD: &str = "#usda 1.0
def Points \"fluid\" { point3f[] points = [(0, 0, 0), (1, 0, 0)]
  float[] primvars:rho = [1, 2] vector3f[] primvars:Vel = [(3, 0, 0), (0, 4, 0)] }
def Points \"wall\" { point3f[] points = [(0, 1, 0)] double[] primvars:rho = [0.1] }
";

/// Asserts what the frame at `input` has, except for the numbers of parts.
#[track_caller]
fn is_joined(input: &SequenceInput, wall: &str) -> RawParticles {
    let sequence = Sequence::open(input).expect("readable");
    let mut loaded = sequence.load_measured(0).expect("a frame");
    assert_eq!(loaded.notes, [format!("part `{wall}` without `Vel`: NaN there")]);
    loaded.particles.attributes.sort_by(|a, b| a.name.cmp(&b.name));
    let attributes = &loaded.particles.attributes;
    let column = |name: &str| attributes.iter().find(|a| a.name == name).expect(name);
    assert_eq!(column("rho").data, AttributeData::F64(vec![1.0, 2.0, 0.1]));
    let AttributeData::F32(velocity) = &column("Vel").data else {
        panic!("the type of the file");
    };
    assert_eq!(velocity[..6], [3.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    assert!(velocity.len() == 9 && velocity[6..].iter().all(|v| v.is_nan()));
    loaded.particles
}

#[test]
fn parts_are_joined_alike_wherever_they_come_from() {
    let dir = tempfile::tempdir().expect("a directory");
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().expect("a directory")).expect("writable");
        fs::write(&path, text).expect("writable");
        path
    };
    let path = |path: PathBuf| SequenceInput::from_path(path);
    // Pieces of a file
    let both = write("one/both.vtu", &vtu(&[piece(true), piece(false)].concat()));
    is_joined(&path(both), "piece 1");
    // Files of a step
    let fluid = write("files/fluid_1.vtu", &vtu(piece(true)));
    let wall = write("files/wall_1.vtu", &vtu(piece(false)));
    is_joined(&SequenceInput::Files(vec![fluid, wall]), "wall");
    // Lists of pieces and of blocks
    let pieces = "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><Piece Source=\"fluid_1.vtu\"/>\
                  <Piece Source=\"wall_1.vtu\"/></PUnstructuredGrid></VTKFile>";
    is_joined(&path(write("files/both.pvtu", pieces)), "piece 1");
    let blocks = "<VTKFile type=\"vtkMultiBlockDataSet\"><vtkMultiBlockDataSet>\
                  <DataSet index=\"0\" name=\"water\" file=\"fluid_1.vtu\"/>\
                  <DataSet index=\"1\" name=\"tank\" file=\"wall_1.vtu\"/></vtkMultiBlockDataSet></VTKFile>";
    is_joined(&path(write("files/both.vtm", blocks)), "tank");
    // Prims and groups
    is_joined(&path(write("both.usda", USD)), "/wall");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let groups = root.join("../tests/data/join/parts.h5");
    is_joined(&path(groups.clone()), "/wall");
    // The same note when the file is streamed
    let source = open_source(&groups).expect("a good file").expect("one step");
    assert_eq!(source.notes(), ["part `/wall` without `Vel`: NaN there"]);
}
