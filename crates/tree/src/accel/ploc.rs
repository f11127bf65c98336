//! Binary trees by `obvhs`: locally ordered clustering (PLOC, Meister & Bittner 2018) and its optimiser, which moves
//! subtrees to positions where they cost less (parallel reinsertion, Meister & Bittner 2018).
//!
//! This module adapts the input so that every scene gives a single tree, which does not depend on the number of
//! threads:
//! - Clustering merges pairs that are each other's nearest neighbours. If all distances are equal (coincident or
//!   equally spaced particles), a pass merges only one pair. So each box is shifted by a small pseudo-random
//!   distance.
//! - `obvhs` does not handle infinite areas: coordinates are scaled by a power of two into -2..2.
//! - Its choice of nodes to reinsert depends on threads if areas are equal; the one here does not.
//! - Its stack has a fixed size, which is set here from the depth of the tree.

use glam::{Vec3, Vec3A};
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use rayon::prelude::*;

use super::Aabb;
use super::binary::{BinaryNode, BinaryTree};
use super::preset::{BvhPreset, Effort};
use super::report::PhaseClock;
use crate::order::index_u32;

/// Shift of a box as a fraction of its longest edge: far too small to affect the cost, and far above the rounding of
/// areas.
const SHIFT: f32 = 1.0 / 512.0;
/// Minimum shift as a fraction of the coordinates, from the resolution of f32.
const MIN_SHIFT: f32 = 1.0 / (1 << 21) as f32;
/// Absolute minimum of the shift, in scaled coordinates.
const SMALLEST_SHIFT: f32 = 1e-12;
/// Passes of reinsertion: over the whole batch first, then over 1/3, 1/5... of it, as in obvhs.
const PASSES: usize = 16;

/// A binary tree and the memory of its build.
#[derive(Debug)]
pub(super) struct Clustered {
    /// Each leaf has one reference, the index of the box.
    pub(super) tree: BinaryTree,
    /// Peak memory in bytes; input boxes that are computed on the fly do not count.
    pub(super) peak_bytes: u64,
}

/// Clusters `count` boxes of spheres, which `bounds_of` returns. The boxes of the result are smaller by `padding` on
/// every side. Records the phases `ploc` and `reinsert`.
pub(super) fn cluster(
    count: usize,
    bounds_of: impl Fn(usize) -> Aabb + Sync,
    padding: f32,
    preset: BvhPreset,
    clock: &mut PhaseClock,
) -> Clustered {
    // Merge the scaled and shifted boxes into one tree
    let scale = Scale::of((0..count).into_par_iter().map(&bounds_of));
    let effort = preset.effort();
    let mut bvh = Bvh2::default();
    let mut ploc = PlocBuilder::new();
    (0..count)
        .into_par_iter()
        .with_min_len(1024)
        .map(|place| leaf(scale.shifted(bounds_of(place), place), place))
        .collect_into_vec(&mut ploc.current_nodes);
    merge(&mut ploc, &mut bvh, preset);
    // Improve the tree by reinsertion
    let ploc_bytes = bytes(&ploc.current_nodes)
        + bytes(&ploc.next_nodes)
        + bytes(&ploc.mortons)
        + bytes(&bvh.nodes);
    drop(ploc);
    clock.lap("ploc");
    let reinsert_bytes = bytes(&bvh.nodes) + reinsert(&mut bvh, effort.reinsertion);
    clock.lap("reinsert");
    // Convert the tree to the original coordinates
    bvh.parents = Vec::new();
    let tree = scale.binary(&bvh.nodes, padding);
    let convert_bytes = bytes(&bvh.nodes) + bytes(&tree.nodes) + bytes(&tree.references);
    Clustered { tree, peak_bytes: ploc_bytes.max(reinsert_bytes).max(convert_bytes) }
}

fn bytes<T>(values: &Vec<T>) -> u64 {
    (values.capacity() * size_of::<T>()) as u64
}

fn leaf(bounds: Aabb, place: usize) -> Bvh2Node {
    let bounds = obvhs::aabb::Aabb::new(Vec3A::from(bounds.min), Vec3A::from(bounds.max));
    Bvh2Node::new(bounds, 1, index_u32(place))
}

