//! Rough surfaces of microfacets: the GGX distribution and Smith's shadowing.
//!
//! Walter et al., "Microfacet Models for Refraction through Rough Surfaces", 2007; Heitz, "Understanding the
//! Masking-Shadowing Function in Microfacet-Based BRDFs", 2014, for height-correlated shadowing; Dupuy and Benyoub,
//! "Sampling Visible GGX Normals with Spherical Caps", 2023. Directions are unit vectors.

use std::f32::consts::{FRAC_1_PI, PI};

use crate::render::shading::disc;
use spherule_tree::math::functions::sin_cos;
use spherule_tree::math::{larger, smaller};

/// The largest number below 1.
const BELOW_ONE: f32 = 1.0 - 0.5 * f32::EPSILON;

/// Least width of the distribution: a sharper highlight would be a mirror.
const MIN_ALPHA: f32 = 2e-3;

/// The GGX distribution of microfacet normals.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Ggx {
    alpha2: f32,
    alpha: f32,
}

impl Ggx {
    /// The distribution of surfaces with a `roughness` of 0 to 1, whose square is the width `alpha`, so that equal
    /// steps look equal (Burley, "Physically-Based Shading at Disney", 2012).
    pub(in crate::render) fn new(roughness: f32) -> Self {
        let alpha = larger(roughness * roughness, MIN_ALPHA);
        Self { alpha2: alpha * alpha, alpha }
    }

    /// The width of the distribution.
    pub(in crate::render) const fn width(&self) -> f32 {
        self.alpha
    }

    /// The density of microfacets whose normal has this `cosine` with that of the surface.
    #[inline(always)]
    pub(super) fn density(&self, cosine: f32) -> f32 {
        let x = cosine * cosine * (self.alpha2 - 1.0) + 1.0;
        self.alpha2 * FRAC_1_PI / (x * x)
    }

    /// Smith's auxiliary function of a direction by its cosine with the normal, above 0.
    #[inline(always)]
    pub(super) fn lambda(&self, cosine: f32) -> f32 {
        let c2 = cosine * cosine;
        let tan2 = larger(1.0 - c2, 0.0) / c2;
        0.5 * ((1.0 + self.alpha2 * tan2).sqrt() - 1.0)
    }

    /// The fraction of microfacets that is visible from a direction.
    #[inline(always)]
    pub(in crate::render) fn masking(&self, cosine: f32) -> f32 {
        1.0 / (1.0 + self.lambda(cosine))
    }

    /// The fraction of microfacets that is visible from two directions.
    #[inline(always)]
    pub(in crate::render) fn shadowing(&self, a: f32, b: f32) -> f32 {
        1.0 / (1.0 + self.lambda(a) + self.lambda(b))
    }

    /// A visible microfacet normal in the frame of the surface, for light that leaves in direction `out`. `u` is
    /// uniform in the unit square.
    #[inline(always)]
    pub(in crate::render) fn sample_normal(&self, out: [f32; 3], u: [f32; 2]) -> [f32; 3] {
        // Stretch the surface, so that its microfacets are a hemisphere
        let v = normalized([out[0] * self.alpha, out[1] * self.alpha, out[2]]);
        // Sample the cap of directions that mirror to above the surface
        let (sin, cos) = sin_cos(2.0 * PI * u[0]);
        let z = (1.0 - u[1]) * (1.0 + v[2]) - v[2];
        let level = larger(1.0 - z * z, 0.0).sqrt();
        let h = [level * cos + v[0], level * sin + v[1], z + v[2]];
        // Undo the stretching
        normalized([h[0] * self.alpha, h[1] * self.alpha, larger(h[2], 1e-7)])
    }

    /// The probability density, per steradian, of the direction to which [`Ggx::sample_normal`] mirrors light, by the
    /// cosines of the microfacet normal and of the outgoing direction.
    #[inline(always)]
    pub(super) fn pdf(&self, normal: f32, out: f32) -> f32 {
        self.density(normal) * self.masking(out) / (4.0 * out)
    }
}

#[inline(always)]
pub(in crate::render) fn normalized(v: [f32; 3]) -> [f32; 3] {
    let scale = 1.0 / dot(v, v).sqrt();
    [v[0] * scale, v[1] * scale, v[2] * scale]
}

#[inline(always)]
pub(in crate::render) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The direction that mirrors `out` at a microfacet with unit normal `h`.
#[inline(always)]
pub(in crate::render) fn mirror(out: [f32; 3], h: [f32; 3]) -> [f32; 3] {
    let twice = 2.0 * dot(out, h);
    [twice * h[0] - out[0], twice * h[1] - out[1], twice * h[2] - out[2]]
}

/// Whether a direction is sampled from the first of two distributions, which is chosen with probability `part`, and
/// the point of the unit square to sample it with.
#[inline(always)]
pub(super) fn choose(part: f32, u: [f32; 2]) -> (bool, [f32; 2]) {
    let is_first = u[0] < part;
    let (rest, size) = if is_first { (u[0], part) } else { (u[0] - part, 1.0 - part) };
    (is_first, [smaller(rest / larger(size, 1e-9), BELOW_ONE), u[1]])
}

