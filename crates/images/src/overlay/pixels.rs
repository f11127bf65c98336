//! Pictures as they are in files, and their scaling.

/// Pixels of 8-bit sRGB, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbaPixels {
    width: usize,
    pixels: Vec<[u8; 4]>,
}

impl RgbaPixels {
    /// A picture with rows of `width` pixels, whose colours are not multiplied by alpha.
    ///
    /// # Panics
    /// There are no pixels, or they are no whole rows.
    pub fn new(width: usize, pixels: Vec<[u8; 4]>) -> Self {
        assert!(
            width > 0 && !pixels.is_empty() && pixels.len().is_multiple_of(width),
            "whole rows"
        );
        Self { width, pixels }
    }

    /// Width in pixels.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// The pixels, row by row from the top.
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width
    }

    /// The mean colour and alpha in the rectangle from `[left, top]` to `[right, bottom]`, in pixels. Colours count as
    /// much as they are opaque.
    fn mean(&self, from: [f32; 2], to: [f32; 2]) -> ([f32; 3], f32) {
        let (mut color, mut alpha, mut area) = ([0.0_f32; 3], 0.0_f32, 0.0_f32);
        for y in covered(from[1], to[1], self.height()) {
            for x in covered(from[0], to[0], self.width) {
                let weight = part(from[0], to[0], x) * part(from[1], to[1], y);
                let [r, g, b, a] = self.pixels[y * self.width + x];
                let opaque = weight * f32::from(a);
                for (sum, byte) in color.iter_mut().zip([r, g, b]) {
                    *sum += opaque * f32::from(byte) / 255.0;
                }
                alpha += opaque;
                area += weight;
            }
        }
        if alpha <= 0.0 {
            return ([0.0; 3], 0.0);
        }
        (color.map(|sum| sum / alpha), alpha / (255.0 * area))
    }
}

impl RgbaPixels {
    /// Calls `visit` with the place, colour and alpha of each pixel of the picture in the rectangle of `size` below
    /// `corner`, which is at a pixel. Each is the mean of what it covers, in sRGB like the edges of text.
    pub(super) fn draw_scaled(
        &self,
        corner: [f32; 2],
        size: [f32; 2],
        mut visit: impl FnMut(i32, i32, [f32; 3], f32),
    ) {
        let scale = [self.width as f32 / size[0], self.height() as f32 / size[1]];
        #[expect(clippy::cast_possible_truncation, reason = "whole pixels")]
        let [left, top, width, height] = [corner[0], corner[1], size[0], size[1]].map(|v| v as i32);
        for y in 0..height {
            for x in 0..width {
                let at = [x as f32, y as f32];
                let from = [at[0] * scale[0], at[1] * scale[1]];
                let to = [from[0] + scale[0], from[1] + scale[1]];
                let (color, alpha) = self.mean(from, to);
                visit(left + x, top + y, color, alpha);
            }
        }
    }
}

/// The pixels that overlap the stretch from `low` to `high` of `count` pixels.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturated, and limited to the picture"
)]
fn covered(low: f32, high: f32, count: usize) -> std::ops::Range<usize> {
    let first = (low.floor() as usize).min(count - 1);
    first..(high.ceil() as usize).clamp(first + 1, count)
}

/// The part of pixel `at` between `low` and `high`.
fn part(low: f32, high: f32, at: usize) -> f32 {
    let at = at as f32;
    // Not zero, so that a stretch of no length has a mean
    (high.min(at + 1.0) - low.max(at)).max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_count_colours_as_much_as_they_are_opaque() {
        let red = [255, 0, 0, 255];
        let clear_blue = [0, 0, 255, 0];
        let half_green = [0, 255, 0, 51];
        let pixels = RgbaPixels::new(3, vec![red, clear_blue, half_green]);
        let (color, alpha) = pixels.mean([0.0, 0.0], [2.0, 1.0]);
        assert_eq!((color, alpha), ([1.0, 0.0, 0.0], 0.5));
        let (color, alpha) = pixels.mean([0.0, 0.0], [3.0, 1.0]);
        assert!((color[0] - 1.0 / 1.2).abs() < 1e-6 && (color[1] - 0.2 / 1.2).abs() < 1e-6);
        assert!((alpha - 0.4).abs() < 1e-6);
        // A quarter of a pixel, as of an enlarged picture
        let (color, alpha) = pixels.mean([2.25, 0.5], [2.5, 0.75]);
        assert!((color[1] - 1.0).abs() < 1e-6 && (alpha - 0.2).abs() < 1e-6);
        assert_eq!(pixels.mean([1.0, 0.0], [2.0, 1.0]), ([0.0; 3], 0.0));
    }
}
