//! One array in an NPZ: its header, and its bytes when they are needed.
//!
//! Sizes come from the central directory (numpy leaves placeholders in the local headers), and no
//! member may inflate beyond the size stated there.

use std::borrow::Cow;
use std::io::{Cursor, Read};

use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::header::{self, NpyHeader};
use spherule_frame::{MemoryBudget, ParseError};

/// Deflate cannot do better: 258 bytes for two bits.
const MAX_DEFLATE_RATIO: u64 = 1032;
/// Reserved at once for an inflated member; more only as data really comes.
const MAX_RESERVE: usize = 1 << 26;

/// One array of the archive, known by its header.
pub(super) struct ArrayMember {
    /// Place in the central directory.
    index: usize,
    /// Without `.npy`.
    pub(super) name: String,
    pub(super) header: NpyHeader,
}

/// Reads the header of member `index`; `None` if it is not an array.
pub(super) fn open(
    zip: &mut ZipArchive<Cursor<&[u8]>>,
    index: usize,
) -> Result<Option<ArrayMember>, ParseError> {
    let mut file = zip.by_index(index).map_err(|e| zip_error(&e, "npz member"))?;
    let full_name = String::from_utf8_lossy(file.name_raw()).into_owned();
    let Some(name) = full_name.strip_suffix(".npy") else {
        return Ok(None);
    };
    let method = file.compression();
    if !matches!(method, CompressionMethod::Stored | CompressionMethod::Deflated) {
        return Err(ParseError::unsupported(format!(
            "npz member {name}: compressed by {method}; save with numpy.savez_compressed"
        )));
    }
    let size = usize::try_from(file.size()).unwrap_or(usize::MAX);
    let start = place(file.header_start());
    if file.size() > file.compressed_size().saturating_add(1).saturating_mul(MAX_DEFLATE_RATIO) {
        return Err(ParseError::malformed(
            start,
            format!(
                "member {full_name} claims {size} bytes from {} compressed ones",
                file.compressed_size()
            ),
        ));
    }
    let mut text = Vec::new();
    let mut read_to = |text: &mut Vec<u8>, len: usize| {
        let more = len.saturating_sub(text.len());
        let read = file.by_ref().take(more as u64).read_to_end(text);
        read.map_err(|e| ParseError::malformed(start, format!("member {full_name}: {e}")))
    };
    read_to(&mut text, header::PREAMBLE)?;
    let len = header::length(&text).map_err(|e| in_member(e, name))?;
    read_to(&mut text, len)?;
    let header = NpyHeader::parse(&text).map_err(|e| in_member(e, name))?;
    header.check_items(size).map_err(|e| in_member(e, name))?;
    Ok(Some(ArrayMember { index, name: name.to_owned(), header }))
}

/// All bytes of a member: a slice of the archive if it is stored, else inflated, if `budget` allows that and
/// as much again for its numbers.
pub(super) fn contents<'a>(
    bytes: &'a [u8],
    zip: &mut ZipArchive<Cursor<&'a [u8]>>,
    member: &ArrayMember,
    budget: MemoryBudget,
) -> Result<Cow<'a, [u8]>, ParseError> {
    let mut file = zip.by_index(member.index).map_err(|e| zip_error(&e, &member.name))?;
    let start = place(file.data_start().unwrap_or(0));
    let damaged =
        |what: String| ParseError::malformed(start, format!("member {}: {what}", member.name));
    let size = usize::try_from(file.size()).unwrap_or(usize::MAX);
    if file.compression() == CompressionMethod::Stored && !file.encrypted() {
        let end = start.checked_add(size);
        let stored = end
            .and_then(|end| bytes.get(start..end))
            .ok_or_else(|| damaged(format!("{size} bytes are missing")))?;
        let mut sum = flate2::Crc::new();
        sum.update(stored);
        if sum.sum() != file.crc32() {
            return Err(damaged("checksum differs".to_owned()));
        }
        return Ok(Cow::Borrowed(stored));
    }
    let too_large = |e| in_member(e, &member.name);
    let need = file.size().saturating_mul(2);
    budget.check(need, "decompressed it is").map_err(too_large)?;
    let mut inflated = Vec::with_capacity(size.min(MAX_RESERVE));
    // One byte more than stated shows that the member continues.
    let bound = file.size().saturating_add(1);
    let read = file.by_ref().take(bound).read_to_end(&mut inflated);
    read.map_err(|e| damaged(e.to_string()))?;
    if inflated.len() != size {
        return Err(damaged(format!("{size} bytes expected, {} or more found", inflated.len())));
    }
    Ok(Cow::Owned(inflated))
}

fn place(offset: u64) -> usize {
    usize::try_from(offset).unwrap_or(usize::MAX)
}

/// Names the member that an error is about; its offsets count from the start of the member.
pub(super) fn in_member(error: ParseError, name: &str) -> ParseError {
    let begin = match error {
        ParseError::Malformed { .. } => "in member",
        ParseError::Unsupported { .. } | ParseError::TooLarge { .. } => "npz member",
    };
    error.map_message(|what| format!("{begin} {name}: {what}"))
}

pub(super) fn zip_error(error: &ZipError, what: &str) -> ParseError {
    match error {
        ZipError::UnsupportedArchive(_)
        | ZipError::CompressionMethodNotSupported(_)
        | ZipError::InvalidPassword => ParseError::unsupported(format!(
            "{what}: {error}; save with numpy.savez or numpy.savez_compressed"
        )),
        ZipError::InvalidArchive(_) => ParseError::malformed(
            0,
            format!(
                "{what}: {error}: the file is damaged or cut short, perhaps still being written"
            ),
        ),
        _ => ParseError::malformed(0, format!("{what}: {error}")),
    }
}
