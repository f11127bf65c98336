//! Colour bars: a bar with ticks, or swatches with the names of categories. This file has vertical ones.

use super::canvas::{Canvas, Color};
use super::layout::Orientation;
use super::number_format::{NumberFormat, power_text};
use super::ticks::{TickChoice, TickSettings, Ticks};
use super::{Pen, font};
use crate::scene::ColorScale;

mod horizontal;

/// A colour bar.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorBar {
    /// What the colours show.
    pub title: String,
    /// The unit of the values; may be empty.
    pub unit: String,
    /// Length of the bar as a fraction of the height of the picture.
    pub length: f32,
    /// Its direction.
    pub orientation: Orientation,
    /// The colours.
    pub kind: ColorBarKind,
    /// Where ticks are wanted, if not at round values.
    pub ticks: Option<TickChoice>,
    /// How numbers are written, if not as short as possible.
    pub format: Option<NumberFormat>,
    /// What values are multiplied by before they are shown; above 0.
    pub factor: f64,
}

/// Colours and their values.
#[derive(Debug, Clone, PartialEq)]
pub enum ColorBarKind {
    /// Numbers.
    Numbers {
        /// Colours at equal distances from the first to the last. For a discrete map, one for each band.
        colors: Vec<Color>,
        /// Values at the ends.
        range: [f64; 2],
        /// The scale.
        scale: ColorScale,
        /// Whether the map has bands of one colour.
        is_discrete: bool,
    },
    /// Names of categories with their colours.
    Categories(Vec<(String, Color)>),
}

/// Lengths in units of the size of text.
const BAR_WIDTH: f32 = 0.9;
const TICK: f32 = 0.3;
const SMALL_TICK: f32 = 0.16;
const LABEL_GAP: f32 = 0.5;
const TITLE_GAP: f32 = 0.5;
/// The same above a bar with a label at its upper end.
const GAP_ABOVE_LABEL: f32 = 0.9;
const SWATCH: f32 = 0.9;
const SWATCH_PITCH: f32 = 1.4;
/// Distance of columns of categories.
const COLUMN_GAP: f32 = 1.0;
/// Greatest height of a column of categories as a fraction of the picture: more would leave it.
const MAX_HEIGHT: f32 = 0.85;
/// Least distance of labels.
const LABEL_PITCH: f32 = 2.0;

impl ColorBar {
    pub(super) fn texts(&self) -> Vec<&str> {
        let categories = match &self.kind {
            ColorBarKind::Numbers { .. } => &[][..],
            ColorBarKind::Categories(all) => all,
        };
        let names = categories.iter().map(|(name, _)| &**name);
        names.chain([&*self.title, &*self.unit]).collect()
    }

