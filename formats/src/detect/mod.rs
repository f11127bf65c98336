//! Which format a file is: by content first, by name second.
//!
//! Extensions lie (`.vtk` is text or binary, `.xyz` is three unrelated things, partio gzips
//! `.bgeo`), so signatures decide and the name only breaks ties. Files that are known but not
//! read get an error that says what to do instead (`foreign.rs`). [`crate::open`] decompresses
//! files before; the readers themselves are in [`crate::read`].

use std::path::Path;

use crate::read::sniff::is_text;
use crate::{Format, ParseError, registry};
use spherule_readers::{Confidence, HEAD_LEN};

mod foreign;
pub(crate) use foreign::ADIOS;
mod text;

/// The format of an uncompressed file that begins with `bytes` (all of it, or at least
/// 4096 bytes) and is called `path`.
///
/// # Errors
/// [`ParseError::Unsupported`] for a known format that is not read, with what to do;
/// [`ParseError::Malformed`] for an empty file (but not `.xyz`: that is zero raw particles),
/// for content that does not match its name, and for unknown content.
pub fn detect_format(bytes: &[u8], path: &Path) -> Result<Format, ParseError> {
    let named = registry::by_name(path);
    let head = &bytes[..bytes.len().min(HEAD_LEN)];
    // A signature decides; of formats that are only likely, the first is remembered
    let mut likely = None;
    for format in registry::all() {
        match format.reader().sniff(head)? {
            Confidence::Signature => return Ok(*format),
            Confidence::Likely => likely = likely.or(Some(*format)),
            Confidence::IfNamed | Confidence::No => {}
        }
    }
    // Refuse known formats that are not read
    if !bytes.is_empty() {
        refuse_foreign(head, path, named)?;
    }
    // Otherwise the name decides, if the content does not contradict it
    match named {
        Some(format) if format.reader().sniff(head)? >= Confidence::IfNamed => Ok(format),
        _ if bytes.is_empty() => {
            Err(ParseError::malformed(0, "the file is empty; perhaps it is still being written"))
        }
        Some(format) => {
            let (name, opening) = (format.name(), opening(head));
            let what = format!("named like a {name} file, but does not begin like one: {opening}");
            Err(ParseError::malformed(0, what))
        }
        None => likely.ok_or_else(|| {
            let (opening, names) = (opening(head), names());
            let what = format!("no particle format begins with {opening}; supported are {names}");
            ParseError::malformed(0, what)
        }),
    }
}

/// Refuses files of known formats that are not read.
fn refuse_foreign(head: &[u8], path: &Path, named: Option<Format>) -> Result<(), ParseError> {
    // Without the reader of the format
    if spherule_readers::hdf5_signature::is_hdf5(head) {
        let what = "an HDF5 file, and this program was built without the feature `hdf5`";
        return Err(ParseError::unsupported(what));
    }
    if let Some(what) = is_text(head).then(|| text::what(head)).flatten() {
        return Err(ParseError::unsupported(what));
    }
    // Two or three bytes of raw floats may look like any short signature.
    let has_no_signature = named.is_some_and(|format| format.reader().info().has_no_signature);
    let shortest = if has_no_signature { 4 } else { 0 };
    foreign::refuse(head, path, shortest)
}

/// The names of all formats, as a list.
fn names() -> String {
    let names: Vec<&str> = registry::all().iter().map(|format| format.name()).collect();
    names.join(", ")
}

