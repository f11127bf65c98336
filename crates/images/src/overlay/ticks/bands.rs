//! Ticks of discrete maps.

use super::{Axis, Tick, Ticks, common_exponent, number, power, significant};
use crate::scene::ColorScale;

impl Axis {
    /// The borders of bands of one colour.
    pub(super) fn bands(&self, steps: u32, most: usize) -> Ticks {
        // Find the borders, as multiples of a common power of ten
        let [low, high] = self.range.map(|value| self.scale.forward(value));
        let exponent = match self.format {
            Some(_) => 0,
            None => common_exponent(self.range[0], self.range[1]),
        };
        let part = |i: u32| f64::from(i) / f64::from(steps);
        let value = |i: u32| match i {
            0 => self.range[0],
            i if i == steps => self.range[1],
            i => self.scale.inverse(low + part(i) * (high - low)),
        };
        let values: Vec<f64> = (0..=steps).map(|i| value(i) / power(exponent)).collect();
        // Use the fewest decimals that show all values
        let step = values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        // Label every so many, such that both ends have a label
        let stride = values.len().div_ceil(most).max(1);
        let stride =
            (stride..=values.len()).find(|stride| (values.len() - 1).is_multiple_of(*stride));
        let stride = stride.unwrap_or(1);
        let is_shown = |decimals: &usize| {
            let scale = power(i32::try_from(*decimals).unwrap_or(0));
            let error = |v: &f64| ((v * scale).round() / scale - v).abs();
            values.iter().step_by(stride).all(|v| error(v) < 0.02 * step)
        };
        let decimals = (0..8).find(is_shown).unwrap_or(8);
        // Make the ticks
        let ticks = values.iter().enumerate().zip(0..=steps).map(|((at, value), i)| Tick {
            position: part(i),
            label: (at % stride == 0).then(|| {
                self.label(*value, |value| match self.scale {
                    ColorScale::Linear => number(value, decimals),
                    _ => significant(value),
                })
            }),
        });
        Ticks { ticks: ticks.collect(), exponent, decimals }
    }
}
