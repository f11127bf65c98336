//! Equirectangular maps of radiance, of any size.

use glam::{DVec3, Vec3};
use thiserror::Error;

use super::{COLUMNS, ROWS};

/// Maximum number of pixels of a map.
pub const MAX_MAP_PIXELS: u64 = 16_384 * 8192;

/// Reasons why pixels are not a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum MapError {
    /// It has no pixels, or too many.
    #[error(
        "the image has {width}x{height} pixels; an environment needs at least 2x1 and at most {MAX_MAP_PIXELS} \
         (16384x8192)"
    )]
    Size {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// It does not show all directions.
    #[error(
        "the image has {width}x{height} pixels; an equirectangular image of all directions is twice as wide as high"
    )]
    Shape {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// A component is NaN or infinite.
    #[error(
        "the pixel in column {column} and row {row} is NaN or infinite; replace it by a finite radiance"
    )]
    NotFinite {
        /// Column, from 0.
        column: usize,
        /// Row from the top, from 0.
        row: usize,
    },
}

/// Radiance by direction: the columns are longitudes from left to right, with the centre in front; the rows are
/// latitudes from the zenith to the nadir.
#[derive(Debug, Clone, PartialEq)]
pub struct RadianceMap {
    width: usize,
    height: usize,
    pixels: Vec<Vec3>,
    negative: usize,
}

impl RadianceMap {
    /// Checks whether a map may have this size.
    ///
    /// # Errors
    /// [`MapError::Size`] or [`MapError::Shape`].
    pub fn check_size(width: usize, height: usize) -> Result<(), MapError> {
        let count = width as u128 * height as u128;
        if width < 2 || height < 1 || count > u128::from(MAX_MAP_PIXELS) {
            return Err(MapError::Size { width, height });
        }
        // Rounding of a size by one pixel is harmless
        if width.abs_diff(2 * height) > 1 + width / 100 {
            return Err(MapError::Shape { width, height });
        }
        Ok(())
    }

