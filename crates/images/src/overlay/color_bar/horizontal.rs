//! Horizontal colour bars: the title above, the labels below.

use super::super::canvas::Canvas;
use super::super::ticks::{TickChoice, Ticks};
use super::super::{Pen, font};
use super::{
    BAR_WIDTH, ColorBar, ColorBarKind, LABEL_GAP, Orientation, SMALL_TICK, SWATCH, TICK, TITLE_GAP,
    frame,
};

/// Distance from the bar to the middle of the labels, in units of the size of text.
const LABEL_BELOW: f32 = 0.95;
/// Least distance of labels.
const LABEL_SPACE: f32 = 0.6;
/// Distance from the name of a category to the next swatch.
const SWATCH_SPACE: f32 = 1.1;

/// Where the parts of a bar are, in pixels from its corner.
struct Layout {
    /// Left and right end of the bar.
    ends: [f32; 2],
    top: f32,
    width: f32,
    height: f32,
    ticks: Ticks,
    heading: String,
}

impl ColorBar {
    fn layout(&self, pen: &Pen) -> Layout {
        // Find the length, of categories with their names between them
        let size = pen.font.size;
        let length = match &self.kind {
            ColorBarKind::Numbers { .. } => (self.length * pen.picture).round().max(1.0),
            ColorBarKind::Categories(all) => {
                let names = all.iter().map(|(name, _)| pen.font.width(name));
                let pitch = (SWATCH + LABEL_GAP + SWATCH_SPACE) * size;
                let sum: f32 = names.map(|width| width + pitch).sum();
                (sum - SWATCH_SPACE * size).max(0.0)
            }
        };
        // As many labels as there is space for
        let mut ticks = (2..=20).rev().map(|most| self.ticks_with(most));
        let fits = |ticks: &Ticks| is_spaced(ticks, length, pen);
        let fitting = ticks.clone().find(fits).or_else(|| ticks.next_back());
        let mut ticks = fitting.unwrap_or_default();
        if matches!(self.ticks, Some(TickChoice::Values(_))) {
            let part = |pixels: f32| f64::from(pixels / length);
            let half = |label: &str| part(0.5 * pen.font.width(label));
            ticks.thin(part(LABEL_SPACE * size), half);
        }
        // Labels may reach beyond the ends
        let (mut before, mut after) = (0.0_f32, 0.0_f32);
        for (middle, half) in labels(&ticks, length, pen) {
            before = before.max(half - middle);
            after = after.max(middle + half - length);
        }
        let before = before.ceil();
        // Put title and exponent above the bar, and labels below it
        let heading = self.heading(ticks.exponent);
        let top = if heading.is_empty() {
            pen.line
        } else {
            (pen.text_size(&heading)[1] + TITLE_GAP * size).round()
        };
        let below = match &self.kind {
            ColorBarKind::Numbers { .. } => LABEL_BELOW + 0.5 * font::CAP_HEIGHT,
            ColorBarKind::Categories(_) => 0.0,
        };
        Layout {
            ends: [before, before + length],
            top,
            width: (before + length + after).max(pen.font.width(&heading)),
            height: top + ((BAR_WIDTH + below) * size).round(),
            ticks,
            heading,
        }
    }

    pub(super) fn measure_horizontal(&self, pen: &Pen) -> [f32; 2] {
        let Layout { width, height, .. } = self.layout(pen);
        [width, height]
    }

    pub(super) fn draw_horizontal(&self, canvas: &mut dyn Canvas, corner: [f32; 2], pen: &Pen) {
        // Find the corners of the bar
        let size = pen.font.size;
        let layout = self.layout(pen);
        let [left, right] = layout.ends.map(|x| (corner[0] + x).round());
        let top = (corner[1] + layout.top).round();
        let bottom = top + (BAR_WIDTH * size).round().max(2.0);
        // Draw colours with their ticks or names
        match &self.kind {
            ColorBarKind::Numbers { colors, is_discrete, .. } => {
                let title = [left.min(corner[0] + layout.ends[0]), corner[1]];
                pen.text(canvas, &layout.heading, title);
                frame(canvas, [left, top], [right, bottom], pen);
                fill(canvas, colors, *is_discrete, [left, right], [top, bottom]);
                draw_ticks(canvas, &layout.ticks, [left, right], bottom, pen);
            }
            ColorBarKind::Categories(all) => {
                pen.text(canvas, &layout.heading, corner);
                let side = (SWATCH * size).round().max(2.0);
                let mut x = left;
                for (name, color) in all {
                    let (from, to) = ([x.round(), top], [x.round() + side, top + side]);
                    frame(canvas, from, to, pen);
                    canvas.fill(from, to, *color);
                    let text = x + (SWATCH + LABEL_GAP) * size;
                    pen.label(canvas, name, text, top + 0.5 * side);
                    x = text + pen.font.width(name) + SWATCH_SPACE * size;
                }
            }
        }
    }
}

/// Middle of each label, and half its width.
fn labels(ticks: &Ticks, length: f32, pen: &Pen) -> Vec<(f32, f32)> {
    let labels = ticks.ticks.iter().filter_map(|tick| {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let part = tick.position as f32;
        let label = tick.label.as_deref()?;
        Some((part * length, 0.5 * pen.font.width(label)))
    });
    labels.collect()
}

/// Whether there is space between the labels.
fn is_spaced(ticks: &Ticks, length: f32, pen: &Pen) -> bool {
    let labels = labels(ticks, length, pen);
    labels.windows(2).all(|pair| {
        let [(a, half_a), (b, half_b)] = [pair[0], pair[1]];
        (b - a).abs() >= half_a + half_b + LABEL_SPACE * pen.font.size
    })
}

/// Fills a bar from its first colour at the left to its last at the right.
fn fill(
    canvas: &mut dyn Canvas,
    colors: &[super::Color],
    is_discrete: bool,
    [left, right]: [f32; 2],
    [top, bottom]: [f32; 2],
) {
    if !is_discrete {
        canvas.ramp([left, top], [right, bottom], Orientation::Horizontal, colors);
        return;
    }
    let length = right - left;
    #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
    let count = colors.len() as f32;
    for (color, i) in colors.iter().zip(0_u16..) {
        let edge = |i: u16| (left + length * f32::from(i) / count).round();
        canvas.fill([edge(i), top], [edge(i + 1), bottom], *color);
    }
}

fn draw_ticks(
    canvas: &mut dyn Canvas,
    ticks: &Ticks,
    [left, right]: [f32; 2],
    bottom: f32,
    pen: &Pen,
) {
    let (size, line) = (pen.font.size, pen.line);
    let start = bottom + line;
    for tick in &ticks.ticks {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let part = tick.position as f32;
        let x = left + part * (right - left);
        // Marks at the ends continue the frame
        let edge = (x - 0.5 * line).round().clamp(left - line, right);
        let length = if tick.label.is_some() { TICK } else { SMALL_TICK };
        canvas.fill([edge, start], [edge + line, start + (length * size).round()], pen.color);
        if let Some(label) = &tick.label {
            let middle = bottom + LABEL_BELOW * size;
            let text = edge + 0.5 * line - 0.5 * pen.font.width(label);
            pen.label(canvas, label, text, middle);
        }
    }
}
