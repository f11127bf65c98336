//! The bytes of one array: length or block headers, base64 and its padding, compressed blocks.
//!
//! Without a compressor an array is one integer (its length in bytes) and the data; in base64 both
//! are one run of characters from VTK and two from pyvisfile. With one it is the number of blocks,
//! the block size, the size of the last block, the compressed size of each, and the blocks; in
//! base64 the header is a run of its own.

use std::borrow::Cow;

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use rayon::prelude::*;

use super::compressor::{Compressor, DecompressError};
use spherule_frame::{Endian, MemoryBudget, ParseError};

/// Padding may be missing at the end of a run; bits beyond the last byte do not matter.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// How arrays are stored; attributes of the root element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ArrayEncoding {
    pub(super) endian: Endian,
    pub(super) header: HeaderType,
    pub(super) compressor: Option<Compressor>,
    /// What decoders may take beside their output.
    pub(super) decoders: MemoryBudget,
}

/// Why an array cannot be read.
#[derive(Debug)]
pub(super) enum ArrayFault {
    /// What is wrong with its bytes.
    Damaged(String),
    /// It needs too much memory.
    TooLarge(ParseError),
}

impl ArrayFault {
    fn too_short(need: usize, left: usize) -> Self {
        Self::Damaged(format!("{need} bytes needed, {left} are left"))
    }
}

impl From<DecompressError> for ArrayFault {
    fn from(error: DecompressError) -> Self {
        Self::Damaged(error.to_string())
    }
}

impl From<String> for ArrayFault {
    fn from(what: String) -> Self {
        Self::Damaged(what)
    }
}

impl From<&str> for ArrayFault {
    fn from(what: &str) -> Self {
        Self::Damaged(what.to_owned())
    }
}

/// The integers in headers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HeaderType {
    U32,
    U64,
}

impl HeaderType {
    const fn size(self) -> usize {
        match self {
            Self::U32 => 4,
            Self::U64 => 8,
        }
    }
}

