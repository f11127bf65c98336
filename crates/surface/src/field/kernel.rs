//! The cubic spline kernel (Monaghan and Lattanzio 1985, with the compact support of Koschier et al. 2019, "Smoothed
//! particle hydrodynamics techniques", eq. 4), in units of its central value.

/// The kernel at `q`, the distance divided by the support; 1 at the centre, 0 from 1 on.
///
/// `6 (q^3 - q^2) + 1` up to one half, and `2 (1 - q)^3` from there, equal `2 (1 - q)^3 - 8 (1/2 - q)^3` with both
/// terms clamped at zero. This form has no branch, so it is the same code for any number of lanes.
#[inline(always)]
pub(crate) fn weight(q: f32) -> f32 {
    let outer = (1.0 - q).max(0.0);
    let inner = (0.5 - q).max(0.0);
    2.0 * outer * outer * outer - 8.0 * inner * inner * inner
}

/// Derivative of [`weight`] by `q`.
#[inline(always)]
pub(crate) fn slope(q: f32) -> f32 {
    let outer = (1.0 - q).max(0.0);
    let inner = (0.5 - q).max(0.0);
    24.0 * inner * inner - 6.0 * outer * outer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_spline() {
        for i in 0..=240 {
            let q = i as f32 / 200.0;
            let expected = match q {
                q if q <= 0.5 => 6.0 * (q * q * q - q * q) + 1.0,
                q if q <= 1.0 => 2.0 * (1.0 - q).powi(3),
                _ => 0.0,
            };
            assert!((weight(q) - expected).abs() < 1e-6, "{q}");
            let step = 1e-3;
            let difference = (weight(q + step) - weight(q - step)) / (2.0 * step);
            assert!((slope(q) - difference).abs() < 2e-3, "{q}");
        }
    }
}
