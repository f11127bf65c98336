//! Finds where rays cross the surface within a voxel.
//!
//! Along a ray, a trilinear field is a cubic polynomial (Parker et al. 1998; Marmitt et al. 2004).

#![expect(clippy::needless_range_loop, reason = "loops over lanes, each of many arrays")]

use spherule_tree::math::{Integers, LANES, Lanes, Lanes3, splat};

/// Iterations in a bracket; false position with Illinois steps gains more than one digit per iteration.
const ROUNDS: usize = 6;
/// The search ends at this distance from the threshold, in codes.
const TOLERANCE: f32 = 0.5;

/// The segment of each ray inside a voxel, in voxels from its corner.
#[derive(Default)]
#[repr(C, align(64))]
pub(super) struct Segments {
    pub(super) from: Lanes3,
    /// Vector from the start of the segment to its end.
    pub(super) along: Lanes3,
    /// 1 for a ray that is outside (lower values), -1 for a ray that is inside.
    pub(super) sign: Lanes,
}

/// Finds the first crossing of each segment: the fraction of its length at which the field reaches `threshold`. The
/// field is given by its values at the `corners` of the voxels. A ray that starts beyond the surface crosses it at 0.
/// The first result is the mask of the rays of `lanes` that cross the surface.
#[inline(always)]
pub(super) fn first_roots(
    corners: &[Integers; 8],
    segments: &Segments,
    threshold: f32,
    lanes: u32,
) -> (u32, Lanes) {
    let mut cubic = Cubic([splat(0.0); 4]);
    let mut bracket = Bracket::default();
    let mut crossed = 0;
    for l in 0..LANES {
        let c = cubic_along(corners, segments, threshold, l);
        // Bracket the first root
        let g = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|s| value(&c, s));
        let peak = maximum(&c);
        let at_peak = value(&c, peak);
        let (low, high, at_low, at_high) = if g[0] >= 0.0 {
            (0.0, 0.0, 0.0, 0.0)
        } else if g[1] >= 0.0 {
            (0.0, 1.0 / 3.0, g[0], g[1])
        } else if g[2] >= 0.0 {
            (1.0 / 3.0, 2.0 / 3.0, g[1], g[2])
        } else if g[3] >= 0.0 {
            (2.0 / 3.0, 1.0, g[2], g[3])
        } else {
            // The field exceeds the threshold between two samples
            (0.0, peak, g[0], at_peak)
        };
        // Store the polynomial and the bracket of the lane
        crossed |= u32::from(at_high >= 0.0) << l;
        for (of_all, of_this) in cubic.0.iter_mut().zip(c) {
            of_all[l] = of_this;
        }
        bracket.low[l] = low;
        bracket.high[l] = high;
        bracket.at_low[l] = at_low;
        bracket.at_high[l] = at_high;
    }
    crossed &= lanes;
    if crossed == 0 {
        return (0, splat(0.0));
    }
    (crossed, bracket.root(&cubic, crossed))
}

/// The polynomial of lane `l`: `sign` times (field - `threshold`) along the segment, by expansion of the trilinear
/// form.
#[inline(always)]
fn cubic_along(corners: &[Integers; 8], segments: &Segments, threshold: f32, l: usize) -> [f32; 4] {
    let c = |corner: usize| corners[corner][l] as f32;
    // Coefficients of 1, x, y, z, xy, xz, yz and xyz
    let x = c(1) - c(0);
    let (y, xy) = (c(2) - c(0), c(3) - c(2) - x);
    let (z, xz) = (c(4) - c(0), c(5) - c(4) - x);
    let yz = c(6) - c(4) - y;
    let xyz = c(7) - c(6) - (c(5) - c(4)) - xy;
    // Each product of two or three coordinates, as a polynomial of s
    let [ax, ay, az] = [segments.from[0][l], segments.from[1][l], segments.from[2][l]];
    let [bx, by, bz] = [segments.along[0][l], segments.along[1][l], segments.along[2][l]];
    let of_xy = [ax * ay, ax * by + bx * ay, bx * by];
    let of_xz = [ax * az, ax * bz + bx * az, bx * bz];
    let of_yz = [ay * az, ay * bz + by * az, by * bz];
    let of_xyz = [
        of_xy[0] * az,
        of_xy[1] * az + of_xy[0] * bz,
        of_xy[2] * az + of_xy[1] * bz,
        of_xy[2] * bz,
    ];
    // Sum the powers of s
    let sign = segments.sign[l];
    let even = |i: usize| xy * of_xy[i] + xz * of_xz[i] + yz * of_yz[i] + xyz * of_xyz[i];
    [
        sign * (c(0) - threshold + x * ax + y * ay + z * az + even(0)),
        sign * (x * bx + y * by + z * bz + even(1)),
        sign * even(2),
        sign * xyz * of_xyz[3],
    ]
}

#[inline(always)]
fn value(c: &[f32; 4], s: f32) -> f32 {
    c[0] + s * (c[1] + s * (c[2] + s * c[3]))
}

/// Position of a maximum of the polynomial in 0..1, or 0 if there is none.
#[inline(always)]
fn maximum(c: &[f32; 4]) -> f32 {
    // Solve c1 + 2 c2 s + 3 c3 s^2 = 0 for the root with a falling slope; this form also works if c3 is 0
    let [_, a, b, c] = *c;
    let discriminant = b * b - 3.0 * a * c;
    let root = if discriminant > 0.0 { discriminant } else { 0.0 }.sqrt();
    let (over, under) = if b <= 0.0 { (a, root - b) } else { (-(b + root), 3.0 * c) };
    let s = over / under;
    if (discriminant >= 0.0) & (s > 0.0) & (s < 1.0) { s } else { 0.0 }
}

