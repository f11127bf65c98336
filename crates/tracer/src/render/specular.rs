//! The scatter stage of transmissive and mirroring surfaces: the reflected and the refracted ray that leave a shading
//! point.

use super::{
    bodies::lanes_inside_any,
    body_set::BodySet,
    context::RenderContext,
    dimensions::{REFLECTED, REFRACTED},
    interface::Dielectric,
    layers::LightClass,
    roulette::SplitRule,
    scene_shapes::Interior,
    scratch::PacketScratch,
    shading::scale,
    stream::{Continuation, RayStreams, SegmentPacket},
};
use spherule_tree::math::{Lanes3, lane3, lanes_in};

/// Path segments that end at specular surfaces.
#[derive(Clone, Copy)]
pub(super) struct SpecularHits<'a> {
    pub(super) segments: &'a SegmentPacket,
    pub(super) depth: u32,
    /// Lanes at a specular surface.
    pub(super) lanes: u32,
    /// The body whose surface it is, if there are several transmissive ones.
    pub(super) crossed: BodySet,
    /// Lanes whose rays are not traced further, and see what is infinitely far away.
    pub(super) last: u32,
}

/// What rays that are not traced further see infinitely far away.
#[derive(Clone, Copy)]
pub(super) struct Escape<'a> {
    /// Adds the radiance for rays in a direction with a throughput, only for lanes in a mask.
    pub(super) add: &'a dyn Fn(&Lanes3, &Lanes3, u32, &mut Lanes3),
    /// The light group of the radiance.
    pub(super) group: usize,
}

impl RenderContext<'_> {
    /// Appends the rays that leave the shading points of `hits` to `next`.
    pub(super) fn scatter(
        &self,
        dielectric: &Dielectric,
        split: &SplitRule,
        hits: SpecularHits<'_>,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
        escape: Escape<'_>,
    ) {
        // Choose which rays to trace
        let SpecularHits { segments, crossed, last, .. } = hits;
        if self.shapes.interior != Interior::Opaque {
            self.split_weights(split, hits, packet);
        }
        let PacketScratch { leaving, throughput, radiance, split: lights, groups, .. } = packet;
        // Describe both rays: weight, stream, side and branch of the path
        let [inside, other_side] = self.insides(segments, crossed);
        let reflected = (
            dielectric.reflection,
            &mut leaving.reflected,
            &mut next.reflected,
            Continuation { inside, crossed: BodySet::EMPTY, branch: REFLECTED },
            LightClass::Reflection,
        );
        let refracted = (
            dielectric.transmission,
            &mut leaving.refracted,
            &mut next.refracted,
            Continuation { inside: other_side, crossed, branch: REFRACTED },
            LightClass::Refraction,
        );
        for (weight, rays, stream, how, class) in [reflected, refracted] {
            if weight <= 0.0 {
                continue;
            }
            // Append the rays with a weight to their stream
            let lanes = lanes_in(hits.lanes).mask_where(|lane| rays.weight[lane] > 0.0);
            scale(self.simd, throughput, &rays.weight, &mut rays.throughput);
            // Rays that are not traced see what is far away
            if lanes & last != 0 {
                let group = groups.of_mut(escape.group);
                for sum in [Some(&mut *radiance), group].into_iter().flatten() {
                    (escape.add)(&rays.direction, &rays.throughput, lanes & last, sum);
                }
                lights.take(class, radiance);
            }
            if lanes & !last != 0 {
                stream.push(lanes & !last, rays, segments, how);
            }
        }
    }

    /// The lanes inside a connected body of rays that are reflected, and of those that are refracted, which enter or leave
    /// the body in `crossed` if there may be several.
    fn insides(&self, segments: &SegmentPacket, crossed: BodySet) -> [u32; 2] {
        match self.shapes.interior {
            Interior::Opaque | Interior::Spheres => [0, 0],
            Interior::Body => [segments.inside, !segments.inside],
            Interior::Nested => {
                let behind = segments.bodies.map(|set| set.across(crossed));
                [segments.inside, lanes_inside_any(&behind)]
            }
        }
    }

    /// Chooses which of the two rays that leave the shading points of `hits` are traced, and their weights.
    fn split_weights(&self, split: &SplitRule, hits: SpecularHits<'_>, packet: &mut PacketScratch) {
        let segments = hits.segments;
        let leaving = &mut packet.leaving;
        let (reflected, refracted) = (&mut leaving.reflected.weight, &mut leaving.refracted.weight);
        for lane in lanes_in(hits.lanes & !hits.last) {
            let is_by_chance = segments.bounces[lane] > 0 || packet.media.sampled >> lane & 1 == 1;
            // One ray only where paths ended by chance: the weights of these are in those of the others
            let arriving =
                if is_by_chance { 0.0 } else { lane3(&packet.throughput, lane).max_element() };
            let (path, sample) = (segments.path[lane], segments.sample[lane]);
            let sample = sample % self.settings.samples;
            let weights = [reflected[lane], refracted[lane]];
            let weights = split.weights(weights, arriving, hits.depth, path, sample);
            [reflected[lane], refracted[lane]] = weights;
        }
    }
}
