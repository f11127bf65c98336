//! Sums over the particles around a point, which are the same to the bit whatever the order of the particles in a
//! structure.

use std::cell::RefCell;

use glam::Vec3;

use spherule_tree::accel::view::TreeView;

/// Maximum number of neighbours. More occur only where a large sphere is among tiny ones, which is not a surface of
/// similar particles.
const MAX_NEIGHBOURS: usize = 4096;

/// Fixed-point units in 1: sums of up to [`MAX_NEIGHBOURS`] terms of up to 1 are exact.
pub(super) const UNIT: f32 = 1_099_511_627_776.0;

/// `value` in fixed-point units of 2^-40.
#[expect(clippy::cast_possible_truncation, reason = "terms are at most 1, and saturate")]
pub(super) fn fixed(value: f32) -> i64 {
    (value * UNIT) as i64
}

/// Calls `add` with the position of each particle within `reach` of `point`, relative to `point` and in units of
/// `reach`. Returns false if there are too many; `add` did not get all of them then.
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
        count <= MAX_NEIGHBOURS
    };
    if tree.has_copies() {
        each_once(tree, point, reach, add);
    } else {
        tree.visit_neighbours(point, reach, |_, center| add(center));
    }
    count <= MAX_NEIGHBOURS
}

/// Calls `add` with the particles within `reach` of `point`, without duplicates, until it returns false.
fn each_once(tree: &TreeView, point: Vec3, reach: f32, mut add: impl FnMut(Vec3) -> bool) {
    /// Assumed limit of copies per particle where there are very many neighbours.
    const MAX_COPIES: usize = 16;
    thread_local! {
        static FOUND: RefCell<Vec<(u32, Vec3)>> = const { RefCell::new(Vec::new()) };
    }
    FOUND.with_borrow_mut(|found| {
        // Collect all copies, then remove the duplicates
        found.clear();
        tree.visit_neighbours(point, reach, |slot, center| {
            found.push((tree.particle(slot), center));
            found.len() <= MAX_COPIES * MAX_NEIGHBOURS
        });
        found.sort_unstable_by_key(|(particle, _)| *particle);
        found.dedup_by_key(|(particle, _)| *particle);
        let _is_too_much = !found.iter().all(|(_, center)| add(*center));
    });
}
