//! Rods as a shape.

use glam::{DVec3, Vec3};

use super::interval::Crossing;
use super::{Rod, RodTree, double};
use crate::surface::hierarchy::single;
use crate::surface::{Intersection, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::lanes_in;
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

impl Shape for RodSurface<'_> {
    fn crossing(&self, ray: &Ray, _side: Side) -> Option<Intersection> {
        let tree = self.tree;
        let exact = DoubleRay::new(ray);
        let (rod, hit) = tree.hierarchy.nearest(ray, |rod| {
            let crossing = exact.first(tree, rod)?;
            Some((crossing.t, crossing))
        })?;
        let point = exact.origin + hit.t * exact.direction;
        let half = tree.body(rod).half_of(point);
        let normal = hit.normal.as_vec3();
        let largest = tree.extent.max(ray.origin.abs().max_element());
        Some(Intersection {
            t: single(hit.t),
            point: point.as_vec3(),
            normal,
            shading: normal,
            lift: 0.0,
            radius: f32::INFINITY,
            particle: tree.rods[rod as usize].particles[half],
            offset: OFFSET * largest,
            anchor: point.as_vec3(),
        })
    }

    fn material(&self) -> MaterialId {
        self.material
    }

    fn colors(&self) -> &[Vec3] {
        &self.tree.colors
    }

    fn occluded(&self, rays: &RayPacket, _coherence: Coherence, lanes: u32) -> u32 {
        lanes_in(lanes).fold(0, |hit_lanes, lane| {
            let ray = rays.ray(lane);
            let exact = DoubleRay::new(&ray);
            let is_hit = |rod| exact.first(self.tree, rod).is_some();
            let is_hit = ray.t_max > ray.t_min && self.tree.hierarchy.is_hit(&ray, is_hit);
            hit_lanes | u32::from(is_hit) << lane
        })
    }
}