    /// What the ticks depend on; None for categories.
    pub fn tick_settings(&self) -> Option<TickSettings<'_>> {
        match &self.kind {
            ColorBarKind::Categories(_) => None,
            ColorBarKind::Numbers { colors, range, scale, is_discrete } => Some(TickSettings {
                range: *range,
                scale: *scale,
                steps: is_discrete.then(|| u32::try_from(colors.len()).unwrap_or(u32::MAX)),
                factor: self.factor,
                choice: self.ticks.as_ref(),
                format: self.format,
            }),
        }
    }

    /// The ticks for a vertical bar of `length` pixels with text of `size` pixels.
    fn vertical_ticks(&self, length: f32, size: f32) -> Ticks {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
        let most = (length / (LABEL_PITCH * size)).floor().clamp(2.0, 100.0) as usize;
        let mut ticks = self.ticks_with(most);
        if matches!(self.ticks, Some(TickChoice::Values(_))) {
            let line = f64::from(size / length);
            ticks.thin(0.3 * line, |_| 0.5 * line);
        }
        ticks
    }

    /// The ticks with at most `most` labels.
    fn ticks_with(&self, most: usize) -> Ticks {
        self.tick_settings().map(|settings| settings.ticks(most)).unwrap_or_default()
    }

    /// The title with unit and common exponent.
    fn heading(&self, exponent: i32) -> String {
        let factor = (exponent != 0).then(|| power_text(exponent));
        let unit: Vec<String> = [factor, Some(self.unit.clone()).filter(|unit| !unit.is_empty())]
            .into_iter()
            .flatten()
            .collect();
        match (self.title.is_empty(), unit.is_empty()) {
            (_, true) => self.title.clone(),
            (true, false) => unit.join(" "),
            (false, false) => format!("{} ({})", self.title, unit.join(" ")),
        }
    }

    fn length(&self, pen: &Pen) -> f32 {
        match &self.kind {
            ColorBarKind::Numbers { .. } => (self.length * pen.picture).round().max(1.0),
            ColorBarKind::Categories(all) => {
                #[expect(clippy::cast_precision_loss, reason = "a few")]
                let rows = rows(all.len(), pen) as f32;
                ((rows - 1.0).max(0.0) * SWATCH_PITCH + SWATCH) * pen.font.size
            }
        }
    }

    /// Distance from the top to the bar.
    fn above(&self, pen: &Pen, heading: &str) -> f32 {
        let size = pen.font.size;
        match (heading.is_empty(), &self.kind) {
            // Half a label may be above the bar
            (true, ColorBarKind::Numbers { .. }) => (0.5 * font::CAP_HEIGHT * size).ceil(),
            (true, ColorBarKind::Categories(_)) => 0.0,
            (false, kind) => {
                let is_numbers = matches!(kind, ColorBarKind::Numbers { .. });
                let gap = if is_numbers && self.orientation == Orientation::Vertical {
                    GAP_ABOVE_LABEL
                } else {
                    TITLE_GAP
                };
                (pen.text_size(heading)[1] + gap * size).round()
            }
        }
    }

    pub(super) fn measure(&self, pen: &Pen) -> [f32; 2] {
        if self.orientation == Orientation::Horizontal {
            return self.measure_horizontal(pen);
        }
        // Find what is drawn
        let size = pen.font.size;
        let length = self.length(pen);
        let ticks = self.vertical_ticks(length, size);
        let heading = self.heading(ticks.exponent);
        let labels = ticks.ticks.iter().filter_map(|tick| tick.label.as_deref());
        let names: Vec<&str> = match &self.kind {
            ColorBarKind::Numbers { .. } => labels.collect(),
            ColorBarKind::Categories(all) => all.iter().map(|(name, _)| &**name).collect(),
        };
        // Find the width, of several columns if there are many categories
        let widest = names.iter().map(|name| pen.font.width(name)).fold(0.0, f32::max);
        let own = (BAR_WIDTH + LABEL_GAP) * size + widest;
        let width = match &self.kind {
            ColorBarKind::Numbers { .. } => own,
            ColorBarKind::Categories(all) => {
                let columns = all.len().div_ceil(rows(all.len(), pen)).max(1);
                #[expect(clippy::cast_precision_loss, reason = "a few")]
                let others = (columns - 1) as f32;
                own + others * column_width(all, pen)
            }
        };
        // Labels of numbers reach half their height beyond the bar
        let below = match &self.kind {
            ColorBarKind::Numbers { .. } => 0.5 * font::CAP_HEIGHT * size,
            ColorBarKind::Categories(_) => 0.0,
        };
        let height = self.above(pen, &heading) + length + below;
        [width.max(pen.font.width(&heading)), height]
    }

    pub(super) fn draw(&self, canvas: &mut dyn Canvas, corner: [f32; 2], pen: &Pen) {
        if self.orientation == Orientation::Horizontal {
            self.draw_horizontal(canvas, corner, pen);
            return;
        }
        // Draw title and exponent
        let size = pen.font.size;
        let length = self.length(pen);
        let ticks = self.vertical_ticks(length, size);
        let heading = self.heading(ticks.exponent);
        pen.text(canvas, &heading, corner);
        let top = (corner[1] + self.above(pen, &heading)).round();
        let left = corner[0].round();
        // Draw colours with their names or ticks
        match &self.kind {
            ColorBarKind::Categories(all) => swatches(canvas, all, [left, top], pen),
            ColorBarKind::Numbers { colors, is_discrete, .. } => {
                let width = (BAR_WIDTH * size).round().max(2.0);
                let (from, to) = ([left, top], [left + width, top + length]);
                frame(canvas, from, to, pen);
                fill(canvas, colors, *is_discrete, from, to);
                draw_ticks(canvas, &ticks, from, to, pen);
            }
        }
    }
}

