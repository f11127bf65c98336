//! What must be found in files that are right, however odd.

use glam::Vec3;

use super::made::{NASTY, TestFile, modern, splish};
use super::{attribute, good, malformed, names, parse};
use spherule_frame::{AttributeData, ParseError, Positions, RawParticles};

#[track_caller]
fn nasty_points(found: &RawParticles) {
    let points: Vec<Vec3> = NASTY.as_chunks().0.iter().map(|p| Vec3::from_array(*p)).collect();
    assert_eq!(found.positions, Positions::F32(points));
}

#[test]
fn payloads_may_contain_keywords() {
    let bytes = TestFile::new("4.1").three_points("POLYDATA").0;
    nasty_points(&good(&bytes));
    let found = good(
        &TestFile::new("4.1")
            .three_points("UNSTRUCTURED_GRID")
            .text("CELL_TYPES 3\n")
            .ints([1, 1, 1])
            .text("\nVECTORS v float\n")
            .floats(&NASTY)
            .0,
    );
    nasty_points(&found);
    assert_eq!(attribute(&found, "v").data, AttributeData::F32(NASTY.to_vec()));
}

#[test]
fn cells_in_text_may_be_counted_wrongly() {
    let file = |lines: &str| {
        format!(
            "# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0\n1 0 0\n2 0 0\n{lines}\n\
             POINT_DATA 3\nSCALARS h float\nLOOKUP_TABLE default\n1 2 3\n"
        )
    };
    for lines in [
        "LINES 1 4\n3 0 1 2",
        "LINES 1 4\n3\n0\n1\n2\n2\n2",
        "LINES 1 6\n3 0 1 2",
        "POLYGONS 1 3 3\n3 0 1 2\nLINES 1 2\n2 0 1",
    ] {
        let found = good(file(lines).as_bytes());
        assert_eq!(attribute(&found, "h").data, AttributeData::F32(vec![1.0, 2.0, 3.0]), "{lines}");
    }
    let cut = file("LINES 1 4\n3 0 1 2")
        .replace("\nPOINT_DATA", "#")
        .split('#')
        .next()
        .map(str::to_owned)
        .expect("a beginning")
        .replace("1 2", "1");
    assert!(parse(cut.as_bytes()).is_err());
}

#[test]
fn no_or_any_white_space_may_follow_a_payload() {
    for gap in ["", "\n", "\r\n", "\n\n", " \r\n \n"] {
        let found = good(
            &TestFile::new("3.0")
                .text("DATASET POLYDATA\r\nPOINTS 3 float\r\n")
                .floats(&NASTY)
                .text(gap)
                .text("VERTICES 1 4\r\n")
                .ints([3, 0, 1, 2])
                .text(gap)
                .text("POINT_DATA 3\r\nscalars Id INT\r\nlookup_table default\r\n")
                .ints([10, 13, 32])
                .text(gap)
                .text("NORMALS n FLOAT\r\n")
                .floats(&NASTY)
                .0,
        );
        nasty_points(&found);
        assert_eq!(attribute(&found, "Id").data, AttributeData::I32(vec![10, 13, 32]));
        assert_eq!(names(&found), ["Id", "n"], "{gap:?}");
    }
}

#[test]
fn every_kind_of_point_attribute_is_kept_and_cell_data_are_not() {
    let found = good(
        &TestFile::new("4.2")
            .three_points("POLYDATA")
            .text("CELL_DATA 2\nSCALARS id int\nLOOKUP_TABLE t\n")
            .ints([1, 2])
            .text("\nFIELD f 1\nvelocity 3 2 float\n")
            .floats(&NASTY[..6])
            .text("\nPOINT_DATA 3\nSCALARS id int\n")
            .ints([7, 8, 9])
            .text("\nLOOKUP_TABLE colours 2\n")
            .bytes(b"RGBARGBA")
            .text("\nCOLOR_SCALARS rgb 3\n")
            .bytes(b"123456789")
            .text("\nTENSORS t float\n")
            .floats(&[0.5; 27])
            .text("\nGLOBAL_IDS g vtkIdType\n")
            .ints([4, 5, 6])
            .text("\nPEDIGREE_IDS names string\n")
            .bytes(b"\xc1a\xc2bc\x80\x01d")
            .text("\nTEXTURE_COORDINATES uv 2 float\n")
            .floats(&NASTY[..6])
            .text("\nFIELD FieldData 5\nvel%20x 1 3 short\n")
            .bytes(&[0, 1, 255, 255, 0, 3])
            .text("\nother 1 2 float\n")
            .floats(&NASTY[..2])
            .text("\nflags 3 3 bit\n")
            .bytes(&[0b1010_0000, 0b1000_0000])
            .0,
    );
    assert_eq!(names(&found), ["id", "rgb", "t", "g", "uv", "vel x", "flags"]);
    assert_eq!(attribute(&found, "id").data, AttributeData::I32(vec![7, 8, 9]));
    assert_eq!(attribute(&found, "rgb").data, AttributeData::U8(b"123456789".to_vec()));
    assert_eq!(attribute(&found, "g").data, AttributeData::I32(vec![4, 5, 6]));
    assert_eq!(attribute(&found, "vel x").data, AttributeData::I16(vec![1, -1, 3]));
    let flags = vec![1, 0, 1, 0, 0, 0, 0, 0, 1];
    assert_eq!(attribute(&found, "flags").data, AttributeData::U8(flags));
}

