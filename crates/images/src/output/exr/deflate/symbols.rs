//! The two alphabets of deflate: literals and lengths, and distances (RFC 1951, section 3.2.5).

/// Number of symbols for literals, the end of a block, and lengths.
pub(super) const SYMBOLS: usize = 286;
/// The symbol that ends a block.
pub(super) const END: usize = 256;
/// Number of symbols for distances.
pub(super) const DISTANCES: usize = 30;
/// The first symbol for lengths.
const FIRST_LENGTH: usize = 257;
/// Minimum length of a match in deflate.
const MIN_LENGTH: usize = 3;
/// Maximum length of a match in deflate.
pub(super) const MAX_LENGTH: usize = 258;

/// The minimum length of each symbol for lengths.
const BASES: [u16; 29] = [
    3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131,
    163, 195, 227, 258,
];

/// The symbol and the extra bits of a length or a distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Value {
    pub(super) symbol: u16,
    /// Difference from the minimum value of the symbol, which the extra bits contain.
    pub(super) extra: u16,
}

/// Symbols and extra bits, by length.
pub(super) static LENGTH_VALUES: [Value; MAX_LENGTH + 1] = length_values();

#[expect(clippy::cast_possible_truncation, reason = "symbols are below 286, extra bits at most 5")]
const fn length_values() -> [Value; MAX_LENGTH + 1] {
    let none = Value { symbol: 0, extra: 0 };
    let mut values = [none; MAX_LENGTH + 1];
    let (mut length, mut index) = (MIN_LENGTH, 0);
    while length <= MAX_LENGTH {
        if index + 1 < BASES.len() && length == BASES[index + 1] as usize {
            index += 1;
        }
        values[length] = Value {
            symbol: (FIRST_LENGTH + index) as u16,
            extra: (length - BASES[index] as usize) as u16,
        };
        length += 1;
    }
    values
}

/// Number of extra bits of `symbol`, a literal or length.
#[expect(clippy::cast_possible_truncation, reason = "symbols are below 286")]
pub(super) const fn length_bits(symbol: usize) -> u32 {
    const LAST: usize = SYMBOLS - 1;
    match symbol {
        // Four symbols for each number of extra bits
        265..LAST => (symbol as u32 - 261) / 4,
        _ => 0,
    }
}

/// Symbol and extra bits of a distance of at least 1.
#[inline(always)]
pub(super) const fn distance_value(distance: u16) -> Value {
    let offset = distance - 1;
    if offset < 4 {
        return Value { symbol: offset, extra: 0 };
    }
    // Two symbols for each power of two
    let power = offset.ilog2();
    let bits = power - 1;
    Value {
        symbol: 2 * (power & 0xf) as u16 + (offset >> bits & 1),
        extra: offset & ((1 << bits) - 1),
    }
}

/// Number of extra bits of `symbol`, a distance.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "symbols are below 30")]
pub(super) const fn distance_bits(symbol: usize) -> u32 {
    match symbol {
        ..4 => 0,
        _ => symbol as u32 / 2 - 1,
    }
}
