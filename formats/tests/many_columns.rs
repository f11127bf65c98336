//! Files with very many arrays, columns or properties. Quadratic work in their number would take minutes to
//! hours here. The tests do not measure time.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::io::{Cursor, Write};

use spherule_formats::Format;
use spherule_formats::join::{Part, join_numbered};
use spherule_formats::read::{bgeo, csv, lammps, npy, ply, vtk, vtk_xml, xyz};
use spherule_formats::sequence::Topology;
use spherule_formats::{
    Attribute, AttributeData, MemoryBudget, ParseError, Positions, RawParticles,
};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Number of arrays in a file.
const MANY: usize = 100_000;

#[track_caller]
fn read(format: Format, bytes: &[u8]) -> Result<RawParticles, ParseError> {
    let steps = format.steps(bytes).expect("steps");
    format.read(bytes, steps.first().expect("one step"))
}

/// Reads the first step and checks its number of attributes.
#[track_caller]
fn has(format: Format, bytes: &[u8], attributes: usize) {
    let particles = read(format, bytes).expect("a good file");
    assert_eq!(particles.attributes.len(), attributes);
    assert_eq!(particles.positions.len(), 1);
}

/// A VTK XML piece with one particle and the arrays `names`.
fn piece(names: impl Iterator<Item = String>) -> String {
    let array = |name: String| format!("<DataArray type=\"UInt8\" Name=\"{name}\">7</DataArray>\n");
    let arrays: String = names.map(array).collect();
    format!(
        "<Piece NumberOfPoints=\"1\"><PointData>{arrays}</PointData>\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">1 2 3</DataArray></Points></Piece>\n"
    )
}

fn vtu(pieces: &[String]) -> Vec<u8> {
    let pieces = pieces.concat();
    format!("<VTKFile type=\"PolyData\"><PolyData>{pieces}</PolyData></VTKFile>").into_bytes()
}

fn numbered(count: usize) -> impl Iterator<Item = String> {
    (0..count).map(|i| format!("a{i}"))
}

#[test]
fn vtk_xml_of_one_piece() {
    has(vtk_xml::FORMAT, &vtu(&[piece(numbered(MANY))]), MANY);
}

#[test]
fn vtk_xml_of_two_pieces() {
    let backwards = (0..MANY).rev().map(|i| format!("a{i}"));
    let file = vtu(&[piece(numbered(MANY)), piece(backwards)]);
    let particles = read(vtk_xml::FORMAT, &file).expect("a good file");
    assert_eq!(particles.attributes.len(), MANY);
    assert_eq!(particles.attributes[1].name, "a1");
    assert_eq!(particles.attributes[1].data, AttributeData::U8(vec![7, 7]));
}

#[test]
fn vtk_xml_of_repeated_names_that_the_last_piece_lacks() {
    let repeated = || std::iter::repeat_n("a".to_owned(), 20_000);
    let mut pieces = vec![piece(repeated())];
    pieces.extend((0..20_000).map(|_| piece(std::iter::once("a".to_owned()))));
    pieces.push(piece(std::iter::empty()));
    let particles = read(vtk_xml::FORMAT, &vtu(&pieces)).expect("a good file");
    assert_eq!(particles.attributes.len(), 1);
    assert!(particles.attributes[0].data.get_f64(20_001).is_nan());
    let notes = [
        "part `piece 20001` without `a`: NaN there",
        "several columns `a` in part `piece 0`: the first is used",
    ];
    assert_eq!(particles.notes, notes);
}

