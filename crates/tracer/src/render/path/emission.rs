//! What rays see of light sources, and infinitely far away.

use glam::Vec3;

use super::PathIntegrator;
use crate::render::{
    light_groups::NO_GROUP,
    lights::{Emission, environment_along},
    scratch::PacketScratch,
    shading::{add, scale},
    stream::SegmentPacket,
};
use spherule_surface::MaterialId;
use spherule_tree::math::{LANES, Lanes, lane3, lanes_in, lanes_where, set_lane3, splat};

impl PathIntegrator<'_> {
    /// Adds the radiance of lights that rays hit: of rays sampled from a BSDF, weighted against the sampling of the
    /// light, and of visible lights before everything else. Returns the lanes of rays that end at visible lights.
    pub(super) fn add_emitted(&self, segments: &SegmentPacket, packet: &mut PacketScratch) -> u32 {
        if !self.has_extents {
            return 0;
        }
        // Find the rays whose light is weighted against light samples, and those that see visible lights
        let sampled = if self.rays_hit_lights() {
            segments.lanes() & lanes_where(|l| segments.pdf[l] < f32::INFINITY)
        } else {
            0
        };
        let seen = segments.lanes() & lanes_where(|l| segments.bounces[l] == 0);
        let mut emission = Emission::default();
        let (mut nearest, mut color) = ([None; LANES], [(Vec3::ZERO, NO_GROUP); LANES]);
        let lights = self.context.lights.iter().enumerate();
        for (index, light) in lights.filter(|(_, light)| light.has_extent()) {
            let group = self.context.light_group(index);
            // Find the rays that hit the light before a surface
            let lanes = sampled | if light.is_visible() { seen } else { 0 };
            if lanes == 0 {
                continue;
            }
            light.intersect(self.context.simd, &segments.rays, &mut emission);
            for lane in lanes_in(lanes & emission.lanes) {
                let is_first = match (packet.hits.mask | packet.media.scattered) >> lane & 1 {
                    0 => true,
                    _ => emission.t[lane] < segments.rays.t_max[lane],
                };
                if !is_first {
                    continue;
                }
                let along = self.throughput_to(emission.t[lane], lane, segments, packet);
                // Add its radiance, or keep the nearest visible light
                if sampled >> lane & 1 == 1 {
                    let pdf = segments.pdf[lane];
                    let weight = pdf / (pdf + emission.pdf[lane]);
                    let arriving = along * (weight * emission.radiance);
                    let sum = lane3(&packet.radiance, lane) + arriving;
                    set_lane3(&mut packet.radiance, lane, sum);
                    packet.groups.add_lane(group, lane, arriving);
                } else if nearest[lane].is_none_or(|t| emission.t[lane] < t) {
                    nearest[lane] = Some(emission.t[lane]);
                    color[lane] = (along * emission.radiance, group);
                }
            }
        }
        // Add the light of the nearest ones
        let ended = lanes_where(|l| nearest[l].is_some());
        add_visible(ended, &color, packet);
        ended
    }

    /// The throughput of the ray in `lane` up to a light at distance `t`, which may be in front of the panes on the
    /// ray.
    fn throughput_to(
        &self,
        t: f32,
        lane: usize,
        segments: &SegmentPacket,
        packet: &PacketScratch,
    ) -> Vec3 {
        if packet.media.sampled >> lane & 1 == 1 {
            // Panes inside media that scatter light do not count
            return lane3(&segments.throughput, lane) * packet.media.passing_weight(lane, t);
        }
        let is_before_panes = !self.context.shapes.panes.is_empty() && t < packet.first_pane[lane];
        if is_before_panes {
            lane3(&segments.throughput, lane)
        } else {
            lane3(&packet.throughput, lane)
        }
    }

    /// Adds the radiance for rays of `lanes` without an intersection, and behind surfaces that are not fully opaque:
    /// camera rays see the background, unless the environment is visible.
    pub(super) fn add_escaped(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        packet: &mut PacketScratch,
    ) {
        let context = &self.context;
        // Camera rays see the background in place of a hidden environment
        if depth == 1 && !context.scene.is_environment_visible {
            if context.sees_background(depth) {
                context.add_background(segments, depth, lanes, packet);
            }
            return;
        }
        if depth == 1 && !context.sees_background(depth) {
            return;
        }
        let Some(environment) = self.environment else {
            return;
        };
        // Weight the environment by what surfaces do not cover
        let PacketScratch { hits, throughput, radiance, weight, groups, .. } = packet;
        let lanes = lanes & (!hits.mask | hits.lanes_of(MaterialId::GROUND));
        if lanes == 0 {
            return;
        }
        let part = std::array::from_fn(|lane| match hits.mask >> lane & 1 {
            0 => 1.0,
            _ => 1.0 - hits.opacity[lane],
        });
        scale(context.simd, throughput, &part, weight);
        // Shadow rays do not pass a ground that fades out, so its paths have the full weight
        let pdf: Lanes = std::array::from_fn(|lane| match hits.mask >> lane & 1 {
            0 => segments.pdf[lane],
            _ => f32::INFINITY,
        });
        // Add its radiance
        let (along, mut seen) = ([&segments.rays.direction, &*weight], [splat(0.0); 3]);
        environment_along(context.simd, environment, along, &pdf, lanes, &mut seen);
        add(context.simd, &seen, &Vec3::ONE, lanes, radiance);
        groups.add(context.simd, context.environment_group(), &seen, lanes);
    }
}

/// Adds the light of visible lights, with its light group, for the lanes whose rays `ended` at them.
fn add_visible(ended: u32, color: &[(Vec3, usize); LANES], packet: &mut PacketScratch) {
    for lane in lanes_in(ended) {
        packet.coverage[lane] = 1.0;
        let (color, group) = color[lane];
        let sum = lane3(&packet.radiance, lane) + color;
        set_lane3(&mut packet.radiance, lane, sum);
        packet.groups.add_lane(group, lane, color);
    }
}
