//! Structures and trajectories of DL_POLY, good and damaged.

use glam::DVec3;

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

const EDGES: &str = "10 0 0\n0 20 0\n0 0 30\n";

/// Two atoms with so many vectors.
fn atoms(vectors: usize, properties: &str) -> String {
    let rows: String = (0..=vectors).map(|row| format!("  {row}.5 -2 3\n")).collect();
    format!("Na+ 1{properties}\n{rows}Cl 2{properties}\n{rows}")
}

fn structure(vectors: usize, boundary: usize, rest: &str) -> String {
    let edges = if boundary == 0 { "" } else { EDGES };
    format!("salt\n {vectors} {boundary}{rest}\n{edges}{}", atoms(vectors, ""))
}

fn history(frames: &[i64], tail: &str) -> String {
    let frame = |number: &i64| {
        format!("timestep {number} 2 1 3 0.002{tail}\n{EDGES}{}", atoms(1, " 22.99 1.0 0.1"))
    };
    format!("salt\n 1 3 2\n{}", frames.iter().map(frame).collect::<String>())
}

#[test]
fn structures_have_vectors_and_cells() {
    for (vectors, boundary, rest) in
        [(0, 0, ""), (1, 1, " 2"), (2, 3, " 2 -1.5E+03"), (0, 6, ""), (1, 4, " 2")]
    {
        let text = structure(vectors, boundary, rest);
        for text in [&text, &text.replace('\n', "\r\n"), &format!("{text}\n")] {
            assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature), "{text}");
            let found = READER.one(text.as_bytes());
            assert_eq!(numbers(&attribute(&found, "element").data), [11.0, 17.0]);
            assert_eq!(numbers(&attribute(&found, "id").data), [1.0, 2.0]);
            assert_eq!(coordinates(&found.positions), [[0.5, -2.0, 3.0]; 2]);
            let known = ["element", "id", "velocity", "force"];
            let expected: Vec<&str> =
                known[..2 + vectors].iter().copied().chain(["atom_name"]).collect();
            assert_eq!(names(&found), expected);
            assert_eq!(found.cell.is_some(), matches!(boundary, 1 | 3 | 6));
            if let Some(cell) = found.cell {
                assert_eq!(cell.origin, DVec3::new(-5.0, -10.0, -15.0));
                assert_eq!(cell.periodic[2], boundary != 6);
            }
        }
    }
    let bare = "title\n0 0 2\nNa\n 1 2 3\nCl\n 4 5 6\n";
    assert_eq!(names(&READER.one(bare.as_bytes())), ["element", "atom_name"]);
}

#[test]
fn trajectories_have_times_masses_and_charges() {
    for (tail, time) in [("", 20.0 * 0.002), (" 7.5", 7.5)] {
        let text = history(&[10, 20], tail);
        assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
        let frames = READER.all(text.as_bytes()).expect("frames");
        assert_eq!((frames.len(), frames[1].step, frames[1].time), (2, Some(20), Some(time)));
        let expected = ["element", "id", "mass", "charge", "velocity", "atom_name"];
        assert_eq!(names(&frames[0]), expected);
        assert_eq!(numbers(&attribute(&frames[1], "mass").data), [22.99, 22.99]);
        assert_eq!(numbers(&attribute(&frames[1], "velocity").data)[..3], [1.5, -2.0, 3.0]);
    }
}

#[test]
fn damage_is_named() {
    for (text, from, to, message) in [
        (structure(0, 1, ""), " 0 1", " 0 9", "codes 0 and 9, which are 0 to 2 and 0 to 7"),
        (structure(0, 1, ""), "0 20 0", "0 20", "the line ends before an edge of the cell"),
        (structure(0, 1, ""), "0.5", "x", "found \"x\" where a coordinate is expected"),
        (
            history(&[1], ""),
            "timestep 1 2",
            "timestep 1 99999999999",
            "no line of each atom: the file is cut short",
        ),
        (structure(1, 0, ""), "1.5 -2 3\nCl", "1.5 -2\nCl", "the line ends before a component"),
        (history(&[1], ""), "timestep 1 2", "timestep 1 3", "no line of each atom"),
        (history(&[1], ""), " 22.99", " heavy", "found \"heavy\" where mass is expected"),
    ] {
        let steps = FORMAT.steps(text.as_bytes()).expect("steps");
        let damaged = text.replacen(from, to, 1);
        let step = Step::at_bytes(0, steps[0].start()..damaged.len());
        let error = particles(damaged.as_bytes(), &step).expect_err("damaged").to_string();
        assert!(error.contains(message), "{error} | {message}");
    }
    for text in [structure(2, 1, " 2"), history(&[1, 2], "")] {
        READER.survives_truncation(text.as_bytes(), &[1, 8, 20, 40, 60, 80], 0);
    }
    let without_last = structure(0, 1, " 2").split("Cl").next().map(str::to_owned);
    let found = READER.one(without_last.expect("an atom").as_bytes());
    assert!(found.notes[0].contains("the file has 1 atoms; 2 in its second line"));
    let tight = MemoryBudget::new(100, "take care");
    let text = structure(2, 0, "");
    let mut source = ByteSource::whole(text.as_bytes());
    assert!(FORMAT.read_within(&mut source, &Step::whole(text.len()), tight).is_err());
}
