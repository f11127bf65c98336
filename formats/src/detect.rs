//! Which format a file is: by content first, by name second.
//!
//! Extensions lie (`.vtk` is text or binary, `.xyz` is three unrelated things, partio gzips
//! `.bgeo`), so magic bytes decide and the name only breaks ties. Files that are known but not
//! read get an error that says what to do instead (`foreign.rs`). Gzip is taken off
//! before, by [`crate::open`]; the readers themselves live in [`crate::read`].

use std::path::Path;

use crate::read::xyz::Kind;
use crate::read::{self, CUT_SHORT, Step, TextInput, stream_bytes};
use crate::{MemoryBudget, ParseError, RawParticles, native};

mod foreign;
mod hdf5;
mod molecules;

/// The bytes that detection looks at; more may be given, less is fine for short files.
pub const HEAD_LEN: usize = 4096;

/// A format that this crate reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Format {
    /// Our native frame file.
    Spf,
    /// Legacy VTK, text or binary.
    VtkLegacy,
    /// XML VTK: `.vtu` and `.vtp`.
    VtkXml,
    /// Classic BGEO version 5, as partio writes it.
    Bgeo,
    /// PLY, text or binary.
    Ply,
    /// Raw f32 triples, molecular text, or bare text: the reader tells them apart.
    Xyz,
    /// LAMMPS text dump.
    Lammps,
    /// One numpy array.
    Npy,
    /// A ZIP of numpy arrays.
    Npz,
    /// Separated columns with a line of names.
    Csv,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 10] = [
        Self::Spf,
        Self::VtkLegacy,
        Self::VtkXml,
        Self::Bgeo,
        Self::Ply,
        Self::Xyz,
        Self::Lammps,
        Self::Npy,
        Self::Npz,
        Self::Csv,
    ];

    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Spf => "spf",
            Self::VtkLegacy => "vtk",
            Self::VtkXml => "vtk-xml",
            Self::Bgeo => "bgeo",
            Self::Ply => "ply",
            Self::Xyz => "xyz",
            Self::Lammps => "lammps",
            Self::Npy => "npy",
            Self::Npz => "npz",
            Self::Csv => "csv",
        }
    }

    /// What the file's name promises, `.gz` left out; `None` for names that say nothing.
    pub fn by_name(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let name = strip_gz(&name);
        let (stem, extension) = name.rsplit_once('.')?;
        Some(match extension {
            "spf" => Self::Spf,
            "vtk" => Self::VtkLegacy,
            "vtu" | "vtp" => Self::VtkXml,
            "bgeo" | "bhclassic" => Self::Bgeo,
            "ply" => Self::Ply,
            "xyz" | "extxyz" => Self::Xyz,
            "lammps" | "lammpstrj" | "dump" => Self::Lammps,
            "npy" => Self::Npy,
            "npz" => Self::Npz,
            "csv" | "tsv" => Self::Csv,
            // `dump.250`, `dump.drop.250`: LAMMPS names without an extension.
            _ if is_digits(extension) && (stem == "dump" || stem.starts_with("dump.")) => {
                Self::Lammps
            }
            _ => return None,
        })
    }

    /// True if one file of this format may hold several time steps.
    pub const fn may_hold_many_steps(self) -> bool {
        matches!(self, Self::Xyz | Self::Lammps | Self::Npy | Self::Npz)
    }

    /// The format of an uncompressed file that begins with `bytes` (all of it, or at least
    /// [`HEAD_LEN`] of it) and is called `path`.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] for a known format that is not read, with what to do;
    /// [`ParseError::Malformed`] for an empty file (but not `.xyz`: that is zero raw particles),
    /// for content that is not what its name promises, and for content that nothing knows.
    pub fn detect(bytes: &[u8], path: &Path) -> Result<Self, ParseError> {
        let named = Self::by_name(path);
        if bytes.is_empty() {
            return match named {
                Some(Self::Xyz) => Ok(Self::Xyz),
                _ => Err(ParseError::malformed(
                    0,
                    "the file is empty; perhaps it is still being written",
                )),
            };
        }
        let head = &bytes[..bytes.len().min(HEAD_LEN)];
        if let Some(format) = by_magic(head)? {
            return Ok(format);
        }
        let foreign = hdf5::what(bytes).or_else(|| is_text(head).then(|| molecules::what(head))?);
        if let Some(what) = foreign {
            return Err(ParseError::unsupported(what));
        }
        // Two or three bytes of raw floats may look like any short magic.
        let shortest = if named == Some(Self::Xyz) { 4 } else { 0 };
        foreign::refuse(head, path, shortest)?;
        match named {
            Some(Self::Xyz) => Ok(Self::Xyz),
            Some(Self::Csv) if is_text(head) => Ok(Self::Csv),
            Some(format) => Err(ParseError::malformed(
                0,
                format!(
                    "named like a {} file, but does not begin like one: {}",
                    format.name(),
                    opening(head)
                ),
            )),
            None => sniff_text(head).ok_or_else(|| {
                ParseError::malformed(
                    0,
                    format!(
                        "no particle format begins with {}; read are {}",
                        opening(head),
                        Self::ALL.map(Self::name).join(", ")
                    ),
                )
            }),
        }
    }

    /// The time steps that the whole uncompressed file `bytes` holds.
    ///
    /// # Errors
    /// What the reader of the format says.
    pub fn steps(self, bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        self.steps_within(&mut TextInput::whole(bytes), MemoryBudget::UNLIMITED)
    }

    /// [`Self::steps`] of what `text` gives, within a budget.
    pub(crate) fn steps_within(
        self,
        text: &mut TextInput<'_>,
        budget: MemoryBudget,
    ) -> Result<Vec<Step>, ParseError> {
        let bytes = text.as_whole().unwrap_or_default();
        match self {
            Self::Spf => native::steps(bytes),
            Self::VtkLegacy => Ok(read::vtk::steps(text, budget)),
            Self::VtkXml => read::vtk_xml::steps(bytes, budget),
            Self::Bgeo => read::bgeo::steps(bytes),
            Self::Ply => read::ply::steps(text),
            Self::Xyz => read::xyz::steps(text, budget),
            Self::Lammps => read::lammps::steps(text, budget),
            Self::Npy | Self::Npz => read::npy::steps(bytes, budget),
            Self::Csv => read::csv::steps(text),
        }
    }

    /// Reads one of the [`Self::steps`] of `bytes`.
    ///
    /// # Errors
    /// What the reader of the format says.
    pub fn read(self, bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        self.read_within(&mut TextInput::whole(bytes), step, MemoryBudget::UNLIMITED)
    }

    /// [`Self::read`] of what `text` gives if the numbers fit into a budget, apart from what is in memory of `text`.
    ///
    /// # Errors
    /// As [`Self::read`], and [`ParseError::TooLarge`].
    pub(crate) fn read_within(
        self,
        text: &mut TextInput<'_>,
        step: &Step,
        budget: MemoryBudget,
    ) -> Result<RawParticles, ParseError> {
        let bytes = text.as_whole().unwrap_or_default();
        if text.as_whole().is_some()
            && (bytes.len() < step.span.end || step.span.end < step.span.start)
        {
            let what = format!("the step ends at {}: {CUT_SHORT}", step.span.end);
            return Err(ParseError::malformed(bytes.len(), what));
        }
        match self {
            Self::Spf => native::read(bytes, step),
            Self::VtkLegacy => read::vtk::read(text, budget),
            Self::VtkXml => read::vtk_xml::read(bytes, step, budget),
            Self::Bgeo => read::bgeo::read(bytes, step),
            Self::Ply => read::ply::read(text, budget),
            Self::Xyz => read::xyz::read(text, step, budget),
            Self::Lammps => read::lammps::read(text, step, budget),
            Self::Npy | Self::Npz => read::npy::read(bytes, step, budget),
            Self::Csv => read::csv::read(text, budget),
        }
    }

    /// Bytes that are held beside the numbers while a text is read in pieces.
    pub(crate) fn stream_bytes(self) -> u64 {
        stream_bytes(matches!(self, Self::Lammps | Self::Csv | Self::Xyz))
    }

    /// Whether a file that begins with `head`, and goes on, is text that can be read in pieces.
    pub(crate) fn is_streamed(self, head: &[u8]) -> bool {
        match self {
            Self::Lammps => true,
            Self::Csv => read::csv::is_told_by(head),
            Self::Xyz => match read::xyz::kind(head) {
                Ok(Kind::Molecular) => true,
                Ok(Kind::Bare) => read::csv::is_told_by(head),
                Ok(Kind::Raw) | Err(_) => false,
            },
            Self::Ply => read::ply::is_text(head),
            Self::VtkLegacy => read::vtk::is_text(head),
            Self::Spf | Self::VtkXml | Self::Bgeo | Self::Npy | Self::Npz => false,
        }
    }
}

