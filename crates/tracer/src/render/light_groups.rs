//! Light of one packet by light group: by the light sources that it comes from, after any number of reflections.
//!
//! Whatever is added to the radiance of a packet is also added to the group of its source, in the same order. A group
//! has therefore just the light that an image with its light sources alone would have.

use glam::Vec3;

use super::layers::Layers;
use super::shading::add;
use spherule_tree::math::{Lanes3, Supported, lane3, set_lane3, splat};

/// The group of light without a group, and of the background.
pub(super) const NO_GROUP: usize = 0;

/// The light of a packet by group. Empty if the film has no layers for groups.
#[derive(Debug, Default)]
pub(super) struct GroupLight {
    radiance: Vec<Lanes3>,
}

impl GroupLight {
    /// Prepares for a packet.
    pub(super) fn start(&mut self, layers: &Layers) {
        self.radiance.clear();
        let groups = usize::from(layers.light_groups);
        self.radiance.resize(groups, [splat(0.0); 3]);
    }

    /// Adds `added` to the light of `group`, only for `lanes`.
    pub(super) fn add(&mut self, simd: Supported, group: usize, added: &Lanes3, lanes: u32) {
        if let Some(radiance) = self.of_mut(group) {
            add(simd, added, &Vec3::ONE, lanes, radiance);
        }
    }

    /// Adds `added` to the light of `group` in `lane`.
    pub(super) fn add_lane(&mut self, group: usize, lane: usize, added: Vec3) {
        if let Some(radiance) = self.of_mut(group) {
            set_lane3(radiance, lane, lane3(radiance, lane) + added);
        }
    }

    /// The light of `group`; None if there are no groups.
    pub(super) fn of_mut(&mut self, group: usize) -> Option<&mut Lanes3> {
        self.radiance.get_mut(group)
    }

    /// The light of all groups, to change it.
    pub(super) fn all_mut(&mut self) -> &mut [Lanes3] {
        &mut self.radiance
    }

    /// The light of all groups; empty if there are none.
    pub(super) fn all(&self) -> &[Lanes3] {
        &self.radiance
    }
}
