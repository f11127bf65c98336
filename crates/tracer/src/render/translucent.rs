//! Spheres that are not fully opaque: each one covers a part of what is behind it, its opacity.
//!
//! A ray that enters a sphere ends there with the probability of the opacity, or else passes the whole sphere in a
//! straight line, as it passes soft spray (stochastic transparency, Enderton et al. 2010). So the order of spheres does
//! not matter, and the expected coverage of several is `1 - (1 - a) (1 - b) ...`. Shadow rays are attenuated by all
//! spheres that they enter. A sphere in which a ray starts does not count.

use super::{
    context::RenderContext, dimensions::OPACITY, lights::LightSamples, sampler::get_1d_lanes,
    scratch::PacketScratch, stream::SegmentPacket,
};
use crate::surface::{Intersection, MaterialId, Shape};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::Ray;

/// Maximum number of surfaces of spheres along a ray; further ones are not there.
const MAX_CROSSINGS: usize = 4096;

/// Transmittance below which a shadow ray ends.
const MIN_TRANSMITTANCE: f32 = 1.0 / 4096.0;

/// The spheres that `ray` enters, in order.
fn entries(spheres: &dyn Shape, mut ray: Ray) -> impl Iterator<Item = Intersection> {
    let crossings = std::iter::from_fn(move || {
        let hit = spheres.nearest(&ray)?;
        ray.t_min = hit.t + hit.offset;
        Some((hit, hit.normal.dot(ray.direction) < 0.0))
    });
    let entries = crossings.take(MAX_CROSSINGS);
    entries.filter_map(|(hit, enters)| enters.then_some(hit))
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
        let lanes = spheres.occluded(&segments.rays, coherence, segments.lanes());
        if lanes == 0 {
            return;
        }
        let mut u = splat(0.0);
        let sample = segments.sample.map(|s| s % self.settings.samples);
        get_1d_lanes(self.simd, &segments.path, OPACITY, &sample, &mut u);
        for lane in lanes_in(lanes) {
            let mut u = u[lane];
            for hit in entries(spheres, segments.rays.ray(lane)) {
                let opacity = self.source.opacity(hit.particle);
                if u < opacity {
                    packet.hits.set(lane, &hit, MaterialId::PARTICLES);
                    segments.rays.t_max[lane] = hit.t;
                    break;
                }
                // The rest of the number is random, too
                u = (u - opacity) / (1.0 - opacity);
            }
        }
    }

    /// Multiplies the radiance of light samples by the part of their shadow rays that spheres which are not fully
    /// opaque let through.
    pub(super) fn attenuate_by_opacity(&self, samples: &mut LightSamples, coherence: Coherence) {
        let Some(spheres) = self.translucent.filter(|_| samples.lanes != 0) else {
            return;
        };
        for lane in lanes_in(spheres.occluded(&samples.rays, coherence, samples.lanes)) {
            let mut transmittance = 1.0;
            for hit in entries(spheres, samples.rays.ray(lane)) {
                transmittance *= 1.0 - self.source.opacity(hit.particle);
                if transmittance < MIN_TRANSMITTANCE {
                    samples.lanes &= !(1 << lane);
                    break;
                }
            }
            let radiance = transmittance * lane3(&samples.radiance, lane);
            set_lane3(&mut samples.radiance, lane, radiance);
        }
    }
}
