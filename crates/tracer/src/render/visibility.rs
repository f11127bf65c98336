//! The occlude stage: visibility of lights from shading points, and transmittance of shadow rays.
//!
//! Shadow rays pass straight through transmissive bodies, so there are no caustics. Each crossing of a surface
//! multiplies their transmittance by `transmission*(1-r)`. `r` is for the angle outside on both sides of the surface
//! (a refracted ray would have come from such an angle, and is never totally reflected). The medium of a connected
//! body attenuates them as well, and mist outside (`mist_rays.rs`). Of several bodies, only boundaries between different
//! media count. Panes (`panes.rs`), soft spray (`spray.rs`) and spheres that are not fully opaque (`translucent.rs`)
//! attenuate all shadow rays.

use super::{
    absorption::InsideSegments,
    bodies::{BoundaryLanes, TransmissiveBodies, TransmissiveBody, lanes_inside, media_of},
    body_set::BodySet,
    context::RenderContext,
    interface::{cross_straight, leaving},
    lights::LightSamples,
    ray_counts::RayCounts,
    scene_shapes::Interior,
    shading::product,
    stream::SegmentPacket,
};
use spherule_surface::{Intersections, Shape};
use spherule_tree::accel::Coherence;
use spherule_tree::math::functions::exp;
use spherule_tree::math::{LANES, Lanes, Lanes3, lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::RayPacket;

/// Maximum number of crossings of one body along a shadow ray.
const MAX_CROSSINGS: u32 = 64;

/// Maximum number of crossings of separate spheres along a shadow ray, which may pass many of them.
const MAX_SPHERE_CROSSINGS: u32 = 4096;

/// Transmittance below which a shadow ray ends.
const MIN_TRANSMITTANCE: f32 = 1.0 / 4096.0;

impl RenderContext<'_> {
    /// Traces shadow rays from the shading points of `segments` to a light, and multiplies the radiance of `samples`
    /// by their transmittance. Returns the lanes that the light reaches.
    pub(super) fn trace_shadow_rays(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        samples: &mut LightSamples,
        crossings: &mut Intersections,
        counts: &mut RayCounts,
    ) -> u32 {
        samples.rays.set_len(segments.rays.len());
        samples.rays.time = segments.rays.time;
        counts.shadow += u64::from(samples.lanes.count_ones());
        let coherence = self.coherence(depth);

        // Trace opaque shapes first: occluded rays need no further tests
        self.occlude(coherence, samples, |shape| !self.shapes.is_transmissive(shape.material()));
        self.attenuate_by_panes(samples, coherence);
        self.attenuate_by_spray(samples, coherence);
        self.attenuate_by_opacity(samples, coherence);
        if samples.lanes == 0 {
            return 0;
        }

        // Trace what is transmissive
        let mut transmittance = [splat(1.0); 3];
        let (shapes, unattenuated) = (&self.shapes, &*samples);
        let reached = match (shapes.interior, &shapes.nested, shapes.particles) {
            (Interior::Opaque, ..) => {
                self.attenuate_by_mist(segments, samples);
                return samples.lanes;
            }
            (Interior::Nested, Some(nested), _) => {
                let sets = segments.bodies;
                self.cross_bodies(nested, unattenuated, sets, crossings, &mut transmittance)
            }
            (Interior::Body, _, Some(body)) => {
                let (inside, transmittance) = (segments.inside, &mut transmittance);
                self.cross_body(body, unattenuated, coherence, inside, crossings, transmittance)
            }
            (_, _, Some(spheres)) if self.has_scattering => {
                self.cross_murky_spheres(spheres, unattenuated, crossings, &mut transmittance)
            }
            (_, _, Some(spheres)) => self.cross_spheres(spheres, unattenuated, &mut transmittance),
            (_, _, None) => {
                self.attenuate_by_mist(segments, samples);
                return samples.lanes;
            }
        };
        // Attenuate the light
        let unoccluded = samples.radiance;
        product(self.simd, &unoccluded, &transmittance, &mut samples.radiance);
        reached
    }

    /// Traces shadow rays that no shape but panes and soft spray lets through, not even a transmissive one. Multiplies
    /// the radiance of `samples` by the transmittance of these. Returns the lanes that arrive.
    pub(super) fn unoccluded(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        samples: &mut LightSamples,
        counts: &mut RayCounts,
    ) -> u32 {
        samples.rays.set_len(segments.rays.len());
        samples.rays.time = segments.rays.time;
        counts.shadow += u64::from(samples.lanes.count_ones());
        let coherence = self.coherence(depth);
        self.occlude(coherence, samples, |_| true);
        self.attenuate_by_panes(samples, coherence);
        self.attenuate_by_spray(samples, coherence);
        self.attenuate_by_opacity(samples, coherence);
        self.attenuate_by_mist(segments, samples);
        samples.lanes
    }

    /// Removes the lanes of `samples` that shapes for which `is_opaque` occlude.
    fn occlude(
        &self,
        coherence: Coherence,
        samples: &mut LightSamples,
        is_opaque: impl Fn(&dyn Shape) -> bool,
    ) {
        for shape in &self.shapes.solid {
            if samples.lanes != 0 && is_opaque(*shape) {
                samples.lanes &= !shape.occluded(&samples.rays, coherence, samples.lanes);
            }
        }
    }

    /// Computes the transmittance of separate spheres. Returns the lanes in which it is not 0.
    fn cross_spheres(
        &self,
        spheres: &dyn Shape,
        samples: &LightSamples,
        transmittance: &mut Lanes3,
    ) -> u32 {
        let fresnel_transmittance =
            |cosine: f32, _: u32| self.boundary.straight_transmittance(cosine);
        // Light crosses spheres in a straight line, and has one transmittance for all colours
        spheres.transmittance(
            &samples.rays,
            samples.lanes,
            &fresnel_transmittance,
            &mut transmittance[0],
        );
        transmittance[1] = transmittance[0];
        transmittance[2] = transmittance[0];
        // Find the lanes with some light left
        lanes_in(samples.lanes).mask_where(|lane| transmittance[0][lane] > 0.0)
    }

    /// The transmittance of separate spheres with their media, crossing after crossing for all rays at once. A ray is
    /// inside a sphere in front of each crossing at which it leaves one. Returns the lanes in which it is not 0.
    fn cross_murky_spheres(
        &self,
        spheres: &dyn Shape,
        samples: &LightSamples,
        hits: &mut Intersections,
        transmittance: &mut Lanes3,
    ) -> u32 {
        let rays = &samples.rays;
        let (mut reached, mut alive) = (samples.lanes, samples.lanes);
        // Rays go on beyond the light, which may be inside a sphere
        let far = splat(f32::INFINITY);
        let mut remaining = *rays;
        remaining.t_max = far;
        let mut from = rays.t_min;
        for _ in 0..MAX_SPHERE_CROSSINGS {
            // Find the next crossing of each ray
            remaining.keep_only(alive);
            hits.clear();
            spheres.intersect(&mut remaining, Coherence::Incoherent, 0, hits);
            let found = hits.mask & alive;

            // Attenuate by the sphere that the ray leaves or by mist, and by the crossing in front of the light
            let inside = found & leaving(self.simd, rays, hits);
            for lane in lanes_in(alive & !inside) {
                let next = if found >> lane & 1 == 1 { hits.t[lane] } else { far[lane] };
                let ends = [from[lane], next.min(rays.t_max[lane])];
                self.attenuate_outside(samples, lane, ends, transmittance);
            }
            for lane in lanes_in(inside) {
                let length = (hits.t[lane].min(rays.t_max[lane]) - from[lane]).max(0.0);
                let extinction = self.sphere_extinction(hits.particle[lane]);
                let passing = extinction.map(|coefficient| exp(-length * coefficient));
                set_lane3(transmittance, lane, lane3(transmittance, lane) * passing);
            }
            let crossing = lanes_in(found).mask_where(|lane| hits.t[lane] < rays.t_max[lane]);
            cross_straight(self.simd, &self.boundary, rays, hits, crossing, transmittance);

            // End rays without transmittance, and continue the others
            let dark = dark_lanes(found, transmittance);
            reached &= !dark;
            alive = crossing & !dark;
            if alive == 0 {
                break;
            }
            hits.continue_rays(&mut remaining, alive, &far);
            for lane in lanes_in(alive) {
                from[lane] = hits.t[lane];
            }
        }
        // Rays that are still in front of the light have next to none
        reached & !alive
    }

    /// The transmittance of one connected body, crossing after crossing for all rays at once; rays of `inside` start
    /// inside the body. Returns the lanes in which it is not 0.
    fn cross_body(
        &self,
        body: &dyn Shape,
        samples: &LightSamples,
        mut coherence: Coherence,
        mut inside: u32,
        hits: &mut Intersections,
        transmittance: &mut Lanes3,
    ) -> u32 {
        let (rays, boundary) = (&samples.rays, &self.boundary);
        let medium = TransmissiveBody { shape: body, material: self.scene.particle_material() };
        let mut remaining = *rays;
        let (mut reached, mut alive) = (samples.lanes, samples.lanes);
        // Distances of the previous crossings
        let mut from = rays.t_min;
        for _ in 0..MAX_CROSSINGS {
            // Find the next crossing of each ray
            remaining.keep_only(alive);
            hits.clear();
            body.intersect(&mut remaining, coherence, inside & alive, hits);
            let crossing = hits.mask & alive;

            // Attenuate by the medium up to the crossing, and by the crossing
            let lanes = alive & inside;
            let length = inside_lengths(rays, hits, crossing, lanes, &from);
            let segments = InsideSegments { rays, from: &from, length: &length, lanes };
            self.absorb_in(&medium, segments, transmittance);
            for lane in lanes_in(alive & !inside) {
                let end = if crossing >> lane & 1 == 1 { hits.t[lane] } else { rays.t_max[lane] };
                self.attenuate_outside(samples, lane, [from[lane], end], transmittance);
            }
            cross_straight(self.simd, boundary, rays, hits, crossing, transmittance);

            // End rays without transmittance
            let dark = dark_lanes(crossing, transmittance);
            reached &= !dark;
            alive = crossing & !dark;
            if alive == 0 {
                break;
            }

            // Continue beyond the crossing
            hits.continue_rays(&mut remaining, alive, &rays.t_max);
            for lane in lanes_in(alive) {
                from[lane] = hits.t[lane];
            }
            inside ^= alive;
            coherence = Coherence::Incoherent;
        }
        reached
    }
}

