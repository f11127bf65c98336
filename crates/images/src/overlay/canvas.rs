//! What overlays are drawn on: a small picture with alpha, or anything else that takes the same commands.

use std::sync::Arc;

use super::Sprite;
use super::font::Font;
use super::layout::Orientation;
use super::pixels::RgbaPixels;

/// A colour as sRGB from 0 to 1. Edges are blended in sRGB, so that thin strokes of dark text look as heavy as those of
/// light text.
pub type Color = [f32; 3];

/// The commands that overlays are drawn with. Lengths are in pixels, from the top left.
pub(super) trait Canvas {
    /// Fills the rectangle from `[left, top]` to `[right, bottom]`.
    fn fill(&mut self, from: [f32; 2], to: [f32; 2], color: Color);

    /// Fills a rectangle with `colors`, from the bottom to the top or from the left to the right.
    fn ramp(&mut self, from: [f32; 2], to: [f32; 2], direction: Orientation, colors: &[Color]);

    /// Draws a line with round ends.
    fn line(&mut self, from: [f32; 2], to: [f32; 2], width: f32, color: Color);

    /// Draws one line of text. `x` is its start, and `baseline` is rounded to a pixel so that horizontal stems are sharp.
    fn text(&mut self, font: &Font, text: &str, x: f32, baseline: f32, color: Color);

    /// Draws a picture in the rectangle of `size` below `corner`, which is at a pixel.
    fn image(&mut self, corner: [f32; 2], size: [f32; 2], source: &Arc<RgbaPixels>);
}

/// Premultiplied sRGB with alpha.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Raster {
    width: i32,
    height: i32,
    pixels: Vec<[f32; 4]>,
}

/// Largest size of a canvas in pixels on each side; pictures are smaller.
const MAX_SIDE: i32 = 1 << 16;

impl Raster {
    /// A transparent canvas.
    pub(super) fn new(width: i32, height: i32) -> Self {
        let (width, height) = (width.clamp(0, MAX_SIDE), height.clamp(0, MAX_SIDE));
        let count = usize::try_from(i64::from(width) * i64::from(height)).unwrap_or(0);
        Self { width, height, pixels: vec![[0.0; 4]; count] }
    }

    fn index(&self, x: i32, y: i32) -> Option<usize> {
        let is_inside = (0..self.width).contains(&x) && (0..self.height).contains(&y);
        let index = i64::from(y) * i64::from(self.width) + i64::from(x);
        usize::try_from(index).ok().filter(|_| is_inside)
    }

    #[cfg(test)]
    pub(super) fn alpha(&self, x: i32, y: i32) -> f32 {
        self.index(x, y).map_or(0.0, |at| self.pixels[at][3])
    }

    /// Draws `color` over a pixel that it covers partly.
    pub(super) fn blend(&mut self, x: i32, y: i32, color: Color, coverage: f32) {
        let Some(at) = self.index(x, y) else { return };
        let alpha = coverage.clamp(0.0, 1.0);
        let pixel = &mut self.pixels[at];
        for c in 0..3 {
            pixel[c] = color[c] * alpha + pixel[c] * (1.0 - alpha);
        }
        pixel[3] = alpha + pixel[3] * (1.0 - alpha);
    }

    /// Puts `color` behind everything that was drawn, up to `radius` pixels around it.
    pub(super) fn add_halo(&mut self, radius: f32, color: Color) {
        #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
        let reach = radius.ceil().min(64.0) as i32;
        // Compute the weight at each offset, with a soft edge
        let mut weights = Vec::new();
        for y in -reach..=reach {
            for x in -reach..=reach {
                let distance = ((x * x + y * y) as f32).sqrt();
                let weight = (radius + 0.5 - distance).clamp(0.0, 1.0);
                if weight > 0.0 {
                    weights.push((x, y, weight));
                }
            }
        }
        // Spread the alpha of each drawn pixel
        let mut halo = vec![0.0_f32; self.pixels.len()];
        for y in 0..self.height {
            for x in 0..self.width {
                let alpha = self.index(x, y).map_or(0.0, |at| self.pixels[at][3]);
                if alpha <= 0.0 {
                    continue;
                }
                for (dx, dy, weight) in &weights {
                    if let Some(at) = self.index(x + dx, y + dy) {
                        halo[at] = halo[at].max(alpha * weight);
                    }
                }
            }
        }
        // Put the halo behind what was drawn
        for (pixel, alpha) in self.pixels.iter_mut().zip(halo) {
            let behind = HALO * alpha * (1.0 - pixel[3]);
            for c in 0..3 {
                pixel[c] += color[c] * behind;
            }
            pixel[3] += behind;
        }
    }

    /// The finished picture at a place.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "in 0 to 255; NaN becomes 0"
    )]
    pub(super) fn into_sprite(self, left: i32, top: i32) -> Sprite {
        let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        Sprite {
            left,
            top,
            width: self.width,
            height: self.height,
            pixels: self.pixels.iter().map(|pixel| pixel.map(byte)).collect(),
        }
    }
}

