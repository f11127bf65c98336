//! `lbvh`: the linear bounding volume hierarchy (Lauterbach et al. 2009) with blocks as leaves and
//! implicit 8-wide levels: Hilbert order, then nothing but arithmetic. The fastest build.
//!
//! Sort: one parallel scatter into the cells of the curve's top levels (`partition.rs`), then
//! each cell on its own inside the cache. Everything happens in the memory that the finished tree
//! keeps, so building needs almost nothing beside it.

use glam::Vec3;
use rayon::prelude::*;

use super::levels::UpperLevels;
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{Aabb, BuildReport, BuildSettings, SphereRadius, Spheres, Structure};
use spherule_formats::order::curve::{AXIS_BITS, CurveState, Grid, TopCells, hilbert};
use spherule_formats::order::partition::{Cells, scatter};

/// Curve levels that the sort inside a cell looks at; finer differences keep the input's order.
const CELL_LEVELS: u32 = 12;
/// Bits left for the index of a particle in its cell, beside 3 * `CELL_LEVELS` bits of key.
const CELL_INDEX_BITS: u32 = 64 - 3 * CELL_LEVELS;
/// Cells above this are sorted by all threads together: a clustered frame must not end on one.
const LARGE_CELL: usize = 1 << 18;
/// Positions looked at to place the grid.
const SAMPLE: usize = 4096;

/// Builds over `spheres` in the memory of `tree`.
pub(super) fn build(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    let scratch_bytes = sort_into_blocks(tree, spheres, settings.keep_indices, &mut clock);
    let sah_cost = tree.finish(UpperLevels::Mapped);
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

/// Brings the particles along the curve into the blocks of `tree`, as points yet. Indices are there
/// afterwards if they are to be kept or radii follow by them. Returns the most bytes held beside the
/// tree. Laps `bounds`, `scatter` and `sort`.
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
    // Radii of their own follow by index, so then the indices are needed while building.
    let indexed = keep_indices || common.is_none();
    tree.reset(centers.len(), common, indexed);

    let bounds = bounds_of(centers);
    let (min, size) = grid_placement(centers, bounds);
    let grid = Grid::new(min, size);
    clock.lap("bounds");

    let (points, indices) = tree.points_mut();
    let top = TopCells::new(grid, Cells::levels_for(centers.len()));
    let cell_of = |_, center| top.cell_of(center);
    let cells = scatter(centers, top.len(), cell_of, points, indices);
    clock.lap("scatter");

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
    centers
        .par_chunks(64 * 1024)
        .map(Aabb::around)
        .reduce(|| Aabb::EMPTY, Aabb::union)
}

/// Where the key grid goes: the box of the bulk of the particles, so that a few that escaped do
/// not leave all others in one cell.
fn grid_placement(centers: &[Vec3], bounds: Aabb) -> (Vec3, Vec3) {
    if centers.is_empty() {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let stride = centers.len().div_ceil(SAMPLE);
    let (mut min, mut max) = (bounds.min, bounds.max);
    for axis in 0..3 {
        let mut values: Vec<f32> = centers.iter().step_by(stride).map(|c| c[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
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
    cells
        .slices_of(points, indices)
        .into_par_iter()
        .for_each_init(CellScratch::default, |scratch, (points, indices)| {
            if points.len() > LARGE_CELL {
                sort_large_cell(grid, top_levels, points, indices);
            } else {
                scratch.sort(grid, top_levels, points, indices);
            }
        });
}

/// Most bytes that sorting holds beside the particles: crowded cells are copied with their keys, the
/// others fit the caches.
fn sort_scratch_bytes(cells: &Cells, indexed: bool) -> u64 {
    let each = size_of::<(u64, u32)>() + size_of::<Vec3>() + if indexed { 4 } else { 0 };
    let lens = cells.starts.windows(2).map(|pair| pair[1] - pair[0]);
    let crowded: usize = lens.filter(|len| *len > LARGE_CELL).sum();
    (crowded * each) as u64
}

/// Memory of one thread for sorting cells; a cell fits the cache.
#[derive(Default)]
struct CellScratch {
    keys: Vec<u64>,
    sorted: Vec<u64>,
    points: Vec<Vec3>,
    indices: Vec<u32>,
    starts: Vec<u32>,
}

/// Curve levels that the counting pass inside a cell distributes by.
const BIN_LEVELS: u32 = 4;

impl CellScratch {
    fn sort(&mut self, grid: &Grid, top_levels: u32, points: &mut [Vec3], indices: &mut [u32]) {
        let Some(first) = points.first() else { return };
        let (_, state) = hilbert(grid.morton(*first), 0, top_levels, CurveState::default());
        self.keys.clear();
        self.keys.extend(points.iter().enumerate().map(|(i, p)| {
            let (place, _) = hilbert(grid.morton(*p), top_levels, CELL_LEVELS, state);
            (place << CELL_INDEX_BITS) | i as u64
        }));
        self.sort_keys();
        self.points.clear();
        self.points.extend_from_slice(points);
        self.indices.clear();
        self.indices.extend_from_slice(indices);
        for (slot, key) in self.sorted.iter().enumerate() {
            let from = local_index(*key);
            points[slot] = self.points[from];
            if let Some(index) = indices.get_mut(slot) {
                *index = self.indices[from];
            }
        }
    }

    /// A counting pass over the top bits of the keys, then each bin by comparison: the bins of an
    /// even spread hold a handful.
    fn sort_keys(&mut self) {
        const BINS: usize = 1 << (3 * BIN_LEVELS);
        const SHIFT: u32 = 64 - 3 * BIN_LEVELS;
        let bin = |key: u64| (key >> SHIFT) as usize;
        self.starts.clear();
        self.starts.resize(BINS + 1, 0);
        for key in &self.keys {
            self.starts[bin(*key) + 1] += 1;
        }
        for b in 0..BINS {
            self.starts[b + 1] += self.starts[b];
        }
        self.sorted.resize(self.keys.len(), 0);
        for key in &self.keys {
            let slot = &mut self.starts[bin(*key)];
            self.sorted[*slot as usize] = *key;
            *slot += 1;
        }
        // Now starts[b] is the end of bin b.
        let mut begin = 0;
        for end in &self.starts[..BINS] {
            let end = *end as usize;
            sort_bin(&mut self.sorted[begin..end]);
            begin = end;
        }
    }
}

/// Insertion sort for the handful that a bin usually holds.
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

/// One crowded cell by all threads, with all levels of the curve.
fn sort_large_cell(grid: &Grid, top_levels: u32, points: &mut [Vec3], indices: &mut [u32]) {
    let (_, state) = hilbert(grid.morton(points[0]), 0, top_levels, CurveState::default());
    let mut keys: Vec<(u64, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(i, p)| {
            let levels = AXIS_BITS - top_levels;
            let (place, _) = hilbert(grid.morton(*p), top_levels, levels, state);
            (place, spherule_formats::order::index_u32(i))
        })
        .collect();
    keys.par_sort_unstable();
    let old = points.to_vec();
    points
        .par_iter_mut()
        .zip(&keys)
        .for_each(|(p, (_, from))| *p = old[*from as usize]);
    if !indices.is_empty() {
        let old = indices.to_vec();
        indices
            .par_iter_mut()
            .zip(&keys)
            .for_each(|(i, (_, from))| *i = old[*from as usize]);
    }
}

const _: () = assert!(LARGE_CELL <= 1 << CELL_INDEX_BITS);
