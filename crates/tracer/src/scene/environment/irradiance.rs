//! Irradiance of an environment for any direction of a surface, from spherical harmonics (Ramamoorthi and Hanrahan, "An
//! Efficient Representation for Irradiance Environment Maps", 2001). A surface averages light over a hemisphere, so the
//! first three bands are enough: they are off by less than a tenth of the irradiance of a surface that faces the light.

use std::f32::consts::PI;

use glam::Vec3;

use super::{Environment, EnvironmentAxes};

/// Number of functions in the first three bands.
const COUNT: usize = 9;

/// Factors of the bands for the cosine over a hemisphere.
const BANDS: [f32; COUNT] = {
    let (first, second, third) = (PI, 2.0 * PI / 3.0, PI / 4.0);
    [first, second, second, second, third, third, third, third, third]
};

/// Irradiance by the direction of a surface, see the module.
#[derive(Debug, Clone, PartialEq)]
pub struct IrradianceHarmonics {
    axes: EnvironmentAxes,
    coefficients: [Vec3; COUNT],
}

impl Environment {
    /// The irradiance on surfaces in any direction, approximately.
    pub fn irradiance_harmonics(&self) -> IrradianceHarmonics {
        let coefficient = |i: usize| BANDS[i] * self.image.integral(|at| basis(at)[i]);
        IrradianceHarmonics { axes: self.axes, coefficients: std::array::from_fn(coefficient) }
    }
}

impl IrradianceHarmonics {
    /// Coefficients of the functions in the axes of the environment, by band and order: linear RGB.
    pub const fn coefficients(&self) -> &[Vec3; COUNT] {
        &self.coefficients
    }

    /// Irradiance on a surface with unit `normal`, linear RGB.
    pub fn at(&self, normal: Vec3) -> Vec3 {
        let basis = basis(self.axes.own(normal));
        let terms = self.coefficients.iter().zip(basis);
        let sum: Vec3 = terms.map(|(coefficient, value)| *coefficient * value).sum();
        sum.max(Vec3::ZERO)
    }
}

/// The real spherical harmonics of the first three bands.
fn basis(direction: Vec3) -> [f32; COUNT] {
    let [x, y, z] = direction.to_array();
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (x * x - y * y),
    ]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::environment::studio;

    #[test]
    fn harmonics_are_close_to_the_integral() {
        let axes = EnvironmentAxes::of_view(DVec3::new(0.3, 1.0, -0.2), DVec3::Z, 20.0);
        let uniform = Environment::constant(Vec3::new(1.0, 2.0, 0.5));
        for (environment, tolerance) in [(uniform, 1e-4), (studio(axes, Vec3::ONE), 0.1)] {
            let harmonics = environment.irradiance_harmonics();
            let normals = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z, Vec3::ONE]
                .map(Vec3::normalize);
            let exact = normals.map(|normal| environment.irradiance(normal));
            let brightest = exact.iter().fold(Vec3::ZERO, |a, b| a.max(*b));
            for (normal, exact) in normals.into_iter().zip(exact) {
                let found = harmonics.at(normal);
                let difference = (found - exact).abs() / brightest;
                assert!(difference.max_element() < tolerance, "{normal}: {found}, {exact}");
                assert!(found.min_element() >= 0.0);
            }
        }
    }
}
