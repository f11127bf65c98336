//! The spheres along a ray at which it may end, found in any order (`translucent.rs`).

use spherule_surface::SphereEntry;
use spherule_tree::math::functions::log2;

/// Maximum number of surfaces of spheres along a ray; further ones are not there.
pub(super) const MAX_CROSSINGS: usize = 4096;

/// Whether a ray with the random number `u` ends at a surface of this `opacity`. The rest of the number is random, too.
#[inline(always)]
pub(super) fn ends(u: &mut f32, opacity: f32) -> bool {
    if *u < opacity {
        return true;
    }
    *u = (*u - opacity) / (1.0 - opacity);
    false
}

/// Spheres that a ray enters, in order, as far as it may come: found in any order.
#[derive(Debug, Default)]
pub(super) struct Entries {
    /// With their opacity, and the binary digits that they take from the transmittance.
    spheres: Vec<(SphereEntry, f32, f32)>,
    /// The sum of these digits.
    digits: f32,
    /// Digits after which the ray has certainly ended.
    enough: f32,
}

impl Entries {
    /// Starts the search for a ray with the random number `u`, which ends where the transmittance falls below `1 - u`.
    pub(super) fn start(&mut self, u: f32) {
        self.spheres.clear();
        // A margin covers all rounding: few spheres more cost little
        *self = Self {
            enough: 0.001 - 1.05 * log2(1.0 - u),
            digits: 0.0,
            spheres: std::mem::take(&mut self.spheres),
        };
    }

    /// Adds a sphere. Returns the distance behind which others do not matter, if it is known.
    #[inline]
    pub(super) fn add(&mut self, entry: SphereEntry, opacity: f32) -> Option<f32> {
        // Without this, full opacity would have infinitely many digits
        let digits = if opacity < 1.0 { -log2(1.0 - opacity) } else { 127.0 };
        let is_before =
            |other: &SphereEntry| (other.t, other.particle) <= (entry.t, entry.particle);
        let before = self.spheres.iter().rposition(|(other, ..)| is_before(other));
        self.spheres.insert(before.map_or(0, |i| i + 1), (entry, opacity, digits));
        self.digits += digits;
        // Remove those that the ray does not reach
        while let Some((_, _, last)) = self.spheres.last()
            && (self.digits - last > self.enough || self.spheres.len() > MAX_CROSSINGS / 2)
        {
            self.digits -= last;
            self.spheres.pop();
        }
        let is_complete = self.digits > self.enough || self.spheres.len() == MAX_CROSSINGS / 2;
        self.spheres.last().filter(|_| is_complete).map(|(last, ..)| last.t)
    }

    /// The sphere at which the ray with the random number `u` ends.
    pub(super) fn end(&self, mut u: f32) -> Option<&SphereEntry> {
        let end = self.spheres.iter().find(|(_, opacity, _)| ends(&mut u, *opacity));
        end.map(|(entry, ..)| entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(t: f32, particle: u32) -> SphereEntry {
        SphereEntry { t, particle, slot: particle }
    }

    #[test]
    fn the_end_does_not_depend_on_the_order_in_which_spheres_are_found() {
        let spheres: Vec<(SphereEntry, f32)> = (0..40_u16)
            .map(|i| {
                let t = f32::from(i * 7 % 40 / 2);
                (entry(t, i.into()), f32::from(i * 11 % 17) / 16.0 * 0.3)
            })
            .collect();
        let mut sorted = spheres.clone();
        sorted.sort_by(|(a, _), (b, _)| a.t.total_cmp(&b.t).then(a.particle.cmp(&b.particle)));
        for i in 0..200_u16 {
            let u = f32::from(i) / 200.0;
            let mut rest = u;
            let expected = sorted.iter().find(|(_, opacity)| ends(&mut rest, *opacity));
            for turn in 0..spheres.len() {
                let mut entries = Entries::default();
                entries.start(u);
                let mut limit = f32::INFINITY;
                for (entry, opacity) in spheres[turn..].iter().chain(&spheres[..turn]) {
                    if entry.t <= limit && *opacity > 0.0 {
                        limit = entries.add(*entry, *opacity).unwrap_or(limit);
                    }
                }
                assert_eq!(entries.end(u), expected.map(|(entry, _)| entry), "{u} {turn}");
            }
        }
    }

    #[test]
    fn opaque_spheres_end_all_rays() {
        for u in [0.0, 0.5, 1.0 - 0.5 * f32::EPSILON] {
            let mut entries = Entries::default();
            entries.start(u);
            assert_eq!(entries.add(entry(3.0, 0), 1.0), Some(3.0));
            assert_eq!(entries.add(entry(2.0, 1), 1.0), Some(2.0));
            assert_eq!(entries.end(u), Some(&entry(2.0, 1)));
        }
    }
}
