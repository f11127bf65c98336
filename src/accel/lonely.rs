//! Which particles have few neighbours, found in the tree that rays use.

use std::ops::Range;

use rayon::prelude::*;

use super::view::TreeView;
use spherule_formats::blocks::BLOCK_SIZE;
use spherule_formats::order::index_u32;

/// Neighbours that are told apart where only few count.
const FEW: usize = 16;

impl TreeView<'_> {
    /// The particles, in order, that have fewer than `enough` others within `support` times their radius.
    ///
    /// # Panics
    /// If `enough` is more than 16.
    pub(crate) fn lonely(&self, support: f32, enough: usize) -> Vec<u32> {
        assert!(enough <= FEW, "only few neighbours are told apart");
        let slots = self.slot_count();
        let mut lonely: Vec<u32> = (0..slots.div_ceil(BLOCK_SIZE))
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|block| {
                let first = block * BLOCK_SIZE;
                let slots = index_u32(first)..index_u32(slots.min(first + BLOCK_SIZE));
                let is_lonely = {
                    let slots = slots.clone();
                    move |slot: &u32| !self.has_company(*slot, &slots, support, enough)
                };
                slots.filter(is_lonely).map(|slot| self.particle(slot))
            })
            .collect();
        lonely.par_sort_unstable();
        lonely.dedup();
        lonely
    }

    /// Whether there are `enough` particles about the one in `slot`: often they are in its own `block`.
    fn has_company(&self, slot: u32, block: &Range<u32>, support: f32, enough: usize) -> bool {
        let (center, radius) = self.sphere(slot);
        let reach = support * radius;
        let own = self.particle(slot);
        let mut found = [0; FEW];
        let mut count = 0;
        let mut is_enough = |slot: u32| {
            let particle = self.particle(slot);
            if count < enough && particle != own && !found[..count].contains(&particle) {
                found[count] = particle;
                count += 1;
            }
            count >= enough
        };
        let is_near = |slot: &u32| {
            let distance = self.sphere(*slot).0.distance_squared(center);
            distance <= reach * reach
        };
        let mut has_company = block.clone().filter(is_near).any(&mut is_enough);
        if !has_company {
            self.visit_near(center, reach, |slot, _| {
                has_company = is_enough(slot);
                !has_company
            });
        }
        has_company
    }
}
