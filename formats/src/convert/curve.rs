//! Where to cut a space-filling curve so that parts are of a wanted size, and where particles are on it.

use glam::Vec3;
use rayon::prelude::*;

use crate::order::curve::{AXIS_BITS, CurveState, Grid, TopCells, hilbert};

/// Bits of a curve position below those of the top cells.
const LOWER_BITS: u32 = 3 * (AXIS_BITS - TopCells::MAX_LEVELS);

/// The curve over the bulk of some particles: those that escaped are at its border.
#[derive(Debug)]
pub(super) struct Curve {
    grid: Grid,
    top: TopCells,
}

impl Curve {
    /// Over the bulk of `sample`: from the 1st to the 99th percentile and half as much again.
    pub(super) fn over(sample: &[Vec3]) -> Self {
        let (min, max) = bulk(sample);
        let grid = Grid::new(min, max - min);
        let top = TopCells::new(grid, TopCells::MAX_LEVELS);
        Self { grid, top }
    }

    /// The curve position of `position`, 63 bits.
    #[inline]
    pub(super) fn place(&self, position: Vec3) -> u64 {
        hilbert(
            self.grid.morton(position),
            0,
            AXIS_BITS,
            CurveState::default(),
        )
        .0
    }

    /// The highest bits of the curve position, at little cost.
    #[inline]
    pub(super) fn cell(&self, position: Vec3) -> usize {
        self.top.cell_of(position)
    }

    /// Cells that [`Self::cell`] distinguishes.
    pub(super) fn cells(&self) -> usize {
        self.top.len()
    }
}

/// The box of the bulk; of everything where the bulk is one point.
fn bulk(sample: &[Vec3]) -> (Vec3, Vec3) {
    let Some(last) = sample.len().checked_sub(1) else {
        return (Vec3::ZERO, Vec3::ZERO);
    };
    let ends = |trimmed: usize| {
        let of_axis = |axis: usize| {
            let mut values: Vec<f32> = sample.iter().map(|p| p[axis]).collect();
            let low = *values.select_nth_unstable_by(trimmed, f32::total_cmp).1;
            let high = *values
                .select_nth_unstable_by(last - trimmed, f32::total_cmp)
                .1;
            [low, high]
        };
        let [x, y, z] = [0, 1, 2].map(of_axis);
        let low = Vec3::new(x[0], y[0], z[0]);
        let high = Vec3::new(x[1], y[1], z[1]);
        (low, high)
    };
    let (low, high) = ends(sample.len() / 100);
    if low == high {
        return ends(0);
    }
    let margin = 0.25 * (high - low);
    (low - margin, high + margin)
}

/// Parts of a curve.
#[derive(Debug)]
pub(super) struct Cuts {
    pub(super) curve: Curve,
    /// Where each part but the first begins; increasing.
    starts: Vec<u64>,
    /// For each top cell the part that all of it is in, or [`MIXED`].
    parts: Vec<u16>,
}

/// A top cell with several parts.
const MIXED: u16 = u16::MAX;

impl Cuts {
    /// Cuts the curve over `sample` into up to `parts` parts with as many of the sample in each. There are fewer
    /// where particles coincide.
    pub(super) fn quantiles(sample: &[Vec3], parts: usize) -> Self {
        let curve = Curve::over(sample);
        let mut places: Vec<u64> = sample.par_iter().map(|p| curve.place(*p)).collect();
        places.par_sort_unstable();
        let mut starts: Vec<u64> = (1..parts)
            .filter_map(|part| places.get(part * places.len() / parts).copied())
            .collect();
        starts.dedup();
        // Nothing is before the first of all.
        starts.retain(|start| Some(start) > places.first());
        let part_of = |place: u64| starts.partition_point(|start| *start <= place);
        let of_cell = |cell: usize| {
            let first = (cell as u64) << LOWER_BITS;
            let (low, high) = (part_of(first), part_of(first | ((1 << LOWER_BITS) - 1)));
            let part = u16::try_from(low).ok().filter(|_| low == high);
            part.unwrap_or(MIXED)
        };
        let parts = (0..curve.cells()).map(of_cell).collect();
        Self {
            curve,
            starts,
            parts,
        }
    }

    /// Parts.
    pub(super) fn len(&self) -> usize {
        self.starts.len() + 1
    }

    /// The part that `position` is in.
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
