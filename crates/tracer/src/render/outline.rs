//! What makes pictures clear where light does not: dark outlines, and particles that fade with their distance.
//!
//! A camera ray that meets a sphere near its silhouette, within the width of the outline on the film, sees black. So
//! outlines have the anti-aliasing of the samples, and each sphere has its own. Of a sphere with a radius of `r` pixels,
//! a point whose normal has the cosine `c` with the ray is `r (1 - sqrt(1 - c^2))` pixels from the silhouette (under a
//! parallel projection, and nearly so under others).

use super::{context::RenderContext, scratch::PacketScratch};
use crate::scene::Owner;
use spherule_surface::MaterialId;
use spherule_tree::math::{lane3, lanes_in};
use spherule_tree::ray::RayPacket;

/// Widest outline of a sphere, as a fraction of its radius: small spheres must keep their colour.
const WIDEST: f32 = 0.25;

/// Cosine below which surfaces without a radius have an outline.
const GRAZING: f32 = 0.2;

impl RenderContext<'_> {
    /// Darkens outlines at the intersections of camera rays, and fades them with their distance.
    pub(super) fn draw_outlines(&self, rays: &RayPacket, packet: &mut PacketScratch) {
        let width = self.settings.drawing.outline;
        let hits = &mut packet.hits;
        for lane in lanes_in(hits.mask & !hits.lanes_of(MaterialId::GROUND)) {
            let (point, material) = (lane3(&hits.point, lane), hits.material[lane]);
            let is_clear = self.shapes.is_transmissive(material);
            if let Some(cue) = self.depth_cue.as_ref().filter(|_| !is_clear) {
                hits.opacity[lane] *= cue.left(self.scene.camera.depth_of(point));
            }
            let is_spray = self.scene.material(material).owner == Owner::Spray;
            if width <= 0.0 || is_clear || is_spray {
                continue;
            }
            let cosine = lane3(&hits.normal, lane).dot(lane3(&rays.direction, lane));
            let radius = hits.radius[lane] / self.cameras.now.pixel_width(point);
            let is_outline = if radius.is_finite() {
                let distance = radius * (1.0 - (1.0 - (cosine * cosine).min(1.0)).sqrt());
                distance < width.min(WIDEST * radius)
            } else {
                cosine.abs() < GRAZING
            };
            if is_outline {
                for channel in &mut packet.throughput {
                    channel[lane] = 0.0;
                }
            }
        }
    }
}
