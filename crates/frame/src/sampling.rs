//! Samples of particles that are in some order.

use crate::generate::splitmix64;

/// At most `most` of the indices below `count`, rising: one of each of equal runs, at a pseudo-random place in it.
///
/// Particles are often stored in the order of a lattice. A sample at equal distances may contain only a few of the
/// layers of a lattice; this one contains about the same part of each.
pub fn sample_indices(count: usize, most: usize) -> impl Iterator<Item = usize> + Clone {
    let runs = most.min(count) as u64;
    (0..runs).map(move |run| {
        let [first, end] = [run, run + 1].map(|run| start(run, runs, count as u64));
        #[expect(clippy::cast_possible_truncation, reason = "below `count`")]
        let index = (first + splitmix64(0, run + 1) % (end - first)) as usize;
        index
    })
}

/// The first of `count` indices that belongs to `run` of `runs`.
fn start(run: u64, runs: u64, count: u64) -> u64 {
    #[expect(clippy::cast_possible_truncation, reason = "at most `count`")]
    let start = (u128::from(run) * u128::from(count) / u128::from(runs)) as u64;
    start
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_rise_and_have_one_index_of_each_run() {
        for (count, most) in [(0, 5), (5, 0), (5, 5), (3, 9), (10, 9), (1000, 7), (24_000, 2000)] {
            let sample: Vec<usize> = sample_indices(count, most).collect();
            assert_eq!(sample.len(), most.min(count));
            assert!(sample.is_sorted_by(|a, b| a < b));
            for (run, index) in sample.iter().enumerate() {
                let of_index = ((index + 1) * sample.len() - 1) / count;
                assert_eq!(of_index, run, "{count} {most}");
            }
        }
        assert!(sample_indices(4, 9).eq(0..4));
        let last = sample_indices(usize::MAX, 3).last();
        assert!(last.is_some_and(|last| last > usize::MAX / 3));
    }

    #[test]
    fn each_remainder_is_in_a_sample_equally_often() {
        for divisor in 2..=60 {
            let mut counts = vec![0; divisor];
            for index in sample_indices(60_000, 6000) {
                counts[index % divisor] += 1;
            }
            let expected = 6000 / divisor;
            let range = expected / 2..2 * expected;
            assert!(counts.iter().all(|count| range.contains(count)), "{counts:?}");
        }
    }
}
