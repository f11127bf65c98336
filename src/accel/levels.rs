//! Whole levels of nodes over whatever lies below them, from the lowest up.

use rayon::prelude::*;

use super::Aabb;
use super::upper::kd_order;
use spherule_formats::blocks::{Node, WIDTH};
use spherule_formats::order::index_u32;

/// Node levels at most. Whole levels need ten: 8^10 blocks of 16 are more particles than 32 bits
/// count. Builders of other shapes keep to it by balancing what would grow deeper.
pub(super) const MAX_LEVELS: usize = 12;

/// The order of the levels above subtrees of about a thousand particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UpperLevels {
    /// That of the particles.
    InOrder,
    /// One of their own, where that of the particles makes no compact nodes (see `upper.rs`).
    Mapped,
}

/// Levels of nodes that stay in the order of the particles: subtrees of 8 * 8 blocks.
const LOWER_LEVELS: usize = 2;

impl UpperLevels {
    /// The level of the roots of those subtrees out of so many, if there are levels above it to gain by
    /// another order.
    pub(super) fn mapped_level(self, levels: usize) -> Option<usize> {
        match self {
            Self::InOrder => None,
            Self::Mapped => levels.checked_sub(LOWER_LEVELS).filter(|level| *level > 0),
        }
    }
}

/// Nodes of each level, root level first; empty without blocks.
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

/// Number of the first node of each level.
pub(super) fn level_starts(counts: &[usize]) -> Vec<u32> {
    let mut total = 0;
    let start = |count: &usize| {
        let start = index_u32(total);
        total += count;
        start
    };
    counts.iter().map(start).collect()
}

/// Something that a node encloses.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Child {
    /// Its box.
    pub(super) bounds: Aabb,
    /// Areas of the padded boxes that are inside it but in no node that is built here.
    pub(super) inner_area: f64,
}

/// What comes of building levels, beside the nodes.
#[derive(Debug, Default)]
pub(super) struct BuiltLevels {
    /// Box of the root, not padded; empty without levels.
    pub(super) bounds: Aabb,
    /// Summed areas of the padded boxes of all children.
    pub(super) child_areas: f64,
    /// Order of the mapped level.
    pub(super) mapped: Vec<u32>,
}

/// Fills `nodes`, of which there are `counts` on each level, root level first. `child` gives what the
/// nodes of the last level enclose, and nothing beyond the end. Areas are of boxes with `padding`.
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
        let below = std::mem::take(&mut boxes);
        let area;
        (boxes, area) = if depth + 1 == counts.len() {
            build_level(level, padding, &child)
        } else {
            build_level(level, padding, |index| {
                below.get(index).map(|bounds| Child {
                    bounds: *bounds,
                    inner_area: 0.0,
                })
            })
        };
        built.child_areas += area;
        if Some(depth) == mapped_level {
            built.mapped = kd_order(&boxes);
            bring_into_order(level, &mut boxes, &built.mapped);
        }
    }
    if let Some(root) = boxes.first() {
        built.bounds = *root;
    }
    built
}

/// Puts the nodes of a level and their boxes into `order`.
fn bring_into_order(level: &mut [Node], boxes: &mut Vec<Aabb>, order: &[u32]) {
    let old = level.to_vec();
    for (node, place) in level.iter_mut().zip(order) {
        *node = old[*place as usize];
    }
    *boxes = order.iter().map(|place| boxes[*place as usize]).collect();
}

/// Fills `level`; returns the box of each node and the summed area of the children.
fn build_level(
    level: &mut [Node],
    padding: f32,
    child: impl Fn(usize) -> Option<Child> + Sync,
) -> (Vec<Aabb>, f64) {
    // Areas are summed by runs of a fixed length, so that the sum does not depend on the threads.
    const RUN: usize = 1024;
    let mut boxes = vec![Aabb::EMPTY; level.len()];
    let areas: Vec<f64> = level
        .par_chunks_mut(RUN)
        .zip(boxes.par_chunks_mut(RUN))
        .enumerate()
        .map(|(run, (nodes, boxes))| {
            let mut area = 0.0;
            for (offset, (node, own)) in nodes.iter_mut().zip(boxes).enumerate() {
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

/// Expected tests of a ray that meets the `root` box, over children whose areas are summed up.
pub(super) fn sah_cost(child_areas: f64, root: Aabb) -> f64 {
    let root_area = root.area();
    if root_area > 0.0 {
        1.0 + child_areas / root_area
    } else {
        1.0
    }
}
