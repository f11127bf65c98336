//! Makes the files of `tests/damaged`: for every format a small whole file, and the ways to
//! break it.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use glam::{DVec3, Vec3};
use spherule_formats::{ParticleFrame, native};
use zip::write::{SimpleFileOptions, ZipWriter};

mod base;
mod clouds;
mod gsd;
mod molecules;
mod text;

use base::{Base, find, replace};
use clouds::{e57, gadget, geo, las, laz, pcd};
use gsd::gsd;
use molecules::molecules;
use text::{csv, lammps, openpmd, rst7, vtk_ascii, xyz};

/// Name and content.
pub(super) type Made = (String, Vec<u8>);

/// Three particles.
const WHOLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [2.0, 1.0, 0.5]];
/// The second one is nowhere.
const NAN: [[f32; 3]; 3] = [WHOLE[0], [f32::NAN, 0.5, 0.25], WHOLE[2]];

/// All files.
pub(super) fn files() -> Vec<Made> {
    let mut all = vec![("empty.vtk".to_owned(), Vec::new())];
    for kind in [
        vtk, vtk_ascii, vtu, bgeo, gzip, ply, xyz, lammps, npy, npz, csv, rst7, spf, gsd, las, laz,
        e57, openpmd, pcd, gadget, geo, molecules,
    ] {
        all.extend(kind());
    }
    all
}

fn big(points: &[[f32; 3]]) -> Vec<u8> {
    let all = points.iter().flatten();
    all.flat_map(|v| v.to_be_bytes()).collect()
}

fn little(points: &[[f32; 3]]) -> Vec<u8> {
    let all = points.iter().flatten();
    all.flat_map(|v| v.to_le_bytes()).collect()
}

/// Legacy, binary, with cells and two attributes.
fn vtk_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let n = points.len();
    let mut file =
        b"# vtk DataFile Version 4.1\ntitle\nBINARY\nDATASET UNSTRUCTURED_GRID\n".to_vec();
    file.extend(format!("POINTS {n} float\n").bytes().chain(big(points)));
    file.extend(format!("\nCELLS {n} {}\n", 2 * n).bytes());
    file.extend((0_u32..).take(n).flat_map(|i| [1, i]).flat_map(u32::to_be_bytes));
    file.extend(format!("\nCELL_TYPES {n}\n").bytes());
    file.extend([0, 0, 0, 1].repeat(n));
    file.extend(format!("\nPOINT_DATA {n}\nSCALARS id unsigned_int 1\nLOOKUP_TABLE t\n").bytes());
    file.extend((7_u32..).take(n).flat_map(u32::to_be_bytes));
    file.extend(format!("\nFIELD FieldData 1\nvelocity 3 {n} float\n").bytes());
    file.extend(big(points).into_iter().chain(*b"\n"));
    file
}

fn vtk() -> Vec<Made> {
    Base::new("legacy", "vtk", vtk_bytes(&WHOLE))
        .replace("magic", "# vtk", "# vtx")
        .replace("version", "4.1", "9.9")
        .replace("grid", "UNSTRUCTURED_GRID", "STRUCTURED_POINTS")
        .cut("cut-in-head", "# vtk DataFile Version 4.1\nti", 0)
        .cut("cut-in-points", "float\n", 20)
        .cut("cut-in-cells", "CELLS 3 6\n", 7)
        .cut("cut-in-scalars", "LOOKUP_TABLE t\n", 5)
        .cut("cut-in-field", "velocity 3 3 float\n", 35)
        .replace("absurd-points", "POINTS 3", "POINTS 2000000000")
        .replace("overflowing-points", "POINTS 3", "POINTS 6148914691236517206")
        .replace("negative-points", "POINTS 3", "POINTS -3")
        .replace("absurd-cells", "CELLS 3 6", "CELLS 3 4000000000")
        .replace("absurd-components", "velocity 3 3", "velocity 4000000000 3")
        .replace("other-count", "POINT_DATA 3", "POINT_DATA 4")
        .file("nan", vtk_bytes(&NAN))
        .file("zero", vtk_bytes(&[]))
        .made
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory takes it");
    encoder.finish().expect("memory takes it")
}

