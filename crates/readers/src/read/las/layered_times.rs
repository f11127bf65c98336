//! Times of points in LAZ files of formats 6 to 10.
//!
//! Each chunk has a layer of times: one for each point whose time differs from that of the point before it in the same
//! scanner channel. The layer of channels, returns and horizontal positions tells which points these are. The crate `laz`
//! decodes that layer but does not report these points, so this module decodes it again.

use std::array;
use std::io::{Cursor, ErrorKind, Result};

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::IntegerDecompressor;
use laz::models::ArithmeticModel;

use super::times::{LEN, Times2, differences, model};

/// Place of the time in a point.
const TIME: usize = 22;
/// Place of the number of the return, and of the number of returns in the upper half.
const RETURNS: usize = 14;
/// Place of the scanner channel, in two bits.
const FLAGS: usize = 15;
const CHANNELS: usize = 4;
/// The layers of positions and of times among those of a chunk.
const POSITIONS_LAYER: usize = 0;
const TIMES_LAYER: usize = 8;

/// Changes of a point against the one before it, as bits of a symbol.
mod change {
    pub(super) const RETURN: u32 = 0b11;
    pub(super) const RETURN_COUNT: u32 = 1 << 2;
    pub(super) const TIME: u32 = 1 << 4;
    pub(super) const CHANNEL: u32 = 1 << 6;
}

/// Kinds of returns, as digits, by the number of returns, then by the number of the return. Each kind has medians of its
/// own.
const RETURN_KINDS: [&[u8; 16]; 16] = [
    b"0123453445555555",
    b"1013333333333333",
    b"2124444444433333",
    b"3345444444444444",
    b"4344544444444444",
    b"5344454444444444",
    b"3344445444444444",
    b"4344444544444444",
    b"4344444454444444",
    b"5344444445444444",
    b"5344444444544444",
    b"5334444444455444",
    b"5334444444455544",
    b"5334444444445554",
    b"5334444444444555",
    b"5334444444444455",
];

/// A chunk of points, compressed in layers.
pub(super) struct Chunk<'a> {
    pub(super) bytes: &'a [u8],
    /// Bytes of a point. The chunk begins with the first one.
    pub(super) record: usize,
    /// Number of layers.
    pub(super) layers: usize,
}

impl Chunk<'_> {
    /// Decodes the times into `points`, which have all other values already.
    ///
    /// # Errors
    /// [`ErrorKind::InvalidData`], or [`ErrorKind::UnexpectedEof`] where a layer ends too early.
    pub(super) fn decode_times(&self, points: &mut [u8]) -> Result<()> {
        let times = self.layer(TIMES_LAYER)?;
        let mut points = points.chunks_exact_mut(self.record);
        let Some(first) = points.next() else {
            return Ok(());
        };
        if times.is_empty() {
            // All times are that of the first point, which the points have already
            return Ok(());
        }
        let mut times = decoder(times)?;
        let mut positions = decoder(self.layer(POSITIONS_LAYER)?)?;
        let mut channels: [Option<Channel>; CHANNELS] = array::from_fn(|_| None);
        let mut current = channel_of(first);
        channels[current] = Some(Channel::new(returns_of(first), time_of(first)));
        for point in points {
            // Read the changes with the channel of the point before, which is also the start of a new channel
            let Some(channel) = channels[current].as_mut() else {
                return Err(ErrorKind::InvalidData.into());
            };
            let changes = channel.read_changes(&mut positions)?;
            let (returns, time) = (channel.returns, channel.time);
            current = channel_of(point);
            let channel = channels[current].get_or_insert_with(|| Channel::new(returns, time));
            channel.pass_position(&mut positions, changes, returns_of(point))?;
            if channel.has_new_time {
                channel.time = channel.times.next_time(&mut times)?;
            }
            point[TIME..TIME + LEN].copy_from_slice(&channel.time.to_le_bytes());
        }
        Ok(())
    }

    /// The bytes of a layer. The number of points and the lengths of all layers come before the first one.
    fn layer(&self, index: usize) -> Result<&[u8]> {
        let find = || {
            let (numbers, _) = self.bytes.get(self.record..)?.as_chunks::<4>();
            let length = |number: &[u8; 4]| u32::from_le_bytes(*number) as usize;
            let lengths = numbers.get(1..=self.layers)?;
            let before = lengths.get(..index)?.iter().map(length).fold(0, usize::saturating_add);
            let layers = self.bytes.get(self.record + 4 * (1 + self.layers)..)?;
            layers.get(before..)?.get(..length(lengths.get(index)?))
        };
        find().ok_or_else(|| ErrorKind::UnexpectedEof.into())
    }
}