/// The first bytes for a message: as text where printable, else in hex.
fn opening(head: &[u8]) -> String {
    let start = &head[..head.len().min(8)];
    if start.iter().all(|b| (32..127).contains(b)) {
        format!("`{}`", String::from_utf8_lossy(start))
    } else {
        let hex: Vec<String> = start.iter().map(|b| format!("{b:02x}")).collect();
        format!("bytes {}", hex.join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::{
        bgeo, bi4, csv, gadget, gsd, houdini, lammps, npy, pdb, ply, usd, vtk, vtk_xml, xyz,
    };

    #[track_caller]
    fn detect(name: &str, bytes: &[u8]) -> Format {
        detect_format(bytes, Path::new(name)).expect("a known format")
    }

    #[track_caller]
    fn refused(name: &str, bytes: &[u8], words: &str) {
        let error = detect_format(bytes, Path::new(name)).expect_err("not readable");
        assert!(error.to_string().contains(words), "{error}");
    }

    /// The start of a ZIP whose first member is called `name`.
    fn zip(name: &[u8]) -> Vec<u8> {
        let length = u8::try_from(name.len()).expect("short");
        let mut bytes = b"PK\x03\x04".to_vec();
        bytes.resize(26, 0);
        bytes.extend([length, 0, 0, 0]);
        [&bytes, name].concat()
    }

    #[test]
    fn content_has_precedence_over_the_name() {
        assert_eq!(detect("a.ply", b"# vtk DataFile Version 4.2\nx\n"), vtk::FORMAT);
        assert_eq!(detect("a.vtk", b"ply\nformat ascii 1.0\n"), ply::FORMAT);
        assert_eq!(detect("a", b"BgeoV\0\0\0\x05"), bgeo::FORMAT);
        assert_eq!(detect("a", b"#FileJBD JPartDataBi4   "), bi4::FORMAT);
        assert_eq!(detect("a.bgeo", b"\x7fNSJb["), houdini::FORMAT);
        assert_eq!(detect("a.bgeo", b"\x7fbJSN["), houdini::FORMAT);
        assert_eq!(detect("a.geo", b"[\n\t\"fileversion\",\"19.5\""), houdini::FORMAT);
        assert_eq!(detect("a.txt", b"ITEM: TIMESTEP\n0\n"), lammps::FORMAT);
        assert_eq!(detect("a.csv", b"a title\n\n2 atoms\n1 atom types\n"), lammps::DATA);
        assert_eq!(
            detect("a", b"# made by hand\n\n  3  atoms # all\n-1 1.5 xlo xhi\n"),
            lammps::DATA
        );
        assert_eq!(detect("a.xyz", b"\x93NUMPY\x01\0"), npy::NPY);
        assert_eq!(detect("a.zip", b"PK\x03\x04"), npy::NPZ);
        assert_eq!(detect("a.zip", &zip(b"scene.usdc")), usd::FORMAT);
        assert_eq!(detect("a.csv", b"#usda 1.0\n"), usd::FORMAT);
        assert_eq!(detect("a", b"PXR-USDC\0\x08\0"), usd::FORMAT);
        assert_eq!(detect("a.xyz", &[0xdf, 0x65].repeat(4)), gsd::FORMAT);
        #[cfg(feature = "hdf5")]
        assert_eq!(detect("a.xyz", b"\x89HDF\r\n\x1a\n"), crate::hdf5::FORMAT);
        let vtu = b"<?xml version=\"1.0\"?>\n<VTKFile header_type=\"UInt64\" type=\"PolyData\">";
        assert_eq!(detect("a.vtk", vtu), vtk_xml::FORMAT);
    }

    #[test]
    fn text_is_sniffed() {
        assert_eq!(detect("a.xyz", b"3\n\nH 0 0 0\n"), xyz::FORMAT);
        assert_eq!(detect("a.xyz", &[0, 1, 2, 3]), xyz::FORMAT);
        assert_eq!(detect("a.xyz", b"\xff\xfe\x80\x3f"), xyz::FORMAT);
        assert_eq!(detect("a.xyz", b""), xyz::FORMAT);
        assert_eq!(detect("a.txt", b"3\n\nH 0 0 0\n"), xyz::FORMAT);
        assert_eq!(detect("a.dat", b"# x y z\n0 1 2\n3 4 5\n"), xyz::FORMAT);
        assert_eq!(detect("a.txt", b"0,1,2\n3,4,5\n"), csv::FORMAT);
        assert_eq!(detect("a.dat", b"Pos.x [m];Pos.y [m];Pos.z [m];\n0;1;2;\n"), csv::FORMAT);
        assert_eq!(detect("a.csv", b"\xef\xbb\xbfx,y,z\n"), csv::FORMAT);
        refused("README.txt", b"these are\nsome words\n", "no particle format");
        refused("a.dat", &[0, 1, 2, 3], "bytes 00 01 02 03");
    }

    #[test]
    fn files_of_pdb_and_pqr_are_told_apart() {
        let words = "ATOM 1 N ALA 1 1.5 2.5 3.5 -0.3 1.85\n";
        let pqr = "ATOM      1  N   MET     1      26.017  13.289  84.371  0.1592 1.8240\n";
        let shifted = "ATOM      1  N   MET     1      26.017   13.289   84.371  0.1592 1.8240\n";
        for atom in [words, pqr, shifted] {
            for text in [atom, &format!("HEADER    A TITLE\nREMARK   1 A NOTE\n{atom}")] {
                for name in ["a", "a.pqr", "a.pdb", "a.xyz", "a.txt"] {
                    assert_eq!(detect(name, text.as_bytes()), pdb::PQR, "{name}: {text}");
                }
            }
        }
        // Where occupancy and temperature factor may be charge and radius, the name decides
        let old = "ATOM      1  N   ALA A   1      11.104   6.134  -6.504  1.00  0.00\n";
        assert_eq!(detect("a.pqr", old.as_bytes()), pdb::PQR);
        let atom =
            "ATOM      1  N   ALA A   1      11.104   6.134  -6.504  1.00  0.00           N\n";
        for name in ["a", "a.pdb", "a.ent", "a.txt"] {
            assert_eq!(detect(name, old.as_bytes()), pdb::FORMAT, "{name}");
            assert_eq!(detect(name, atom.as_bytes()), pdb::FORMAT, "{name}");
        }
        assert_eq!(detect("a.pqr", atom.as_bytes()), pdb::FORMAT);
        // The atoms may be behind the bytes that are examined
        let notes = "REMARK   1 what the program did to get charges, at some length\n".repeat(80);
        assert_eq!(detect("a.PQR", format!("{notes}{words}").as_bytes()), pdb::PQR);
        assert_eq!(detect("a.pdb", notes.as_bytes()), pdb::FORMAT);
        refused("a.pqr", b"x,y,z\n1,2,3\n", "named like a pqr file");
    }

    #[test]
    fn snapshots_of_gadget_are_known_by_the_lengths_around_their_header() {
        let mut snapshot = vec![0; 400];
        (snapshot[1], snapshot[261]) = (1, 1);
        assert_eq!(detect("snapshot_001", &snapshot), gadget::FORMAT);
    }

    #[test]
    fn wrong_extension_is_reported() {
        refused("a.bgeo", b"hello world", "named like a bgeo file");
        refused("a.vtk", b"", "still being written");
        refused("a.csv", &[0, 159, 146], "named like a csv file");
    }

    #[test]
    fn known_unsupported_formats_have_a_remedy() {
        let collection = b"<VTKFile type=\"Collection\" version=\"0.1\">";
        refused("a.pvd", collection, "give one of the files");
        refused("a.pvtu", b"<VTKFile type='PUnstructuredGrid'>", "lists other files");
        refused("a.vtm", b"<VTKFile type=\"vtkMultiBlockDataSet\">", "lists other files");
        refused("a.vti", b"<VTKFile type=\"ImageData\">", "ImageData");
        let odd = b"<VTKFile type=\"a\n\x1b[2J\">";
        refused("a.vti", odd, r"type a\n\u{1b}[2J is not read");
        refused("a.gsd", &[0x65, 0xdf].repeat(4), "big-endian");
        refused("Part_0001.bi2", &[1, 2, 3], "DualSPHysics");
        refused("Part_0001", b"#File JPartDataBi4\0\0", "DualSPHysics");
        refused(
            "Part_Head.ibi4",
            b"#FileJBD JPartDataHead  ",
            "JPartDataHead, which has no particles",
        );
        let mut tar = vec![b'x'; 512];
        tar[257..262].copy_from_slice(b"ustar");
        refused("a.tar", &tar, "archive");
        refused("a.7z", b"7z\xbc\xaf\x27\x1c", "archive");
        refused("a.webp", b"RIFF\0\0\0\0WEBP", "image");
        refused("a.xmf", b"<?xml version=\"1.0\"?>\n<Xdmf>", "XDMF");
        refused("a.abc", b"Ogawa\0", "Alembic");
        refused("a.bgeo.sc", b"scf1", "blosc inside");
        refused("a.geo", b"PGEOMETRY V5\n", "bgeo");
        refused("a.pdb", b"\x9e\x02\0\0\x01\0", "PDB");
        refused("a.zst", b"\x28\xb5\x2f\xfd", "zstd");
        refused("dump.bin", &[0; 64], "LAMMPS binary");
        refused("other.bin", &[0; 64], "no particle format");
        refused("a.vdb", b" BDV\0\0\0\0", "OpenVDB");
        refused("a.png", b"\x89PNG\r\n", "image");
        refused("a.exr", b"\x76\x2f\x31\x01", "image");
        refused("a.gz", b"\x1f\x8b\x08", "gzip inside gzip");
        refused("a.tpr", b"\0\0\0\x0d\0\0\0\x0cVERSION 5.1.2", "gmx editconf");
        let mut tng = vec![1; 40];
        tng.extend(b"GENERAL INFO\0");
        refused("a.tng", &tng, "gmx trjconv");
    }
}
