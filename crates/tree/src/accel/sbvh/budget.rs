//! The reference budget: how many references spatial splits may add, and how that number is distributed.
//!
//! The memory for all references is allocated once, at the size that the budget allows. Every split distributes the
//! free part of its node between the two children (as in Fuetterling, Lojewski, Pfreundt & Ebert 2016, "Parallel
//! spatial splits in bounding volume hierarchies"). So memory is bounded, threads need no communication, and the tree
//! does not depend on their number.

use crate::blocks::BLOCK_SIZE;

/// Number of references to allocate: one per particle, and `budget` times as many for spatial splits.
pub(super) fn capacity(particles: usize, budget: f32) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "rounded down, clamped just below, and NaN becomes 0"
    )]
    let duplicates = (particles as f64 * f64::from(budget)) as u64;
    let most = u64::from(u32::MAX);
    let capacity = (particles as u64).saturating_add(duplicates).min(most);
    usize::try_from(capacity).unwrap_or(usize::MAX).max(particles)
}

/// Distributes `free` slots between two children in proportion to their reference counts.
pub(super) fn share(free: usize, counts: [usize; 2]) -> [usize; 2] {
    let [below, above] = counts.map(|count| count as u128);
    let share = free as u128 * below / (below + above).max(1);
    let first = usize::try_from(share).expect("no more than all that are free");
    [first, free - first]
}

/// About half of `count`, less than `count`, and a multiple of the block size if possible.
pub(super) fn half_in_blocks(count: usize) -> usize {
    let half = count.div_ceil(2);
    let filled = half.next_multiple_of(BLOCK_SIZE);
    if filled < count { filled } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reserved_space_is_bounded() {
        assert_eq!(capacity(1000, 0.0), 1000);
        assert_eq!(capacity(1000, 0.25), 1250);
        assert_eq!(capacity(1000, f32::NAN), 1000);
        assert_eq!(capacity(1000, -1.0), 1000);
        assert_eq!(capacity(10, f32::MAX), u32::MAX as usize);
    }

    #[test]
    fn shares_add_up() {
        assert_eq!(share(10, [1, 1]), [5, 5]);
        assert_eq!(share(10, [0, 3]), [0, 10]);
        assert_eq!(share(7, [2, 1]), [4, 3]);
        assert_eq!(share(usize::MAX, [1, 0]), [usize::MAX, 0]);
    }

    #[test]
    fn halves_fill_blocks_where_they_can() {
        assert_eq!(half_in_blocks(2), 1);
        assert_eq!(half_in_blocks(17), 16);
        assert_eq!(half_in_blocks(33), 32);
        assert_eq!(half_in_blocks(100), 64);
    }
}
