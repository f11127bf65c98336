//! Pictures on surfaces, filtered so that they do not shimmer: a pyramid of images, each half the size of the one
//! before (Williams, "Pyramidal Parametrics", 1983), and several probes along a stretched footprint.

use glam::{Vec2, Vec3};
use half::f16;
use thiserror::Error;

use spherule_tree::math::functions::log2;

/// Maximum number of pixels. With its pyramid, such a picture takes 270 MB.
pub const MAX_TEXTURE_PIXELS: u64 = 8192 * 4096;

/// Maximum number of probes along a footprint; longer ones are blurred.
const MAX_PROBES: f32 = 8.0;

/// Reasons why pixels are not a picture of base colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum TextureError {
    /// It has no pixels, or too many.
    #[error(
        "the picture has {width}x{height} pixels; it needs at least 1x1 and at most {MAX_TEXTURE_PIXELS} \
         (8192x4096); make it smaller"
    )]
    Size {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// A component is NaN or infinite.
    #[error(
        "the pixel in column {column} and row {row} is NaN or infinite; a base colour is from 0 to 1"
    )]
    NotFinite {
        /// Column, from 0.
        column: usize,
        /// Row from the top, from 0.
        row: usize,
    },
    /// A component is negative.
    #[error("the pixel in column {column} and row {row} is negative; a base colour is from 0 to 1")]
    Negative {
        /// Column, from 0.
        column: usize,
        /// Row from the top, from 0.
        row: usize,
    },
}

/// A picture of base colours. Positions on it are from (0, 0) at the top left to (1, 1) at the bottom right.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// From the largest to a single texel.
    levels: Vec<Level>,
}

/// An image of the pyramid, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
struct Level {
    width: usize,
    height: usize,
    /// Linear RGB from 0 to 1. Half precision is finer than 8-bit sRGB everywhere.
    texels: Vec<[f16; 3]>,
}

/// What a picture shows beyond its edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Beyond {
    /// Itself, as tiles.
    Repeat,
    /// One colour.
    Plain(Vec3),
}

/// The part of a picture that a sample of an image shows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Footprint {
    /// Length and direction of its longer axis.
    pub long: Vec2,
    /// Length of its shorter axis.
    pub short: f32,
}

impl Texture {
    /// Checks whether a picture may have this size.
    ///
    /// # Errors
    /// [`TextureError::Size`].
    pub fn check_size(width: usize, height: usize) -> Result<(), TextureError> {
        let count = width as u128 * height as u128;
        if (1..=u128::from(MAX_TEXTURE_PIXELS)).contains(&count) {
            Ok(())
        } else {
            Err(TextureError::Size { width, height })
        }
    }

    /// A picture of `pixels`, row by row from the top, linear RGB. Components above 1 count as 1.
    ///
    /// # Errors
    /// See [`TextureError`].
    ///
    /// # Panics
    /// If there are not `width * height` pixels.
    pub fn new(width: usize, height: usize, pixels: &[Vec3]) -> Result<Self, TextureError> {
        Self::check_size(width, height)?;
        assert_eq!(pixels.len(), width * height, "one value per pixel");
        let mut texels = Vec::with_capacity(pixels.len());
        for (place, pixel) in pixels.iter().enumerate() {
            let (column, row) = (place % width, place / width);
            if !pixel.is_finite() {
                return Err(TextureError::NotFinite { column, row });
            }
            if pixel.min_element() < 0.0 {
                return Err(TextureError::Negative { column, row });
            }
            texels.push(pixel.min(Vec3::ONE).to_array().map(f16::from_f32));
        }
        let mut levels = vec![Level { width, height, texels }];
        while let Some(last) = levels.last().filter(|l| l.texels.len() > 1) {
            let half = last.halved();
            levels.push(half);
        }
        Ok(Self { levels })
    }

    /// Height divided by width.
    pub fn aspect(&self) -> f32 {
        self.levels[0].height as f32 / self.levels[0].width as f32
    }

    /// Memory in bytes.
    pub fn byte_len(&self) -> u64 {
        let levels = self.levels.iter().map(|l| size_of_val(&l.texels[..]) as u64);
        levels.sum()
    }

