//! Decompresses streams with another crate, and checks their lengths.

use std::io::Read;

use flate2::read::ZlibDecoder;
use proptest::prelude::*;

use super::matches::MatchFinder;
use super::symbols::MAX_LENGTH;
use super::*;

/// Pseudorandom bytes (splitmix64).
fn noise(seed: u64) -> impl Iterator<Item = u8> {
    (seed << 32..).map(|at| {
        let z = at.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z >> 56) as u8
    })
}

/// Compresses `data` in pieces that end at `ends` and at the last byte. Either all pieces are searched or none.
fn compress(data: &[u8], ends: &[usize], is_searched: bool) -> Option<Vec<u8>> {
    let ends = ends.iter().copied().chain([data.len()]);
    let pieces = ends.scan(0, |start, end| {
        let length = end - std::mem::replace(start, end);
        Some(Piece { length, is_searched })
    });
    let mut deflater = Deflater::default();
    // Compress other data first: the previous content of the memory must not matter
    let piece = Piece { length: 500, is_searched: true };
    let before: Vec<u8> = noise(9).take(500).collect();
    deflater.compress(&before.repeat(2), [piece; 2]).unwrap();
    deflater.compress(data, pieces).map(<[u8]>::to_vec)
}

fn inflated(stream: &[u8]) -> Vec<u8> {
    let mut data = Vec::new();
    // The decoder fails if a code is not complete or the checksum is wrong
    let mut decoder = ZlibDecoder::new(stream);
    decoder.read_to_end(&mut data).unwrap();
    assert_eq!(decoder.total_in(), stream.len() as u64);
    data
}

/// Length of the stream of `data`, if it is shorter than the data: with runs only, and with a search for other matches.
#[track_caller]
fn check(data: &[u8], ends: &[usize]) -> [Option<usize>; 2] {
    [false, true].map(|is_searched| {
        let stream = compress(data, ends, is_searched)?;
        assert!(stream.len() < data.len());
        assert!(inflated(&stream) == data, "{} bytes", data.len());
        Some(stream.len())
    })
}

/// Length of the stream with runs only.
#[track_caller]
fn length(data: &[u8], ends: &[usize]) -> usize {
    check(data, ends)[0].expect("shorter than the data")
}

#[test]
fn runs_of_every_length_and_distance_round_trip() {
    let mut data: Vec<u8> = noise(1).take(5).collect();
    for length in (0..40).chain(250..300).chain([515, 516, 517, 518, 519, 520, 5000]) {
        for period in 1..4 {
            let pattern: Vec<u8> = noise(length as u64).take(period).collect();
            data.extend(pattern.iter().cycle().take(length + period));
            data.extend(noise(period as u64).take(length % 9));
        }
    }
    let all: Vec<usize> = (0..data.len()).collect();
    let some: Vec<usize> = (0..data.len()).step_by(97).collect();
    // A third of the data has period 3, which is not the distance of a run
    for ends in [&[][..], &some] {
        assert!(length(&data, ends) < data.len() / 2);
    }
    check(&data, &all);
}

#[test]
fn few_and_equal_bytes_round_trip() {
    for length in 0..20 {
        check(&vec![128; length], &[]);
        check(&vec![0; length], &[length / 2]);
    }
    for length in [100, 1000, 100_000, 1 << 20] {
        for byte in [0, 128, 255] {
            let most = 40 + length / 500;
            assert!(self::length(&vec![byte; length], &[]) < most, "{length}");
        }
    }
}

#[test]
fn noise_is_not_compressed() {
    for length in [0, 1, 2, 1000, 200_000] {
        let data: Vec<u8> = noise(3).take(length).collect();
        assert_eq!(check(&data, &[length / 3, length / 2]), [None; 2], "{length}");
    }
}

#[test]
fn noise_next_to_runs_is_stored_in_several_blocks() {
    let mut data: Vec<u8> = noise(4).take(200_000).collect();
    data.extend([5; 200_000]);
    data.extend(noise(5).take(70_000));
    let ends = [200_000, 400_000];
    let stream = length(&data, &ends);
    assert!((270_000..271_500).contains(&stream), "{stream}");
}

/// Counts that are Fibonacci numbers give the deepest codes.
#[test]
fn longest_codes_round_trip() {
    let mut data = Vec::new();
    let (mut count, mut next) = (1, 1);
    for byte in 0..26_u8 {
        // Adjacent bytes differ, so there are no runs
        let pairs = std::iter::repeat_n([byte, 255 - byte % 2], count);
        data.extend(pairs.flatten());
        (count, next) = (next, count + next);
    }
    let mut mixed: Vec<(u8, u8)> = noise(6).zip(data.iter().copied()).collect();
    mixed.sort_unstable();
    let mixed: Vec<u8> = mixed.into_iter().map(|(_, byte)| byte).collect();
    assert!(length(&mixed, &[]) < mixed.len() / 2);
}