/// `c[0] + c[1] s + c[2] s^2 + c[3] s^3` for each lane.
#[repr(C, align(64))]
struct Cubic([Lanes; 4]);

/// Intervals with polynomial values of opposite signs at their ends.
#[derive(Default)]
#[repr(C, align(64))]
struct Bracket {
    low: Lanes,
    high: Lanes,
    at_low: Lanes,
    at_high: Lanes,
}

impl Bracket {
    /// The roots of the polynomials of `lanes`.
    #[inline(always)]
    fn root(&mut self, cubic: &Cubic, lanes: u32) -> Lanes {
        let mut roots = self.high;
        let mut searching = lanes;
        for _ in 0..ROUNDS {
            let mut continuing = 0;
            for l in 0..LANES {
                // Take a step of false position
                let span = self.at_high[l] - self.at_low[l];
                let is_searched = (searching >> l & 1 == 1) & (span > 0.0);
                let s = self.low[l] - self.at_low[l] * (self.high[l] - self.low[l]) / span;
                let c = [cubic.0[0][l], cubic.0[1][l], cubic.0[2][l], cubic.0[3][l]];
                let g = value(&c, s);
                roots[l] = if is_searched { s } else { roots[l] };
                continuing |= u32::from(is_searched & (g.abs() >= TOLERANCE)) << l;
                // Shorten the bracket; halve the value at the end that stays (Illinois)
                let is_beyond = g >= 0.0;
                let (low, high) = (self.low[l], self.high[l]);
                let (at_low, at_high) = (self.at_low[l], self.at_high[l]);
                self.low[l] = if is_beyond { low } else { s };
                self.high[l] = if is_beyond { s } else { high };
                self.at_low[l] = if is_beyond { 0.5 * at_low } else { g };
                self.at_high[l] = if is_beyond { g } else { 0.5 * at_high };
            }
            searching = continuing;
            if searching == 0 {
                break;
            }
        }
        roots
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use spherule_tree::math::set_lane3;

    /// The crossing of one ray, in a lane among others that contain NaN.
    #[expect(clippy::cast_possible_truncation, reason = "codes are integers")]
    fn first_crossing(
        corners: &[f32; 8],
        from: Vec3,
        to: Vec3,
        threshold: f32,
        sign: f32,
    ) -> Option<f32> {
        let lane = 5;
        let mut segments =
            Segments { from: [splat(f32::NAN); 3], along: [splat(f32::NAN); 3], sign: splat(sign) };
        set_lane3(&mut segments.from, lane, from);
        set_lane3(&mut segments.along, lane, to - from);
        let corners = corners.map(|code| [code as i32; LANES]);
        let all = first_roots(&corners, &segments, threshold, 1 << lane);
        (all.0 == 1 << lane).then_some(all.1[lane])
    }

    /// Corner values of `a + b.x + c x y z`.
    fn corners(of: impl Fn(Vec3) -> f32) -> [f32; 8] {
        std::array::from_fn(|i| {
            let bit = |bit: usize| f32::from(u8::from(i & bit != 0));
            of(Vec3::new(bit(1), bit(2), bit(4)))
        })
    }

    #[test]
    fn finds_the_root_of_a_cubic() {
        // x y z along the diagonal is s^3.
        let c = corners(|p| 40_000.0 * p.x * p.y * p.z);
        for expected in [0.1_f32, 0.5, 0.93] {
            let threshold = 40_000.0 * expected.powi(3);
            let s = first_crossing(&c, Vec3::ZERO, Vec3::ONE, threshold, 1.0).unwrap();
            assert!((s - expected).abs() < 2e-3, "{s} {expected}");
            let back = first_crossing(&c, Vec3::ONE, Vec3::ZERO, threshold, -1.0).unwrap();
            assert!((1.0 - back - expected).abs() < 2e-3, "{back} {expected}");
        }
        assert_eq!(first_crossing(&c, Vec3::ZERO, Vec3::ONE, 50_000.0, 1.0), None);
    }

    #[test]
    fn finds_sheets_thinner_than_a_step() {
        // x (1 - y) from (0, 0) to (1, 1) is s (1 - s), largest in the middle.
        let c = corners(|p| 40_000.0 * p.x * (1.0 - p.y));
        let (from, to) = (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0));
        let s = first_crossing(&c, from, to, 9_990.0, 1.0).unwrap();
        let exact = 0.5 - (0.25_f32 - 0.24975).sqrt();
        assert!((s - exact).abs() < 5e-3, "{s} {exact}");
        assert_eq!(first_crossing(&c, from, to, 10_010.0, 1.0), None);
    }

    #[test]
    fn interval_starts_behind_the_surface() {
        let c = corners(|p| 1000.0 * p.x);
        let (a, b) = (Vec3::new(0.75, 0.5, 0.5), Vec3::new(1.0, 0.5, 0.5));
        assert_eq!(first_crossing(&c, a, b, 500.0, 1.0), Some(0.0));
        assert_eq!(first_crossing(&c, a, b, 500.0, -1.0), None);
    }
}
