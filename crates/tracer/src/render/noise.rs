//! The noise of a tile, for adaptive sampling.
//!
//! The noise of a pixel is the difference between the means of all its samples and of every second one, as it is seen:
//! relative to the square root of the brightness (Dammertz, Hanika, Keller and Lensch, "A hierarchical automatic stopping
//! condition for Monte Carlo global illumination", 2010). That of a tile is the root of the mean square over its pixels.

/// Brightness below which noise does not count more, a radiance.
const DARK: f32 = 0.01;

/// The noise of the pixels of a tile.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TileNoise {
    squares: f64,
    pixels: u32,
}

impl TileNoise {
    /// Adds a pixel, with the means of all its samples and of every second one.
    pub(super) fn add(&mut self, [r, g, b, a]: [f32; 4], odd: [f32; 4]) {
        let brightness = ((r + g + b) / 3.0).max(DARK);
        let of_color = ((r - odd[0]).abs() + (g - odd[1]).abs() + (b - odd[2]).abs()) / 3.0;
        let of_coverage = (a - odd[3]).abs();
        let noise = f64::from((of_color / brightness.sqrt()).max(of_coverage));
        self.squares += noise * noise;
        self.pixels += 1;
    }

    /// The noise of the tile.
    pub(super) fn mean(self) -> f64 {
        (self.squares / f64::from(self.pixels.max(1))).sqrt()
    }
}
