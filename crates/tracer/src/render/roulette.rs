//! Path splitting: decides which of the two rays that leave a transmissive surface are traced.
//!
//! Taken literally, eq. 4.1 doubles the number of rays at each depth. So both rays are traced only while the lesser
//! one carries enough of its sample; below that, one of them is chosen at random (Russian roulette; Arvo and Kirk,
//! "Particle transport and image synthesis", 1990). The sum of both weights is preserved, and the expected value of
//! each. Random numbers depend on the pixel, the sample and the path, so the choice does not depend on threads.

use super::{
    dimensions::BRANCH,
    sampler::PathSeed,
    scene_shapes::Interior,
    settings::{MAX_DEPTH, RenderSettings},
};

/// Path weight in a connected body from which both rays are traced, per sample of a pixel: the threshold grows with
/// the number of samples, because many samples average out the noise of a random choice. Bounded by
/// [`MIN_SPLIT_WEIGHT`] for few samples.
const SPLIT_WEIGHT: f32 = 1.0 / 80.0;

/// A ray with this weight is visible in an image of one sample per pixel.
const MIN_SPLIT_WEIGHT: f32 = 0.02;

/// Probability (before it is clamped to 1) of tracing the lesser ray at the first crossing of a connected body if its
/// weight equals the splitting threshold; proportional to the weight below that. Directly visible surfaces get more
/// rays, because noise is most visible there.
const FIRST_CHANCE: f32 = 2.0;

/// Decides from which path weight both rays are traced.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplitRule {
    /// Path weight of the lesser ray from which both are traced.
    pub(super) least: f32,
    /// Whether the lesser ray of a first crossing may be traced in addition to the greater one below that weight.
    favors_first: bool,
}

impl SplitRule {
    /// The rule for particles with that interior. Only one ray leaves an opaque surface.
    pub(super) fn new(settings: &RenderSettings, interior: Interior) -> Self {
        let least = match interior {
            Interior::Opaque => f32::INFINITY,
            Interior::Spheres => settings.min_weight,
            Interior::Body | Interior::Nested => {
                (SPLIT_WEIGHT * settings.samples as f32).clamp(MIN_SPLIT_WEIGHT, 1.0)
            }
        };
        Self { least, favors_first: matches!(interior, Interior::Body | Interior::Nested) }
    }

    /// Maximum number of rays of one sample at any depth: the path weights of a sample never add up to more than 1. Where
    /// free paths in coloured media choose a channel, there may be three times as many.
    pub(super) fn max_paths(&self, max_depth: u32) -> usize {
        let by_depth = 1_usize << (max_depth.min(MAX_DEPTH) - 1).min(30);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let by_weight = (1.0 / self.least) as usize;
        let by_weight = by_weight.saturating_add(usize::from(self.favors_first));
        by_depth.min(by_weight).max(1)
    }

    /// The weights with which the reflected and the refracted ray are traced, given their own `weights`; 0 for a ray
    /// that is not. `arriving` is the path weight of the incoming ray, at `depth`; `sample` is the index of the
    /// sample in its pixel.
    pub(super) fn weights(
        &self,
        weights: [f32; 2],
        arriving: f32,
        depth: u32,
        path: PathSeed,
        sample: u32,
    ) -> [f32; 2] {
        // Trace both rays if the lesser one has enough weight
        let [reflected, refracted] = weights;
        let both = reflected + refracted;
        let lesser = reflected.min(refracted);
        let splits = arriving * lesser >= self.least;
        if lesser <= 0.0 || splits {
            return weights;
        }
        // Compute the probability of the lesser ray
        let is_first = self.favors_first && depth == 1;
        let share = lesser / both;
        let chance = if is_first {
            let probability = FIRST_CHANCE * arriving * lesser / self.least;
            probability.min(1.0).max(share)
        } else {
            share
        };
        // Choose, and compensate the weights
        let of_lesser = match (path.get_1d(BRANCH, sample) < chance, is_first) {
            (false, _) => 0.0,
            (true, true) => lesser / chance,
            (true, false) => both,
        };
        if reflected < refracted {
            [of_lesser, both - of_lesser]
        } else {
            [both - of_lesser, of_lesser]
        }
    }
}
