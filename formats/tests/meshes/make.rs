//! A small whole file of every format, and the ways to break it: the files of `tests/damaged_meshes`.

/// Name, extension, content.
pub(crate) type Made = (&'static str, &'static str, Vec<u8>);

/// A unit square in a plane that is not flat.
const VERTICES: [[f32; 3]; 4] =
    [[0.0, 0.5, 0.0], [1.0, 0.5, 0.0], [1.0, 1.5, 0.25], [0.0, 1.5, 0.25]];
const TRIANGLES: [[usize; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// All whole files.
pub(crate) fn whole() -> Vec<Made> {
    vec![
        ("stl-binary", "stl", stl_binary()),
        ("stl-ascii", "stl", stl_ascii().into_bytes()),
        ("obj", "obj", obj().into_bytes()),
        ("ply-ascii", "ply", ply_ascii().into_bytes()),
        ("ply-binary", "ply", ply_binary()),
        ("legacy", "vtk", legacy_ascii().into_bytes()),
        ("legacy-binary", "vtk", legacy_binary()),
        ("xml", "vtp", polydata().into_bytes()),
        ("xml-appended", "vtu", grid()),
    ]
}

fn text(coordinates: &[[f32; 3]]) -> String {
    let line = |[x, y, z]: &[f32; 3]| format!("{x} {y} {z}\n");
    coordinates.iter().map(line).collect()
}

pub(crate) fn stl_binary() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2_u32.to_le_bytes());
    for triangle in TRIANGLES {
        let corners = triangle.map(|corner| VERTICES[corner]);
        let numbers = [[0.0; 3]].into_iter().chain(corners).flatten();
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0, 0]);
    }
    bytes
}

