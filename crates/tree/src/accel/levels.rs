//! Builds complete levels of nodes over blocks or stored nodes, from the lowest level up.

use rayon::prelude::*;

use super::Aabb;
use super::top_levels::kd_order;
use crate::blocks::{Node, WIDTH};
use crate::order::index_u32;

/// Maximum number of node levels. Complete levels need ten: 8^10 blocks of 16 are more particles than 32 bits can
/// count. Builders of other shapes stay within it by balancing subtrees that would be deeper.
pub(super) const MAX_LEVELS: usize = 12;

/// Order of the levels above subtrees of about a thousand particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TopLevels {
    /// The order of the particles.
    InOrder,
    /// An order of their own, for particle orders that do not give compact nodes (see `top_levels.rs`).
    Mapped,
}

/// Levels of nodes that stay in the order of the particles: subtrees of 8 * 8 blocks.
const LOWER_LEVELS: usize = 2;

impl TopLevels {
    /// The level of the roots of those subtrees in a tree of `levels` levels, if there are levels above it that
    /// another order would improve.
    pub(super) fn mapped_level(self, levels: usize) -> Option<usize> {
        match self {
            Self::InOrder => None,
            Self::Mapped => levels.checked_sub(LOWER_LEVELS).filter(|level| *level > 0),
        }
    }
}

/// Node count of each level, root level first; empty without blocks.
pub(super) fn level_counts(blocks: usize) -> Vec<usize> {
    let mut counts = Vec::new();
    let mut count = blocks;
    while count > 1 || (count == 1 && counts.is_empty()) {
        count = count.div_ceil(WIDTH);
        counts.push(count);
    }
    counts.reverse();
    counts
}

/// Index of the first node of each level.
pub(super) fn level_starts(counts: &[usize]) -> Vec<u32> {
    let mut total = 0;
    let start = |count: &usize| {
        let start = index_u32(total);
        total += count;
        start
    };
    counts.iter().map(start).collect()
}

/// A child of a node.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Child {
    /// Its bounding box.
    pub(super) bounds: Aabb,
    /// Total area of the padded boxes inside the child whose nodes were not built here.
    pub(super) inner_area: f64,
}

/// Result of building levels, apart from the nodes.
#[derive(Debug, Default)]
pub(super) struct BuiltLevels {
    /// Box of the root, not padded; empty without levels.
    pub(super) bounds: Aabb,
    /// Total area of the padded boxes of all children.
    pub(super) child_areas: f64,
    /// Order of the mapped level.
    pub(super) mapped: Vec<u32>,
}

/// Fills `nodes`, which has `counts` nodes on each level, root level first. `child` returns the children of the nodes
/// on the last level, and None past the end. Areas are those of boxes with `padding`.
pub(super) fn build_levels(
    mut nodes: &mut [Node],
    counts: &[usize],
    mapped_level: Option<usize>,
    padding: f32,
    child: impl Fn(usize) -> Option<Child> + Sync,
) -> BuiltLevels {
    let mut built = BuiltLevels::default();
    let mut boxes = Vec::new();
    for (depth, count) in counts.iter().enumerate().rev() {
        let (upper, level) = nodes.split_at_mut(nodes.len() - count);
        nodes = upper;
        // Build the level over the caller's children or over the level below it
        let below = std::mem::take(&mut boxes);
        let area;
        (boxes, area) = if depth + 1 == counts.len() {
            build_level(level, padding, &child)
        } else {
            build_level(level, padding, |index| {
                below.get(index).map(|bounds| Child { bounds: *bounds, inner_area: 0.0 })
            })
        };
        built.child_areas += area;
        // Reorder the roots of the subtrees, so that the levels above have compact nodes
        if Some(depth) == mapped_level {
            built.mapped = kd_order(&boxes);
            reorder(level, &mut boxes, &built.mapped);
        }
    }
    if let Some(root) = boxes.first() {
        built.bounds = *root;
    }
    built
}

/// Reorders the nodes of a level and their boxes by `order`.
fn reorder(level: &mut [Node], boxes: &mut Vec<Aabb>, order: &[u32]) {
    let old = level.to_vec();
    for (node, place) in level.iter_mut().zip(order) {
        *node = old[*place as usize];
    }
    *boxes = order.iter().map(|place| boxes[*place as usize]).collect();
}

/// Fills `level`. Returns the box of each node and the total area of the children.
fn build_level(
    level: &mut [Node],
    padding: f32,
    child: impl Fn(usize) -> Option<Child> + Sync,
) -> (Vec<Aabb>, f64) {
    // Areas are summed over runs of a fixed length, so that the sum does not depend on the number of threads.
    const RUN: usize = 1024;
    let mut boxes = vec![Aabb::EMPTY; level.len()];
    let areas: Vec<f64> = level
        .par_chunks_mut(RUN)
        .zip(boxes.par_chunks_mut(RUN))
        .enumerate()
        .map(|(run, (nodes, boxes))| {
            let mut area = 0.0;
            for (offset, (node, own)) in nodes.iter_mut().zip(boxes).enumerate() {
                // Collect the boxes of up to eight children, and encode them
                let first = (run * RUN + offset) * WIDTH;
                let mut bounds = [Aabb::EMPTY; WIDTH];
                let mut used = 0;
                while let Some(child) = (used < WIDTH).then(|| child(first + used)).flatten() {
                    area += child.bounds.padded(padding).area() + child.inner_area;
                    *own = own.union(child.bounds);
                    bounds[used] = child.bounds;
                    used += 1;
                }
                *node = Node::enclosing(&bounds[..used]);
            }
            area
        })
        .collect();
    (boxes, areas.iter().sum())
}

/// Expected number of tests for a ray that hits the `root` box, given the total area of all children.
pub(super) fn sah_cost(child_areas: f64, root: Aabb) -> f64 {
    let root_area = root.area();
    if root_area > 0.0 { 1.0 + child_areas / root_area } else { 1.0 }
}
