//! The compressed positions of an `.xtc` frame.
//!
//! Positions are integers, multiples of 1/precision. An atom is stored in full, as offset from the least position of
//! the frame, or by its small distance from the atom before. Behind each atom in full, a flag tells whether a new
//! number of small ones follows, and whether the range of small distances grows or shrinks from here on. The first
//! small atom of a run comes before the one in full: for water that is shorter, oxygen between hydrogens. The algorithm
//! is that of `xdr3dfcoord` by Frans van Hoesel (xdrf, 1995).

use glam::Vec3;

use super::bits::{BitReader, PackedTriple};
use crate::read::numbers::NumberReader;
use spherule_frame::ParseError;

/// Ranges of small distances: about the powers of the cube root of two, so that three of them need as many bits as
/// the place in the table says.
const RANGES: [u32; 73] = [
    0, 0, 0, 0, 0, 0, 0, 0, 0, 8, 10, 12, 16, 20, 25, 32, 40, 50, 64, 80, 101, 128, 161, 203, 256,
    322, 406, 512, 645, 812, 1024, 1290, 1625, 2048, 2580, 3250, 4096, 5060, 6501, 8192, 10321,
    13003, 16384, 20642, 26007, 32768, 41285, 52015, 65536, 82570, 104_031, 131_072, 165_140,
    208_063, 262_144, 330_280, 416_127, 524_287, 660_561, 832_255, 1_048_576, 1_321_122, 1_664_510,
    2_097_152, 2_642_245, 3_329_021, 4_194_304, 5_284_491, 6_658_042, 8_388_607, 10_568_983,
    13_316_085, 16_777_216,
];

/// First place in the table that is used.
const FIRST_RANGE: usize = 9;

/// Ranges up to this one are packed together.
const MAX_PACKED: u32 = 0xff_ffff;

/// Bits of the number of small atoms in a run, with the change of their range.
const RUN_BITS: u32 = 5;

/// What precedes the bits, and the bits.
struct Header<'a> {
    /// Grid cells a nm.
    precision: f32,
    least: [i32; 3],
    full: FullRange,
    /// First place in [`RANGES`].
    small: usize,
    bits: BitReader<'a>,
}

/// Where the positions end that begin at `stream`, with what fills them up to a multiple of four bytes.
///
/// # Errors
/// [`ParseError::Malformed`] if the file ends before their length.
pub(super) fn end(mut stream: NumberReader<'_>, is_large: bool) -> Result<usize, ParseError> {
    stream.take(32)?;
    let len = packed_len(&mut stream, is_large)?;
    let padded = len.checked_next_multiple_of(4);
    Ok(padded.map_or(usize::MAX, |len| stream.at().saturating_add(len)))
}

fn packed_len(stream: &mut NumberReader<'_>, is_large: bool) -> Result<usize, ParseError> {
    if is_large {
        let len = stream.u64()?;
        return Ok(usize::try_from(len).unwrap_or(usize::MAX));
    }
    stream.count("length of the compressed positions")
}

/// Reads the positions of `count` atoms, which the caller has compared with the budget.
///
/// # Errors
/// [`ParseError::Malformed`] if they are damaged.
pub(super) fn decompress(
    stream: &mut NumberReader<'_>,
    count: usize,
    is_large: bool,
) -> Result<Vec<Vec3>, ParseError> {
    let start = stream.at();
    let mut header = Header::read(stream, is_large)?;
    let bits = &mut header.bits;
    let unit = 1.0 / header.precision;
    #[expect(clippy::cast_precision_loss, reason = "rounded as in GROMACS")]
    let position = |grid: [i32; 3]| Vec3::from_array(grid.map(|n| n as f32 * unit));
    let mut range = SmallRange::at(header.small, start)?;
    // Small atoms of a run, until another number is stored.
    let mut run = 0;
    let mut positions = Vec::with_capacity(count);
    while positions.len() < count {
        // Read an atom in full
        let offset = header.full.read(bits)?;
        let full = add(header.least, offset.map(u32::cast_signed));
        // Read the number of small atoms after it, and how their range changes behind them
        let mut change = 1;
        if bits.number(1)? == 1 {
            let stored = bits.number(RUN_BITS)? as usize;
            (run, change) = (stored / 3, stored % 3);
        }
        if run >= count - positions.len() {
            let what = format!("a run of {run} atoms reaches beyond the {count} of the frame");
            return Err(ParseError::malformed(start, what));
        }
        if run == 0 {
            positions.push(position(full));
        }
        // Read the small ones
        let mut before = full;
        for index in 0..run {
            before = add(before, range.read(bits)?);
            positions.push(position(before));
            if index == 0 {
                positions.push(position(full));
            }
        }
        if change != 1 {
            range = SmallRange::at((range.index + change).wrapping_sub(1), start)?;
        }
    }
    Ok(positions)
}

