//! Cuts a space-filling curve into parts of a given size, and locates particles on it.

use glam::Vec3;
use rayon::prelude::*;

use crate::order::curve::{AXIS_BITS, CurveState, Grid, TopCells, hilbert};

/// Bits of a curve position below those of the top cells.
const LOWER_BITS: u32 = 3 * (AXIS_BITS - TopCells::MAX_LEVELS);

/// A space-filling curve over the bulk of some particles. Particles outside the bulk are clamped to its border.
#[derive(Debug)]
pub(super) struct Curve {
    grid: Grid,
    top: TopCells,
}

impl Curve {
    /// The curve over the bulk of `sample`: the box from the 1st to the 99th percentile, enlarged by half.
    pub(super) fn over(sample: &[Vec3]) -> Self {
        let (min, max) = bulk(sample);
        let grid = Grid::new(min, max - min);
        let top = TopCells::new(grid, TopCells::MAX_LEVELS);
        Self { grid, top }
    }

    /// The curve position of `position`, 63 bits.
    #[inline]
    pub(super) fn place(&self, position: Vec3) -> u64 {
        hilbert(self.grid.morton(position), 0, AXIS_BITS, CurveState::default()).0
    }

    /// The cell of `position`: the highest bits of its curve position, cheap to compute.
    #[inline]
    pub(super) fn cell(&self, position: Vec3) -> usize {
        self.top.cell_of(position)
    }

    /// Cells that [`Self::cell`] distinguishes.
    pub(super) fn cells(&self) -> usize {
        self.top.len()
    }
}

/// The bounding box of the bulk, or of all particles if the bulk is one point.
fn bulk(sample: &[Vec3]) -> (Vec3, Vec3) {
    let Some(last) = sample.len().checked_sub(1) else {
        return (Vec3::ZERO, Vec3::ZERO);
    };
    // Compute the box without the `trimmed` smallest and largest values of each axis
    let ends = |trimmed: usize| {
        let of_axis = |axis: usize| {
            let mut values: Vec<f32> = sample.iter().map(|p| p[axis]).collect();
            let low = *values.select_nth_unstable_by(trimmed, f32::total_cmp).1;
            let high = *values.select_nth_unstable_by(last - trimmed, f32::total_cmp).1;
            [low, high]
        };
        let [x, y, z] = [0, 1, 2].map(of_axis);
        let low = Vec3::new(x[0], y[0], z[0]);
        let high = Vec3::new(x[1], y[1], z[1]);
        (low, high)
    };
    // Enlarge the box between the percentiles
    let (low, high) = ends(sample.len() / 100);
    if low == high {
        return ends(0);
    }
    let margin = 0.25 * (high - low);
    (low - margin, high + margin)
}

/// A curve that is cut into parts.
#[derive(Debug)]
pub(super) struct Cuts {
    pub(super) curve: Curve,
    /// The first curve position of each part except the first, in increasing order.
    starts: Vec<u64>,
    /// For each top cell, the part that contains the whole cell, or [`MIXED`].
    parts: Vec<u16>,
}

/// Marks a top cell with several parts.
const MIXED: u16 = u16::MAX;

impl Cuts {
    /// Cuts the curve over `sample` into at most `parts` parts with equally many samples each. Coincident
    /// particles can make the number of parts smaller.
    pub(super) fn quantiles(sample: &[Vec3], parts: usize) -> Self {
        // Sort the samples along the curve
        let curve = Curve::over(sample);
        let mut places: Vec<u64> = sample.par_iter().map(|p| curve.place(*p)).collect();
        places.par_sort_unstable();
        // Cut at the quantiles
        let mut starts: Vec<u64> = (1..parts)
            .filter_map(|part| places.get(part * places.len() / parts).copied())
            .collect();
        starts.dedup();
        // A cut at the first sample would make an empty part.
        starts.retain(|start| Some(start) > places.first());
        // Find the cells that are in one part
        let part_of = |place: u64| starts.partition_point(|start| *start <= place);
        let of_cell = |cell: usize| {
            let first = (cell as u64) << LOWER_BITS;
            let (low, high) = (part_of(first), part_of(first | ((1 << LOWER_BITS) - 1)));
            let part = u16::try_from(low).ok().filter(|_| low == high);
            part.unwrap_or(MIXED)
        };
        let parts = (0..curve.cells()).map(of_cell).collect();
        Self { curve, starts, parts }
    }

    /// Number of parts.
    pub(super) fn len(&self) -> usize {
        self.starts.len() + 1
    }

    /// The part that contains `position`.
    #[inline]
    pub(super) fn part(&self, position: Vec3) -> usize {
        let part = self.parts[self.curve.cell(position)];
        if part != MIXED {
            return usize::from(part);
        }
        let place = self.curve.place(position);
        self.starts.partition_point(|start| *start <= place)
    }
}
