//! Particles sorted into cubic bins with the size of the kernel's support.
//!
//! Only bins with particles are stored: rows along x sorted by (z, y), the bins of each row sorted by x, and the
//! particles of each bin. So outliers cost nothing, and the neighbourhood of a bin is nine runs of bins.

use std::cmp::Ordering;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use spherule_tree::order::index_u32;
use spherule_tree::order::partition::scatter;

/// Maximum distance of bins from the origin along each axis, in bins, so that three coordinates fit into a key of 64
/// bits.
const MAX_CELL: i32 = 1 << 20;
/// Target number of particles per piece of the sort.
const PIECE_LEN: usize = 512;
/// Maximum number of pieces of the sort.
const MAX_PIECES: usize = 1 << 14;

/// A row of bins along x.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) z: i32,
    pub(crate) y: i32,
    /// Index of its first bin.
    first: u32,
}

/// A bin with at least one particle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bin {
    pub(crate) x: i32,
    /// Index of its first particle.
    pub(crate) start: u32,
}

/// Sorted particles, see the module.
#[derive(Debug, Default)]
pub(crate) struct Bins {
    size: f32,
    inverse: f32,
    /// All rows, and one more that marks the end of the last one.
    rows: Vec<Row>,
    /// All bins, and one more that marks the end of the last one.
    bins: Vec<Bin>,
    points: Vec<Vec3>,
    /// Index in the frame of each point; empty unless requested.
    indices: Vec<u32>,
    lookup: RowLookup,
    left_out: u64,
}

/// How to find the row at (z, y).
#[derive(Debug, Default)]
enum RowLookup {
    /// By binary search, for rows that are far apart.
    #[default]
    Search,
    /// By a table over the rectangle of all rows.
    Table { low: [i32; 2], width: i32, rows: Vec<u32> },
}

const NO_ROW: u32 = u32::MAX;

/// The cell of `point` in a grid of cells of edge `1 / inverse`.
#[inline(always)]
pub(crate) fn cell_of(point: Vec3, inverse: f32) -> [i32; 3] {
    [point.x, point.y, point.z].map(|x| floor(x * inverse))
}

/// The largest integer not above `x`, without the function call that plain `floor` needs on old processors.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(crate) fn floor(x: f32) -> i32 {
    let cut = x as i32;
    cut - i32::from((cut as f32) > x)
}

#[inline(always)]
fn is_in_range(cell: [i32; 3]) -> bool {
    cell.iter().all(|c| (-MAX_CELL..MAX_CELL).contains(c))
}

/// Sort key of bins: by z, then y, then x.
#[inline(always)]
fn key(cell: [i32; 3]) -> u64 {
    let part = |c: i32| u64::from((c + MAX_CELL).cast_unsigned());
    part(cell[2]) << 42 | part(cell[1]) << 21 | part(cell[0])
}

impl Bins {
    /// Sorts `centers` into bins of edge `size`. Particles of a bin keep their order. With `keep_indices`, their
    /// indices in the frame are stored.
    pub(crate) fn sort(centers: &[Vec3], size: f32, keep_indices: bool) -> Self {
        let inverse = 1.0 / size;
        let (low, high) = cell_bounds(centers, inverse);
        let mut bins = Self {
            size,
            inverse,
            points: vec![Vec3::ZERO; centers.len()],
            indices: vec![0; if keep_indices { centers.len() } else { 0 }],
            ..Self::default()
        };
        // Divide the rows into pieces; one more piece takes the particles out of reach
        let width = i64::from(high[1]) - i64::from(low[1]) + 1;
        let rows = (width * (i64::from(high[2]) - i64::from(low[2]) + 1)).max(1).cast_unsigned();
        let max_pieces = (centers.len() / PIECE_LEN).clamp(1, MAX_PIECES) as u64;
        let rows_each = rows.div_ceil(max_pieces);
        #[expect(clippy::cast_possible_truncation, reason = "at most MAX_PIECES")]
        let pieces = rows.div_ceil(rows_each) as usize;
        #[expect(clippy::cast_possible_truncation, reason = "at most MAX_PIECES")]
        let piece_of = |_: usize, center: Vec3| {
            let cell = cell_of(center, inverse);
            if !is_in_range(cell) {
                return pieces;
            }
            let (z, y) = (i64::from(cell[2] - low[2]), i64::from(cell[1] - low[1]));
            ((z * width + y).cast_unsigned() / rows_each) as usize
        };
        // Scatter the particles into pieces, and sort each piece by bin
        let cells = scatter(centers, pieces + 1, piece_of, &mut bins.points, &mut bins.indices);
        let kept = cells.starts[pieces];
        let mut slices = cells.slices_of(&mut bins.points, &mut bins.indices);
        slices.truncate(pieces);
        let found: Vec<Vec<(u64, u32)>> = slices
            .into_par_iter()
            .zip(&cells.starts[..pieces])
            .map_init(Scratch::default, |scratch, ((points, indices), first)| {
                scratch.sort(points, indices, inverse);
                bins_of(points, inverse, *first)
            })
            .collect();
        // Drop the particles out of reach, and index rows and bins
        bins.left_out = (centers.len() - kept) as u64;
        bins.points.truncate(kept);
        bins.indices.truncate(kept);
        bins.index(&found);
        bins
    }

