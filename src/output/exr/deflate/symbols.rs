//! The two alphabets of deflate: literals and lengths, and distances (RFC 1951, section 3.2.5).

/// Literals, the end of a block, and lengths.
pub(super) const SYMBOLS: usize = 286;
/// Ends a block.
pub(super) const END: usize = 256;
/// Symbols of distances.
pub(super) const DISTANCES: usize = 30;
/// The first symbol of lengths.
const FIRST_LENGTH: usize = 257;
/// Shortest and longest match.
const MIN_LENGTH: usize = 3;
pub(super) const MAX_LENGTH: usize = 258;

/// The shortest length of each symbol of lengths.
const BASES: [u16; 29] = [
    3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131,
    163, 195, 227, 258,
];

/// How a length or a distance is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Value {
    pub(super) symbol: u16,
    /// What it is more than the least value of the symbol.
    pub(super) extra: u16,
}

/// By length.
pub(super) static LENGTH_VALUES: [Value; MAX_LENGTH + 1] = length_values();

#[expect(
    clippy::cast_possible_truncation,
    reason = "symbols are below 286, extra bits at most 5"
)]
const fn length_values() -> [Value; MAX_LENGTH + 1] {
    let none = Value {
        symbol: 0,
        extra: 0,
    };
    let mut values = [none; MAX_LENGTH + 1];
    let (mut length, mut place) = (MIN_LENGTH, 0);
    while length <= MAX_LENGTH {
        if place + 1 < BASES.len() && length == BASES[place + 1] as usize {
            place += 1;
        }
        values[length] = Value {
            symbol: (FIRST_LENGTH + place) as u16,
            extra: (length - BASES[place] as usize) as u16,
        };
        length += 1;
    }
    values
}

/// Bits that follow `symbol` of literals and lengths.
#[expect(clippy::cast_possible_truncation, reason = "symbols are below 286")]
pub(super) const fn length_bits(symbol: usize) -> u32 {
    const LAST: usize = SYMBOLS - 1;
    match symbol {
        // Four symbols for each number of bits.
        265..LAST => (symbol as u32 - 261) / 4,
        _ => 0,
    }
}

/// How a distance from 1 on is written.
#[inline(always)]
pub(super) const fn distance_value(distance: u16) -> Value {
    let beyond = distance - 1;
    if beyond < 4 {
        return Value {
            symbol: beyond,
            extra: 0,
        };
    }
    // Two symbols for each power of two.
    let power = beyond.ilog2();
    let bits = power - 1;
    Value {
        symbol: 2 * (power & 0xf) as u16 + (beyond >> bits & 1),
        extra: beyond & ((1 << bits) - 1),
    }
}

/// Bits that follow `symbol` of distances.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "symbols are below 30")]
pub(super) const fn distance_bits(symbol: usize) -> u32 {
    match symbol {
        ..4 => 0,
        _ => symbol as u32 / 2 - 1,
    }
}
