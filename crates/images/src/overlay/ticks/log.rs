//! Ticks of logarithmic scales.

use std::ops::RangeInclusive;

use super::{Axis, PLAIN, Ticks, decade, decade_text, number, power};

impl Axis {
    /// Powers of ten with small marks between them; in short ranges, 1, 2 and 5 times powers of ten, or round values.
    pub(super) fn log(&self, most: usize) -> Ticks {
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
            return self.digits(decade(low)..=decade(high * (1.0 + slack)), is_inside);
        }
        self.decades(most, is_plain)
    }

    /// Powers of ten, with small marks at their multiples.
    fn decades(&self, most: usize, is_plain: bool) -> Ticks {
        let [low, high] = self.range;
        let slack = 1e-9;
        let is_inside = |value: f64| value >= low * (1.0 - slack) && value <= high * (1.0 + slack);
        // Find the decades, and how many of them have labels
        let all: Vec<i32> = (decade(low)..=decade(high * (1.0 + slack))).collect();
        let stride = all.len().div_ceil(most).max(1);
        let mut ticks = Vec::new();
        // Mark multiples only if each decade has a label
        for exponent in all {
            let is_labelled = exponent.rem_euclid(i32::try_from(stride).unwrap_or(i32::MAX)) == 0;
            let value = power(exponent);
            let text = |_| decade_text(exponent, is_plain);
            let label = is_labelled.then(|| self.label(value, text));
            let between = if stride == 1 { 2..10 } else { 2..2 };
            let marks = between.map(|digit| (f64::from(digit) * value, None));
            for (value, label) in std::iter::once((value, label)).chain(marks) {
                if is_inside(value) {
                    ticks.push(self.tick(value, label));
                }
            }
        }
        Ticks { ticks, ..Ticks::default() }
    }

    /// 1, 2 and 5 times powers of ten, with small marks at their other multiples.
    fn digits(&self, decades: RangeInclusive<i32>, is_inside: impl Fn(f64) -> bool) -> Ticks {
        let values = decades.flat_map(|e| (1..10_i32).map(move |digit| (digit, e)));
        let ticks = values.filter_map(|(digit, exponent)| {
            let value = f64::from(digit) * power(exponent);
            let decimals = usize::try_from(-exponent).unwrap_or(0);
            let is_labelled = [1, 2, 5].contains(&digit);
            let label = is_labelled.then(|| self.label(value, |v| number(v, decimals)));
            is_inside(value).then(|| self.tick(value, label))
        });
        Ticks { ticks: ticks.collect(), ..Ticks::default() }
    }
}