    /// Creates rows and bins from the keys of all bins with their first particles, in order.
    fn index(&mut self, found: &[Vec<(u64, u32)>]) {
        let count = found.iter().map(Vec::len).sum::<usize>();
        self.bins = Vec::with_capacity(count + 1);
        self.rows = Vec::new();
        let part = |key: u64| (key & ((1 << 21) - 1)) as i32 - MAX_CELL;
        let mut before = None;
        for (key, start) in found.iter().flatten() {
            // Begin a new row if z or y changes
            if before != Some(key >> 21) {
                before = Some(key >> 21);
                let first = index_u32(self.bins.len());
                self.rows.push(Row { z: part(key >> 42), y: part(key >> 21), first });
            }
            self.bins.push(Bin { x: part(*key), start: *start });
        }
        // Append the end markers
        self.lookup = RowLookup::of(&self.rows);
        self.rows.push(Row { z: i32::MAX, y: i32::MAX, first: index_u32(self.bins.len()) });
        self.bins.push(Bin { x: i32::MAX, start: index_u32(self.points.len()) });
    }

    /// Removes all bins for which `is_needed` returns false.
    pub(crate) fn retain(&mut self, is_needed: impl Fn(usize) -> bool) {
        let mut kept = 0;
        let mut found = Vec::new();
        for row in 0..self.row_count() {
            let place = self.rows[row];
            for bin in self.bins_in(row).filter(|bin| is_needed(*bin)) {
                let particles = self.particles_in(bin..bin + 1);
                found.push((key([self.bins[bin].x, place.y, place.z]), index_u32(kept)));
                self.points.copy_within(particles.clone(), kept);
                if !self.indices.is_empty() {
                    self.indices.copy_within(particles.clone(), kept);
                }
                kept += particles.len();
            }
        }
        self.points.truncate(kept);
        self.points.shrink_to_fit();
        self.indices.truncate(kept);
        self.indices.shrink_to_fit();
        self.index(&[found]);
    }

    /// Sorts the particles of each bin by position, so that sums over them do not depend on the order of the file.
    /// Requires indices.
    pub(crate) fn order_by_position(&mut self) {
        // Split points and indices by bin
        let mut tasks = Vec::with_capacity(self.bin_count());
        let (mut points, mut indices) = (&mut self.points[..], &mut self.indices[..]);
        for bins in self.bins.windows(2) {
            let count = (bins[1].start - bins[0].start) as usize;
            let (own_points, others) = points.split_at_mut(count);
            points = others;
            let (own_indices, others) = indices.split_at_mut(count);
            indices = others;
            tasks.push((own_points, own_indices));
        }
        // Sort the particles of each bin by position, then by index
        tasks.into_par_iter().with_min_len(64).for_each_init(
            Vec::new,
            |pairs, (points, indices)| {
                pairs.clear();
                pairs.extend(points.iter().copied().zip(indices.iter().copied()));
                pairs.sort_unstable_by(|a: &(Vec3, u32), b| {
                    let coordinates = a.0.to_array().into_iter().zip(b.0.to_array());
                    let by_position = coordinates
                        .fold(Ordering::Equal, |order, (p, q)| order.then(p.total_cmp(&q)));
                    by_position.then(a.1.cmp(&b.1))
                });
                for ((point, index), sorted) in points.iter_mut().zip(indices).zip(pairs) {
                    (*point, *index) = *sorted;
                }
            },
        );
    }

