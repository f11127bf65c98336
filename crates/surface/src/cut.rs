//! Spheres that are cut to a convex region, with flat faces where they are cut: the intersection of the union of solid
//! balls with the region.
//!
//! A ray is inside a convex region on one interval. If it enters the region inside a ball, it hits the face there.
//! Otherwise the spheres are traced within the interval, and a ray that finds none and leaves the region inside a ball
//! hits the face from inside. So trees and kernels know nothing of cuts.
//!
//! Where several balls contain a point of a face, it belongs to the one with the least power distance
//! `|p - c|^2 - r^2`, whose borders on the face are those of the spheres in front of it. Ties go to the lower particle
//! index.

use glam::{DVec3, Vec3};

use super::shape::{CutShape, crossing_of_packet};
use super::spheres::step_off;
use super::{Intersection, Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{LANES, Lanes, first_lanes, lanes_in, splat};
use spherule_tree::ray::{Ray, RayPacket};

/// A plane: points with `normal . p <= distance` are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Plane {
    normal: Vec3,
    distance: f32,
}

/// The points behind all of some planes, relative to the origin of the sequence; without planes, all points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ConvexRegion {
    planes: Vec<Plane>,
}

/// The part of a ray in a region; empty if it does not begin before it ends.
#[derive(Debug, Clone, Copy)]
struct Span {
    /// Distances at which the ray enters and leaves the region.
    ends: [f32; 2],
    /// The planes that it crosses there.
    planes: [usize; 2],
}

impl ConvexRegion {
    /// Whether there are no planes.
    pub fn is_everywhere(&self) -> bool {
        self.planes.is_empty()
    }

    /// Leaves out what is beyond the plane through `point`, in the direction of the unit vector `normal`.
    pub fn cut(&mut self, point: DVec3, normal: DVec3) {
        let normal = normal.as_vec3();
        #[expect(clippy::cast_possible_truncation, reason = "rays are in f32")]
        let distance = point.dot(normal.as_dvec3()) as f32;
        self.planes.push(Plane { normal, distance });
    }

    fn span(&self, ray: &Ray) -> Span {
        let mut span = Span { ends: [f32::NEG_INFINITY, f32::INFINITY], planes: [0; 2] };
        for (index, plane) in self.planes.iter().enumerate() {
            let height = plane.distance - plane.normal.dot(ray.origin);
            let slope = plane.normal.dot(ray.direction);
            if slope == 0.0 && height < 0.0 {
                span.ends = [f32::INFINITY, f32::NEG_INFINITY];
            }
            let t = height / slope;
            if slope < 0.0 && t > span.ends[0] {
                (span.ends[0], span.planes[0]) = (t, index);
            } else if slope > 0.0 && t < span.ends[1] {
                (span.ends[1], span.planes[1]) = (t, index);
            }
        }
        span
    }
}

/// Spheres cut to a region.
#[derive(Debug, Clone, Copy)]
pub struct CutSpheres<'a, S> {
    spheres: S,
    region: &'a ConvexRegion,
}

/// The spheres that contain one point of each ray.
struct Owners {
    /// Rays whose point is in a sphere.
    mask: u32,
    particle: [u32; LANES],
    radius: Lanes,
    power: Lanes,
}

impl<'a, S: CutShape> CutSpheres<'a, S> {
    /// The part of `spheres` in `region`.
    pub const fn new(spheres: S, region: &'a ConvexRegion) -> Self {
        Self { spheres, region }
    }

    /// For each ray of `lanes`, the sphere that contains its point at distance `t`.
    fn owners(&self, rays: &RayPacket, t: &Lanes, lanes: u32) -> Owners {
        let mut owners = Owners {
            mask: 0,
            particle: [u32::MAX; LANES],
            radius: splat(0.0),
            power: splat(f32::INFINITY),
        };
        if lanes == 0 {
            return owners;
        }
        // Cut each ray down to its point
        let mut points = *rays;
        for lane in lanes_in(lanes) {
            points.t_min[lane] = t[lane];
            points.t_max[lane] = t[lane].next_up();
        }
        let spheres = &self.spheres;
        // Among spheres that contain it, choose that with the least power; equal ones by index
        spheres.visit_chords(&points, lanes, &mut |lane, particle, radius, [near, far]| {
            let t = t[lane];
            let contains = near < t && t <= far;
            if !contains {
                return;
            }
            let power = (t - near) * (t - far);
            let is_first = particle < owners.particle[lane];
            if power < owners.power[lane] || (power == owners.power[lane] && is_first) {
                owners.power[lane] = power;
                owners.particle[lane] = particle;
                owners.radius[lane] = radius;
                owners.mask |= 1 << lane;
            }
        });
        owners
    }

