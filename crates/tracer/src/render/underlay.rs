//! Panes behind everything else: walls of thin glass around a fluid.
//!
//! Only camera rays that hit nothing but the ground see them. So they neither hide nor tint the colours of particles,
//! which a colour map explains, they throw no shadows, and all other rays cost what they do without walls. What they
//! reflect is the environment, as if nothing else were there: no ray is traced, so that the glass has no noise.

use glam::Vec3;

use super::{
    context::RenderContext, layers::LightClass, panes::reflected, scratch::PacketScratch,
    stream::SegmentPacket,
};
use crate::scene::Environment;
use crate::scene::environment::LUMINANCE;
use spherule_surface::MaterialId;
use spherule_tree::math::{lane3, set_lane3};

impl RenderContext<'_> {
    /// Multiplies the throughput of camera rays of `lanes` that hit nothing but the ground by the transmittance of the
    /// underlays in front of it, and adds what these reflect of the `environment`.
    pub(super) fn pass_underlays(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        environment: Option<&Environment>,
        packet: &mut PacketScratch,
    ) {
        let panes = &self.shapes.underlays;
        let unhidden = !packet.hits.mask | packet.hits.lanes_of(MaterialId::GROUND);
        let lanes = lanes & unhidden;
        if depth > 1 || panes.is_empty() || lanes == 0 {
            return;
        }
        let (group, is_transparent) =
            (self.environment_group(), self.settings.transparent_background);
        let PacketScratch { throughput, radiance, groups, coverage, .. } = packet;
        self.walk_panes(panes, segments.rays, lanes, self.coherence(depth), |lane, pane| {
            let before = lane3(throughput, lane);
            // Add the reflection
            if let Some(environment) = environment {
                let (_, direction) = reflected(lane3(&segments.rays.direction, lane), &pane.hit);
                let seen = before * pane.reflectance * environment.radiance(direction);
                set_lane3(radiance, lane, lane3(radiance, lane) + seen);
                groups.add_lane(group, lane, seen);
            }
            // What does not pass covers a transparent background
            if is_transparent {
                let passing = pane.transmittance.min(Vec3::ONE).dot(LUMINANCE);
                coverage[lane] = 1.0 - (1.0 - coverage[lane]) * passing;
            }
            set_lane3(throughput, lane, before * pane.transmittance);
            true
        });
        packet.take_light(LightClass::Reflection);
    }
}