#[test]
fn vtk_xml_of_arrays_that_share_their_bytes() {
    // A slow reader would search for each array behind all blanks.
    let array = "<DataArray type=\"UInt8\" Name=\"a\" format=\"appended\" offset=\"0\"/>";
    let arrays: Vec<String> =
        (0..MANY).map(|i| array.replace("\"a\"", &format!("\"a{i}\""))).collect();
    let head = format!(
        "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"1\"><PointData>{}</PointData>\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">1 2 3</DataArray></Points></Piece>\
         </PolyData>",
        arrays.concat()
    );
    let blanks = " ".repeat(1 << 22);
    let file = format!(
        "{head}<AppendedData encoding=\"base64\">_{blanks}AQAAAAc=</AppendedData></VTKFile>"
    );
    let error = read(vtk_xml::FORMAT, file.as_bytes()).expect_err("shared bytes");
    assert!(error.to_string().contains("needs bytes of its own"), "{error}");
}

#[test]
fn vtk_legacy() {
    let mut file = String::from(
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n1 2 3\nPOINT_DATA 1\n",
    );
    for name in numbered(MANY) {
        file += &format!("SCALARS {name} float\nLOOKUP_TABLE default\n7\n");
    }
    has(vtk::FORMAT, file.as_bytes(), MANY);
}

#[test]
fn vtk_legacy_in_binary() {
    let mut file =
        b"# vtk DataFile Version 3.0\nt\nBINARY\nDATASET POLYDATA\nPOINTS 1 float\n".to_vec();
    file.extend([0; 12]);
    file.extend(format!("\nPOINT_DATA 1\nFIELD FieldData {MANY}\n").bytes());
    for name in numbered(MANY) {
        // The size of this type depends on the bytes that follow.
        file.extend(format!("{name} 1 1 long\n").bytes());
        file.extend([0; 8]);
        file.push(b'\n');
    }
    has(vtk::FORMAT, &file, MANY);
}

#[test]
fn ply() {
    let properties: String = numbered(MANY).map(|n| format!("property uchar {n}\n")).collect();
    let head = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    for format in ["ascii", "binary_little_endian"] {
        let mut file =
            format!("ply\nformat {format} 1.0\n{head}{properties}end_header\n").into_bytes();
        match format {
            "ascii" => file.extend(format!("1 2 3{}\n", " 7".repeat(MANY)).bytes()),
            _ => file.extend(vec![0; 12 + MANY]),
        }
        has(ply::FORMAT, &file, MANY);
    }
}

#[test]
fn csv() {
    for names in [
        numbered(MANY).collect::<Vec<_>>().join(","),
        (0..MANY).map(|i| format!("a{i}.x")).collect::<Vec<_>>().join(","),
    ] {
        let file = format!("x,y,z,{names}\n1,2,3{}\n", ",7".repeat(MANY));
        has(csv::FORMAT, file.as_bytes(), MANY);
    }
}

#[test]
fn xyz() {
    let numbers = " 7".repeat(MANY);
    // The element is one more attribute.
    has(xyz::FORMAT, format!("1\n\nH 1 2 3{numbers}\n").as_bytes(), MANY + 1);
    // Columns that each begin a search in the first row would take minutes.
    let many = 8 * MANY;
    let numbers = " 7".repeat(many);
    let properties: String = numbered(many).map(|n| format!(":{n}:I:1")).collect();
    let file = format!("1\nProperties=pos:R:3{properties}\n1 2 3{numbers}\n");
    has(xyz::FORMAT, file.as_bytes(), many);
}

#[test]
fn lammps() {
    let dump = |names: &str, values: &str| {
        let head = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS";
        format!("{head} x y z{names}\n1 2 3{values}\n")
    };
    let names: String = numbered(MANY).map(|n| format!(" {n}")).collect();
    let values = " 7".repeat(MANY);
    has(lammps::FORMAT, dump(&names, &values).as_bytes(), MANY);
    // A slow reader would search for the other components of each vector.
    let file = dump(&" vx".repeat(MANY), &values);
    has(lammps::FORMAT, file.as_bytes(), MANY);
}

#[test]
fn lammps_headers_in_one_line() {
    let file = format!("{}\n{}\n", "ITEM: TIMESTEP ".repeat(1 << 18), "0".repeat(1 << 22));
    let steps = lammps::FORMAT.steps(file.as_bytes()).expect("steps");
    assert_eq!(steps.len(), 1);
}

