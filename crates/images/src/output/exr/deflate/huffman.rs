//! Huffman codes of limited length.

/// Maximum length of a code in deflate, bits.
pub(super) const MAX_BITS: usize = 15;

/// The code of a symbol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Code {
    /// The bits in the order of the stream, the first one lowest.
    pub(super) bits: u16,
    /// Number of bits; 0 if the symbol does not occur.
    pub(super) length: u8,
}

/// The codes of `N` symbols with these `counts`, of at most `limit` bits each. At least two symbols must occur.
#[expect(clippy::cast_possible_truncation, reason = "lengths are at most 15")]
pub(super) fn codes<const N: usize>(counts: &[u32; N], limit: usize) -> [Code; N] {
    let mut codes = [Code::default(); N];
    // Sort the symbols by count, and by symbol in a tie
    let mut sorted = [(0, 0); N];
    let mut used = 0;
    for (symbol, count) in (0_u16..).zip(counts) {
        sorted[used] = (*count, symbol);
        used += usize::from(*count > 0);
    }
    let sorted = &mut sorted[..used];
    debug_assert!(used >= 2, "a code for one symbol is not complete");
    sorted.sort_unstable();
    // Compute the lengths of the codes
    let mut depths = [0; N];
    for (depth, (count, _)) in depths.iter_mut().zip(&*sorted) {
        *depth = *count;
    }
    code_lengths(&mut depths[..used]);
    let lengths = limited(&depths[..used], limit);
    // Give the longest codes to the rarest symbols
    let mut symbols = sorted.iter();
    for length in (1..=limit).rev() {
        for (_, symbol) in symbols.by_ref().take(lengths[length] as usize) {
            codes[usize::from(*symbol)].length = length as u8;
        }
    }
    number(&mut codes, &lengths);
    codes
}

/// Replaces counts in ascending order by the lengths of their Huffman codes, in place (Moffat and Katajainen, "In-Place
/// Calculation of Minimum-Redundancy Codes", 1995).
#[expect(clippy::cast_possible_truncation, reason = "there are fewer than 300 symbols")]
fn code_lengths(counts: &mut [u32]) {
    let used = counts.len();
    // Repeatedly join the two lightest nodes. The entry of an internal node is its weight until it is joined itself,
    // and then the index of its parent.
    let (mut root, mut leaf) = (0, 0);
    for next in 0..used - 1 {
        let mut lightest = |counts: &mut [u32]| {
            if leaf >= used || (root < next && counts[root] < counts[leaf]) {
                let weight = counts[root];
                counts[root] = next as u32;
                root += 1;
                weight
            } else {
                leaf += 1;
                counts[leaf - 1]
            }
        };
        let first = lightest(counts);
        let second = lightest(counts);
        counts[next] = first + second;
    }
    // Replace the parents of internal nodes by depths
    counts[used - 2] = 0;
    for node in (0..used - 2).rev() {
        counts[node] = counts[counts[node] as usize] + 1;
    }
    // Replace the entries of leaves by depths: on each level, leaves take the positions that internal nodes leave
    let (mut node, mut next) = (used - 1, used);
    let (mut available, mut depth) = (1, 0);
    while available > 0 {
        let mut internal = 0;
        while node > 0 && counts[node - 1] == depth {
            internal += 1;
            node -= 1;
        }
        for _ in internal..available {
            next -= 1;
            counts[next] = depth;
        }
        available = 2 * internal;
        depth += 1;
    }
}

/// The number of codes of each length, if none may be longer than `limit`.
fn limited(depths: &[u32], limit: usize) -> [u32; MAX_BITS + 1] {
    let mut lengths = [0_u32; MAX_BITS + 1];
    for depth in depths {
        lengths[limit.min(*depth as usize)] += 1;
    }
    // The Kraft sum of the codes, in units of a code with `limit` bits
    let kraft_sum = |lengths: &[u32]| -> u32 {
        let of_length = (1..=limit).map(|length| lengths[length] << (limit - length));
        of_length.sum()
    };
    // Reduce the sum to 1, one unit at a time: split a shorter code into two that are one bit longer, and use one of
    // them in place of a code with `limit` bits
    for _ in (1 << limit)..kraft_sum(&lengths) {
        let found = (1..limit).rev().find(|length| lengths[*length] > 0);
        let shorter = found.expect("some code is shorter than the longest");
        lengths[shorter] -= 1;
        lengths[shorter + 1] += 2;
        lengths[limit] -= 1;
    }
    lengths
}

