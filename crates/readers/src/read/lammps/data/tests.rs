use glam::DVec3;

use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers, sample};
use crate::read::pieces;

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(FORMAT, bytes)
}

fn particles(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(FORMAT, bytes, step)
}

const READER: TestedReader = TestedReader { steps, read: particles };

/// Water, its lines in another order than its ids.
const WATER: &str =
    "LAMMPS data file via write_data, version 2 Aug 2023, timestep = 5, units = real

3 atoms
2 atom types
2 bonds # of the molecule
1 bond types
1 extra bond per atom

-1.5 2.5 xlo xhi
0 4 ylo yhi
0 5 zlo zhi
0.5 0.25 -0.5 xy xz yz

Masses

1 15.9994 # OW
2 1.008   # HW

Pair Coeffs # lj/cut

1 0.1553 3.166
2 0 0

Atoms # full

7 1 2 0.4238 1.5 0.25 -0.125 0 -1 0
5 1 1 -0.8476 0.5 0.25 0.125 0 0 0 # oxygen
6 1 2 0.4238 -0.5 1e-3 nan 0 0 1

Velocities

6 0.5 0.25 6.5
5 1 2 3
7 -1 -2 -3

Bonds

1 1 5 6
2 1 7 5
";

fn read(text: &str) -> RawParticles {
    let sniffed = FORMAT.reader().sniff(text.as_bytes());
    assert_eq!(sniffed, Ok(Confidence::Signature), "{text}");
    READER.one(text.as_bytes())
}

#[track_caller]
fn column(particles: &RawParticles, name: &str) -> Vec<f64> {
    numbers(&attribute(particles, name).data)
}

#[test]
fn atoms_are_joined_by_id() {
    for text in [WATER, &WATER.replace('\n', "\r\n")] {
        let water = read(text);
        assert_eq!(names(&water), ["id", "mol", "type", "q", "element", "mass", "velocity"]);
        assert_eq!(column(&water, "id"), [5.0, 6.0, 7.0]);
        assert_eq!(column(&water, "type"), [1.0, 2.0, 2.0]);
        assert_eq!(column(&water, "q"), [-0.8476, 0.4238, 0.4238]);
        assert_eq!(column(&water, "element"), [8.0, 1.0, 1.0]);
        assert_eq!(column(&water, "mass"), [15.9994, 1.008, 1.008]);
        assert_eq!(column(&water, "velocity"), [1.0, 2.0, 3.0, 0.5, 0.25, 6.5, -1.0, -2.0, -3.0]);
        assert_eq!(water.positions.get(0), DVec3::new(0.5, 0.25, 0.125));
        assert!(water.positions.get(1).z.is_nan() && water.positions.get(1).y == 1e-3);
        assert_eq!(water.bonds, [[0, 1], [2, 0]]);
        assert_eq!(water.labels["type"][&2], "HW");
        let cell = water.cell.expect("a cell");
        assert_eq!(cell.origin, DVec3::new(-1.5, 0.0, 0.0));
        assert_eq!(cell.vectors[0], DVec3::new(4.0, 0.0, 0.0));
        assert_eq!(cell.vectors[1], DVec3::new(0.5, 4.0, 0.0));
        assert_eq!(cell.vectors[2], DVec3::new(0.25, -0.5, 5.0));
        assert!(water.notes.is_empty());
        let notes = FORMAT.reader().notes(text.as_bytes());
        assert_eq!(notes.len(), 2, "{notes:?}");
    }
}

#[test]
fn general_boxes_have_three_vectors() {
    let start = WATER.find("-1.5 2.5").expect("the box");
    let end = WATER.find("Masses").expect("a section");
    let text = format!(
        "{}1 2 3 avec\n0 4 0 bvec\n0.5 0 6 cvec\n7 8 9 abc origin\n\n{}",
        &WATER[..start],
        &WATER[end..]
    );
    let cell = read(&text).cell.expect("a cell");
    assert_eq!(cell.origin, DVec3::new(7.0, 8.0, 9.0));
    let vectors = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 4.0, 0.0), DVec3::new(0.5, 0.0, 6.0)];
    assert_eq!(cell.vectors, vectors);
}

/// One atom, with `header` lines, what is behind the heading, and the columns.
fn one(header: &str, comment: &str, row: &str) -> String {
    format!("a title\n\n1 atoms\n2 atom types\n{header}\n\nAtoms{comment}\n\n{row}\n")
}

#[track_caller]
fn style(header: &str, comment: &str, row: &str, expected: &str, has_images: bool) {
    let text = one(header, comment, row);
    let particles = read(&text);
    let found = names(&particles).join(" ");
    assert_eq!(found, expected, "{comment} {row}");
    assert_eq!(coordinates(&particles.positions), [[0.5, 1.5, 2.5]], "{row}");
    let notes = FORMAT.reader().notes(text.as_bytes()).join(" ");
    assert_eq!(notes.contains("image flags"), has_images, "{notes}");
    let notes = particles.notes.join(" ");
    assert_eq!(notes.contains("does not name its atom style"), comment.is_empty(), "{notes}");
}

