//! Ticks of colour bars: round values with labels, for each scale.

use crate::scene::ColorScale;

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
}

/// A power of ten.
fn power(exponent: i32) -> f64 {
    // Exact, unlike a product of rounded factors
    format!("1e{exponent}").parse().unwrap_or(f64::INFINITY)
}

/// The smallest exponent of a normal number.
const LEAST: i32 = -307;

/// The exponent of the largest power of ten that is at most `value`, which is above 0.
fn decade(value: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "below 400")]
    let mut exponent = libm::floor(libm::log10(value)).clamp(LEAST.into(), 308.0) as i32;
    // The logarithm is rounded
    if power(exponent) > value {
        exponent -= 1;
    }
    if power(exponent + 1) <= value {
        exponent += 1;
    }
    exponent
}

/// `value` with `decimals`, with the sign that mathematics uses.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    match text.strip_prefix('-') {
        Some(digits) if is_zero => digits.to_owned(),
        Some(digits) => format!("\u{2212}{digits}"),
        None => text,
    }
}

/// `10` to the power of `exponent`, as text.
pub(super) fn power_text(exponent: i32) -> String {
    let superscript = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32(0x2070 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    };
    let digits = exponent.to_string();
    format!("10{}", digits.chars().map(superscript).collect::<String>())
}

/// Exponents whose powers of ten are written with zeros: 0.001 to 10000.
const PLAIN: std::ops::RangeInclusive<i32> = -3..=4;

impl Ticks {
    /// The ticks of a range with at most `most` labels, which is at least 2. With `steps`, they are at the borders of
    /// the bands of a discrete map.
    pub fn of(range: [f64; 2], scale: ColorScale, steps: Option<u32>, most: usize) -> Self {
        let [low, high] = range;
        if !(low < high && (high - low).is_normal()) {
            return Self::of_one(low);
        }
        let axis = Axis { range, scale };
        let most = most.max(2);
        match (steps, scale) {
            (Some(steps), _) => axis.bands(steps, most),
            (None, ColorScale::Linear) => axis.linear(most),
            (None, ColorScale::Log) => axis.log(most),
            (None, ColorScale::SymLog { threshold }) => axis.symlog(threshold, most),
        }
    }

    /// The tick of a range of one value.
    fn of_one(value: f64) -> Self {
        let exponent = common_exponent(value, value);
        let label = significant(value / power(exponent));
        Self { ticks: vec![Tick { position: 0.5, label: Some(label) }], exponent }
    }
}

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
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// A range on a scale.
struct Axis {
    range: [f64; 2],
    scale: ColorScale,
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