/// `name` without a final `.gz` (given in lower case).
pub(crate) fn strip_gz(name: &str) -> &str {
    name.strip_suffix(".gz").unwrap_or(name)
}

pub(crate) fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

/// Formats that announce themselves. XML needs a look at the root element.
fn by_magic(head: &[u8]) -> Result<Option<Format>, ParseError> {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    Ok(Some(match head {
        _ if head.starts_with(native::MAGIC) => Format::Spf,
        _ if starts_ignoring_case(text, b"# vtk DataFile") => Format::VtkLegacy,
        _ if head.starts_with(b"BgeoV") => Format::Bgeo,
        _ if head.starts_with(b"ply\n") || head.starts_with(b"ply\r") => Format::Ply,
        _ if head.starts_with(b"\x93NUMPY") => Format::Npy,
        _ if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") => {
            foreign::refuse_usdz(head)?;
            Format::Npz
        }
        _ if text.trim_ascii_start().starts_with(b"ITEM:") => Format::Lammps,
        _ if text.trim_ascii_start().starts_with(b"<") => return vtk_xml_kind(text),
        _ => return Ok(None),
    }))
}

/// Tells particle files from collections and grids by the `type` of the root element.
fn vtk_xml_kind(head: &[u8]) -> Result<Option<Format>, ParseError> {
    let head = String::from_utf8_lossy(head);
    let Some((_, root)) = head.split_once("<VTKFile") else {
        return match head.contains("<Xdmf") {
            true => Err(ParseError::unsupported(
                "an XDMF index, whose numbers lie in other files; save as .vtu with ParaView",
            )),
            false => Ok(None),
        };
    };
    let root = root.split_once('>').map_or(root, |(root, _)| root);
    let kind = ["type=\"", "type='"].iter().find_map(|key| {
        // `header_type=` ends the same way, so a blank must come before.
        let at = root
            .match_indices(key)
            .find(|(at, _)| root[..*at].ends_with(char::is_whitespace))?
            .0;
        root[at + key.len()..].split(['"', '\'']).next()
    });
    match kind {
        Some("UnstructuredGrid" | "PolyData") => Ok(Some(Format::VtkXml)),
        Some("Collection") => Err(ParseError::unsupported(
            "a ParaView collection (.pvd), which only lists other files; give those files",
        )),
        Some("PUnstructuredGrid" | "PPolyData") => Err(ParseError::unsupported(
            "a parallel VTK index (.pvtu, .pvtp), which only lists its pieces; give the pieces",
        )),
        Some(kind) if kind.contains("MultiBlock") || kind.contains("PartitionedDataSet") => {
            Err(ParseError::unsupported(
                "a VTK multi-block index (.vtm), which only lists its blocks; give the blocks",
            ))
        }
        Some(kind) => Err(ParseError::unsupported(format!(
            "a VTK file of type {kind} holds no particles; save as UnstructuredGrid or PolyData"
        ))),
        // The reader says what is wrong with the root element.
        None => Ok(Some(Format::VtkXml)),
    }
}

