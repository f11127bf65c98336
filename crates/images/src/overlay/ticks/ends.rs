//! Labels of both ends of a bar, and labels that would overlap.

use super::{Axis, PLAIN, Tick, Ticks, decade, number, power, power_text, significant};
use crate::scene::ColorScale;

/// Ends are written to this part of the range.
const RESOLUTION: f64 = 0.01;

impl Axis {
    /// Labels both ends of the range. Ticks less than `gap`, a fraction of the length, from an end lose their label.
    pub(super) fn label_ends(&self, mut ticks: Ticks, gap: f64) -> Ticks {
        for (end, value) in [0.0, 1.0].into_iter().zip(self.range) {
            let has_label =
                |tick: &Tick| tick.label.is_some() && (tick.position - end).abs() < 1e-9;
            if ticks.ticks.iter().any(has_label) {
                continue;
            }
            let label = self.label(value, |value| self.end_text(value, &ticks));
            ticks.ticks.retain(|tick| (tick.position - end).abs() >= 1e-9);
            for tick in &mut ticks.ticks {
                if (tick.position - end).abs() < gap {
                    tick.label = None;
                }
            }
            ticks.ticks.push(Tick { position: end, label: Some(label) });
        }
        ticks.ticks.sort_by(|a, b| a.position.total_cmp(&b.position));
        ticks
    }

    /// Whether numbers of the size of both ends are written without a power of ten.
    pub(super) fn has_plain_ends(&self) -> bool {
        let is_plain = |value: f64| value == 0.0 || PLAIN.contains(&decade(value.abs()));
        self.range.into_iter().all(is_plain)
    }

    /// The text of an end without a format.
    fn end_text(&self, value: f64, ticks: &Ticks) -> String {
        if self.scale != ColorScale::Linear && ticks.exponent == 0 {
            return significant_or_power(value, self.has_plain_ends());
        }
        let [low, high] = self.range;
        let decimals = ticks.exponent - decade(RESOLUTION * (high - low));
        let mut text =
            number(value / power(ticks.exponent), usize::try_from(decimals).unwrap_or(0));
        // No more zeros than the other labels have
        while let Some((_, part)) = text.split_once('.')
            && part.len() > ticks.decimals
            && text.ends_with('0')
        {
            text.pop();
        }
        text.trim_end_matches('.').to_owned()
    }
}

/// `value` with three digits; as the multiple of a power of ten unless numbers are plain.
pub(super) fn significant_or_power(value: f64, is_plain: bool) -> String {
    let size = value.abs();
    if size == 0.0 || !size.is_finite() || is_plain {
        return significant(value);
    }
    let exponent = decade(size);
    let sign = if value < 0.0 { "\u{2212}" } else { "" };
    match significant(size / power(exponent)) {
        one if one == "1" => format!("{sign}{}", power_text(exponent)),
        digits => format!("{sign}{digits}\u{d7}{}", power_text(exponent)),
    }
}

impl Ticks {
    /// Removes labels that would come closer than `space` to those before them. `half` is half the length of a label;
    /// both are fractions of the length of the bar.
    pub fn thin(&mut self, space: f64, half: impl Fn(&str) -> f64) {
        let mut end = f64::NEG_INFINITY;
        for tick in &mut self.ticks {
            let Some(half) = tick.label.as_deref().map(&half) else {
                continue;
            };
            if tick.position - half < end + space {
                tick.label = None;
            } else {
                end = tick.position + half;
            }
        }
    }
}