/// Clusters the nodes of the builder into one tree.
fn merge(ploc: &mut PlocBuilder, bvh: &mut Bvh2, preset: BvhPreset) {
    bvh.reset_for_reuse(ploc.current_nodes.len(), Some(Vec::new()));
    let leaves = ploc.current_nodes.par_iter().map(|node| *node.aabb());
    let total = leaves.reduce(obvhs::aabb::Aabb::empty, |a, b| a.union(&b));
    let Effort { near_passes, precision, .. } = preset.effort();
    // The search radius is a compile-time constant.
    match preset {
        BvhPreset::Fast => {
            ploc.build_ploc_from_leaves::<6, false>(bvh, total, precision, near_passes);
        }
        BvhPreset::Medium => {
            ploc.build_ploc_from_leaves::<14, false>(bvh, total, precision, near_passes);
        }
        BvhPreset::High => {
            ploc.build_ploc_from_leaves::<24, false>(bvh, total, precision, near_passes);
        }
    }
}

/// Reinserts a fraction `share` of the nodes, in several passes. Returns the memory used, in bytes.
fn reinsert(bvh: &mut Bvh2, share: f32) -> u64 {
    if bvh.nodes.len() < 3 {
        return 0;
    }
    let mut optimizer = ReinsertionOptimizer::default();
    let mut most_candidates = 0;
    for pass in 0..PASSES {
        // Select the largest nodes, fewer in each pass
        let part = share / (2 * pass + 1) as f32;
        let candidates = largest_nodes(&bvh.nodes, part);
        most_candidates = most_candidates.max(candidates.len());
        // Reinsert them with a stack that suits the current depth
        bvh.max_depth = depth(&bvh.nodes) + 1;
        optimizer.run_with_candidates(bvh, &candidates, 1);
    }
    // Each node has a parent and a mark; each candidate has an index, a cost and a result.
    let per_candidate = 4 + 8 + size_of::<obvhs::bvh2::reinsertion::Reinsertion>();
    bytes(&bvh.parents) + (bvh.nodes.len() + per_candidate * most_candidates) as u64
}

/// The nodes of largest area among the first nodes of the tree, twice as many as requested, which are the upper ones.
/// Follows obvhs, except that ties in area are broken by index.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of what there is"
)]
fn largest_nodes(nodes: &[Bvh2Node], part: f32) -> Vec<u32> {
    let count = ((nodes.len() as f32 * part) as usize).clamp(1, nodes.len() - 1);
    let looked_at = nodes.len().min(2 * (count + 1));
    let mut found: Vec<(f32, u32)> =
        (1..looked_at).map(|index| (nodes[index].aabb().half_area(), index_u32(index))).collect();
    found.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    found.truncate(count);
    found.into_iter().map(|(_, index)| index).collect()
}

/// Number of levels below the root.
fn depth(nodes: &[Bvh2Node]) -> usize {
    let mut deepest = 0;
    let mut pending = vec![(0_u32, 0_usize)];
    while let Some((index, level)) = pending.pop() {
        deepest = deepest.max(level);
        let node = &nodes[index as usize];
        if !node.is_leaf() {
            pending.extend([0, 1].map(|side| (node.first_index + side, level + 1)));
        }
    }
    deepest
}

/// Conversion to the coordinates of obvhs and back.
#[derive(Debug, Clone, Copy)]
struct Scale {
    factor: f32,
    inverse: f32,
}

impl Scale {
    /// Scales all boxes into -2..2 by a power of two, which is exact.
    fn of(bounds: impl ParallelIterator<Item = Aabb>) -> Self {
        let largest =
            bounds.map(|b| b.min.abs().max(b.max.abs()).max_element()).reduce(|| 0.0, f32::max);
        #[expect(clippy::cast_possible_wrap, reason = "nine bits")]
        let exponent = ((largest.to_bits() >> 23) as i32 - 126).clamp(-126, 127);
        #[expect(clippy::cast_possible_truncation, reason = "a power of two in the range of f32")]
        let power = |exponent| 2.0_f64.powi(exponent) as f32;
        Self { factor: power(-exponent), inverse: power(exponent) }
    }

    /// `bounds` in the coordinates of obvhs, shifted so that no two distances are equal.
    fn shifted(self, bounds: Aabb, place: usize) -> Aabb {
        let scaled =
            |corner: Vec3| (corner * self.factor).clamp(Vec3::splat(-2.0), Vec3::splat(2.0));
        let (min, max) = (scaled(bounds.min), scaled(bounds.max));
        let far = min.abs().max(max.abs()).max_element();
        let edge = (max - min).max_element();
        let shift = (SHIFT * edge).max(MIN_SHIFT * far).max(SMALLEST_SHIFT) * unit_vector(place);
        Aabb { min: min + shift, max: max + shift }
    }

