//! Selects the bricks that the surface may pass through: near particles, but not deep inside the fluid.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::brick::VOXELS;
use super::layout::Layout;
use crate::field::bins::{Bins, floor};

/// Bricks along an edge of a block.
pub(super) const EDGE: i32 = 4;
/// Blocks per task.
const TASK_BLOCKS: usize = 64;
/// Rows of bins per task.
const TASK_ROWS: usize = 128;
/// A bin with at least this fraction of the particles of a regular filling counts as filled.
const FILLED: f32 = 0.5;

/// A block of 4x4x4 bricks, with one bit per brick: x fastest, then y, then z.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockPlan {
    /// Position in blocks.
    pub(super) position: [i32; 3],
    /// Bricks that the surface may pass through.
    pub(super) band: u64,
    /// Bricks that are deep inside the fluid.
    pub(super) inside: u64,
    /// Bricks in which the field is needed: the band and its neighbours, without those that are deep inside.
    pub(super) raw: u64,
}

/// All blocks with any bits set, sorted by position.
#[derive(Debug)]
pub(super) struct Plan {
    /// Sorted by their keys.
    pub(super) blocks: Vec<BlockPlan>,
}

impl Plan {
    pub(super) fn of(bins: &Bins, layout: &Layout) -> Self {
        // Find the band, and the bricks around it
        let blocks = near_particles(bins, layout);
        let with_neighbours: Vec<Vec<(u64, u64)>> =
            blocks.par_chunks(TASK_BLOCKS).map(neighbours_of_band).collect();
        let with_neighbours = merge_by_key(with_neighbours.concat());
        let mut near = blocks.into_iter().peekable();
        let mut blocks = Vec::new();
        // Merge the two sorted lists
        for (key, raw) in with_neighbours {
            while let Some(earlier) = near.next_if(|block| block.key() < key) {
                blocks.push(earlier);
            }
            let block =
                near.next_if(|block| block.key() == key).unwrap_or_else(|| BlockPlan::empty(key));
            let raw = raw & !block.inside;
            blocks.push(BlockPlan { raw, ..block });
        }
        blocks.extend(near);
        Self { blocks }
    }

    /// Indices of a block and its 26 neighbours, by z, y and x.
    pub(super) fn around(&self, block: usize) -> [Option<usize>; 27] {
        let position = self.blocks[block].position;
        std::array::from_fn(|i| {
            let step = |i: usize| [-1, 0, 1][i % 3];
            let (x, y, z) = (step(i), step(i / 3), step(i / 9));
            let key = key_of([position[0] + x, position[1] + y, position[2] + z]);
            self.blocks.binary_search_by_key(&key, BlockPlan::key).ok()
        })
    }

    /// Memory in bytes.
    pub(super) fn byte_len(&self) -> u64 {
        size_of_val(&self.blocks[..]) as u64
    }

    /// Number of bricks that the surface may pass through.
    pub(super) fn band_count(&self) -> u64 {
        self.blocks.iter().map(|block| u64::from(block.band.count_ones())).sum()
    }

    /// Number of bricks in which the field is needed.
    pub(super) fn raw_count(&self) -> u64 {
        self.blocks.iter().map(|block| u64::from(block.raw.count_ones())).sum()
    }

    /// The plan of a part of the bricks: those of some blocks, distributed over all, about `most` in total.
    pub(super) fn sample(&self, most: u64) -> Self {
        let every = self.band_count().div_ceil(most).max(1);
        let is_chosen = |block: &BlockPlan| (mixed(block.key()) >> 32).is_multiple_of(every);
        let with_band = self.blocks.iter().filter(|block| block.band != 0);
        let mut chosen: Vec<BlockPlan> = with_band.clone().copied().filter(is_chosen).collect();
        if chosen.is_empty() {
            chosen.extend(with_band.max_by_key(|block| block.band.count_ones()));
        }
        // Find the bricks around them, which are in blocks of the plan
        let around = neighbours_of_band(&chosen);
        let bits_of = |entries: &[(u64, u64)], key: u64| {
            entries.binary_search_by_key(&key, |entry| entry.0).map_or(0, |found| entries[found].1)
        };
        let bands: Vec<(u64, u64)> = chosen.iter().map(|block| (block.key(), block.band)).collect();
        let blocks = self.blocks.iter().map(|block| BlockPlan {
            band: bits_of(&bands, block.key()),
            raw: bits_of(&around, block.key()) & block.raw,
            ..*block
        });
        Self { blocks: blocks.collect() }
    }
}

