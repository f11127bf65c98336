//! The record that the cuts move for each particle, and the total order of the cuts.

use glam::Vec3;

/// A position, and a number that distinguishes equal positions: 16 bytes, moved as one value.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(16))]
pub(super) struct KeyedParticle {
    center: [f32; 3],
    number: u32,
}

impl KeyedParticle {
    pub(super) fn new(center: Vec3, number: u32) -> Self {
        Self { center: center.to_array(), number }
    }

    #[inline(always)]
    pub(super) fn center(&self) -> Vec3 {
        Vec3::from_array(self.center)
    }

    #[inline(always)]
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// The coordinate as an integer that orders the same.
    #[inline(always)]
    pub(super) fn place(&self, axis: usize) -> i32 {
        order_bits(self.center[axis])
    }

    /// The coordinate, then the number, as one integer.
    #[inline(always)]
    pub(super) fn key(&self, axis: usize) -> i64 {
        key(self.center[axis], self.number)
    }
}

/// Orders by coordinate, then by number.
#[inline(always)]
pub(super) fn key(coordinate: f32, number: u32) -> i64 {
    (i64::from(order_bits(coordinate)) << 32) | i64::from(number)
}

/// An integer that orders like `f32::total_cmp`, except that both zeros are equal: coincident particles have
/// equal keys.
#[inline(always)]
fn order_bits(value: f32) -> i32 {
    // The sum of -0 and 0 is 0.
    let bits = (value + 0.0).to_bits().cast_signed();
    bits ^ ((bits >> 31) & i32::MAX)
}

/// The axis of the largest component of `extent`; the first of equal ones.
pub(super) fn widest(extent: Vec3) -> usize {
    let [x, y, z] = extent.to_array();
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_order_by_coordinate_then_number() {
        let values = [f32::NEG_INFINITY, -2.5, -1e-40, -0.0, 0.0, 1e-40, 1.0, 3e38];
        let keys: Vec<i64> =
            values.iter().flat_map(|v| [0, 7, u32::MAX].map(|number| key(*v, number))).collect();
        let (zeros, others): (Vec<i64>, Vec<i64>) =
            keys.into_iter().partition(|key| *key >> 32 == 0);
        assert!(others.is_sorted_by(|a, b| a < b), "{others:?}");
        assert_eq!(zeros, [0, 7, u32::MAX, 0, 7, u32::MAX].map(i64::from));
    }
}
