//! The bytes of a native frame: header, sections, index. Everything is little-endian.
//!
//! ```text
//!   0  magic `SPHERULE`
//!   8  u32 version, 2             12  u32 length of this header, 64
//!  16  u64 length of the file
//!  24  u64 offset of the index    32  u64 length of the index   40  u64 xxh3 of the index
//!  48  u64 length of the details  56  u64 xxh3 of bytes 0..56
//!  64  sections of plain numbers, each at a multiple of 64, zeros between
//!      index: details (JSON, padded with spaces to a multiple of 16), then the rest (rkyv), up to the end of the file
//! ```
//!
//! Opening reads only the header and the index, whatever the particle count. No number in a file is trusted:
//! lengths follow from counts by checked arithmetic, and each section must end before the index.

use std::str::FromStr;
use std::{fmt, io};

use rkyv::rancor;
use rkyv::util::AlignedVec;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::stored::{RadiusCode, StoredType};
use crate::blocks::{BLOCK_SIZE, Block, Node, Q10Block, Q16Block, WIDTH};
use crate::{Labels, ParseError, SimulationCell, ValueError};

/// The first bytes of every native frame.
pub const MAGIC: &[u8; 8] = b"SPHERULE";
/// Version that this program reads and writes.
pub const VERSION: u32 = 2;
/// Length of the header in bytes.
pub const HEADER_LEN: usize = 64;
/// Largest number of components of an attribute: far more than any attribute has.
const MAX_COMPONENTS: u32 = 4096;
/// Alignment of sections, bytes: a cache line, and an AVX-512 vector.
pub const ALIGN: u64 = 64;

/// How positions are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Encoding {
    /// Unchanged f32, 12 bytes per particle.
    #[default]
    F32,
    /// 16 bits per axis within the box of the block, 6 bytes per particle.
    Q16,
    /// 11, 11 and 10 bits within the box of the block, 4 bytes per particle.
    Q10,
}

impl Encoding {
    /// All encodings, the most exact first.
    pub const ALL: [Self; 3] = [Self::F32, Self::Q16, Self::Q10];

    /// The name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::Q16 => "q16",
            Self::Q10 => "q10",
        }
    }

    /// Bytes of a block of 16 particles.
    pub const fn block_len(self) -> usize {
        match self {
            Self::F32 => size_of::<Block>(),
            Self::Q16 => size_of::<Q16Block>(),
            Self::Q10 => size_of::<Q10Block>(),
        }
    }

    /// The code of the encoding in the index.
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// The encoding with this code; `None` for unknown codes.
    pub fn of_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|e| e.code() == code)
    }
}

impl fmt::Display for Encoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Encoding {
    type Err = ValueError;

    fn from_str(name: &str) -> Result<Self, ValueError> {
        let found = Self::ALL.into_iter().find(|e| e.name() == name);
        found.ok_or_else(|| ValueError::one_of(&Self::ALL.map(Self::name), name))
    }
}

/// The place of a section and the xxh3 of its bytes.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize,
)]
pub struct Section {
    /// Offset from the start of the file, bytes.
    pub offset: u64,
    /// Length, bytes.
    pub len: u64,
    /// The xxh3 of these bytes.
    pub xxh3: u64,
}

/// Radii of a frame.
#[derive(Debug, Clone, Copy, PartialEq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub enum RadiusIndex {
    /// The radii are unknown.
    None,
    /// All particles have this radius.
    Common(f32),
    /// Each particle has its own radius.
    PerParticle(RadiiIndex),
}

/// Radii that differ, in blocks of 16 like the positions: f32, or `low + code * step`, where `step` is
/// `(high - low)` divided by the largest code.
#[derive(Debug, Clone, Copy, PartialEq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub struct RadiiIndex {
    /// The code of the stored type, see [`RadiusCode`].
    pub code: u32,
    /// The smallest radius.
    pub low: f32,
    /// The largest radius.
    pub high: f32,
    /// Largest difference of a stored radius from the true one.
    pub max_error: f32,
    /// The section with the radii.
    pub section: Section,
}

