//! Where a ray crosses the surface within one voxel.
//!
//! Along a ray a trilinear field is a cubic polynomial (Parker et al. 1998; Marmitt et al. 2004).

use glam::Vec3;

/// Rounds of the search in a bracket; false position with Illinois steps gains more than a digit each.
const ROUNDS: usize = 6;
/// Values this close to the surface end the search, in codes.
const CLOSE: f32 = 0.5;

/// The part of the way from `from` to `to`, places in a voxel with these corner values, at which the field
/// first gets to `threshold`; `sign` is 1 for a ray that comes from smaller values, -1 from larger ones. A
/// ray that begins beyond crosses at 0.
#[inline(always)]
pub(super) fn first_crossing(
    corners: &[f32; 8],
    from: Vec3,
    to: Vec3,
    threshold: f32,
    sign: f32,
) -> Option<f32> {
    let cubic = Cubic::along(corners, from, to - from, threshold, sign);
    let g = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|s| cubic.value(s));
    if g[0] >= 0.0 {
        return Some(0.0);
    }
    let (low, high, at_low, at_high) = if g[1] >= 0.0 {
        (0.0, 1.0 / 3.0, g[0], g[1])
    } else if g[2] >= 0.0 {
        (1.0 / 3.0, 2.0 / 3.0, g[1], g[2])
    } else if g[3] >= 0.0 {
        (2.0 / 3.0, 1.0, g[2], g[3])
    } else {
        // Thinner than the steps.
        let peak = cubic.maximum()?;
        let at_peak = cubic.value(peak);
        if at_peak < 0.0 {
            return None;
        }
        (0.0, peak, g[0], at_peak)
    };
    Some(cubic.root_between(low, high, at_low, at_high))
}

/// `c[0] + c[1] s + c[2] s^2 + c[3] s^3`.
struct Cubic([f32; 4]);

impl Cubic {
    /// `sign` times the field over `threshold` along `from + s way`: the trilinear form multiplied out.
    #[inline(always)]
    fn along(c: &[f32; 8], from: Vec3, way: Vec3, threshold: f32, sign: f32) -> Self {
        // Of 1, x, y, z, xy, xz, yz and xyz.
        let x = c[1] - c[0];
        let (y, xy) = (c[2] - c[0], c[3] - c[2] - x);
        let (z, xz) = (c[4] - c[0], c[5] - c[4] - x);
        let yz = c[6] - c[4] - y;
        let xyz = c[7] - c[6] - (c[5] - c[4]) - xy;
        let (a, b) = (from, way);
        // Each product of two or three coordinates, as a polynomial of s.
        let of_xy = [a.x * a.y, a.x * b.y + b.x * a.y, b.x * b.y];
        let of_xz = [a.x * a.z, a.x * b.z + b.x * a.z, b.x * b.z];
        let of_yz = [a.y * a.z, a.y * b.z + b.y * a.z, b.y * b.z];
        let of_xyz = [
            of_xy[0] * a.z,
            of_xy[1] * a.z + of_xy[0] * b.z,
            of_xy[2] * a.z + of_xy[1] * b.z,
            of_xy[2] * b.z,
        ];
        let even = |i: usize| xy * of_xy[i] + xz * of_xz[i] + yz * of_yz[i] + xyz * of_xyz[i];
        Self([
            sign * (c[0] - threshold + x * a.x + y * a.y + z * a.z + even(0)),
            sign * (x * b.x + y * b.y + z * b.z + even(1)),
            sign * even(2),
            sign * xyz * of_xyz[3],
        ])
    }

    #[inline(always)]
    fn value(&self, s: f32) -> f32 {
        let c = &self.0;
        c[0] + s * (c[1] + s * (c[2] + s * c[3]))
    }

    /// Where in 0..1 it has a maximum.
    #[inline(always)]
    fn maximum(&self) -> Option<f32> {
        // c1 + 2 c2 s + 3 c3 s^2 = 0 with a falling slope; written so that c3 may vanish.
        let [_, a, b, c] = self.0;
        let discriminant = b * b - 3.0 * a * c;
        if discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        let s = if b <= 0.0 {
            a / (root - b)
        } else {
            -(b + root) / (3.0 * c)
        };
        (s > 0.0 && s < 1.0).then_some(s)
    }

    /// Where it is 0 between `low` and `high`, where it has values of either sign.
    #[inline(always)]
    fn root_between(&self, mut low: f32, mut high: f32, mut at_low: f32, mut at_high: f32) -> f32 {
        let mut s = high;
        for _ in 0..ROUNDS {
            let span = at_high - at_low;
            if span <= 0.0 {
                break;
            }
            s = low - at_low * (high - low) / span;
            let g = self.value(s);
            if g.abs() < CLOSE {
                break;
            }
            if g >= 0.0 {
                high = s;
                at_high = g;
                at_low *= 0.5;
            } else {
                low = s;
                at_low = g;
                at_high *= 0.5;
            }
        }
        s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        for wanted in [0.1_f32, 0.5, 0.93] {
            let threshold = 40_000.0 * wanted.powi(3);
            let s = first_crossing(&c, Vec3::ZERO, Vec3::ONE, threshold, 1.0).unwrap();
            assert!((s - wanted).abs() < 2e-3, "{s} {wanted}");
            let back = first_crossing(&c, Vec3::ONE, Vec3::ZERO, threshold, -1.0).unwrap();
            assert!((1.0 - back - wanted).abs() < 2e-3, "{back} {wanted}");
        }
        assert_eq!(
            first_crossing(&c, Vec3::ZERO, Vec3::ONE, 50_000.0, 1.0),
            None
        );
    }

    #[test]
    fn finds_what_is_thinner_than_a_step() {
        // x (1 - y) from (0, 0) to (1, 1) is s (1 - s), largest in the middle.
        let c = corners(|p| 40_000.0 * p.x * (1.0 - p.y));
        let (from, to) = (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0));
        let s = first_crossing(&c, from, to, 9_990.0, 1.0).unwrap();
        let exact = 0.5 - (0.25_f32 - 0.24975).sqrt();
        assert!((s - exact).abs() < 5e-3, "{s} {exact}");
        assert_eq!(first_crossing(&c, from, to, 10_010.0, 1.0), None);
    }

    #[test]
    fn begins_beyond() {
        let c = corners(|p| 1000.0 * p.x);
        let (a, b) = (Vec3::new(0.75, 0.5, 0.5), Vec3::new(1.0, 0.5, 0.5));
        assert_eq!(first_crossing(&c, a, b, 500.0, 1.0), Some(0.0));
        assert_eq!(first_crossing(&c, a, b, 500.0, -1.0), None);
    }
}