#[test]
fn bgeo() {
    let count = 50_000;
    let mut file = b"BgeoV".to_vec();
    file.extend(5_i32.to_be_bytes());
    for number in [1, 0, 0, 0, count, 0, 0, 0] {
        file.extend(i32::to_be_bytes(number));
    }
    for i in 0..count {
        let name = format!("a{i}");
        file.extend(u16::try_from(name.len()).expect("short").to_be_bytes());
        file.extend(name.bytes());
        file.extend(1_u16.to_be_bytes());
        file.extend([0; 8]);
    }
    let record = 16 + 4 * usize::try_from(count).expect("not negative");
    file.resize(file.len() + record, 0);
    has(bgeo::FORMAT, &file, 50_000);
}

/// An array of f32 in the format of `numpy.save`.
fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut file = b"\x93NUMPY\x02\x00".to_vec();
    file.extend(u32::try_from(header.len()).expect("short").to_le_bytes());
    file.extend(header.bytes());
    file.extend(data);
    file
}

#[test]
fn npy_of_many_fields() {
    // Headers of up to 1 MiB are accepted.
    let count = 50_000;
    let fields: String = numbered(count).map(|n| format!("('{n}', '<f4'), ")).collect();
    let descr = format!("[('pos', '<f4', (3,)), {fields}]");
    let file = npy(&descr, "(1,)", &vec![0; 12 + 4 * count]);
    has(npy::NPY, &file, count);
}

#[test]
fn npz_of_many_members() {
    let count = 20_000;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let mut add = |name: &str, bytes: &[u8]| {
        zip.start_file(format!("{name}.npy"), options).expect("memory takes all");
        zip.write_all(bytes).expect("memory takes all");
    };
    add("pos", &npy("'<f4'", "(1, 3)", &[0; 12]));
    let one = npy("'<f4'", "(1,)", &[0; 4]);
    for name in numbered(count) {
        add(&name, &one);
    }
    let file = zip.finish().expect("memory takes all").into_inner();
    has(npy::NPZ, &file, count);
}

#[test]
fn parts_of_a_step() {
    let part = |number: u32, names: &mut dyn Iterator<Item = String>| {
        let column = |name| Attribute { name, components: 1, data: AttributeData::U8(vec![7]) };
        let particles = RawParticles {
            positions: Positions::F32(vec![glam::Vec3::ZERO]),
            attributes: names.map(column).collect(),
            ..RawParticles::default()
        };
        Part { number, name: number.to_string(), particles }
    };
    let join = |others: &mut dyn Iterator<Item = String>| {
        let parts = vec![part(0, &mut numbered(MANY)), part(1, others)];
        join_numbered(parts, MemoryBudget::UNLIMITED).expect("no limit")
    };
    let joined = join(&mut (0..MANY).rev().map(|i| format!("a{i}")));
    assert_eq!(joined.attributes.len(), MANY + 1);
    assert_eq!(joined.attributes[3].name, "a3");
    assert!(joined.notes.is_empty());
    let joined = join(&mut (0..MANY).map(|i| format!("b{i}")));
    assert_eq!((joined.attributes.len(), joined.notes.len()), (2 * MANY + 1, 2));
}

#[test]
fn topology_of_other_attributes() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("topology.csv");
    let table = |prefix: &str| {
        let names: String = (0..MANY).map(|i| format!(",{prefix}{i}")).collect();
        format!("x,y,z{names}\n1,2,3{}\n", ",7".repeat(MANY))
    };
    std::fs::write(&path, table("t")).expect("writable");
    let topology = Topology::open(&path, MemoryBudget::UNLIMITED).expect("a good file");
    let mut particles = read(csv::FORMAT, table("f").as_bytes()).expect("a good file");
    topology.add_to(&mut particles, &path).expect("one particle");
    topology.add_to(&mut particles, &path).expect("one particle");
    assert_eq!(particles.attributes.len(), 2 * MANY);
}