/// One attribute: interleaved values in the order of the positions.
#[derive(Debug, Clone, PartialEq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub struct AttributeIndex {
    /// Name.
    pub name: String,
    /// Code of the type, see [`StoredType`].
    pub stored: u32,
    /// Numbers per particle.
    pub components: u32,
    /// For each component, the values of code 0 and of code 255; empty except for 8-bit codes.
    pub ranges: Vec<[f64; 2]>,
    /// Largest difference of a stored value from the true one; 0 for values that are stored without loss.
    pub max_error: f64,
    /// The section with the values.
    pub section: Section,
}

/// Alignment of the part of the index after the details, bytes.
const INDEX_ALIGN: usize = 16;

/// Maximum length of the details of a frame, bytes: names of half a million values.
const MAX_DETAILS: usize = 16 << 20;

/// What a frame has beside its particles. Frames of earlier versions have none.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameDetails {
    /// Names of parts and of other values.
    #[serde(default, skip_serializing_if = "Labels::is_empty")]
    pub labels: Labels,
    /// The simulation cell, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<SimulationCell>,
}

/// The index: the contents of a native frame and their places.
#[derive(Debug, Clone, PartialEq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub struct FrameIndex {
    /// Number of particles.
    pub count: u64,
    /// Particles in a position block, 16.
    pub block: u32,
    /// How positions are stored, the code of an [`Encoding`].
    pub encoding: u32,
    /// The order of the particles, [`ORDER_KD`].
    pub order: u32,
    /// Which axis points up in the program that made the particles: 0 if unknown, or [`UP_Y`].
    pub up: u32,
    /// World position that stored positions are relative to.
    pub origin: [f64; 3],
    /// Smallest stored position; infinity if there are no particles.
    pub min: [f32; 3],
    /// Largest stored position; minus infinity if there are no particles.
    pub max: [f32; 3],
    /// Largest distance of a stored position from the true one, scene units.
    pub max_error: f64,
    /// The position blocks.
    pub positions: Section,
    /// Blocks that are stored as f32 because the encoding would be too coarse; empty for f32.
    pub wide: Section,
    /// The nodes of the tree, one for each eight blocks.
    pub nodes: Section,
    /// Radii.
    pub radius: RadiusIndex,
    /// Attributes.
    pub attributes: Vec<AttributeIndex>,
    /// Simulation time.
    pub time: Option<f64>,
    /// Step number of the simulation.
    pub step: Option<i64>,
    /// Particles that the conversion dropped because they were not finite.
    pub dropped: u64,
    /// What it has beside the particles.
    #[rkyv(with = rkyv::with::Skip)]
    pub details: FrameDetails,
}

/// Order code: k-d cuts inside runs of a space-filling curve, at whole nodes.
pub const ORDER_KD: u32 = 1;

/// Up code: the y axis, as in Houdini.
pub const UP_Y: u32 = 2;

impl FrameIndex {
    /// How positions are stored.
    ///
    /// # Panics
    /// Never for an index that was parsed or written.
    pub fn encoding(&self) -> Encoding {
        Encoding::of_code(self.encoding).expect("checked when the index was read")
    }

    /// All sections with their names.
    pub fn sections(&self) -> Vec<(String, &Section)> {
        let mut sections = self.tree_sections();
        for attribute in &self.attributes {
            sections.push((format!("attribute {}", attribute.name), &attribute.section));
        }
        sections
    }

    /// The sections of positions, nodes and radii, with their names.
    pub fn tree_sections(&self) -> Vec<(String, &Section)> {
        let mut sections = vec![
            ("the positions".to_owned(), &self.positions),
            ("the wide blocks".to_owned(), &self.wide),
            ("the nodes".to_owned(), &self.nodes),
        ];
        if let RadiusIndex::PerParticle(radii) = &self.radius {
            sections.push(("the radii".to_owned(), &radii.section));
        }
        sections
    }
}

/// Bytes of the position blocks of `count` particles.
pub fn positions_len(count: u64, encoding: Encoding) -> Option<u64> {
    blocks_of(count).checked_mul(encoding.block_len() as u64)
}

