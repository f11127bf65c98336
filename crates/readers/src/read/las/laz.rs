//! LAZ: points of LAS that are compressed by LASzip, through the crate `laz`.
//!
//! A record of variable length names the items of a point and how they are compressed. Formats 0 to 5 are one stream, which
//! begins anew after each chunk. A chunk of formats 6 to 10 has its number of points and the lengths of its layers, so that
//! it is decoded by itself, and the table of chunks is not needed.
//!
//! The crate allocates what a file says, and panics on some damage. So the items have to be those of the format of points,
//! lengths are compared with the bytes that are there before it sees them, and panics become errors. It decodes times by
//! recursion as deep as a file wants, so that damage overflows the stack, which is not an error but an end of the process.
//! Therefore times are decoded by `times.rs`, and those of formats 6 to 10, which are a layer, by `layered_times.rs`.

use std::io::Cursor;

use laz::record::{RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{
    DecompressionSelection, LasZipDecompressor, LazItem, LazItemRecordBuilder, LazItemType, LazVlr,
};

use super::layered_times::Chunk;
use super::times::{Times1, Times2};
use super::{LasHeader, offsets};
use crate::read::CUT_SHORT;
use spherule_files::{Panic, catch_panic};
use spherule_frame::{MemoryBudget, ParseError};

/// Most points for a byte: of points that are all equal, LASzip needs nearly none.
const MAX_POINTS_EACH: usize = 1024;
/// Most extra bytes of a point: the decoder holds some kilobytes for each. Files have a few dozen.
const MAX_EXTRA: u16 = 1024;
/// Least number of points of a chunk that is not the only one: each takes half a millisecond to begin. LASzip writes
/// 50,000.
const LEAST_CHUNK: usize = 64;
/// Bytes of the place of the table of chunks, and of a table without chunks.
const TABLE: usize = 8;
/// Where the record has the number of points of a chunk.
const CHUNK_SIZE: usize = 12;

/// How the stream of points is divided: not at all, or into chunks.
const ONE_CHUNK: u16 = 1;
const CHUNKS: u16 = 2;
const LAYERED_CHUNKS: u16 = 3;

/// The file `bytes` with its points as they are in an uncompressed file.
pub(super) fn unpack(
    bytes: &[u8],
    header: &LasHeader,
    budget: MemoryBudget,
) -> Result<Vec<u8>, ParseError> {
    let data = bytes.get(header.start..).unwrap_or_default();
    if header.count > data.len().saturating_mul(MAX_POINTS_EACH) {
        let what =
            format!("{} compressed points in {} bytes: {CUT_SHORT}", header.count, data.len());
        return Err(ParseError::malformed(header.start.min(bytes.len()), what));
    }
    let points_len = header.count.saturating_mul(header.record);
    // The result, and a copy of compressed bytes
    let need = header.start.saturating_add(points_len).saturating_add(data.len());
    budget.check(need as u64, "its points, decompressed, are")?;
    let settings = Settings::read(bytes, header)?;
    let mut unpacked = bytes.get(..header.start).unwrap_or_default().to_vec();
    unpacked.resize(header.start + points_len, 0);
    let points = unpacked.get_mut(header.start..).unwrap_or_default();
    if settings.layers > 0 {
        settings.unpack_layers(data, points, header)?;
    } else {
        settings.unpack_stream(data, points, header)?;
    }
    Ok(unpacked)
}

/// Decodes the points of formats up to 5.
type StreamDecoder<'a> = SequentialPointRecordDecompressor<'a, Cursor<&'a [u8]>>;

/// How the points are compressed.
struct Settings {
    vlr: LazVlr,
    is_one_chunk: bool,
    /// Layers of a chunk; none for formats up to 5.
    layers: usize,
}

impl Settings {
    fn read(bytes: &[u8], header: &LasHeader) -> Result<Self, ParseError> {
        let stored = header.record_of(bytes, LazVlr::USER_ID.as_bytes(), LazVlr::RECORD_ID);
        let Some((at, stored)) = stored else {
            let what = format!(
                "the points are compressed, but there is no record `{}`: {CUT_SHORT}",
                LazVlr::USER_ID
            );
            return Err(ParseError::malformed(header.len.min(bytes.len()), what));
        };
        let bad = |what: String| ParseError::malformed(at, format!("the record of LASzip: {what}"));
        let vlr = LazVlr::from_buffer(stored).map_err(|error| bad(error.to_string()))?;
        // The items have to be those of the format
        let (least, ..) = offsets(header.format).unwrap_or_default();
        let extra = u16::try_from(header.record.saturating_sub(least)).unwrap_or(u16::MAX);
        if extra > MAX_EXTRA {
            let what = format!(
                "a LAZ file with {extra} extra bytes a point, at most {MAX_EXTRA} are decoded; decompress it with `laszip`"
            );
            return Err(ParseError::unsupported(what));
        }
        let expected = LazItemRecordBuilder::default_for_point_format_id(header.format, extra);
        let expected = expected.map_err(|error| bad(error.to_string()))?;
        let has_layers = header.format > 5;
        let is_expected = |(item, other): (&LazItem, &LazItem)| {
            let versions = if has_layers { [3, 4] } else { [1, 2] };
            item.item_type() == other.item_type()
                && item.size() == other.size()
                && versions.contains(&item.version())
        };
        if vlr.items().len() != expected.len()
            || !vlr.items().iter().zip(&expected).all(is_expected)
        {
            let what = format!("its items are not those of the format of points {}", header.format);
            return Err(bad(what));
        }
        let kind = stored.first_chunk().map_or(0, |kind| u16::from_le_bytes(*kind));
        let kinds = if has_layers { [LAYERED_CHUNKS; 2] } else { [ONE_CHUNK, CHUNKS] };
        if !kinds.contains(&kind) {
            return Err(bad(format!("the unknown compressor {kind}")));
        }
        let layers = expected.iter().map(layers_of).sum();
        // A chunk with layers is decoded by itself, whatever the number of points in others
        let mut fixed = stored.to_vec();
        if let Some(size) = fixed.get_mut(CHUNK_SIZE..CHUNK_SIZE + 4)
            && has_layers
        {
            size.copy_from_slice(&(u32::MAX - 1).to_le_bytes());
        }
        if kind == CHUNKS && matches!(vlr.chunk_size(), 0 | u32::MAX) {
            let what = "LAZ with chunks of several lengths in a format of points up to 5, which is not read; write it \
                        anew with `laszip -i in.laz -o out.laz`";
            return Err(ParseError::unsupported(what));
        }
        if kind == CHUNKS && (vlr.chunk_size() as usize) < LEAST_CHUNK.min(header.count) {
            return Err(bad(format!("chunks of {} points", vlr.chunk_size())));
        }
        let vlr = LazVlr::from_buffer(&fixed).map_err(|error| bad(error.to_string()))?;
        Ok(Self { vlr, is_one_chunk: kind == ONE_CHUNK, layers })
    }

    /// Decodes `points` of a stream.
    fn unpack_stream(
        &self,
        data: &[u8],
        points: &mut [u8],
        header: &LasHeader,
    ) -> Result<(), ParseError> {
        if points.is_empty() {
            return Ok(());
        }
        let table = if self.is_one_chunk { 0 } else { TABLE };
        let body = Cursor::new(data.get(table..).unwrap_or_default());
        let chunk = match (self.is_one_chunk, self.vlr.chunk_size() as usize) {
            (true, _) => points.len(),
            (false, size) => size.saturating_mul(header.record),
        };
        let decoded = catch_panic(|| -> Result<(), DecoderError> {
            let mut decoder = SequentialPointRecordDecompressor::new(body);
            for points in points.chunks_mut(chunk) {
                self.start_chunk(&mut decoder)?;
                decoder.decompress_many(points)?;
            }
            Ok(())
        });
        decoded.map_err(|DecoderError(what)| damaged(header.start, &what))
    }

    /// Makes `decoder` begin anew.
    fn start_chunk(&self, decoder: &mut StreamDecoder<'_>) -> Result<(), laz::LasZipError> {
        decoder.reset();
        for item in self.vlr.items() {
            match (item.item_type(), item.version()) {
                (LazItemType::GpsTime, 1) => decoder.add_field_decompressor(Times1::default()),
                (LazItemType::GpsTime, _) => decoder.add_field_decompressor(Times2::default()),
                _ => decoder.set_fields_from(&vec![*item])?,
            }
        }
        Ok(())
    }

    /// Decodes `points` chunk by chunk.
    fn unpack_layers(
        &self,
        data: &[u8],
        points: &mut [u8],
        header: &LasHeader,
    ) -> Result<(), ParseError> {
        let mut rest = data.get(TABLE..).unwrap_or_default();
        let mut left = points;
        while !left.is_empty() {
            let at = bytes_before(header, data, rest);
            let (count, len) = self.chunk(rest, header.record).ok_or_else(|| {
                damaged(at, "a chunk has no points, or is longer than what is left of the file")
            })?;
            let (chunk, more) = rest.split_at(len);
            let len = count.saturating_mul(header.record).min(left.len());
            let (own, others) = left.split_at_mut(len);
            self.decode(chunk, own, header.record).map_err(|what| damaged(at, &what))?;
            (rest, left) = (more, others);
        }
        Ok(())
    }

    /// Points and bytes of the chunk at the beginning of `bytes`: the first point, the number of points, the lengths of all
    /// layers, and these.
    fn chunk(&self, bytes: &[u8], record: usize) -> Option<(usize, usize)> {
        let (numbers, _) = bytes.get(record..)?.as_chunks::<4>();
        let (count, lengths) = numbers.split_first()?;
        let count = u32::from_le_bytes(*count) as usize;
        let lengths =
            lengths.get(..self.layers)?.iter().map(|len| u32::from_le_bytes(*len) as usize);
        let layers = lengths.fold(0, usize::saturating_add);
        let len = record.checked_add(4 + 4 * self.layers)?.checked_add(layers)?;
        (count > 0 && len <= bytes.len()).then_some((count, len))
    }

    /// Decodes the points of a chunk with layers, as many as `to` has room for.
    fn decode(&self, body: &[u8], to: &mut [u8], record: usize) -> Result<(), String> {
        // A table without chunks, so that the crate trusts none
        let mut source = Vec::with_capacity(body.len() + 2 * TABLE);
        source.extend(((TABLE + body.len()) as u64).to_le_bytes());
        source.extend(body);
        source.extend([0; TABLE]);
        let decoded = catch_panic(|| -> Result<(), DecoderError> {
            let source = Cursor::new(&source);
            let selection = DecompressionSelection::all().skip_gps_time();
            let mut decoder = LasZipDecompressor::selective(source, self.vlr.clone(), selection)?;
            decoder.decompress_many(to)?;
            let chunk = Chunk { bytes: body, record, layers: self.layers };
            Ok(chunk.decode_times(to)?)
        });
        decoded.map_err(|DecoderError(what)| what)
    }
}

/// Layers of an item.
fn layers_of(item: &LazItem) -> usize {
    match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGB14 | LazItemType::WavePacket14 => 1,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => count.into(),
        _ => 0,
    }
}

