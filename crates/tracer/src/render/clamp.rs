//! The clamp of indirect light: an upper limit of what one path segment adds to a sample after the first bounce.
//!
//! Samples that are found with a small probability, such as the sun in a metal that lights the ground, are fireflies:
//! single pixels that hundreds of samples do not even out. The limit takes some of their light away. It does not
//! change the light that the first surface receives from the environment and from lights, whether a light sample or a
//! ray of the BSDF found it: highlights stay as they are. How much is lost is counted.

use super::light_groups::GroupLight;
use super::ray_counts::LostLight;
use super::stream::SegmentPacket;
use spherule_tree::math::{Lanes3, lane3, lanes_in, lanes_where, set_lane3, splat};

/// The limit, and the light of a packet that it does not apply to.
#[derive(Default)]
pub(super) struct IndirectClamp {
    /// Largest component of the radiance that a segment adds to its sample.
    pub(super) limit: Option<f32>,
    direct: Lanes3,
    direct_groups: Vec<Lanes3>,
}

impl IndirectClamp {
    /// Prepares for a packet.
    pub(super) fn start(&mut self) {
        if self.limit.is_some() {
            self.direct = [splat(0.0); 3];
            self.direct_groups.clear();
        }
    }

    /// Keeps the light that has been added so far from the clamp, on rays whose light the first surface reflects: what
    /// they see of lights and the environment.
    pub(super) fn keep_direct(
        &mut self,
        segments: &SegmentPacket,
        radiance: &Lanes3,
        groups: &GroupLight,
    ) {
        if self.limit.is_none() {
            return;
        }
        self.direct_groups.resize(groups.all().len(), [splat(0.0); 3]);
        // Rays that have passed glass since the first bounce have an infinite density: their light is a caustic
        let is_direct = |l: usize| segments.bounces[l] == 1 && segments.pdf[l] < f32::INFINITY;
        for lane in lanes_in(segments.lanes() & lanes_where(is_direct)) {
            set_lane3(&mut self.direct, lane, lane3(radiance, lane));
            for (direct, group) in self.direct_groups.iter_mut().zip(groups.all()) {
                set_lane3(direct, lane, lane3(group, lane));
            }
        }
    }

    /// Limits the indirect light of `segments`: in `radiance`, and in the same proportion in `groups`.
    pub(super) fn apply(
        &self,
        segments: &SegmentPacket,
        radiance: &mut Lanes3,
        groups: &mut GroupLight,
        lost: &mut LostLight,
    ) {
        let Some(limit) = self.limit else {
            return;
        };
        for lane in lanes_in(segments.lanes() & lanes_where(|l| segments.bounces[l] > 0)) {
            let direct = lane3(&self.direct, lane);
            let indirect = lane3(radiance, lane) - direct;
            // What is not finite stays, so that faults are visible
            let largest = indirect.max_element();
            if !(largest > limit && largest.is_finite()) {
                continue;
            }
            let part = limit / largest;
            lost.add(indirect * (1.0 - part));
            set_lane3(radiance, lane, direct + indirect * part);
            for (number, group) in groups.all_mut().iter_mut().enumerate() {
                let direct =
                    self.direct_groups.get(number).map_or(glam::Vec3::ZERO, |d| lane3(d, lane));
                let indirect = lane3(group, lane) - direct;
                set_lane3(group, lane, direct + indirect * part);
            }
        }
    }
}