/// Bytes of the nodes over `count` particles.
pub fn nodes_len(count: u64) -> Option<u64> {
    let nodes = blocks_of(count).div_ceil(WIDTH as u64);
    nodes.checked_mul(size_of::<Node>() as u64)
}

/// Blocks that `count` particles fill.
pub const fn blocks_of(count: u64) -> u64 {
    count.div_ceil(BLOCK_SIZE as u64)
}

/// The bytes of `index`, and how many of them are details.
///
/// # Errors
/// The details are too long.
pub fn index_bytes(index: &FrameIndex) -> io::Result<(Vec<u8>, usize)> {
    let mut bytes = match &index.details {
        none if *none == FrameDetails::default() => Vec::new(),
        details => serde_json::to_vec(details)?,
    };
    bytes.resize(bytes.len().next_multiple_of(INDEX_ALIGN), b' ');
    let details = bytes.len();
    if details > MAX_DETAILS {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!(
                "the names of values have {details} bytes, but at most {MAX_DETAILS} are possible"
            ),
        ));
    }
    bytes.extend_from_slice(&rkyv::to_bytes::<rancor::Error>(index).map_err(io::Error::other)?);
    Ok((bytes, details))
}

/// The header of a file of `file_len` bytes that ends in `index`, whose first bytes are so many `details`.
pub fn header(file_len: u64, index_offset: u64, index: &[u8], details: usize) -> [u8; HEADER_LEN] {
    let mut header = [0; HEADER_LEN];
    header[0..8].copy_from_slice(MAGIC);
    header[8..12].copy_from_slice(&VERSION.to_le_bytes());
    header[12..16].copy_from_slice(&64u32.to_le_bytes());
    header[16..24].copy_from_slice(&file_len.to_le_bytes());
    header[24..32].copy_from_slice(&index_offset.to_le_bytes());
    header[32..40].copy_from_slice(&(index.len() as u64).to_le_bytes());
    header[40..48].copy_from_slice(&xxh3_64(index).to_le_bytes());
    header[48..56].copy_from_slice(&(details as u64).to_le_bytes());
    let sum = xxh3_64(&header[..56]);
    header[56..64].copy_from_slice(&sum.to_le_bytes());
    header
}

/// Reads and checks the header and the index of `bytes`, a whole file. Opening a file needs no more.
///
/// # Errors
/// [`ParseError::Malformed`] for a damaged or truncated file, [`ParseError::Unsupported`] for another version
/// or encoding.
pub fn parse(bytes: &[u8]) -> Result<FrameIndex, ParseError> {
    let range = index_range(bytes)?;
    let offset = range.start;
    let (details, index) = divided(bytes, range)?;
    // rkyv needs an alignment that a slice does not guarantee; the index is small enough to copy.
    let mut aligned = AlignedVec::<16>::with_capacity(index.len());
    aligned.extend_from_slice(index);
    let damaged = |e: rancor::Error| {
        ParseError::malformed(offset, format!("the index is damaged: {e}; convert it again"))
    };
    let archived = rkyv::access::<ArchivedFrameIndex, rancor::Error>(&aligned).map_err(damaged)?;
    let mut index = rkyv::deserialize::<FrameIndex, rancor::Error>(archived).map_err(damaged)?;
    if !details.is_empty() {
        index.details = serde_json::from_slice(details).map_err(|e| {
            let what = format!("the names of values are damaged: {e}; convert it again");
            ParseError::malformed(offset, what)
        })?;
    }
    let is_cell =
        |c: SimulationCell| SimulationCell::new(c.origin, c.vectors, c.periodic).is_some();
    if !index.details.cell.is_none_or(is_cell) {
        return Err(ParseError::malformed(offset, "the cell is not finite; convert it again"));
    }
    let again = |error: ParseError| error.map_message(|what| format!("{what}; convert it again"));
    check_index(&index, offset).map_err(again)?;
    Ok(index)
}

