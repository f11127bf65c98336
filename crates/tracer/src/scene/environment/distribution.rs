//! A piecewise-constant distribution over the cells of a square, sampled by inversion: first the row, then the column
//! (Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, A.5.6). The search takes the same number of
//! steps for all numbers, so that loops over lanes vectorise, and is monotone: strata stay together.

use spherule_tree::math::narrow;

/// See the module. `SIDE` is a power of two, and `COUNT` its square: lengths that the compiler knows make it drop the
/// checks of bounds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Distribution<const SIDE: usize, const COUNT: usize> {
    /// Cumulative probability at the end of each row.
    rows: Box<[f32; SIDE]>,
    /// Cumulative probability at the end of each column, row by row, given the row.
    cells: Box<[f32; COUNT]>,
}

/// A cell, and a position in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    /// Index of the cell, row by row.
    pub(super) index: u32,
    /// Position from the left, in cells.
    pub(super) x: f32,
    /// Position from the top, in cells.
    pub(super) y: f32,
}

impl<const SIDE: usize, const COUNT: usize> Distribution<SIDE, COUNT> {
    /// The distribution of cells with `weights`, row by row, whose sum is positive in each row.
    pub(super) fn new(weights: &[f64]) -> Self {
        const { assert!(SIDE.is_power_of_two() && COUNT == SIDE * SIDE && SIDE <= 1 << 12) };
        let sums: Vec<f64> = weights.chunks(SIDE).map(|row| row.iter().sum()).collect();
        let cells = weights.chunks(SIDE).flat_map(cumulative).collect();
        Self { rows: boxed(cumulative(&sums)), cells: boxed(cells) }
    }

    /// Memory, bytes.
    pub(super) const fn byte_len() -> u64 {
        (size_of::<[f32; SIDE]>() + size_of::<[f32; COUNT]>()) as u64
    }

    /// Cumulative probabilities of the rows, and of the cells in each.
    pub(super) const fn ends(&self) -> [&[f32]; 2] {
        [&*self.rows, &*self.cells]
    }

    /// The probability with which [`Self::sample`] chooses the cell at `index`.
    pub(super) fn probability(&self, index: usize) -> f64 {
        let interval = |ends: &[f32], cell: usize| {
            let low = if cell == 0 { 0.0 } else { ends[cell - 1] };
            f64::from(ends[cell]) - f64::from(low)
        };
        let (row, column) = (index / SIDE, index % SIDE);
        let cells = &self.cells[row * SIDE..(row + 1) * SIDE];
        interval(&*self.rows, row) * interval(cells, column)
    }

    /// The cell of `u`, whose components are in 0..1.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "sides are short")]
    #[expect(clippy::cast_possible_wrap, reason = "indices are small; conversions are faster")]
    pub(super) fn sample(&self, u: [f32; 2]) -> Cell {
        let (row, down) = invert::<SIDE, SIDE>(&self.rows, 0, u[1]);
        let (index, across) = invert::<SIDE, COUNT>(&self.cells, row * SIDE as u32, u[0]);
        let column = index & (SIDE as u32 - 1);
        Cell { index, x: column as i32 as f32 + across, y: row as i32 as f32 + down }
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
            narrow((sum / total).min(1.0))
        })
        .collect();
    if let Some(last) = ends.last_mut() {
        *last = 1.0;
    }
    ends
}

/// The elements of a vector of this length.
pub(super) fn boxed<T, const LENGTH: usize>(values: Vec<T>) -> Box<[T; LENGTH]> {
    let values = values.into_boxed_slice().try_into();
    values.unwrap_or_else(|_| unreachable!("tables have one value per cell"))
}

/// The index of the interval that contains `u` among those that end at `ends[first..first + SIDE]`, and the position
/// in it, in 0..1. `first` is a multiple of `SIDE`.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "sides are short")]
fn invert<const SIDE: usize, const COUNT: usize>(
    ends: &[f32; COUNT],
    first: u32,
    u: f32,
) -> (u32, f32) {
    // Halve the range of intervals until one is left, whose ends are known then
    let (mut index, mut low, mut high) = (first, 0.0, 1.0);
    let mut step = SIDE as u32 / 2;
    while step > 0 {
        // The mask changes nothing but shows that the index is in bounds
        let end = ends[(index + (step - 1)) as usize & (COUNT - 1)];
        let is_behind = end <= u;
        index = if is_behind { index + step } else { index };
        low = if is_behind { end } else { low };
        high = if is_behind { high } else { end };
        step /= 2;
    }
    // Compute the position in the interval
    let position = (u - low) / (high - low);
    let position = if position > 0.0 { position } else { 0.0 };
    let below_one = 1.0 - 0.5 * f32::EPSILON;
    (index, if position < below_one { position } else { below_one })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares of cells, from stratified samples.
    fn shares(distribution: &Distribution<4, 16>, side: u16) -> Vec<f64> {
        let mut shares = vec![0.0; 16];
        for i in 0..u32::from(side) * u32::from(side) {
            let unit = |k: u32| (k as f32 + 0.5) / f32::from(side);
            let u = [unit(i % u32::from(side)), unit(i / u32::from(side))];
            let cell = distribution.sample(u);
            let (column, row) = (cell.index % 4, cell.index / 4);
            assert!((column as f32..(column + 1) as f32).contains(&cell.x), "{cell:?}");
            assert!((row as f32..(row + 1) as f32).contains(&cell.y), "{cell:?}");
            shares[cell.index as usize] += f64::from(side).powi(-2);
        }
        shares
    }

    #[test]
    fn cells_are_chosen_by_weight() {
        let mut weights = vec![1.0, 2.0, 1e-12, 4.0, 0.5, 0.5, 8.0, 1e-12, 0.0, 0.0, 3.0, 0.0];
        weights.extend([1e-12; 4]);
        let distribution = Distribution::<4, 16>::new(&weights);
        let total: f64 = weights.iter().sum();
        let shares = shares(&distribution, 512);
        for (cell, (share, weight)) in shares.iter().zip(weights).enumerate() {
            assert!((share - weight / total).abs() < 4e-3, "{cell}: {share}");
            let probability = distribution.probability(cell);
            assert!((probability - weight / total).abs() < 1e-7, "{cell}");
            assert!(weight > 0.0 || *share == 0.0, "{cell}");
        }
    }

    #[test]
    fn positions_rise_with_the_numbers() {
        let weights: Vec<f64> = (0..256_u16).map(|i| f64::from(i * 37 % 11)).collect();
        let distribution = Distribution::<16, 256>::new(&weights);
        let mut before = 0.0;
        for i in 0..10_000_u16 {
            let u = f32::from(i) / 10_000.0;
            let y = distribution.sample([0.5, u]).y;
            assert!(y >= before, "{u}");
            before = y;
        }
    }

    #[test]
    fn the_ends_of_the_unit_square_are_cells() {
        let distribution = Distribution::<4, 16>::new(&[1.0; 16]);
        let below_one = 1.0 - 0.5 * f32::EPSILON;
        let first = distribution.sample([0.0, 0.0]);
        assert_eq!((first.index, first.x, first.y), (0, 0.0, 0.0));
        assert_eq!(distribution.sample([below_one, below_one]).index, 15);
        for u in [f32::NAN, -1.0, 2.0] {
            let cell = distribution.sample([u, u]);
            assert!(cell.index < 16 && cell.x <= 4.0 && cell.y <= 4.0, "{cell:?}");
        }
    }
}
