//! Ticks of linear scales.

use super::{Axis, Ticks, common_exponent, decade, number, power};

/// Multiples of a step inside a range.
struct Multiples {
    step: f64,
    /// The exponent of the last digit of the step.
    exponent: i32,
    first: f64,
    last: f64,
}

/// Tolerance of positions as a fraction of the range.
const SLACK: f64 = 1e-9;

impl Multiples {
    fn count(&self) -> f64 {
        self.last - self.first + 1.0
    }

    fn reaches_ends(&self, [low, high]: [f64; 2]) -> bool {
        let slack = SLACK * (high - low);
        let is_near = |multiple: f64, end: f64| (multiple * self.step - end).abs() <= slack;
        is_near(self.first, low) && is_near(self.last, high)
    }
}

impl Axis {
    fn multiples(&self, (digit, exponent): (f64, i32)) -> Multiples {
        let [low, high] = self.range;
        let step = digit * power(exponent);
        let slack = SLACK * (high - low);
        Multiples {
            step,
            exponent: if digit.fract() == 0.0 { exponent } else { exponent - 1 },
            first: ((low - slack) / step).ceil(),
            last: ((high + slack) / step).floor(),
        }
    }

    /// Multiples of 1, 2 or 5 times a power of ten; also of 2.5 or 4 times one if these have ticks at both ends.
    pub(super) fn linear(&self, most: usize) -> Ticks {
        let [low, high] = self.range;
        // Find the smallest step that gives few enough labels
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let raw = (high - low) / (most - 1).max(1) as f64;
        let smallest = decade(raw);
        let steps = |digits: &[f64]| -> Vec<Multiples> {
            let exponents = smallest - 1..=smallest + 1;
            let all = exponents.flat_map(|e| digits.iter().map(move |digit| (*digit, e)));
            #[expect(clippy::cast_precision_loss, reason = "a few")]
            let fits = |multiples: &Multiples| multiples.count() <= most as f64;
            all.map(|step| self.multiples(step)).filter(fits).collect()
        };
        let usual = steps(&[1.0, 2.0, 5.0])
            .into_iter()
            .next()
            .unwrap_or_else(|| self.multiples((1.0, smallest + 2)));
        // One with ticks at both ends is better, unless it has far fewer
        let is_better =
            |own: &Multiples| own.reaches_ends(self.range) && 2.0 * own.count() >= usual.count();
        let better = steps(&[1.0, 2.0, 2.5, 4.0, 5.0]).into_iter().find(is_better);
        let chosen = match better {
            Some(better) if !usual.reaches_ends(self.range) && better.count() > 2.0 => better,
            _ => usual,
        };
        self.ticks_at(&chosen)
    }

    fn ticks_at(&self, multiples: &Multiples) -> Ticks {
        let exponent = match self.format {
            Some(_) => 0,
            None => common_exponent(self.range[0], self.range[1]),
        };
        let decimals = usize::try_from(exponent - multiples.exponent).unwrap_or(0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few: callers choose the step"
        )]
        let count = multiples.count().clamp(0.0, 100.0) as usize;
        let ticks = (0..count).map(|i| {
            #[expect(clippy::cast_precision_loss, reason = "a few")]
            let value = (multiples.first + i as f64) * multiples.step;
            let label = self.label(value, |v| number(v / power(exponent), decimals));
            self.tick(value, Some(label))
        });
        Ticks { ticks: ticks.collect(), exponent, decimals }
    }
}
