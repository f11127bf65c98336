//! Rods as a shape.

use std::array;

use glam::{DVec3, Vec3};

use super::interval::Crossing;
use super::{Rod, RodTree, double};
use crate::hierarchy::single;
use crate::shape::crossing_of_packet;
use crate::{Intersection, Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{LANES, first_lanes};
use spherule_tree::ray::{Ray, RayPacket};

/// Distance by which rays step off a surface, in units of the rounding of the largest coordinate.
const OFFSET: f32 = 8.0 * f32::EPSILON;

/// Factor on radii, so that rounding never loses a crossing.
const REACH: f64 = 1.0 + 1e-4;

/// Rods as a shape.
#[derive(Clone, Copy, Debug)]
pub struct RodSurface<'a> {
    tree: &'a RodTree,
    material: MaterialId,
}

impl<'a> RodSurface<'a> {
    /// Rods with this material. With [`MaterialId::PARTICLES`], each half has the attributes of its particle; with
    /// another one, the [colours](RodTree::with_colors) of the tree.
    pub const fn new(tree: &'a RodTree, material: MaterialId) -> Self {
        Self { tree, material }
    }
}

/// A ray in double precision.
struct DoubleRay {
    origin: DVec3,
    direction: DVec3,
    /// The distances between which it can hit.
    range: [f32; 2],
}

impl DoubleRay {
    fn new(ray: &Ray) -> Self {
        Self {
            origin: double(ray.origin),
            direction: double(ray.direction),
            range: [ray.t_min, ray.t_max],
        }
    }

    /// Whether the line of the ray is farther from that of the rod than its greatest radius, which takes a fraction of
    /// the time of [`Self::first`].
    fn misses(&self, rod: &Rod) -> bool {
        let [start, end] = rod.ends.map(double);
        let across = self.direction.cross(end - start);
        let distance = (start - self.origin).dot(across);
        let radius = REACH * f64::from(rod.radii[0].max(rod.radii[1]));
        distance * distance > radius * radius * across.length_squared()
    }

    /// The first crossing with a rod within the range.
    fn first(&self, tree: &RodTree, rod: u32) -> Option<Crossing> {
        if self.misses(&tree.rods[rod as usize]) {
            return None;
        }
        let crossings = tree.body(rod).crossings(self.origin, self.direction);
        let is_in_range = |crossing: &Crossing| {
            let t = single(crossing.t);
            t >= self.range[0] && t < self.range[1]
        };
        crossings.into_iter().flatten().find(is_in_range)
    }
}

/// The rods that are hit.
struct Nearest {
    /// Distance, as it is stored, and index: at equal distances, the lower index wins.
    place: (f32, u32),
    crossing: Crossing,
}

impl RodSurface<'_> {
    /// The intersection of a ray with the rod that it hits first.
    fn intersection(&self, ray: &DoubleRay, hit: &Nearest) -> Intersection {
        let tree = self.tree;
        let (t_stored, rod) = hit.place;
        let body = tree.body(rod);
        let point = ray.origin + hit.crossing.t * ray.direction;
        let half = body.half_of(point);
        let normal = body.normal(ray.origin, ray.direction, &hit.crossing).as_vec3();
        let largest = tree.extent.max(ray.origin.as_vec3().abs().max_element());
        Intersection {
            t: t_stored,
            point: point.as_vec3(),
            normal,
            shading: normal,
            lift: 0.0,
            radius: f32::INFINITY,
            particle: tree.rods[rod as usize].particles[half],
            offset: OFFSET * largest,
            anchor: point.as_vec3(),
        }
    }
}

/// The rays of a packet in double precision; the last one again in lanes without one.
fn double_rays(rays: &RayPacket) -> [DoubleRay; LANES] {
    let last = rays.len().saturating_sub(1);
    array::from_fn(|lane| DoubleRay::new(&rays.ray(lane.min(last))))
}

impl Shape for RodSurface<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn material(&self) -> MaterialId {
        self.material
    }

    fn colors(&self) -> &[Vec3] {
        &self.tree.colors
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        _coherence: Coherence,
        _inside: u32,
        hits: &mut Intersections,
    ) {
        if rays.is_empty() {
            return;
        }
        // Find the nearest rod in double precision; of equal ones the lower index wins
        let exact = double_rays(rays);
        let mut found: [Option<Nearest>; LANES] = [const { None }; LANES];
        self.tree.parts.visit(rays, first_lanes(rays.len()), |lane, rod| {
            let crossing = exact[lane].first(self.tree, rod)?;
            let place = (single(crossing.t), rod);
            if found[lane].as_ref().is_none_or(|nearest| place < nearest.place) {
                found[lane] = Some(Nearest { place, crossing });
            }
            Some(crossing.t)
        });
        // End the rays there
        for (lane, nearest) in found.iter().enumerate() {
            if let Some(nearest) = nearest {
                let hit = self.intersection(&exact[lane], nearest);
                hits.end_ray(rays, lane, &hit, self.material);
            }
        }
    }

    fn occluded(&self, rays: &RayPacket, _coherence: Coherence, lanes: u32) -> u32 {
        if rays.is_empty() {
            return 0;
        }
        let exact = double_rays(rays);
        let mut occluded = 0;
        self.tree.parts.visit(rays, lanes, |lane, rod| {
            exact[lane].first(self.tree, rod)?;
            occluded |= 1 << lane;
            // Nothing else matters to the ray
            Some(-1.0)
        });
        occluded
    }
}