type Decoder<'a> = ArithmeticDecoder<Cursor<&'a [u8]>>;

fn decoder(layer: &[u8]) -> Result<Decoder<'_>> {
    let mut decoder = ArithmeticDecoder::new(Cursor::new(layer));
    decoder.read_init_bytes()?;
    Ok(decoder)
}

fn channel_of(point: &[u8]) -> usize {
    usize::from(point[FLAGS] >> 4) % CHANNELS
}

fn time_of(point: &[u8]) -> i64 {
    let mut bytes = [0; LEN];
    bytes.copy_from_slice(&point[TIME..TIME + LEN]);
    i64::from_le_bytes(bytes)
}

fn returns_of(point: &[u8]) -> Returns {
    let byte = usize::from(point[RETURNS]);
    Returns { number: byte % 16, count: byte / 16 }
}

/// The number of a return, and the number of returns of its pulse.
#[derive(Clone, Copy)]
struct Returns {
    number: usize,
    count: usize,
}

impl Returns {
    fn is_first(self) -> bool {
        self.number == 1
    }

    fn is_last(self) -> bool {
        self.number >= self.count
    }
}

/// What the decoder knows of the points of a scanner channel.
struct Channel {
    returns: Returns,
    time: i64,
    /// Whether the last point has another time than the one before it.
    has_new_time: bool,
    changes: [ArithmeticModel; 8],
    channel: ArithmeticModel,
    return_counts: [ArithmeticModel; 16],
    return_numbers: [ArithmeticModel; 16],
    return_number_at_same_time: ArithmeticModel,
    x: Axis,
    y: Axis,
    times: Times2,
}

impl Channel {
    fn new(returns: Returns, time: i64) -> Self {
        Self {
            returns,
            time,
            has_new_time: false,
            changes: array::from_fn(|_| model(128)),
            channel: model(3),
            return_counts: array::from_fn(|_| model(16)),
            return_numbers: array::from_fn(|_| model(16)),
            return_number_at_same_time: model(13),
            x: Axis::new(2),
            y: Axis::new(22),
            times: Times2::layered(time),
        }
    }

    /// Reads what changes from the last point of this channel to the next point.
    fn read_changes(&mut self, decoder: &mut Decoder<'_>) -> Result<u32> {
        let context = usize::from(self.returns.is_first())
            + 2 * usize::from(self.returns.is_last())
            + 4 * usize::from(self.has_new_time);
        let changes = decoder.decode_symbol(&mut self.changes[context])?;
        if changes & change::CHANNEL != 0 {
            decoder.decode_symbol(&mut self.channel)?;
        }
        Ok(changes)
    }

    /// Passes over the position of the next point, which has these returns.
    fn pass_position(
        &mut self,
        decoder: &mut Decoder<'_>,
        changes: u32,
        returns: Returns,
    ) -> Result<()> {
        self.has_new_time = changes & change::TIME != 0;
        // Pass over the returns
        if changes & change::RETURN_COUNT != 0 {
            decoder.decode_symbol(&mut self.return_counts[self.returns.count])?;
        }
        if changes & change::RETURN == change::RETURN {
            let number = if self.has_new_time {
                &mut self.return_numbers[self.returns.number]
            } else {
                &mut self.return_number_at_same_time
            };
            decoder.decode_symbol(number)?;
        }
        self.returns = returns;
        // Pass over the coordinates
        let kind = usize::from(RETURN_KINDS[returns.count][returns.number] - b'0');
        let context = 2 * kind + usize::from(self.has_new_time);
        let is_single = u32::from(returns.count == 1);
        self.x.pass(decoder, context, is_single)?;
        let bits = (self.x.differences.k() & !1).min(20);
        self.y.pass(decoder, context, is_single + bits)
    }
}

/// Differences of a coordinate.
struct Axis {
    differences: IntegerDecompressor,
    medians: [Median; 12],
}

impl Axis {
    fn new(contexts: u32) -> Self {
        Self { differences: differences(contexts), medians: [Median::default(); 12] }
    }

