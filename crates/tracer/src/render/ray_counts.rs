//! Ray counters, and the light that a clamp takes away.

use glam::Vec3;

/// Light that a clamp takes away, as a sum over samples that does not depend on their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LostLight(u64);

impl LostLight {
    /// Nothing.
    pub const NONE: Self = Self(0);
    /// Steps of a unit of radiance, the sum of its components: finer than the noise of any picture.
    const STEPS: f32 = 4096.0;

    /// Light that another device has lost, in steps of 1/4096, each rounded down.
    pub const fn from_steps(steps: u64) -> Self {
        Self(steps)
    }

    /// Adds light that a sample has lost, linear RGB.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub(super) fn add(&mut self, radiance: Vec3) {
        let steps = (radiance.element_sum() * Self::STEPS) as u64;
        self.0 = self.0.saturating_add(steps);
    }

    /// The part of its light that a picture with the colours `kept` and so many samples per pixel has lost, 0 to 1.
    pub fn part(self, kept: &[[f32; 4]], samples: u32) -> f64 {
        if self == Self::NONE {
            return 0.0;
        }
        let lost = self.0 as f64 / f64::from(Self::STEPS) / f64::from(samples);
        let sum = |[r, g, b, _]: &[f32; 4]| f64::from(r + g + b);
        let kept: f64 = kept.iter().map(sum).filter(|sum| sum.is_finite()).sum();
        lost / (lost + kept.max(0.0))
    }

    /// The light of a tile with `samples` per pixel, as it would be with `others`.
    pub(super) fn of_samples(self, samples: u32, others: u32) -> Self {
        let scaled = u128::from(self.0) * u128::from(others) / u128::from(samples.max(1));
        Self(u64::try_from(scaled).unwrap_or(u64::MAX))
    }

    const fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

/// Number of rays traced, by purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// Camera rays.
    pub primary: u64,
    /// Shadow rays.
    pub shadow: u64,
    /// Reflected rays.
    pub reflection: u64,
    /// Refracted rays, into or out of a transmissive body.
    pub refraction: u64,
    /// Light that the clamp of indirect light took away.
    pub lost: LostLight,
    /// Adaptive sampling: samples of all pixels.
    pub samples: u64,
    /// Adaptive sampling: pixels of tiles that have the most samples and are still above the limit of noise.
    pub noisy_pixels: u64,
}

impl RayCounts {
    /// Number of all rays.
    pub const fn total(&self) -> u64 {
        self.primary + self.shadow + self.reflection + self.refraction
    }
}

impl std::ops::Add for RayCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            primary: self.primary + other.primary,
            shadow: self.shadow + other.shadow,
            reflection: self.reflection + other.reflection,
            refraction: self.refraction + other.refraction,
            lost: self.lost.plus(other.lost),
            samples: self.samples + other.samples,
            noisy_pixels: self.noisy_pixels + other.noisy_pixels,
        }
    }
}