/// Decides for text that no name explains: columns with names or separators are CSV, a count
/// or bare numbers are XYZ.
fn sniff_text(head: &[u8]) -> Option<Format> {
    if !is_text(head) {
        return None;
    }
    let text = String::from_utf8_lossy(head);
    let mut lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .map(str::trim)
        .filter(|l| !l.is_empty() && !l.starts_with('#') && !l.starts_with("//"));
    let first = lines.next()?;
    if is_digits(first) {
        return Some(Format::Xyz);
    }
    if has_numbers(first) {
        let separated = first.contains([',', ';', '\t']);
        return Some(if separated { Format::Csv } else { Format::Xyz });
    }
    // A line of names, or free lines before it: numbers must follow soon.
    lines.take(8).any(has_numbers).then_some(Format::Csv)
}

/// True if `line` is three or more numbers and nothing else (an empty last cell aside).
fn has_numbers(line: &str) -> bool {
    let cells = || {
        line.split([',', ';', '\t', ' '])
            .map(|cell| cell.trim().trim_matches('"'))
            .filter(|cell| !cell.is_empty())
    };
    cells().all(|cell| cell.parse::<f64>().is_ok()) && cells().nth(2).is_some()
}

/// True if `head` is UTF-8 (a character cut off by the end aside) without control characters.
fn is_text(head: &[u8]) -> bool {
    let whole = match std::str::from_utf8(head) {
        Ok(_) => true,
        Err(e) => e.error_len().is_none() && head.len() >= HEAD_LEN - 3,
    };
    whole
        && head
            .iter()
            .all(|b| *b >= 32 && *b != 127 || matches!(b, b'\t' | b'\n' | b'\r'))
}