/// Offset in the file of `rest`, the end of its `data`.
fn bytes_before(header: &LasHeader, data: &[u8], rest: &[u8]) -> usize {
    header.start + data.len().saturating_sub(rest.len())
}

fn damaged(at: usize, what: &str) -> ParseError {
    let what = format!("compressed points are damaged ({what}), or {CUT_SHORT}");
    ParseError::malformed(at, what)
}

/// What the decoder says, or why it panicked.
struct DecoderError(String);

impl From<Panic> for DecoderError {
    fn from(panic: Panic) -> Self {
        Self(panic.message)
    }
}

impl From<laz::LasZipError> for DecoderError {
    fn from(error: laz::LasZipError) -> Self {
        Self(error.to_string())
    }
}

impl From<std::io::Error> for DecoderError {
    fn from(error: std::io::Error) -> Self {
        Self(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{FORMAT, POINT_FORMAT};
    use super::*;
    use crate::read::damage::{TestedReader, mutate, sample};
    use crate::read::{ByteSource, Step};
    use crate::reader::Confidence;

    const READER: TestedReader = TestedReader {
        steps: |bytes| FORMAT.steps(bytes),
        read: |bytes, step| FORMAT.read(bytes, step),
    };

    const FORMATS: [u8; 8] = [0, 1, 2, 3, 5, 6, 7, 8];

    fn cloud(format: u8) -> Vec<u8> {
        sample(&format!("las/format{format}.laz"))
    }

    #[test]
    fn files_of_laszip_have_the_points_of_uncompressed_ones() {
        for format in FORMATS {
            let packed = cloud(format);
            assert_eq!(FORMAT.reader().sniff(&packed), Ok(Confidence::Signature));
            let plain = READER.one(&sample(&format!("las/format{format}.las")));
            assert_eq!(plain.positions.len(), 300);
            assert_eq!(READER.one(&packed), plain, "format {format}");
            let notes = FORMAT.reader().notes(&packed);
            assert!(notes[0].starts_with("LAZ 1."), "{notes:?}");
        }
    }

    #[test]
    fn truncated_files_are_detected() {
        for format in FORMATS {
            let bytes = cloud(format);
            let header = LasHeader::parse(&bytes).expect("a header");
            // The table of chunks at the end is not used
            READER.survives_truncation(&bytes, &[0, 4, 104, 226, header.start], bytes.len() / 2);
        }
    }

    /// Record of LASzip in a file, its place and the place of the points.
    fn places(bytes: &[u8]) -> (usize, usize) {
        let header = LasHeader::parse(bytes).expect("a header");
        let record = header.record_of(bytes, LazVlr::USER_ID.as_bytes(), LazVlr::RECORD_ID);
        (record.expect("a record").0, header.start)
    }

    #[test]
    fn damage_is_named() {
        let error = |format: u8, place: usize, value: &[u8]| {
            let mut bytes = cloud(format);
            bytes[place..place + value.len()].copy_from_slice(value);
            READER.error_inside(&bytes).to_string()
        };
        let (stream, _) = places(&cloud(2));
        let (layers, start) = places(&cloud(6));
        let mut others = Vec::new();
        for (format, place, value, message) in [
            (2, stream, &[9, 0][..], "Compressor type 9 is not valid"),
            (2, stream, &[3, 0], "the unknown compressor 3"),
            (2, stream + 12, &[255; 4], "chunks of several lengths"),
            (2, stream + 12, &[1, 0, 0, 0], "chunks of 1 points"),
            (2, stream + 32, &[200, 0], "the record of LASzip: "),
            (2, stream + 34, &[10, 0], "are not those of the format of points 2"),
            (2, stream + 36, &[19, 0], "are not those of the format of points 2"),
            (2, stream + 38, &[7, 0], "are not those of the format of points 2"),
            (2, 105, &[0, 255], "65254 extra bytes a point"),
            (2, stream - 52, b"X", "there is no record `laszip encoded`"),
            (2, 107, &[255, 0, 0, 1], "compressed points in"),
            (2, 107, &[255, 255, 0, 0], "compressed points are damaged"),
            (2, POINT_FORMAT, &[0x83, 34, 0], "are not those of the format of points 3"),
            (6, layers, &[2, 0], "the unknown compressor 2"),
            (6, start + 8 + 30, &[0; 4], "a chunk has no points"),
            (6, start + 8 + 30 + 4, &[255; 4], "longer than what is left"),
            (6, 247, &[255, 255], "compressed points"),
        ] {
            let found = error(format, place, value);
            if !found.contains(message) {
                others.push(format!("{found}, not {message}"));
            }
        }
        assert!(others.is_empty(), "{others:#?}");
    }

    #[test]
    fn decompressed_points_are_bounded_by_the_budget() {
        let bytes = cloud(6);
        let step = Step::whole(bytes.len());
        for limit in [1000, 12_000] {
            let mut source = ByteSource::whole(&bytes);
            let budget = MemoryBudget::new(limit, "take care");
            let error = FORMAT.read_within(&mut source, &step, budget).expect_err("too many");
            assert!(matches!(error, ParseError::TooLarge { .. }), "{error}");
        }
    }

    proptest! {
        #[test]
        fn mutations_never_panic(
            format in prop::sample::select(&FORMATS[..]),
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        ) {
            let _ = READER.all(&mutate(&cloud(format), &changes));
        }
    }
}
