//! Formats that people can read.

use super::base::Base;
use super::{Made, NAN, WHOLE, little};

pub(super) fn vtk_ascii() -> Vec<Made> {
    let head = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n";
    let with = |points: &[[f32; 3]]| format!("{head}{}", text(points)).into_bytes();
    Base::new("legacy-ascii", "vtk", with(&WHOLE))
        .cut("cut", "1 0.5", 0)
        .replace("word", "0.25", "zero")
        .replace("absurd", "POINTS 3", "POINTS 2000000000")
        .file("nan", with(&NAN))
        .made
}

pub(super) fn xyz() -> Vec<Made> {
    let molecular = |points: &[[f32; 3]]| {
        let lines: String = points.iter().map(|p| format!("W {}", text(&[*p]))).collect();
        format!("{}\ncomment\n{lines}", points.len()).into_bytes()
    };
    let mut made = Base::new("molecular", "xyz", molecular(&WHOLE))
        .cut("cut", "W 1 0.5", 0)
        .replace("absurd", "3\n", "2000000000\n")
        .replace("word", "0.25", "half")
        .file("nan", molecular(&NAN))
        .file("zero", molecular(&[]))
        .made;
    let raw = Base::new("raw", "xyz", little(&WHOLE))
        .cut_at("cut", 29)
        .file("nan", little(&NAN))
        .file("zero", Vec::new());
    made.extend(raw.made);
    made
}

pub(super) fn lammps() -> Vec<Made> {
    let dump = |points: &[[f32; 3]]| {
        let head = "ITEM: BOX BOUNDS ff ff ff\n0 9\n0 9\n0 9\nITEM: ATOMS id type x y z\n";
        let lines: String =
            points.iter().zip(7..).map(|(p, id)| format!("{id} 1 {}", text(&[*p]))).collect();
        let n = points.len();
        format!("ITEM: TIMESTEP\n100\nITEM: NUMBER OF ATOMS\n{n}\n{head}{lines}").into_bytes()
    };
    Base::new("dump", "lammpstrj", dump(&WHOLE))
        .replace("magic", "ITEM: TIMESTEP", "ATOM: TIMESTEP")
        .cut("cut-in-head", "NUMBER OF ATOMS\n", 0)
        .cut("cut-in-bounds", "0 9\n0", 0)
        .cut("cut-in-atoms", "8 1 1 0.5", 0)
        .replace("absurd-atoms", "ATOMS\n3\n", "ATOMS\n2000000000\n")
        .replace("negative-atoms", "ATOMS\n3\n", "ATOMS\n-3\n")
        .replace("no-positions", "x y z", "a b c")
        .replace("word", "0.25", "half")
        .file("nan", dump(&NAN))
        .file("zero", dump(&[]))
        .made
}

/// AMBER restart files: six numbers of twelve columns in a line.
pub(super) fn rst7() -> Vec<Made> {
    let restart = |points: &[[f32; 3]]| {
        let numbers: Vec<f32> = points.iter().flatten().copied().collect();
        let row = |row: &[f32]| row.iter().map(|n| format!("{n:12.7}")).collect::<String>() + "\n";
        let rows: String = numbers.chunks(6).map(row).collect();
        format!("title\n{:5}  0.5000000E+01\n{rows}", points.len()).into_bytes()
    };
    let overflow = String::from_utf8(restart(&WHOLE)).expect("text");
    Base::new("restart", "rst7", restart(&WHOLE))
        .cut("cut-in-title", "title", 3)
        .cut("cut-in-positions", "   2.0000000", 0)
        .replace("absurd-atoms", "    3  0", "2000000000  0")
        .replace("other-count", "    3  0", "    5  0")
        .replace("no-count", "    3  0", "three  0")
        .replace("word", "0.2500000", "0.25half0")
        .file("nan", overflow.replace("   0.2500000", "************").into_bytes())
        .file("zero", restart(&[]))
        .made
}

pub(super) fn csv() -> Vec<Made> {
    let table =
        |points: &[[f32; 3]]| format!("x,y,z\n{}", text(points).replace(' ', ",")).into_bytes();
    Base::new("table", "csv", table(&WHOLE))
        .replace("flat", "x,y,z", "x,y,w")
        .replace("no-positions", "x,y,z", "a,b,c")
        .replace("word", "0.25", "half")
        .cut("cut", "1,0.5", 0)
        .replace("long-row", "0.25", "0.25,7,8,9")
        .file("prose", b"these are no particles\nbut two lines of words\n".to_vec())
        .file("nan", table(&NAN))
        .file("zero", table(&[]))
        .made
}

fn text(points: &[[f32; 3]]) -> String {
    let line = |p: &[f32; 3]| format!("{} {} {}\n", p[0], p[1], p[2]);
    points.iter().map(line).collect()
}

/// openPMD in JSON: an iteration with one species.
fn openpmd_text(points: &[[f32; 3]]) -> Vec<u8> {
    let values = |axis: usize| -> Vec<String> {
        points
            .iter()
            .map(|p| if p[axis].is_nan() { "null".into() } else { format!("{:?}", p[axis]) })
            .collect()
    };
    let component = |(axis, name)| {
        format!(
            "\"{name}\":{{\"attributes\":{{}},\"data\":[{}],\"datatype\":\"FLOAT\"}}",
            values(axis).join(",")
        )
    };
    let axes: Vec<String> = (0..).zip(["x", "y", "z"]).map(component).collect();
    format!(
        "{{\"attributes\":{{\"openPMD\":{{\"datatype\":\"STRING\",\"value\":\"1.1.0\"}}}},\"data\":{{\"7\":{{\"attributes\":\
         {{\"time\":{{\"datatype\":\"DOUBLE\",\"value\":0.5}}}},\"particles\":{{\"e\":{{\"position\":{{{}}}}}}}}}}}}}",
        axes.join(",")
    )
    .into_bytes()
}

pub(super) fn openpmd() -> Vec<Made> {
    Base::new("plasma", "json", openpmd_text(&WHOLE))
        .replace("magic", "openPMD", "openPMC")
        .cut("cut-in-attributes", "\"value\":", 2)
        .cut("cut-in-values", "\"data\":[", 5)
        .replace("not-utf8", "\"time\"", b"\"tim\xff\"")
        .replace("no-particles", "particles", "meshes")
        .replace("no-position", "\"position\"", "\"place\"")
        .replace("no-axes", "\"x\":", "\"a\":")
        .replace("one-axis", "\"y\":", "\"z\":")
        .replace("more-values", "\"data\":[", "\"data\":[4.5,")
        .replace("text", "\"data\":[", "\"data\":[\"a\",")
        .replace("rows", "\"data\":[0.0", "\"data\":[[0.0]")
        .replace("type", "FLOAT", "CDOUBLE")
        .replace("no-type", "\"FLOAT\"", "3")
        .replace("time", "0.5", "\"late\"")
        .file("nan", openpmd_text(&NAN))
        .file("zero", openpmd_text(&[]))
        .made
}
