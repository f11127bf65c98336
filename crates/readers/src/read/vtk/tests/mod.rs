//! Samples of several writers; what the other test modules share.

mod content;
mod damage;
mod made;

use glam::{DVec3, Vec3};

use crate::read::Step;
use crate::read::pieces;
use spherule_frame::{Attribute, AttributeData, ParseError, Positions, RawParticles};

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(crate::read::vtk::FORMAT, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(crate::read::vtk::FORMAT, bytes, step)
}

fn sample(name: &str) -> Vec<u8> {
    let path = format!("{}/../../tests/data/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

#[track_caller]
fn parse(bytes: &[u8]) -> Result<RawParticles, ParseError> {
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
    match parse(bytes) {
        Ok(found) => found,
        Err(error) => panic!("{error}"),
    }
}

#[track_caller]
fn malformed(bytes: &[u8]) -> (u64, String) {
    match parse(bytes) {
        Err(ParseError::Malformed { at, what }) => (at, what),
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
    let truth = good(&sample("single_frames/legacy_polydata-4.2.vtk"));
    assert_eq!(truth.positions.len(), 1200);
    let first = Vec3::new(0.320_935_13, 0.457_511_8, 0.111_691_66);
    assert_eq!(truth.positions.get(0), first.as_dvec3());
    assert_eq!(attribute(&truth, "id").data.get_f64(0), 9458.0);
    assert_eq!(names(&truth), ["id", "density", "velocity"]);
    for (name, tolerance) in [
        ("legacy_polydata-5.1.vtk", 0.0),
        ("legacy_polydata-5.1-meta.vtk", 0.0),
        ("legacy_double.vtk", 0.0),
        ("legacy_ascii.vtk", 1e-5),
    ] {
        let found = good(&sample(&format!("single_frames/{name}")));
        assert_eq!(found.positions.len(), 1200, "{name}");
        assert_eq!(matches!(found.positions, Positions::F64(_)), name == "legacy_double.vtk");
        for i in 0..1200 {
            let distance = found.positions.get(i).distance(truth.positions.get(i));
            assert!(distance <= tolerance, "{name}: {i}: {distance}");
        }
        assert_eq!(attribute(&found, "id").data, attribute(&truth, "id").data);
        for other in ["density", "velocity"] {
            let (a, b) = (attribute(&found, other), attribute(&truth, other));
            assert_eq!(a.data.len(), b.data.len());
            for i in 0..a.data.len() {
                let (a, b) = (a.data.get_f64(i), b.data.get_f64(i));
                assert!((a - b).abs() <= tolerance * b.abs().max(1.0), "{name} {other} {i}");
            }
        }
    }
}

#[test]
fn splashsurf_samples() {
    for (name, count, attributes) in [
        ("double_dam_break_frame_01_4732_particles", 4732, &["id", "velocity"][..]),
        ("double_dam_break_frame_26_4732_particles", 4732, &["id", "velocity"]),
        ("hilbert2_7954_particles", 7954, &["id"]),
        ("free_particles_125_particles", 125, &[]),
        ("cube_8_particles", 8, &[]),
    ] {
        let found = good(&sample(&format!("public_splashsurf/{name}.vtk")));
        assert_eq!(found.positions.len(), count, "{name}");
        assert_eq!(names(&found), attributes, "{name}");
    }
    let cube = good(&sample("public_splashsurf/cube_8_particles.vtk"));
    let Positions::F64(points) = cube.positions else { panic!("double points are f64") };
    assert_eq!(points[1], DVec3::new(0.5, 0.499_509_5, 1.0));
}

#[test]
fn emitter_starts_without_particles() {
    let expected = ["id", "density", "velocity", "pressure_acceleration"];
    let none = good(&sample("emitter_sph/ParticleData_Fluid_1.vtk"));
    assert!(none.positions.is_empty());
    assert_eq!(names(&none), expected);
    let some = good(&sample("emitter_sph/ParticleData_Fluid_3.vtk"));
    assert_eq!(some.positions.len(), 90);
    assert_eq!(names(&some), expected);
    assert!(matches!(attribute(&some, "id").data, AttributeData::U32(_)));
}