#[test]
fn styles_are_named_or_follow_from_the_columns() {
    let place = "0.5 1.5 2.5";
    for (row, expected) in [
        ("1 2 P", "id type"),
        ("1 2 -0.5 P", "id type q"),
        ("1 7 2 P", "id mol type"),
        ("1 7 2 -0.5 P", "id mol type q"),
        ("1 2 0.5 2.7 P", "id type diameter density"),
        ("1 7 2 0.5 2.7 P", "id mol type diameter density"),
    ] {
        let row = row.replace('P', place);
        style("", "", &row, expected, false);
        style("", "", &format!("{row} 0 -1 12"), expected, true);
    }
    style("", "", &format!("1 2 -0.5 {place} 0.1 0.2 0.3"), "id type q mux muy muz", false);
    style("1 ellipsoids", "", &format!("1 2 1 2.7 {place}"), "id type density", false);
    style("1 bodies", "", &format!("1 2 1 2.7 {place}"), "id type mass", false);
    // A charge that is an integer, and a style with fewer columns than there are
    style("", " # charge", &format!("1 2 1 {place}"), "id type q", false);
    style("", "# atomic", &format!("1 2 {place}"), "id type", false);
    style(
        "",
        " # smd",
        &format!("1 2 7 1 2 3 4 9 9 9 {place}"),
        "id type mol volume mass kradius cradius",
        false,
    );
    let hybrid = read(&one("", " # hybrid", &format!("1 2 {place} 0.5 7 0 0 0")));
    assert_eq!(names(&hybrid), ["id", "type"]);
    assert_eq!(hybrid.notes.len(), 1);
    let error = READER.error(one("", "", "1 2 3 4 5 6 7 8 9 10.5 11 12.5").as_bytes()).to_string();
    assert!(error.contains("does not follow from the 12 columns"), "{error}");
}

#[test]
fn types_may_have_labels() {
    let text = "t\n2 atoms\n2 atom types\n0 1 xlo xhi\n\nAtom Type Labels\n\n1 Si\n2 O2\n\nMasses\n\n\
        Si 28.0855\n2 15.999\n\nAtoms # atomic\n\n2 O2 1 2 3\n1 Si 4 5 6\n";
    for text in [text, &text.replace("1 Si 4", "1 1 4")] {
        let found = read(text);
        assert_eq!(column(&found, "type"), [1.0, 2.0]);
        assert_eq!(column(&found, "element"), [14.0, 8.0]);
        assert_eq!(found.labels["type"][&2], "O2");
    }
    let fails = |from, to, message| {
        let error = READER.error(text.replace(from, to).as_bytes()).to_string();
        assert!(error.contains(message), "{error}");
    };
    fails("2 O2\n", "2 SI\n", "is like that of another type");
    fails("O2 1", "O3 1", "has the type 0");
}

#[test]
fn elements_need_masses_of_atoms() {
    let with = |from: &str, to: &str| names(&read(&WATER.replace(from, to))).contains(&"element");
    assert!(with("units = real", "units = metal") && with(", units = real", ""));
    assert!(!with("units = real", "units = lj"));
    assert!(!with("15.9994", "18.0"));
    let reduced = WATER.replace("15.9994", "1").replace("1.008 ", "1.0 ");
    assert!(names(&read(&reduced)).contains(&"element"));
    assert!(!names(&read(&reduced.replace(", units = real", ""))).contains(&"element"));
}

