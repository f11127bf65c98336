//! Structures and trajectories of VASP, good and damaged.

use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};
use crate::read::pieces;

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(FORMAT, bytes)
}

fn particles(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(FORMAT, bytes, step)
}

const READER: TestedReader = TestedReader { steps, read: particles };

const CELL: &str = "4.0 0 0\n0 4.0 0\n1.0 0 8.0\n";

fn structure(scale: &str, species: &str, kind: &str) -> String {
    format!("Fe O\n{scale}\n{CELL}{species}1 2\n{kind}\n0 0 0\n.5 .5 .5\n0.25 0 0.5\n")
}

#[track_caller]
fn one(text: &str) -> RawParticles {
    assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature), "{text}");
    let found = READER.one(text.as_bytes());
    assert_eq!(READER.one(text.replace('\n', "\r\n").as_bytes()), found);
    found
}

#[test]
fn coordinates_are_scaled() {
    let edges = |scale: [f64; 3]| {
        [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [1.0, 0.0, 8.0]]
            .map(|edge: [f64; 3]| DVec3::from_array(edge) * DVec3::from_array(scale))
    };
    for (text, scale) in
        [("1.0", [1.0; 3]), ("  2.", [2.0; 3]), ("-1024.0 ", [2.0; 3]), ("1 2 3", [1.0, 2.0, 3.0])]
    {
        let [x, y, z] = scale;
        for kind in ["Direct", "direct coordinates", "D"] {
            let found = one(&structure(text, "Fe O\n", kind));
            assert_eq!(found.cell.expect("a cell").vectors, edges(scale));
            let positions = coordinates(&found.positions);
            assert_eq!(positions[1], [2.5 * x, 2.0 * y, 4.0 * z], "{text}");
            assert_eq!(positions[2], [1.5 * x, 0.0, 4.0 * z], "{text}");
        }
        let found = one(&structure(text, "Fe O\n", "Cartesian"));
        assert_eq!(coordinates(&found.positions)[2], [0.25 * x, 0.0, 0.5 * z]);
    }
}

#[test]
fn species_have_names_or_numbers() {
    for species in ["Fe O\n", " Fe_pv O_s ! potentials\n", "Fe/0a1b2c O\n", ""] {
        let found = one(&structure("1", species, "K"));
        assert_eq!(numbers(&attribute(&found, "element").data), [26.0, 8.0, 8.0], "{species}");
    }
    let text = structure("1", "", "K").replace("Fe O", "hematite");
    assert_eq!(numbers(&attribute(&one(&text), "type").data), [1.0, 2.0, 2.0]);
    let other = one(&structure("1", "Fe Water\n", "K"));
    assert!(numbers(&attribute(&other, "element").data)[1] >= 1000.0);
}

#[test]
fn fixed_atoms_and_velocities_are_columns() {
    let text = structure("1", "Fe O\n", "Selective dynamics\nDirect");
    let text = text
        .replace("0 0 0\n.5", "0 0 0 T F .FALSE.\n.5")
        .replace("0.25 0 0.5", "0.25 0 0.5 F F F");
    let found = one(&text);
    assert_eq!(numbers(&attribute(&found, "fixed").data), [0., 1., 1., 0., 0., 0., 1., 1., 1.]);
    for heading in ["", "Cartesian"] {
        let moving = format!("{text}{heading}\n1.0 2.0 3.0\n0.0 0.0 0.0\n0.0 0.0 1.E-02\n\n1\n");
        let velocities = numbers(&attribute(&one(&moving), "velocity").data);
        assert_eq!(velocities, [1., 2., 3., 0., 0., 0., 0., 0., 0.01]);
    }
    for rest in ["\n  48 48 48\n 0.1 0.2 0.3 0.4 0.5\n", "Direct\n0.1 0.2 0.3\n", "\n", " 1\n"] {
        assert_eq!(names(&one(&(text.clone() + rest))), ["element", "fixed"], "{rest}");
    }
    let error = READER.error_inside(format!("{text}\n0.0 0.0 0.0\n").as_bytes()).to_string();
    assert!(error.contains("no velocity of each atom: the file is cut short"), "{error}");
}

fn frame(number: usize) -> String {
    format!("Direct configuration= {number:5}\n0.5 0 0\n0 0.{number} 0\n")
}

#[test]
fn trajectories_have_one_cell_or_many() {
    let head = |scale: f64| format!("water\n{scale}\n{CELL}O H\n1 1\n");
    let constant = head(1.0) + &frame(1) + &frame(3) + &frame(4);
    let variable = head(1.0) + &frame(1) + &head(2.0) + &frame(3) + &head(4.0) + &frame(4);
    for (text, factors) in [(&constant, [1.0; 3]), (&variable, [1.0, 2.0, 4.0])] {
        assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
        let frames = READER.all(text.as_bytes()).expect("frames");
        assert_eq!(frames.iter().map(|f| f.step).collect::<Vec<_>>(), [Some(1), Some(3), Some(4)]);
        for (found, factor) in frames.iter().zip(factors) {
            assert_eq!(
                found.cell.expect("a cell").vectors[2],
                DVec3::new(factor, 0.0, 8.0 * factor)
            );
            assert_eq!(coordinates(&found.positions)[0], [2.0 * factor, 0.0, 0.0]);
        }
        READER.survives_truncation(text.as_bytes(), &[3, 20, 40, 60, 100], 0);
    }
    let cut = &constant[..constant.len() - 10];
    let error = READER.all(cut.as_bytes()).expect_err("cut").to_string();
    assert!(error.contains("still being written"), "{error}");
}

#[test]
fn damage_is_named() {
    let good = structure("1", "Fe O\n", "Direct");
    for (from, to, message) in [
        ("\n1\n", "\n0\n", "byte 5: the scale is neither"),
        ("\n1\n", "\nx\n", "byte 5: found \"x\" where a scale is expected"),
        ("0 4.0 0", "0 4.0", "byte 15: the line ends before an edge of the cell"),
        ("1 2\n", "1 2 3\n", "expected 2 numbers of atoms, found \"1 2 3\""),
        ("1 2\n", "1 -2\n", "expected 2 numbers of atoms"),
        (".5 .5 .5", ".5 x .5", "found \"x\" where a coordinate is expected"),
        (
            "1 2\n",
            "1 999999999999\n",
            "no atom where the head of the file counts one: the file is cut",
        ),
    ] {
        let text = good.replacen(from, to, 1);
        let error = READER.error_inside(text.as_bytes()).to_string();
        assert!(error.contains(message), "{error} | {message}");
    }
    assert!(READER.error_inside(b"").to_string().contains("no title"));
    let many = good.replacen("Fe O\n1 2", &format!("{}\n1 2", "H ".repeat(5000)), 1);
    assert!(READER.error_inside(many.as_bytes()).to_string().contains("more than 4096 species"));
    let tight = MemoryBudget::new(100, "take care");
    let mut source = ByteSource::whole(good.as_bytes());
    assert!(FORMAT.read_within(&mut source, &Step::whole(good.len()), tight).is_err());
}