/// The details and the rest of the index, which is at `range` in `bytes`.
fn divided(bytes: &[u8], range: std::ops::Range<usize>) -> Result<(&[u8], &[u8]), ParseError> {
    let index = &bytes[range];
    let len = bytes.first_chunk().and_then(|header| usize::try_from(word(header, 48)).ok());
    let fits = |len: &usize| len.is_multiple_of(INDEX_ALIGN) && *len <= MAX_DETAILS;
    len.filter(fits).and_then(|len| index.split_at_checked(len)).ok_or_else(|| {
        ParseError::malformed(48, "the length of the details is wrong; convert it again")
    })
}

/// The number at byte `at` of the header.
fn word(header: &[u8; HEADER_LEN], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|i| header[at + i]))
}

/// The header, if it is intact and of this version.
fn intact_header(bytes: &[u8]) -> Result<&[u8; HEADER_LEN], ParseError> {
    let short = || {
        let what = format!(
            "the header has {HEADER_LEN} bytes, the file {}; perhaps it is still being copied",
            bytes.len()
        );
        ParseError::malformed(bytes.len(), what)
    };
    // Check the magic bytes and the checksum
    let header: &[u8; HEADER_LEN] = bytes.first_chunk().ok_or_else(short)?;
    if !header.starts_with(MAGIC) {
        return Err(ParseError::malformed(0, "no native frame: the magic bytes are missing"));
    }
    if word(header, 56) != xxh3_64(&header[..56]) {
        return Err(ParseError::malformed(
            56,
            "the header is damaged: its checksum differs; copy or convert it again",
        ));
    }
    // Check the version
    let version = u32::from_le_bytes(std::array::from_fn(|i| header[8 + i]));
    if version != VERSION {
        return Err(ParseError::unsupported(format!(
            "a native frame of version {version}, this program reads {VERSION}; convert again"
        )));
    }
    Ok(header)
}

/// Checks the header and returns the range of the index.
fn index_range(bytes: &[u8]) -> Result<std::ops::Range<usize>, ParseError> {
    let header = intact_header(bytes)?;
    // Check the length of the file
    let (file_len, offset, len) = (word(header, 16), word(header, 24), word(header, 32));
    if file_len != bytes.len() as u64 {
        return Err(ParseError::malformed(
            bytes.len().min(usize::try_from(file_len).unwrap_or(usize::MAX)),
            format!(
                "the file should have {file_len} bytes, but has {}; copy or convert it again",
                bytes.len()
            ),
        ));
    }
    // Find the index and check its checksum
    let index = usize::try_from(offset)
        .ok()
        .zip(offset.checked_add(len).and_then(|end| usize::try_from(end).ok()))
        .filter(|(start, end)| *start >= HEADER_LEN && *start <= *end && *end == bytes.len())
        .map(|(start, end)| start..end)
        .ok_or_else(|| {
            ParseError::malformed(24, "the index is outside the file; convert it again")
        })?;
    if word(header, 40) != xxh3_64(&bytes[index.clone()]) {
        return Err(ParseError::malformed(
            index.start,
            "the index is damaged: its checksum differs; copy or convert it again",
        ));
    }
    Ok(index)
}

/// Checks every section against the particle count and the bytes before the index at `end`.
fn check_index(index: &FrameIndex, end: usize) -> Result<(), ParseError> {
    // Check that this version can read the encoding and the order
    let encoding = Encoding::of_code(index.encoding)
        .filter(|_| index.block as usize == BLOCK_SIZE && index.order == ORDER_KD)
        .ok_or_else(|| {
            ParseError::unsupported(format!(
                "positions in encoding {} and order {} with blocks of {}, which this version does not \
                 read",
                index.encoding, index.order, index.block
            ))
        })?;
    // Check the sections of the tree
    let check = SectionCheck { count: index.count, end };
    let positions = positions_len(index.count, encoding);
    check.length("the positions", &index.positions, positions)?;
    check.length("the nodes", &index.nodes, nodes_len(index.count))?;
    let most = match encoding {
        Encoding::F32 => 0,
        Encoding::Q16 | Encoding::Q10 => blocks_of(index.count),
    };
    let wide = index.wide.len / size_of::<Block>() as u64;
    let is_whole = index.wide.len.is_multiple_of(size_of::<Block>() as u64) && wide <= most;
    check.length("the wide blocks", &index.wide, is_whole.then_some(index.wide.len))?;
    // Check the origin and the bounds
    let numbers = index.origin.iter().chain([&index.max_error]);
    let is_box = |i: usize| index.min[i].is_finite() && index.min[i] <= index.max[i];
    if numbers.into_iter().any(|n| !n.is_finite()) || index.count > 0 && !(0..3).all(is_box) {
        return Err(ParseError::malformed(
            end,
            "the index is damaged: origin or bounds are not numbers",
        ));
    }
    check_radius(index, check)?;
    // Check the sum of the sections: overlapping ones would need more memory than the file has bytes
    let lens = index.sections().into_iter().map(|(_, section)| section.len);
    let sum = lens.fold(0, u64::saturating_add);
    if sum > end as u64 {
        let what = format!("the sections have {sum} bytes, more than the file");
        return Err(ParseError::malformed(end, what));
    }
    // Check the attributes
    index.attributes.iter().try_for_each(|attribute| check_attribute(attribute, check))
}