/// Appended raw, one zlib block an array; `size` is what the block's header says.
fn vtu_bytes(points: &[[f32; 3]], size: u32) -> Vec<u8> {
    let n = points.len();
    let mut file = format!(
        r#"<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" compressor="vtkZLibDataCompressor">
<UnstructuredGrid><Piece NumberOfPoints="{n}" NumberOfCells="0">
<Points><DataArray type="Float32" Name="Points" NumberOfComponents="3" format="appended" offset="0"/></Points>
</Piece></UnstructuredGrid>
<AppendedData encoding="raw">_"#
    )
    .into_bytes();
    if n > 0 {
        let block = zlib(&little(points));
        let length = u32::try_from(block.len()).expect("a small block");
        file.extend([1, size, 0, length].into_iter().flat_map(u32::to_le_bytes));
        file.extend(block);
    } else {
        file.extend([0, size, 0].into_iter().flat_map(u32::to_le_bytes));
    }
    file.extend(b"</AppendedData></VTKFile>");
    file
}

fn vtu() -> Vec<Made> {
    let whole = vtu_bytes(&WHOLE, 36);
    let data = find(&whole, b"raw\">_") + 6;
    Base::new("xml", "vtu", whole)
        .replace("magic", "VTKFile", "VTXFile")
        .replace("image", "UnstructuredGrid", "ImageData")
        .replace("compressor", "ZLib", "Brot")
        .cut("cut-in-head", "<Points><DataArray", 0)
        .cut("cut-before-data", "<AppendedData encoding", 0)
        .cut("cut-in-data", "raw\">_", 25)
        .replace("absurd-points", "NumberOfPoints=\"3\"", "NumberOfPoints=\"4000000000\"")
        .replace("no-count", "NumberOfPoints=\"3\"", "")
        .replace("two-components", "NumberOfComponents=\"3\"", "NumberOfComponents=\"2\"")
        .replace("far-offset", "offset=\"0\"", "offset=\"123456789\"")
        .replace("no-underscore", "raw\">_", "raw\"> ")
        .patch("absurd-blocks", data, &[0xff; 4])
        .file("absurd-block-size", vtu_bytes(&WHOLE, 0xffff_fff0))
        .patch("not-zlib", data + 16, &[0xff; 4])
        .file("nan", vtu_bytes(&NAN, 36))
        .file("zero", vtu_bytes(&[], 32_768))
        .made
}

/// Classic, with an int and a vector attribute.
fn bgeo_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let n = u32::try_from(points.len()).expect("a few points");
    let mut file = b"BgeoV".to_vec();
    file.extend([5, n, 0, 0, 0, 2, 0, 0, 0].into_iter().flat_map(u32::to_be_bytes));
    for (name, size, kind) in [("id", 1_u16, 1_u32), ("velocity", 3, 5)] {
        let length = u16::try_from(name.len()).expect("a short name");
        file.extend(length.to_be_bytes().into_iter().chain(name.bytes()));
        file.extend(size.to_be_bytes().into_iter().chain(kind.to_be_bytes()));
        file.extend([0; 4].repeat(size.into()));
    }
    for (point, id) in points.iter().zip(7_u32..) {
        file.extend(big(&[*point]).into_iter().chain(1_f32.to_be_bytes()));
        file.extend(id.to_be_bytes().into_iter().chain(big(&[*point])));
    }
    file.extend([0x00, 0xff]);
    file
}

fn bgeo() -> Vec<Made> {
    Base::new("classic", "bgeo", bgeo_bytes(&WHOLE))
        .replace("magic", "BgeoV", "BgeoX")
        .patch("version", 5, &[0, 0, 0, 7])
        .cut_at("cut-in-head", 20)
        .cut("cut-in-definition", "velocity", 4)
        .cut("cut-in-points", "velocity", 18 + 40)
        .patch("absurd-points", 9, &[0x7f, 0xff, 0xff, 0xff])
        .patch("negative-points", 9, &[0xff; 4])
        .patch("absurd-attributes", 25, &[0x7f, 0xff, 0xff, 0xff])
        .file("nan", bgeo_bytes(&NAN))
        .file("zero", bgeo_bytes(&[]))
        .made
}

fn gzip() -> Vec<Made> {
    let pack = |bytes: &[u8]| {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(bytes).expect("memory takes it");
        encoder.finish().expect("memory takes it")
    };
    let whole = pack(&bgeo_bytes(&WHOLE));
    let (twice, half) = (pack(&whole), whole.len() / 2);
    let crc = whole.len() - 8;
    // Two megabytes of zeros in two thousand bytes, and no particle in them.
    let zeros = pack(&vec![0; 2 << 20]);
    Base::new("gzip", "bgeo", whole)
        .cut_at("cut", half)
        .cut_at("cut-in-head", 6)
        .patch("checksum", crc, &[0xaa; 4])
        .file("twice", twice)
        .file("zeros", zeros)
        .made
}

fn ply_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let n = points.len();
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty float x\n\
         property float y\nproperty float z\nend_header\n"
    )
    .into_bytes();
    file.extend(little(points));
    file
}

