//! An axis: its range and its ticks.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// The scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Linear.
    #[default]
    Linear,
    /// Logarithmic; values up to zero cannot be shown.
    Log,
}

/// The properties of an axis; its range depends on the data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axis {
    title: String,
    scale: Scale,
    from_zero: bool,
    whole: bool,
}

impl Axis {
    /// A linear axis. `title` names the quantity and its unit.
    pub fn linear(title: impl Into<String>) -> Self {
        Self { title: title.into(), scale: Scale::Linear, from_zero: false, whole: false }
    }

    /// A logarithmic axis.
    pub fn log(title: impl Into<String>) -> Self {
        Self { scale: Scale::Log, ..Self::linear(title) }
    }

    /// Includes zero, so that heights can be compared; has no effect on a logarithmic axis.
    #[must_use]
    pub const fn from_zero(mut self) -> Self {
        self.from_zero = true;
        self
    }

    /// Ticks only at integers, for counts and frame numbers.
    #[must_use]
    pub const fn whole(mut self) -> Self {
        self.whole = true;
        self
    }

    pub(super) fn title(&self) -> &str {
        &self.title
    }

    pub(super) fn is_log(&self) -> bool {
        self.scale == Scale::Log
    }

    /// Position of `value` on the axis; NaN if it cannot be shown. Values above 1e100 count as infinite, so that sums
    /// and differences of the others are finite.
    pub(super) fn place(&self, value: f64) -> f64 {
        match self.scale {
            _ if value.abs() > 1e100 => f64::NAN,
            Scale::Linear => value,
            Scale::Log if value < 1e-100 => f64::NAN,
            Scale::Log => value.log10(),
        }
    }

    /// The axis over positions from `low` to `high`, both finite, with about `tick_count` ticks.
    pub(super) fn span(&self, low: f64, high: f64, tick_count: f64) -> Span {
        match self.scale {
            Scale::Linear => self.linear_span(low, high, tick_count),
            Scale::Log => log_span(low, high, tick_count),
        }
    }

    fn linear_span(&self, mut low: f64, mut high: f64, tick_count: f64) -> Span {
        if self.from_zero {
            low = low.min(0.0);
            high = high.max(0.0);
        }
        // Widen a range that is empty or too small for distinct ticks
        if high - low <= 1e-9 * high.abs().max(low.abs()) {
            let wanted = if self.whole { (1e-6 * high.abs()).max(1.0) } else { 0.5 * high.abs() };
            let half = if wanted > 0.0 { wanted } else { 1.0 };
            (low, high) = (low - half, high + half);
        }
        // Choose the distance between ticks
        let mut step = nice_step((high - low) / tick_count);
        if self.whole {
            step = step.max(1.0);
        }
        // Add a margin for markers at the edge
        if !self.whole {
            let air = 0.05 * (high - low);
            let keeps = |end: f64| self.from_zero && end == 0.0;
            high += if keeps(high) { 0.0 } else { air };
            low -= if keeps(low) { 0.0 } else { air };
        }
        // Place the ticks; the slack prevents rounding from removing the first or the last one
        let first = (low / step - 1e-9).ceil();
        let count = (high / step + 1e-9).floor() - first;
        let largest = high.abs().max(low.abs());
        let mut ticks = Vec::new();
        let mut i = 0.0;
        while i <= count {
            let value = (first + i) * step;
            ticks.push((value, label(value, step, largest)));
            i += 1.0;
        }
        Span { low, high, ticks }
    }
}

/// The range of an axis in positions, and its ticks with their labels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Span {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) ticks: Vec<(f64, String)>,
}