/// Draws a thin frame around a rectangle.
fn frame(canvas: &mut dyn Canvas, from: [f32; 2], to: [f32; 2], pen: &Pen) {
    let line = pen.line;
    let outside = ([from[0] - line, from[1] - line], [to[0] + line, to[1] + line]);
    canvas.fill(outside.0, outside.1, pen.color);
}

/// Fills a bar from its first colour at the bottom to its last at the top.
fn fill(
    canvas: &mut dyn Canvas,
    colors: &[Color],
    is_discrete: bool,
    from: [f32; 2],
    to: [f32; 2],
) {
    if !is_discrete {
        canvas.ramp(from, to, Orientation::Vertical, colors);
        return;
    }
    let length = to[1] - from[1];
    #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
    let count = colors.len() as f32;
    for (color, i) in colors.iter().zip(0_u16..) {
        let edge = |i: u16| (to[1] - length * f32::from(i) / count).round();
        canvas.fill([from[0], edge(i + 1)], [to[0], edge(i)], *color);
    }
}

fn draw_ticks(canvas: &mut dyn Canvas, ticks: &Ticks, from: [f32; 2], to: [f32; 2], pen: &Pen) {
    let (size, line) = (pen.font.size, pen.line);
    let start = to[0] + line;
    for tick in &ticks.ticks {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let part = tick.position as f32;
        let y = to[1] - part * (to[1] - from[1]);
        // Marks at the ends continue the frame
        let edge = (y - 0.5 * line).round().clamp(from[1] - line, to[1]);
        let length = if tick.label.is_some() { TICK } else { SMALL_TICK };
        canvas.fill([start, edge], [start + (length * size).round(), edge + line], pen.color);
        if let Some(label) = &tick.label {
            pen.label(canvas, label, to[0] + LABEL_GAP * size, edge + 0.5 * line);
        }
    }
}

/// Rows of the columns of so many categories: as many as the picture has room for.
fn rows(count: usize, pen: &Pen) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
    let most = (MAX_HEIGHT * pen.picture / (SWATCH_PITCH * pen.font.size)).max(1.0) as usize;
    // Columns of about equal length
    count.div_ceil(count.div_ceil(most).max(1)).max(1)
}

/// Distance of the columns of categories.
fn column_width(all: &[(String, Color)], pen: &Pen) -> f32 {
    let widest = all.iter().map(|(name, _)| pen.font.width(name)).fold(0.0, f32::max);
    (SWATCH + LABEL_GAP + COLUMN_GAP) * pen.font.size + widest
}

fn swatches(canvas: &mut dyn Canvas, all: &[(String, Color)], corner: [f32; 2], pen: &Pen) {
    let size = pen.font.size;
    let side = (SWATCH * size).round().max(2.0);
    let column_width = column_width(all, pen);
    let columns = all.chunks(rows(all.len(), pen)).zip(0_u16..);
    for (column, x) in columns {
        let left = (corner[0] + f32::from(x) * column_width).round();
        for ((name, color), i) in column.iter().zip(0_u16..) {
            let top = (corner[1] + f32::from(i) * SWATCH_PITCH * size).round();
            let (from, to) = ([left, top], [left + side, top + side]);
            frame(canvas, from, to, pen);
            canvas.fill(from, to, *color);
            pen.label(canvas, name, left + (SWATCH + LABEL_GAP) * size, top + 0.5 * side);
        }
    }
}
