//! A hash for independent pseudo-random bits.

/// Increment of the state of SplitMix64 (Steele, Lea and Flood, 2014).
pub(super) const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// The output of SplitMix64 for `state`.
#[inline(always)]
pub(super) const fn mix(state: u64) -> u64 {
    let mut z = state.wrapping_add(STEP);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
