//! Huffman codes of limited length.

/// Longest code of deflate.
pub(super) const MAX_BITS: usize = 15;

/// The code of a symbol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Code {
    /// As written: the first bit is the lowest.
    pub(super) bits: u16,
    /// How many; 0 if the symbol does not occur.
    pub(super) length: u8,
}

/// The codes of `N` symbols that occur so often, none longer than `limit` bits. Two at least must occur.
#[expect(clippy::cast_possible_truncation, reason = "lengths are at most 15")]
pub(super) fn codes<const N: usize>(counts: &[u32; N], limit: usize) -> [Code; N] {
    let mut codes = [Code::default(); N];
    // The rarest symbols first, and of those that are equally rare the lowest.
    let mut sorted = [(0, 0); N];
    let mut used = 0;
    for (symbol, count) in (0_u16..).zip(counts) {
        sorted[used] = (*count, symbol);
        used += usize::from(*count > 0);
    }
    let sorted = &mut sorted[..used];
    debug_assert!(used >= 2, "a code for one symbol is not complete");
    sorted.sort_unstable();
    let mut depths = [0; N];
    for (depth, (count, _)) in depths.iter_mut().zip(&*sorted) {
        *depth = *count;
    }
    code_lengths(&mut depths[..used]);
    let lengths = limited(&depths[..used], limit);
    // The rarest have the longest codes.
    let mut symbols = sorted.iter();
    for length in (1..=limit).rev() {
        for (_, symbol) in symbols.by_ref().take(lengths[length] as usize) {
            codes[usize::from(*symbol)].length = length as u8;
        }
    }
    number(&mut codes, &lengths);
    codes
}

/// Turns counts in ascending order into the lengths of Huffman's code, in place: Moffat and Katajainen, "In-Place
/// Calculation of Minimum-Redundancy Codes", 1995.
#[expect(
    clippy::cast_possible_truncation,
    reason = "there are fewer than 300 symbols"
)]
fn code_lengths(counts: &mut [u32]) {
    let used = counts.len();
    // Join the two lightest again and again; a joined node keeps its weight until it is joined itself, then its parent.
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
    // From parents to depths of joined nodes.
    counts[used - 2] = 0;
    for node in (0..used - 2).rev() {
        counts[node] = counts[counts[node] as usize] + 1;
    }
    // Leaves take what the joined nodes of each level leave.
    let (mut node, mut next) = (used - 1, used);
    let (mut room, mut depth) = (1, 0);
    while room > 0 {
        let mut joined = 0;
        while node > 0 && counts[node - 1] == depth {
            joined += 1;
            node -= 1;
        }
        for _ in joined..room {
            next -= 1;
            counts[next] = depth;
        }
        room = 2 * joined;
        depth += 1;
    }
}

/// How many codes have each length, if none may be longer than `limit`.
fn limited(depths: &[u32], limit: usize) -> [u32; MAX_BITS + 1] {
    let mut lengths = [0_u32; MAX_BITS + 1];
    for depth in depths {
        lengths[limit.min(*depth as usize)] += 1;
    }
    // What the codes take of the room for codes of the longest length.
    let taken = |lengths: &[u32]| -> u32 {
        let of_length = (1..=limit).map(|length| lengths[length] << (limit - length));
        of_length.sum()
    };
    // Each turn makes room for one more: a shorter code becomes two, one of which takes the place of a longest.
    for _ in (1 << limit)..taken(&lengths) {
        let shorter = (1..limit).rev().find(|length| lengths[*length] > 0);
        let shorter = shorter.expect("some code is shorter than the longest");
        lengths[shorter] -= 1;
        lengths[shorter + 1] += 2;
        lengths[limit] -= 1;
    }
    lengths
}

/// Numbers codes of one length one after the other (RFC 1951, section 3.2.2).
#[expect(
    clippy::cast_possible_truncation,
    reason = "there are fewer than 300 symbols"
)]
fn number(codes: &mut [Code], lengths: &[u32; MAX_BITS + 1]) {
    let mut next = [0_u16; MAX_BITS + 1];
    for length in 1..=MAX_BITS {
        // No code has length 0, so none is counted there.
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

    /// Bits of all symbols by Huffman's own procedure.
    fn least_bits(counts: &[u32]) -> u64 {
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
        let mut room = 0;
        let mut bits = 0;
        for (code, count) in codes.iter().zip(counts) {
            assert_eq!(code.length > 0, *count > 0);
            assert!(usize::from(code.length) <= limit);
            if code.length > 0 {
                room += 1_u64 << (limit - usize::from(code.length));
            }
            bits += u64::from(code.length) * u64::from(*count);
        }
        // Complete.
        assert_eq!(room, 1 << limit);
        // No code begins as another: read as numbers from the first bit on, those of one length follow one another.
        let mut sorted: Vec<&Code> = codes.iter().filter(|code| code.length > 0).collect();
        let place = |code: &Code| code.bits.reverse_bits();
        sorted.sort_by_key(|code| place(code));
        for pair in sorted.windows(2) {
            let width = 1_u32 << (16 - u32::from(pair[0].length));
            assert_eq!(u32::from(place(pair[1])), u32::from(place(pair[0])) + width);
            assert!(pair[0].length <= pair[1].length);
        }
        bits
    }

    #[test]
    fn codes_are_those_of_the_standard() {
        // RFC 1951, section 3.2.2: lengths 3, 3, 3, 3, 3, 2, 4, 4.
        let counts = [20, 20, 20, 20, 20, 40, 10, 10];
        let codes = codes(&counts, MAX_BITS);
        let bits: Vec<u16> = codes
            .iter()
            .map(|code| code.bits.reverse_bits() >> (16 - code.length))
            .collect();
        assert_eq!(
            bits,
            [0b010, 0b011, 0b100, 0b101, 0b110, 0b00, 0b1110, 0b1111]
        );
    }

    #[test]
    fn deep_codes_are_cut() {
        let mut counts = [0; 30];
        let (mut count, mut next) = (1, 1);
        for each in &mut counts {
            *each = count;
            (count, next) = (next, count + next);
        }
        let all: u64 = counts.iter().map(|count| u64::from(*count)).sum();
        for limit in [5, 7, 14, 15] {
            let bits = check(&counts, limit);
            assert!(bits >= least_bits(&counts) && bits <= all * limit as u64);
        }
        assert_eq!(check(&[1; 128], 7), 7 * 128);
        assert_eq!(
            check(&[0, 1, 0, u32::MAX / 2, 0], 7),
            1 + u64::from(u32::MAX / 2)
        );
    }

    proptest! {
        #[test]
        fn codes_are_complete_and_shortest(counts in prop::array::uniform32(0..2000_u32)) {
            let mut counts = counts;
            // Some do not occur, two at least do.
            for count in &mut counts {
                *count = count.saturating_sub(500);
            }
            counts[3] += 1;
            counts[7] += 1;
            // Deep trees need larger counts.
            prop_assert_eq!(check(&counts, 15), least_bits(&counts));
            prop_assert!(check(&counts, 6) >= least_bits(&counts));
        }
    }
}
