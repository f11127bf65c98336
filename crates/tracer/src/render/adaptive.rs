//! Adaptive sampling: tiles with more noise than a limit take more samples.
//!
//! A tile is rendered with few samples. If its noise is above the limit, another pass over it takes as many more as the
//! limit is expected to need, with other random numbers, until all passes together are below. Planes of the nearest sample
//! of a pixel are those of the first pass.

use super::film::FilmTile;
use super::integrator::Integrator;
use super::noise::TileNoise;
use super::ray_counts::RayCounts;
use super::scratch::Scratch;
use super::settings::NoiseLimit;
use super::stop::Stop;

/// A pass makes at most this many times as many samples of those before, because one bright sample raises the expected
/// number far too high.
const MAX_GROWTH: f64 = 8.0;

/// How many more samples are taken than are expected to be needed, so that there are few passes.
const MARGIN: f64 = 1.05;

/// The integrators of the passes, with more and more samples, and the limit of the noise.
pub(super) struct Passes<'a> {
    pub(super) integrators: Vec<Box<dyn Integrator + 'a>>,
    /// The one of the first pass over a tile.
    pub(super) first: usize,
    /// Samples per pixel that were asked for, which lost light is counted for.
    pub(super) samples: u32,
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
            return self.integrators[self.first].render_tile(tile, stop, scratch);
        };
        let mut joined: Option<Joined> = None;
        let (mut counts, mut number) = (RayCounts::default(), Some(self.first));
        scratch.group.pass = 0;
        while let Some(pass) = number {
            // Render the tile, and measure its noise
            scratch.group.noise = Some(TileNoise::default());
            counts = counts + self.integrators[pass].render_tile(tile, stop, scratch)?;
            let noise = scratch.group.noise.take().unwrap_or_default().mean();
            let this = Joined { samples: self.samples_of(pass), noise };
            scratch.group.pass += 1;
            // Join it with the passes before
            let all = match (joined, scratch.earlier.take()) {
                (Some(before), Some(earlier)) => {
                    tile.join(&earlier, before.share(this));
                    before.with(this)
                }
                _ => this,
            };
            joined = Some(all);
            number = self.next(all, limit);
            scratch.earlier = number.map(|_| tile.pass());
        }
        let all = joined?;
        let pixels = u64::from(tile.width * tile.rows);
        counts.lost = counts.lost.of_samples(all.samples, self.samples);
        counts.samples = pixels * u64::from(all.samples);
        counts.noisy_pixels = if all.noise <= f64::from(limit.noise) { 0 } else { pixels };
        Some(counts)
    }

    /// Samples per pixel of a pass.
    fn samples_of(&self, pass: usize) -> u32 {
        self.integrators[pass].context().settings.samples
    }

    /// The next pass over a tile with `all` passes so far, if its noise is above the limit and it may have more samples.
    fn next(&self, all: Joined, limit: NoiseLimit) -> Option<usize> {
        let excess = all.noise / f64::from(limit.noise);
        if excess <= 1.0 {
            return None;
        }
        // Noise falls with the root of the number of samples
        let growth = (MARGIN * excess * excess).min(MAX_GROWTH);
        let needed = f64::from(all.samples) * (growth - 1.0);
        let left = limit.most_samples(self.samples_of(self.first)).saturating_sub(all.samples);
        let possible =
            (0..self.integrators.len()).take_while(|pass| self.samples_of(*pass) <= left);
        let is_enough = |pass: &usize| f64::from(self.samples_of(*pass)) >= needed;
        possible.clone().find(is_enough).or(possible.last())
    }
}

/// Passes over a tile.
#[derive(Clone, Copy)]
struct Joined {
    /// Samples per pixel.
    samples: u32,
    /// Noise of the tile.
    noise: f64,
}

impl Joined {
    /// The share of these passes in the samples of them and `other`.
    fn share(self, other: Self) -> f32 {
        self.samples as f32 / (self.samples + other.samples) as f32
    }

    /// These and `other`, whose noise is independent.
    fn with(self, other: Self) -> Self {
        let samples = self.samples + other.samples;
        let squares = [self, other].map(|of| (of.noise * f64::from(of.samples)).powi(2));
        Self { samples, noise: squares.iter().sum::<f64>().sqrt() / f64::from(samples) }
    }
}
