//! Samples of several writers; what the other test modules share.

mod content;
mod damage;
mod made;

use crate::read::Step;
use crate::read::pieces;
use spherule_frame::{Attribute, AttributeData, ParseError, Positions, RawParticles};

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(crate::read::vtk_xml::FORMAT, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(crate::read::vtk_xml::FORMAT, bytes, step)
}

fn sample(name: &str) -> Vec<u8> {
    let path = format!("{}/../../tests/data/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

#[track_caller]
fn parse_file(bytes: &[u8]) -> Result<RawParticles, ParseError> {
    let steps = steps(bytes).expect("steps never fails");
    assert_eq!(steps.len(), 1);
    let found = read(bytes, &steps[0]);
    if let Ok(found) = &found {
        assert_eq!(found.time, steps[0].time);
        for attribute in &found.attributes {
            assert_eq!(
                attribute.data.len(),
                attribute.components * found.positions.len(),
                "{}",
                attribute.name
            );
        }
    }
    found
}

#[track_caller]
fn good(bytes: &[u8]) -> RawParticles {
    match parse_file(bytes) {
        Ok(found) => found,
        Err(error) => panic!("{error}"),
    }
}

#[track_caller]
fn malformed(bytes: &[u8]) -> String {
    match parse_file(bytes) {
        Err(ParseError::Malformed { what, .. }) => what,
        other => panic!("not malformed: {other:?}"),
    }
}

#[track_caller]
fn attribute<'a>(found: &'a RawParticles, name: &str) -> &'a Attribute {
    let by_name = found.attributes.iter().find(|a| a.name == name);
    by_name.unwrap_or_else(|| panic!("no {name} among {:?}", names(found)))
}

fn names(found: &RawParticles) -> Vec<&str> {
    found.attributes.iter().map(|a| a.name.as_str()).collect()
}

#[test]
fn every_variant_contains_the_same_particles() {
    let legacy = sample("single_frames/legacy_polydata-4.2.vtk");
    let truth = crate::read::vtk::FORMAT.read(&legacy, &Step::whole(legacy.len())).unwrap();
    let folder = format!("{}/../../tests/data/single_frames", env!("CARGO_MANIFEST_DIR"));
    let mut checked = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.ends_with(".vtu") && !name.ends_with(".vtp") {
            continue;
        }
        checked += 1;
        let found = good(&sample(&format!("single_frames/{name}")));
        let is_double = matches!(found.positions, Positions::F64(_));
        assert_eq!(is_double, name == "raw-zlib_u64_f64.vtu", "{name}");
        let tolerance = if name.starts_with("ascii") { 1e-7 } else { 0.0 };
        assert_eq!(found.positions.len(), 1200, "{name}");
        for i in 0..1200 {
            let distance = found.positions.get(i).distance(truth.positions.get(i));
            assert!(distance <= tolerance, "{name}: {i}: {distance}");
        }
        assert_eq!(attribute(&found, "id").data, attribute(&truth, "id").data, "{name}");
        for other in ["density", "velocity"] {
            let (a, b) = (attribute(&found, other), attribute(&truth, other));
            assert_eq!((a.components, a.data.len()), (b.components, b.data.len()));
            for i in 0..a.data.len() {
                let (a, b) = (a.data.get_f64(i), b.data.get_f64(i));
                let error = (a - b).abs() / b.abs().max(1.0);
                assert!(error <= tolerance, "{name} {other} {i}");
            }
        }
    }
    assert_eq!(checked, 17);
}

#[test]
fn splashsurf_samples() {
    let cube = good(&sample("public_splashsurf/cube_8_particles.vtu"));
    let corner = glam::DVec3::new(0.5, 0.499_509_5, 1.0);
    assert!(cube.positions.get(1).distance(corner) < 1e-15);
    let expected = ["velocity", "pressure", "density", "index"];
    let meshio = good(&sample("public_splashsurf/fluid_250_particles.vtu"));
    let paraview = good(&sample("public_splashsurf/fluid_encoded_250_particles.vtu"));
    for found in [&meshio, &paraview] {
        assert_eq!(found.positions.len(), 250);
        assert_eq!(names(found), expected);
        assert!(matches!(attribute(found, "index").data, AttributeData::I64(_)));
        assert!(matches!(found.positions, Positions::F64(_)));
    }
    assert_eq!(meshio.positions, paraview.positions);
    assert_eq!(meshio.attributes, paraview.attributes);
}

#[test]
fn headers_may_be_encoded_separately() {
    let fluid = good(&sample("pysph/dam_break_3d_fluid_00100.vtu"));
    assert_eq!(fluid.positions.len(), 2880);
    assert_eq!(names(&fluid), ["u", "v", "w", "rho", "p", "velocity"]);
    for axis in 0..3 {
        let name = ["u", "v", "w"][axis];
        for i in 0..2880 {
            assert_eq!(
                attribute(&fluid, name).data.get_f64(i),
                attribute(&fluid, "velocity").data.get_f64(3 * i + axis)
            );
        }
    }
    let rho = &attribute(&fluid, "rho").data;
    assert!((0..2880).all(|i| (900.0..1100.0).contains(&rho.get_f64(i))));
    let obstacle = good(&sample("pysph/dam_break_3d_obstacle_00100.vtu"));
    assert_eq!(obstacle.positions.len(), 36);
}
