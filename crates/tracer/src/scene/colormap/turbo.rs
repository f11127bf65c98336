//! The turbo map. That of `colorous` is a polynomial that differs from the published map by up to 22 of 255 at the
//! ends, so turbo is interpolated here from knots of the published map.

use glam::Vec3;

use super::ENTRIES;

/// Number of table entries between two knots of [`TURBO`].
const TURBO_STEP: usize = 5;

/// Every fifth of the 256 colours of turbo (sRGB): Mikhailov, "Turbo, an improved rainbow colormap for
/// visualization", 2019. The cubics through them differ by at most 1 from all published entries.
const TURBO: [[u8; 3]; (ENTRIES - 1) / TURBO_STEP + 1] = [
    [48, 18, 59],
    [54, 33, 95],
    [59, 47, 128],
    [63, 62, 156],
    [66, 75, 181],
    [69, 89, 203],
    [70, 102, 221],
    [71, 115, 235],
    [70, 128, 246],
    [69, 140, 253],
    [64, 153, 255],
    [56, 165, 251],
    [47, 178, 244],
    [39, 190, 233],
    [31, 201, 221],
    [26, 212, 208],
    [24, 221, 194],
    [26, 228, 182],
    [34, 235, 170],
    [47, 241, 155],
    [63, 246, 138],
    [82, 250, 122],
    [101, 253, 105],
    [121, 254, 89],
    [139, 255, 75],
    [156, 254, 64],
    [169, 251, 57],
    [183, 247, 53],
    [195, 241, 52],
    [208, 234, 52],
    [219, 226, 54],
    [229, 217, 56],
    [238, 207, 58],
    [245, 197, 58],
    [250, 186, 57],
    [253, 174, 53],
    [254, 161, 48],
    [254, 147, 42],
    [252, 132, 35],
    [249, 117, 29],
    [244, 102, 23],
    [239, 88, 17],
    [232, 75, 12],
    [225, 65, 9],
    [216, 55, 6],
    [206, 45, 4],
    [195, 37, 3],
    [183, 29, 2],
    [169, 22, 1],
    [155, 15, 1],
    [139, 9, 2],
    [122, 4, 3],
];

/// Entry `i` of turbo in sRGB from 0 to 255: a Catmull-Rom spline through the knots.
pub(super) fn entry(i: usize) -> Vec3 {
    let knot = |k: usize| Vec3::from(TURBO[k.min(TURBO.len() - 1)].map(f32::from));
    let (k, t) = (i / TURBO_STEP, (i % TURBO_STEP) as f32 / TURBO_STEP as f32);
    let (from, to) = (knot(k), knot(k + 1));
    // Extrapolate linearly beyond the ends
    let before = if k == 0 { 2.0 * from - to } else { knot(k - 1) };
    let after = if k + 2 < TURBO.len() { knot(k + 2) } else { 2.0 * to - from };
    // Evaluate the cubic between the knots
    let (slope_from, slope_to) = (0.5 * (to - before), 0.5 * (after - from));
    let bend = to - from;
    let cubic = slope_from + slope_to - 2.0 * bend;
    let square = 3.0 * bend - 2.0 * slope_from - slope_to;
    let color = from + t * (slope_from + t * (square + t * cubic));
    color.clamp(Vec3::ZERO, Vec3::splat(255.0))
}
