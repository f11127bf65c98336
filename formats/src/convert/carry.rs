//! Keeps each node within one part: particles that do not fill a whole node move to the next part.

use glam::Vec3;
use rayon::prelude::*;

use super::curve::Curve;
use super::order::PartData;

/// Particles that one task counts.
const TASK: usize = 1 << 16;

/// Removes the particles of `part` beyond a multiple of `unit`, the last ones on `curve`. The next part begins there.
pub(super) fn carry_last(
    part: &mut PartData,
    curve: &Curve,
    width: usize,
    unit: usize,
) -> PartData {
    let count = part.len() % unit;
    let mut carried = last_on(&part.positions, curve, count);
    carried.sort_unstable();
    part.take(&carried, width)
}

/// The indices of the `count` particles that are last on the curve.
#[expect(clippy::cast_possible_truncation, reason = "a part has fewer than 2^32 particles")]
fn last_on(positions: &[Vec3], curve: &Curve, count: usize) -> Vec<u32> {
    if count == 0 {
        return Vec::new();
    }
    let counts = count_cells(positions, curve);
    // Find the cell of the first of these particles; all particles of later cells belong to them too
    let (mut cell, mut behind) = (counts.len() - 1, 0);
    while behind + counts[cell] < count {
        behind += counts[cell];
        cell -= 1;
    }
    // Collect the particles of this cell and of later cells
    let is_among = |(number, position): (usize, &Vec3)| {
        (curve.cell(*position) >= cell).then_some(number as u32)
    };
    let numbered = positions.par_iter().enumerate().with_min_len(TASK);
    let among: Vec<u32> = numbered.filter_map(is_among).collect();
    let cell_of = |number: &u32| curve.cell(positions[*number as usize]);
    let (mut last, mut own): (Vec<u32>, Vec<u32>) =
        among.into_iter().partition(|number| cell_of(number) > cell);
    // Sort the particles of the cell, unless there are too many
    let needed = count - behind;
    let rest = own.len() - needed;
    if rest > 0 && own.len() <= positions.len() / 8 {
        let place = |number: &u32| (curve.place(positions[*number as usize]), *number);
        let mut places: Vec<(u64, u32)> = own.par_iter().map(place).collect();
        places.select_nth_unstable(rest);
        own = places.into_iter().map(|(_, number)| number).collect();
    }
    // In a very full cell, any particles do: they are too close together to matter, and too many to sort.
    last.extend(&own[rest..]);
    last
}

/// Particles in each cell of the curve.
fn count_cells(positions: &[Vec3], curve: &Curve) -> Vec<usize> {
    let counted = |positions: &[Vec3]| {
        let mut counts = vec![0_usize; curve.cells()];
        positions.iter().for_each(|p| counts[curve.cell(*p)] += 1);
        counts
    };
    let sum = |mut a: Vec<usize>, b: Vec<usize>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    };
    let none = || vec![0; curve.cells()];
    positions.par_chunks(TASK).map(counted).reduce(none, sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{BoxSettings, fill_box};
    use crate::native::tests::clustered;

    /// Each particle of `all` is in exactly one of `parts`, with its own row, which holds its index.
    #[track_caller]
    fn assert_complete(all: &[Vec3], parts: [&PartData; 2]) {
        let mut visited = vec![false; all.len()];
        for part in parts {
            assert_eq!(part.rows.len(), 4 * part.len());
            for (position, row) in part.positions.iter().zip(part.rows.as_chunks().0) {
                let number = u32::from_le_bytes(*row) as usize;
                assert_eq!(all[number], *position);
                assert!(!std::mem::replace(&mut visited[number], true));
            }
        }
        assert!(visited.into_iter().all(|s| s));
    }

    #[test]
    fn samples_include_the_end_of_the_curve() {
        let coincident = vec![Vec3::splat(2.0); 3000];
        for all in [clustered(10_000), clustered(700), clustered(2048), coincident] {
            let curve = Curve::over(&all);
            let (part, carried) = carried_of(&all, &curve);
            // In a very full cell, any particles may be carried.
            let cells = |part: &PartData| -> Vec<usize> {
                part.positions.iter().map(|p| curve.cell(*p)).collect()
            };
            let (before, after) = (cells(&part), cells(&carried));
            assert!(before.iter().max() <= after.iter().min() || after.is_empty());
        }
        let even = fill_box(&BoxSettings::thesis(10_000, 1));
        let curve = Curve::over(&even);
        let (part, carried) = carried_of(&even, &curve);
        let places = |part: &PartData| -> Vec<u64> {
            part.positions.iter().map(|p| curve.place(*p)).collect()
        };
        assert!(places(&part).iter().max() <= places(&carried).iter().min());
    }

    /// The particles that stay and the particles that are carried.
    #[track_caller]
    fn carried_of(all: &[Vec3], curve: &Curve) -> (PartData, PartData) {
        let mut part = PartData {
            rows: (0..).take(all.len()).flat_map(u32::to_le_bytes).collect(),
            positions: all.to_vec(),
        };
        let carried = carry_last(&mut part, curve, 4, 1024);
        assert_eq!((part.len() % 1024, carried.len()), (0, all.len() % 1024));
        assert_complete(all, [&part, &carried]);
        (part, carried)
    }
}