    /// Edge of a bin.
    pub(crate) fn size(&self) -> f32 {
        self.size
    }

    /// Number of particles that are too far away to be stored.
    pub(crate) fn left_out(&self) -> u64 {
        self.left_out
    }

    /// The particles, in the order of the bins.
    pub(crate) fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// Their indices in the frame; empty unless requested.
    pub(crate) fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// Number of rows.
    pub(crate) fn row_count(&self) -> usize {
        self.rows.len().saturating_sub(1)
    }

    /// Number of bins with particles.
    pub(crate) fn bin_count(&self) -> usize {
        self.bins.len().saturating_sub(1)
    }

    /// The row with an index.
    pub(crate) fn row(&self, row: usize) -> Row {
        self.rows[row]
    }

    /// Indices of the bins of a row.
    #[inline]
    pub(crate) fn bins_in(&self, row: usize) -> Range<usize> {
        self.rows[row].first as usize..self.rows[row + 1].first as usize
    }

    /// The bin with an index.
    #[inline]
    pub(crate) fn bin(&self, bin: usize) -> Bin {
        self.bins[bin]
    }

    /// Indices of the particles in a run of bins.
    #[inline]
    pub(crate) fn particles_in(&self, bins: Range<usize>) -> Range<usize> {
        self.bins[bins.start].start as usize..self.bins[bins.end].start as usize
    }

    /// The cell of a point.
    #[inline]
    pub(crate) fn cell_of(&self, point: Vec3) -> [i32; 3] {
        cell_of(point, self.inverse)
    }

    /// Index of the row at (z, y).
    #[inline]
    pub(crate) fn row_at(&self, z: i32, y: i32) -> Option<usize> {
        match &self.lookup {
            RowLookup::Search => {
                let rows = &self.rows[..self.row_count()];
                rows.binary_search_by_key(&(z, y), |row| (row.z, row.y)).ok()
            }
            RowLookup::Table { low, width, rows } => {
                let (z, y) = (z.wrapping_sub(low[1]), y.wrapping_sub(low[0]));
                if y < 0 || y >= *width || z < 0 {
                    return None;
                }
                let place = z as usize * *width as usize + y as usize;
                let row = *rows.get(place)?;
                (row != NO_ROW).then_some(row as usize)
            }
        }
    }

    /// The bins of the row at (z, y) with x in `xs`.
    #[inline]
    pub(crate) fn run(&self, z: i32, y: i32, xs: Range<i32>) -> Range<usize> {
        let Some(row) = self.row_at(z, y) else {
            return 0..0;
        };
        let all = self.bins_in(row);
        let bins = &self.bins[all.clone()];
        let from = bins.partition_point(|bin| bin.x < xs.start);
        let len = bins[from..].iter().take_while(|bin| bin.x < xs.end).count();
        all.start + from..all.start + from + len
    }

    /// Memory in bytes.
    pub(crate) fn byte_len(&self) -> u64 {
        let lookup = match &self.lookup {
            RowLookup::Search => 0,
            RowLookup::Table { rows, .. } => size_of_val(&rows[..]),
        };
        (size_of_val(&self.rows[..])
            + size_of_val(&self.bins[..])
            + size_of_val(&self.points[..])
            + size_of_val(&self.indices[..])
            + lookup) as u64
    }
}

impl RowLookup {
    fn of(rows: &[Row]) -> Self {
        let bounds = |of: fn(&Row) -> i32| {
            let all = || rows.iter().map(of);
            (all().min().unwrap_or(0), all().max().unwrap_or(0))
        };
        let ((low_y, high_y), (low_z, high_z)) = (bounds(|r| r.y), bounds(|r| r.z));
        let width = high_y - low_y + 1;
        let area = i64::from(width) * i64::from(high_z - low_z + 1);
        // Prefer binary search if a table would be sparse
        if area > 8 * rows.len() as i64 + 4096 {
            return Self::Search;
        }
        let place =
            |row: &Row| (row.z - low_z) as usize * width as usize + (row.y - low_y) as usize;
        #[expect(clippy::cast_possible_truncation, reason = "compared with the rows above")]
        let mut table = vec![NO_ROW; area as usize];
        for (number, row) in (0..).zip(rows) {
            table[place(row)] = number;
        }
        Self::Table { low: [low_y, low_z], width, rows: table }
    }
}