/// Bytes or characters from the header of an array to its end, or further.
#[derive(Debug, Clone, Copy)]
pub(super) enum EncodedBytes<'a> {
    Raw(&'a [u8]),
    Base64(&'a [u8]),
}

impl<'a> EncodedBytes<'a> {
    /// Bytes or characters that are left.
    const fn len(self) -> usize {
        match self {
            Self::Raw(bytes) | Self::Base64(bytes) => bytes.len(),
        }
    }

    /// The next `count` bytes, encoded as one run, and the source after them.
    fn run(self, count: usize) -> Result<(Cow<'a, [u8]>, Self), ArrayFault> {
        match self {
            Self::Raw(bytes) => match bytes.split_at_checked(count) {
                Some((run, rest)) => Ok((Cow::Borrowed(run), Self::Raw(rest))),
                None => Err(ArrayFault::too_short(count, bytes.len())),
            },
            Self::Base64(chars) => {
                let (mut bytes, rest) = decode_run(chars, count)?;
                bytes.truncate(count);
                Ok((Cow::Owned(bytes), Self::Base64(rest)))
            }
        }
    }

    /// The length header of `header` bytes, and where its data are.
    fn length_and_data(self, header: usize) -> Result<(Cow<'a, [u8]>, DataRun<'a>), ArrayFault> {
        match self {
            Self::Raw(_) => {
                let (length, behind) = self.run(header)?;
                Ok((length, DataRun::New(behind)))
            }
            Self::Base64(chars) => {
                let (length, rest) = decode_run(chars, header)?;
                // Padding that ends exactly with the header ends the run; one byte of data in the
                // same run can give padding too, but of another length.
                let data = if length.len() == header {
                    DataRun::New(Self::Base64(rest))
                } else {
                    DataRun::Same(self)
                };
                Ok((Cow::Owned(length), data))
            }
        }
    }
}

/// Decodes the characters that hold `count` bytes, up to two bytes more; and what follows them.
fn decode_run(chars: &[u8], count: usize) -> Result<(Vec<u8>, &[u8]), ArrayFault> {
    let needed =
        count.div_ceil(3).checked_mul(4).ok_or_else(|| format!("{count} bytes are too many"))?;
    let (run, rest) = take_chars(chars, needed);
    let bytes = BASE64.decode(run).map_err(|error| format!("bad base64: {error}"))?;
    if bytes.len() < count {
        return Err(ArrayFault::too_short(count, bytes.len()));
    }
    Ok((bytes, rest))
}

/// Where data without a compressor are.
enum DataRun<'a> {
    /// In a run of their own (or raw).
    New(EncodedBytes<'a>),
    /// Behind the header in the run that begins here.
    Same(EncodedBytes<'a>),
}

/// Up to `count` characters that are not white space (fewer at the end), and the rest.
fn take_chars(chars: &[u8], count: usize) -> (Cow<'_, [u8]>, &[u8]) {
    let chars = chars.trim_ascii_start();
    let near = chars.get(..count).unwrap_or(chars.trim_ascii_end());
    if !near.iter().any(u8::is_ascii_whitespace) {
        return (Cow::Borrowed(near), chars.get(near.len()..).unwrap_or_default());
    }
    let mut taken = Vec::with_capacity(near.len());
    let mut used = 0;
    for byte in chars {
        if taken.len() == count {
            break;
        }
        used += 1;
        if !byte.is_ascii_whitespace() {
            taken.push(*byte);
        }
    }
    (Cow::Owned(taken), chars.get(used..).unwrap_or_default())
}

/// The `need` bytes of an array, borrowed if the file holds them as they are, and how many bytes of `source`
/// they were read from.
///
/// # Errors
/// What is wrong: the header states another length, the source is too short, or a block is damaged.
/// Nothing is allocated that the bytes at hand could not fill, or that decoders may not take.
pub(super) fn payload<'a>(
    source: EncodedBytes<'a>,
    encoding: ArrayEncoding,
    need: usize,
) -> Result<(Cow<'a, [u8]>, usize), ArrayFault> {
    let (bytes, rest) = match encoding.compressor {
        None => plain(source, encoding, need)?,
        Some(compressor) => compressed(source, encoding, compressor, need)?,
    };
    Ok((bytes, source.len() - rest.len()))
}

/// The bytes of an array, and what follows them.
type Payload<'a> = (Cow<'a, [u8]>, EncodedBytes<'a>);

fn plain<'a>(
    source: EncodedBytes<'a>,
    encoding: ArrayEncoding,
    need: usize,
) -> Result<Payload<'a>, ArrayFault> {
    let header = encoding.header.size();
    let (length, data) = source.length_and_data(header)?;
    let stated = integers(&length, encoding).next().unwrap_or(0);
    if stated != need as u64 {
        return Err(format!("{need} bytes needed, but the header has {stated}").into());
    }
    match data {
        DataRun::New(source) => source.run(need),
        DataRun::Same(source) => {
            let whole =
                need.checked_add(header).ok_or_else(|| format!("{need} bytes are too many"))?;
            let (bytes, rest) = source.run(whole)?;
            let mut bytes = bytes.into_owned();
            bytes.drain(..header);
            Ok((Cow::Owned(bytes), rest))
        }
    }
}

fn compressed<'a>(
    source: EncodedBytes<'a>,
    encoding: ArrayEncoding,
    compressor: Compressor,
    need: usize,
) -> Result<Payload<'a>, ArrayFault> {
    let size = encoding.header.size();
    let (first, rest) = source.run(size)?;
    let blocks = integers(&first, encoding).next().unwrap_or(0);
    if blocks == 0 {
        // Some writers leave out the other two integers then.
        return match need {
            0 => Ok((Cow::Borrowed(&[]), rest)),
            _ => Err(format!("{need} bytes needed, but there are no blocks").into()),
        };
    }
    let header = usize::try_from(blocks)
        .ok()
        .and_then(|n| n.checked_add(3)?.checked_mul(size))
        .ok_or_else(|| format!("{blocks} blocks are too many"))?;
    let (header, data) = source.run(header)?;
    inflate(&header, data, encoding, compressor, need)
}

