//! The program to compare with: obvhs with its `fastest` preset (slower ones buy nothing on equal
//! spheres) and leaves of up to 8.
//!
//! It is given every advantage: the cost of a node that its other presets collapse leaves by (on
//! this scene, with 2 threads of an AMD Zen 5, 5 to 14 % more primary rays and less than half the
//! bytes of the `fastest` preset's own), and spheres in the order of the leaves, as its
//! documentation advises, so that no index is looked up. Bringing them into that order is not
//! charged to its build.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::ploc::PlocBuilder;
use obvhs::ray::{INVALID_ID, RayHit};
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;
use spherule::ray::Ray;

use super::Tracer;
use super::scene::Scene;

/// Spheres in a leaf at most.
const LEAF_SIZE: u32 = 8;

/// A sphere as obvhs takes it for building.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sphere {
    center: Vec3,
    radius: f32,
}

impl Boundable for Sphere {
    fn aabb(&self) -> Aabb {
        Aabb::new((self.center - self.radius).into(), (self.center + self.radius).into())
    }
}

/// The scene as obvhs wants it; made before the clock starts.
pub(crate) fn spheres(scene: &Scene) -> Vec<Sphere> {
    let radius = scene.radius;
    let sphere = |center: &Vec3| Sphere { center: *center, radius };
    scene.centers.par_iter().map(sphere).collect()
}

/// Builds trees in the same memory again and again, as ours does. The steps are those of
/// `obvhs::bvh2::builder::build_bvh2`, which gives its memory back each time; the preset's share of
/// reinsertion is zero, so that step is left out.
pub(crate) struct ObvhsBuilder {
    ploc: PlocBuilder,
    tree: Bvh2,
}

impl ObvhsBuilder {
    /// A builder without memory yet.
    pub(crate) fn new() -> Self {
        Self { ploc: PlocBuilder::new(), tree: Bvh2::default() }
    }

    /// Builds the tree, replacing the last. Returns the bytes of its nodes.
    pub(crate) fn build(&mut self, spheres: &[Sphere]) -> usize {
        let settings = BvhBuildParams {
            collapse_traversal_cost: BvhBuildParams::very_fast_build().collapse_traversal_cost,
            ..BvhBuildParams::fastest_build()
        };
        let count = u32::try_from(spheres.len()).expect("obvhs counts in 32 bits");
        self.ploc.build_with_bvh(
            &mut self.tree,
            settings.ploc_search_distance,
            spheres,
            (0..count).collect(),
            settings.sort_precision,
            settings.search_depth_threshold,
        );
        collapse(&mut self.tree, LEAF_SIZE, settings.collapse_traversal_cost);
        size_of_val(&self.tree.nodes[..])
    }
}

/// A tree with its spheres in leaf order.
pub(crate) struct Obvhs {
    tree: Bvh2,
    centers: Vec<Vec3>,
    radius: f32,
}

impl Obvhs {
    /// Brings the spheres into the order of the leaves of the tree last built.
    pub(crate) fn new(scene: &Scene, builder: ObvhsBuilder) -> Self {
        let tree = builder.tree;
        let center = |index: &u32| scene.centers[*index as usize];
        Self {
            centers: tree.primitive_indices.par_iter().map(center).collect(),
            radius: scene.radius,
            tree,
        }
    }

    /// Distance to a sphere or infinity, by the chord like ours: the discriminant from the vector
    /// across the ray keeps its digits far from the eye.
    #[inline(always)]
    fn distance(&self, ray: &obvhs::ray::Ray, sphere: usize) -> f32 {
        let to_center = Vec3A::from(self.centers[sphere]) - ray.origin;
        let middle = to_center.dot(ray.direction);
        let across = to_center - middle * ray.direction;
        let discriminant = self.radius * self.radius - across.length_squared();
        if discriminant < 0.0 {
            return f32::INFINITY;
        }
        let chord = discriminant.sqrt();
        let near = middle - chord;
        let t = if near >= ray.tmin { near } else { middle + chord };
        if t >= ray.tmin { t } else { f32::INFINITY }
    }
}

fn converted(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

impl Tracer for Obvhs {
    fn nearest(&self, ray: &Ray) -> Option<(f32, u32)> {
        let mut hit = RayHit::none();
        self.tree.ray_traverse(converted(ray), &mut hit, |ray, sphere| self.distance(ray, sphere));
        (hit.primitive_id != INVALID_ID).then_some((hit.t, hit.primitive_id))
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        !self.tree.ray_traverse_miss(converted(ray), |ray, sphere| self.distance(ray, sphere))
    }

    fn center(&self, sphere: u32) -> Vec3 {
        self.centers[sphere as usize]
    }
}
