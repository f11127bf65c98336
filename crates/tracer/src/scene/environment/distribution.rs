//! A piecewise-constant distribution over the cells of a table, sampled by inversion: first the row, then the column
//! (Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, A.5.6). A guide table of start indices
//! replaces binary search (Chen and Asau, 1974).

/// Entries of a guide table per cumulative distribution.
const GUIDES: usize = 128;

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Distribution {
    columns: usize,
    /// Cumulative probability at the end of each row.
    rows: Vec<f32>,
    row_guide: Vec<u16>,
    /// Cumulative probability at the end of each column, row by row, given the row.
    cells: Vec<f32>,
    cell_guide: Vec<u16>,
}

/// A cell, and a position in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    pub(super) column: usize,
    pub(super) row: usize,
    /// In 0..1, from the left of the cell.
    pub(super) across: f32,
    /// In 0..1, from the top of the cell.
    pub(super) down: f32,
}

impl Distribution {
    /// The distribution of cells with positive `weights`, row by row.
    pub(super) fn new(columns: usize, weights: &[f64]) -> Self {
        let sums: Vec<f64> = weights.chunks(columns).map(|row| row.iter().sum()).collect();
        let rows = cumulative(&sums);
        let cells: Vec<f32> = weights.chunks(columns).flat_map(cumulative).collect();
        Self {
            columns,
            row_guide: guide(&rows),
            cell_guide: cells.chunks(columns).flat_map(guide).collect(),
            rows,
            cells,
        }
    }

    /// Memory, bytes.
    pub(super) fn byte_len(&self) -> u64 {
        let tables = size_of_val(&*self.rows) + size_of_val(&*self.cells);
        let guides = size_of_val(&*self.row_guide) + size_of_val(&*self.cell_guide);
        (tables + guides) as u64
    }

    /// The probability with which [`Self::sample`] chooses a cell.
    pub(super) fn probability(&self, column: usize, row: usize) -> f64 {
        let interval = |ends: &[f32], cell: usize| {
            let low = if cell == 0 { 0.0 } else { ends[cell - 1] };
            f64::from(ends[cell]) - f64::from(low)
        };
        interval(&self.rows, row) * interval(self.row(row), column)
    }

    /// The cell of `u`, whose components are in 0..1.
    #[inline(always)]
    pub(super) fn sample(&self, u: [f32; 2]) -> Cell {
        let (row, down) = invert(&self.rows, &self.row_guide, u[1]);
        let guide = &self.cell_guide[row * GUIDES..(row + 1) * GUIDES];
        let (column, across) = invert(self.row(row), guide, u[0]);
        Cell { column, row, across, down }
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[f32] {
        &self.cells[row * self.columns..(row + 1) * self.columns]
    }
}

/// Cumulative probabilities of `weights`; the last is exactly 1.
fn cumulative(weights: &[f64]) -> Vec<f32> {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    let mut ends: Vec<f32> = weights
        .iter()
        .map(|weight| {
            sum += weight;
            super::narrow((sum / total).min(1.0))
        })
        .collect();
    if let Some(last) = ends.last_mut() {
        *last = 1.0;
    }
    ends
}

/// For each of [`GUIDES`] equal intervals of 0..1, the first cell that ends after the start of the interval.
fn guide(ends: &[f32]) -> Vec<u16> {
    let first = |interval: usize| {
        let start = interval as f32 / GUIDES as f32;
        let cell = ends.partition_point(|end| *end <= start);
        u16::try_from(cell.min(ends.len() - 1)).expect("tables have fewer than 65536 columns")
    };
    (0..GUIDES).map(first).collect()
}

/// The cell of `u` and the position in it, in 0..1.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn invert(ends: &[f32], guide: &[u16], u: f32) -> (usize, f32) {
    // Start at the guide, and step to the first cell that ends after `u`
    let interval = (u * GUIDES as f32) as usize;
    let last = guide.len() - 1;
    let mut cell = usize::from(guide[if interval < last { interval } else { last }]);
    while cell + 1 < ends.len() && ends[cell] <= u {
        cell += 1;
    }
    // Compute the position in the cell
    let low = if cell == 0 { 0.0 } else { ends[cell - 1] };
    let position = (u - low) / (ends[cell] - low);
    let position = if position > 0.0 { position } else { 0.0 };
    let below_one = 1.0 - 0.5 * f32::EPSILON;
    (cell, if position < below_one { position } else { below_one })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares of cells, from stratified samples.
    fn shares(distribution: &Distribution, count: usize, side: u16) -> Vec<f64> {
        let mut shares = vec![0.0; count];
        for i in 0..u32::from(side) * u32::from(side) {
            let unit = |k: u32| (k as f32 + 0.5) / f32::from(side);
            let u = [unit(i % u32::from(side)), unit(i / u32::from(side))];
            let cell = distribution.sample(u);
            assert!((0.0..1.0).contains(&cell.across) && (0.0..1.0).contains(&cell.down));
            shares[cell.row * distribution.columns + cell.column] += f64::from(side).powi(-2);
        }
        shares
    }

    #[test]
    fn cells_are_chosen_by_weight() {
        let weights = [1.0, 2.0, 1e-12, 4.0, 0.5, 0.5, 8.0, 1e-12];
        let distribution = Distribution::new(4, &weights);
        let total: f64 = weights.iter().sum();
        let shares = shares(&distribution, 8, 512);
        for (cell, (share, weight)) in shares.iter().zip(weights).enumerate() {
            assert!((share - weight / total).abs() < 4e-3, "{cell}: {share}");
            let probability = distribution.probability(cell % 4, cell / 4);
            assert!((probability - weight / total).abs() < 1e-7, "{cell}");
        }
    }

    #[test]
    fn the_ends_of_the_unit_square_are_cells() {
        let distribution = Distribution::new(3, &[1.0; 6]);
        let below_one = 1.0 - 0.5 * f32::EPSILON;
        let first = distribution.sample([0.0, 0.0]);
        assert_eq!((first.column, first.row, first.across), (0, 0, 0.0));
        let last = distribution.sample([below_one, below_one]);
        assert_eq!((last.column, last.row), (2, 1));
        for u in [f32::NAN, -1.0, 2.0] {
            let cell = distribution.sample([u, u]);
            assert!(cell.column < 3 && cell.row < 2 && cell.down < 1.0);
        }
    }
}
