//! Files that are known but not read: what they are, and what to do instead.

use std::path::Path;

use crate::ParseError;

/// Magic bytes at the start, and the message.
const MAGICS: &[(&[u8], &str)] = &[
    (
        b"\x89HDF",
        "an HDF5 file, which is not read; for PySPH: `pysph dump_vtk` writes .vtu from it",
    ),
    (
        b"Ogawa",
        "an Alembic file, which is not read; export the points as .ply or .bgeo",
    ),
    (
        b"\x7fNSJ",
        "the newer Houdini binary bgeo, which is not read; save as .bhclassic",
    ),
    (
        b"scf1",
        "a blosc-compressed bgeo (.bgeo.sc), which is not read; save as .bhclassic",
    ),
    (
        b"PGEOMETRY",
        "a Houdini text .geo, which is not read; convert to classic .bgeo with partio",
    ),
    (b"\x9e\x02\0\0", PDB),
    (b"\0\0\x02\x9e", PDB),
    (
        b"ATTRIBUTES",
        "a PDA particle file, which is not read; convert to .bgeo with partio",
    ),
    (
        b"PDC ",
        "a Maya PDC cache, which is not read; convert to .bgeo with partio",
    ),
    (
        b"\xc0PRT\r\n\x1a\n",
        "a Krakatoa PRT file, which is not read; convert to .bgeo with partio",
    ),
    (
        b"\x28\xb5\x2f\xfd",
        "zstd-compressed, which is not read; unpack with `zstd -d`, or use gzip",
    ),
    (
        b"\xfd7zXZ\0",
        "xz-compressed, which is not read; unpack with `xz -d`, or use gzip",
    ),
    (
        b"BZh",
        "bzip2-compressed, which is not read; unpack with `bzip2 -d`, or use gzip",
    ),
    (
        b"\x04\x22\x4d\x18",
        "lz4-compressed, which is not read; unpack with `lz4 -d`, or use gzip",
    ),
    (
        b"\x1f\x8b",
        "gzip inside gzip, which is not read; unpack it once",
    ),
    (
        b" BDV",
        "an OpenVDB volume, which is not read; export the points as .ply or .bgeo",
    ),
    (
        b"CDF\x01",
        "a NetCDF file, which is not read; export as .vtu or .npy",
    ),
    (
        b"CDF\x02",
        "a NetCDF file, which is not read; export as .vtu or .npy",
    ),
    (
        b"CDF\x05",
        "a NetCDF file, which is not read; export as .vtu or .npy",
    ),
    (b"\x76\x2f\x31\x01", "an image, no particle file"),
    (b"\x89PNG", "an image, no particle file"),
    (b"\xff\xd8\xff", "an image, no particle file"),
    (b"II*\0", "an image, no particle file"),
    (b"MM\0*", "an image, no particle file"),
    (b"\xff\xfe", UTF16),
    (b"\xfe\xff", UTF16),
];

const PDB: &str = "a PDB particle file, which is not read; convert to .bgeo with partio";
const UTF16: &str = "UTF-16 text, which is not read; save as UTF-8";
const LAMMPS_BINARY: &str =
    "a LAMMPS binary dump, which is not read; run `binary2txt` on it, or dump to a text file";
const HOUDINI_JSON: &str = "the newer Houdini bgeo in JSON, which is not read; save as .bhclassic";

/// Refuses what is known by its first bytes (magics of `shortest` bytes and more), or failing
/// that by its name.
pub(super) fn refuse(head: &[u8], path: &Path, shortest: usize) -> Result<(), ParseError> {
    let what = MAGICS
        .iter()
        .find(|(magic, _)| magic.len() >= shortest && head.starts_with(magic))
        .map(|(_, what)| *what)
        .or_else(|| is_lammps_binary(head, path).then_some(LAMMPS_BINARY))
        .or_else(|| is_houdini_json(head).then_some(HOUDINI_JSON));
    what.map_or(Ok(()), |what| Err(ParseError::unsupported(what)))
}

/// Newer versions open with minus the length of a name, then the name; older ones with a bare
/// step number, where only the file name helps.
fn is_lammps_binary(head: &[u8], path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    let named = name.ends_with(".bin") && (name.contains("dump") || name.contains("lammps"));
    let opens = head
        .split_at_checked(8)
        .is_some_and(|(length, name)| length[7] == 0xff && name.starts_with(b"DUMP"));
    named || opens
}

fn is_houdini_json(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&head[..head.len().min(64)]);
    head.trim_start()
        .strip_prefix('[')
        .is_some_and(|rest| rest.trim_start().starts_with("\"fileversion\""))
}