    /// The mean colour over a `footprint` around `position`.
    pub fn color(&self, position: Vec2, footprint: &Footprint, beyond: Beyond) -> Vec3 {
        if !position.is_finite() || !footprint.long.is_finite() {
            // Too far away for single precision
            return match beyond {
                Beyond::Plain(color) => color,
                Beyond::Repeat => self.levels[self.levels.len() - 1].texel(0, 0),
            };
        }
        // Choose probes along the footprint, each about as wide as it is narrow
        let long = footprint.long.length();
        let probes = (long / footprint.short.max(1e-3 * long)).ceil();
        let probes = if probes > 1.0 { probes.min(MAX_PROBES) } else { 1.0 };
        let width = footprint.short.max(long / probes);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "1 to MAX_PROBES"
        )]
        let count = probes as u32;
        // Average them
        let sum: Vec3 = (0..count)
            .map(|i| {
                let along = (i as f32 + 0.5) / probes - 0.5;
                self.probe(position + along * footprint.long, width, beyond)
            })
            .sum();
        sum / probes
    }

    /// The mean colour over a square of `width`, in widths of the picture. Positions are in widths and heights.
    fn probe(&self, position: Vec2, width: f32, beyond: Beyond) -> Vec3 {
        // Find the two levels whose texels are as large as the square
        let texels = width * self.levels[0].width as f32;
        let level = if texels > 1.0 { log2(texels) } else { 0.0 };
        let last = (self.levels.len() - 1) as f32;
        let level = level.min(last);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a level of the pyramid"
        )]
        let fine = level as usize;
        let coarse = (fine + 1).min(self.levels.len() - 1);
        // Interpolate within and between the levels
        let repeats = beyond == Beyond::Repeat;
        let [fine_color, coarse_color] =
            [fine, coarse].map(|level| self.levels[level].bilinear(position, repeats));
        let color = fine_color.lerp(coarse_color, level - fine as f32);
        // Outside, the plain colour takes over
        match beyond {
            Beyond::Repeat => color,
            Beyond::Plain(plain) => plain.lerp(color, self.inside(position, width)),
        }
    }

    /// The part of a square of `width` that is on the picture.
    fn inside(&self, position: Vec2, width: f32) -> f32 {
        let part = |at: f32, width: f32| {
            let width = width.max(1e-9);
            let part = (at.min(1.0 - at) / width + 0.5).clamp(0.0, 1.0);
            part.min(1.0 / width)
        };
        part(position.x, width) * part(position.y, width / self.aspect())
    }
}

impl Level {
    fn texel(&self, x: usize, y: usize) -> Vec3 {
        let texel = self.texels[y * self.width + x];
        Vec3::from_array(texel.map(f16::to_f32))
    }

    /// The colour at a position, interpolated between the centres of texels.
    fn bilinear(&self, position: Vec2, repeats: bool) -> Vec3 {
        let (columns, right) = neighbours(position.x, self.width, repeats);
        let (rows, below) = neighbours(position.y, self.height, repeats);
        let row = |y: usize| self.texel(columns[0], y).lerp(self.texel(columns[1], y), right);
        row(rows[0]).lerp(row(rows[1]), below)
    }

    /// The image at half the width and height, rounded down: means over areas.
    fn halved(&self) -> Self {
        let [width, height] = [self.width, self.height].map(|side| (side / 2).max(1));
        let (columns, rows) = (overlaps(self.width, width), overlaps(self.height, height));
        let mean = |row: &[(usize, f32)], column: &[(usize, f32)]| -> [f16; 3] {
            let mut sum = Vec3::ZERO;
            for (y, of_row) in row {
                for (x, of_column) in column {
                    sum += of_row * of_column * self.texel(*x, *y);
                }
            }
            sum.to_array().map(f16::from_f32)
        };
        let texels =
            rows.iter().flat_map(|row| columns.iter().map(move |column| mean(row, column)));
        Self { width, height, texels: texels.collect() }
    }
}

/// For each of `new` equal intervals, at least half as many as the `old` ones, the old ones in it with their parts.
fn overlaps(old: usize, new: usize) -> Vec<Vec<(usize, f32)>> {
    let interval = |cell: usize| {
        // In units of 1 / (old * new)
        let (from, to) = (cell * old, (cell + 1) * old);
        let first = from / new;
        let last = to.div_ceil(new);
        let part = |i: usize| {
            let overlap = to.min((i + 1) * new) - from.max(i * new);
            (i, overlap as f32 / old as f32)
        };
        (first..last).map(part).collect()
    };
    (0..new).map(interval).collect()
}