/// Mixes the bits of `key`, so that equal distances in a grid do not show (finalizer of SplitMix64).
const fn mixed(key: u64) -> u64 {
    let key = (key ^ key >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let key = (key ^ key >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    key ^ key >> 31
}

impl BlockPlan {
    fn key(&self) -> u64 {
        key_of(self.position)
    }

    fn empty(key: u64) -> Self {
        Self { position: position_of(key), band: 0, inside: 0, raw: 0 }
    }
}

/// Keys and bits of the bricks of all bands and of their neighbours.
fn neighbours_of_band(blocks: &[BlockPlan]) -> Vec<(u64, u64)> {
    let mut found = Vec::new();
    for block in blocks {
        for cell in cells(block.band) {
            let [x, y, z] = brick_at(block.position, cell);
            for z in z - 1..=z + 1 {
                for y in y - 1..=y + 1 {
                    found.extend((x - 1..=x + 1).map(|x| key_and_bit([x, y, z])));
                }
            }
        }
    }
    merge_by_key(found)
}

/// Indices of the set bits.
pub(super) fn cells(mut bits: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let cell = bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
        (cell < 64).then_some(cell)
    })
}

/// All blocks with particles near enough for a surface, sorted by key; `raw` is not set yet.
fn near_particles(bins: &Bins, layout: &Layout) -> Vec<BlockPlan> {
    let occupied = occupied(bins, layout);
    let filled = filled_count(layout);
    // The field deep inside is assumed to be 1, so a higher threshold has no inside.
    let has_inside = layout.threshold < 1.0;
    occupied
        .into_par_iter()
        .map(|(key, near)| {
            let position = position_of(key);
            // Separate bricks that are deep inside from the band
            let is_deep = |cell: u32| {
                let brick = brick_at(position, cell);
                has_inside && near >> cell & 1 == 1 && is_deep(bins, layout, brick, filled)
            };
            let inside = (0..64).fold(0, |bits, cell| bits | u64::from(is_deep(cell)) << cell);
            BlockPlan { position, band: near & !inside, inside, raw: 0 }
        })
        .collect()
}

/// Position in bricks of a cell of the block at `position`.
pub(super) fn brick_at(position: [i32; 3], cell: u32) -> [i32; 3] {
    let part = |axis: usize| (cell >> (2 * axis) & 3).cast_signed();
    std::array::from_fn(|axis| EDGE * position[axis] + part(axis))
}

/// A flag for each bin: whether it is within `reach` of a brick in which the field is needed.
pub(super) fn bins_near(
    bins: &Bins,
    layout: &Layout,
    blocks: &[BlockPlan],
    reach: f32,
) -> Vec<bool> {
    let near: Vec<AtomicBool> = (0..bins.bin_count()).map(|_| AtomicBool::new(false)).collect();
    blocks.par_iter().for_each(|block| {
        for cell in cells(block.raw) {
            // Flag all bins within reach of the brick
            let [xs, ys, zs] = cells_around(layout, brick_at(block.position, cell), reach);
            for z in zs {
                for y in ys.clone() {
                    for bin in bins.run(z, y, xs.clone()) {
                        near[bin].store(true, Ordering::Relaxed);
                    }
                }
            }
        }
    });
    near.into_iter().map(AtomicBool::into_inner).collect()
}

