//! The bytes of a native frame: header, sections, index. Everything is little-endian.
//!
//! ```text
//!   0  magic `SPHERULE`
//!   8  u32 version, 1             12  u32 length of this header, 64
//!  16  u64 length of the file
//!  24  u64 offset of the index    32  u64 length of the index   40  u64 xxh3 of the index
//!  48  u64 zero                   56  u64 xxh3 of bytes 0..56
//!  64  sections of plain numbers, each at a multiple of 64, zeros between
//!      index (rkyv), last, up to the end of the file
//! ```
//!
//! Opening looks at header and index only, whatever the particle count. Nothing here trusts a
//! number: lengths follow from counts by checked arithmetic and must fit before the index.

use rkyv::rancor;
use rkyv::util::AlignedVec;
use xxhash_rust::xxh3::xxh3_64;

use crate::{ParseError, ScalarType};

/// The first bytes of every native frame.
pub const MAGIC: &[u8; 8] = b"SPHERULE";
/// Version that is written and read.
pub const VERSION: u32 = 1;
/// Length of the header in bytes.
pub const HEADER_LEN: usize = 64;
/// Alignment of sections: a cache line, and an AVX-512 vector.
pub const ALIGN: u64 = 64;
/// Particles in a position block.
pub const BLOCK: usize = 16;

/// Positions of [`BLOCK`] particles, one array an axis, relative to the frame's origin. The last
/// block of a frame is filled up with its last particle.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub struct PositionBlock {
    /// x of each particle.
    pub x: [f32; BLOCK],
    /// y of each particle.
    pub y: [f32; BLOCK],
    /// z of each particle.
    pub z: [f32; BLOCK],
}

/// Encoding code of plain f32 blocks, the only one so far.
pub const ENCODING_F32: u32 = 0;
/// Order code: as in the file that the particles came from.
pub const ORDER_FILE: u32 = 0;

/// Where a section is, and the xxh3 of its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub struct Section {
    /// From the start of the file.
    pub offset: u64,
    /// Bytes.
    pub len: u64,
    /// Of exactly these bytes.
    pub xxh3: u64,
}

/// Radii of a frame.
#[derive(Debug, Clone, Copy, PartialEq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub enum RadiusIndex {
    /// The frame does not tell.
    None,
    /// All particles alike.
    Common(f32),
    /// One f32 a particle; may be the section of an attribute.
    PerParticle(Section),
}

/// One attribute: values interleaved as in memory.
#[derive(Debug, Clone, PartialEq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub struct AttributeIndex {
    /// Name.
    pub name: String,
    /// Code of the type, see [`scalar_code`].
    pub scalar: u32,
    /// Numbers a particle.
    pub components: u32,
    /// The numbers.
    pub section: Section,
}

/// What a native frame holds and where.
#[derive(Debug, Clone, PartialEq, rkyv::Archive, rkyv::Serialize, rkyv::Deserialize)]
pub struct FrameIndex {
    /// Particles.
    pub count: u64,
    /// Particles in a position block, 16.
    pub block: u32,
    /// How positions are stored, [`ENCODING_F32`].
    pub encoding: u32,
    /// How particles are ordered; [`ORDER_FILE`], others are for tracing in place.
    pub order: u32,
    /// World position of the zero of the stored positions.
    pub origin: [f64; 3],
    /// Smallest stored position; infinity if there are no particles.
    pub min: [f32; 3],
    /// Largest stored position; minus infinity if there are no particles.
    pub max: [f32; 3],
    /// Largest distance of a stored position from the true one; 0 for f32.
    pub max_error: f64,
    /// Position blocks.
    pub positions: Section,
    /// Radii.
    pub radius: RadiusIndex,
    /// Attributes.
    pub attributes: Vec<AttributeIndex>,
    /// Simulation time.
    pub time: Option<f64>,
    /// Step number of the simulation.
    pub step: Option<i64>,
    /// Particles that were left out on conversion because they were not finite.
    pub dropped: u64,
}

/// The number that stands for a type in the index.
pub const fn scalar_code(kind: ScalarType) -> u32 {
    match kind {
        ScalarType::I8 => 1,
        ScalarType::U8 => 2,
        ScalarType::I16 => 3,
        ScalarType::U16 => 4,
        ScalarType::I32 => 5,
        ScalarType::U32 => 6,
        ScalarType::I64 => 7,
        ScalarType::U64 => 8,
        ScalarType::F32 => 9,
        ScalarType::F64 => 10,
    }
}

/// The type that a number of the index stands for.
pub const fn scalar_of(code: u32) -> Option<ScalarType> {
    Some(match code {
        1 => ScalarType::I8,
        2 => ScalarType::U8,
        3 => ScalarType::I16,
        4 => ScalarType::U16,
        5 => ScalarType::I32,
        6 => ScalarType::U32,
        7 => ScalarType::I64,
        8 => ScalarType::U64,
        9 => ScalarType::F32,
        10 => ScalarType::F64,
        _ => return None,
    })
}

/// Bytes of the position blocks of `count` particles.
pub fn positions_len(count: u64) -> Option<u64> {
    count
        .div_ceil(BLOCK as u64)
        .checked_mul(size_of::<PositionBlock>() as u64)
}

