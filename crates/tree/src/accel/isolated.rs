//! Finds particles with few neighbours, by queries to the tree that rays use.

use std::ops::Range;

use rayon::prelude::*;

use super::view::TreeView;
use crate::blocks::BLOCK_SIZE;
use crate::order::index_u32;

/// Largest supported number of neighbours.
const MAX_NEIGHBOURS: usize = 16;

impl TreeView<'_> {
    /// The particles, in ascending order, that have fewer than `enough` others within `support` times their radius.
    ///
    /// # Panics
    /// If `enough` is more than 16.
    pub fn isolated(&self, support: f32, enough: usize) -> Vec<u32> {
        assert!(enough <= MAX_NEIGHBOURS, "only few neighbours are distinguished");
        let slots = self.slot_count();
        // Check every particle, block by block
        let mut isolated: Vec<u32> = (0..slots.div_ceil(BLOCK_SIZE))
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|block| {
                let first = block * BLOCK_SIZE;
                let slots = index_u32(first)..index_u32(slots.min(first + BLOCK_SIZE));
                let is_isolated = {
                    let slots = slots.clone();
                    move |slot: &u32| !self.has_neighbours(*slot, &slots, support, enough)
                };
                slots.filter(is_isolated).map(|slot| self.particle(slot))
            })
            .collect();
        // Sort, and remove particles that are stored in several slots
        isolated.par_sort_unstable();
        isolated.dedup();
        isolated
    }

    /// Whether there are `enough` particles around the one in `slot`. Searches its own `block` first, because
    /// neighbours are often in the same block.
    fn has_neighbours(&self, slot: u32, block: &Range<u32>, support: f32, enough: usize) -> bool {
        let (center, radius) = self.sphere(slot);
        let reach = support * radius;
        let own = self.particle(slot);
        // Count distinct neighbours up to `enough`
        let mut found = [0; MAX_NEIGHBOURS];
        let mut count = 0;
        let mut add_neighbour = |slot: u32| {
            let particle = self.particle(slot);
            if count < enough && particle != own && !found[..count].contains(&particle) {
                found[count] = particle;
                count += 1;
            }
            count >= enough
        };
        // Search the particle's own block, then the rest of the tree
        let is_within_reach = |slot: &u32| {
            let distance = self.sphere(*slot).0.distance_squared(center);
            distance <= reach * reach
        };
        let mut has_neighbours = block.clone().filter(is_within_reach).any(&mut add_neighbour);
        if !has_neighbours {
            self.visit_neighbours(center, reach, |slot, _| {
                has_neighbours = add_neighbour(slot);
                !has_neighbours
            });
        }
        has_neighbours
    }
}
