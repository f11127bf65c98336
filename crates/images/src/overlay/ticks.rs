//! Ticks of colour bars: round values with labels, for each scale.

use super::number_format::{NumberFormat, number, power_text};
use crate::scene::ColorScale;

mod bands;
mod ends;
mod given;
mod linear;
mod log;
mod symlog;

/// A mark of a colour bar.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Fraction of the length of the bar.
    pub position: f64,
    /// The label; None for a small mark.
    pub label: Option<String>,
}

/// The marks of a colour bar.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ticks {
    /// The marks, rising.
    pub ticks: Vec<Tick>,
    /// Power of ten that labels are multiplied by.
    pub exponent: i32,
    /// Decimals of the labels.
    decimals: usize,
}

/// A power of ten.
fn power(exponent: i32) -> f64 {
    // Exact, unlike a product of rounded factors
    format!("1e{exponent}").parse().unwrap_or(f64::INFINITY)
}

/// The smallest exponent of a normal number.
const MIN: i32 = -307;

/// The exponent of the largest power of ten that is at most `value`, which is above 0.
fn decade(value: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "below 400")]
    let mut exponent = libm::floor(libm::log10(value)).clamp(MIN.into(), 308.0) as i32;
    // The logarithm is rounded
    if power(exponent) > value {
        exponent -= 1;
    }
    if power(exponent + 1) <= value {
        exponent += 1;
    }
    exponent
}

/// Exponents whose powers of ten are written with zeros: 0.001 to 10000.
const PLAIN: std::ops::RangeInclusive<i32> = -3..=4;

/// Where ticks are wanted.
#[derive(Debug, Clone, PartialEq)]
pub enum TickChoice {
    /// At round values, with about so many labels.
    Count(u16),
    /// At these values, in the unit that the bar shows.
    Values(Vec<f64>),
}

/// What the ticks of a bar depend on.
#[derive(Debug, Clone, Copy)]
pub struct TickSettings<'a> {
    /// Values at the ends.
    pub range: [f64; 2],
    /// The scale.
    pub scale: ColorScale,
    /// The number of bands of a discrete map.
    pub steps: Option<u32>,
    /// What values are multiplied by before they are shown; above 0.
    pub factor: f64,
    /// Where ticks are wanted, if not at round values.
    pub choice: Option<&'a TickChoice>,
    /// How labels are written, if not as short as possible.
    pub format: Option<NumberFormat>,
}

impl TickSettings<'_> {
    fn axis(&self) -> Axis {
        let scale = match self.scale {
            ColorScale::SymLog { threshold } => {
                ColorScale::SymLog { threshold: threshold * self.factor }
            }
            scale => scale,
        };
        Axis { range: self.range.map(|value| value * self.factor), scale, format: self.format }
    }

    /// The values among those that are wanted which are not on the bar.
    pub fn outside(&self) -> Vec<f64> {
        let axis = self.axis();
        match self.choice {
            Some(TickChoice::Values(all)) => {
                all.iter().copied().filter(|value| !axis.contains(*value)).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The ticks with at most `most` labels, which is at least 2.
    pub fn ticks(&self, most: usize) -> Ticks {
        let axis = self.axis();
        // An empty range has one label
        let [low, high] = axis.range;
        if !(low < high && (high - low).is_normal()) {
            return axis.one(low);
        }
        // Choose how many labels there are
        let wanted = match self.choice {
            Some(TickChoice::Values(values)) => return axis.given(values),
            Some(TickChoice::Count(count)) => most.min(usize::from(*count)),
            None => most.min(USUAL),
        };
        let most = wanted.max(2);
        // Choose their places by the scale
        let ticks = match (self.steps, axis.scale) {
            (Some(steps), _) => return axis.bands(steps, most),
            (None, ColorScale::Linear) => axis.linear(most),
            (None, ColorScale::Log) => axis.log(most),
            (None, ColorScale::SymLog { threshold }) => axis.symlog(threshold, most),
        };
        // Label the ends too, if there is space
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let gap = GAP / most as f64;
        axis.label_ends(ticks, gap)
    }
}

/// Most labels unless a number is wanted.
const USUAL: usize = 9;

/// Distance of labels from those of the ends, in units of the distance of labels.
const GAP: f64 = 0.8;

/// The exponent to take out of the labels of a range.
fn common_exponent(low: f64, high: f64) -> i32 {
    let largest = low.abs().max(high.abs());
    if !(largest > 0.0 && largest.is_finite()) {
        return 0;
    }
    match decade(largest) {
        exponent if (-2..5).contains(&exponent) => 0,
        exponent => exponent,
    }
}

/// `value` with three significant digits, without zeros at the end.
fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return number(value, 0);
    }
    let decimals = usize::try_from(2 - decade(value.abs())).unwrap_or(0);
    let text = number(value, decimals);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A range on a scale.
struct Axis {
    range: [f64; 2],
    scale: ColorScale,
    format: Option<NumberFormat>,
}

impl Axis {
    /// Fraction of the length at a value.
    fn position(&self, value: f64) -> f64 {
        let [low, high] = self.range.map(|value| self.scale.forward(value));
        (self.scale.forward(value) - low) / (high - low)
    }

    fn tick(&self, value: f64, label: Option<String>) -> Tick {
        Tick { position: self.position(value).clamp(0.0, 1.0), label }
    }

    /// `value` in the given format, or else as `usual`.
    fn label(&self, value: f64, usual: impl Fn(f64) -> String) -> String {
        self.format.map_or_else(|| usual(value), |format| format.write(value))
    }

    /// The tick of a range of one value.
    fn one(&self, value: f64) -> Ticks {
        let exponent = match self.format {
            Some(_) => 0,
            None => common_exponent(value, value),
        };
        let label = self.label(value, |value| significant(value / power(exponent)));
        Ticks { ticks: vec![Tick { position: 0.5, label: Some(label) }], exponent, decimals: 0 }
    }
}

/// A power of ten with zeros or with an exponent.
fn decade_text(exponent: i32, is_plain: bool) -> String {
    if is_plain {
        number(power(exponent), usize::try_from(-exponent).unwrap_or(0))
    } else {
        power_text(exponent)
    }
}

#[cfg(test)]
#[path = "ticks_tests.rs"]
mod tests;
