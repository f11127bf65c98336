//! Orders that place neighbouring particles near each other: along a space-filling curve, and by k-d cuts.

pub mod curve;
pub mod kd;
pub mod partition;

/// Converts a particle index to its stored type.
///
/// # Panics
/// If a frame holds 2^32 particles or more.
pub fn index_u32(index: usize) -> u32 {
    u32::try_from(index).expect("a frame holds fewer than 2^32 particles, checked by the builder")
}