impl Canvas for Raster {
    /// Edges inside pixels are soft.
    fn fill(&mut self, from: [f32; 2], to: [f32; 2], color: Color) {
        let part = |low: f32, high: f32, at: i32| {
            let at = at as f32;
            (high.min(at + 1.0) - low.max(at)).max(0.0)
        };
        for y in pixels(from[1], to[1], self.height) {
            for x in pixels(from[0], to[0], self.width) {
                let coverage = part(from[0], to[0], x) * part(from[1], to[1], y);
                self.blend(x, y, color, coverage);
            }
        }
    }

    fn ramp(&mut self, from: [f32; 2], to: [f32; 2], direction: Orientation, colors: &[Color]) {
        let axis = usize::from(direction == Orientation::Vertical);
        let length = to[axis] - from[axis];
        #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
        let last = colors.len() as f32 - 1.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
        let steps = length as u32;
        for step in 0..steps {
            let start = from[axis] + step as f32;
            let (mut low, mut high) = (from, to);
            (low[axis], high[axis]) = (start, start + 1.0);
            let along = match direction {
                Orientation::Vertical => to[1] - (start + 0.5),
                Orientation::Horizontal => start + 0.5 - from[0],
            };
            self.fill(low, high, between(colors, along / length * last));
        }
    }

    fn line(&mut self, from: [f32; 2], to: [f32; 2], width: f32, color: Color) {
        let reach = 0.5 * width + 1.0;
        let along = [to[0] - from[0], to[1] - from[1]];
        let square = along[0] * along[0] + along[1] * along[1];
        for y in pixels(from[1].min(to[1]) - reach, from[1].max(to[1]) + reach, self.height) {
            for x in pixels(from[0].min(to[0]) - reach, from[0].max(to[0]) + reach, self.width) {
                let at = [x as f32 + 0.5 - from[0], y as f32 + 0.5 - from[1]];
                let t = if square > 0.0 {
                    ((at[0] * along[0] + at[1] * along[1]) / square).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let away = [at[0] - t * along[0], at[1] - t * along[1]];
                let distance = (away[0] * away[0] + away[1] * away[1]).sqrt();
                self.blend(x, y, color, 0.5 * width + 0.5 - distance);
            }
        }
    }

    fn text(&mut self, font: &Font, text: &str, x: f32, baseline: f32, color: Color) {
        font.draw(text, x, baseline, |x, y, coverage| self.blend(x, y, color, coverage));
    }

    fn image(&mut self, corner: [f32; 2], size: [f32; 2], source: &Arc<RgbaPixels>) {
        source.draw_scaled(corner, size, |x, y, color, alpha| self.blend(x, y, color, alpha));
    }
}

/// The colour at a position between two entries.
fn between(colors: &[Color], at: f32) -> Color {
    let last = colors.len().saturating_sub(1);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "limited to the entries"
    )]
    let index = (at.max(0.0) as usize).min(last);
    let (Some(a), Some(b)) = (colors.get(index), colors.get((index + 1).min(last))) else {
        return [0.0; 3];
    };
    #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
    let part = (at - index as f32).clamp(0.0, 1.0);
    std::array::from_fn(|c| a[c] + part * (b[c] - a[c]))
}

/// Opacity of halos.
const HALO: f32 = 0.8;

/// The pixels that an interval touches, below `count`.
#[expect(clippy::cast_possible_truncation, reason = "limited to the canvas")]
fn pixels(low: f32, high: f32, count: i32) -> std::ops::Range<i32> {
    let limit = |value: f32| value.clamp(0.0, count as f32) as i32;
    limit(low.floor())..limit(high.ceil())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_cover_parts_of_pixels() {
        let mut canvas = Raster::new(4, 3);
        canvas.fill([0.5, 1.0], [2.25, 2.0], [1.0, 0.5, 0.0]);
        let row: Vec<f32> = (0..4).map(|x| canvas.alpha(x, 1)).collect();
        assert_eq!(row, [0.5, 1.0, 0.25, 0.0]);
        assert_eq!(canvas.alpha(1, 0), 0.0);
        let sprite = canvas.into_sprite(0, 0);
        assert_eq!(sprite.pixels[4..7], [[128, 64, 0, 128], [255, 128, 0, 255], [64, 32, 0, 64]]);
    }

    #[test]
    fn lines_have_their_width() {
        let mut canvas = Raster::new(20, 9);
        canvas.line([3.5, 4.5], [16.5, 4.5], 3.0, [1.0; 3]);
        let column: Vec<f32> = (0..9).map(|y| canvas.alpha(10, y)).collect();
        assert_eq!(column, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        // Nothing is drawn outside, and nothing fails
        canvas.line([-5.0, -5.0], [1e9, f32::NAN], 3.0, [1.0; 3]);
        canvas.blend(-1, 3, [1.0; 3], 1.0);
    }

    #[test]
    fn halos_lie_behind() {
        let mut canvas = Raster::new(9, 9);
        canvas.fill([4.0, 4.0], [5.0, 5.0], [0.0; 3]);
        canvas.add_halo(2.0, [1.0; 3]);
        let sprite = canvas.into_sprite(0, 0);
        assert_eq!(sprite.pixels[4 * 9 + 4], [0, 0, 0, 255]);
        assert_eq!(sprite.pixels[4 * 9 + 5], [204; 4]);
        assert_eq!(sprite.pixels[4 * 9 + 8], [0; 4]);
    }
}
