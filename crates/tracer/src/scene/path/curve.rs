//! Cubic interpolation that never leaves the range of the two adjacent values.
//!
//! The slopes at the values follow M. Steffen, "A simple method for monotonic interpolation in one dimension",
//! Astronomy and Astrophysics 239 (1990): the slope of the parabola through three values, limited so that the cubics
//! on both sides are monotone, and 0 at extrema.

/// Slope at a value between two segments of the curve: `before` and `after` are the slopes of the straight lines (eq.
/// 11 of the paper), `gaps` the lengths of the segments.
pub(super) fn slope(before: f64, after: f64, gaps: [f64; 2]) -> f64 {
    if before == 0.0 || after == 0.0 || (before > 0.0) != (after > 0.0) {
        return 0.0;
    }
    let weight = gaps[1] / (gaps[0] + gaps[1]);
    let parabola = before * weight + after * (1.0 - weight);
    let steepest = before.abs().min(after.abs());
    2.0 * steepest.min(0.5 * parabola.abs()).copysign(before)
}

/// The cubic at `t` in 0..1 between the values `ends`, with the `slopes` at both ends per segment (not per frame).
pub(super) fn cubic(ends: [f64; 2], slopes: [f64; 2], t: f64) -> f64 {
    let [from, to] = ends;
    let rest = 1.0 - t;
    let line = from + (to - from) * (t * t * (3.0 - 2.0 * t));
    let bent = line + t * rest * (slopes[0] * rest - slopes[1] * t);
    // Rounding alone could leave the range.
    bent.clamp(from.min(to), from.max(to))
}
