//! Free paths in media that scatter light: how far rays get, and what weight their paths have.
//!
//! A ray travels a free path, whose length is distributed as the transmittance falls. If the path ends before the ray
//! meets a surface, the ray scatters there. The media of a scene differ in their extinction by colour channel, so the
//! length is sampled for one channel, chosen in proportion to the throughput of the path, and weighted by the mean
//! density of all channels: the balance heuristic for one sample (Pharr, Jakob and Humphreys, "Physically Based
//! Rendering", 4th edition, section 14.2; Kutz, Habel, Li and Novak, "Spectral and decomposition tracking for rendering
//! heterogeneous volumes", 2017). With one coefficient for all channels, the weight of a ray that meets a surface is 1,
//! and that of one that scatters is the albedo.
//!
//! Media that only absorb light end no path. `media.rs` finds the media along rays.

use glam::Vec3;

use super::body_set::BodySet;
use super::density_profile::DensityProfile;
use crate::scene::Material;
use spherule_tree::math::functions::{exp, ln};
use spherule_tree::math::{LANES, Lanes};

/// A part of a ray that is in one medium. It begins where the part before it ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct MediumPart {
    /// Distance along the ray.
    pub(super) end: f32,
    /// Coefficients, per length, where the density is 1.
    pub(super) extinction: Vec3,
    pub(super) scattering: Vec3,
    pub(super) anisotropy: f32,
    /// The density along the part.
    pub(super) profile: DensityProfile,
    /// Whether it is in mist, outside all bodies.
    pub(super) is_mist: bool,
    /// The body whose surface the ray passes straight at the end, if there may be several.
    pub(super) crossed: BodySet,
}

impl MediumPart {
    /// Air up to a distance.
    pub(super) const fn air(end: f32) -> Self {
        Self {
            end,
            extinction: Vec3::ZERO,
            scattering: Vec3::ZERO,
            anisotropy: 0.0,
            profile: DensityProfile::CONSTANT,
            is_mist: false,
            crossed: BodySet::EMPTY,
        }
    }

    /// The medium of a `material` with this extinction up to a distance.
    pub(super) const fn of(material: &Material, extinction: Vec3, end: f32) -> Self {
        let Material { scattering, anisotropy, .. } = *material;
        Self { extinction, scattering, anisotropy, ..Self::air(end) }
    }

    /// Mist with these coefficients at its base up to a distance.
    pub(super) fn of_mist(
        extinction: f32,
        albedo: Vec3,
        anisotropy: f32,
        profile: DensityProfile,
        end: f32,
    ) -> Self {
        Self {
            extinction: Vec3::splat(extinction),
            scattering: extinction * albedo,
            anisotropy,
            profile,
            is_mist: true,
            ..Self::air(end)
        }
    }

    pub(super) fn scatters(&self) -> bool {
        self.scattering != Vec3::ZERO
    }

    /// The coefficient that free paths are sampled by.
    fn sampled(&self) -> Vec3 {
        if self.scatters() { self.extinction } else { Vec3::ZERO }
    }
}

/// The media along the rays of a packet.
#[derive(Debug, Default)]
pub(super) struct MediaAlong {
    /// Whether media attenuate rays and never scatter them.
    pub(super) only_attenuate: bool,
    pub(super) parts: [Vec<MediumPart>; LANES],
    /// Probability of each colour channel.
    pub(super) channels: [Vec3; LANES],
    /// Length of the free path of each ray; infinite if it does not end.
    pub(super) free_path: Lanes,
    /// Lanes of rays in media that scatter light.
    pub(super) sampled: u32,
    /// Lanes of rays that end in a medium, and have no intersection.
    pub(super) scattered: u32,
    /// Those of them that end in mist.
    pub(super) in_mist: u32,
    /// Those of them that would meet a surface otherwise, whose data stay in the intersections.
    pub(super) hidden: u32,
    /// The anisotropy of the medium in which each of them ends.
    pub(super) anisotropy: Lanes,
}

impl MediaAlong {
    /// Forgets all rays.
    pub(super) const fn clear(&mut self) {
        (self.sampled, self.scattered) = (0, 0);
        (self.in_mist, self.hidden) = (0, 0);
    }

    /// The weight of the ray in `lane` if it passes all media up to a distance.
    pub(super) fn passing_weight(&self, lane: usize, distance: f32) -> Vec3 {
        weight(&self.parts[lane], self.channels[lane], distance, false)
    }
}

/// The distance at which the free path of a colour `channel` ends; infinite if it is longer than `parts`. `u` is uniform
/// in 0..1.
pub(super) fn free_path(parts: &[MediumPart], channel: usize, u: f32) -> f32 {
    // Optical depth that is left
    let (mut left, mut from) = (-ln(1.0 - u), 0.0_f32);
    for part in parts {
        let coefficient = part.sampled()[channel];
        let depth = coefficient * part.profile.equal_length((part.end - from).max(0.0));
        if left < depth {
            return (from + part.profile.length_of(left / coefficient)).min(part.end);
        }
        left -= depth;
        from = from.max(part.end);
    }
    f32::INFINITY
}

