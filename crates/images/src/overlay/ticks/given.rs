//! Ticks at values that users give.

use super::ends::significant_or_power;
use super::{Axis, Tick, Ticks, number};
use crate::scene::ColorScale;

/// Largest number of decimals of values without a format.
const MAX_DECIMALS: usize = 9;

impl Axis {
    /// Ticks at those of the `values` that are in the range.
    pub(super) fn given(&self, values: &[f64]) -> Ticks {
        // Sort the values that can be seen
        let mut inside: Vec<f64> = values.iter().copied().filter(|v| self.contains(*v)).collect();
        inside.sort_by(f64::total_cmp);
        inside.dedup();
        // As many decimals as all of them need
        let needs = |value: &f64| {
            let is_exact = |decimals: &usize| {
                let shown: f64 = format!("{value:.decimals$}").parse().unwrap_or(f64::NAN);
                (shown - value).abs() <= 1e-9 * value.abs()
            };
            (0..MAX_DECIMALS).find(is_exact).unwrap_or(MAX_DECIMALS)
        };
        let decimals = inside.iter().map(needs).max().unwrap_or(0);
        // Write each of them
        let text = |value: f64| match self.scale {
            ColorScale::Linear if value.abs() < 1e7 => number(value, decimals),
            _ => significant_or_power(value, self.has_plain_ends()),
        };
        let tick = |value: f64| Tick {
            position: self.position(value).clamp(0.0, 1.0),
            label: Some(self.label(value, text)),
        };
        Ticks { ticks: inside.into_iter().map(tick).collect(), exponent: 0, decimals }
    }

    /// Whether a value is on the bar.
    pub(super) fn contains(&self, value: f64) -> bool {
        let [low, high] = self.range;
        let slack = 1e-9 * (high - low);
        value >= low - slack && value <= high + slack
    }
}
