//! Spheres that are not fully opaque: each one covers a part of what is behind it, its opacity.
//!
//! A ray that enters a sphere ends there with the probability of the opacity, or else passes the whole sphere in a
//! straight line, as it passes soft spray (stochastic transparency, Enderton et al. 2010). So the order of spheres does
//! not matter, and the expected coverage of several is `1 - (1 - a) (1 - b) ...`. Shadow rays are attenuated by all
//! spheres that they enter. A sphere in which a ray starts does not count.

use super::{
    context::RenderContext, dimensions::OPACITY, lights::LightSamples, sampler::get_1d_lanes,
    scratch::PacketScratch, source::ShadeSource, stream::SegmentPacket,
};
use crate::surface::{
    Intersection, MaterialId, Shape, SphereEntries, SphereEntry, TransmittanceProduct,
};
use spherule_tree::accel::Coherence;
use spherule_tree::math::functions::log2;
use spherule_tree::math::{LANES, lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::{Ray, RayPacket};

/// Maximum number of surfaces of spheres along a ray; further ones are not there.
const MAX_CROSSINGS: usize = 4096;

/// Binary digits of the transmittance at which a shadow ray ends: 1/4096.
const DARK: f32 = 12.0;

/// The spheres that `ray` enters, in order: for shapes without [`SphereEntries`].
fn entries(spheres: &dyn Shape, mut ray: Ray) -> impl Iterator<Item = Intersection> {
    let crossings = std::iter::from_fn(move || {
        let hit = spheres.nearest(&ray)?;
        ray.t_min = hit.t + hit.offset;
        Some((hit, hit.normal.dot(ray.direction) < 0.0))
    });
    let entries = crossings.take(MAX_CROSSINGS);
    entries.filter_map(|(hit, enters)| enters.then_some(hit))
}

/// Whether a ray with the random number `u` ends at a surface of this `opacity`. The rest of the number is random, too.
#[inline(always)]
fn ends(u: &mut f32, opacity: f32) -> bool {
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
    fn start(&mut self, u: f32) {
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
    fn add(&mut self, entry: SphereEntry, opacity: f32) -> Option<f32> {
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
    fn end(&self, mut u: f32) -> Option<&SphereEntry> {
        let end = self.spheres.iter().find(|(_, opacity, _)| ends(&mut u, *opacity));
        end.map(|(entry, ..)| entry)
    }
}

/// The transmittance of the spheres that the rays of `lanes` enter.
fn transmittance(
    spheres: &dyn SphereEntries,
    source: &dyn ShadeSource,
    rays: &RayPacket,
    lanes: u32,
) -> [TransmittanceProduct; LANES] {
    let mut products = [TransmittanceProduct::default(); LANES];
    spheres.visit_entries(rays, lanes, &mut |lane, entry| {
        let product = &mut products[lane];
        product.multiply(1.0 - source.opacity(entry.particle));
        (product.digits() > DARK).then_some(-1.0)
    });
    products
}

impl RenderContext<'_> {
    /// Ends some of the rays at spheres that are not fully opaque, before their intersections.
    pub(super) fn meet_translucent(
        &self,
        segments: &mut SegmentPacket,
        coherence: Coherence,
        packet: &mut PacketScratch,
    ) {
        let Some(spheres) = self.translucent else {
            return;
        };
        let lanes = self.may_enter(spheres, &segments.rays, coherence, segments.lanes());
        if lanes == 0 {
            return;
        }
        let mut u = splat(0.0);
        let sample = segments.sample.map(|s| s % self.settings.samples);
        get_1d_lanes(self.simd, &segments.path, OPACITY, &sample, &mut u);
        // Find the sphere at which each ray ends
        let Some(all) = spheres.sphere_entries() else {
            for lane in lanes_in(lanes) {
                let u = &mut u[lane];
                let ends = |hit: &Intersection| ends(u, self.source.opacity(hit.particle));
                if let Some(hit) = entries(spheres, segments.rays.ray(lane)).find(ends) {
                    packet.hits.set(lane, &hit, MaterialId::PARTICLES);
                    segments.rays.t_max[lane] = hit.t;
                }
            }
            return;
        };
        for lane in lanes_in(lanes) {
            packet.entries[lane].start(u[lane]);
        }
        all.visit_entries(&segments.rays, lanes, &mut |lane, entry| {
            let opacity = self.source.opacity(entry.particle);
            if opacity > 0.0 { packet.entries[lane].add(entry, opacity) } else { None }
        });
        for lane in lanes_in(lanes) {
            if let Some(entry) = packet.entries[lane].end(u[lane]) {
                let hit = all.intersection(&segments.rays.ray(lane), entry);
                packet.hits.set(lane, &hit, MaterialId::PARTICLES);
                segments.rays.t_max[lane] = entry.t;
            }
        }
    }

    /// Multiplies the radiance of light samples by the part of their shadow rays that spheres which are not fully
    /// opaque let through.
    pub(super) fn attenuate_by_opacity(&self, samples: &mut LightSamples, coherence: Coherence) {
        let Some(spheres) = self.translucent.filter(|_| samples.lanes != 0) else {
            return;
        };
        let lanes = self.may_enter(spheres, &samples.rays, coherence, samples.lanes);
        let products = match spheres.sphere_entries() {
            Some(all) => transmittance(all, self.source, &samples.rays, lanes),
            None => std::array::from_fn(|lane| {
                let mut product = TransmittanceProduct::default();
                if lanes >> lane & 1 == 1 {
                    let mut hits = entries(spheres, samples.rays.ray(lane));
                    let _is_bright = hits.all(|hit| {
                        product.multiply(1.0 - self.source.opacity(hit.particle));
                        product.digits() <= DARK
                    });
                }
                product
            }),
        };
        for lane in lanes_in(lanes) {
            if products[lane].digits() > DARK {
                samples.lanes &= !(1 << lane);
            }
            let radiance = products[lane].value() * lane3(&samples.radiance, lane);
            set_lane3(&mut samples.radiance, lane, radiance);
        }
    }

    /// The lanes whose rays may enter spheres. A beam finds rays that do not faster than a search for all entries;
    /// a search for any hit with each ray does not.
    fn may_enter(
        &self,
        spheres: &dyn Shape,
        rays: &RayPacket,
        coherence: Coherence,
        lanes: u32,
    ) -> u32 {
        match coherence {
            Coherence::Incoherent if spheres.sphere_entries().is_some() => lanes,
            _ => spheres.occluded(rays, coherence, lanes),
        }
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
