//! Adaptive sampling: tiles with more noise than a limit take more samples.
//!
//! A tile is rendered with few samples. If its noise is above the limit, it is rendered again with as many as the limit
//! is expected to need, at least a third more and at most eight times as many, until it is below. What was rendered before
//! is not used, so each tile equals that of a picture in which all pixels have its number of samples, with all its planes.
//! The passes before the last one usually cost a third to a half of it.

use super::film::FilmTile;
use super::integrator::Integrator;
use super::noise::TileNoise;
use super::ray_counts::RayCounts;
use super::scratch::Scratch;
use super::settings::NoiseLimit;
use super::stop::Stop;

/// Each pass has at most this many times the samples of the one before, because one bright sample raises the expected
/// number far too high.
const MAX_GROWTH: f64 = 8.0;

/// How many more samples are taken than are expected to be needed, so that few passes are in vain.
const MARGIN: f64 = 1.1;

/// The integrators of the passes, with more and more samples, and the limit of the noise.
pub(super) struct Passes<'a> {
    pub(super) integrators: Vec<Box<dyn Integrator + 'a>>,
    pub(super) limit: Option<NoiseLimit>,
}

impl Passes<'_> {
    /// Renders all pixels of `tile`. Returns `None` if `stop` is raised.
    pub(super) fn render_tile(
        &self,
        tile: &mut FilmTile<'_>,
        stop: &dyn Stop,
        scratch: &mut Scratch,
    ) -> Option<RayCounts> {
        let Some(limit) = self.limit else {
            return self.integrators[0].render_tile(tile, stop, scratch);
        };
        let pixels = u64::from(tile.width * tile.rows);
        let first = self.samples(0);
        let (mut pass, mut before) = (0, RayCounts::default());
        loop {
            // Render the tile, and measure its noise
            scratch.group.noise = Some(TileNoise::default());
            let mut counts = self.integrators[pass].render_tile(tile, stop, scratch)?;
            let noise = scratch.group.noise.take().unwrap_or_default().mean();
            let is_last = pass + 1 == self.integrators.len();
            let is_below = noise <= f64::from(limit.noise);
            if is_below || is_last {
                // Light that earlier passes have lost is not missing in the picture
                counts.lost = counts.lost.of_samples(self.samples(pass), first);
                counts.kept = pixels * u64::from(self.samples(pass));
                counts.noisy_pixels = if is_below { 0 } else { pixels };
                return Some(before + counts);
            }
            before = before + counts.without_lost();
            pass = self.next(pass, noise / f64::from(limit.noise));
        }
    }

    /// Samples per pixel.
    fn samples(&self, pass: usize) -> u32 {
        self.integrators[pass].context().settings.samples
    }

    /// The pass after `pass`, whose noise was `excess` times the limit: noise falls with the root of the number of
    /// samples.
    fn next(&self, pass: usize, excess: f64) -> usize {
        let samples = self.samples(pass);
        let growth = (MARGIN * excess * excess).min(MAX_GROWTH);
        let needed = f64::from(samples) * growth;
        let is_enough = |other: &usize| f64::from(self.samples(*other)) >= needed;
        let last = self.integrators.len() - 1;
        (pass + 1..last).find(is_enough).unwrap_or(last)
    }
}
