//! A product of many factors that does not depend on their order.

use spherule_tree::math::functions::{exp2, log2};

/// The transmittance along a ray: a product of factors from 0 to 1. Sums logarithms in fixed point, where addition is
/// exact in any order. Structures that find crossings in different orders get the same result to the bit, without
/// sorting.
#[derive(Debug, Clone, Copy, Default)]
pub struct TransmittanceProduct {
    /// Negated base-2 logarithm of the product, in units of 2^-32.
    loss: u64,
}

/// Loss beyond which the product counts as zero: 2^-32 of the light is less than a hundredth of the smallest number
/// that a half float can represent.
const MAX_LOSS: u64 = 32 << 32;
const UNIT: f64 = 4_294_967_296.0;

impl TransmittanceProduct {
    /// Multiplies the product by a factor from 0 to 1. Returns whether the product is still above zero; once it is
    /// not, further factors cannot change it.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "casts saturate, and a factor above 1 loses nothing"
    )]
    pub fn multiply(&mut self, factor: f32) -> bool {
        let loss = (f64::from(-log2(factor)) * UNIT) as u64;
        self.loss = self.loss.saturating_add(loss);
        self.loss <= MAX_LOSS
    }

    /// The negated base-2 logarithm of the product.
    #[expect(clippy::cast_possible_truncation, reason = "few digits are enough")]
    #[inline]
    pub fn digits(self) -> f32 {
        (self.loss as f64 / UNIT) as f32
    }

    /// The product.
    #[expect(clippy::cast_possible_truncation, reason = "light is f32")]
    #[inline]
    pub fn value(self) -> f32 {
        if self.loss > MAX_LOSS { 0.0 } else { exp2((-(self.loss as f64) / UNIT) as f32) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(factors: impl Iterator<Item = f32>) -> f32 {
        let mut transmittance = TransmittanceProduct::default();
        for factor in factors {
            transmittance.multiply(factor);
        }
        transmittance.value()
    }

    #[test]
    fn transmittance_does_not_depend_on_the_order() {
        let factors: Vec<f32> = (1..40).map(|i| 1.0 - i as f32 / 100.0).collect();
        let forwards = product(factors.iter().copied());
        let exact: f64 = factors.iter().map(|f| f64::from(*f)).product();
        assert!((f64::from(forwards) / exact - 1.0).abs() < 1e-6);
        assert_eq!(forwards.to_bits(), product(factors.into_iter().rev()).to_bits());
    }

    #[test]
    fn traversal_ends_at_zero_transmittance() {
        assert_eq!(product(std::iter::empty()), 1.0);
        assert_eq!(product([1.0, 1.0].into_iter()), 1.0);
        assert_eq!(product([0.5, 0.0].into_iter()), 0.0);
        let mut transmittance = TransmittanceProduct::default();
        assert!((0..31).all(|_| transmittance.multiply(0.5)), "2^-31 is left");
        assert!(!transmittance.multiply(0.25));
        assert_eq!(transmittance.value(), 0.0);
    }
}