    /// The intersection of a ray with the face on `plane` at distance `t`.
    fn face(&self, ray: &Ray, t: f32, plane: usize, particle: u32, radius: f32) -> Intersection {
        let Plane { normal, distance } = self.region.planes[plane];
        let on_ray = ray.at(t);
        let point = on_ray - normal * (normal.dot(on_ray) - distance);
        Intersection {
            t,
            point,
            normal,
            shading: normal,
            lift: 0.0,
            radius,
            particle,
            offset: step_off(radius, point, ray.origin),
            anchor: point,
        }
    }

    /// Ends the rays that are in a sphere at the given end of their spans.
    fn end_at_faces(
        &self,
        rays: &mut RayPacket,
        spans: &[Span; LANES],
        end: usize,
        owners: &Owners,
        hits: &mut Intersections,
    ) {
        for lane in lanes_in(owners.mask) {
            let hit = self.face(
                &rays.ray(lane),
                spans[lane].ends[end],
                spans[lane].planes[end],
                owners.particle[lane],
                owners.radius[lane],
            );
            hits.end_ray(rays, lane, &hit, self.spheres.material());
        }
    }

    /// The spans of `rays`, the rays of `lanes` that enter the region between their ends, and those that leave it
    /// there. Shortens all rays to their spans, and disables those without one.
    fn shorten(&self, rays: &mut RayPacket, lanes: u32) -> ([Span; LANES], [u32; 2]) {
        let empty = Span { ends: [f32::INFINITY, f32::NEG_INFINITY], planes: [0; 2] };
        let (mut spans, mut crossing) = ([empty; LANES], [0; 2]);
        for lane in lanes_in(first_lanes(rays.len())) {
            let ray = rays.ray(lane);
            let span = self.region.span(&ray);
            let [enter, leave] = span.ends;
            let (start, end) = (enter.max(ray.t_min), leave.min(ray.t_max));
            let is_in = start < end && lanes >> lane & 1 == 1;
            if !is_in {
                disable(rays, lane);
                continue;
            }
            crossing[0] |= u32::from(enter >= ray.t_min) << lane;
            crossing[1] |= u32::from(leave < ray.t_max) << lane;
            (rays.t_min[lane], rays.t_max[lane]) = (start, end);
            spans[lane] = span;
        }
        (spans, crossing)
    }
}

/// Rays that end before they start hit nothing.
fn disable(rays: &mut RayPacket, lane: usize) {
    (rays.t_min[lane], rays.t_max[lane]) = (0.0, -1.0);
}

impl<S: CutShape> Shape for CutSpheres<'_, S> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn material(&self) -> MaterialId {
        self.spheres.material()
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        let given = [rays.t_min, rays.t_max];
        let all = first_lanes(rays.len());
        let (spans, [entering, leaving]) = self.shorten(rays, all);
        // Find the rays that enter the region inside a ball
        let entries = self.owners(rays, &spans.map(|span| span.ends[0]), entering);
        for lane in lanes_in(entries.mask) {
            disable(rays, lane);
        }
        // Trace the others within the region
        let end = rays.t_max;
        self.spheres.intersect(rays, coherence, inside, hits);
        let is_ended = |lane| u32::from(rays.t_max[lane] < end[lane]) << lane;
        let found = lanes_in(all).fold(0, |found, lane| found | is_ended(lane));
        // Find the rays that leave the region inside a ball
        let leaving = leaving & !found & !entries.mask;
        let exits = self.owners(rays, &spans.map(|span| span.ends[1]), leaving);
        // Rays without a hit go on
        rays.t_min = given[0];
        for lane in lanes_in(all & !found) {
            rays.t_max[lane] = given[1][lane];
        }
        self.end_at_faces(rays, &spans, 0, &entries, hits);
        self.end_at_faces(rays, &spans, 1, &exits, hits);
    }

    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        let mut rest = *rays;
        let (spans, [entering, leaving]) = self.shorten(&mut rest, lanes);
        let enter = spans.map(|span| span.ends[0]);
        let mut occluded = self.owners(&rest, &enter, entering).mask;
        for lane in lanes_in(occluded) {
            disable(&mut rest, lane);
        }
        let all = first_lanes(rays.len());
        occluded |= self.spheres.occluded(&rest, coherence, all);
        let leave = spans.map(|span| span.ends[1]);
        occluded | self.owners(&rest, &leave, leaving & !occluded).mask
    }
}

#[cfg(test)]
#[path = "cut_tests.rs"]
mod tests;