/// `a` or `b`.
#[inline(always)]
pub(super) fn select(is_a: bool, a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    let choose = |axis: usize| if is_a { a[axis] } else { b[axis] };
    [choose(0), choose(1), choose(2)]
}

/// A direction around the normal, with a density in proportion to the cosine (Malley's method).
#[inline(always)]
pub(super) fn cosine_direction(u: [f32; 2]) -> [f32; 3] {
    let [x, y] = disc(u);
    [x, y, larger(1.0 - x * x - y * y, 0.0).sqrt()]
}

/// `(1 - cosine)^5`, by which Schlick's Fresnel reflectance rises from normal incidence to 1.
#[inline(always)]
pub(super) fn schlick_rise(cosine: f32) -> f32 {
    let x = 1.0 - smaller(larger(cosine, 0.0), 1.0);
    let x2 = x * x;
    x2 * x2 * x
}

/// Cells of a table.
const CELLS: usize = 64;

/// Added to a number of magnitude below 2^22, this rounds it to an integer in the low bits of the mantissa.
const ROUND: f32 = 12_582_912.0;

/// Directions that a value of a table is averaged over.
const SAMPLES: u32 = 512;

/// The fraction of light that leaves a surface of microfacets after one reflection, by the cosine of the outgoing
/// direction. For a reflectance of `f0` at normal incidence, it is `f0 * scale + bias` (Karis, "Real Shading in
/// Unreal Engine 4", 2013).
#[derive(Debug, Clone)]
pub(in crate::render) struct Albedo {
    /// The number of values is a power of two, so that indices need no check; the last ones are not used.
    values: [f32; 2 * CELLS],
    /// Mean over the cosine-weighted hemisphere.
    pub(super) mean: f32,
}

impl Albedo {
    /// The fraction that leaves a surface of `ggx` with reflectance `f0`.
    pub(super) fn new(ggx: &Ggx, f0: f32) -> Self {
        Self::tabulated(|cosine| albedo(ggx, f0, cosine))
    }

    /// The fraction that `leaving` computes from the cosine, above 0, of the outgoing direction.
    pub(in crate::render) fn tabulated(leaving: impl Fn(f32) -> f32) -> Self {
        let mut values = [0.0; 2 * CELLS];
        for (cell, value) in values.iter_mut().enumerate().take(CELLS + 1) {
            *value = leaving(larger(cell as f32 / CELLS as f32, 1e-3));
        }
        values[CELLS + 1] = values[CELLS];
        // Integrate 2 E(c) c dc exactly for the interpolated table
        let mean = (0..CELLS).map(|cell| {
            let [a, b] = [values[cell], values[cell + 1]].map(f64::from);
            let [x, h] = [cell as f64, 1.0].map(|v| v / CELLS as f64);
            2.0 * h * (a * (0.5 * x + h / 6.0) + b * (0.5 * x + h / 3.0))
        });
        #[expect(clippy::cast_possible_truncation, reason = "rounds")]
        let mean = mean.sum::<f64>() as f32;
        Self { values, mean }
    }

    /// The fractions for cosines from 0 to 1, evenly spaced, and the mean.
    pub(in crate::render) fn table(&self) -> impl Iterator<Item = f32> {
        self.values[..=CELLS].iter().copied().chain([self.mean])
    }

    /// The fraction for an outgoing direction with this cosine.
    #[inline(always)]
    pub(in crate::render) fn at(&self, cosine: f32) -> f32 {
        let x = smaller(larger(cosine, 0.0), 1.0) * CELLS as f32;
        let rounded = (x - 0.5) + ROUND;
        let cell = rounded.to_bits().wrapping_sub(ROUND.to_bits()) as usize;
        let a = self.values[cell % (2 * CELLS)];
        let b = self.values[(cell + 1) % (2 * CELLS)];
        a + (b - a) * (x - (rounded - ROUND))
    }
}

/// The mean of `value` over points that fill the unit square evenly (Hammersley).
pub(in crate::render) fn mean_over_square(value: impl Fn([f32; 2]) -> f32) -> f32 {
    let sum = (0..SAMPLES).map(|i| {
        let across = (i as f32 + 0.5) / SAMPLES as f32;
        let down = (i.reverse_bits() >> 8) as f32 / (1 << 24) as f32;
        value([across, down])
    });
    sum.sum::<f32>() / SAMPLES as f32
}

/// The direction with this cosine.
pub(in crate::render) fn direction_at(cosine: f32) -> [f32; 3] {
    [larger(1.0 - cosine * cosine, 0.0).sqrt(), 0.0, cosine]
}

/// The fraction of light that leaves with this `cosine`.
fn albedo(ggx: &Ggx, f0: f32, cosine: f32) -> f32 {
    let out = direction_at(cosine);
    mean_over_square(|u| {
        let h = ggx.sample_normal(out, u);
        let direction = mirror(out, h);
        if direction[2] <= 0.0 {
            return 0.0;
        }
        let fresnel = f0 + (1.0 - f0) * schlick_rise(dot(out, h));
        fresnel * ggx.shadowing(cosine, direction[2]) / ggx.masking(cosine)
    })
}
