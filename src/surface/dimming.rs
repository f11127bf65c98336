//! A product of many factors that does not depend on their order.

use crate::math::functions::{exp2, log2};

/// Adds up logarithms in fixed point, where addition is exact in any order: structures that find
/// crossings in different orders come to the same light to the bit, without sorting.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Dimming {
    /// Minus the logarithm of the product to base 2, in units of 2^-32.
    loss: u64,
}

/// Loss beyond which nothing is left: 2^-32 of the light is less than a hundredth of the smallest number that a half
/// float holds.
const DARK: u64 = 32 << 32;
const UNIT: f64 = 4_294_967_296.0;

impl Dimming {
    /// Multiplies by `kept`, from 0 to 1. Returns whether any light is left, which more factors
    /// cannot bring back.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "casts saturate, and a factor above 1 loses nothing"
    )]
    pub(crate) fn by(&mut self, kept: f32) -> bool {
        let loss = (f64::from(-log2(kept)) * UNIT) as u64;
        self.loss = self.loss.saturating_add(loss);
        self.loss <= DARK
    }

    /// The product.
    #[expect(clippy::cast_possible_truncation, reason = "light is f32")]
    pub(crate) fn product(self) -> f32 {
        if self.loss > DARK {
            0.0
        } else {
            exp2((-(self.loss as f64) / UNIT) as f32)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(factors: impl Iterator<Item = f32>) -> f32 {
        let mut dimming = Dimming::default();
        for factor in factors {
            dimming.by(factor);
        }
        dimming.product()
    }

    #[test]
    fn is_the_product_in_any_order() {
        let factors: Vec<f32> = (1..40).map(|i| 1.0 - i as f32 / 100.0).collect();
        let forwards = product(factors.iter().copied());
        let exact: f64 = factors.iter().map(|f| f64::from(*f)).product();
        assert!((f64::from(forwards) / exact - 1.0).abs() < 1e-6);
        assert_eq!(
            forwards.to_bits(),
            product(factors.into_iter().rev()).to_bits()
        );
    }

    #[test]
    fn ends_in_the_dark() {
        assert_eq!(product(std::iter::empty()), 1.0);
        assert_eq!(product([1.0, 1.0].into_iter()), 1.0);
        assert_eq!(product([0.5, 0.0].into_iter()), 0.0);
        let mut dimming = Dimming::default();
        assert!((0..31).all(|_| dimming.by(0.5)), "2^-31 is left");
        assert!(!dimming.by(0.25));
        assert_eq!(dimming.product(), 0.0);
    }
}
