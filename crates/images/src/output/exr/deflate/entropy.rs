//! Estimates the number of bits of symbols with an optimal code, from their entropy.

use super::matches::Sequence;
use super::symbols::{DISTANCES, END, LENGTH_VALUES, SYMBOLS, distance_value};

/// The number of occurrences of each symbol.
#[derive(Debug, Clone)]
pub(super) struct Histogram {
    /// Literals and lengths.
    pub(super) symbols: [u32; SYMBOLS],
    pub(super) distances: [u32; DISTANCES],
    /// Total number of literals and lengths, and of distances.
    pub(super) counts: [u32; 2],
}

impl Default for Histogram {
    fn default() -> Self {
        Self { symbols: [0; SYMBOLS], distances: [0; DISTANCES], counts: [0; 2] }
    }
}

impl Histogram {
    /// Counts the symbols of `sequences`, which begin at `start` of `data`.
    pub(super) fn of(data: &[u8], start: usize, sequences: &[Sequence]) -> Self {
        let mut histogram = Self::default();
        // Four sets of counters: equal bytes often follow each other, and would have to wait for the same counter
        let mut literals = [[0_u32; END]; 4];
        let mut at = start;
        // Count literals, then the copy that follows them
        for sequence in sequences {
            let end = at + sequence.literals as usize;
            let (fours, rest) = data[at..end].as_chunks::<4>();
            for four in fours {
                for (counters, byte) in literals.iter_mut().zip(four) {
                    counters[usize::from(*byte)] += 1;
                }
            }
            for byte in rest {
                literals[0][usize::from(*byte)] += 1;
            }
            at = end + usize::from(sequence.length);
            histogram.counts[0] += sequence.literals;
            if sequence.length > 0 {
                let length = LENGTH_VALUES[usize::from(sequence.length)];
                let distance = distance_value(sequence.distance);
                histogram.symbols[usize::from(length.symbol)] += 1;
                histogram.distances[usize::from(distance.symbol)] += 1;
                histogram.counts[0] += 1;
                histogram.counts[1] += 1;
            }
        }
        // Add the sets of counters
        for counters in literals {
            add(&mut histogram.symbols[..END], &counters);
        }
        histogram
    }

    /// Adds the counts of `other`.
    pub(super) fn add(&mut self, other: &Self) {
        add(&mut self.symbols, &other.symbols);
        add(&mut self.distances, &other.distances);
        add(&mut self.counts, &other.counts);
    }

    /// Approximate number of bits of all symbols, without their extra bits.
    pub(super) fn cost(&self) -> u64 {
        self.cost_with(&Self::default())
    }

    /// The cost of the symbols of both histograms together.
    pub(super) fn cost_with(&self, other: &Self) -> u64 {
        let sum = |a: &[u32], b: &[u32]| -> u64 {
            let both = a.iter().zip(b);
            both.map(|(a, b)| count_log_count(a + b)).sum()
        };
        // Entropy: a symbol that occurs c times among n symbols costs log n - log c bits each time
        let totals = sum(&self.counts, &other.counts);
        let symbols = sum(&self.symbols, &other.symbols) + sum(&self.distances, &other.distances);
        (totals - symbols) >> FRACTION
    }
}

fn add(counters: &mut [u32], others: &[u32]) {
    for (counter, other) in counters.iter_mut().zip(others) {
        *counter += other;
    }
}

/// Number of fractional bits of a logarithm.
const FRACTION: u32 = 16;
/// The table has the logarithms of the numbers below 2 to this power.
const TABLE_BITS: u32 = 11;

/// `count` times its binary logarithm, with [`FRACTION`] fractional bits.
#[inline(always)]
fn count_log_count(count: u32) -> u64 {
    let shift = (u32::BITS - TABLE_BITS).saturating_sub(count.leading_zeros());
    let logarithm = LOGARITHMS[(count >> shift) as usize] + (shift << FRACTION);
    u64::from(count) * u64::from(logarithm)
}

/// Binary logarithms; the entry of 0 is 0.
static LOGARITHMS: [u32; 1 << TABLE_BITS] = logarithms();

/// Computes the table by repeated squaring of integers, so that it is the same on all machines.
const fn logarithms() -> [u32; 1 << TABLE_BITS] {
    let mut table = [0; 1 << TABLE_BITS];
    let mut number = 1;
    while number < table.len() {
        let whole = number.ilog2();
        // A number from 1 to 2, with 31 fractional bits
        let mut power = (number as u64) << (31 - whole);
        let mut logarithm = whole;
        let mut digit = 0;
        while digit < FRACTION {
            // Squaring doubles the logarithm, so that its next binary digit is before the point
            power = (power * power) >> 31;
            logarithm <<= 1;
            if power >> 32 > 0 {
                power >>= 1;
                logarithm += 1;
            }
            digit += 1;
        }
        table[number] = logarithm;
        number += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_accurate() {
        for count in (1..5000).chain([65_535, 65_536, 1 << 24, u32::MAX - 1]) {
            let expected = f64::from(count) * f64::from(count).log2();
            let found = count_log_count(count) as f64 / f64::from(1 << FRACTION);
            assert!((found - expected).abs() <= 0.0015 * f64::from(count), "{count}");
        }
        assert_eq!(count_log_count(0), 0);
    }

    #[test]
    fn costs_are_entropies() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.cost(), 0);
        histogram.symbols[..4].fill(250);
        histogram.counts = [1000, 0];
        assert!(histogram.cost().abs_diff(2000) <= 2);
        let mut other = Histogram::default();
        other.symbols[4..8].fill(250);
        other.counts = [1000, 0];
        assert!(histogram.cost_with(&other).abs_diff(6000) <= 4);
        histogram.add(&other);
        assert!(histogram.cost().abs_diff(6000) <= 4);
        other.symbols.fill(0);
        other.symbols[9] = 77;
        other.counts = [77, 0];
        assert_eq!(other.cost(), 0);
        other.distances[3..5].fill(10);
        other.counts[1] = 20;
        assert!(other.cost().abs_diff(20) <= 1);
    }
}
