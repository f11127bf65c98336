//! Rays through several transmissive bodies: see `bodies.rs`.
//!
//! A ray passes surfaces between equal media without an intersection. So neither depth nor data channels depend on how far
//! bodies overlap.

use super::{
    absorption::InsideSegments,
    bodies::{
        MediumBoundary, StraightCrossing, TransmissiveBodies, lanes_inside, lanes_inside_any,
        media_of,
    },
    body_set::BodySet,
    context::RenderContext,
    scratch::PacketScratch,
    stream::SegmentPacket,
};
use spherule_surface::{Intersections, MaterialId};
use spherule_tree::accel::Coherence;
use spherule_tree::math::functions::exp;
use spherule_tree::math::{LANES, Lanes, lanes_in, splat};
use spherule_tree::ray::RayPacket;

/// Maximum number of surfaces between equal media that a ray passes before its intersection.
const MAX_STRAIGHT_CROSSINGS: u32 = 64;

/// Lanes at surfaces of the same kind.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfaceLanes {
    pub(super) lanes: u32,
    /// Lanes whose rays are inside the body.
    pub(super) inside: u32,
    /// The media on both sides, with several transmissive bodies.
    pub(super) boundary: Option<MediumBoundary>,
}

impl SurfaceLanes {
    /// The body that refracted rays enter or leave, with several transmissive bodies.
    pub(super) fn crossed(&self) -> BodySet {
        self.boundary.map_or(BodySet::EMPTY, |boundary| BodySet::of(boundary.body))
    }
}

impl RenderContext<'_> {
    /// Divides `lanes`, which hit surfaces of a `material`, by what their interface depends on.
    pub(super) fn divide_surface(
        &self,
        segments: &SegmentPacket,
        hits: &Intersections,
        material: MaterialId,
        lanes: u32,
    ) -> impl Iterator<Item = SurfaceLanes> + use<> {
        let nested = self.shapes.nested.as_ref();
        let of_bodies = nested
            .filter(|nested| nested.with_material(material).is_some())
            .map(|nested| nested.boundaries(hits, lanes, &segments.bodies));
        let whole = SurfaceLanes { lanes, inside: segments.inside, boundary: None };
        let whole = of_bodies.is_none().then_some(whole);
        let of_bodies = of_bodies.into_iter().flatten().map(|found| SurfaceLanes {
            lanes: found.lanes,
            inside: found.inside,
            boundary: Some(found.boundary),
        });
        whole.into_iter().chain(of_bodies)
    }

    /// Finds the nearest intersection of each ray with solid shapes, apart from surfaces of bodies that separate equal
    /// media. These are in `packet.straight`.
    pub(super) fn intersect_nested(
        &self,
        nested: &TransmissiveBodies<'_>,
        segments: &mut SegmentPacket,
        coherence: Coherence,
        packet: &mut PacketScratch,
    ) {
        let PacketScratch { hits, straight, .. } = packet;
        straight.clear();
        let (lanes, far) = (segments.lanes(), segments.rays.t_max);
        let mut sets = segments.bodies;
        self.intersect_solid(nested, &mut segments.rays, coherence, &sets, hits);
        let mut passing = nested.straight_lanes(hits, hits.mask & lanes, &sets);
        let mut remaining = segments.rays;
        for _ in 0..MAX_STRAIGHT_CROSSINGS {
            if passing == 0 {
                return;
            }
            // Continue the rays that pass, and end all others
            remaining.keep_only(passing);
            hits.continue_rays(&mut remaining, passing, &far);
            for lane in lanes_in(passing) {
                let body = nested.crossed_at(hits, lane);
                straight.push(StraightCrossing { lane, t: hits.t[lane], body });
                sets[lane] = sets[lane].across(body);
            }
            // Find their next intersections
            hits.mask &= !passing;
            self.intersect_solid(nested, &mut remaining, Coherence::Incoherent, &sets, hits);
            for lane in lanes_in(passing) {
                segments.rays.t_max[lane] = remaining.t_max[lane];
            }
            passing = nested.straight_lanes(hits, hits.mask & passing, &sets);
        }
        // The last ones end nowhere
        hits.mask &= !passing;
        for lane in lanes_in(passing) {
            segments.rays.t_max[lane] = far[lane];
        }
    }

    /// Finds the nearest intersection of rays that are inside the bodies of `sets` with solid shapes.
    fn intersect_solid(
        &self,
        nested: &TransmissiveBodies<'_>,
        rays: &mut RayPacket,
        coherence: Coherence,
        sets: &[BodySet; LANES],
        hits: &mut Intersections,
    ) {
        for shape in &self.shapes.solid {
            let body = nested.with_material(shape.material());
            let inside = body.map_or(0, |body| lanes_inside(body, sets));
            shape.intersect(rays, coherence, inside, hits);
        }
    }

    /// Multiplies the throughput by the transmittance of all media between the origins of the rays and their intersections,
    /// and moves `segments` into the bodies in which the rays end.
    pub(super) fn absorb_nested(
        &self,
        nested: &TransmissiveBodies<'_>,
        segments: &mut SegmentPacket,
        packet: &mut PacketScratch,
    ) {
        let PacketScratch { hits, straight, throughput, .. } = packet;
        // Attenuate by the media up to the last surface that a ray has passed straight
        let mut from = splat(0.0);
        for StraightCrossing { lane, t, body } in straight.iter().copied() {
            // Spray, spheres that are not fully opaque, and panes may have ended the ray before
            if hits.mask >> lane & 1 == 1 && t >= hits.t[lane] {
                continue;
            }
            if let Some(body) = nested.absorbing(segments.bodies[lane].medium()) {
                let extinction = self.mean_extinction(body, &segments.rays, lane, [from[lane], t]);
                for axis in 0..3 {
                    throughput[axis][lane] *= exp(-(t - from[lane]) * extinction[axis]);
                }
            }
            segments.bodies[lane] = segments.bodies[lane].across(body);
            from[lane] = t;
        }
        segments.inside = segments.lanes() & lanes_inside_any(&segments.bodies);
        // Attenuate by the medium in front of the intersection. A ray inside a body without an intersection has left
        // through a crack in the surface; its length inside is unknown
        let length: Lanes = std::array::from_fn(|lane| hits.t[lane] - from[lane]);
        for (medium, lanes) in media_of(segments.inside & hits.mask, &segments.bodies) {
            if let Some(body) = nested.absorbing(medium) {
                let inside =
                    InsideSegments { rays: &segments.rays, from: &from, length: &length, lanes };
                self.absorb_in(body, inside, throughput);
            }
        }
    }
}