/// The two of `count` texels around a position from 0 to 1, and the weight of the second one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the texels"
)]
fn neighbours(position: f32, count: usize, repeats: bool) -> ([usize; 2], f32) {
    let size = count as f32;
    let position = if repeats { position - position.floor() } else { position.clamp(0.0, 1.0) };
    let at = position * size - 0.5;
    let first = at.floor();
    let weight = at - first;
    if repeats {
        let first = if first < 0.0 { count - 1 } else { (first as usize).min(count - 1) };
        return ([first, (first + 1) % count], weight);
    }
    let index = |at: f32| (at.max(0.0) as usize).min(count - 1);
    ([index(first), index(first + 1.0)], weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINT: Footprint = Footprint { long: Vec2::ZERO, short: 0.0 };
    const PLAIN: Beyond = Beyond::Plain(Vec3::X);

    fn gray(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Texture {
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let pixels: Vec<Vec3> = places.map(|(x, y)| Vec3::splat(value(x, y))).collect();
        Texture::new(width, height, &pixels).unwrap()
    }

    #[test]
    fn centres_of_texels_have_their_colours() {
        let texture = gray(4, 2, |x, y| (x + 4 * y) as f32 / 8.0);
        for (x, y) in (0..2_u8).flat_map(|y| (0..4_u8).map(move |x| (x, y))) {
            let at = Vec2::new((f32::from(x) + 0.5) / 4.0, (f32::from(y) + 0.5) / 2.0);
            let wanted = f32::from(x + 4 * y) / 8.0;
            for beyond in [Beyond::Repeat, PLAIN] {
                assert_eq!(texture.color(at, &POINT, beyond), Vec3::splat(wanted));
            }
            // Other tiles
            let tile = at + Vec2::new(-3.0, 2.0);
            let found = texture.color(tile, &POINT, Beyond::Repeat).x;
            assert!((found - wanted).abs() < 1e-5, "{found} {wanted}");
            assert_eq!(texture.color(tile, &POINT, PLAIN), Vec3::X);
        }
        // Between the last column and the first one
        let edge = texture.color(Vec2::new(0.0, 0.25), &POINT, Beyond::Repeat).x;
        assert!((edge - 0.5 * 3.0 / 8.0).abs() < 1e-6, "{edge}");
    }

    #[test]
    fn wide_footprints_see_means() {
        for (width, height) in [(16, 16), (37, 11), (1, 9), (5, 1)] {
            let texture = gray(width, height, |x, y| ((x + y) % 2) as f32);
            let whole = (0..width * height).filter(|i| (i % width + i / width) % 2 == 1);
            let mean = whole.count() as f32 / (width * height) as f32;
            let wide = Footprint { long: Vec2::new(100.0, 0.0), short: 100.0 };
            let found = texture.color(Vec2::new(0.3, 0.6), &wide, Beyond::Repeat).x;
            assert!((found - mean).abs() < 2e-3, "{width}x{height}: {found} {mean}");
        }
        // Four texels of a checkerboard, at any position
        let texture = gray(64, 64, |x, y| ((x + y) % 2) as f32);
        let few = Footprint { long: Vec2::new(4.0 / 64.0, 0.0), short: 4.0 / 64.0 };
        for i in 0..100_u8 {
            let at = Vec2::new(0.013 * f32::from(i), 0.021 * f32::from(i));
            assert!((texture.color(at, &few, Beyond::Repeat).x - 0.5).abs() < 1e-2);
        }
    }

    #[test]
    fn long_footprints_keep_detail_across() {
        // Stripes along x: a footprint along them sees their colour, one across them the mean
        let texture = gray(64, 64, |_, y| (y / 4 % 2) as f32);
        let at = Vec2::new(0.5, 2.0 / 64.0);
        let along = Footprint { long: Vec2::new(8.0 / 64.0, 0.0), short: 1.0 / 64.0 };
        let across = Footprint { long: Vec2::new(0.0, 16.0 / 64.0), ..along };
        assert!(texture.color(at, &along, Beyond::Repeat).x < 0.01);
        assert!((texture.color(at, &across, Beyond::Repeat).x - 0.5).abs() < 0.1);
    }

    #[test]
    fn edges_are_smooth_without_repetition() {
        let texture = gray(8, 4, |_, _| 0.0);
        let footprint = Footprint { long: Vec2::new(0.1, 0.0), short: 0.1 };
        let red = |x: f32| texture.color(Vec2::new(x, 0.5), &footprint, PLAIN).x;
        assert_eq!([red(0.1), red(-0.1)], [0.0, 1.0]);
        assert!((red(0.0) - 0.5).abs() < 1e-6 && red(-0.025) > red(0.025));
        // Far away, and nowhere
        for x in [1e30, f32::INFINITY, f32::NAN] {
            assert_eq!(red(x), 1.0);
            let tile = texture.color(Vec2::splat(x), &footprint, Beyond::Repeat);
            assert_eq!(tile, Vec3::ZERO);
        }
    }

    #[test]
    fn bad_pixels_are_refused_with_their_place() {
        let with = |bad: f32| {
            let mut pixels = [Vec3::ONE; 6];
            pixels[4].y = bad;
            Texture::new(3, 2, &pixels)
        };
        let place = (1, 1);
        let (column, row) = place;
        assert_eq!(with(f32::NAN), Err(TextureError::NotFinite { column, row }));
        assert_eq!(with(f32::INFINITY), Err(TextureError::NotFinite { column, row }));
        assert_eq!(with(-0.25), Err(TextureError::Negative { column, row }));
        let bright = with(7.0).unwrap();
        assert_eq!(bright.color(Vec2::new(0.5, 0.75), &POINT, PLAIN), Vec3::ONE);
        assert!(Texture::new(0, 5, &[]).is_err());
        assert!(
            Texture::check_size(8192, 4096).is_ok() && Texture::check_size(8192, 4097).is_err()
        );
        assert!(Texture::check_size(usize::MAX, usize::MAX).is_err());
    }
}
