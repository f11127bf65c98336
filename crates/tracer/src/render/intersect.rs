//! The intersect stage: the nearest intersections, the throughput up to them, and the background behind them.

use super::{
    absorption::InsideSegments,
    bodies::TransmissiveBody,
    context::RenderContext,
    drawing::Drawing,
    interface::{attenuate, leaving},
    light_groups::NO_GROUP,
    scene_shapes::Interior,
    scratch::PacketScratch,
    shading::{add_backdrop, add_background, scale},
    stream::SegmentPacket,
};
use crate::scene::{Background, Material};
use spherule_surface::{Intersections, MaterialId};
use spherule_tree::math::{Lanes3, lanes_in, splat};

impl RenderContext<'_> {
    /// Finds the nearest intersection of each ray with the shapes of the scene, ends the ray there, and computes the
    /// throughput up to that point.
    pub(super) fn intersect(
        &self,
        segments: &mut SegmentPacket,
        depth: u32,
        packet: &mut PacketScratch,
    ) {
        packet.hits.clear();
        let coherence = self.coherence(depth);
        if let Some(nested) = &self.shapes.nested {
            self.intersect_nested(nested, segments, coherence, packet);
        } else {
            for shape in &self.shapes.solid {
                // Rays enter no other body than that of the particles
                let is_particles = shape.material() == MaterialId::PARTICLES;
                let inside = if is_particles { segments.inside } else { 0 };
                shape.intersect(&mut segments.rays, coherence, inside, &mut packet.hits);
            }
        }
        self.meet_translucent(segments, coherence, packet);
        self.meet_spray(segments, coherence, packet);
        self.assign_materials(packet);
        packet.throughput = segments.throughput;
        if depth == 1 && self.settings.drawing != Drawing::NONE {
            self.draw_outlines(&segments.rays, packet);
        }
        packet.media.clear();
        if self.has_scattering && !packet.media.only_attenuate {
            // Free paths that end before the first pane meet none
            self.sample_free_paths(segments, packet);
            self.pass_panes(segments, coherence, packet);
            self.end_free_paths(segments, packet);
            return;
        }
        self.pass_panes(segments, coherence, packet);
        match &self.shapes.nested {
            Some(nested) => self.absorb_nested(nested, segments, packet),
            None => self.absorb(segments, packet),
        }
        if packet.media.only_attenuate {
            self.attenuate_photons(segments, packet);
        }
    }

    /// Replaces the material of particles by that of their style.
    fn assign_materials(&self, packet: &mut PacketScratch) {
        if !self.has_styles {
            return;
        }
        // Spheres of several styles are one shape, which has the material of one of them
        let hits = &mut packet.hits;
        for lane in lanes_in(hits.mask) {
            if self.scene.material(hits.material[lane]).owner.has_styles()
                && let Some(material) = self.source.style(hits.particle[lane])
            {
                hits.material[lane] = material;
            }
        }
    }

    /// Multiplies the throughput by the transmittance of the only medium between the origins of the rays and their
    /// intersections.
    fn absorb(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        let material = self.scene.particle_material();
        if !material.absorbs() {
            return;
        }
        let PacketScratch { hits, throughput, .. } = packet;
        match (self.shapes.interior, self.shapes.particles) {
            // Only a ray that leaves a sphere has passed through its interior.
            (Interior::Spheres, _) => {
                let rays = &segments.rays;
                let lanes = hits.lanes_of(MaterialId::PARTICLES) & leaving(self.simd, rays, hits);
                self.absorb_in_spheres(material, hits, lanes, throughput);
            }
            // A ray inside the body without an intersection has left through a crack in the surface; its length
            // inside is unknown.
            (Interior::Body, Some(shape)) if segments.inside & hits.mask != 0 => {
                let inside = InsideSegments {
                    rays: &segments.rays,
                    from: &splat(0.0),
                    length: &hits.t,
                    lanes: segments.inside & hits.mask,
                };
                self.absorb_in(&TransmissiveBody { shape, material }, inside, throughput);
            }
            _ => {}
        }
    }

    /// Multiplies `throughput` of `lanes`, whose rays leave separate spheres, by the transmittance of these.
    fn absorb_in_spheres(
        &self,
        material: &Material,
        hits: &Intersections,
        lanes: u32,
        throughput: &mut Lanes3,
    ) {
        match material.color_length {
            _ if lanes == 0 => {}
            None => attenuate(self.simd, &material.extinction, &hits.t, lanes, throughput),
            Some(_) => {
                for lane in lanes_in(lanes) {
                    let own = self.sphere_extinction(hits.particle[lane]);
                    attenuate(self.simd, &own, &hits.t, 1 << lane, throughput);
                }
            }
        }
    }

    /// Whether rays of `depth` without an intersection hit the background.
    pub(super) fn sees_background(&self, depth: u32) -> bool {
        depth > 1 || !self.settings.transparent_background
    }

    /// Adds the background for rays of `lanes` at `depth` without an intersection, and behind surfaces that are not
    /// fully opaque.
    pub(super) fn add_background(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        packet: &mut PacketScratch,
    ) {
        // Rays see it where they miss everything, and through a ground that fades out
        let hits = &packet.hits;
        let fading = if depth == 1 && self.depth_cue.is_some() { hits.mask } else { 0 };
        let lanes = lanes & (!hits.mask | hits.lanes_of(MaterialId::GROUND) | fading);
        if lanes == 0 {
            return;
        }
        // Weight the background by the part of the light that the surface does not cover
        let background_part = std::array::from_fn(|lane| match hits.mask >> lane & 1 {
            0 => 1.0,
            _ => 1.0 - hits.opacity[lane],
        });
        scale(self.simd, &packet.throughput, &background_part, &mut packet.weight);
        // Add it to the picture and to the group of lights without one; camera rays see the backdrop of a studio
        let (rays, weight) = (&segments.rays, &packet.weight);
        let is_backdrop = depth == 1
            && matches!(self.scene.background, Background::Studio { .. })
            && !self.scene.camera.projection().is_panorama();
        let group = packet.groups.of_mut(NO_GROUP);
        for radiance in [Some(&mut packet.radiance), group].into_iter().flatten() {
            if is_backdrop {
                add_backdrop(self.simd, &self.cameras.now, rays, weight, lanes, radiance);
                continue;
            }
            let (background, direction) = (&self.background, &rays.direction);
            add_background(self.simd, background, direction, weight, lanes, radiance);
        }
    }
}
