//! Soft spray: each drop is a ball of fog that is densest at its centre and fades out towards its silhouette, so that
//! many of them are a white cluster.
//!
//! A ray that enters a drop ends there with the probability of its opacity along the ray, or else passes it, as it
//! passes a pane. Shadow rays are attenuated by all drops that they enter. The drop in which a ray starts does not
//! count: the BSDF (`bsdf/foam.rs`) has the light that it scatters itself.

use super::{
    context::RenderContext, dimensions::SPRAY, lights::LightSamples, sampler::get_1d_lanes,
    scratch::PacketScratch, stream::SegmentPacket,
};
use spherule_surface::{Intersection, MaterialId, Shape};
use spherule_tree::accel::Coherence;
use spherule_tree::math::functions::exp;
use spherule_tree::math::{lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::Ray;

/// Maximum number of drops along a ray; further ones are not there.
const MAX_DROPS: usize = 256;

/// Optical depth of a drop through its centre, tuned by eye.
const OPTICAL_DEPTH: f32 = 2.5;

/// Transmittance below which a shadow ray ends.
const MIN_TRANSMITTANCE: f32 = 1.0 / 4096.0;

/// The part of the light that a drop takes away from a ray that enters it at this absolute `cosine` to the normal. The
/// extinction falls off from the centre like `1 - (distance / radius)^2`, so the optical depth along a chord grows with
/// the third power of its length.
fn opacity(cosine: f32) -> f32 {
    1.0 - exp(-OPTICAL_DEPTH * cosine * cosine * cosine)
}

/// Where a ray enters a drop, and the opacity of the drop.
struct Entry {
    hit: Intersection,
    opacity: f32,
}

/// The next drop that `ray` enters; moves its start behind that point.
fn next_entry(spray: &dyn Shape, ray: &mut Ray) -> Option<Entry> {
    for _ in 0..MAX_DROPS {
        let hit = spray.nearest(ray)?;
        ray.t_min = hit.t + hit.offset;
        let cosine = -hit.normal.dot(ray.direction);
        if cosine > 0.0 {
            let opacity = opacity(cosine.min(1.0));
            return Some(Entry { hit, opacity });
        }
    }
    None
}

impl RenderContext<'_> {
    /// Ends some of the rays at drops of soft spray before their intersections.
    pub(super) fn meet_spray(
        &self,
        segments: &mut SegmentPacket,
        coherence: Coherence,
        packet: &mut PacketScratch,
    ) {
        let Some(spray) = self.shapes.soft_spray else {
            return;
        };
        // Find the rays near any drop
        let lanes = spray.occluded(&segments.rays, coherence, segments.lanes());
        if lanes == 0 {
            return;
        }
        // Choose a random number for each ray
        let mut u = splat(0.0);
        let sample = segments.sample.map(|s| s % self.settings.samples);
        get_1d_lanes(self.simd, &segments.path, SPRAY, &sample, &mut u);
        // Pass drops until the number chooses one
        for lane in lanes_in(lanes) {
            let (mut rest, mut u) = (segments.rays.ray(lane), u[lane]);
            for _ in 0..MAX_DROPS {
                let Some(Entry { hit, opacity }) = next_entry(spray, &mut rest) else {
                    break;
                };
                if u < opacity {
                    packet.hits.set(lane, &hit, MaterialId::SPRAY);
                    segments.rays.t_max[lane] = hit.t;
                    break;
                }
                // The rest of the number is random, too
                u = (u - opacity) / (1.0 - opacity);
            }
        }
    }

    /// Multiplies the radiance of light samples by the transmittance of soft spray on their shadow rays.
    pub(super) fn attenuate_by_spray(&self, samples: &mut LightSamples, coherence: Coherence) {
        let Some(spray) = self.shapes.soft_spray.filter(|_| samples.lanes != 0) else {
            return;
        };
        for lane in lanes_in(spray.occluded(&samples.rays, coherence, samples.lanes)) {
            let (mut rest, mut transmittance) = (samples.rays.ray(lane), 1.0);
            for _ in 0..MAX_DROPS {
                let Some(Entry { opacity, .. }) = next_entry(spray, &mut rest) else {
                    break;
                };
                transmittance *= 1.0 - opacity;
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
