//! The particles about a place, found in the tree that rays use.

use std::borrow::Borrow;

use glam::Vec3;

use super::leaves::Leaves;
use super::simd::PacketKernel;
use super::topology::Topology;
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::walk;
use crate::ray::Ray;
use spherule_formats::blocks::BLOCK_SIZE;

impl TreeView<'_> {
    /// Gives `visit` slot and centre of every particle whose centre lies within `reach` of `point`, in the
    /// order of the walk, until it returns false. Where there are copies, they come several times.
    pub(crate) fn visit_near(&self, point: Vec3, reach: f32, visit: impl FnMut(u32, Vec3) -> bool) {
        self.run(Near {
            point,
            reach,
            visit,
        });
    }
}

struct Near<F> {
    point: Vec3,
    reach: f32,
    /// Gets every particle; false ends the walk.
    visit: F,
}

impl<F: FnMut(u32, Vec3) -> bool> TreeTask for Near<F> {
    type Output = ();

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) {
        let Self {
            point,
            reach,
            mut visit,
        } = self;
        // A ray of no length meets the boxes that hold its start, once they are `reach` larger on every
        // side: all boxes hold the centres of their particles.
        let ray = Ray::new(point, Vec3::X);
        let prepared = kernel.prepare(&ray, 0.0, reach);
        let slots = tree.view.slot_count();
        walk(
            kernel,
            tree,
            |node, limit| kernel.test_node(&prepared, node, limit),
            0.0,
            |block, limit| {
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
