//! Which of the two rays that leave a transmissive surface are followed.
//!
//! Followed to the letter, eq. 4.1 doubles the rays at each depth. So both are followed only while the lesser one
//! carries enough of its sample; below that one of them is drawn (Russian roulette; Arvo and Kirk, "Particle transport
//! and image synthesis", 1990). The weights of both always add up to what they were, and so does their mean.
//! Draws come of the pixel, the sample and the path since, so that they do not depend on threads.

use super::{
    context::Interior,
    sampler::PathSeed,
    settings::{MAX_DEPTH, RenderSettings},
};

/// Path weight in a connected body from which on both rays are followed, times the samples of a pixel: noise that few
/// samples do not even out costs fewer rays than it is worth. Bounded by [`SPLIT_LEAST`] for few samples.
const SPLIT: f32 = 1.0 / 80.0;

/// A ray with this weight is seen in an image of one sample a pixel.
const SPLIT_LEAST: f32 = 0.02;

/// At the first crossing of a connected body the lesser ray is drawn with this chance where its weight is just that
/// of a split, else in proportion: what the camera sees first is seen best.
const FIRST_CHANCE: f32 = 2.0;

/// Continuations of a path.
pub(super) const REFLECTED: u32 = 0;
pub(super) const REFRACTED: u32 = 1;

/// The dimension of a path that decides which ray is followed.
const BRANCH: u32 = 0;

/// From which weight on both rays are followed.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplitRule {
    /// Path weight of the lesser ray from which on both are followed.
    pub(super) least: f32,
    /// Whether the lesser ray of a first crossing may be followed beside the greater one below that, too.
    favors_first: bool,
}

impl SplitRule {
    /// The rule for particles with that interior. Opaque surfaces leave one ray.
    pub(super) fn new(settings: &RenderSettings, interior: Interior) -> Self {
        let least = match interior {
            Interior::Opaque => f32::INFINITY,
            Interior::Spheres => settings.min_weight,
            Interior::Body => (SPLIT * settings.samples as f32).clamp(SPLIT_LEAST, 1.0),
        };
        Self {
            least,
            favors_first: interior == Interior::Body,
        }
    }

    /// Rays of one sample at any depth, at most: the path weights of a sample never add up to more than 1.
    pub(super) fn max_paths(&self, max_depth: u32) -> usize {
        let doubled = 1_usize << (max_depth.min(MAX_DEPTH) - 1).min(30);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates"
        )]
        let weighed = (1.0 / self.least) as usize;
        let weighed = weighed.saturating_add(usize::from(self.favors_first));
        doubled.min(weighed).max(1)
    }

    /// The weights with which the reflected and the refracted ray are followed, of their own `weights`. `arriving` is
    /// the path weight of the ray that they leave, at `depth`; `sample` is the number of the sample in its pixel.
    pub(super) fn weights(
        &self,
        weights: [f32; 2],
        arriving: f32,
        depth: u32,
        path: PathSeed,
        sample: u32,
    ) -> [f32; 2] {
        let [reflected, refracted] = weights;
        let both = reflected + refracted;
        let lesser = reflected.min(refracted);
        let splits = arriving * lesser >= self.least;
        if lesser <= 0.0 || splits {
            return weights;
        }
        let is_first = self.favors_first && depth == 1;
        let share = lesser / both;
        let chance = if is_first {
            let often = FIRST_CHANCE * arriving * lesser / self.least;
            often.min(1.0).max(share)
        } else {
            share
        };
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