fn starts_ignoring_case(bytes: &[u8], prefix: &[u8]) -> bool {
    bytes
        .get(..prefix.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(prefix))
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

    #[track_caller]
    fn detect(name: &str, bytes: &[u8]) -> Format {
        Format::detect(bytes, Path::new(name)).expect("a known format")
    }

    #[track_caller]
    fn refused(name: &str, bytes: &[u8], words: &str) {
        let error = Format::detect(bytes, Path::new(name)).expect_err("not readable");
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
    fn content_goes_before_the_name() {
        assert_eq!(
            detect("a.ply", b"# vtk DataFile Version 4.2\nx\n"),
            Format::VtkLegacy
        );
        assert_eq!(detect("a.vtk", b"ply\nformat ascii 1.0\n"), Format::Ply);
        assert_eq!(detect("a", b"BgeoV\0\0\0\x05"), Format::Bgeo);
        assert_eq!(detect("a.txt", b"ITEM: TIMESTEP\n0\n"), Format::Lammps);
        assert_eq!(detect("a.xyz", b"\x93NUMPY\x01\0"), Format::Npy);
        assert_eq!(detect("a.zip", b"PK\x03\x04"), Format::Npz);
        let vtu = b"<?xml version=\"1.0\"?>\n<VTKFile header_type=\"UInt64\" type=\"PolyData\">";
        assert_eq!(detect("a.vtk", vtu), Format::VtkXml);
    }

    #[test]
    fn text_is_sniffed() {
        assert_eq!(detect("a.xyz", b"3\n\nH 0 0 0\n"), Format::Xyz);
        assert_eq!(detect("a.xyz", &[0, 1, 2, 3]), Format::Xyz);
        assert_eq!(detect("a.xyz", b"\xff\xfe\x80\x3f"), Format::Xyz);
        assert_eq!(detect("a.xyz", b""), Format::Xyz);
        assert_eq!(detect("a.txt", b"3\n\nH 0 0 0\n"), Format::Xyz);
        assert_eq!(detect("a.dat", b"# x y z\n0 1 2\n3 4 5\n"), Format::Xyz);
        assert_eq!(detect("a.txt", b"0,1,2\n3,4,5\n"), Format::Csv);
        assert_eq!(
            detect("a.dat", b"Pos.x [m];Pos.y [m];Pos.z [m];\n0;1;2;\n"),
            Format::Csv
        );
        assert_eq!(detect("a.csv", b"\xef\xbb\xbfx,y,z\n"), Format::Csv);
        refused(
            "README.txt",
            b"these are\nsome words\n",
            "no particle format",
        );
        refused("a.dat", &[0, 1, 2, 3], "bytes 00 01 02 03");
    }

    #[test]
    fn a_name_that_lies_is_told() {
        refused("a.bgeo", b"hello world", "named like a bgeo file");
        refused("a.vtk", b"", "still being written");
        refused("a.csv", &[0, 159, 146], "named like a csv file");
    }

    #[test]
    fn known_foreign_files_say_what_to_do() {
        let collection = b"<VTKFile type=\"Collection\" version=\"0.1\">";
        refused("a.pvd", collection, "give those files");
        refused(
            "a.pvtu",
            b"<VTKFile type='PUnstructuredGrid'>",
            "give the pieces",
        );
        refused(
            "a.vtm",
            b"<VTKFile type=\"vtkMultiBlockDataSet\">",
            "give the blocks",
        );
        refused("a.vti", b"<VTKFile type=\"ImageData\">", "ImageData");
        let odd = b"<VTKFile type=\"a\n\x1b[2J\">";
        refused("a.vti", odd, r"type a\n\u{1b}[2J holds");
        refused("a.h5", b"\x89HDF\r\n\x1a\n", "HDF5");
        refused(
            "a.csv",
            b"a title\n\n2 atoms\n1 atom types\n",
            "LAMMPS data file",
        );
        refused("a.usdz", &zip(b"scene.usdc"), "USD");
        refused("a.usda", b"#usda 1.0\n", "USD");
        refused("a.xtc", b"\0\0\x07\xcb\0\0\0\x03", "GROMACS");
        refused("a.dcd", b"\x54\0\0\0CORD\0", "DCD");
        refused("a.gsd", &[0xdf, 0x65].repeat(4), "GSD");
        refused("Part_0001.bi4", &[1, 2, 3], "DualSPHysics");
        refused("Part_0001", b"#File JPartDataBi4\0\0", "DualSPHysics");
        let mut snapshot = vec![0; 400];
        (snapshot[1], snapshot[261]) = (1, 1);
        refused("snapshot_001", &snapshot, "Gadget");
        let mut tar = vec![b'x'; 512];
        tar[257..262].copy_from_slice(b"ustar");
        refused("a.tar", &tar, "archive");
        refused("a.7z", b"7z\xbc\xaf\x27\x1c", "archive");
        refused("a.webp", b"RIFF\0\0\0\0WEBP", "image");
        refused("a.xmf", b"<?xml version=\"1.0\"?>\n<Xdmf>", "XDMF");
        refused("a.abc", b"Ogawa\0", "Alembic");
        refused("a.bgeo", b"\x7fNSJ", "bhclassic");
        refused("a.bgeo", b"[\n\t\"fileversion\",\"19.5\"", "bhclassic");
        refused("a.bgeo.sc", b"scf1", "bhclassic");
        refused("a.geo", b"PGEOMETRY V5\n", "bgeo");
        refused("a.pdb", b"\x9e\x02\0\0\x01\0", "PDB");
        refused("a.zst", b"\x28\xb5\x2f\xfd", "zstd");
        refused("dump.bin", &[0; 64], "LAMMPS binary");
        refused("other.bin", &[0; 64], "no particle format");
        refused("a.vdb", b" BDV\0\0\0\0", "OpenVDB");
        refused("a.nc", b"CDF\x01", "NetCDF");
        refused("a.png", b"\x89PNG\r\n", "image");
        refused("a.exr", b"\x76\x2f\x31\x01", "image");
        refused("a.gz", b"\x1f\x8b\x08", "gzip inside gzip");
    }

    #[test]
    fn names_say_what_they_can() {
        let by_name = |name: &str| Format::by_name(Path::new(name));
        assert_eq!(by_name("x/dump.drop.1200.lammps.gz"), Some(Format::Lammps));
        assert_eq!(by_name("dump.250"), Some(Format::Lammps));
        assert_eq!(by_name("A_7.VTK"), Some(Format::VtkLegacy));
        assert_eq!(by_name("notes.12"), None);
        assert_eq!(by_name("README"), None);
    }
}