/// Decompresses all blocks, in parallel, once their sizes have been found to add up.
fn inflate<'a>(
    header: &[u8],
    data: EncodedBytes<'a>,
    encoding: ArrayEncoding,
    compressor: Compressor,
    need: usize,
) -> Result<Payload<'a>, ArrayFault> {
    let mut header = integers(header, encoding);
    let (_, block_size, last) = (header.next(), header.next(), header.next());
    let block_size = block_size.unwrap_or(0);
    let compressed_sizes: Vec<usize> =
        header.map(|n| usize::try_from(n).unwrap_or(usize::MAX)).collect();
    // VTK writes 0 for a full last block, meshio the full size.
    let last = last.filter(|n| *n != 0).unwrap_or(block_size);
    let full_blocks = compressed_sizes.len().saturating_sub(1) as u64;
    let total = full_blocks.checked_mul(block_size).and_then(|full| full.checked_add(last));
    if total != Some(need as u64) || last > block_size || block_size == 0 {
        return Err(format!(
            "{need} bytes needed, but the header has {full_blocks} blocks of {block_size} and one of \
             {last}"
        )
        .into());
    }
    let block_size = usize::try_from(block_size).unwrap_or(usize::MAX).min(need);
    let compressed_total = compressed_sizes
        .iter()
        .try_fold(0_usize, |sum, n| sum.checked_add(*n))
        .ok_or("the block sizes overflow")?;
    let (data, behind_data) = data.run(compressed_total)?;
    let mut blocks = Vec::with_capacity(compressed_sizes.len());
    let mut rest: &[u8] = &data;
    let mut left = need;
    for size in compressed_sizes {
        let (block, behind) = rest.split_at_checked(size).ok_or("a block is cut short")?;
        let output = block_size.min(left);
        if output > compressor.most_output(size) {
            return Err(format!("{size} compressed bytes cannot hold {output}").into());
        }
        blocks.push(block);
        rest = behind;
        left -= output;
    }
    let each = decoder_bytes(&blocks, compressor, encoding.decoders)?;
    // As many at a time as may take that much.
    let at_once = encoding
        .decoders
        .bytes()
        .checked_div(each)
        .map_or(usize::MAX, |n| usize::try_from(n).unwrap_or(usize::MAX))
        .clamp(1, blocks.len());
    let mut output = vec![0; need];
    let groups = output.chunks_mut(block_size.saturating_mul(at_once));
    for (chunks, blocks) in groups.zip(blocks.chunks(at_once)) {
        let memory = encoding.decoders.bytes();
        chunks
            .par_chunks_mut(block_size)
            .zip(blocks)
            .try_for_each(|(chunk, block)| compressor.decompress(block, chunk, memory))?;
    }
    Ok((Cow::Owned(output), behind_data))
}

/// The most that decompressing one of `blocks` takes beside its output.
///
/// # Errors
/// [`ArrayFault::TooLarge`] if that is more than `budget`.
fn decoder_bytes(
    blocks: &[&[u8]],
    compressor: Compressor,
    budget: MemoryBudget,
) -> Result<u64, ArrayFault> {
    let each = blocks.iter().map(|block| compressor.memory(block)).max().unwrap_or(0);
    let what = format!("a compressed block needs {} MiB", each.div_ceil(1 << 20));
    let most = Compressor::MAX_MEMORY;
    if each > most {
        return Err(ArrayFault::Damaged(format!(
            "{what} for its dictionary, presets of xz no more than {} MiB; write it with a preset",
            most >> 20
        )));
    }
    let what = format!("{what} for its dictionary, which is");
    budget.check(each, &what).map_err(ArrayFault::TooLarge)?;
    Ok(each)
}

/// The integers of a header.
fn integers(bytes: &[u8], encoding: ArrayEncoding) -> impl Iterator<Item = u64> + '_ {
    bytes.chunks_exact(encoding.header.size()).map(move |chunk| {
        let fold = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        match encoding.endian {
            Endian::Big => chunk.iter().fold(0, fold),
            Endian::Little => chunk.iter().rev().fold(0, fold),
        }
    })
}
