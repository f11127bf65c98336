//! Finds the rods that rays may hit: spheres around the parts of rods, in a tree for spheres, whose kernels trace packets
//! of any rays.
//!
//! Spheres are larger than the parts by more than the rounding of the traversal, so that no rod is lost. Which other
//! rods are found does not matter: each of them is intersected exactly.

use glam::{DVec3, Vec3};

use super::parts::Part;
use super::{Caps, Rod, double};
use crate::hierarchy::{range_in_box, single};
use spherule_tree::accel::{
    BuildBytes, BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder, predicted_bytes,
};
use spherule_tree::math::{LANES, first_lanes, lanes_in};
use spherule_tree::ray::{Ray, RayPacket};

/// Rounding of the traversal as a fraction of the size of all rods.
const PADDING: f64 = 32.0 * f32::EPSILON as f64;

/// Spheres around the parts of rods.
pub(super) struct PartTree {
    trees: TreeBuilder,
    /// Memory of the tree.
    tree_bytes: usize,
    /// The rod of each sphere.
    owners: Vec<u32>,
    /// Centre of the box of all rods. The tree is relative to it, so that it is as exact far from the origin.
    center: DVec3,
    /// Half the size of that box.
    half: DVec3,
    /// The largest radius of a sphere.
    largest: f64,
}

/// A ray in the coordinates of the tree.
#[derive(Clone, Copy)]
struct LocalRay {
    /// Distance along the ray at which it starts: before all spheres around what is between its ends.
    start: f64,
    /// Its current end, from its start.
    end: f32,
}

impl PartTree {
    /// The tree of `parts` of `rods`.
    pub(super) fn new(parts: &[Part], rods: &[Rod], caps: Caps) -> Self {
        // Find the box of all parts, which limits the rounding
        let boxes = parts.iter().map(|part| part.bounds(rods, caps));
        let [min, max] = boxes.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |all, own| {
            [all[0].min(own[0]), all[1].max(own[1])]
        });
        let (center, half) = (0.5 * (min + max), 0.5 * (max - min));
        let padding = PADDING * half.length();
        // Bound each part by a sphere around the middle of the box
        let spheres = parts.iter().map(|part| part.sphere(rods, caps));
        let (centers, radii): (Vec<Vec3>, Vec<f32>) = spheres
            .map(|(middle, radius)| ((middle - center).as_vec3(), single(radius + padding)))
            .unzip();
        let mut trees = TreeBuilder::new();
        let spheres = Spheres { centers: &centers, radius: SphereRadius::Each(&radii) };
        let report = trees.build(&spheres, &settings());
        let tree_bytes = report.position_bytes + report.structure_bytes;
        Self {
            trees,
            tree_bytes: usize::try_from(tree_bytes).unwrap_or(usize::MAX),
            owners: parts.iter().map(|part| part.rod).collect(),
            center,
            half,
            largest: radii.iter().copied().fold(0.0, f32::max).into(),
        }
    }

    /// The box of all rods; None without any.
    pub(super) fn bounds(&self) -> Option<[Vec3; 2]> {
        let corners = [self.center - self.half, self.center + self.half];
        (!self.owners.is_empty()).then_some(corners.map(|corner| corner.as_vec3()))
    }

    /// Memory, bytes.
    pub(super) const fn bytes(&self) -> usize {
        self.tree_bytes + size_of_val(self.owners.as_slice())
    }

    /// Memory of a tree of `parts` parts, bytes: while it is built, and afterwards.
    pub(super) fn predicted_bytes(parts: u64) -> [u64; 2] {
        let BuildBytes { tree, scratch } = predicted_bytes(&settings(), parts, true);
        let kept = tree.saturating_add(parts.saturating_mul(size_of::<u32>() as u64));
        let each = (size_of::<Part>() + size_of::<Vec3>() + size_of::<f32>()) as u64;
        [kept.saturating_add(scratch).saturating_add(parts.saturating_mul(each)), kept]
    }

    /// Calls `visit` with a lane and a rod for each rod that the ray may hit between its ends, some of them several
    /// times, and for some other rods. `visit` returns the distance behind which other rods do not matter to the ray, or
    /// None if that stays the same; a negative one ends the ray.
    pub(super) fn visit(
        &self,
        rays: &RayPacket,
        lanes: u32,
        mut visit: impl FnMut(usize, u32) -> Option<f64>,
    ) {
        let mut packet = *rays;
        let mut locals = [LocalRay { start: 0.0, end: -1.0 }; LANES];
        let mut active = 0;
        // Move each ray to the box of all rods, since rounding grows with the distance from its origin
        for lane in lanes_in(lanes & first_lanes(rays.len())) {
            let ray = rays.ray(lane);
            let Some([enter, leave]) = self.range(&ray) else {
                continue;
            };
            let start = enter - 2.0 * self.largest;
            let origin = double(ray.origin) - self.center + start * double(ray.direction);
            let end = single(leave - start + PADDING * self.half.length());
            for axis in 0..3 {
                packet.origin[axis][lane] = single(origin[axis]);
            }
            (packet.t_min[lane], packet.t_max[lane]) = (0.0, end);
            locals[lane] = LocalRay { start, end };
            active |= 1 << lane;
        }
        if active == 0 {
            return;
        }
        // Visit the parts whose spheres the rays enter
        let view = self.trees.tree().view();
        view.visit_entries(&packet, active, |lane, hit| {
            let rod = self.owners[view.particle(hit.slot) as usize];
            let limit = visit(lane, rod)?;
            let local = &mut locals[lane];
            if limit < 0.0 {
                local.end = -1.0;
            } else {
                // Spheres at the same distance may contain a rod with a lower index
                let limit = single(limit - local.start + PADDING * self.half.length());
                local.end = local.end.min(limit);
            }
            Some(local.end)
        });
    }

    /// The distances between which a ray may hit rods: where it is in the box of all of them.
    fn range(&self, ray: &Ray) -> Option<[f64; 2]> {
        if !(ray.origin.is_finite() && ray.direction.is_finite() && ray.t_max > ray.t_min) {
            return None;
        }
        range_in_box(ray, self.center, self.half, PADDING * self.half.length())
    }
}

/// How the tree is built: to be traced by many rays.
fn settings() -> BuildSettings {
    BuildSettings::new(Structure::Kdtree)
}
