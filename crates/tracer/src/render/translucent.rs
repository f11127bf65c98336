//! Spheres that are not fully opaque: each one covers a part of what is behind it, its opacity.
//!
//! A ray that enters a sphere ends there with the probability of the opacity, or else passes the whole sphere in a
//! straight line, as it passes soft spray (stochastic transparency, Enderton et al. 2010). So the order of spheres does
//! not matter, and the expected coverage of several is `1 - (1 - a) (1 - b) ...`. Shadow rays are attenuated by all
//! spheres that they enter. A sphere in which a ray starts does not count.

use super::{
    context::RenderContext,
    dimensions::OPACITY,
    entries::{MAX_CROSSINGS, ends},
    lights::LightSamples,
    sampler::get_1d_lanes,
    scratch::PacketScratch,
    source::ShadeSource,
    stream::SegmentPacket,
};
use crate::surface::{Intersection, Shape, SphereEntries, TransmittanceProduct};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{LANES, lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::{Ray, RayPacket};

/// Binary digits of the transmittance at which a shadow ray ends: 1/4096.
const DARK: f32 = 12.0;

/// The spheres that `ray` enters, in order, for shapes without [`SphereEntries`].
fn entries(spheres: &dyn Shape, mut ray: Ray) -> impl Iterator<Item = Intersection> {
    let crossings = std::iter::from_fn(move || {
        let hit = spheres.nearest(&ray)?;
        ray.t_min = hit.t + hit.offset;
        Some((hit, hit.normal.dot(ray.direction) < 0.0))
    });
    let entries = crossings.take(MAX_CROSSINGS);
    entries.filter_map(|(hit, enters)| enters.then_some(hit))
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
        let Some(spheres) = self.shapes.translucent else {
            return;
        };
        // Find the rays near any of the spheres, and a random number for each
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
                    packet.hits.set(lane, &hit, spheres.material());
                    segments.rays.t_max[lane] = hit.t;
                }
            }
            return;
        };
        // Collect the spheres along each ray; a visit ends where none behind can matter
        for lane in lanes_in(lanes) {
            packet.entries[lane].start(u[lane]);
        }
        all.visit_entries(&segments.rays, lanes, &mut |lane, entry| {
            let opacity = self.source.opacity(entry.particle);
            if opacity > 0.0 { packet.entries[lane].add(entry, opacity) } else { None }
        });
        // End the rays at the spheres that the numbers choose
        for lane in lanes_in(lanes) {
            if let Some(entry) = packet.entries[lane].end(u[lane]) {
                let hit = all.intersection(&segments.rays.ray(lane), entry);
                packet.hits.set(lane, &hit, spheres.material());
                segments.rays.t_max[lane] = entry.t;
            }
        }
    }

    /// Multiplies the radiance of light samples by the part of their shadow rays that spheres which are not fully
    /// opaque let through.
    pub(super) fn attenuate_by_opacity(&self, samples: &mut LightSamples, coherence: Coherence) {
        let Some(spheres) = self.shapes.translucent.filter(|_| samples.lanes != 0) else {
            return;
        };
        // Multiply the transmittance of all spheres on the way, until too little light is left
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
        // Dark samples are dropped
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
