//! Media that scatter light inside transmissive bodies, and mist outside (`mist_rays.rs`): finds them along rays, and
//! ends rays where their free paths end (`free_path.rs`). `path/scattering.rs` has the light there.

use glam::Vec3;

use super::{
    bodies::{TransmissiveBodies, TransmissiveBody, lanes_inside_any},
    body_set::BodySet,
    context::RenderContext,
    dimensions::FREE_PATH,
    free_path::{MediumPart, channel_chances, channel_of, free_path, weight},
    interface::leaving,
    sampler::get_2d_lanes,
    scene_shapes::Interior,
    scratch::PacketScratch,
    stream::SegmentPacket,
};
use spherule_surface::MaterialId;
use spherule_tree::math::{lane3, lanes_in, set_lane3, splat};

impl RenderContext<'_> {
    /// Finds the media along the rays of `segments` up to their intersections, and samples free paths in them. Rays end
    /// where these end.
    pub(super) fn sample_free_paths(
        &self,
        segments: &mut SegmentPacket,
        packet: &mut PacketScratch,
    ) {
        self.find_media(segments, packet);
        let PacketScratch { media, .. } = packet;
        media.free_path = splat(f32::INFINITY);
        let scatters = |parts: &Vec<MediumPart>| parts.iter().any(MediumPart::scatters);
        let lanes = lanes_in(segments.lanes());
        media.sampled = lanes.mask_where(|lane| scatters(&media.parts[lane]));
        if media.sampled == 0 {
            return;
        }
        let mut u = [splat(0.0); 2];
        let sample = segments.sample.map(|s| s % self.settings.samples);
        get_2d_lanes(self.simd, &segments.path, FREE_PATH, &sample, &mut u);
        for lane in lanes_in(media.sampled) {
            let chances = channel_chances(lane3(&segments.throughput, lane));
            let channel = channel_of(chances, u[0][lane]);
            let length = free_path(&media.parts[lane], channel, u[1][lane]);
            media.channels[lane] = chances;
            media.free_path[lane] = length;
            if length < segments.rays.t_max[lane] {
                segments.rays.t_max[lane] = length;
            }
        }
    }

    /// Ends rays whose free paths end before their intersections, and multiplies the throughput of all by the weight of
    /// the media along them. Moves `segments` into the bodies in which the rays end.
    pub(super) fn end_free_paths(&self, segments: &mut SegmentPacket, packet: &mut PacketScratch) {
        let PacketScratch { media, hits, throughput, .. } = packet;
        // A shadow catcher has no data
        let is_catcher = self.catches_shadows();
        let invisible = if is_catcher { hits.lanes_of(MaterialId::GROUND) } else { 0 };
        for lane in lanes_in(segments.lanes()) {
            let parts = &media.parts[lane];
            if parts.is_empty() {
                continue;
            }
            // Panes may have ended the ray before
            let is_hit = hits.mask >> lane & 1 == 1;
            let surface = if is_hit { hits.t[lane] } else { f32::INFINITY };
            let is_scattered = media.free_path[lane] < surface;
            let end = media.free_path[lane].min(surface);
            let along = match media.sampled >> lane & 1 {
                0 => weight(parts, Vec3::splat(1.0 / 3.0), end, false),
                _ => weight(parts, media.channels[lane], end, is_scattered),
            };
            set_lane3(throughput, lane, lane3(throughput, lane) * along);
            for part in parts.iter().filter(|part| part.end < end) {
                segments.bodies[lane] = segments.bodies[lane].across(part.crossed);
            }
            if is_scattered {
                media.scattered |= 1 << lane;
                media.hidden |= hits.mask & !invisible & 1 << lane;
                let last = parts.iter().find(|part| end <= part.end);
                media.anisotropy[lane] = last.map_or(0.0, |part| part.anisotropy);
                media.in_mist |= u32::from(last.is_some_and(|part| part.is_mist)) << lane;
            }
        }
        hits.mask &= !media.scattered;
        if self.shapes.nested.is_some() {
            segments.inside = segments.lanes() & lanes_inside_any(&segments.bodies);
        }
    }

    /// Finds the media along rays up to their intersections.
    fn find_media(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        for parts in &mut packet.media.parts {
            parts.clear();
        }
        let material = self.scene.particle_material();
        let (hits, rays) = (&packet.hits, &segments.rays);
        match (self.shapes.interior, self.shapes.particles, &self.shapes.nested) {
            (Interior::Nested, _, Some(nested)) => self.find_nested_media(nested, segments, packet),
            // Only a ray that leaves a sphere has passed through its interior
            (Interior::Spheres, ..) => {
                let lanes = hits.lanes_of(MaterialId::PARTICLES) & leaving(self.simd, rays, hits);
                for lane in lanes_in(lanes) {
                    let extinction = self.sphere_extinction(hits.particle[lane]);
                    let part = MediumPart::of(material, extinction, hits.t[lane]);
                    packet.media.parts[lane].push(part);
                }
            }
            // A ray inside the body without an intersection has left through a crack in the surface
            (Interior::Body, Some(shape), _) => {
                let body = TransmissiveBody { shape, material };
                for lane in lanes_in(segments.inside & hits.mask) {
                    let part = self.part_in(&body, segments, lane, [0.0, hits.t[lane]]);
                    packet.media.parts[lane].push(part);
                }
            }
            _ => {}
        }
        if self.shapes.nested.is_none() {
            self.find_mist(segments, packet);
        }
    }

    /// The same with several bodies, whose surfaces between equal media rays pass.
    fn find_nested_media(
        &self,
        nested: &TransmissiveBodies<'_>,
        segments: &SegmentPacket,
        packet: &mut PacketScratch,
    ) {
        let PacketScratch { media, hits, straight, .. } = packet;
        let (mut sets, mut from) = (segments.bodies, splat(0.0));
        let mut push = |set: BodySet, lane: usize, ends: [f32; 2], crossed: BodySet| {
            let parts = &mut media.parts[lane];
            match nested.absorbing(set.medium()) {
                _ if set.is_empty() => self.push_air(segments, lane, ends, crossed, parts),
                Some(body) => {
                    let part = self.part_in(body, segments, lane, ends);
                    parts.push(MediumPart { crossed, ..part });
                }
                None => parts.push(MediumPart { crossed, ..MediumPart::air(ends[1]) }),
            }
        };
        for crossing in straight.iter() {
            let (lane, t) = (crossing.lane, crossing.t);
            // Spray and spheres that are not fully opaque may have ended the ray before
            if hits.mask >> lane & 1 == 1 && t >= hits.t[lane] {
                continue;
            }
            push(sets[lane], lane, [from[lane], t], crossing.body);
            sets[lane] = sets[lane].across(crossing.body);
            from[lane] = t;
        }
        // A ray inside a body without an intersection has left through a crack in the surface
        for lane in lanes_in(segments.lanes()) {
            let is_hit = hits.mask >> lane & 1 == 1;
            if is_hit || sets[lane].is_empty() {
                let end = if is_hit { hits.t[lane] } else { f32::INFINITY };
                push(sets[lane], lane, [from[lane], end], BodySet::EMPTY);
            }
        }
    }

    /// The part of the ray in `lane` between two distances, which is in the medium of `body`.
    fn part_in(
        &self,
        body: &TransmissiveBody<'_>,
        segments: &SegmentPacket,
        lane: usize,
        ends: [f32; 2],
    ) -> MediumPart {
        let extinction = self.mean_extinction(body, &segments.rays, lane, ends);
        MediumPart::of(body.material, extinction, ends[1])
    }
}

#[cfg(test)]
#[path = "media_tests.rs"]
mod tests;