/// Assigns consecutive numbers to the codes of each length (RFC 1951, section 3.2.2).
#[expect(clippy::cast_possible_truncation, reason = "there are fewer than 300 symbols")]
fn number(codes: &mut [Code], lengths: &[u32; MAX_BITS + 1]) {
    let mut next = [0_u16; MAX_BITS + 1];
    for length in 1..=MAX_BITS {
        // `lengths[0]` is 0, because every code has at least one bit
        next[length] = (next[length - 1] + lengths[length - 1] as u16) << 1;
    }
    for code in codes.iter_mut().filter(|code| code.length > 0) {
        let length = usize::from(code.length);
        code.bits = next[length].reverse_bits() >> (16 - length);
        next[length] += 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Number of bits of all symbols with Huffman's algorithm, without a limit.
    fn min_bits(counts: &[u32]) -> u64 {
        let used = counts.iter().filter(|count| **count > 0);
        let mut weights: Vec<u64> = used.map(|count| u64::from(*count)).collect();
        let mut bits = 0;
        while weights.len() > 1 {
            weights.sort_unstable_by(|a, b| b.cmp(a));
            let joined = weights.pop().unwrap() + weights.pop().unwrap();
            bits += joined;
            weights.push(joined);
        }
        bits
    }

    #[track_caller]
    fn check<const N: usize>(counts: &[u32; N], limit: usize) -> u64 {
        let codes = codes(counts, limit);
        let mut kraft_sum = 0;
        let mut bits = 0;
        for (code, count) in codes.iter().zip(counts) {
            assert_eq!(code.length > 0, *count > 0);
            assert!(usize::from(code.length) <= limit);
            if code.length > 0 {
                kraft_sum += 1_u64 << (limit - usize::from(code.length));
            }
            bits += u64::from(code.length) * u64::from(*count);
        }
        // The code is complete
        assert_eq!(kraft_sum, 1 << limit);
        // No code is a prefix of another: as numbers with the first bit highest, codes of one length are consecutive
        let mut sorted: Vec<&Code> = codes.iter().filter(|code| code.length > 0).collect();
        let number = |code: &Code| code.bits.reverse_bits();
        sorted.sort_by_key(|code| number(code));
        for pair in sorted.windows(2) {
            let width = 1_u32 << (16 - u32::from(pair[0].length));
            assert_eq!(u32::from(number(pair[1])), u32::from(number(pair[0])) + width);
            assert!(pair[0].length <= pair[1].length);
        }
        bits
    }

    #[test]
    fn codes_are_those_of_the_standard() {
        // RFC 1951, section 3.2.2: lengths 3, 3, 3, 3, 3, 2, 4, 4.
        let counts = [20, 20, 20, 20, 20, 40, 10, 10];
        let codes = codes(&counts, MAX_BITS);
        let bits: Vec<u16> =
            codes.iter().map(|code| code.bits.reverse_bits() >> (16 - code.length)).collect();
        assert_eq!(bits, [0b010, 0b011, 0b100, 0b101, 0b110, 0b00, 0b1110, 0b1111]);
    }

    #[test]
    fn deep_codes_are_limited() {
        let mut counts = [0; 30];
        let (mut count, mut next) = (1, 1);
        for each in &mut counts {
            *each = count;
            (count, next) = (next, count + next);
        }
        let all: u64 = counts.iter().map(|count| u64::from(*count)).sum();
        for limit in [5, 7, 14, 15] {
            let bits = check(&counts, limit);
            assert!(bits >= min_bits(&counts) && bits <= all * limit as u64);
        }
        assert_eq!(check(&[1; 128], 7), 7 * 128);
        assert_eq!(check(&[0, 1, 0, u32::MAX / 2, 0], 7), 1 + u64::from(u32::MAX / 2));
    }

    proptest! {
        #[test]
        fn codes_are_complete_and_shortest(counts in prop::array::uniform32(0..2000_u32)) {
            let mut counts = counts;
            // Some symbols do not occur, but at least two do
            for count in &mut counts {
                *count = count.saturating_sub(500);
            }
            counts[3] += 1;
            counts[7] += 1;
            // Uniformly distributed counts give no codes longer than 15 bits
            prop_assert_eq!(check(&counts, 15), min_bits(&counts));
            prop_assert!(check(&counts, 6) >= min_bits(&counts));
        }
    }
}
