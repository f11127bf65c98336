//! Binary trees of awkward shapes must become valid wide ones.

use glam::Vec3;

use super::binary::{BinaryNode, BinaryTree};
use super::collapse::{self, Collapsed, Content};
use super::levels::MAX_LEVELS;
use super::report::PhaseClock;
use super::view::TreeView;
use super::wide::WideTree;
use super::{Aabb, BuildSettings, SphereRadius, Spheres, TreeBuilder};
use crate::blocks::{BLOCK_SIZE, Block};
use crate::order::index_u32;
use crate::ray::Ray;

fn collapse(tree: &mut WideTree, binary: BinaryTree, content: &Content) -> Collapsed {
    collapse::collapse(tree, binary, content, &mut PhaseClock::new())
}

const RADIUS: f32 = 0.03;

fn points(count: u16) -> Vec<Vec3> {
    // A spiral, so that neighbours in order are neighbours in space.
    (0..count)
        .map(|i| {
            let turn = f32::from(i) * 0.05;
            Vec3::new(turn.cos(), turn.sin(), 0.0) * (0.2 + turn * 0.01) + Vec3::Z * turn * 0.02
        })
        .collect()
}

fn spheres(centers: &[Vec3]) -> Spheres<'_> {
    Spheres { centers, radius: SphereRadius::Common(RADIUS) }
}

/// A tree over leaves that each hold a run of references; `split` returns how many leaves of a run go to the left.
fn binary(leaves: &[(Aabb, Vec<u32>)], split: impl Fn(usize) -> usize) -> BinaryTree {
    let mut tree = BinaryTree::default();
    if leaves.is_empty() {
        return tree;
    }
    let empty = BinaryNode { bounds: Aabb::EMPTY, first: 0, count: 0 };
    tree.nodes.push(empty);
    let mut pending = vec![(0, leaves)];
    while let Some((place, leaves)) = pending.pop() {
        let bounds = leaves.iter().fold(Aabb::EMPTY, |b, leaf| b.union(leaf.0));
        tree.nodes[place].bounds = bounds;
        if let [(_, references)] = leaves {
            tree.nodes[place].first = index_u32(tree.references.len());
            tree.nodes[place].count = index_u32(references.len());
            tree.references.extend_from_slice(references);
        } else {
            let left = tree.nodes.len();
            tree.nodes[place].first = index_u32(left);
            tree.nodes.extend([empty; 2]);
            let (a, b) = leaves.split_at(split(leaves.len()));
            pending.extend([(left, a), (left + 1, b)]);
        }
    }
    tree
}

/// Leaves of `size` particles each.
fn leaves(centers: &[Vec3], size: usize) -> Vec<(Aabb, Vec<u32>)> {
    let numbers: Vec<u32> = (0..index_u32(centers.len())).collect();
    let runs = centers.chunks(size).zip(numbers.chunks(size));
    runs.map(|(points, numbers)| (Aabb::around(points), numbers.to_vec())).collect()
}

#[test]
fn particles_of_trees_of_any_shape() {
    let shapes: [fn(usize) -> usize; 3] = [|n| n / 2, |_| 1, |n| n - 1];
    for count in [0, 1, 2, 16, 17, 300, 5000] {
        let centers = points(count);
        for size in [1, 5, 16, 17, 100] {
            for (shape, split) in shapes.iter().enumerate() {
                let mut tree = WideTree::default();
                let binary = binary(&leaves(&centers, size), split);
                let collapsed = collapse(&mut tree, binary, &Content::Particles(spheres(&centers)));
                let what = format!("{count} particles, {size} a leaf, shape {shape}");
                tree.validate(&spheres(&centers)).expect(&what);
                assert!(tree.level_starts.len() <= MAX_LEVELS, "{what}");
                assert!(collapsed.sah_cost >= 1.0, "{what}");
            }
        }
    }
}

