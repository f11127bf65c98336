//! Ticks of scales that are linear around zero and logarithmic beyond.

use super::{Axis, PLAIN, Tick, Ticks, decade, decade_text, power, significant};

impl Axis {
    /// Zero, the ends of the linear part, and powers of ten beyond.
    pub(super) fn symlog(&self, threshold: f64, most: usize) -> Ticks {
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
        let signed = |value: f64| match value {
            0.0 => "0".to_owned(),
            value if value < 0.0 => format!("\u{2212}{}", text(-value)),
            value => text(value),
        };
        let groups = std::iter::once(vec![0.0]).chain(sizes.map(|size| vec![size, -size]));
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let gap = 0.8 / most as f64;
        let mut kept: Vec<Tick> = Vec::new();
        for group in groups {
            let tick = |value: f64| self.tick(value, Some(self.label(value, signed)));
            let group: Vec<Tick> = group.into_iter().filter(is_inside).map(tick).collect();
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
        Ticks { ticks: kept, ..Ticks::default() }
    }
}
