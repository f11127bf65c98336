//! Known formats that are not read: what they are, and what to do instead.

use std::path::Path;

use memchr::memmem;

use crate::ParseError;

/// Magic bytes at the start, and the message.
const MAGICS: &[(&[u8], &str)] = &[
    (b"Ogawa", "an Alembic file, which is not read; export the points as .ply or .bgeo"),
    (b"scf1", "blosc inside another compression, which is not read; unpack it once with hsc"),
    (b"PGEOMETRY", "a Houdini text .geo, which is not read; convert to classic .bgeo with partio"),
    (b"\x9e\x02\0\0", PDB),
    (b"\0\0\x02\x9e", PDB),
    (b"ATTRIBUTES", "a PDA particle file, which is not read; convert to .bgeo with partio"),
    (b"PDC ", "a Maya PDC cache, which is not read; convert to .bgeo with partio"),
    (b"\xc0PRT\r\n\x1a\n", "a Krakatoa PRT file, which is not read; convert to .bgeo with partio"),
    (b"\x28\xb5\x2f\xfd", "zstd inside another compression, which is not read; unpack it once"),
    (b"\xfd7zXZ\0", "xz inside another compression, which is not read; unpack it once"),
    (b"BZh", "bzip2 inside another compression, which is not read; unpack it once"),
    (b"\x04\x22\x4d\x18", "LZ4 inside another compression, which is not read; unpack it once"),
    (b"\x1f\x8b", "gzip inside gzip or another compression, which is not read; unpack it once"),
    (
        b"\x02\x21\x4c\x18",
        "the older LZ4 format, which is not read; compress with another version of `lz4`, or without -l",
    ),
    (b" BDV", "an OpenVDB volume, which is not read; export the points as .ply or .bgeo"),
    (b"\x76\x2f\x31\x01", IMAGE),
    (b"\x89PNG", IMAGE),
    (b"\xff\xd8\xff", IMAGE),
    (b"II*\0", IMAGE),
    (b"MM\0*", IMAGE),
    (b"GIF8", IMAGE),
    (b"8BPS", IMAGE),
    (b"DDS ", IMAGE),
    (b"#?RADIANCE", IMAGE),
    (b"7z\xbc\xaf\x27\x1c", ARCHIVE),
    (b"Rar!\x1a\x07", ARCHIVE),
    (
        b"MATLAB ",
        "a MATLAB file, which is not read; write positions and attributes to .npz with SciPy and numpy",
    ),
    (b"PAR1", "a Parquet file, which is not read; write .csv or .npz with pandas"),
    (b"SQLite format 3", "an SQLite database, which is not read; write the particles as .csv"),
    (b"BLENDER", "a Blender file, which is not read; export the points as .ply"),
    (b"Kaydara FBX", "an FBX file, which is not read; export the points as .ply"),
    (b"glTF", "a glTF file, which is not read; export the points as .ply"),
    (b"\xff\xfe", UTF16),
    (b"\xfe\xff", UTF16),
];

const IMAGE: &str = "an image, not a particle file";
const ARCHIVE: &str = "an archive, which is not read; unpack it and give its files";
const DUALSPHYSICS: &str = "a DualSPHysics file of an older version, or without particles, which is not read; give \
                            Part_####.bi4, or write .vtk with `PartVTK`";
const PDB: &str = "a PDB particle file, which is not read; convert to .bgeo with partio";
/// What ADIOS2 writes, a file or a directory.
pub(crate) const ADIOS: &str = "ADIOS2 data (.bp), which is not read; write HDF5 instead, or convert with `openpmd-pipe --infile in.bp \
                                --outfile out.h5`";
const TNG: &str =
    "a GROMACS TNG trajectory, which is not read; write .xtc (`gmx trjconv -f in.tng -o out.xtc`)";
const TPR: &str = "a GROMACS run input file (.tpr), which is not read; write .gro (`gmx editconf -f in.tpr -o out.gro`), which \
                   can also be given with --topology";
const UTF16: &str = "UTF-16 text, which is not read; save as UTF-8";
const LAMMPS_BINARY: &str = "a LAMMPS binary dump without names of columns, which is not read; run `binary2txt` on it, or dump to a text file";
const XDMF: &str = "an XDMF index, which keeps its data in other files; save as .vtu with ParaView";

/// Refuses what is known by its first bytes (magics of `shortest` bytes and more), or failing
/// that by its name.
pub(super) fn refuse(head: &[u8], path: &Path, shortest: usize) -> Result<(), ParseError> {
    let what = MAGICS
        .iter()
        .find(|(magic, _)| magic.len() >= shortest && head.starts_with(magic))
        .map(|(_, what)| *what)
        .or_else(|| by_structure(head))
        .or_else(|| is_lammps_binary(head, path).then_some(LAMMPS_BINARY))
        .or_else(|| is_dualsphysics(head, path).then_some(DUALSPHYSICS))
        .or_else(|| path.extension().is_some_and(|end| end == "bp").then_some(ADIOS))
        .or_else(|| is_xdmf(head).then_some(XDMF));
    what.map_or(Ok(()), |what| Err(ParseError::unsupported(what)))
}

/// Formats that are known by bytes after the first.
fn by_structure(head: &[u8]) -> Option<&'static str> {
    let at = |at: usize, bytes: &[u8]| head.get(at..).is_some_and(|b| b.starts_with(bytes));
    [
        (at(257, b"ustar"), ARCHIVE),
        (at(0, b"RIFF") && at(8, b"WEBP"), IMAGE),
        (at(4, b"ftyp"), "a video or image, not a particle file"),
        (at(40, b"GENERAL INFO\0"), TNG),
        (at(8, b"VERSION "), TPR),
    ]
    .into_iter()
    .find_map(|(is_one, what)| is_one.then_some(what))
}

/// Their first text names the content. Not all versions have it, so the file name counts, too.
fn is_dualsphysics(head: &[u8], path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let named = [".ibi4", ".obi4", ".bi2"].iter().any(|end| name.ends_with(end));
    named || (head.starts_with(b"#File ") && head.contains(&0))
}

/// Newer versions open with minus the length of a name, then the name; older ones with a bare
/// step number, where only the file name helps.
fn is_lammps_binary(head: &[u8], path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let named = name.ends_with(".bin") && (name.contains("dump") || name.contains("lammps"));
    let opens = head
        .split_at_checked(8)
        .is_some_and(|(length, name)| length[7] == 0xff && name.starts_with(b"DUMP"));
    named || opens
}

fn is_xdmf(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    text.trim_ascii_start().starts_with(b"<") && memmem::find(text, b"<Xdmf").is_some()
}
