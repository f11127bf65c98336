//! The lower cuts: one thread cuts a cell that fits into the cache.
//!
//! Each cut moves the particles from one buffer into the other and keeps their order on both sides. Equal
//! coordinates are therefore ordered by index although no index is compared.

use glam::Vec3;

use super::item::{KeyedParticle, widest};
use super::middle_of;

/// The buffers of one thread.
#[derive(Default)]
pub(super) struct CellScratch {
    items: Vec<KeyedParticle>,
    spare: Vec<KeyedParticle>,
    keys: Vec<i32>,
}

impl CellScratch {
    /// Brings a cell, whose particles must be in index order, into k-d order.
    pub(super) fn sort(&mut self, points: &mut [Vec3], indices: &mut [u32]) {
        self.items.clear();
        if indices.is_empty() {
            self.items.extend(points.iter().map(|p| KeyedParticle::new(*p, 0)));
        } else {
            let pairs = points.iter().zip(&*indices);
            self.items.extend(pairs.map(|(p, i)| KeyedParticle::new(*p, *i)));
        }
        self.spare.resize(points.len(), KeyedParticle::default());
        self.keys.resize(points.len(), 0);
        cut(&mut self.items, &mut self.spare, &mut self.keys, points, indices);
    }
}

/// Cuts `items` into blocks and writes the blocks.
fn cut(
    items: &mut [KeyedParticle],
    spare: &mut [KeyedParticle],
    keys: &mut [i32],
    points: &mut [Vec3],
    indices: &mut [u32],
) {
    let middle = middle_of(items.len());
    if middle == 0 {
        return write(items, points, indices);
    }
    // Partition the particles at the median
    part(items, spare, keys, widest_axis(items), middle);
    // Cut both sides, with the buffers exchanged
    let (items_low, items_high) = items.split_at_mut(middle);
    let (spare_low, spare_high) = spare.split_at_mut(middle);
    let (keys_low, keys_high) = keys.split_at_mut(middle);
    let (points_low, points_high) = points.split_at_mut(middle);
    let (indices_low, indices_high) = indices.split_at_mut(middle.min(indices.len()));
    cut(spare_low, items_low, keys_low, points_low, indices_low);
    cut(spare_high, items_high, keys_high, points_high, indices_high);
}

fn write(items: &[KeyedParticle], points: &mut [Vec3], indices: &mut [u32]) {
    for (point, item) in points.iter_mut().zip(items) {
        *point = item.center();
    }
    for (index, item) in indices.iter_mut().zip(items) {
        *index = item.number();
    }
}

fn widest_axis(items: &[KeyedParticle]) -> usize {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for item in items {
        min = min.min(item.center());
        max = max.max(item.center());
    }
    widest(max - min)
}

/// Moves the `middle` lowest of `items` along `axis` to the front of `to`, and the others behind them.
fn part(
    items: &[KeyedParticle],
    to: &mut [KeyedParticle],
    keys: &mut [i32],
    axis: usize,
    middle: usize,
) {
    // Find the pivot
    for (key, item) in keys.iter_mut().zip(items) {
        *key = item.place(axis);
    }
    let (below, pivot, _) = keys.select_nth_unstable(middle);
    let pivot = *pivot;
    // The front has room for this many particles that equal the pivot.
    let mut room = middle - below.iter().filter(|key| **key < pivot).count();
    // Distribute the particles without branches
    let (mut low, mut high) = (0, middle);
    for item in items {
        let key = item.place(axis);
        let tied = (key == pivot) & (room > 0);
        let is_low = (key < pivot) | tied;
        room -= usize::from(tied);
        to[if is_low { low } else { high }] = *item;
        low += usize::from(is_low);
        high += usize::from(!is_low);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_keep_their_order() {
        let items: Vec<KeyedParticle> =
            (0..64).map(|i| KeyedParticle::new(Vec3::X * (i % 2) as f32, i)).collect();
        let mut to = vec![KeyedParticle::default(); 64];
        part(&items, &mut to, &mut [0; 64], 0, 48);
        let numbers: Vec<u32> = to.iter().map(KeyedParticle::number).collect();
        let is_low = |i: &u32| i.is_multiple_of(2) || *i < 32;
        let (low, high): (Vec<u32>, Vec<u32>) = (0..64).partition(is_low);
        assert_eq!(numbers, [low, high].concat());
    }
}
