//! A domain a million units from zero with particles a thousandth apart: f32 would make it a
//! single point, so its shape must survive reading, rendering and printing.

use std::fs;
use std::path::Path;

use glam::DVec3;
use serde_json::Value;
use spherule_formats::{ParticleFrame, Sequence, SequenceInput, choose_origin};

use crate::harness::Workshop;
use crate::picture::Picture;

const SPACING: f64 = 1e-3;
const OFFSET: DVec3 = DVec3::new(1e6, -2e6, 3e6);
/// Particles along each axis.
const SIDE: [u32; 3] = [12, 9, 7];

/// A lattice at `offset`.
fn lattice(offset: DVec3) -> Vec<DVec3> {
    let [x, y, z] = SIDE;
    let all = (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| (i, j, k))));
    all.map(|(i, j, k)| offset + SPACING * DVec3::new(i.into(), j.into(), k.into())).collect()
}

/// Writes `points` as numpy does, `<f8` of shape (N, 3).
fn write_npy(path: &Path, points: &[DVec3]) {
    let shape = format!("({}, 3)", points.len());
    let dict = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{dict:117}\n").bytes());
    assert_eq!(bytes.len(), 128);
    for point in points {
        bytes.extend(point.to_array().into_iter().flat_map(f64::to_le_bytes));
    }
    fs::write(path, bytes).expect("a file");
}

#[test]
fn positions_keep_their_shape() {
    let workshop = Workshop::new();
    let points = lattice(OFFSET);
    write_npy(&workshop.join("far.npy"), &points);
    let sequence = Sequence::open(&SequenceInput::from_path(workshop.join("far.npy")))
        .expect("a sequence of one");
    let origin = choose_origin(points[0], points[points.len() - 1]);
    assert!((origin - OFFSET).length() < 0.1, "{origin}");
    let frame: ParticleFrame = sequence.load(0, origin).expect("the frame");
    assert_eq!((frame.len(), frame.dropped), (points.len(), 0));
    for (found, expected) in frame.positions.iter().zip(&points) {
        // The relative position rounded once to f32 is all that may happen.
        assert_eq!(*found, (*expected - origin).as_vec3());
        let off = (found.as_dvec3() + origin - *expected).length();
        assert!(off < 1e-5 * SPACING, "{off:e}");
    }
}

#[test]
fn bounds_are_printed_in_world_units() {
    let workshop = Workshop::new();
    let points = lattice(OFFSET);
    write_npy(&workshop.join("far.npy"), &points);
    let ran = workshop.run(&["inspect", "--json", "far.npy"]).expect(0);
    let object: Value = serde_json::from_str(&ran.text()).expect("one object");
    assert_eq!(object["encoding"], "f64");
    for (key, corner) in [("min", points[0]), ("max", points[points.len() - 1])] {
        let bounds: Vec<f64> = serde_json::from_value(object["bounds"][key].clone()).expect("xyz");
        assert_eq!(bounds, corner.to_array());
    }
}

#[test]
fn pictures_are_those_of_the_same_particles_at_zero() {
    let workshop = Workshop::new();
    write_npy(&workshop.join("far.npy"), &lattice(OFFSET));
    write_npy(&workshop.join("near.npy"), &lattice(DVec3::ZERO));
    let render = |input: &str, output: &str| {
        let arguments = ["render", input, "-o", output, "--width", "96", "--height", "54"];
        let more = ["--samples", "1", "--radius", "0.0004", "--channels", "RGBA,Z,N,id"];
        let ran = workshop.run(&[&arguments[..], &more].concat()).expect(0);
        (Picture::open(&workshop.join(output)), ran.errors())
    };
    let (far, errors) = render("far.npy", "far/f.exr");
    let (near, _) = render("near.npy", "near/f.exr");

    let origin: Vec<f64> =
        serde_json::from_value(far.facts.as_ref().expect("facts")["origin"].clone())
            .expect("a point");
    let origin = DVec3::from_slice(&origin);
    assert!((origin - OFFSET).length() < 0.1, "{origin}");
    assert!(errors.contains(&format!("origin {origin}")), "{errors}");
    assert_eq!(near.facts.as_ref().expect("facts")["origin"], serde_json::json!([0.0, 0.0, 0.0]));

    // f64 at three million has steps of 5e-10, half a millionth of the spacing: edges of a few
    // pixels may move.
    let same = far.integers("id.I").iter().zip(near.integers("id.I")).filter(|(a, b)| a == b);
    assert!(same.count() + 10 >= 96 * 54);
    let depths = far.floats("Z").iter().zip(near.floats("Z"));
    let both = depths.filter(|(a, b)| a.is_finite() && b.is_finite());
    let mut off: Vec<f64> = both.map(|(a, b)| f64::from((a - b).abs())).collect();
    assert!(off.len() > 96 * 54 / 4, "{}", off.len());
    off.sort_by(f64::total_cmp);
    assert!(off[off.len() - 20] < 1e-3 * SPACING, "{:e}", off[off.len() - 20]);
}