impl Ranged for Span {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, limit: (i32, i32)) -> i32 {
        let (start, end) = (f64::from(limit.0), f64::from(limit.1));
        let at = start + (place - self.low) / (self.high - self.low) * (end - start);
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and the axis holds it")]
        let at = at.round() as i32;
        at
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Without finer lines between the ticks.
        if hint.weight().allow_light_points() {
            return Vec::new();
        }
        self.ticks.iter().map(|(at, _)| *at).collect()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Span {
    fn format_ext(&self, place: &f64) -> String {
        let tick = self.ticks.iter().find(|(at, _)| at == place);
        tick.map_or_else(String::new, |(_, label)| label.clone())
    }
}

/// 1, 2 or 5 times a power of ten, at least `least`.
fn nice_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= least * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// `value` with the number of decimals that `step` requires, on an axis up to `largest`.
fn label(value: f64, step: f64, largest: f64) -> String {
    // Rounding may leave a tiny or negative zero.
    let value = if value.abs() < 0.5 * step { 0.0 } else { value };
    if largest >= 1e6 || step < 1e-4 {
        return if value == 0.0 { "0".to_owned() } else { scientific(value, step) };
    }
    let decimals = (0..5).find(|d| {
        let scaled = step * 10f64.powi(*d);
        (scaled - scaled.round()).abs() < 1e-6
    });
    let text = format!("{value:.*}", usize::try_from(decimals.unwrap_or(5)).unwrap_or(5));
    minus(&text)
}

/// In the form `1.25e6`, with enough digits to distinguish it from its neighbours.
fn scientific(value: f64, step: f64) -> String {
    let digits = (value.abs().log10().floor() - step.log10().floor()).clamp(0.0, 8.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 8")]
    let text = format!("{value:.*e}", digits as usize);
    match text.split_once('e') {
        Some((mantissa, power)) if mantissa.contains('.') => {
            let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
            minus(&format!("{mantissa}e{power}"))
        }
        _ => minus(&text),
    }
}

/// With a minus sign that is as wide as a digit.
fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

/// The range extended to the next 1, 2 or 5 times a power of ten; ticks at these, or only at powers.
fn log_span(low: f64, high: f64, tick_count: f64) -> Span {
    const SLACK: f64 = 1e-9;
    // Steps of about a third of a decade: 3k, 3k+1, 3k+2 are 1, 2 and 5 times 10^k
    let place = |step: f64| {
        let decade = (step / 3.0).floor();
        let factor = [1.0f64, 2.0, 5.0];
        let third = step - 3.0 * decade;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0, 1, 2")]
        let factor = factor[third as usize];
        (decade + factor.log10(), decade, factor)
    };
    // Find the first and the last step
    let mut first = 3.0 * low.floor();
    while place(first + 1.0).0 <= low + SLACK {
        first += 1.0;
    }
    let mut last = first + 1.0;
    while place(last).0 < high - SLACK {
        last += 1.0;
    }
    // A single value would be at the edge.
    if place(first).0 >= low - SLACK && high - low < SLACK {
        first -= 1.0;
    }
    // Place the ticks
    let decades = (last - first) / 3.0;
    let every = (decades / tick_count).ceil().max(1.0);
    // Do not mix notations such as 10000 and 1e5.
    let is_plain = low >= -4.0 && high < 5.0;
    let mut ticks = Vec::new();
    let mut step = first;
    while step <= last {
        let (at, decade, factor) = place(step);
        let shown = decades <= 2.0 || (factor == 1.0 && decade % every == 0.0);
        if shown {
            ticks.push((at, log_label(decade, factor, is_plain)));
        }
        step += 1.0;
    }
    Span { low: place(first).0, high: place(last).0, ticks }
}

/// `factor` times ten to the `decade`; written in full if that is short, or on the whole axis.
fn log_label(decade: f64, factor: f64, is_plain: bool) -> String {
    if is_plain || (-3.0..=3.0).contains(&decade) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4")]
        let decimals = (-decade).max(0.0) as usize;
        let value = factor * 10f64.powf(decade);
        return format!("{value:.decimals$}");
    }
    minus(&format!("{factor:.0}e{decade:.0}"))
}