impl RenderContext<'_> {
    /// The transmittance of several connected bodies, crossing after crossing for all rays at once; rays start inside the
    /// bodies of `sets`. Returns the lanes in which it is not 0.
    fn cross_bodies(
        &self,
        nested: &TransmissiveBodies<'_>,
        samples: &LightSamples,
        mut sets: [BodySet; LANES],
        hits: &mut Intersections,
        transmittance: &mut Lanes3,
    ) -> u32 {
        let rays = &samples.rays;
        let mut remaining = *rays;
        let (mut reached, mut alive) = (samples.lanes, samples.lanes);
        // Distances of the previous crossings
        let mut from = rays.t_min;
        for _ in 0..MAX_CROSSINGS {
            // Find the next crossing of each ray
            remaining.keep_only(alive);
            hits.clear();
            for (index, body) in nested.all().iter().enumerate() {
                let inside = alive & lanes_inside(index, &sets);
                body.shape.intersect(&mut remaining, Coherence::Incoherent, inside, hits);
            }
            let crossing = hits.mask & alive;

            // Attenuate by the media up to the crossings, and by those between different media
            for (medium, lanes) in media_of(alive, &sets) {
                let length = inside_lengths(rays, hits, crossing, lanes, &from);
                if let Some(body) = nested.absorbing(medium) {
                    let segments = InsideSegments { rays, from: &from, length: &length, lanes };
                    self.absorb_in(body, segments, transmittance);
                }
            }
            for lane in lanes_in(alive).filter(|lane| sets[*lane].is_empty()) {
                let end = if crossing >> lane & 1 == 1 { hits.t[lane] } else { rays.t_max[lane] };
                self.attenuate_outside(samples, lane, [from[lane], end], transmittance);
            }
            self.cross_boundaries(nested, (rays, hits), crossing, &sets, transmittance);

            // End rays without transmittance
            let dark = dark_lanes(crossing, transmittance);
            reached &= !dark;
            alive = crossing & !dark;
            if alive == 0 {
                break;
            }

            // Continue beyond the crossing
            hits.continue_rays(&mut remaining, alive, &rays.t_max);
            for lane in lanes_in(alive) {
                from[lane] = hits.t[lane];
                sets[lane] = sets[lane].across(nested.crossed_at(hits, lane));
            }
        }
        reached
    }

    /// Multiplies `transmittance` by that of the boundaries that shadow rays of `lanes` cross at `hits`; before, they are
    /// inside the bodies of `sets`.
    fn cross_boundaries(
        &self,
        nested: &TransmissiveBodies<'_>,
        (rays, hits): (&RayPacket, &Intersections),
        lanes: u32,
        sets: &[BodySet; LANES],
        transmittance: &mut Lanes3,
    ) {
        let Some(boundaries) = &self.boundaries else {
            return;
        };
        for BoundaryLanes { boundary, lanes, .. } in nested.boundaries(hits, lanes, sets) {
            let dielectric = boundaries.of(boundary);
            cross_straight(self.simd, dielectric, rays, hits, lanes, transmittance);
        }
    }
}

/// Those of `lanes` in which almost no light is left.
fn dark_lanes(lanes: u32, transmittance: &Lanes3) -> u32 {
    lanes_in(lanes).mask_where(|lane| lane3(transmittance, lane).max_element() < MIN_TRANSMITTANCE)
}

/// Lengths of the segments of `lanes` inside a body, `from` the previous crossing to the next one in `crossing`, or
/// to the light. An unbounded segment has left through a crack in the surface, and gets length 0.
fn inside_lengths(
    rays: &RayPacket,
    hits: &Intersections,
    crossing: u32,
    lanes: u32,
    from: &Lanes,
) -> Lanes {
    let mut length = splat(0.0);
    for lane in lanes_in(lanes) {
        let end = if crossing >> lane & 1 == 1 { hits.t[lane] } else { rays.t_max[lane] };
        if end.is_finite() {
            length[lane] = end - from[lane];
        }
    }
    length
}
