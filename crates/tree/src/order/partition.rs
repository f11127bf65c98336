//! The first half of every sort: a parallel, stable scatter of the particles into cells (one pass of a
//! most-significant-digit radix sort).
//!
//! Apart from small tables, it needs no memory but the destination. The scatter is stable, so that the result
//! does not depend on the number of threads.

use glam::Vec3;
use rayon::prelude::*;

use super::curve::TopCells;
use super::index_u32;

/// Target number of particles per cell: large enough to amortise the cell, small enough for the L2 cache.
const CELL_TARGET: usize = 4096;

/// The ranges of particles of the cells.
#[derive(Debug, Default)]
pub struct Cells {
    /// First particle of each cell, and the particle count at the end.
    pub starts: Vec<usize>,
}

impl Cells {
    /// The number of levels for `count` particles: the fewest for which an even distribution is near the target.
    pub fn levels_for(count: usize) -> u32 {
        let mut levels = 0;
        while levels < TopCells::MAX_LEVELS && (count >> (3 * levels)) > 8 * CELL_TARGET {
            levels += 1;
        }
        levels
    }

    /// The points and the indices of each cell; the index slices are empty if `indices` is empty.
    pub fn slices_of<'a>(
        &self,
        mut points: &'a mut [Vec3],
        mut indices: &'a mut [u32],
    ) -> Vec<(&'a mut [Vec3], &'a mut [u32])> {
        let mut slices = Vec::with_capacity(self.starts.len());
        for pair in self.starts.windows(2) {
            let len = pair[1] - pair[0];
            let (cell_points, rest) = points.split_at_mut(len);
            points = rest;
            let (cell_indices, rest) = indices.split_at_mut(len.min(indices.len()));
            indices = rest;
            slices.push((cell_points, cell_indices));
        }
        slices
    }
}

/// Particles per task of the scatter.
fn chunk_len(count: usize) -> usize {
    count.div_ceil(4 * rayon::current_num_threads()).max(16 * 1024)
}

/// Bytes of the tables for a scatter of `count` particles: a count and two slices for each chunk and cell.
pub fn table_bytes(count: u64) -> u64 {
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    let cells = 1_u64 << (3 * Cells::levels_for(count));
    let chunks = count.div_ceil(chunk_len(count)) as u64;
    chunks * cells * (size_of::<u32>() + size_of::<usize>() + 2 * size_of::<&[u32]>()) as u64
}

/// Scatters `centers` into `points`, and their indices into `indices` unless that is empty. `cell_of` returns
/// the cell of the particle with this index and position, below `cell_count`.
///
/// # Panics
/// If `points` (or a non-empty `indices`) is shorter than `centers`.
pub fn scatter(
    centers: &[Vec3],
    cell_count: usize,
    cell_of: impl Fn(usize, Vec3) -> usize + Sync,
    points: &mut [Vec3],
    indices: &mut [u32],
) -> Cells {
    // Count the particles of each cell in each chunk
    let chunk_len = chunk_len(centers.len());
    let counts: Vec<Vec<u32>> = centers
        .par_chunks(chunk_len)
        .enumerate()
        .map(|(chunk_number, chunk)| {
            let mut counts = vec![0; cell_count];
            for (index, center) in (chunk_number * chunk_len..).zip(chunk) {
                counts[cell_of(index, *center)] += 1;
            }
            counts
        })
        .collect();
    // Give each chunk its own slice of each cell
    let starts = cell_starts(&counts, cell_count);
    let point_parts = split_by_cell(&mut points[..centers.len()], &counts, cell_count);
    let index_parts = if indices.is_empty() {
        point_parts.iter().map(|_| Vec::new()).collect()
    } else {
        split_by_cell(&mut indices[..centers.len()], &counts, cell_count)
    };
    // Move the particles of each chunk into its slices
    centers.par_chunks(chunk_len).zip(point_parts).zip(index_parts).enumerate().for_each(
        |(chunk_number, ((chunk, mut points), mut indices))| {
            let first = chunk_number * chunk_len;
            let mut filled = vec![0_usize; cell_count];
            for (index, center) in (first..).zip(chunk) {
                let cell = cell_of(index, *center);
                let slot = filled[cell];
                filled[cell] += 1;
                points[cell][slot] = *center;
                if let Some(part) = indices.get_mut(cell) {
                    part[slot] = index_u32(index);
                }
            }
        },
    );
    Cells { starts }
}

fn cell_starts(counts: &[Vec<u32>], cell_count: usize) -> Vec<usize> {
    let mut starts = Vec::with_capacity(cell_count + 1);
    let mut next = 0;
    starts.push(0);
    for cell in 0..cell_count {
        next += counts.iter().map(|c| c[cell] as usize).sum::<usize>();
        starts.push(next);
    }
    starts
}

/// Cuts `whole`, which is ordered by cell and then by chunk, into one slice per chunk and cell, and returns the
/// slices of each chunk.
fn split_by_cell<'a, T>(
    mut whole: &'a mut [T],
    counts: &[Vec<u32>],
    cell_count: usize,
) -> Vec<Vec<&'a mut [T]>> {
    let mut parts: Vec<Vec<&mut [T]>> =
        counts.iter().map(|_| Vec::with_capacity(cell_count)).collect();
    for cell in 0..cell_count {
        for (chunk_parts, chunk_counts) in parts.iter_mut().zip(counts) {
            let (part, rest) = whole.split_at_mut(chunk_counts[cell] as usize);
            chunk_parts.push(part);
            whole = rest;
        }
    }
    parts
}
