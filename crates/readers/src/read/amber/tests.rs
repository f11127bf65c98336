//! Units and factors of variables. Files of reference writers are in `tests/data/molecules`.

use super::*;
use crate::read::damage::{attribute, coordinates, numbers};

/// A variable of the written file: name, whether it has all three numbers of two atoms in each frame, units, factor.
type Written<'a> = (&'a str, &'a str, Option<f64>, &'a [f64]);

fn name(text: &str) -> Vec<u8> {
    let mut bytes = i32::try_from(text.len()).unwrap().to_be_bytes().to_vec();
    bytes.extend(text.bytes());
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

fn integers(numbers: &[i32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
}

/// Attributes of text and of one real number.
fn attributes(texts: &[(&str, &str)], factor: Option<f64>) -> Vec<u8> {
    let count = i32::try_from(texts.len() + usize::from(factor.is_some())).unwrap();
    let mut bytes = integers(&[if count == 0 { 0 } else { 12 }, count]);
    for (key, value) in texts {
        bytes.extend([name(key), integers(&[2]), name(value)].concat());
    }
    if let Some(factor) = factor {
        bytes.extend([name("scale_factor"), integers(&[6, 1])].concat());
        bytes.extend(factor.to_be_bytes());
    }
    bytes
}

/// A file of one frame of two atoms, CDF-1, with these variables in double precision.
fn file(variables: &[Written<'_>]) -> Vec<u8> {
    let mut head = b"CDF\x01".to_vec();
    head.extend(integers(&[0, 10, 3]));
    for (dimension, len) in [("frame", 1), ("atom", 2), ("spatial", 3)] {
        head.extend([name(dimension), integers(&[len])].concat());
    }
    head.extend(attributes(&[("Conventions", "AMBER"), ("program", "test")], None));
    head.extend(integers(&[11, i32::try_from(variables.len()).unwrap()]));
    let entry = |(title, units, factor, values): &Written<'_>, begin: i32| {
        let axes: &[i32] = match values.len() {
            1 => &[1, 0],
            3 => &[2, 0, 2],
            _ => &[3, 0, 1, 2],
        };
        let units: &[(&str, &str)] = if units.is_empty() { &[] } else { &[("units", units)] };
        let len = i32::try_from(8 * values.len()).unwrap();
        [name(title), integers(axes), attributes(units, *factor), integers(&[6, len, begin])]
            .concat()
    };
    let head_len = head.len() + variables.iter().map(|v| entry(v, 0).len()).sum::<usize>();
    let mut begin = i32::try_from(head_len).unwrap();
    let mut data = Vec::new();
    for variable in variables {
        head.extend(entry(variable, begin));
        begin += i32::try_from(8 * variable.3.len()).unwrap();
        data.extend(variable.3.iter().flat_map(|n| n.to_be_bytes()));
    }
    [head, data].concat()
}

const PLACES: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

fn time_and_note(units: &str, factor: Option<f64>, velocity_units: &str) -> (Option<f64>, String) {
    let bytes = file(&[
        ("time", units, factor, &[8.0]),
        ("coordinates", "angstrom", None, &PLACES),
        ("velocities", velocity_units, None, &PLACES),
    ]);
    let steps = FORMAT.steps(&bytes).expect("a good file");
    let particles = FORMAT.read(&bytes, &steps[0]).expect("a good frame");
    assert_eq!(particles.time, steps[0].time);
    (particles.time, FORMAT.reader().notes(&bytes).remove(0))
}

#[test]
fn times_are_in_picoseconds() {
    for (units, factor, expected, note) in [
        ("picosecond", None, 8.0, "times in ps"),
        ("", None, 8.0, "times in ps"),
        ("picosecond", Some(0.005), 0.04, "times in ps"),
        ("femtosecond", None, 0.008, "times in ps (the file has femtosecond)"),
        ("femtosecond", Some(0.5), 0.004, "times in ps (the file has femtosecond)"),
        ("nanosecond", None, 8000.0, "times in ps (the file has nanosecond)"),
        ("lj", None, 8.0, "times in lj"),
    ] {
        let (time, found) = time_and_note(units, factor, "angstrom/femtosecond");
        let time = time.expect("a time");
        assert!((time - expected).abs() < 1e-12, "{units}: {time}");
        let expected = format!("lengths in angstrom, velocities in angstrom/femtosecond, {note}");
        assert!(found.ends_with(&expected), "{found}");
    }
}

#[test]
fn factors_scale_positions_velocities_and_cells() {
    let bytes = file(&[
        ("coordinates", "nanometer", Some(10.0), &PLACES),
        ("velocities", "", Some(20.455), &PLACES),
        ("cell_lengths", "", Some(2.0), &[1.0, 2.0, 3.0]),
        ("cell_angles", "radian", Some(0.5), &[std::f64::consts::PI; 3]),
    ]);
    let particles = FORMAT.read(&bytes, &Step::with_key(0, 0)).expect("a good frame");
    assert_eq!(coordinates(&particles.positions)[1], [40.0, 50.0, 60.0]);
    assert_eq!(numbers(&attribute(&particles, "velocity").data)[1], 2.0 * 20.455);
    let cell = particles.cell.expect("a cell");
    let lengths = cell.vectors.map(glam::DVec3::length);
    assert!(
        (0..3).all(|axis| (lengths[axis] - [2.0, 4.0, 6.0][axis]).abs() < 1e-12),
        "{lengths:?}"
    );
    assert_eq!(particles.time, None);
}