fn stl_ascii() -> String {
    let mut text = "solid square\n".to_owned();
    for triangle in TRIANGLES {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in triangle.map(|corner| VERTICES[corner]) {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid square\n"
}

fn obj() -> String {
    let vertices: String = text(&VERTICES).lines().map(|line| format!("v {line}\n")).collect();
    format!("# square\n{vertices}f 1 2 3 4\n")
}

fn ply_header(format: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn ply_ascii() -> String {
    format!("{}{}4 0 1 2 3\n", ply_header("ascii"), text(&VERTICES))
}

fn ply_binary() -> Vec<u8> {
    let mut bytes = ply_header("binary_little_endian").into_bytes();
    bytes.extend(VERTICES.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    bytes.push(4);
    bytes.extend((0..4_i32).flat_map(i32::to_le_bytes));
    bytes
}

fn legacy_ascii() -> String {
    format!(
        "# vtk DataFile Version 5.1\nsquare\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n{}\
         POLYGONS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\n",
        text(&VERTICES)
    )
}

fn legacy_binary() -> Vec<u8> {
    let head =
        "# vtk DataFile Version 3.0\nsquare\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n";
    let mut bytes = head.as_bytes().to_vec();
    bytes.extend(VERTICES.as_flattened().iter().flat_map(|v| v.to_be_bytes()));
    bytes.extend(b"\nCELLS 1 5\n");
    bytes.extend([4, 0, 1, 2, 3_i32].into_iter().flat_map(i32::to_be_bytes));
    bytes.extend(b"\nCELL_TYPES 1\n");
    bytes.extend(9_i32.to_be_bytes());
    bytes.extend(b"\nPOINT_DATA 4\nSCALARS a float 1\nLOOKUP_TABLE default\n");
    bytes.extend([0; 16]);
    bytes
}

fn polydata() -> String {
    let array = |name: &str, kind: &str, numbers: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"3\" format=\"ascii\">{numbers}</DataArray>\n"
        )
    };
    let points = array("Points", "Float32", &text(&VERTICES));
    let cells = array("connectivity", "Int64", "0 1 2 3") + &array("offsets", "Int64", "4");
    format!(
        "<VTKFile type=\"PolyData\" version=\"1.0\">\n<PolyData>\n<Piece NumberOfPoints=\"4\" NumberOfPolys=\"1\">\n\
         <Points>{points}</Points>\n<Polys>{cells}</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    )
}

/// As above, as an unstructured grid with raw appended data.
fn grid() -> Vec<u8> {
    let mut blob = Vec::new();
    let mut array = |name: &str, kind: &str, bytes: Vec<u8>| {
        let offset = blob.len();
        blob.extend(u32::try_from(bytes.len()).expect("short").to_le_bytes());
        blob.extend(bytes);
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"3\" format=\"appended\" offset=\"{offset}\"/>\n"
        )
    };
    let points = VERTICES.as_flattened().iter().flat_map(|v| v.to_le_bytes());
    let points = array("Points", "Float32", points.collect());
    let corners = (0..4_i32).flat_map(i32::to_le_bytes).collect();
    let cells = array("connectivity", "Int32", corners)
        + &array("offsets", "Int32", 4_i32.to_le_bytes().to_vec())
        + &array("types", "UInt8", vec![9]);
    let head = format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\">\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\n<Points>{points}</Points>\n<Cells>{cells}</Cells>\n\
         </Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_"
    );
    [head.as_bytes(), &blob, b"\n</AppendedData>\n</VTKFile>\n"].concat()
}

/// One change to a whole file: what the damage is called, the first text to find, and what replaces it; with nothing
/// to replace it, the file ends there.
type Damage = (&'static str, &'static str, Option<&'static str>);

const STL_ASCII: [Damage; 10] = [
    ("cut-in-facet", "vertex 1 1.5", None),
    ("cut-at-end", "endsolid", None),
    ("word", "vertex 1 0.5 0", Some("vertex 1 half 0")),
    ("two-numbers", "vertex 1 0.5 0", Some("vertex 1 0.5")),
    ("two-vertices", "vertex 1 0.5 0\n", Some("")),
    ("four-vertices", "endloop", Some("vertex 1 2 3\nendloop")),
    ("keyword", "outer loop", Some("inner loop")),
    ("no-facets", "facet", None),
    ("garbage", "endfacet\n", Some("endfacet\n\u{1}\u{2}\u{3}\n")),
    ("joined", "facet normal 0 0 0\n", Some("facetnormal000\n")),
];

const OBJ: [Damage; 10] = [
    ("absurd-index", "f 1 2", Some("f 99999999999999999999 2")),
    ("index-beyond", "f 1 2", Some("f 1 5")),
    ("index-far-beyond", "f 1 2", Some("f 1 5000000000")),
    ("index-zero", "f 1 2", Some("f 0 2")),
    ("index-before", "f 1 2", Some("f 1 -5")),
    ("index-word", "f 1 2", Some("f 1 b")),
    ("index-missing", "f 1 2", Some("f 1 /2")),
    ("word", "v 1 0.5 0\n", Some("v 1 x 0\n")),
    ("two-numbers", "v 1 0.5 0\n", Some("v 1 0.5\n")),
    ("cut-in-vertices", "f 1", None),
];

const PLY_ASCII: [Damage; 5] = [
    ("index-beyond", "4 0 1 2 3", Some("4 0 1 2 4")),
    ("index-negative", "4 0 1 2 3", Some("4 0 1 2 -3")),
    ("list-absurd", "4 0 1 2 3", Some("4000000000000 0 1 2 3")),
    ("absurd-faces", "face 1", Some("face 4000000000")),
    ("more-values", "4 0 1 2 3", Some("3 0 1 2 3")),
];

const PLY_BINARY: [Damage; 5] = [
    ("index-beyond", "\u{2}\0\0\0\u{3}", Some("\u{2}\0\0\0\u{4}")),
    ("list-absurd", "\u{4}\0\0\0\0\u{1}", Some("\u{7f}\0\0\0\0\u{1}")),
    ("absurd-vertices", "vertex 4", Some("vertex 4000000000")),
    ("absurd-faces", "face 1", Some("face 4000000000")),
    ("cut-in-faces", "\u{2}\0\0\0\u{3}", None),
];

const LEGACY: [Damage; 6] = [
    ("index-beyond", "0 1 2 3\n", Some("0 1 2 4\n")),
    ("index-negative", "0 1 2 3\n", Some("0 1 2 -3\n")),
    ("offset-beyond", "0 4\n", Some("0 5\n")),
    ("offset-back", "0 4\n", Some("4 0\n")),
    ("absurd-cells", "POLYGONS 2 4", Some("POLYGONS 2 4000000000")),
    ("cut-in-cells", "0 1 2 3\n", None),
];

const LEGACY_BINARY: [Damage; 6] = [
    ("index-beyond", "\0\0\0\u{2}\0\0\0\u{3}", Some("\0\0\0\u{2}\0\0\u{1}\u{3}")),
    ("count-absurd", "\0\0\0\u{4}\0\0\0\0", Some("\u{7f}\0\0\u{4}\0\0\0\0")),
    ("type-unknown", "\0\0\0\u{9}", Some("\0\0\0\u{42}")),
    ("type-of-volumes", "\0\0\0\u{9}", Some("\0\0\0\u{c}")),
    ("no-types", "\nCELL_TYPES", None),
    ("absurd-cells", "CELLS 1 5", Some("CELLS 1 2000000000")),
];

const XML: [Damage; 6] = [
    ("index-beyond", "0 1 2 3", Some("0 1 2 4")),
    ("index-fraction", "0 1 2 3", Some("0 1 2 2.5")),
    ("offset-absurd", ">4<", Some(">4000000000<")),
    ("offset-negative", ">4<", Some(">-4<")),
    ("no-offsets", "\"offsets\"", Some("\"offset\"")),
    ("absurd-cells", "NumberOfPolys=\"1\"", Some("NumberOfPolys=\"9000000000000000000\"")),
];

const XML_APPENDED: [Damage; 6] = [
    ("index-beyond", "\u{2}\0\0\0\u{3}\0\0\0", Some("\u{2}\0\0\0\u{4}\0\0\0")),
    ("offset-beyond", "\u{4}\0\0\0\u{4}\0\0\0", Some("\u{4}\0\0\0\u{5}\0\0\0")),
    ("type-unknown", "\u{1}\0\0\0\u{9}", Some("\u{1}\0\0\0\u{2a}")),
    ("no-types", "\"types\"", Some("\"type\"")),
    ("absurd-cells", "NumberOfCells=\"1\"", Some("NumberOfCells=\"4000000000\"")),
    ("cut-in-cells", "\u{2}\0\0\0\u{3}\0\0\0", None),
];

/// All damaged files: name and content.
pub(crate) fn damaged() -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for (base, extension, bytes) in whole() {
        let mut add =
            |what: &str, bytes: Vec<u8>| all.push((format!("{base}-{what}.{extension}"), bytes));
        let damages: &[Damage] = match base {
            "stl-ascii" => &STL_ASCII,
            "obj" => &OBJ,
            "ply-ascii" => &PLY_ASCII,
            "ply-binary" => &PLY_BINARY,
            "legacy" => &LEGACY,
            "legacy-binary" => &LEGACY_BINARY,
            "xml" => &XML,
            "xml-appended" => &XML_APPENDED,
            _ => {
                stl_binaries(&bytes, &mut add);
                continue;
            }
        };
        for (what, old, new) in damages {
            let found = bytes.windows(old.len()).position(|window| window == old.as_bytes());
            let at = found.unwrap_or_else(|| panic!("{base} has no {old:?}"));
            let (before, after) = (&bytes[..at], &bytes[at + old.len()..]);
            let broken = match new {
                Some(new) => [before, new.as_bytes(), after].concat(),
                None => before.to_vec(),
            };
            add(what, broken);
        }
    }
    all
}

/// Binary STL has no text to find.
fn stl_binaries(bytes: &[u8], add: &mut impl FnMut(&str, Vec<u8>)) {
    let patched = |at: usize, new: &[u8]| {
        let mut bytes = bytes.to_vec();
        bytes[at..at + new.len()].copy_from_slice(new);
        bytes
    };
    add("cut-in-header", bytes[..70].to_vec());
    add("cut-in-count", bytes[..82].to_vec());
    add("cut-before-triangles", bytes[..84].to_vec());
    add("cut-in-triangle", bytes[..120].to_vec());
    add("one-byte-short", bytes[..183].to_vec());
    add("one-byte-more", [bytes, &[0]].concat());
    add("solid-cut", [b"solid", &bytes[5..160]].concat());
    add("absurd-count", patched(80, &[0xff; 4]));
    add("big-endian-count", patched(80, &[0, 0, 0, 2]));
    add("no-triangles", [&bytes[..80], &[0; 4]].concat());
    add("nan", patched(96, &f32::NAN.to_le_bytes()));
}