    fn pass(&mut self, decoder: &mut Decoder<'_>, median: usize, context: u32) -> Result<()> {
        let median = &mut self.medians[median];
        let difference = self.differences.decompress(decoder, median.value(), context)?;
        median.add(difference);
        Ok(())
    }
}

/// The median of five numbers, an estimate for all numbers before. New numbers replace the largest while they are below
/// the median, and the smallest while they are above it.
#[derive(Clone, Copy)]
struct Median {
    sorted: [i32; 5],
    replaces_largest: bool,
}

impl Default for Median {
    fn default() -> Self {
        Self { sorted: [0; 5], replaces_largest: true }
    }
}

impl Median {
    const fn value(&self) -> i32 {
        self.sorted[2]
    }

    fn add(&mut self, number: i32) {
        let median = self.value();
        if self.replaces_largest {
            self.sorted[4] = number;
            self.replaces_largest = number < median;
        } else {
            self.sorted[0] = number;
            self.replaces_largest = number <= median;
        }
        self.sorted.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use laz::{LasZipCompressor, LazItemRecordBuilder};
    use proptest::prelude::*;

    use super::*;

    const RECORD: usize = 30;

    /// Points of format 6, as bytes, of `(channel, returns, step of the time, place)`.
    fn cloud(values: &[(u8, u8, f64, i32)]) -> Vec<u8> {
        let mut times = [1e5, 2e5, 3e5, 4e5];
        let mut points = Vec::new();
        for (channel, returns, step, place) in values {
            let time = &mut times[usize::from(*channel)];
            *time += step;
            let mut point = [0_u8; RECORD];
            point[..4].copy_from_slice(&place.to_le_bytes());
            point[4..8].copy_from_slice(&place.wrapping_mul(3).to_le_bytes());
            point[RETURNS] = *returns;
            point[FLAGS] = channel << 4;
            point[TIME..].copy_from_slice(&time.to_le_bytes());
            points.extend(point);
        }
        points
    }

    fn compressed(points: &[u8]) -> Vec<u8> {
        let items = LazItemRecordBuilder::default_for_point_format_id(6, 0).expect("items");
        let mut packer =
            LasZipCompressor::from_laz_items(Cursor::new(Vec::new()), items).expect("a compressor");
        packer.compress_many(points).expect("points");
        packer.done().expect("the end");
        // The place of the table of chunks comes first
        packer.into_inner().into_inner().split_off(8)
    }

    proptest! {
        #[test]
        fn times_are_those_that_were_compressed(
            values in prop::collection::vec(
                (
                    0..4_u8,
                    any::<u8>(),
                    prop::sample::select(&[0.0, 0.0, 0.0, 1e-5, 1e-5, 2e-5, 3e-3, -1e-5, -1e3, 1e6][..]),
                    prop_oneof![-50..50_i32, any::<i32>()],
                ),
                1..300,
            ),
        ) {
            let points = cloud(&values);
            let bytes = compressed(&points);
            let mut without = points.clone();
            for point in without.chunks_exact_mut(RECORD) {
                point[TIME..].copy_from_slice(&points[TIME..RECORD]);
            }
            let chunk = Chunk { bytes: &bytes, record: RECORD, layers: 9 };
            chunk.decode_times(&mut without).expect("times");
            prop_assert_eq!(without, points);
        }
    }

    #[test]
    fn damage_is_an_error() {
        let points = cloud(&[(0, 0x11, 1.0, 5), (1, 0x22, 2.0, 6), (1, 0x21, 2.0, 6)].repeat(40));
        let bytes = compressed(&points);
        let found = |bytes: &[u8], record, layers| {
            Chunk { bytes, record, layers }.decode_times(&mut points.clone())
        };
        found(&bytes, RECORD, 9).expect("times");
        assert!(found(&bytes[..RECORD + 20], RECORD, 9).is_err());
        assert!(found(&bytes, RECORD, 8).is_err(), "no layer of times");
        let mut damaged = bytes.clone();
        damaged[RECORD + 4..RECORD + 8].fill(255);
        assert!(found(&damaged, RECORD, 9).is_err(), "an endless layer");
        damaged[RECORD + 4..RECORD + 8].fill(0);
        assert!(found(&damaged, RECORD, 9).is_err(), "no positions");
    }
}
