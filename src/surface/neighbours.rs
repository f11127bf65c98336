//! Sums over the particles about a place: the same to the bit in whatever order a structure has them.

use std::cell::RefCell;

use glam::Vec3;

use crate::accel::view::TreeView;

/// Neighbours beyond which a place is no surface of particles like the one that was hit, but that of a large
/// one among tiny ones.
const MOST_NEIGHBOURS: usize = 4096;

/// Units in one: sums of as many terms of up to 1 are exact.
pub(super) const UNIT: f32 = 1_099_511_627_776.0;

/// `value` in units of 2^-40.
#[expect(
    clippy::cast_possible_truncation,
    reason = "terms are at most 1, and saturate"
)]
pub(super) fn fixed(value: f32) -> i64 {
    (value * UNIT) as i64
}

/// Gives `add` where each particle within `reach` of `point` is, seen from there, in units of `reach`. False if
/// there are too many; then `add` did not get them all.
pub(super) fn each_neighbour(
    tree: &TreeView,
    point: Vec3,
    reach: f32,
    mut add: impl FnMut(Vec3),
) -> bool {
    let mut count = 0;
    let mut add = |center: Vec3| {
        add((center - point) / reach);
        count += 1;
        count <= MOST_NEIGHBOURS
    };
    if tree.has_copies() {
        each_once(tree, point, reach, add);
    } else {
        tree.visit_neighbours(point, reach, |_, center| add(center));
    }
    count <= MOST_NEIGHBOURS
}

/// Gives `add` the particles within `reach` of `point`, copies left out, until it returns false.
fn each_once(tree: &TreeView, point: Vec3, reach: f32, mut add: impl FnMut(Vec3) -> bool) {
    /// Copies that a particle may be thought to have where there are very many neighbours.
    const COPIES: usize = 16;
    thread_local! {
        static FOUND: RefCell<Vec<(u32, Vec3)>> = const { RefCell::new(Vec::new()) };
    }
    FOUND.with_borrow_mut(|found| {
        found.clear();
        tree.visit_neighbours(point, reach, |slot, center| {
            found.push((tree.particle(slot), center));
            found.len() <= COPIES * MOST_NEIGHBOURS
        });
        found.sort_unstable_by_key(|(particle, _)| *particle);
        found.dedup_by_key(|(particle, _)| *particle);
        let _is_too_much = !found.iter().all(|(_, center)| add(*center));
    });
}