fn check_radius(index: &FrameIndex, check: SectionCheck) -> Result<(), ParseError> {
    let bad = |what: &str| Err(ParseError::malformed(check.end, what));
    match &index.radius {
        RadiusIndex::None => Ok(()),
        RadiusIndex::Common(radius) if radius.is_finite() => Ok(()),
        RadiusIndex::Common(_) => bad("the radius is not a number"),
        RadiusIndex::PerParticle(radii) => {
            let Some(code) = RadiusCode::of_code(radii.code) else {
                return Err(ParseError::unsupported(format!(
                    "radii of type {}, which this version does not know",
                    radii.code
                )));
            };
            if !(radii.low.is_finite() && radii.high.is_finite() && radii.low <= radii.high) {
                return bad("the range of the radii is not a range");
            }
            let lanes = blocks_of(check.count).checked_mul(BLOCK_SIZE as u64);
            let len = lanes.and_then(|lanes| lanes.checked_mul(code.size() as u64));
            check.length("the radii", &radii.section, len)
        }
    }
}

fn check_attribute(attribute: &AttributeIndex, check: SectionCheck) -> Result<(), ParseError> {
    let stored = StoredType::of_code(attribute.stored).ok_or_else(|| {
        ParseError::unsupported(format!(
            "attribute {} has type code {}, which this version does not know",
            attribute.name, attribute.stored
        ))
    })?;
    let bad = |what: &str| {
        let what = format!("attribute {} {what}", attribute.name);
        Err(ParseError::malformed(check.end, what))
    };
    // Check the number of components
    let width = u64::from(attribute.components) * stored.size() as u64;
    if width == 0 || attribute.components > MAX_COMPONENTS {
        return bad("has no components, or absurdly many");
    }
    // Check the ranges
    let ranges = match stored {
        StoredType::Ranged => attribute.components as usize,
        _ => 0,
    };
    let is_finite = attribute.ranges.iter().flatten().all(|v| v.is_finite());
    if attribute.ranges.len() != ranges || !is_finite {
        return bad("has ranges that do not fit its type");
    }
    // Check the section
    let what = format!("attribute {}", attribute.name);
    check.length(&what, &attribute.section, check.count.checked_mul(width))
}

/// Checks the places of sections.
#[derive(Clone, Copy)]
struct SectionCheck {
    /// Number of particles.
    count: u64,
    /// Offset of the index.
    end: usize,
}

impl SectionCheck {
    /// Checks that `section` has `expected` bytes; `None` means that the length overflowed, and always fails.
    fn length(
        &self,
        what: &str,
        section: &Section,
        expected: Option<u64>,
    ) -> Result<(), ParseError> {
        let ends = section.offset.checked_add(section.len);
        let fits = ends.is_some_and(|e| e <= self.end as u64);
        let placed = section.offset >= HEADER_LEN as u64 && section.offset.is_multiple_of(ALIGN);
        if expected == Some(section.len) && fits && placed {
            return Ok(());
        }
        Err(ParseError::malformed(
            self.end,
            format!(
                "{what} of {} particles cannot be the {} bytes at {}",
                self.count, section.len, section.offset
            ),
        ))
    }
}
