//! Memory that decoding an xz stream takes.

/// Bytes that an LZMA decoder takes beside its dictionary: probabilities and a buffer.
const DECODER: u64 = 128 << 10;

/// Bytes that decoding the xz stream that begins with `stream` takes beside its output: its first block says it. None
/// if its header is damaged, which the decoder finds out.
pub fn decoder_len(stream: &[u8]) -> Option<u64> {
    dictionary_len(stream).map(|dictionary| dictionary + DECODER)
}

/// The dictionary, in bytes, that the first block of the xz stream `stream` asks for; none if its header is damaged,
/// which the decoder finds out. ("The .xz File Format", sections 2.1.1, 3.1 and 5.3.1.)
fn dictionary_len(stream: &[u8]) -> Option<u64> {
    const STREAM_HEADER: usize = 12;
    const LZMA2: u64 = 0x21;
    let (size, mut header) = stream.get(STREAM_HEADER..)?.split_first()?;
    header = header.get(..4 * usize::from(*size))?;
    let flags = take(&mut header, 1)?[0];
    // Compressed and uncompressed size, where they are stated.
    for stated in [0x40, 0x80] {
        if flags & stated != 0 {
            integer(&mut header)?;
        }
    }
    for _ in 0..=flags & 3 {
        let filter = integer(&mut header)?;
        let len = usize::try_from(integer(&mut header)?).ok()?;
        let properties = take(&mut header, len)?;
        if filter == LZMA2 {
            // Two and three times powers of two, from 4 KiB to 4 GiB.
            let bits = u64::from(*properties.first()? & 0x3f).min(40);
            return Some((2 + bits % 2) << (bits / 2 + 11));
        }
    }
    None
}

/// Seven bits a byte, the lowest first.
fn integer(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..63).step_by(7) {
        let byte = take(bytes, 1)?[0];
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(taken)
}