/// The header in front of `file_len` bytes that end in `index`.
pub fn header(file_len: u64, index_offset: u64, index: &[u8]) -> [u8; HEADER_LEN] {
    let mut header = [0; HEADER_LEN];
    header[0..8].copy_from_slice(MAGIC);
    header[8..12].copy_from_slice(&VERSION.to_le_bytes());
    header[12..16].copy_from_slice(&64u32.to_le_bytes());
    header[16..24].copy_from_slice(&file_len.to_le_bytes());
    header[24..32].copy_from_slice(&index_offset.to_le_bytes());
    header[32..40].copy_from_slice(&(index.len() as u64).to_le_bytes());
    header[40..48].copy_from_slice(&xxh3_64(index).to_le_bytes());
    let sum = xxh3_64(&header[..56]);
    header[56..64].copy_from_slice(&sum.to_le_bytes());
    header
}

/// Reads and checks header and index of the whole file `bytes`: all that opening does.
///
/// # Errors
/// [`ParseError::Malformed`] for anything damaged or cut off, [`ParseError::Unsupported`] for a
/// newer version or encoding.
pub fn parse(bytes: &[u8]) -> Result<FrameIndex, ParseError> {
    let index = index_range(bytes)?;
    let (offset, index) = (index.start, &bytes[index]);
    // rkyv wants its alignment, which a slice does not promise; the index is small.
    let mut aligned = AlignedVec::<16>::with_capacity(index.len());
    aligned.extend_from_slice(index);
    let damaged =
        |e: rancor::Error| ParseError::malformed(offset, format!("the index is damaged: {e}"));
    let archived = rkyv::access::<ArchivedFrameIndex, rancor::Error>(&aligned).map_err(damaged)?;
    let index = rkyv::deserialize::<FrameIndex, rancor::Error>(archived).map_err(damaged)?;
    check_index(&index, offset)?;
    Ok(index)
}

/// Checks the header and gives the place of the index.
fn index_range(bytes: &[u8]) -> Result<std::ops::Range<usize>, ParseError> {
    let short = || {
        let what = format!(
            "the header has {HEADER_LEN} bytes, the file {}; perhaps it is still being copied",
            bytes.len()
        );
        ParseError::malformed(bytes.len(), what)
    };
    let header: &[u8; HEADER_LEN] = bytes.first_chunk().ok_or_else(short)?;
    if !header.starts_with(MAGIC) {
        return Err(ParseError::malformed(
            0,
            "no native frame: the magic bytes are missing",
        ));
    }
    let word = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
    if word(56) != xxh3_64(&header[..56]) {
        return Err(ParseError::malformed(
            56,
            "the header is damaged: its checksum differs",
        ));
    }
    let version = u32::from_le_bytes(std::array::from_fn(|i| header[8 + i]));
    if version != VERSION {
        return Err(ParseError::unsupported(format!(
            "a native frame of version {version}, this program reads {VERSION}; convert again"
        )));
    }
    let (file_len, offset, len) = (word(16), word(24), word(32));
    if file_len != bytes.len() as u64 {
        return Err(ParseError::malformed(
            bytes
                .len()
                .min(usize::try_from(file_len).unwrap_or(usize::MAX)),
            format!(
                "the file should have {file_len} bytes, but has {}; copy or convert it again",
                bytes.len()
            ),
        ));
    }
    let index = usize::try_from(offset)
        .ok()
        .zip(
            offset
                .checked_add(len)
                .and_then(|end| usize::try_from(end).ok()),
        )
        .filter(|(start, end)| *start >= HEADER_LEN && *start <= *end && *end == bytes.len())
        .map(|(start, end)| start..end)
        .ok_or_else(|| ParseError::malformed(24, "the index lies outside the file"))?;
    if word(40) != xxh3_64(&bytes[index.clone()]) {
        return Err(ParseError::malformed(
            index.start,
            "the index is damaged: its checksum differs",
        ));
    }
    Ok(index)
}

/// Checks every section against the particle count and the bytes before the index at `end`.
fn check_index(index: &FrameIndex, end: usize) -> Result<(), ParseError> {
    let bad = |what: String| ParseError::malformed(end, what);
    if index.encoding != ENCODING_F32 || index.block as usize != BLOCK {
        return Err(ParseError::unsupported(format!(
            "positions in encoding {} with blocks of {}, which this version does not read",
            index.encoding, index.block
        )));
    }
    let check = |what: &str, section: &Section, expected: Option<u64>| {
        let fits = section
            .offset
            .checked_add(section.len)
            .is_some_and(|e| e <= end as u64);
        let placed = section.offset >= HEADER_LEN as u64 && section.offset.is_multiple_of(ALIGN);
        if expected == Some(section.len) && fits && placed {
            return Ok(());
        }
        Err(bad(format!(
            "{what} of {} particles cannot be the {} bytes at {}",
            index.count, section.len, section.offset
        )))
    };
    check(
        "the positions",
        &index.positions,
        positions_len(index.count),
    )?;
    if let RadiusIndex::PerParticle(section) = &index.radius {
        check("the radii", section, index.count.checked_mul(4))?;
    }
    for attribute in &index.attributes {
        let kind = scalar_of(attribute.scalar).ok_or_else(|| {
            ParseError::unsupported(format!(
                "attribute {} has type code {}, which this version does not know",
                attribute.name, attribute.scalar
            ))
        })?;
        let width = u64::from(attribute.components) * kind.size() as u64;
        if width == 0 {
            return Err(bad(format!(
                "attribute {} has no components",
                attribute.name
            )));
        }
        let what = format!("attribute {}", attribute.name);
        check(&what, &attribute.section, index.count.checked_mul(width))?;
    }
    Ok(())
}