fn cell_bounds(centers: &[Vec3], inverse: f32) -> ([i32; 3], [i32; 3]) {
    let join = |(a, b): ([i32; 3], [i32; 3]), (c, d): ([i32; 3], [i32; 3])| {
        (std::array::from_fn(|i| a[i].min(c[i])), std::array::from_fn(|i| b[i].max(d[i])))
    };
    let none = ([i32::MAX; 3], [i32::MIN; 3]);
    let (low, high) = centers
        .par_chunks(1 << 16)
        .map(|chunk| {
            let cells = chunk.iter().map(|center| cell_of(*center, inverse));
            cells.filter(|cell| is_in_range(*cell)).fold(none, |all, cell| join(all, (cell, cell)))
        })
        .reduce(|| none, join);
    if low[0] > high[0] { ([0; 3], [0; 3]) } else { (low, high) }
}

/// Buffers of one thread for sorting pieces.
#[derive(Default)]
struct Scratch {
    /// Key of the bin and index before the sort, for each particle.
    keyed: Vec<(u64, u32)>,
    /// Number of particles before each bin.
    starts: Vec<u32>,
    points: Vec<Vec3>,
    indices: Vec<u32>,
}

impl Scratch {
    /// Sorts a piece by bin; the sort is stable.
    fn sort(&mut self, points: &mut [Vec3], indices: &mut [u32], inverse: f32) {
        // Sort the keys of the particles
        self.keyed.clear();
        let keys = points.iter().map(|point| key(cell_of(*point, inverse)));
        self.keyed.extend(keys.zip(0..));
        self.points.clear();
        self.points.extend_from_slice(points);
        self.indices.clear();
        self.indices.extend_from_slice(indices);
        if !self.counting_sort() {
            self.keyed.sort_unstable();
        }
        // Move points and indices into the sorted order
        for (point, (_, place)) in points.iter_mut().zip(&self.keyed) {
            *point = self.points[*place as usize];
        }
        for (index, (_, place)) in indices.iter_mut().zip(&self.keyed) {
            *index = self.indices[*place as usize];
        }
    }

    /// Sorts the keys by counting if their range is small; returns whether it was.
    fn counting_sort(&mut self) -> bool {
        let all = || self.keyed.iter().map(|(key, _)| *key);
        let (Some(low), Some(high)) = (all().min(), all().max()) else {
            return true;
        };
        // Give up on a large range, as of a piece with several rows
        let span = high - low;
        if span > 4 * self.keyed.len() as u64 {
            return false;
        }
        #[expect(clippy::cast_possible_truncation, reason = "compared above")]
        let place = |key: u64| (key - low) as usize;
        // Count the keys of each bin, and sum the counts up to the start of each bin
        self.starts.clear();
        self.starts.resize(place(high) + 2, 0);
        for (key, _) in &self.keyed {
            self.starts[place(*key) + 1] += 1;
        }
        for bin in 1..self.starts.len() {
            self.starts[bin] += self.starts[bin - 1];
        }
        // Move each key to its bin
        let mut sorted = vec![(0, 0); self.keyed.len()];
        for entry in &self.keyed {
            let next = &mut self.starts[place(entry.0)];
            sorted[*next as usize] = *entry;
            *next += 1;
        }
        self.keyed = sorted;
        true
    }
}

/// Key and first particle of each bin of a sorted piece; `first` is the index of the first particle of the piece.
fn bins_of(points: &[Vec3], inverse: f32, first: usize) -> Vec<(u64, u32)> {
    let mut bins: Vec<(u64, u32)> = Vec::new();
    for (number, point) in (first..).zip(points) {
        let key = key(cell_of(*point, inverse));
        if bins.last().is_none_or(|(last, _)| *last != key) {
            bins.push((key, index_u32(number)));
        }
    }
    bins
}
