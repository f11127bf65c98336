//! A series in the form in which it is drawn: thinned, and split at gaps.

use super::{Line, Plot, Series};

/// Maximum number of points, about one per unit of width. Longer series are divided into half as many intervals, and
/// the smallest and the largest value of each are kept.
const MAX_POINTS: usize = 800;
/// Maximum number of markers; longer series have markers at some points only.
const MAX_MARKERS: usize = 24;

/// A series in positions of its axes, split at gaps.
pub(super) struct Drawn<'a> {
    pub(super) name: &'a str,
    pub(super) hue: usize,
    pub(super) line: Line,
    pub(super) pieces: Vec<Vec<(f64, f64)>>,
}

impl<'a> Drawn<'a> {
    pub(super) fn new(plot: &Plot, series: &'a Series, hue: usize) -> Self {
        let points = series.points.iter().map(|(x, y)| (plot.x.place(*x), plot.y.place(*y)));
        let placed = thinned(points.collect());
        let pieces = placed
            .split(|point| !is_finite(*point))
            .filter(|piece| !piece.is_empty())
            .map(<[_]>::to_vec)
            .collect();
        Self { name: &series.name, hue, line: series.line, pieces }
    }

    pub(super) fn point_count(&self) -> usize {
        self.pieces.iter().map(Vec::len).sum()
    }

    /// Positions of markers: all isolated points, and some of many connected ones.
    pub(super) fn marked(&self) -> Vec<(f64, f64)> {
        let joined = self.line != Line::None;
        let every = if joined { self.point_count().div_ceil(MAX_MARKERS).max(1) } else { 1 };
        let mut marked = Vec::new();
        let mut place = 0;
        for piece in &self.pieces {
            for point in piece {
                if place % every == 0 || piece.len() == 1 {
                    marked.push(*point);
                }
                place += 1;
            }
        }
        marked
    }
}

fn is_finite((x, y): (f64, f64)) -> bool {
    x.is_finite() && y.is_finite()
}

/// Reduces a long series to the smallest and the largest value of each section, in their order. A
/// section without values remains a gap.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= MAX_POINTS {
        return points;
    }
    let stretches = MAX_POINTS / 2;
    let mut kept = Vec::with_capacity(MAX_POINTS);
    for i in 0..stretches {
        let range = i * points.len() / stretches..(i + 1) * points.len() / stretches;
        let of = |index: &usize| points[*index].1;
        let present = range.filter(|index| is_finite(points[*index]));
        let least = present.clone().min_by(|a, b| of(a).total_cmp(&of(b)));
        let most = present.max_by(|a, b| of(a).total_cmp(&of(b)));
        match (least, most) {
            (Some(a), Some(b)) if a == b => kept.push(points[a]),
            (Some(a), Some(b)) => kept.extend([points[a.min(b)], points[a.max(b)]]),
            _ => kept.push((f64::NAN, f64::NAN)),
        }
    }
    kept
}
