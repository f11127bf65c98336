//! In-place partition by all threads, with the same result for any number of threads.
//!
//! Chunks of a fixed length are partitioned separately. Then runs on the wrong side of the global middle are swapped.

use std::ops::Range;

use rayon::prelude::*;

use super::reference::Reference;
use super::{CHUNK, is_large};

/// Moves the references that satisfy `is_first` to the front, and returns their number.
pub(super) fn partition(
    references: &mut [Reference],
    is_first: impl Fn(&Reference) -> bool + Sync,
) -> usize {
    if !is_large(references.len()) {
        return partition_chunk(references, &is_first);
    }
    // Partition each chunk separately
    let firsts: Vec<usize> =
        references.par_chunks_mut(CHUNK).map(|chunk| partition_chunk(chunk, &is_first)).collect();
    let middle = firsts.iter().sum();
    let len = references.len();
    let chunks = firsts.iter().enumerate().map(|(number, first)| {
        let start = number * CHUNK;
        (start, start + first, len.min(start + CHUNK))
    });
    // Swap the runs that lie on the wrong side of the middle
    let late = chunks.clone().map(|(_, cut, end)| cut..end.min(middle));
    let early = chunks.map(|(start, cut, _)| start.max(middle)..cut);
    let (lower, upper) = references.split_at_mut(middle);
    swap_runs(runs(lower, 0, late), runs(upper, middle, early));
    middle
}

fn partition_chunk(references: &mut [Reference], is_first: &impl Fn(&Reference) -> bool) -> usize {
    // Hoare's scheme: swap the first and last elements that are on the wrong side
    let (mut start, mut end) = (0, references.len());
    loop {
        while start < end && is_first(&references[start]) {
            start += 1;
        }
        while start < end && !is_first(&references[end - 1]) {
            end -= 1;
        }
        if start == end {
            return start;
        }
        end -= 1;
        references.swap(start, end);
        start += 1;
    }
}

/// The slices of `whole` at the ascending `ranges`; `base` is the index of the first element of `whole`.
fn runs(
    whole: &mut [Reference],
    base: usize,
    ranges: impl Iterator<Item = Range<usize>>,
) -> Vec<&mut [Reference]> {
    let (mut rest, mut at) = (whole, base);
    let mut runs = Vec::new();
    for range in ranges.filter(|range| range.start < range.end) {
        let (_, from) = rest.split_at_mut(range.start - at);
        let (run, after) = from.split_at_mut(range.len());
        runs.push(run);
        (rest, at) = (after, range.end);
    }
    runs
}

/// Swaps the elements of two lists of runs with the same total length.
fn swap_runs(late: Vec<&mut [Reference]>, early: Vec<&mut [Reference]>) {
    let (mut late, mut early) = (late.into_iter(), early.into_iter());
    let (mut a, mut b) = (late.next(), early.next());
    // Cut the runs into pairs of equal length
    let mut pairs = Vec::new();
    while let (Some(x), Some(y)) = (a.take(), b.take()) {
        let len = x.len().min(y.len());
        let (x, x_rest) = x.split_at_mut(len);
        let (y, y_rest) = y.split_at_mut(len);
        pairs.push((x, y));
        a = Some(x_rest).filter(|rest| !rest.is_empty()).or_else(|| late.next());
        b = Some(y_rest).filter(|rest| !rest.is_empty()).or_else(|| early.next());
    }
    pairs.into_par_iter().for_each(|(x, y)| x.swap_with_slice(y));
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::super::reference::Bounds;
    use super::*;

    #[test]
    fn large_set_is_partitioned_completely() {
        let count = 5 * CHUNK + 17;
        for modulus in [1, 2, 3, 1000, usize::MAX] {
            let bounds = Bounds { min: Vec3A::ZERO, max: Vec3A::ONE };
            let mut references: Vec<Reference> = (0..count)
                .map(|i| Reference::new(bounds, u32::try_from(i).expect("few")))
                .collect();
            // Whole runs on the wrong side, and mixed ones.
            let is_first = |r: &Reference| {
                let i = r.particle as usize;
                i.is_multiple_of(modulus) || i > 4 * CHUNK
            };
            let count = references.iter().filter(|r| is_first(r)).count();
            assert_eq!(partition(&mut references, is_first), count);
            assert!(references[..count].iter().all(is_first));
            assert!(!references[count..].iter().any(is_first));
            let mut particles: Vec<u32> = references.iter().map(|r| r.particle).collect();
            particles.sort_unstable();
            assert!(particles.iter().enumerate().all(|(i, p)| i == *p as usize));
        }
    }
}