/// The transmittance of `parts` up to a distance, over the mean density of all `channels` with their probabilities that a
/// free path ends there, which `scatters`, or does not end before.
pub(super) fn weight(parts: &[MediumPart], channels: Vec3, distance: f32, scatters: bool) -> Vec3 {
    let (mut depth, mut sampled, mut from) = (Vec3::ZERO, Vec3::ZERO, 0.0_f32);
    let mut last = None;
    for part in parts {
        let length = part.profile.equal_length((part.end.min(distance) - from).max(0.0));
        depth += length * part.extinction;
        sampled += length * part.sampled();
        if distance <= part.end {
            last = Some(part);
            break;
        }
        from = from.max(part.end);
    }
    let transmittance = depth.map(|depth| exp(-depth));
    let passing = sampled.map(|depth| exp(-depth));
    // Coefficients relative to the largest, whose products with probabilities are neither too large nor too small
    let (albedo, ending) = match last.filter(|_| scatters) {
        None => (Vec3::ONE, Vec3::ONE),
        Some(part) => {
            let largest = part.extinction.max_element();
            (part.scattering / largest, part.extinction / largest)
        }
    };
    let density = channels.dot(passing * ending);
    if density > 0.0 { transmittance * albedo / density } else { Vec3::ZERO }
}

/// Probabilities of the colour channels for a path with this throughput.
pub(super) fn channel_chances(throughput: Vec3) -> Vec3 {
    let sum = throughput.element_sum();
    // Paths without light, or with values that are not finite
    let is_usual = sum > 0.0 && sum < f32::INFINITY && throughput.min_element() >= 0.0;
    if is_usual { throughput / sum } else { Vec3::splat(1.0 / 3.0) }
}

/// The channel that a number in 0..1 chooses.
pub(super) fn channel_of(chances: Vec3, u: f32) -> usize {
    let second = chances.x + chances.y;
    usize::from(u >= chances.x) + usize::from(u >= second)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of absorption and scattering up to a distance.
    fn part(end: f32, absorption: Vec3, scattering: Vec3) -> MediumPart {
        let material = Material { scattering, ..Material::DEFAULT };
        MediumPart::of(&material, absorption + scattering, end)
    }

    #[track_caller]
    fn assert_near(found: Vec3, expected: Vec3, limit: f32) {
        let error = (found - expected).abs().max_element();
        assert!(error < limit, "{found} is not {expected}");
    }

    /// Points of a grid in the unit square.
    fn grid(side: u16) -> impl Iterator<Item = [f32; 2]> {
        let at = move |i: u16| (f32::from(i) + 0.5) / f32::from(side);
        (0..side).flat_map(move |x| (0..side).map(move |y| [at(x), at(y)]))
    }

    #[test]
    fn free_paths_have_the_mean_of_the_transmittance() {
        let (red, blue) = (Vec3::new(1.4, 0.3, 0.0), Vec3::new(0.1, 0.2, 0.9));
        let parts = [
            part(0.5, red, blue),
            MediumPart::air(0.9),
            part(1.2, blue, Vec3::ZERO),
            part(2.0, Vec3::ZERO, red),
        ];
        let depth = 0.5 * (red + blue) + 0.3 * blue + 0.8 * red;
        for throughput in [Vec3::ONE, Vec3::new(0.1, 1.0, 0.4), Vec3::new(0.0, 1.0, 2.0)] {
            let chances = channel_chances(throughput);
            let (mut passed, mut scattered, count) = (Vec3::ZERO, Vec3::ZERO, 65_536.0);
            for [u, v] in grid(256) {
                let end = free_path(&parts, channel_of(chances, u), v);
                if end < 2.0 {
                    scattered += weight(&parts, chances, end, true) / count;
                } else {
                    passed += weight(&parts, chances, 2.0, false) / count;
                }
            }
            // Channels without light have no weight in the picture, whatever it is
            let is_lit =
                |values: Vec3| Vec3::select(throughput.cmpgt(Vec3::ZERO), values, Vec3::ZERO);
            assert_near(is_lit(passed), is_lit((-depth).exp()), 4e-3);
            // The part that scatters: what each part takes of the light that arrives, by its albedo
            let first = (1.0 - (-0.5 * (red + blue)).exp()) * blue / (red + blue);
            let before_last = (-(0.5 * (red + blue) + 0.3 * blue)).exp();
            let last = before_last * (1.0 - (-0.8 * red).exp());
            assert_near(is_lit(scattered), is_lit(first + last), 4e-3);
        }
    }

    #[test]
    fn extreme_coefficients_have_finite_weights() {
        for coefficient in [f32::MIN_POSITIVE, 1e-30, 1e30, f32::MAX] {
            let scattering = Vec3::new(coefficient, 1.0, 0.0);
            let parts = [part(1.0, Vec3::ZERO, scattering)];
            for [u, v] in grid(32) {
                let chances = Vec3::splat(1.0 / 3.0);
                let end = free_path(&parts, channel_of(chances, u), v);
                let found = weight(&parts, chances, end.min(1.0), end < 1.0);
                assert!(found.is_finite() && found.max_element() < 3.01, "{coefficient}: {found}");
            }
        }
        // Paths without light choose any channel
        for throughput in [Vec3::ZERO, Vec3::splat(f32::NAN), Vec3::splat(f32::INFINITY)] {
            assert!((channel_chances(throughput).element_sum() - 1.0).abs() < 1e-6);
        }
    }
}