#[test]
fn damage_is_named() {
    for (from, to, message) in [
        ("3 atoms", "3.5 atoms", "\"3.5\" in \"3.5 atoms\" is not a count"),
        ("3 atoms", "-3 atoms", "is not a count"),
        ("3 atoms\n", "\n", "no line with the number of atoms"),
        ("3 atoms", "4 atoms", "section Atoms has 3 lines and not the 4 of the header"),
        ("3 atoms", "2 atoms", "section Atoms has more lines than the header says"),
        ("3 atoms", "99999999999 atoms", "section Atoms has 99999999999 lines by the header"),
        ("2 bonds", "1 bonds", "section Bonds has more lines"),
        ("2 bonds", "3 bonds", "section Bonds has 2 of 3 lines: the file is cut short"),
        ("2 atom types", "1 atom types", "section Masses has more lines"),
        ("-1.5 2.5 xlo", "-1.5 -2.5 xlo", "the box ends before it begins"),
        ("-1.5 2.5 xlo", "-1.5 wide xlo", "\"wide\" in a line of the box"),
        ("1 15.9994", "1 heavy", "is not the number of an atom type and its mass"),
        ("1 15.9994", "9 15.9994", "is not the number of an atom type and its mass"),
        ("7 1 2 0.4238", "6 1 2 0.4238", "section Atoms has the atom 6 twice"),
        ("7 1 2 0.4238", "7.5 1 2 0.4238", "is not an integer"),
        ("7 1 2 0.4238", "7 1 3 0.4238", "an atom has the type 3"),
        ("7 1 2 0.4238", "7 1 2 much", "column 4 has \"much\", not a number"),
        ("6 0.5 0.25", "8 0.5 0.25", "section Velocities lacks the atom 6"),
        (
            "6 0.5 0.25",
            "2 0.5 0.25",
            "section Velocities has the atom 2, which section Atoms lacks",
        ),
        ("1 1 5 6", "1 1 5 8", "a bond has the atom 8, which section Atoms lacks"),
        ("1 1 5 6", "1 1 5 x", "column 4 has \"x\""),
        ("Atoms # full", "Atom", "section Velocities stands before section Atoms"),
        ("Velocities", "Atoms # full", "line has 4 of 7 columns"),
    ] {
        let text = WATER.replace(from, to);
        assert_ne!(text, WATER, "{from}");
        let error = READER.error_inside(text.as_bytes()).to_string();
        assert!(error.contains(message), "{error} | {message}");
    }
    let end = WATER.find("Bonds\n").expect("a section");
    READER.survives_truncation(WATER.as_bytes(), &[10, 20, 300, 400, 500], end - 30);
    let tight = MemoryBudget::new(100, "take care");
    let mut source = ByteSource::whole(WATER.as_bytes());
    let step = Step::whole(WATER.len());
    assert!(FORMAT.read_within(&mut source, &step, tight).is_err());
}

/// Two ellipsoids and a point, as `write_data` writes them.
const ELLIPSOIDS: &str = "t\n3 atoms\n1 atom types\n2 ellipsoids\n0 9 xlo xhi\n0 9 ylo yhi\n0 9 zlo zhi\n\n\
    Atoms # ellipsoid\n\n1 1 1 2.5 1 2 3\n2 1 0 2.5 4 5 6\n4 1 1 2.5 7 8 0\n\n\
    Ellipsoids\n\n4 1 2 3 0.5 -0.5 0.5 -0.5\n1 4 5 6 1 0 0 0 # upright\n";

#[test]
fn ellipsoids_have_the_columns_of_dumps() {
    let found = read(ELLIPSOIDS);
    assert_eq!(column(&found, "shapex"), [4.0, 0.0, 1.0]);
    assert_eq!(column(&found, "shapez"), [6.0, 0.0, 3.0]);
    assert_eq!(column(&found, "quatw"), [1.0, 0.0, 0.5]);
    assert_eq!(column(&found, "quatk"), [0.0, 0.0, -0.5]);
    assert!(!names(&found).contains(&"block1"));
    // The exponents of superellipsoids follow
    let exponents = ELLIPSOIDS.replace("-0.5\n", "-0.5 8 2\n").replace("0 # upright", "0 4 4");
    assert_eq!(column(&read(&exponents), "block1"), [4.0, 0.0, 8.0]);
    for (from, to, message) in [
        ("2 ellipsoids", "3 ellipsoids", "section Ellipsoids has 2 of 3 lines"),
        ("2 ellipsoids", "1 ellipsoids", "section Ellipsoids has more lines than the header says"),
        ("2 ellipsoids\n", "", "section Ellipsoids has more lines"),
        ("2 ellipsoids", "2.5 ellipsoids", "is not a count"),
        ("\n4 1 2 3 0.5", "\n3 1 2 3 0.5", "has the atom 3, which section Atoms lacks"),
        ("\n4 1 2 3 0.5", "\n1 1 2 3 0.5", "section Ellipsoids has the atom 1 twice"),
        ("\n4 1 2 3 0.5", "\n4 1 wide 3 0.5", "column 3 has \"wide\""),
        ("0.5 -0.5\n", "0.5\n", "line has 7 of 8 columns"),
        ("Atoms # ellipsoid", "Atom", "section Ellipsoids stands before section Atoms"),
    ] {
        let text = ELLIPSOIDS.replace(from, to);
        assert_ne!(text, ELLIPSOIDS, "{from}");
        let error = READER.error_inside(text.as_bytes()).to_string();
        assert!(error.contains(message), "{error} | {message}");
    }
    let end = ELLIPSOIDS.find(" # upright").expect("the last line");
    READER.survives_truncation(ELLIPSOIDS.as_bytes(), &[40, 120, 180], end - 3);
}

#[test]
fn files_without_atoms_are_legal() {
    let empty =
        read("t\n0 atoms\n1 atom types\n0 1 xlo xhi\n0 1 ylo yhi\n0 1 zlo zhi\n\nAtoms\n\n");
    assert!(empty.positions.is_empty() && empty.cell.is_some());
}

#[test]
fn the_sample_is_read() {
    let particles = READER.one(&sample("molecules/ethanol.data"));
    assert_eq!(particles.positions.len(), 9);
    assert_eq!(particles.bonds.len(), 8);
}