    /// Converts a tree of obvhs to the order and coordinates of this crate; boxes shrink by `padding`.
    fn binary(self, nodes: &[Bvh2Node], padding: f32) -> BinaryTree {
        let mut tree = BinaryTree::default();
        let Some(root) = nodes.first() else {
            return tree;
        };
        tree.nodes.reserve_exact(nodes.len());
        tree.references.reserve_exact(nodes.len().div_ceil(2));
        tree.nodes.push(self.node(root, padding));
        // Copy the nodes depth first; the children of a node are adjacent
        let mut pending = vec![(0_usize, 0_usize)];
        while let Some((from, to)) = pending.pop() {
            let node = &nodes[from];
            if node.is_leaf() {
                tree.nodes[to].first = index_u32(tree.references.len());
                tree.nodes[to].count = 1;
                tree.references.push(node.first_index);
            } else {
                let (left, place) = (node.first_index as usize, tree.nodes.len());
                tree.nodes[to].first = index_u32(place);
                for side in [0, 1] {
                    tree.nodes.push(self.node(&nodes[left + side], padding));
                }
                pending.extend([(left + 1, place + 1), (left, place)]);
            }
        }
        tree
    }

    fn node(self, node: &Bvh2Node, padding: f32) -> BinaryNode {
        let corner = |corner: Vec3A| Vec3::from(corner) * self.inverse;
        let bounds = Aabb { min: corner(node.aabb().min), max: corner(node.aabb().max) };
        BinaryNode { bounds: bounds.padded(-padding), first: 0, count: 0 }
    }
}

/// A pseudo-random vector with components from 0 to 1 that depends only on `place` (the finaliser of splitmix64,
/// Steele, Lea & Flood 2014).
fn unit_vector(place: usize) -> Vec3 {
    let mut bits = (place as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^= bits >> 31;
    let part = |shift: u32| ((bits >> shift) & 0x1f_ffff) as f32 / (1 << 21) as f32;
    Vec3::new(part(0), part(21), part(42))
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 3000;

    /// Clusters spheres of radius 1 around `centers`.
    fn clustered(centers: &[Vec3], preset: BvhPreset) -> Clustered {
        let bounds_of =
            |place: usize| Aabb { min: centers[place] - 1.0, max: centers[place] + 1.0 };
        cluster(centers.len(), bounds_of, 1.0, preset, &mut PhaseClock::new())
    }

    fn levels(tree: &BinaryTree) -> usize {
        let mut levels = vec![0; tree.nodes.len()];
        for (index, node) in tree.nodes.iter().enumerate() {
            if !node.is_leaf() {
                let below = levels[index] + 1;
                levels[node.first as usize..][..2].fill(below);
            }
        }
        levels.into_iter().max().unwrap_or(0)
    }

    /// Otherwise a pass merges one pair, and time grows with the square of the particle count.
    #[test]
    fn equal_distances_do_not_make_chains() {
        let line = (0..COUNT).map(|i| Vec3::X * i as f32).collect();
        let coincident = vec![Vec3::ONE; COUNT];
        let origin = vec![Vec3::ZERO; COUNT];
        for centers in [line, coincident, origin] {
            for preset in BvhPreset::ALL {
                let tree = clustered(&centers, preset).tree;
                let levels = levels(&tree);
                assert!(levels < 60, "{preset:?}: {levels} levels");
                let mut found = tree.references;
                found.sort_unstable();
                assert!((0..COUNT).eq(found.into_iter().map(|r| r as usize)));
            }
        }
    }

    #[test]
    fn boxes_are_returned_in_their_own_coordinates() {
        let line: Vec<Vec3> = (0..COUNT).map(|i| Vec3::X * (100 * i) as f32).collect();
        let tree = clustered(&line, BvhPreset::Fast).tree;
        let root = tree.nodes[0].bounds;
        let near = |a: Vec3, b: Vec3| (a - b).abs().max_element() < 1.0;
        assert!(near(root.min, Vec3::ZERO), "{root:?}");
        assert!(near(root.max, line[COUNT - 1]), "{root:?}");
        for node in tree.nodes.iter().filter(|node| node.is_leaf()) {
            let center = line[tree.references[node.first as usize] as usize];
            assert!(near(node.bounds.min, center), "{node:?} {center}");
        }
    }

    #[test]
    fn no_coordinate_is_too_large_or_too_small() {
        for size in [0.0, 1e-38, 1e-20, 1e20, 3e38] {
            let scale = Scale::of([0, 1].into_par_iter().map(|side| Aabb {
                min: Vec3::splat(-size),
                max: Vec3::splat(size * side as f32),
            }));
            assert!(scale.factor * scale.inverse == 1.0, "{size}: {scale:?}");
            let shifted =
                scale.shifted(Aabb { min: Vec3::splat(-size), max: Vec3::splat(size) }, 7);
            assert!(shifted.min.abs().max(shifted.max.abs()).max_element() < 2.1);
            assert!(shifted.min.is_finite(), "{shifted:?}");
        }
    }
}