#[test]
fn small_subtrees_share_a_block_if_cheaper() {
    let near = points(8);
    let mut tree = WideTree::default();
    let tree_of = |leaves: &[_]| binary(leaves, |n| n / 2);
    collapse(&mut tree, tree_of(&leaves(&near, 4)), &Content::Particles(spheres(&near)));
    assert_eq!(tree.blocks.len(), 1, "one block of two leaves");

    let mut far = near;
    far[4..].iter_mut().for_each(|p| p.x += 1000.0);
    collapse(&mut tree, tree_of(&leaves(&far, 4)), &Content::Particles(spheres(&far)));
    assert_eq!(tree.blocks.len(), 2, "two blocks far from each other");
}

#[test]
fn blocks_are_permuted_and_the_partial_one_is_last() {
    for count in [1, 16, 100, 5000] {
        let centers = points(count);
        let blocks = centers.len().div_ceil(BLOCK_SIZE);
        for (shape, split) in [|n: usize| n / 2, |_| 1, |n| n - 1].iter().enumerate() {
            let mut tree = WideTree::default();
            tree.reset(centers.len(), Some(RADIUS), true);
            let (slots, indices) = tree.points_mut();
            for (slot, (to, index)) in slots.iter_mut().zip(indices).enumerate() {
                let from = slot.min(centers.len() - 1);
                (*to, *index) = (centers[from], index_u32(from));
            }
            tree.blocks.iter_mut().for_each(Block::transpose_points);
            // The unfilled block is the first one in tree order.
            let leaves: Vec<(Aabb, Vec<u32>)> =
                (0..blocks).rev().map(|b| (tree.blocks[b].bounds(), vec![index_u32(b)])).collect();
            collapse(&mut tree, binary(&leaves, split), &Content::Blocks);
            let what = format!("{count} particles, shape {shape}");
            assert!(!tree.has_copies, "{what}");
            tree.validate(&spheres(&centers)).expect(&what);
        }
    }
}

/// Every sphere is cut in two at a plane, as by spatial splits.
#[test]
fn clipped_spheres_are_hit_once_from_either_side() {
    let centers = points(700);
    let whole = leaves(&centers, 10);
    let mut halves = Vec::new();
    for (bounds, numbers) in &whole {
        let bounds = bounds.padded(RADIUS);
        let middle = bounds.min.x + 0.5 * (bounds.max.x - bounds.min.x);
        let (mut low, mut high) = (bounds, bounds);
        (low.max.x, high.min.x) = (middle, middle);
        halves.extend([(low, numbers.clone()), (high, numbers.clone())]);
    }
    let mut tree = WideTree::default();
    let clipped = Content::Clipped(spheres(&centers));
    collapse(&mut tree, binary(&halves, |n| n / 2), &clipped);
    assert!(tree.blocks.len() > whole.len(), "copies were kept");
    let mut other = TreeBuilder::new();
    other.build(&spheres(&centers), &BuildSettings::default());
    let (tree, other) = (tree.view(), other.tree().view());
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let mut hit_count = 0;
    for (i, target) in centers.iter().enumerate() {
        let away = Vec3::new(1.0, 0.3 * (i % 7) as f32 - 1.0, 0.1 * (i % 11) as f32);
        let ray = Ray::new(*target + away, -away.normalize());
        tree.crossings(&ray, &mut ours);
        other.crossings(&ray, &mut theirs);
        let describe =
            |tree: &TreeView, c: &super::traverse::TreeCrossing| (c.t, tree.particle(c.slot));
        assert_eq!(
            ours.iter().map(|c| describe(&tree, c)).collect::<Vec<_>>(),
            theirs.iter().map(|c| describe(&other, c)).collect::<Vec<_>>(),
            "ray {i}"
        );
        let hit = tree.nearest(&ray).map(|hit| hit.t);
        assert_eq!(hit, ours.first().map(|c| c.t), "ray {i}");
        hit_count += ours.len();
    }
    assert!(hit_count > 2 * centers.len(), "rays were aimed at spheres");
}