    /// A map of `pixels`, row by row from the top, linear RGB. Negative components count as 0.
    ///
    /// # Errors
    /// See [`MapError`].
    ///
    /// # Panics
    /// If there are not `width * height` pixels.
    pub fn new(width: usize, height: usize, mut pixels: Vec<Vec3>) -> Result<Self, MapError> {
        Self::check_size(width, height)?;
        assert_eq!(pixels.len(), width * height, "one value per pixel");
        let mut negative = 0;
        for (place, pixel) in pixels.iter_mut().enumerate() {
            if !pixel.is_finite() {
                let (column, row) = (place % width, place / width);
                return Err(MapError::NotFinite { column, row });
            }
            negative += usize::from(pixel.min_element() < 0.0);
            *pixel = pixel.max(Vec3::ZERO);
        }
        Ok(Self { width, height, pixels, negative })
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The pixels, row by row from the top, linear RGB.
    pub(super) fn pixels(&self) -> &[Vec3] {
        &self.pixels
    }

    /// Changes a pixel.
    pub(super) fn set(&mut self, pixel: usize, radiance: Vec3) {
        self.pixels[pixel] = radiance;
    }

    /// Number of pixels with a negative component, which counts as 0.
    pub fn negative(&self) -> usize {
        self.negative
    }

    /// The map in the resolution of environments, for [`Environment::from_map`](super::Environment::from_map): a
    /// fraction of the memory, and the same environment.
    #[must_use]
    pub fn reduced(&self) -> Self {
        Self {
            width: COLUMNS,
            height: ROWS,
            pixels: self.resized(COLUMNS, ROWS),
            negative: self.negative,
        }
    }

    /// The map with another number of pixels: the mean over the solid angle of each new pixel.
    pub(super) fn resized(&self, width: usize, height: usize) -> Vec<Vec3> {
        let columns = overlaps(self.width, width, |x| x);
        let polar = |y: f64| 1.0 - libm::cos(y * std::f64::consts::PI);
        let rows = overlaps(self.height, height, polar);
        let mut resized = Vec::with_capacity(width * height);
        for row in &rows {
            // Average the rows of a new row, then its columns
            let mut line = vec![DVec3::ZERO; self.width];
            for (y, part) in row {
                let pixels = &self.pixels[y * self.width..(y + 1) * self.width];
                for (sum, pixel) in line.iter_mut().zip(pixels) {
                    *sum += *part * pixel.as_dvec3();
                }
            }
            resized.extend(columns.iter().map(|column| {
                let sum: DVec3 = column.iter().map(|(x, part)| *part * line[*x]).sum();
                sum.as_vec3()
            }));
        }
        resized
    }
}

/// For each of `new` equal intervals of 0..1, the `old` equal intervals that overlap it, with their parts of its
/// `measure`. The parts of an interval add up to 1.
fn overlaps(old: usize, new: usize, measure: impl Fn(f64) -> f64) -> Vec<Vec<(usize, f64)>> {
    let interval = |cell: usize| {
        let (low, high) = (cell as f64 / new as f64, (cell + 1) as f64 / new as f64);
        let whole = measure(high) - measure(low);
        let first = cell * old / new;
        let last = ((cell + 1) * old).div_ceil(new);
        let parts = (first..last).filter_map(|index| {
            let from = low.max(index as f64 / old as f64);
            let to = high.min((index + 1) as f64 / old as f64);
            let part = (measure(to) - measure(from)) / whole;
            (to > from && part > 0.0).then_some((index, part))
        });
        parts.collect()
    };
    (0..new).map(interval).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_an_interval_add_up() {
        for (old, new) in [(1, 5), (5, 1), (512, 256), (7, 512), (1000, 256)] {
            for parts in overlaps(old, new, |x| x * x) {
                let sum: f64 = parts.iter().map(|(_, part)| part).sum();
                assert!((sum - 1.0).abs() < 1e-9, "{old} {new}: {sum}");
                assert!(parts.iter().all(|(index, _)| *index < old));
            }
        }
    }

    #[test]
    fn other_sizes_have_the_same_total() {
        let pixels: Vec<Vec3> = (0..32_u8).map(|i| Vec3::splat(f32::from(i % 7))).collect();
        let map = RadianceMap::new(8, 4, pixels).unwrap();
        // The mean over the sphere, rows weighted by their solid angle.
        let mean = |pixels: &[Vec3], width: usize| -> f64 {
            let height = pixels.len() / width;
            let edge = |row: usize| (row as f64 * std::f64::consts::PI / height as f64).cos();
            let rows = pixels.chunks(width).enumerate();
            rows.map(|(row, pixels)| {
                let sum: f64 = pixels.iter().map(|p| f64::from(p.x)).sum();
                sum / width as f64 * 0.5 * (edge(row) - edge(row + 1))
            })
            .sum()
        };
        for (width, height) in [(2, 1), (4, 2), (12, 6), (512, 256)] {
            let resized = map.resized(width, height);
            let [old, new] = [mean(&map.pixels, 8), mean(&resized, width)];
            assert!((old - new).abs() < 1e-5, "{width}: {old} {new}");
        }
    }

    #[test]
    fn bad_maps_are_refused_with_their_reason() {
        let size =
            |width, height| RadianceMap::check_size(width, height).map_err(|e| e.to_string());
        assert_eq!(size(512, 256), Ok(()));
        assert_eq!(size(513, 256), Ok(()));
        assert!(size(0, 0).unwrap_err().contains("0x0"));
        assert!(size(1 << 20, 1 << 19).unwrap_err().contains("at most"));
        assert!(size(usize::MAX, usize::MAX / 2).is_err());
        assert!(size(1920, 1080).unwrap_err().contains("twice as wide"));
        let mut pixels = vec![Vec3::ONE; 8];
        pixels[6].y = f32::NAN;
        let error = RadianceMap::new(4, 2, pixels.clone()).unwrap_err();
        assert_eq!(error, MapError::NotFinite { column: 2, row: 1 });
        pixels[6].y = f32::INFINITY;
        assert!(RadianceMap::new(4, 2, pixels.clone()).is_err());
        pixels[6].y = -2.0;
        let map = RadianceMap::new(4, 2, pixels).unwrap();
        assert_eq!((map.negative(), map.pixels[6]), (1, Vec3::new(1.0, 0.0, 1.0)));
    }
}