#[test]
fn similar_pieces_share_a_block_and_different_ones_do_not() {
    let nibbles = |seed, add| noise(seed).map(move |byte| byte % 16 + add);
    let pieces = |add: u8| {
        let pieces = (0..20_u8).map(|piece| nibbles(piece.into(), add * (piece % 2)).take(3000));
        pieces.flatten().collect::<Vec<u8>>()
    };
    let ends: Vec<usize> = (1..20).map(|piece| 3000 * piece).collect();
    let similar = length(&pieces(0), &ends);
    let different = length(&pieces(100), &ends);
    // Four bits per byte, with one header, or with a header per piece
    assert!((30_000..30_700).contains(&similar), "{similar}");
    assert!((30_700..32_000).contains(&different), "{different}");
    assert!(length(&pieces(100), &[]) > 37_000);
}

#[test]
fn memory_for_sequences_is_bounded() {
    // As many runs as possible
    let data: Vec<u8> = noise(7).take(400_000).flat_map(|byte| [byte; 5]).collect();
    let mut deflater = Deflater::default();
    let piece = Piece { length: data.len(), is_searched: true };
    let stream = deflater.compress(&data, [piece]).unwrap();
    assert!(inflated(stream) == data);
    let bytes = deflater.sequences.capacity() * size_of::<Sequence>();
    assert!(bytes <= MAX_SEQUENCE_BYTES, "{bytes}");
    assert_eq!(deflater.stream.capacity(), data.len() + EXTRA_CAPACITY);
}

#[track_caller]
fn check_sequences<F: MatchFinder>(
    data: &[u8],
    mut finder: F,
    distances: std::ops::RangeInclusive<usize>,
) {
    let mut sequences = Vec::new();
    for ends in [0, 1, 2, 3, 700, 701, 5000, data.len()].windows(2) {
        let first = sequences.len();
        find_sequences(data, ends[0]..ends[1], &mut finder, &mut sequences);
        let lengths =
            sequences[first..].iter().map(|s| s.literals as usize + usize::from(s.length));
        assert_eq!(lengths.sum::<usize>(), ends[1] - ends[0]);
    }
    let mut at = 0;
    for sequence in &sequences {
        at += sequence.literals as usize;
        let (length, distance) = (usize::from(sequence.length), usize::from(sequence.distance));
        assert!(length == 0 || (4..=MAX_LENGTH).contains(&length));
        assert!(distances.contains(&distance), "{distance}");
        for index in at..at + length {
            assert_eq!(data[index], data[index - distance]);
        }
        at += length;
    }
    assert_eq!(at, data.len());
}

#[test]
fn sequences_describe_the_data() {
    let bytes = noise(8).take(5000);
    let data: Vec<u8> = bytes.flat_map(|b| vec![b % 8; usize::from(b)]).collect();
    let mut hash_table = HashTable::default();
    hash_table.clear();
    check_sequences(&data, RunsOnly, 1..=2);
    check_sequences(&data, hash_table, 1..=WINDOW);
}

/// A row of noise and its copy, with some bytes changed, at distances near the end of the window.
#[test]
fn matches_reach_as_far_as_the_window() {
    let matched = |distance: usize| {
        let row: Vec<u8> = noise(10).take(distance).collect();
        let mut copy = row.clone();
        for byte in copy.iter_mut().step_by(100) {
            *byte = byte.wrapping_add(1);
        }
        let data = [row, copy].concat();
        let [runs_only, searched] = check(&data, &[]);
        assert_eq!(runs_only, None);
        searched.is_some_and(|length| length < distance + distance / 10)
    };
    for distance in [5000, WINDOW - 1, WINDOW] {
        assert!(matched(distance), "{distance}");
    }
    assert!(!matched(WINDOW + 1));
}

#[test]
fn every_distance_has_its_symbol() {
    let mut first = 1;
    for symbol in 0..symbols::DISTANCES {
        let values = 1_usize << symbols::distance_bits(symbol);
        for extra in 0..values {
            let value = symbols::distance_value(u16::try_from(first + extra).unwrap());
            assert_eq!((usize::from(value.symbol), usize::from(value.extra)), (symbol, extra));
        }
        first += values;
    }
    assert_eq!(first, WINDOW + 1);
}

proptest! {
    /// Runs of any bytes and lengths with noise between them, divided anywhere into pieces.
    #[test]
    fn any_data_round_trip(
        parts in prop::collection::vec((any::<[u8; 2]>(), 0..700_usize, 0..9_usize), 1..60),
        cuts in prop::collection::vec(any::<prop::sample::Index>(), 0..40),
    ) {
        let mut data = Vec::new();
        for (pattern, length, rest) in parts {
            data.extend(pattern.iter().cycle().take(length));
            data.extend(noise(length as u64).take(rest));
        }
        let mut ends: Vec<usize> = cuts.iter().map(|at| at.index(data.len() + 1)).collect();
        ends.sort_unstable();
        check(&data, &ends);
    }
}
