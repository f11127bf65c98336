//! Scale bars: a horizontal line of a known length in the scene.

use super::canvas::Canvas;
use super::number_format::number;
use super::{FrameView, Pen};

/// A scale bar.
#[derive(Debug, Clone, PartialEq)]
pub struct ScaleBar {
    /// Length in the unit of the scene.
    pub length: f64,
    /// The unit; may be empty.
    pub unit: String,
}

/// Height of the marks at the ends, in units of the size of text.
const END: f32 = 0.5;
/// Distance of the label.
const GAP: f32 = 0.3;

impl ScaleBar {
    /// A round length of at most a fifth of the height of a picture with so many units in its height.
    pub fn round_length(units_per_height: f64) -> f64 {
        let most = 0.2 * units_per_height;
        if !(most > 0.0 && most.is_finite()) {
            return 1.0;
        }
        #[expect(clippy::cast_possible_truncation, reason = "below 400")]
        let decade = libm::floor(libm::log10(most)) as i32;
        let lengths = (decade - 1..=decade).flat_map(|exponent| {
            let power: f64 = format!("1e{exponent}").parse().unwrap_or(1.0);
            [1.0, 2.0, 5.0].map(|digit| digit * power)
        });
        lengths.filter(|length| *length <= most).fold(most, |_, length| length)
    }

    fn label(&self) -> String {
        let decimals = (0..9).find(|decimals| {
            let shown: f64 = format!("{:.*}", decimals, self.length).parse().unwrap_or(0.0);
            (shown - self.length).abs() <= 1e-6 * self.length.abs()
        });
        let length = match decimals {
            Some(decimals) => number(self.length, decimals),
            None => format!("{:.2e}", self.length),
        };
        [&length[..], &self.unit].join(" ").trim_end().to_owned()
    }

    /// Length in pixels, at most that of a few pictures.
    fn pixels(&self, pen: &Pen, frame: &FrameView) -> f32 {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let part = (self.length / frame.units_per_height) as f32;
        let length = (part * pen.picture).round();
        if length.is_finite() { length.clamp(1.0, 4.0 * pen.picture) } else { 1.0 }
    }

    pub(super) fn measure(&self, pen: &Pen, frame: &FrameView) -> [f32; 2] {
        let [width, height] = pen.text_size(&self.label());
        let size = pen.font.size;
        [width.max(self.pixels(pen, frame)), height + (GAP + END) * size]
    }

    pub(super) fn draw(
        &self,
        canvas: &mut dyn Canvas,
        corner: [f32; 2],
        pen: &Pen,
        frame: &FrameView,
    ) {
        let (label, length) = (self.label(), self.pixels(pen, frame));
        let [text_width, text_height] = pen.text_size(&label);
        let size = pen.font.size;
        let width = text_width.max(length);
        pen.text(canvas, &label, [corner[0] + 0.5 * (width - text_width), corner[1]]);
        // The line with a mark at each end
        let left = (corner[0] + 0.5 * (width - length)).round();
        let right = left + length;
        let top = (corner[1] + text_height + GAP * size).round();
        let end = (END * size).round();
        let line = (2.0 * pen.line).max(1.0);
        let middle = (top + 0.5 * (end - line)).round();
        canvas.fill([left, middle], [right, middle + line], pen.color);
        for x in [left, right - pen.line] {
            canvas.fill([x, top], [x + pen.line, top + end], pen.color);
        }
    }
}
