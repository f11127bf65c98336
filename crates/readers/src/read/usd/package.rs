//! USD packages (`.usdz`): zip archives whose first file is a USD file that is not compressed.

use crate::read::CUT_SHORT;
use spherule_frame::ParseError;

/// Bytes of the header of a file in an archive, without its name.
const HEADER_LEN: usize = 30;

/// Where the first file of the archive `bytes` is.
///
/// # Errors
/// [`ParseError::Malformed`] if it is not inside the archive; [`ParseError::Unsupported`] if it is compressed.
pub(super) fn first_file(bytes: &[u8]) -> Result<std::ops::Range<usize>, ParseError> {
    let cut =
        || ParseError::malformed(bytes.len(), format!("no USD file in the package: {CUT_SHORT}"));
    let header = bytes.get(..HEADER_LEN).ok_or_else(cut)?;
    let u16_at = |at: usize| usize::from(header[at]) | usize::from(header[at + 1]) << 8;
    let u32_at = |at: usize| u16_at(at) | u16_at(at + 2) << 16;
    let (flags, method, len) = (u16_at(6), u16_at(8), u32_at(18));
    // Bit 0 is encryption; bit 3 says that the length comes later
    if method != 0 || flags & 0b1001 != 0 {
        let what = "a USD package whose first file is compressed, which the format does not allow; unpack it";
        return Err(ParseError::unsupported(what));
    }
    let start = HEADER_LEN + u16_at(26) + u16_at(28);
    let end = start.checked_add(len).filter(|end| *end <= bytes.len());
    end.map(|end| start..end).ok_or_else(cut)
}
