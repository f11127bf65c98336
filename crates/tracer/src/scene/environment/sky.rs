//! A clear sky.
//!
//! Hosek and Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", 2012, in linear RGB. Their coefficients
//! (`hosek_wilkie/coefficients.bin`, little-endian f32; licence beside them) are, for red, green and blue, first the 9
//! parameters and then the radiance: for a ground of albedo 0 and 1, for a turbidity of 1 to 10, and for the 6 control
//! points of a quintic Bézier curve over the elevation of the sun.

use glam::{DVec3, Vec3};

use super::image::EnvironmentImage;
use super::{Environment, EnvironmentAxes, LUMINANCE};
use spherule_tree::math::functions::{acos, exp, pow};

const COEFFICIENTS: &[u8; 14_400] = include_bytes!("hosek_wilkie/coefficients.bin");

/// Values of the model: 9 parameters, and the radiance.
const PARAMETERS: usize = 9;
/// Control points of a curve.
const POINTS: usize = 6;
/// Numbers of one channel for one albedo, per parameter: all turbidities.
const TURBIDITIES: usize = 10;

/// Albedo of the ground that lights the sky.
const GROUND_ALBEDO: f32 = 0.2;

/// Turbidity, the haze in the air, by the two rows of the table around it and the weight of the second: 2.5. 2 is very
/// clear, 10 hazy.
const TURBIDITY: ([usize; 2], f32) = ([1, 2], 0.5);

/// Irradiance of the sky on the ground over pi, in luminance.
const BRIGHTNESS: f32 = 0.5;

/// Largest radiance relative to the mean of the ground. The sky next to the sun is brighter, but the sun is a light of
/// its own.
const LIMIT: f32 = 6.0;

/// Saturation of the colours; those of the model look artificial.
const SATURATION: f32 = 0.65;

/// Sine of the elevation whose radiance is that of the horizon. Lower, the model has a dark band.
const HORIZON: f32 = 0.03;

/// Direction towards a point of the sky in the axes of an environment (x right, y to the viewer, z up), from its
/// elevation above the horizon and its azimuth from the right towards the viewer, degrees.
pub fn sky_direction(elevation: f64, azimuth: f64) -> Vec3 {
    let (elevation, azimuth) = (elevation.to_radians(), azimuth.to_radians());
    let level = libm::cos(elevation);
    let (x, y) = (level * libm::cos(azimuth), level * libm::sin(azimuth));
    DVec3::new(x, y, libm::sin(elevation)).as_vec3()
}

/// A clear sky without its sun, which is in `direction` (unit length, in the axes of the environment), times `scale`
/// per component.
pub fn sky(axes: EnvironmentAxes, direction: Vec3, scale: Vec3) -> Environment {
    let model = Model::new(direction);
    let radiance = |at: Vec3| model.radiance(at.with_z(at.z.max(HORIZON)).normalize());
    // Scale to the brightness on the ground
    let raw = EnvironmentImage::from_fn(|at| if at.z > 0.0 { radiance(at) } else { Vec3::ZERO });
    let ground = raw.integral(|at| at.z.max(0.0)) / std::f32::consts::PI;
    let factor = BRIGHTNESS / ground.dot(LUMINANCE).max(f32::MIN_POSITIVE);
    Environment::from_fn(axes, |at| {
        let rgb = (factor * radiance(at)).min(Vec3::splat(LIMIT));
        let grey = Vec3::splat(rgb.dot(LUMINANCE));
        // Below the horizon, fade to the light that the ground reflects
        let depth = (-at.z / 0.3).clamp(0.0, 1.0);
        scale * (grey + SATURATION * (rgb - grey)).lerp(GROUND_ALBEDO * factor * ground, depth)
    })
}

/// The model for one position of the sun.
struct Model {
    sun: Vec3,
    /// For red, green and blue.
    parameters: [[f32; PARAMETERS]; 3],
    radiance: [f32; 3],
}

impl Model {
    fn new(sun: Vec3) -> Self {
        // The curves are over the cube root of the elevation
        let angle = std::f32::consts::FRAC_PI_2 - acos(sun.z.clamp(0.0, 1.0));
        let elevation = (angle / std::f32::consts::FRAC_PI_2).max(1e-6);
        let position = pow(elevation, 1.0 / 3.0);
        let curve = |first: usize, stride: usize| {
            // Interpolate between albedos and turbidities
            let ([low, high], part) = TURBIDITY;
            let mut sum = 0.0;
            for (albedo, weight) in [(0, 1.0 - GROUND_ALBEDO), (1, GROUND_ALBEDO)] {
                for (turbidity, share) in [(low, 1.0 - part), (high, part)] {
                    let start = first + (albedo * TURBIDITIES + turbidity) * POINTS * stride;
                    sum += weight * share * bezier(position, |i| number(start + i * stride));
                }
            }
            sum
        };
        // The data have a block for each colour channel, and those of the radiance behind them
        let channel = 2 * TURBIDITIES * POINTS;
        Self {
            sun,
            parameters: std::array::from_fn(|rgb| {
                std::array::from_fn(|i| curve(rgb * channel * PARAMETERS + i, PARAMETERS))
            }),
            radiance: std::array::from_fn(|rgb| curve(3 * channel * PARAMETERS + rgb * channel, 1)),
        }
    }

