//! `lbvh`: the linear bounding volume hierarchy (Lauterbach et al. 2009) with blocks as leaves and implicit 8-wide
//! levels. Particles are sorted along a Hilbert curve; everything else is arithmetic. It is the fastest build.
//!
//! The sort is one parallel scatter into the cells of the top levels of the curve (`partition.rs`), followed by a
//! sort of each cell inside the cache. Both run in the memory of the finished tree, so the build needs almost no
//! additional memory.

use glam::Vec3;
use rayon::prelude::*;

use super::levels::TopLevels;
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{Aabb, BuildReport, BuildSettings, SphereRadius, Spheres, Structure};
use crate::order::curve::{AXIS_BITS, CurveState, Grid, TopCells, hilbert};
use crate::order::partition::{Cells, scatter};

/// Curve levels that the sort inside a cell uses; particles that differ only in finer levels keep the order of the
/// input.
const CELL_LEVELS: u32 = 12;
/// Bits for the index of a particle in its cell, next to 3 * `CELL_LEVELS` bits of the key.
const CELL_INDEX_BITS: u32 = 64 - 3 * CELL_LEVELS;
/// Larger cells are sorted by all threads together, so that a clustered frame is not sorted by one thread.
pub(super) const LARGE_CELL: usize = 1 << 18;
/// Number of positions sampled to place the grid.
const SAMPLE: usize = 4096;

/// Builds a tree over `spheres` in the memory of `tree`.
pub(super) fn build(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    let scratch_bytes = sort_into_blocks(tree, spheres, settings.keep_indices, &mut clock);
    let sah_cost = tree.finish(TopLevels::Mapped);
    if !settings.keep_indices {
        tree.drop_indices();
    }
    clock.lap("nodes");
    tree.report(
        Structure::Lbvh,
        "hilbert, k-d above 1024 particles",
        sah_cost,
        scratch_bytes,
        clock.finish(),
    )
}

/// Sorts the particles along the curve into the blocks of `tree`, which then hold points (not yet transposed). The
/// indices are available afterwards if they are to be kept or if radii need them. Returns the peak memory in bytes
/// next to the tree. Records the phases `bounds`, `scatter` and `sort`.
pub(super) fn sort_into_blocks(
    tree: &mut WideTree,
    spheres: &Spheres,
    keep_indices: bool,
    clock: &mut PhaseClock,
) -> u64 {
    let centers = spheres.centers;
    let common = match spheres.radius {
        SphereRadius::Common(radius) => Some(radius),
        SphereRadius::Each(_) => None,
    };
    // Radii per particle are gathered by index, so the build needs the indices then.
    let indexed = keep_indices || common.is_none();
    tree.reset(centers.len(), common, indexed);

    // Place the grid of the curve over the bulk of the particles
    let bounds = bounds_of(centers);
    let (min, size) = grid_placement(centers, bounds);
    let grid = Grid::new(min, size);
    clock.lap("bounds");

    // Scatter the particles into the cells of the top levels of the curve
    let (points, indices) = tree.points_mut();
    let top = TopCells::new(grid, Cells::levels_for(centers.len()));
    let cell_of = |_, center| top.cell_of(center);
    let cells = scatter(centers, top.len(), cell_of, points, indices);
    clock.lap("scatter");

    // Sort each cell along the curve and complete the blocks
    let scratch_bytes = sort_scratch_bytes(&cells, indexed);
    sort_cells(&grid, top.levels(), &cells, points, indices);
    tree.pad_last_block();
    if let SphereRadius::Each(radii) = spheres.radius {
        tree.gather_radii(radii);
    }
    clock.lap("sort");
    scratch_bytes
}

fn bounds_of(centers: &[Vec3]) -> Aabb {
    centers.par_chunks(64 * 1024).map(Aabb::around).reduce(|| Aabb::EMPTY, Aabb::union)
}