impl<'a> Header<'a> {
    fn read(stream: &mut NumberReader<'a>, is_large: bool) -> Result<Self, ParseError> {
        let at = stream.at();
        let precision = stream.f32()?;
        if !(precision > 0.0 && precision.is_finite()) {
            let what = format!("the precision is {precision}: the file is damaged");
            return Err(ParseError::malformed(at, what));
        }
        let mut corners = [[0; 3]; 2];
        for number in corners.as_flattened_mut() {
            *number = stream.i32()?;
        }
        let [least, largest] = corners;
        let mut ranges = [0; 3];
        for ((range, least), largest) in ranges.iter_mut().zip(least).zip(largest) {
            let size = i64::from(largest) - i64::from(least) + 1;
            *range = u32::try_from(size).ok().filter(|size| *size > 0).ok_or_else(|| {
                let what = format!("positions from {least} to {largest}: the file is damaged");
                ParseError::malformed(at + 4, what)
            })?;
        }
        let small = stream.count("range of small distances")?;
        let len = packed_len(stream, is_large)?;
        let start = stream.at();
        Ok(Self {
            precision,
            least,
            full: FullRange::new(ranges),
            small,
            bits: BitReader::new(stream.take(len)?, start),
        })
    }
}

/// How atoms in full are stored.
enum FullRange {
    /// All coordinates as one number.
    Packed(PackedTriple),
    /// Each coordinate in so many bits.
    Apart([u32; 3]),
}

impl FullRange {
    fn new(ranges: [u32; 3]) -> Self {
        if ranges.iter().all(|range| *range <= MAX_PACKED) {
            Self::Packed(PackedTriple::new(ranges))
        } else {
            Self::Apart(ranges.map(|range| u32::BITS - range.leading_zeros()))
        }
    }

    #[inline]
    fn read(&self, bits: &mut BitReader<'_>) -> Result<[u32; 3], ParseError> {
        match self {
            Self::Packed(packed) => bits.triple(*packed),
            Self::Apart([x, y, z]) => Ok([bits.number(*x)?, bits.number(*y)?, bits.number(*z)?]),
        }
    }
}

/// The range of small distances.
#[derive(Debug, Clone, Copy)]
struct SmallRange {
    /// Place in [`RANGES`].
    index: usize,
    /// What is subtracted, so that there are negative ones.
    half: i32,
    packed: PackedTriple,
}

impl SmallRange {
    /// The range at a place in the table.
    fn at(index: usize, start: usize) -> Result<Self, ParseError> {
        let range = RANGES.get(index).filter(|_| index >= FIRST_RANGE);
        let Some(range) = range else {
            let what = format!(
                "the range {index} of small distances is not in {FIRST_RANGE}..{}: the file is damaged",
                RANGES.len()
            );
            return Err(ParseError::malformed(start, what));
        };
        Ok(Self {
            index,
            half: (range / 2).cast_signed(),
            packed: PackedTriple::cube(*range, u32::try_from(index).unwrap_or_default()),
        })
    }

    #[inline]
    fn read(&self, bits: &mut BitReader<'_>) -> Result<[i32; 3], ParseError> {
        let offset = bits.triple(self.packed)?;
        Ok(offset.map(|n| n.cast_signed().wrapping_sub(self.half)))
    }
}

/// Damaged numbers may overflow.
fn add(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|axis| a[axis].wrapping_add(b[axis]))
}
