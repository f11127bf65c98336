//! Finds the particles around a point, by queries to the tree that rays use.

use std::borrow::Borrow;

use glam::Vec3;

use super::leaves::Leaves;
use super::simd::{PacketKernel, finite_inverse};
use super::topology::Topology;
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::walk;
use crate::blocks::BLOCK_SIZE;
use crate::ray::Ray;

impl TreeView<'_> {
    /// Calls `visit` with slot and centre of every particle whose centre is within `reach` of `point`, in traversal
    /// order, until it returns false. A particle that is stored in several slots is visited several times.
    pub fn visit_neighbours(&self, point: Vec3, reach: f32, visit: impl FnMut(u32, Vec3) -> bool) {
        self.run(Neighbours { point, reach, visit });
    }
}

struct Neighbours<F> {
    point: Vec3,
    reach: f32,
    /// Called with every particle; false ends the traversal.
    visit: F,
}

impl<F: FnMut(u32, Vec3) -> bool> TreeTask for Neighbours<F> {
    type Output = ();

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) {
        let Self { point, reach, mut visit } = self;
        // Use a ray of length zero and boxes padded by `reach`: all boxes contain the centres of their particles, so
        // the ray enters every box with a centre within `reach`
        let ray = Ray::new(point, Vec3::X);
        let prepared = kernel.prepare(&ray, finite_inverse(ray.direction), 0.0, reach);
        let slots = tree.view.slot_count();
        walk(
            kernel,
            tree,
            |node, limit| kernel.test_node(&prepared, node, limit),
            0.0,
            |block, limit| {
                // Visit the particles of the block that are within `reach`
                let loaded = tree.leaves.load(kernel, block);
                let centers = loaded.borrow();
                let first = block * BLOCK_SIZE;
                for lane in 0..BLOCK_SIZE.min(slots.saturating_sub(first)) {
                    let center = centers.center(lane);
                    if center.distance_squared(point) > reach * reach {
                        continue;
                    }
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "slots are counted in 32 bits"
                    )]
                    if !visit((first + lane) as u32, center) {
                        return -1.0;
                    }
                }
                limit
            },
        );
    }
}