/// Position and size of the grid: the box of the bulk of the particles, so that a few outliers do not put all others
/// into one cell.
fn grid_placement(centers: &[Vec3], bounds: Aabb) -> (Vec3, Vec3) {
    if centers.is_empty() {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let stride = centers.len().div_ceil(SAMPLE);
    let (mut min, mut max) = (bounds.min, bounds.max);
    for axis in 0..3 {
        let mut values: Vec<f32> = centers.iter().step_by(stride).map(|c| c[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        // Clip the box to the 1st and 99th percentile, with a margin of half their distance
        let low = values[values.len() / 100];
        let high = values[values.len() - 1 - values.len() / 100];
        let margin = 0.5 * (high - low);
        min[axis] = min[axis].max(low - margin);
        max[axis] = max[axis].min(high + margin);
    }
    (min, (max - min).max(Vec3::ZERO))
}

/// Sorts the particles of every cell along the curve.
fn sort_cells(
    grid: &Grid,
    top_levels: u32,
    cells: &Cells,
    points: &mut [Vec3],
    indices: &mut [u32],
) {
    cells.slices_of(points, indices).into_par_iter().for_each_init(
        CellScratch::default,
        |scratch, (points, indices)| {
            if points.len() > LARGE_CELL {
                sort_large_cell(grid, top_levels, points, indices);
            } else {
                scratch.sort(grid, top_levels, points, indices);
            }
        },
    );
}

/// Peak memory of the sort in bytes next to the particles. Crowded cells are copied with their keys; all other cells
/// fit into the cache.
fn sort_scratch_bytes(cells: &Cells, indexed: bool) -> u64 {
    let each = size_of::<(u64, u32)>() + size_of::<Vec3>() + if indexed { 4 } else { 0 };
    let lens = cells.starts.windows(2).map(|pair| pair[1] - pair[0]);
    let crowded: usize = lens.filter(|len| *len > LARGE_CELL).sum();
    (crowded * each) as u64
}

/// Bytes for each particle of a cell in [`CellScratch`].
pub(super) const CELL_SCRATCH: u64 = 16;

/// Buffers of one thread for sorting cells; a cell fits into the cache.
#[derive(Default)]
struct CellScratch {
    keys: Vec<u64>,
    sorted: Vec<u64>,
    starts: Vec<u32>,
}

/// Curve levels used by the counting sort inside a cell.
const BIN_LEVELS: u32 = 4;

impl CellScratch {
    fn sort(&mut self, grid: &Grid, top_levels: u32, points: &mut [Vec3], indices: &mut [u32]) {
        // Compute the key of each particle: its position along the curve, then its index in the cell
        let Some(first) = points.first() else { return };
        let (_, state) = hilbert(grid.morton(*first), 0, top_levels, CurveState::default());
        self.keys.clear();
        self.keys.extend(points.iter().enumerate().map(|(i, p)| {
            let (place, _) = hilbert(grid.morton(*p), top_levels, CELL_LEVELS, state);
            (place << CELL_INDEX_BITS) | i as u64
        }));
        self.sort_keys();
        self.move_to_order(points, indices);
    }

    /// Moves points and indices into the order of the sorted keys: cycle by cycle of the permutation, without copies of
    /// a cell.
    fn move_to_order(&mut self, points: &mut [Vec3], indices: &mut [u32]) {
        for first in 0..self.sorted.len() {
            let point = points[first];
            let index = indices.get(first).copied();
            let mut slot = first;
            loop {
                let from = local_index(self.sorted[slot]);
                // The slot is done
                self.sorted[slot] = slot as u64;
                if from == first || from == slot {
                    break;
                }
                points[slot] = points[from];
                if index.is_some() {
                    indices[slot] = indices[from];
                }
                slot = from;
            }
            points[slot] = point;
            if let Some(index) = index {
                indices[slot] = index;
            }
        }
    }

    /// Sorts the keys: a counting sort by their top bits, then a comparison sort in each bin. In an even
    /// distribution, bins hold a handful of keys.
    fn sort_keys(&mut self) {
        const BINS: usize = 1 << (3 * BIN_LEVELS);
        const SHIFT: u32 = 64 - 3 * BIN_LEVELS;
        let bin = |key: u64| (key >> SHIFT) as usize;
        // Count the keys of each bin, and sum the counts up to the start of each bin
        self.starts.clear();
        self.starts.resize(BINS + 1, 0);
        for key in &self.keys {
            self.starts[bin(*key) + 1] += 1;
        }
        for b in 0..BINS {
            self.starts[b + 1] += self.starts[b];
        }
        // Move each key to its bin
        self.sorted.resize(self.keys.len(), 0);
        for key in &self.keys {
            let slot = &mut self.starts[bin(*key)];
            self.sorted[*slot as usize] = *key;
            *slot += 1;
        }
        // Sort each bin; `starts[b]` is now the end of bin `b`
        let mut begin = 0;
        for end in &self.starts[..BINS] {
            let end = *end as usize;
            sort_bin(&mut self.sorted[begin..end]);
            begin = end;
        }
    }
}

/// Insertion sort for small bins, which are the usual case.
fn sort_bin(keys: &mut [u64]) {
    if keys.len() > 24 {
        return keys.sort_unstable();
    }
    for i in 1..keys.len() {
        let key = keys[i];
        let mut j = i;
        while j > 0 && keys[j - 1] > key {
            keys[j] = keys[j - 1];
            j -= 1;
        }
        keys[j] = key;
    }
}

fn local_index(key: u64) -> usize {
    (key & ((1 << CELL_INDEX_BITS) - 1)) as usize
}

/// Sorts a crowded cell with all threads, by all levels of the curve.
fn sort_large_cell(grid: &Grid, top_levels: u32, points: &mut [Vec3], indices: &mut [u32]) {
    // Sort the keys; ties go to the earlier particle
    let (_, state) = hilbert(grid.morton(points[0]), 0, top_levels, CurveState::default());
    let mut keys: Vec<(u64, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(i, p)| {
            let levels = AXIS_BITS - top_levels;
            let (place, _) = hilbert(grid.morton(*p), top_levels, levels, state);
            (place, crate::order::index_u32(i))
        })
        .collect();
    keys.par_sort_unstable();
    // Move points and indices into the sorted order
    let old = points.to_vec();
    points.par_iter_mut().zip(&keys).for_each(|(p, (_, from))| *p = old[*from as usize]);
    if !indices.is_empty() {
        let old = indices.to_vec();
        indices.par_iter_mut().zip(&keys).for_each(|(i, (_, from))| *i = old[*from as usize]);
    }
}

const _: () = assert!(LARGE_CELL <= 1 << CELL_INDEX_BITS);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_sorted_by_key_and_points_keep_their_indices() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Few places, so that many particles have the same key
            (state >> 28) as f32 / 16.0
        };
        let input: Vec<Vec3> = (0..5000).map(|_| Vec3::new(random(), random(), random())).collect();
        let grid = Grid::new(Vec3::ZERO, Vec3::ONE);
        let key =
            |point: Vec3| hilbert(grid.morton(point), 0, CELL_LEVELS, CurveState::default()).0;
        let mut expected: Vec<u32> = (0..5000).collect();
        expected.sort_by_key(|index| key(input[*index as usize]));
        let (mut points, mut indices) = (input.clone(), (0..5000).collect::<Vec<u32>>());
        CellScratch::default().sort(&grid, 0, &mut points, &mut indices);
        assert_eq!(indices, expected);
        assert!(points.iter().zip(&indices).all(|(point, index)| *point == input[*index as usize]));
        let mut alone = input;
        CellScratch::default().sort(&grid, 0, &mut alone, &mut []);
        assert_eq!(alone, points);
    }
}
