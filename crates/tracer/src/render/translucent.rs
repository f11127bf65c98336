//! Spheres and grains that are not fully opaque: each one covers a part of what is behind it, its opacity.
//!
//! Grains are spheres here, whose entries are found one after the other. A ray that enters a sphere ends there with the
//! probability of the opacity, or else passes the whole sphere in a straight line, as it passes soft spray (stochastic
//! transparency, Enderton et al. 2010). So the order of spheres does not matter, and the expected coverage of several is
//! `1 - (1 - a) (1 - b) ...`. Shadow rays are attenuated by all
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
use spherule_surface::{Intersection, Intersections, Shape, SphereEntries, TransmittanceProduct};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{LANES, lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::RayPacket;

/// Binary digits of the transmittance at which a shadow ray ends: 1/4096.
const DARK: f32 = 12.0;

/// The spheres that the ray in `lane` enters, in order, for shapes without [`SphereEntries`].
fn entries(
    spheres: &dyn Shape,
    rays: &RayPacket,
    lane: usize,
) -> impl Iterator<Item = Intersection> {
    // A packet of one ray, since spheres may move
    let mut rest = RayPacket::default();
    rest.push(&rays.ray(lane));
    rest.time[0] = rays.time[lane];
    let crossings = std::iter::from_fn(move || {
        let (mut ray, mut hits) = (rest, Intersections::default());
        spheres.intersect(&mut ray, Coherence::Incoherent, 0, &mut hits);
        let hit = (hits.mask != 0).then(|| hits.get(0))?;
        rest.t_min[0] = hit.t + hit.offset;
        Some((hit, hit.normal.dot(rest.ray(0).direction) < 0.0))
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
        // Each shape has a random number of its own
        for (spheres, dimension) in self.shapes.translucent.iter().zip((0..=OPACITY).rev()) {
            self.meet_spheres(*spheres, dimension, (segments, coherence), packet);
        }
    }

    /// The same with the spheres of one shape, and the random numbers of a `dimension`.
    fn meet_spheres(
        &self,
        spheres: &dyn Shape,
        dimension: u32,
        (segments, coherence): (&mut SegmentPacket, Coherence),
        packet: &mut PacketScratch,
    ) {
        // Find the rays near any of the spheres, and a random number for each
        let lanes = self.may_enter(spheres, &segments.rays, coherence, segments.lanes());
        if lanes == 0 {
            return;
        }
        let mut u = splat(0.0);
        let sample = segments.sample.map(|s| s % self.settings.samples);
        get_1d_lanes(self.simd, &segments.path, dimension, &sample, &mut u);
        // Find the sphere at which each ray ends
        let Some(all) = spheres.sphere_entries() else {
            for lane in lanes_in(lanes) {
                let u = &mut u[lane];
                let ends = |hit: &Intersection| ends(u, self.source.opacity(hit.particle));
                let hit = entries(spheres, &segments.rays, lane).find(ends);
                if let Some(hit) = hit {
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
        for spheres in &self.shapes.translucent {
            if samples.lanes != 0 {
                self.attenuate_by_spheres(*spheres, samples, coherence);
            }
        }
    }

    /// The same with the spheres of one shape.
    fn attenuate_by_spheres(
        &self,
        spheres: &dyn Shape,
        samples: &mut LightSamples,
        coherence: Coherence,
    ) {
        // Multiply the transmittance of all spheres on the way, until too little light is left
        let lanes = self.may_enter(spheres, &samples.rays, coherence, samples.lanes);
        let products = match spheres.sphere_entries() {
            Some(all) => transmittance(all, self.source, &samples.rays, lanes),
            None => std::array::from_fn(|lane| {
                let mut product = TransmittanceProduct::default();
                if lanes >> lane & 1 == 1 {
                    let mut hits = entries(spheres, &samples.rays, lane);
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
