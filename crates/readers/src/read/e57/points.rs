//! The points of a scan: packets, each with the next bits of all fields.

use super::document::{Field, FieldKind, Scan};
use super::pages::Pages;
use crate::read::vtk_xml::short;
use spherule_frame::ParseError;

/// Bytes of the header of the section with the points, and where it says where the packets begin.
const SECTION: usize = 32;
const PACKETS: usize = 16;
/// Maximum number of fields that have one value and no bits: the file does not limit how many numbers they become.
const MAX_CONSTANT: usize = 32;
/// Kinds of packets.
const INDEX: u8 = 0;
const DATA: u8 = 1;
const IGNORED: u8 = 2;

/// The values of a field.
struct Stream<'a> {
    field: &'a Field,
    count: usize,
    /// Bytes that are not decoded yet, and bits of the first one that are.
    pending: Vec<u8>,
    done: usize,
    values: Vec<f64>,
}

impl Stream<'_> {
    const fn is_complete(&self) -> bool {
        self.values.len() == self.count
    }

    /// Decodes the next `bytes`. Whole numbers beyond 2^53 lose their last digits.
    #[expect(clippy::cast_possible_truncation, reason = "values have up to 64 bits")]
    fn append(&mut self, bytes: &[u8]) -> Result<(), String> {
        if self.is_complete() {
            return Ok(());
        }
        let bits = self.field.kind.bits() as usize;
        self.pending.extend(bytes);
        while !self.is_complete() && self.done + bits <= 8 * self.pending.len() {
            let bytes = &self.pending[self.done / 8..(self.done + bits).div_ceil(8)];
            let mut word = [0; 16];
            word[..bytes.len()].copy_from_slice(bytes);
            let shifted = u128::from_le_bytes(word) >> (self.done % 8);
            self.values.push(value(self.field.kind, (shifted & ((1 << bits) - 1)) as u64)?);
            self.done += bits;
        }
        self.pending.drain(..self.done / 8);
        self.done %= 8;
        Ok(())
    }
}

/// The value with these bits.
#[expect(clippy::cast_possible_truncation, reason = "numbers in single precision have 32 bits")]
fn value(kind: FieldKind, bits: u64) -> Result<f64, String> {
    let whole = |min: i64, max: i64| match min.wrapping_add_unsigned(bits) {
        whole if bits <= max.wrapping_sub(min).cast_unsigned() => Ok(whole as f64),
        _ => Err(format!("{bits} above its minimum, but its range is {min} to {max}")),
    };
    Ok(match kind {
        FieldKind::Single => f32::from_bits(bits as u32).into(),
        FieldKind::Double => f64::from_bits(bits),
        FieldKind::Whole { min, max } => whole(min, max)?,
        FieldKind::Scaled { min, max, scale, offset } => whole(min, max)? * scale + offset,
    })
}

/// Checks that a file of `len` bytes has as many points as its scans.
pub(super) fn check_counts(scans: &[Scan], len: usize) -> Result<(), ParseError> {
    let mut left = len;
    for scan in scans.iter().filter(|scan| scan.count > 0) {
        let bits: usize = scan.fields.iter().map(|field| field.kind.bits() as usize).sum();
        let constant = scan.fields.iter().filter(|field| field.kind.bits() == 0).count();
        if bits == 0 || constant > MAX_CONSTANT {
            let what = format!(
                "points of {bits} bits and {constant} fields of one value; up to {MAX_CONSTANT} are read"
            );
            return Err(ParseError::malformed(scan.place.min(len), what));
        }
        let need = scan.count.saturating_mul(bits) / 8;
        if need > left {
            let what = format!("{} points need {need} bytes, file has {left} left", scan.count);
            return Err(ParseError::malformed(scan.place.min(len), what));
        }
        left -= need;
    }
    Ok(())
}

/// The values of each field of `scan`.
pub(super) fn values(pages: &Pages<'_>, scan: &Scan) -> Result<Vec<Vec<f64>>, ParseError> {
    if scan.count == 0 {
        return Ok(vec![Vec::new(); scan.fields.len()]);
    }
    let start = pages.content_at(scan.place);
    // Find the packets
    let mut found = Vec::new();
    pages.read(start, SECTION, &mut found)?;
    if found[0] != DATA {
        let what = format!("no points here, but a section of kind {}", found[0]);
        return Err(ParseError::malformed(pages.place_of(start), what));
    }
    let place = u64::from_le_bytes(*found[PACKETS..].first_chunk().expect("8 bytes"));
    let mut at = pages.content_at(usize::try_from(place).unwrap_or(usize::MAX));
    // Decode them
    let mut streams: Vec<_> = scan.fields.iter().map(|field| stream(field, scan.count)).collect();
    while !streams.iter().all(Stream::is_complete) {
        pages.read(at, 4, &mut found)?;
        let len = usize::from(u16::from_le_bytes([found[2], found[3]])) + 1;
        let wrong = |what: String| ParseError::malformed(pages.place_of(at), what);
        match found[0] {
            DATA => {
                pages.read(at, len, &mut found)?;
                append(&mut streams, &found).map_err(wrong)?;
            }
            INDEX | IGNORED => {}
            kind => return Err(wrong(format!("a packet of kind {kind}"))),
        }
        at += len.next_multiple_of(4);
    }
    Ok(streams.into_iter().map(|stream| stream.values).collect())
}

/// The stream of `field` before the first packet. Equal values have no bits.
fn stream(field: &Field, count: usize) -> Stream<'_> {
    let values = match field.kind {
        FieldKind::Whole { min, max } | FieldKind::Scaled { min, max, .. } if min == max => {
            vec![value(field.kind, 0).unwrap_or_default(); count]
        }
        _ => Vec::with_capacity(count),
    };
    Stream { field, count, pending: Vec::new(), done: 0, values }
}

/// Decodes a packet of points.
fn append(streams: &mut [Stream<'_>], packet: &[u8]) -> Result<(), String> {
    let word = |at: usize| match packet.get(at..at + 2) {
        Some(bytes) => Ok(usize::from(u16::from_le_bytes([bytes[0], bytes[1]]))),
        None => Err("a packet ends early".to_owned()),
    };
    let count = word(4)?;
    if count != streams.len() {
        return Err(format!("a packet of {count} fields, but points have {}", streams.len()));
    }
    let mut at = 6 + 2 * count;
    for (number, stream) in streams.iter_mut().enumerate() {
        let len = word(6 + 2 * number)?;
        let bytes = packet.get(at..at + len).ok_or("a packet ends early")?;
        let name = &stream.field.name;
        let named = |what: String| format!("a value of {}: {what}", short(name));
        stream.append(bytes).map_err(named)?;
        at += len;
    }
    Ok(())
}
