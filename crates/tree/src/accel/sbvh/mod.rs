//! `sbvh`: binned object splits by the surface area heuristic, and spatial splits that cut spheres if boxes would
//! overlap (Stich, Friedrich & Dietrich 2009, "Spatial splits in bounding volume hierarchies").
//!
//! Each node uses the cheapest split of its rules (`split.rs`: `object.rs`, or `sweep.rs` near the leaves;
//! `spatial.rs` if the children overlap). The build uses one thread or all of them (`grow.rs`), in memory that the
//! reference budget limits (`budget.rs`). The binary tree is collapsed like any other (`collapse.rs`); the boxes of
//! the wide tree bound parts of spheres.
//!
//! Measured against `lbvh` with 1e5 and 1e6 particles (AMD EPYC, 2 threads, thesis's camera). On the thesis's box of
//! equal spheres, rays are 1.1 to 1.3 times as fast, entirely because of the object splits: spatial splits add 0.5 %
//! references without an effect, and take three quarters of the build time. They pay off if radii vary by a factor of
//! a hundred: rays are then 1.3 to 2.4 times as fast as with `lbvh`; without spatial splits 0.9 to 1.5 times. A build
//! costs 2 s of one core per million particles (4.5 s if many are cut), which is 40 to 70 times `lbvh`, and 1.5 times
//! the memory, or more than twice if many are cut.

use rayon::prelude::*;

use super::binary::{BinaryNode, BinaryTree};
use super::collapse::{Content, collapse};
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{BuildReport, BuildSettings, Spheres, Structure};
use crate::order::index_u32;
use divide::BuildNode;
use grow::{Grower, Grown};
use reference::{Parts, Reference};

mod budget;
mod cost;
mod divide;
mod grow;
mod object;
mod partition;
mod reference;
mod spatial;
mod split;
mod sweep;
mod unsplit;

/// References per task if all threads work on one set. It is fixed, so that results do not depend on the number of
/// threads.
const CHUNK: usize = 16 * 1024;

/// Whether all threads should work on one set of this many references.
fn is_large(references: usize) -> bool {
    references >= 4 * CHUNK
}

/// Builds a tree over `spheres` in the memory of `tree`.
pub(super) fn build(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    let parts = Parts::of(*spheres);
    let particles = spheres.centers.len();
    // Allocate the budget, and create one reference per particle
    let mut storage: Vec<Reference> =
        bytemuck::zeroed_vec(budget::capacity(particles, settings.sbvh.budget));
    storage[..particles]
        .par_iter_mut()
        .enumerate()
        .for_each(|(particle, reference)| *reference = parts.whole(index_u32(particle)));
    let bounds = divide::bounds_of(&storage[..particles]);
    clock.lap("references");

    // Split recursively, and concatenate the subtrees
    let grown = (particles > 0).then(|| {
        let root = BuildNode { storage: &mut storage, count: particles, bounds };
        Grower::new(parts, bounds, settings.sbvh.alpha).grow(root, 0)
    });
    let storage_bytes = size_of_val(&storage[..]) as u64;
    drop(storage);
    let binary = grown.map_or_else(BinaryTree::default, concatenate);
    let binary_bytes =
        (size_of_val(&binary.nodes[..]) + size_of_val(&binary.references[..])) as u64;
    clock.lap("splits");

    // Collapse the binary tree into 8-wide nodes
    let collapsed = collapse(tree, binary, &Content::Clipped(*spheres), &mut clock);
    tree.is_clipped = true;
    tree.report(
        Structure::Sbvh,
        "surface area heuristic, spatial splits",
        collapsed.sah_cost,
        collapsed.scratch_bytes.max(storage_bytes + binary_bytes),
        clock.finish(),
    )
}

/// Concatenates all subtrees, depth first.
fn concatenate(grown: Grown) -> BinaryTree {
    let mut tree = BinaryTree::default();
    // Reserve the exact size: a growing vector would take up to three times as much memory.
    let (nodes, references) = grown.lengths();
    tree.nodes.reserve_exact(nodes);
    tree.references.reserve_exact(references);
    tree.nodes.push(grown.root());
    append_at(&mut tree, 0, grown);
    tree
}

/// Stores the root of `grown` at index `at`, and appends the rest.
fn append_at(tree: &mut BinaryTree, at: usize, grown: Grown) {
    let first = index_u32(tree.nodes.len());
    match grown {
        Grown::Tree(own) => {
            let references = index_u32(tree.references.len());
            let mut nodes = own.nodes.into_iter().map(|node| BinaryNode {
                // The root of `own` moves to `at`; the other nodes keep their order.
                first: if node.is_leaf() {
                    node.first + references
                } else {
                    node.first - 1 + first
                },
                ..node
            });
            tree.nodes[at] = nodes.next().expect("a grown tree has a root");
            tree.nodes.extend(nodes);
            tree.references.extend_from_slice(&own.references);
        }
        Grown::Split(bounds, halves) => {
            tree.nodes[at] = grow::inner(bounds, first as usize);
            tree.nodes.extend(halves.iter().map(Grown::root));
            for (half, at) in halves.into_iter().zip(first as usize..) {
                append_at(tree, at, half);
            }
        }
    }
}
