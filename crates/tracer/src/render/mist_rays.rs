//! Mist (`mist.rs`) along the rays of packets: the parts of paths in air, and what is left of shadow rays and photons.

use super::{
    body_set::BodySet, context::RenderContext, free_path::MediumPart, interface::leaving,
    lights::LightSamples, scene_shapes::Interior, scratch::PacketScratch, stream::SegmentPacket,
};
use spherule_surface::MaterialId;
use spherule_tree::math::{Lanes3, lane3, lanes_in, set_lane3};

impl RenderContext<'_> {
    /// Appends the parts of the ray in `lane` that are in air, between two distances, to those in `parts`.
    pub(super) fn push_air(
        &self,
        segments: &SegmentPacket,
        lane: usize,
        ends: [f32; 2],
        crossed: BodySet,
        parts: &mut Vec<MediumPart>,
    ) {
        match &self.mist {
            Some(mist) => mist.push_parts(&segments.rays.ray(lane), ends, crossed, parts),
            None if ends[1] < f32::INFINITY => {
                parts.push(MediumPart { crossed, ..MediumPart::air(ends[1]) });
            }
            None => {}
        }
    }

    /// Finds the mist along the rays outside all bodies. The parts of those inside are known.
    pub(super) fn find_mist(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        if self.mist.is_none() {
            return;
        }
        let PacketScratch { media, hits, .. } = packet;
        for lane in lanes_in(segments.lanes() & !segments.inside) {
            // A ray that leaves a separate sphere has passed through its medium
            if media.parts[lane].is_empty() {
                let is_hit = hits.mask >> lane & 1 == 1;
                let end = if is_hit { hits.t[lane] } else { f32::INFINITY };
                let parts = &mut media.parts[lane];
                self.push_air(segments, lane, [0.0, end], BodySet::EMPTY, parts);
            }
        }
    }

    /// Multiplies the throughput of photons outside all bodies by what mist leaves of them up to their intersections.
    pub(super) fn attenuate_photons(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        let Some(mist) = &self.mist else {
            return;
        };
        let PacketScratch { hits, throughput, .. } = packet;
        let mut lanes = hits.mask & !segments.inside;
        if self.shapes.interior == Interior::Spheres {
            let inside = leaving(self.simd, &segments.rays, hits);
            lanes &= !(hits.lanes_of(MaterialId::PARTICLES) & inside);
        }
        for lane in lanes_in(lanes) {
            let passing = mist.transmittance(&segments.rays.ray(lane), [0.0, hits.t[lane]]);
            set_lane3(throughput, lane, lane3(throughput, lane) * passing);
        }
    }

    /// Multiplies the radiance of light samples by what mist leaves of it along their whole shadow rays, which start
    /// outside all bodies unless the rays of `segments` are inside.
    pub(super) fn attenuate_by_mist(&self, segments: &SegmentPacket, samples: &mut LightSamples) {
        let Some(mist) = self.mist.as_ref().filter(|_| !samples.ignores_mist) else {
            return;
        };
        for lane in lanes_in(samples.lanes & !segments.inside) {
            let ends = [samples.rays.t_min[lane], samples.rays.t_max[lane]];
            let passing = mist.transmittance(&samples.rays.ray(lane), ends);
            let radiance = lane3(&samples.radiance, lane) * passing;
            set_lane3(&mut samples.radiance, lane, radiance);
        }
    }

    /// Multiplies `transmittance` by that of the mist on the part of a shadow ray between two distances, which is
    /// outside all bodies.
    pub(super) fn attenuate_outside(
        &self,
        samples: &LightSamples,
        lane: usize,
        ends: [f32; 2],
        transmittance: &mut Lanes3,
    ) {
        if let Some(mist) = self.mist.as_ref().filter(|_| !samples.ignores_mist) {
            let passing = mist.transmittance(&samples.rays.ray(lane), ends);
            set_lane3(transmittance, lane, lane3(transmittance, lane) * passing);
        }
    }
}
