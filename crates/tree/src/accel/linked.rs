//! Writes a tree with links: moves blocks and nodes to their final positions and recomputes boxes from the blocks up.

use rayon::prelude::*;

use super::collapse_nodes::Layout;
use super::levels::sah_cost;
use super::pack_leaves::PackedTree;
use super::topology::Link;
use super::wide::WideTree;
use super::{Aabb, SphereRadius, Spheres};
use crate::blocks::BLOCK_SIZE;
use crate::blocks::{Node, WIDTH};

/// Reorders the blocks of `tree` by `layout`.
pub(super) fn reorder_blocks(tree: &mut WideTree, packed: &PackedTree, layout: &Layout) {
    let order = |place: usize| packed.members(layout.blocks[place])[0] as usize;
    permute(&mut tree.blocks, 1, order);
    permute(&mut tree.radii, 1, order);
    permute(&mut tree.indices, BLOCK_SIZE, order);
}

/// Reorders runs of `run` values: run `i` of the result is run `from(i)` of the input. Accepts an empty vector.
fn permute<T: Copy + Send + Sync + bytemuck::Zeroable>(
    values: &mut Vec<T>,
    run: usize,
    from: impl Fn(usize) -> usize + Sync,
) {
    let mut ordered = vec![T::zeroed(); values.len()];
    ordered
        .par_chunks_mut(run)
        .with_min_len(1024)
        .enumerate()
        .for_each(|(place, to)| to.copy_from_slice(&values[from(place) * run..][..run]));
    *values = ordered;
}

/// Fills the blocks of `tree`, which are allocated, with the particles of the packed tree. Unused lanes repeat the
/// last particle of the block.
pub(super) fn gather_blocks(
    tree: &mut WideTree,
    spheres: &Spheres,
    packed: &PackedTree,
    layout: &Layout,
) {
    let members = |place: usize| packed.members(layout.blocks[place]);
    let lanes = |place: usize| {
        let members = members(place);
        std::array::from_fn::<u32, BLOCK_SIZE, _>(|lane| members[lane.min(members.len() - 1)])
    };
    tree.blocks
        .par_iter_mut()
        .zip(tree.indices.par_chunks_mut(BLOCK_SIZE))
        .with_min_len(256)
        .enumerate()
        .for_each(|(place, (block, indices))| {
            for (lane, particle) in lanes(place).into_iter().enumerate() {
                block.set_center(lane, spheres.centers[particle as usize]);
                indices[lane] = particle;
            }
        });
    if let SphereRadius::Each(radii) = spheres.radius {
        tree.gather_radii(radii);
    }
}

/// Box of each block, padded as the boxes of the tree are. If there are `given` boxes, the result is their
/// intersection with the boxes of the spheres.
pub(super) fn block_boxes(tree: &WideTree, given: &[Aabb], layout: &Layout) -> Vec<Aabb> {
    let own = |place: usize| match tree.radii.get(place) {
        Some(radii) => tree.blocks[place].sphere_bounds(radii),
        // Pad by the radius only if boxes bound spheres.
        None if tree.padding == 0.0 && tree.radius > 0.0 => {
            tree.blocks[place].bounds().padded(tree.radius).rounded_outwards()
        }
        None => tree.blocks[place].bounds(),
    };
    (0..tree.blocks.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|place| {
            let own = own(place);
            match given.get(layout.blocks[place] as usize) {
                None => own,
                Some(given) => {
                    // Intersect the boxes; keep the given one if rounding leaves nothing
                    let common = given.intersection(own);
                    if common.is_empty() { *given } else { common }
                }
            }
        })
        .collect()
}

/// Builds the nodes of `tree` over blocks with the boxes `block_boxes`. Returns the SAH cost.
pub(super) fn build_nodes(tree: &mut WideTree, layout: Layout, block_boxes: &[Aabb]) -> f64 {
    let Layout { links, child_counts, level_starts, .. } = layout;
    // Reuse the memory of the previous nodes
    let mut nodes = std::mem::take(&mut tree.nodes);
    nodes.clear();
    nodes.resize(links.len(), bytemuck::Zeroable::zeroed());
    // Encode the nodes level by level, from the lowest one up
    let mut boxes = vec![Aabb::EMPTY; links.len()];
    let mut areas = 0.0;
    let mut end = links.len();
    for start in level_starts.iter().rev().map(|start| *start as usize) {
        let (own, below) = boxes[start..].split_at_mut(end - start);
        let level = Level {
            links: &links[start..end],
            child_counts: &child_counts[start..end],
            below,
            first_below: end,
            block_boxes,
            padding: tree.padding,
        };
        areas += level.fill(&mut nodes[start..end], own);
        end = start;
    }
    // Store the nodes and the bounds of the root
    tree.nodes = nodes;
    tree.links = links;
    tree.level_starts = level_starts;
    tree.mapped.clear();
    tree.mapped_level = u32::MAX;
    tree.bounds =
        boxes.first().map_or(Aabb::EMPTY, |root| root.padded(tree.padding).rounded_outwards());
    sah_cost(areas, tree.bounds)
}

/// Input for the nodes of one level.
struct Level<'a> {
    links: &'a [Link],
    child_counts: &'a [u8],
    /// Boxes of all nodes from index `first_below` on.
    below: &'a [Aabb],
    first_below: usize,
    block_boxes: &'a [Aabb],
    padding: f32,
}

impl Level<'_> {
    /// Fills `nodes` and their `boxes`. Returns the total area of the children.
    fn fill(&self, nodes: &mut [Node], boxes: &mut [Aabb]) -> f64 {
        // Areas are summed over runs of a fixed length, so that the sum does not depend on the number of threads.
        const RUN: usize = 1024;
        let areas: Vec<f64> = nodes
            .par_chunks_mut(RUN)
            .zip(boxes.par_chunks_mut(RUN))
            .enumerate()
            .map(|(run, (nodes, boxes))| {
                let mut area = 0.0;
                for (offset, (node, own)) in nodes.iter_mut().zip(boxes).enumerate() {
                    let (children, count) = self.child_boxes(run * RUN + offset);
                    for child in &children[..count] {
                        area += child.padded(self.padding).area();
                        *own = own.union(*child);
                    }
                    *node = Node::enclosing(&children[..count]);
                }
                area
            })
            .collect();
        areas.iter().sum()
    }

    fn child_boxes(&self, index: usize) -> ([Aabb; WIDTH], usize) {
        let (link, count) = (self.links[index], usize::from(self.child_counts[index]));
        let mut boxes = [Aabb::EMPTY; WIDTH];
        let (nodes, blocks) = boxes[..count].split_at_mut(link.node_count());
        let first_node = link.first_node() - self.first_below;
        nodes.copy_from_slice(&self.below[first_node..][..nodes.len()]);
        blocks.copy_from_slice(&self.block_boxes[link.first_block()..][..blocks.len()]);
        (boxes, count)
    }
}