#[test]
fn long_may_have_four_bytes() {
    let start = || TestFile::new("4.0").three_points("POLYDATA");
    for wide in [true, false] {
        let made = start().text("POINT_DATA 3\nSCALARS id long\nLOOKUP_TABLE default\n");
        let made = if wide { made.longs([1, -2, 3]) } else { made.ints([1, -2, 3]) };
        let found = good(&made.text("\nVECTORS v float\n").floats(&NASTY).0);
        let expected = if wide {
            AttributeData::I64(vec![1, -2, 3])
        } else {
            AttributeData::I32(vec![1, -2, 3])
        };
        assert_eq!(attribute(&found, "id").data, expected);
        assert_eq!(attribute(&found, "v").data.len(), 9);
    }
}

#[test]
fn time_precedes_the_points() {
    let points = [[1.0, 2.0, 3.0]];
    let found = good(&modern(&points, &[4], &points));
    assert_eq!(found.time, Some(0.25));
    assert_eq!(names(&found), ["id", "velocity"]);
    let ascii = b"# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nFIELD FieldData 2\n\
        CYCLE 1 1 int\n7\nTIME 1 1 double\n1.5\nPOINTS 1 double\n0 nan 1e400\n";
    let found = good(ascii);
    assert_eq!(found.time, Some(1.5));
    assert!(found.positions.get(0).y.is_nan());
}

#[test]
fn ascii_is_free_form() {
    let found = good(
        b"# vtk DataFile Version 2.0\n\nASCII\n\nDATASET POLYDATA\nPOINTS 2 FLOAT\n0 1\n2 -1.#IND 4 5\n\
        VERTICES 1 3\n2 0 1 POINT_DATA 2\nSCALARS a float\nLOOKUP_TABLE default\n1\n2\n\
        COLOR_SCALARS c 2\n0.5 1 0 0.25\nFIELD f 3\nnames 1 2 string\nPOINTS%20a\nCELLS b\nn 1 2 vtkIdType\n5000000000 -1\n\
        METADATA\nCOMPONENT_NAMES\nSCALARS\n\nu 1 2 unsigned_char\n255 7\nVECTORS v double\n1 2 3 4 5 6",
    );
    assert_eq!(names(&found), ["a", "c", "n", "u", "v"]);
    let expected = AttributeData::I64(vec![5_000_000_000, -1]);
    assert_eq!(attribute(&found, "n").data, expected);
    assert_eq!(attribute(&found, "c").data, AttributeData::U8(vec![128, 255, 0, 64]));
    assert_eq!(attribute(&found, "u").data, AttributeData::U8(vec![255, 7]));
}

#[test]
fn field_may_declare_too_many_arrays() {
    let made = || {
        TestFile::new("4.1")
            .three_points("POLYDATA")
            .text("POINT_DATA 3\nFIELD FieldData 4\na 1 3 int\n")
            .ints([1, 2, 3])
    };
    assert_eq!(names(&good(&made().text("\n").0)), ["a"]);
    let more = made().text("\nSCALARS b int\n").ints([1, 2, 3]).0;
    assert_eq!(names(&good(&more)), ["a", "b"]);
    malformed(&made().text("\nrubbish\n").0);
}

#[test]
fn zero_points() {
    let none = good(
        b"# vtk DataFile Version 5.1\nvtk output\nBINARY\nDATASET POLYDATA\nPOINTS 0 float\n\n",
    );
    assert!(none.positions.is_empty());
    assert!(good(&splish(&[], &[], &[])).positions.is_empty());
    assert!(good(&modern(&[], &[], &[])).positions.is_empty());
}

#[test]
fn data_sets_without_particles_are_rejected_by_name() {
    for kind in ["STRUCTURED_POINTS", "STRUCTURED_GRID", "RECTILINEAR_GRID", "FIELD"] {
        match parse(&TestFile::new("3.0").text(&format!("DATASET {kind}\n")).0) {
            Err(ParseError::Unsupported { what }) => assert!(what.contains(kind), "{what}"),
            other => panic!("{kind}: {other:?}"),
        }
    }
    assert!(matches!(
        parse(b"# vtk DataFile Version 6.0\n\nASCII\n"),
        Err(ParseError::Unsupported { .. })
    ));
}

#[test]
fn old_cell_format_in_a_new_file() {
    let cells = vec![0_i32; 20_000];
    let found = good(
        &TestFile::new("5.1")
            .three_points("POLYDATA")
            .text("VERTICES 1 20000\n")
            .ints(cells)
            .text("POINT_DATA 3\nSCALARS id int\n")
            .ints([1, 2, 3])
            .0,
    );
    nasty_points(&found);
    assert_eq!(names(&found), ["id"]);
}
