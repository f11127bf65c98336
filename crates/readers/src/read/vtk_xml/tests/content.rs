//! What must be found in files that are right, and what valid files are refused.

use glam::Vec3;

use super::made::{Made, Style, all_styles, ids, made, points};
use super::{attribute, good, malformed, names, parse_file};
use crate::read::vtk;
use spherule_frame::{AttributeData, ParseError, Positions};

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn every_encoding_of_every_size_is_read() {
    for style in all_styles() {
        for sizes in [&[0][..], &[1], &[4], &[5], &[0, 3, 0, 2], &[1, 1, 1], &[]] {
            let file = made(style, sizes);
            let found =
                parse_file(&file).unwrap_or_else(|error| panic!("{style:?} {sizes:?}: {error}"));
            let total: usize = sizes.iter().sum();
            assert_eq!(found.time, Some(0.75), "{style:?}");
            assert_eq!(found.positions.len(), total);
            let mut at = 0;
            for &n in sizes {
                let expected = vtk::positions(points(n));
                for i in 0..n {
                    assert_eq!(found.positions.get(at + i), expected.get(i), "{style:?} {sizes:?}");
                    let id = attribute(&found, "id").data.get_f64(at + i);
                    assert_eq!(id, 7.0 * i as f64);
                }
                at += n;
            }
            if !sizes.is_empty() {
                assert_eq!(names(&found), ["id", "a < b"]);
                assert_eq!(attribute(&found, "a < b").data, AttributeData::U8(vec![65; total]));
            }
        }
    }
}

#[test]
fn pieces_have_nan_for_what_they_lack() {
    let piece = |made: Made, n: usize, extra: &[(&str, usize, AttributeData)]| {
        let mut made = made
            .xml(&format!("<Piece NumberOfPoints=\"{n}\"><Points>"))
            .array("p", 3, &points(n))
            .xml("</Points><PointData>");
        for (name, components, data) in extra {
            made = made.array(name, *components, data);
        }
        made.xml("</PointData></Piece>")
    };
    let bytes = |n: usize| AttributeData::U8(vec![1; n]);
    let file = Made::new(Style::RAW);
    let file = piece(
        file,
        2,
        &[
            ("a", 1, ids(2)),
            ("b", 1, ids(2)),
            ("c", 1, ids(2)),
            ("d", 2, bytes(4)),
            ("a", 1, ids(2)),
        ],
    );
    let file = piece(file, 0, &[]);
    let file = piece(file, 1, &[("d", 1, bytes(1)), ("c", 1, bytes(1)), ("a", 1, ids(1))]);
    let found = good(&file.end());
    assert_eq!(names(&found), ["a", "b", "c"]);
    assert_eq!(attribute(&found, "a").data, AttributeData::U32(vec![0, 7, 0]));
    assert_eq!(attribute(&found, "c").data, AttributeData::U32(vec![0, 7, 1]));
    assert!(attribute(&found, "b").data.get_f64(2).is_nan());
    let notes = [
        "part `piece 2` without `b`: NaN there",
        "`d` with different numbers of components in parts `piece 0`, `piece 2`: left out",
        "several columns `a` in part `piece 0`: the first is used",
    ];
    assert_eq!(found.notes, notes);
}

#[test]
fn one_double_piece_makes_all_double() {
    let file = Made::new(Style::RAW)
        .xml("<Piece NumberOfPoints=\"1\"><Points>")
        .array("p", 3, &AttributeData::F32(vec![1.0, 2.0, 3.0]))
        .xml("</Points></Piece><Piece NumberOfPoints=\"1\"><Points>")
        .array("p", 3, &AttributeData::F64(vec![0.1, 0.2, 0.3]))
        .xml("</Points></Piece>")
        .end();
    let found = good(&file);
    assert!(matches!(found.positions, Positions::F64(_)));
    assert_eq!(found.positions.get(0), Vec3::new(1.0, 2.0, 3.0).as_dvec3());
    assert_eq!(found.positions.get(1).x, 0.1);
}

#[test]
fn lists_and_grids_are_rejected_with_a_remedy() {
    for (kind, remedy) in [
        ("PUnstructuredGrid", "as the input"),
        ("PPolyData", "as the input"),
        ("Collection", "as the input"),
        ("vtkMultiBlockDataSet", "as the input"),
        ("ImageData", "PolyData"),
        ("RectilinearGrid", "PolyData"),
        ("StructuredGrid", "PolyData"),
    ] {
        match parse_file(format!("<VTKFile type=\"{kind}\"></VTKFile>").as_bytes()) {
            Err(ParseError::Unsupported { what }) => {
                assert!(what.contains(kind) && what.contains(remedy), "{what}");
            }
            other => panic!("{kind}: {other:?}"),
        }
    }
    let unknown = "<VTKFile type=\"PolyData\" compressor=\"vtkNewCompressor\"></VTKFile>";
    let error = parse_file(unknown.as_bytes());
    assert!(matches!(error, Err(ParseError::Unsupported { what }) if what.contains("vtkNew")));
    malformed(b"<svg></svg>");
    malformed(b"");
    malformed(b"<VTKFile type=\"PolyData\"><PolyData>");
}

#[test]
fn text_around_the_numbers_is_ignored() {
    let mut file = b"\xef\xbb\xbf<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\r\n".to_vec();
    file.extend(
        b"<!DOCTYPE x>\r\n<VTKFile type='UnstructuredGrid' byte_order='LittleEndian'>\r\n\
        <UnstructuredGrid><Piece NumberOfPoints=' 1 '><PointData>\
        <DataArray type='int16' Name='H\xf6he' format='ascii'><!-- \xfc -->5</DataArray></PointData>\
        <Points><DataArray type='Float32' Name='' format='ascii'>1\r\n2<!-- ! -->3</DataArray></Points>\
        </Piece></UnstructuredGrid></VTKFile>",
    );
    let found = good(&file);
    assert_eq!(found.positions, Positions::F32(vec![Vec3::new(1.0, 2.0, 3.0)]));
    assert_eq!(found.attributes[0].name, "H?he");
    assert_eq!(found.attributes[0].data, AttributeData::I16(vec![5]));
}