    /// Multiples of 1, 2 or 5 times a power of ten.
    fn linear(&self, most: usize) -> Ticks {
        let [low, high] = self.range;
        let exponent = common_exponent(low, high);
        // Find the smallest step that gives few enough labels
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let raw = (high - low) / (most - 1).max(1) as f64;
        let smallest = decade(raw);
        let candidates = (smallest - 1..=smallest + 1)
            .flat_map(|exponent| [1, 2, 5].map(|digit| (digit, exponent)));
        let multiples = |digit: i32, exponent: i32| {
            let step = f64::from(digit) * power(exponent);
            let slack = 1e-9 * (high - low);
            let first = ((low - slack) / step).ceil();
            let last = ((high + slack) / step).floor();
            (step, first, last)
        };
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let fits = |(digit, exponent): &(i32, i32)| {
            let (_, first, last) = multiples(*digit, *exponent);
            last - first < most as f64
        };
        let mut candidates = candidates.filter(fits);
        let (digit, step_exponent) = candidates.next().unwrap_or((1, smallest + 2));
        let (step, first, last) = multiples(digit, step_exponent);
        let decimals = usize::try_from(exponent - step_exponent).unwrap_or(0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few: checked above"
        )]
        let count = (last - first + 1.0).clamp(0.0, 100.0) as usize;
        let ticks = (0..count).map(|i| {
            #[expect(clippy::cast_precision_loss, reason = "a few")]
            let multiple = first + i as f64;
            let label = number(multiple * step / power(exponent), decimals);
            self.tick(multiple * step, Some(label))
        });
        Ticks { ticks: ticks.collect(), exponent }
    }

    /// Powers of ten with small marks between them; in short ranges, 1, 2 and 5 times powers of ten, or round values.
    fn log(&self, most: usize) -> Ticks {
        let [low, high] = self.range;
        if low <= 0.0 {
            return Ticks::default();
        }
        let slack = 1e-9;
        let is_inside = |value: f64| value >= low * (1.0 - slack) && value <= high * (1.0 + slack);
        let decades = decade(low)..=decade(high * (1.0 + slack));
        let within = decades.clone().filter(|e| is_inside(power(*e))).count();
        let is_plain = decades.clone().all(|e| PLAIN.contains(&e));
        if within < 3 {
            // Few powers of ten
            let values =
                decades.flat_map(|e| [1, 2, 5].map(|digit| (f64::from(digit) * power(e), e)));
            let values: Vec<(f64, i32)> = values.filter(|(value, _)| is_inside(*value)).collect();
            if values.len() < 3 || values.len() > most || !is_plain {
                let few = self.linear(most.min(5));
                return if within < 2 { few } else { self.decades(most, is_plain) };
            }
            let label = |(value, e): (f64, i32)| {
                let decimals = usize::try_from(-e).unwrap_or(0);
                self.tick(value, Some(number(value, decimals)))
            };
            return Ticks { ticks: values.into_iter().map(label).collect(), exponent: 0 };
        }
        self.decades(most, is_plain)
    }

    /// Powers of ten, with small marks at their multiples.
    fn decades(&self, most: usize, is_plain: bool) -> Ticks {
        let [low, high] = self.range;
        let slack = 1e-9;
        let is_inside = |value: f64| value >= low * (1.0 - slack) && value <= high * (1.0 + slack);
        let all: Vec<i32> = (decade(low)..=decade(high * (1.0 + slack))).collect();
        let stride = all.len().div_ceil(most).max(1);
        let mut ticks = Vec::new();
        for exponent in all {
            let is_labelled = exponent.rem_euclid(i32::try_from(stride).unwrap_or(i32::MAX)) == 0;
            let label = is_labelled.then(|| decade_text(exponent, is_plain));
            let between = if stride == 1 { 2..10 } else { 2..2 };
            let value = power(exponent);
            let marks = between.map(|digit| (f64::from(digit) * value, None));
            for (value, label) in std::iter::once((value, label)).chain(marks) {
                if is_inside(value) {
                    ticks.push(self.tick(value, label));
                }
            }
        }
        Ticks { ticks, exponent: 0 }
    }

    /// Zero, the ends of the linear part, and powers of ten beyond.
    fn symlog(&self, threshold: f64, most: usize) -> Ticks {
        let [low, high] = self.range;
        let is_inside = |value: &f64| (low..=high).contains(value);
        let largest = low.abs().max(high.abs());
        let powers = decade(threshold)..=decade(largest);
        let is_plain = powers.clone().all(|e| PLAIN.contains(&e));
        let text = |size: f64| match decade(size) {
            e if power(e) == size => decade_text(e, is_plain),
            _ => significant(size),
        };
        // In order of importance: zero, the largest powers, the threshold
        let powers = powers.rev().map(power).filter(|size| *size > threshold);
        let sizes = powers.chain([threshold]);
        let both = |size: f64| vec![(size, text(size)), (-size, format!("\u{2212}{}", text(size)))];
        let groups = std::iter::once(vec![(0.0, "0".to_owned())]).chain(sizes.map(both));
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let gap = 0.8 / most as f64;
        let mut kept: Vec<Tick> = Vec::new();
        for group in groups {
            let group = group.into_iter().filter(|(value, _)| is_inside(value));
            let group: Vec<Tick> =
                group.map(|(value, label)| self.tick(value, Some(label))).collect();
            // Both signs have a tick, or none
            let is_free = |tick: &Tick| {
                let mut others = kept.iter();
                others.all(|other| (other.position - tick.position).abs() >= gap)
            };
            if group.iter().all(is_free) && kept.len() + group.len() <= most {
                kept.extend(group);
            }
        }
        kept.sort_by(|a, b| a.position.total_cmp(&b.position));
        Ticks { ticks: kept, exponent: 0 }
    }

    /// The borders of bands of one colour.
    fn bands(&self, steps: u32, most: usize) -> Ticks {
        let [low, high] = self.range.map(|value| self.scale.forward(value));
        let exponent = common_exponent(self.range[0], self.range[1]);
        let part = |i: u32| f64::from(i) / f64::from(steps);
        let value = |i: u32| match i {
            0 => self.range[0],
            i if i == steps => self.range[1],
            i => self.scale.inverse(low + part(i) * (high - low)),
        };
        let values: Vec<f64> = (0..=steps).map(|i| value(i) / power(exponent)).collect();
        // Use the fewest decimals that show all values
        let step = values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
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
        let ticks = values.iter().enumerate().zip(0..=steps).map(|((at, value), i)| Tick {
            position: part(i),
            label: (at % stride == 0).then(|| match self.scale {
                ColorScale::Linear => number(*value, decimals),
                _ => significant(*value),
            }),
        });
        Ticks { ticks: ticks.collect(), exponent }
    }
}

/// A power of ten with zeros or with an exponent.
fn decade_text(exponent: i32, is_plain: bool) -> String {
    match is_plain {
        true => number(power(exponent), usize::try_from(-exponent).unwrap_or(0)),
        false => power_text(exponent),
    }
}

#[cfg(test)]
#[path = "ticks_tests.rs"]
mod tests;