fn ply() -> Vec<Made> {
    let ascii = |numbers: &str| {
        let head = ply_bytes(&WHOLE[..0]);
        let head = String::from_utf8(head).expect("text").replace("vertex 0", "vertex 3");
        format!("{}{numbers}", head.replace("binary_little_endian", "ascii")).into_bytes()
    };
    Base::new("points", "ply", ply_bytes(&WHOLE))
        .replace("magic", "ply\n", "plx\n")
        .replace("format", "binary_little", "binary_middle")
        .cut("cut-in-head", "property float y\n", 0)
        .cut("cut-in-points", "end_header\n", 30)
        .replace("absurd-points", "vertex 3", "vertex 4000000000")
        .replace("overflowing-points", "vertex 3", "vertex 99999999999999999999")
        .replace("no-z", "property float z\n", "")
        .replace("mesh", "vertex 3", "face 2\nproperty list uchar int i\nelement vertex 3")
        .file("ascii-cut", ascii("0 0 0\n1 0.5"))
        .file("ascii-word", ascii("0 0 0\n1 half 0\n2 1 0\n"))
        .file("nan", ply_bytes(&NAN))
        .file("zero", ply_bytes(&[]))
        .made
}

/// An array of shape (N, 3) whose header says `count`.
fn npy_bytes(points: &[[f32; 3]], count: &str) -> Vec<u8> {
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 3), }}");
    let mut file = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    file.extend(format!("{dict:117}\n").bytes().chain(little(points)));
    file
}

fn npy() -> Vec<Made> {
    Base::new("array", "npy", npy_bytes(&WHOLE, "3"))
        .replace("magic", "NUMPY", "NUMPX")
        .patch("version", 6, &[9])
        .cut("cut-in-head", "'shape'", 0)
        .cut_at("cut-in-data", 128 + 30)
        .file("absurd", npy_bytes(&WHOLE, "2000000000"))
        .file("overflowing", npy_bytes(&WHOLE, "9223372036854775807"))
        .file("negative", npy_bytes(&WHOLE, "-3"))
        .patch("absurd-head", 8, &[0xff; 2])
        .replace("objects", "<f4", "|O8")
        .replace("text", "<f4", "<U4")
        .replace("one-axis", "(3, 3)", "(9,)  ")
        .file("nan", npy_bytes(&NAN, "3"))
        .file("zero", npy_bytes(&[], "0"))
        .made
}

fn npz() -> Vec<Made> {
    let archive = |member: &[u8]| {
        let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
        zip.start_file("positions.npy", SimpleFileOptions::default()).expect("memory takes it");
        zip.write_all(member).expect("memory takes it");
        zip.finish().expect("memory takes it").into_inner()
    };
    let whole = archive(&npy_bytes(&WHOLE, "3"));
    let (length, directory) = (whole.len(), find(&whole, b"PK\x01\x02"));
    Base::new("archive", "npz", whole)
        .cut_at("cut-in-member", 70)
        .cut_at("cut-in-directory", directory + 20)
        .cut_at("cut-in-end", length - 10)
        .patch("garbled-member", 50, &[0xff; 8])
        .patch("absurd-size", directory + 24, &[0xff, 0xff, 0xff, 0x7f])
        .file("absurd", archive(&npy_bytes(&WHOLE, "2000000000")))
        .file("objects", archive(&replace(&npy_bytes(&WHOLE, "3"), b"<f4", b"|O8")))
        .file("not-numpy", archive(b"no array at all"))
        .file("nan", archive(&npy_bytes(&NAN, "3")))
        .file("zero", archive(&npy_bytes(&[], "0")))
        .made
}

/// A native frame; NaN is not written to one.
fn spf_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let frame = ParticleFrame {
        positions: points.iter().map(|p| Vec3::from_array(*p)).collect(),
        origin: DVec3::ZERO,
        radius: None,
        attributes: Vec::new(),
        time: None,
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 0,
        file_index: None,
    };
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("frame.spf");
    native::write(&path, &frame, Some(7)).expect("a file");
    std::fs::read(path).expect("the file")
}

fn spf() -> Vec<Made> {
    let whole = spf_bytes(&WHOLE);
    let length = whole.len();
    Base::new("native", "spf", whole)
        .replace("magic", "SPHERULE", "SPHERULA")
        .patch("version", 8, &[99, 0, 0, 0])
        .cut_at("cut-in-head", 40)
        .cut_at("cut-in-positions", 100)
        .cut_at("cut-in-index", length - 8)
        .patch("head", 24, &[0xff; 8])
        .patch("positions", 70, &[0xff])
        .patch("index", length - 8, &[0xff; 4])
        .file("zero", spf_bytes(&[]))
        .made
}
