//! Frame rates.

use std::fmt;
use std::str::FromStr;

/// Frames per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameRate(f64);

/// The text is not a frame rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("expected frames per second from 0.1 to 240, such as 25 or 23.976")]
pub struct FrameRateError;

impl FrameRate {
    /// Most frames per second.
    const MAX: f64 = 240.0;
    /// Fewest frames per second.
    const MIN: f64 = 0.1;

    /// A rate from 0.1 to 240.
    ///
    /// # Errors
    /// [`FrameRateError`].
    pub fn new(rate: f64) -> Result<Self, FrameRateError> {
        if (Self::MIN..=Self::MAX).contains(&rate) { Ok(Self(rate)) } else { Err(FrameRateError) }
    }

    /// Frames per second.
    pub const fn per_second(self) -> f64 {
        self.0
    }

    /// The end of picture number `shown` in units of `1 / unit` seconds, rounded. Rounding ends instead of durations
    /// adds up no error.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a positive number of short units"
    )]
    pub(super) fn end(self, shown: u64, unit: f64) -> u64 {
        (shown as f64 * unit / self.0).round() as u64
    }
}

impl fmt::Display for FrameRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for FrameRate {
    type Err = FrameRateError;

    fn from_str(text: &str) -> Result<Self, FrameRateError> {
        Self::new(text.trim().parse().map_err(|_| FrameRateError)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_useful_rates_are_accepted() {
        assert_eq!("23.976".parse(), Ok(FrameRate(23.976)));
        for text in ["", "0", "-25", "nan", "inf", "1e9", "25fps"] {
            assert_eq!(text.parse::<FrameRate>(), Err(FrameRateError), "{text}");
        }
    }

    #[test]
    fn rounding_adds_up_no_error() {
        let rate = FrameRate::new(30.0).unwrap();
        let ends: Vec<u64> = (1..=6).map(|n| rate.end(n, 100.0)).collect();
        assert_eq!(ends, [3, 7, 10, 13, 17, 20]);
        assert_eq!(rate.end(3000, 100.0), 10_000);
    }
}