/// Sorted keys of all blocks with particles near enough for a surface, and the bits of these bricks.
fn occupied(bins: &Bins, layout: &Layout) -> Vec<(u64, u64)> {
    let tasks: Vec<Range<usize>> = (0..bins.row_count())
        .step_by(TASK_ROWS)
        .map(|first| first..(first + TASK_ROWS).min(bins.row_count()))
        .collect();
    let parts: Vec<Vec<(u64, u64)>> = tasks
        .into_par_iter()
        .map(|rows| {
            let mut found = Vec::new();
            for row in rows {
                occupied_by_row(bins, layout, row, &mut found);
            }
            merge_by_key(found)
        })
        .collect();
    merge_by_key(parts.concat())
}

/// Sorts entries by key, and combines the bits of equal keys.
pub(super) fn merge_by_key(mut found: Vec<(u64, u64)>) -> Vec<(u64, u64)> {
    found.par_sort_unstable();
    found.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 |= next.1;
        }
        same
    });
    found
}

fn occupied_by_row(bins: &Bins, layout: &Layout, row: usize, found: &mut Vec<(u64, u64)>) {
    let position = bins.row(row);
    let (ys, zs) = (layout.bricks_near(position.y), layout.bricks_near(position.z));
    for z in zs {
        for y in ys.clone() {
            // Bins are sorted by x, so entries of the same block are adjacent: combine them at once
            let mut last: Option<(u64, u64)> = None;
            for bin in bins.bins_in(row) {
                for x in layout.bricks_near(bins.bin(bin).x) {
                    let (key, bit) = key_and_bit([x, y, z]);
                    match &mut last {
                        Some((current, bits)) if *current == key => *bits |= bit,
                        _ => found.extend(last.replace((key, bit))),
                    }
                }
            }
            found.extend(last);
        }
    }
}

fn key_and_bit(brick: [i32; 3]) -> (u64, u64) {
    let part = |c: i32| c.rem_euclid(EDGE).cast_unsigned();
    let cell = part(brick[0]) | part(brick[1]) << 2 | part(brick[2]) << 4;
    (key_of(brick.map(|c| c.div_euclid(EDGE))), 1 << cell)
}

pub(super) fn key_of(block: [i32; 3]) -> u64 {
    let part = |c: i32| u64::from((c + (1 << 20)).cast_unsigned());
    part(block[2]) << 42 | part(block[1]) << 21 | part(block[0])
}

pub(super) fn position_of(key: u64) -> [i32; 3] {
    [0, 21, 42].map(|shift| (key >> shift & ((1 << 21) - 1)) as i32 - (1 << 20))
}

/// Particle count from which a bin counts as filled.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small number above 0"
)]
fn filled_count(layout: &Layout) -> usize {
    let spacings = layout.support / (2.0 * layout.radius);
    ((FILLED * spacings.powi(3)).ceil() as usize).max(1)
}

/// Whether all bins within the support of a brick are filled.
fn is_deep(bins: &Bins, layout: &Layout, brick: [i32; 3], filled: usize) -> bool {
    let [xs, ys, zs] = cells_around(layout, brick, layout.support);
    zs.into_iter().all(|z| {
        ys.clone().all(|y| {
            let run = bins.run(z, y, xs.clone());
            run.len() == xs.len()
                && run.into_iter().all(|bin| bins.particles_in(bin..bin + 1).len() >= filled)
        })
    })
}

/// The range of bins within `reach` of a brick, along each axis.
pub(super) fn cells_around(layout: &Layout, brick: [i32; 3], reach: f32) -> [Range<i32>; 3] {
    /// Excludes bins that touch the range only because of rounding.
    const SLACK: f32 = 1e-3;
    let edge = VOXELS as f32 * layout.voxel;
    brick.map(|b| {
        let low = (b as f32 * edge - reach) / layout.support + SLACK;
        let high = ((b + 1) as f32 * edge + reach) / layout.support - SLACK;
        floor(low)..floor(high) + 1
    })
}