    /// Radiance of the sky in unit `direction` above the horizon.
    fn radiance(&self, direction: Vec3) -> Vec3 {
        let cosine = direction.dot(self.sun).clamp(-1.0, 1.0);
        let height = direction.z.clamp(0.0, 1.0);
        let rgb = std::array::from_fn(|i| {
            let [a, b, c, d, e, f, g, h, mie] = self.parameters[i];
            let gradient = 1.0 + a * exp(b / (height + 0.01));
            let halo = 1.0 + mie * mie - 2.0 * mie * cosine;
            let halo = (1.0 + cosine * cosine) / (halo * halo.sqrt());
            let glow = c + d * exp(e * acos(cosine)) + f * cosine * cosine + g * halo;
            self.radiance[i] * gradient * (glow + h * height.sqrt())
        });
        Vec3::from_array(rgb).max(Vec3::ZERO)
    }
}

/// The number at an index of [`COEFFICIENTS`].
fn number(index: usize) -> f32 {
    let bytes = COEFFICIENTS.as_chunks::<4>().0[index];
    f32::from_le_bytes(bytes)
}

/// A Bézier curve of six control points at `t` of 0 to 1, by De Casteljau's algorithm.
fn bezier(t: f32, point: impl Fn(usize) -> f32) -> f32 {
    let mut points: [f32; POINTS] = std::array::from_fn(point);
    for count in (1..POINTS).rev() {
        for i in 0..count {
            points[i] += t * (points[i + 1] - points[i]);
        }
    }
    points[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> EnvironmentAxes {
        EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0)
    }

    #[test]
    fn the_ground_has_the_stated_brightness() {
        for elevation in [5.0, 42.0, 90.0] {
            let sky = sky(axes(), sky_direction(elevation, 140.0), Vec3::ONE);
            let up = sky.irradiance(Vec3::Z) / std::f32::consts::PI;
            let luminance = up.dot(LUMINANCE);
            assert!((luminance - BRIGHTNESS).abs() < 0.02, "{elevation}: {luminance}");
        }
    }

    #[test]
    fn it_is_blue_and_brightest_at_the_sun() {
        let sun = sky_direction(42.0, 140.0);
        let (axes, level) = (axes(), Vec3::new(-1.0, -1.0, 1.0));
        let sky = sky(axes, sun, Vec3::ONE);
        let [there, away] = [sun, level * sun].map(|at| sky.radiance(axes.to_world(at)));
        assert!(away.z > 1.5 * away.x, "{away}");
        assert!(there.dot(LUMINANCE) > 2.0 * away.dot(LUMINANCE), "{there} {away}");
        // No dark band at the horizon
        let [above, below] =
            [0.01, -0.01].map(|z| sky.radiance(Vec3::new(0.0, 1.0, z).normalize()));
        assert!((above - below).abs().max_element() < 0.1 * above.max_element(), "{above} {below}");
    }

    /// Values of the authors' RGB code (version 1.4a, as ported by the crate `hw-skymodel` 0.1.1) for turbidity 2.5,
    /// albedo 0.2, a sun 42 degrees high.
    #[test]
    fn radiance_is_that_of_the_published_code() {
        let model = Model::new(sky_direction(42.0, 0.0));
        for (elevation, azimuth, expected) in REFERENCE {
            let found = model.radiance(sky_direction(elevation, azimuth));
            let error = (found - Vec3::from_array(expected)).abs().max_element();
            assert!(error < 1e-3 * found.max_element(), "{elevation} {azimuth}: {found}");
        }
    }

    const REFERENCE: [(f64, f64, [f32; 3]); 6] = [
        (90.0, 0.0, [2.058_497, 3.768_09, 7.937_717]),
        (42.0, 0.0, [14.401_121, 17.436_111, 20.963_823]),
        (42.0, 180.0, [2.469_521, 4.925_994, 10.069_256]),
        (10.0, 90.0, [7.953_85, 13.129_112, 20.312_237]),
        (2.0, 30.0, [19.249_847, 25.091_38, 28.004_034]),
        (60.0, 20.0, [4.832_445, 7.131_905, 11.962_302]),
    ];
}
