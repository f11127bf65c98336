//! Which bricks the surface may pass: near particles, but not deep among them.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::brick::VOXELS;
use super::layout::Layout;
use crate::surface::field::bins::{Bins, floor};

/// Bricks along an edge of a block.
pub(super) const EDGE: i32 = 4;
/// Blocks that a task looks at.
const BLOCKS: usize = 64;
/// Rows of bins that a task looks at.
const ROWS: usize = 128;
/// Part of the particles that an even filling has, from which on a bin counts as filled.
const FILLED: f32 = 0.5;

/// 4x4x4 bricks, a bit for each: x fastest, then y, then z.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockPlan {
    /// In blocks.
    pub(super) place: [i32; 3],
    /// The surface may pass.
    pub(super) band: u64,
    /// All inside, deep among particles.
    pub(super) inside: u64,
    /// The band and its neighbours that are not deep inside: the field is needed here.
    pub(super) raw: u64,
}

/// The blocks that hold anything, in the order of their places.
#[derive(Debug)]
pub(super) struct Plan {
    /// By their keys.
    pub(super) blocks: Vec<BlockPlan>,
}

impl Plan {
    pub(super) fn of(bins: &Bins, layout: &Layout) -> Self {
        let blocks = near_particles(bins, layout);
        let beside: Vec<Vec<(u64, u64)>> = blocks.par_chunks(BLOCKS).map(beside_band).collect();
        let beside = merged(beside.concat());
        let mut near = blocks.into_iter().peekable();
        let mut blocks = Vec::new();
        // Two lists by key become one.
        for (key, raw) in beside {
            while let Some(earlier) = near.next_if(|block| block.key() < key) {
                blocks.push(earlier);
            }
            let block = near.next_if(|block| block.key() == key);
            let block = block.unwrap_or_else(|| BlockPlan::empty(key));
            let raw = raw & !block.inside;
            blocks.push(BlockPlan { raw, ..block });
        }
        blocks.extend(near);
        Self { blocks }
    }

    /// Numbers of the blocks around a block, by z, y and x.
    pub(super) fn around(&self, block: usize) -> [Option<usize>; 27] {
        let place = self.blocks[block].place;
        std::array::from_fn(|i| {
            let step = |i: usize| [-1, 0, 1][i % 3];
            let (x, y, z) = (step(i), step(i / 3), step(i / 9));
            let key = key_of([place[0] + x, place[1] + y, place[2] + z]);
            self.blocks.binary_search_by_key(&key, BlockPlan::key).ok()
        })
    }

    /// Bytes of all of it.
    pub(super) fn byte_len(&self) -> u64 {
        size_of_val(&self.blocks[..]) as u64
    }
}

impl BlockPlan {
    fn key(&self) -> u64 {
        key_of(self.place)
    }

    fn empty(key: u64) -> Self {
        Self {
            place: place_of(key),
            band: 0,
            inside: 0,
            raw: 0,
        }
    }
}

/// Keys and bits of the bricks of bands and of those around them.
fn beside_band(blocks: &[BlockPlan]) -> Vec<(u64, u64)> {
    let mut found = Vec::new();
    for block in blocks {
        for cell in cells(block.band) {
            let [x, y, z] = brick_at(block.place, cell);
            for z in z - 1..=z + 1 {
                for y in y - 1..=y + 1 {
                    found.extend((x - 1..=x + 1).map(|x| key_and_bit([x, y, z])));
                }
            }
        }
    }
    merged(found)
}

/// The cells whose bits are set.
pub(super) fn cells(mut bits: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let cell = bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
        (cell < 64).then_some(cell)
    })
}

/// The bands of the blocks that particles are near enough to for a surface, by their keys.
fn near_particles(bins: &Bins, layout: &Layout) -> Vec<BlockPlan> {
    let occupied = occupied(bins, layout);
    let filled = filled_count(layout);
    // Deep inside the field is taken to be 1: no inside for who asks for more.
    let has_inside = layout.threshold < 1.0;
    occupied
        .into_par_iter()
        .map(|(key, near)| {
            let place = place_of(key);
            let is_deep = |cell: u32| {
                let brick = brick_at(place, cell);
                has_inside && near >> cell & 1 == 1 && is_deep(bins, layout, brick, filled)
            };
            let inside = (0..64).fold(0, |bits, cell| bits | u64::from(is_deep(cell)) << cell);
            BlockPlan {
                place,
                band: near & !inside,
                inside,
                raw: 0,
            }
        })
        .collect()
}

/// The brick of a cell of the block at `place`, in bricks.
pub(super) fn brick_at(place: [i32; 3], cell: u32) -> [i32; 3] {
    let part = |axis: usize| (cell >> (2 * axis) & 3).cast_signed();
    std::array::from_fn(|axis| EDGE * place[axis] + part(axis))
}

/// Flags for the bins within `reach` of the bricks where the field is needed.
pub(super) fn bins_near(
    bins: &Bins,
    layout: &Layout,
    blocks: &[BlockPlan],
    reach: f32,
) -> Vec<bool> {
    let near: Vec<AtomicBool> = (0..bins.bin_count())
        .map(|_| AtomicBool::new(false))
        .collect();
    blocks.par_iter().for_each(|block| {
        for cell in cells(block.raw) {
            let [xs, ys, zs] = cells_around(layout, brick_at(block.place, cell), reach);
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

/// Keys and bits of blocks with bricks that particles are near enough to for a surface, in order.
fn occupied(bins: &Bins, layout: &Layout) -> Vec<(u64, u64)> {
    let tasks: Vec<Range<usize>> = (0..bins.row_count())
        .step_by(ROWS)
        .map(|first| first..(first + ROWS).min(bins.row_count()))
        .collect();
    let parts: Vec<Vec<(u64, u64)>> = tasks
        .into_par_iter()
        .map(|rows| {
            let mut found = Vec::new();
            for row in rows {
                occupied_by_row(bins, layout, row, &mut found);
            }
            merged(found)
        })
        .collect();
    merged(parts.concat())
}

/// One entry for each key, in order.
pub(super) fn merged(mut found: Vec<(u64, u64)>) -> Vec<(u64, u64)> {
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
    let place = bins.row(row);
    let (ys, zs) = (layout.bricks_near(place.y), layout.bricks_near(place.z));
    for z in zs {
        for y in ys.clone() {
            // Bins come by x: entries of one block follow one another.
            let mut last: Option<(u64, u64)> = None;
            for bin in bins.bins_in(row) {
                for x in layout.bricks_near(bins.bin(bin).x) {
                    let (key, bit) = key_and_bit([x, y, z]);
                    match &mut last {
                        Some((held, bits)) if *held == key => *bits |= bit,
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

pub(super) fn place_of(key: u64) -> [i32; 3] {
    [0, 21, 42].map(|shift| (key >> shift & ((1 << 21) - 1)) as i32 - (1 << 20))
}

/// Particles from which on a bin counts as filled.
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
                && run
                    .into_iter()
                    .all(|bin| bins.particles_in(bin..bin + 1).len() >= filled)
        })
    })
}

/// The bins that come within `reach` of a brick, along each axis.
pub(super) fn cells_around(layout: &Layout, brick: [i32; 3], reach: f32) -> [Range<i32>; 3] {
    /// Bins that touch only by rounding do not count.
    const SLACK: f32 = 1e-3;
    let edge = VOXELS as f32 * layout.voxel;
    brick.map(|b| {
        let low = (b as f32 * edge - reach) / layout.support + SLACK;
        let high = ((b + 1) as f32 * edge + reach) / layout.support - SLACK;
        floor(low)..floor(high) + 1
    })
}
