//! `sbvh`: binned object splits by the surface area heuristic, and spatial splits that cut spheres
//! where boxes would overlap (Stich, Friedrich & Dietrich 2009, "Spatial splits in bounding volume
//! hierarchies").
//!
//! Each node takes the cheapest split that its rules find (`split.rs`: `object.rs`, near the leaves
//! `sweep.rs`; `spatial.rs` where the sides overlap), on one thread or all (`grow.rs`), in room that
//! the reference budget sets (`budget.rs`). The binary tree then becomes a wide one like any other
//! (`collapse.rs`), whose boxes bound the parts of spheres.
//!
//! Measured against `lbvh` with 1e5 and 1e6 particles (AMD EPYC, 2 threads, thesis's camera): on the
//! thesis's box of equal spheres, rays are 1.1 to 1.3 times as fast, all of it by the object splits:
//! spatial ones add 0.5 % references and change nothing, but take three quarters of the build. They
//! pay where radii vary a hundredfold: 1.3 to 2.4 times the rays of `lbvh`, without them 0.9 to 1.5.
//! The price is 2 s of one core a million particles (4.5 s where many are cut), 40 to 70 times
//! `lbvh`, and half as much memory again, or more than twice where many are cut.

use rayon::prelude::*;

use super::binary::{BinaryNode, BinaryTree};
use super::collapse::{Content, collapse};
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{BuildReport, BuildSettings, Spheres, Structure};
use divide::Roomed;
use grow::{Grower, Grown};
use reference::{Parts, Reference};
use spherule_formats::order::index_u32;

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

/// References that one thread takes at a time of a set that all work on. Fixed, so that results do
/// not depend on the number of threads.
const CHUNK: usize = 16 * 1024;

/// Whether all threads work on one set of this many references.
fn is_large(references: usize) -> bool {
    references >= 4 * CHUNK
}

/// Builds over `spheres` in the memory of `tree`.
pub(super) fn build(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    let parts = Parts::of(*spheres);
    let particles = spheres.centers.len();
    let mut room: Vec<Reference> =
        bytemuck::zeroed_vec(budget::room(particles, settings.sbvh.budget));
    room[..particles]
        .par_iter_mut()
        .enumerate()
        .for_each(|(particle, reference)| *reference = parts.whole(index_u32(particle)));
    let bounds = divide::bounds_of(&room[..particles]);
    clock.lap("references");

    let grown = (particles > 0).then(|| {
        let root = Roomed {
            room: &mut room,
            count: particles,
            bounds,
        };
        Grower::new(parts, bounds, settings.sbvh.alpha).grow(root, 0)
    });
    let room_bytes = size_of_val(&room[..]) as u64;
    drop(room);
    let binary = grown.map_or_else(BinaryTree::default, joined);
    let binary_bytes =
        (size_of_val(&binary.nodes[..]) + size_of_val(&binary.references[..])) as u64;
    clock.lap("splits");

    let collapsed = collapse(tree, binary, &Content::Clipped(*spheres), &mut clock);
    tree.is_clipped = true;
    tree.report(
        Structure::Sbvh,
        "surface area heuristic, spatial splits",
        collapsed.sah_cost,
        collapsed.scratch_bytes.max(room_bytes + binary_bytes),
        clock.finish(),
    )
}

/// All trees as one, depth first.
fn joined(grown: Grown) -> BinaryTree {
    let mut tree = BinaryTree::default();
    // A growing vector would hold up to three times what it needs.
    let (nodes, references) = grown.lengths();
    tree.nodes.reserve_exact(nodes);
    tree.references.reserve_exact(references);
    tree.nodes.push(grown.root());
    join_at(&mut tree, 0, grown);
    tree
}

/// Puts `grown` into the place `at`, and what is below at the end.
fn join_at(tree: &mut BinaryTree, at: usize, grown: Grown) {
    let first = index_u32(tree.nodes.len());
    match grown {
        Grown::Tree(own) => {
            let references = index_u32(tree.references.len());
            let mut nodes = own.nodes.into_iter().map(|node| BinaryNode {
                // The root of `own` goes elsewhere, the others keep their order.
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
                join_at(tree, at, half);
            }
        }
    }
}
