//! A clear sky and its sun.
//!
//! Hosek and Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", 2012, in linear RGB. Their coefficients
//! (`hosek_wilkie/coefficients.bin`, little-endian f32; licence beside them) are, for red, green and blue, first the 9
//! parameters and then the radiance: for a ground of albedo 0 and 1, for a turbidity of 1 to 10, and for the 6 control
//! points of a quintic Bézier curve over the elevation of the sun.

use glam::{DVec3, Vec3};

use super::sun_spectrum::sun_irradiance;
use super::{Environment, EnvironmentAxes, LUMINANCE};
use spherule_tree::math::functions::{acos, exp, pow};

const COEFFICIENTS: &[u8; 14_400] = include_bytes!("hosek_wilkie/coefficients.bin");

/// Values of the model: 9 parameters, and the radiance.
const PARAMETERS: usize = 9;
/// Control points of a curve.
const POINTS: usize = 6;
/// Numbers of one channel for one albedo, per parameter: all turbidities.
const TURBIDITIES: usize = 10;

/// Irradiance of sky and sun on the ground over pi, in luminance, with the sun of [`REFERENCE_ELEVATION`].
const BRIGHTNESS: f32 = 0.8;

/// Elevation of the sun for [`BRIGHTNESS`], degrees.
const REFERENCE_ELEVATION: f64 = 42.0;

/// How much of the differences in brightness is left, as an exponent: an eye that has adapted sees a dusk as dark, but not
/// as much darker as it is.
const ADAPTED: f32 = 0.3;

/// Sine of the angle below the horizon at which only the ground is left.
const FADE: f32 = 0.3;

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

/// The sky and its sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkySettings {
    /// Unit vector towards the sun, in the axes of the environment.
    pub sun: Vec3,
    /// The haze in the air, 1 to 10: 2 is very clear, 10 hazy.
    pub turbidity: f32,
    /// Reflectance of the ground, which lights the sky, 0 to 1.
    pub albedo: f32,
}

/// A clear sky and its sun in their true ratio, as bright as suits pictures.
pub struct ClearSky {
    model: Model,
    /// Factor on radiance and irradiance.
    exposure: f32,
    /// Irradiance of the sun on a surface that faces it, without the factor.
    sun: Vec3,
    /// Radiance of the ground, without the factor.
    ground: Vec3,
}

impl ClearSky {
    /// The sky of some settings.
    pub fn new(settings: &SkySettings) -> Self {
        let usual = SkySettings { sun: sky_direction(REFERENCE_ELEVATION, 0.0), ..*settings };
        let (model, sun, light) = measured(settings);
        // Expose for the usual sun, and adapt to this one
        let [own, usual] = [light, measured(&usual).2].map(|light| light.dot(LUMINANCE));
        let adapted = pow((own / usual).max(f32::MIN_POSITIVE), ADAPTED);
        let exposure = BRIGHTNESS * adapted / own.max(f32::MIN_POSITIVE);
        Self { model, exposure, sun, ground: settings.albedo * light }
    }

    /// Irradiance of the sun on a surface that faces it, linear RGB.
    pub fn sun(&self) -> Vec3 {
        self.exposure * self.sun
    }

    /// The sky without its sun, times `scale` per component.
    pub fn environment(&self, axes: EnvironmentAxes, scale: Vec3) -> Environment {
        Environment::from_fn(axes, |at| {
            // Below the horizon, fade to the light that the ground reflects
            let depth = (-at.z / FADE).clamp(0.0, 1.0);
            self.exposure * scale * self.model.above_horizon(at).lerp(self.ground, depth)
        })
    }
}

/// The model of the sky, the irradiance of the sun on a surface that faces it, and that of both on the ground over pi.
fn measured(settings: &SkySettings) -> (Model, Vec3, Vec3) {
    let model = Model::new(settings);
    let sun = sun_irradiance(settings.sun.z, settings.turbidity);
    let ground = model.irradiance_of_ground() + sun * settings.sun.z.max(0.0);
    (model, sun, ground / std::f32::consts::PI)
}

/// The model for one position of the sun.
struct Model {
    sun: Vec3,
    /// For red, green and blue.
    parameters: [[f32; PARAMETERS]; 3],
    radiance: [f32; 3],
}

impl Model {
    fn new(settings: &SkySettings) -> Self {
        let SkySettings { sun, turbidity, albedo } = *settings;
        // The curves are over the cube root of the elevation
        let angle = std::f32::consts::FRAC_PI_2 - acos(sun.z.clamp(0.0, 1.0));
        let elevation = (angle / std::f32::consts::FRAC_PI_2).max(1e-6);
        let position = pow(elevation, 1.0 / 3.0);
        let curve = |first: usize, stride: usize| {
            // Interpolate between albedos and turbidities
            let mut sum = 0.0;
            for (row, weight) in [(0, 1.0 - albedo), (1, albedo)] {
                for (turbidity, share) in rows_of(turbidity) {
                    let start = first + (row * TURBIDITIES + turbidity) * POINTS * stride;
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

    /// Irradiance on the ground.
    fn irradiance_of_ground(&self) -> Vec3 {
        let (rows, columns) = (45_u8, 90_u8);
        let mut sum = Vec3::ZERO;
        for row in 0..rows {
            // Bands of equal projected area
            let sine = ((f32::from(row) + 0.5) / f32::from(rows)).sqrt();
            for column in 0..columns {
                let turn = (f64::from(column) + 0.5) / f64::from(columns) * std::f64::consts::TAU;
                let (x, y) = (libm::cos(turn), libm::sin(turn));
                let level = (1.0 - sine * sine).sqrt();
                let at = (f64::from(level) * DVec3::new(x, y, 0.0)).as_vec3().with_z(sine);
                sum += self.above_horizon(at);
            }
        }
        sum * std::f32::consts::PI / (f32::from(rows) * f32::from(columns))
    }

    /// Radiance of the sky in unit `direction`, or at the horizon if that is below.
    fn above_horizon(&self, direction: Vec3) -> Vec3 {
        self.radiance(direction.with_z(direction.z.max(HORIZON)).normalize())
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

/// The rows of the table around a turbidity, with their weights.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 10")]
fn rows_of(turbidity: f32) -> [(usize, f32); 2] {
    let place = turbidity.clamp(1.0, TURBIDITIES as f32) - 1.0;
    let low = (place as usize).min(TURBIDITIES - 2);
    let part = place - low as f32;
    [(low, 1.0 - part), (low + 1, part)]
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

    fn settings(elevation: f64) -> SkySettings {
        SkySettings { sun: sky_direction(elevation, 140.0), turbidity: 2.5, albedo: 0.2 }
    }

    #[test]
    fn sky_and_sun_have_the_stated_brightness() {
        let ground = |elevation: f64| {
            let sky = ClearSky::new(&settings(elevation));
            let of_sky = sky.environment(axes(), Vec3::ONE).irradiance(Vec3::Z);
            let of_sun = sky.sun() * settings(elevation).sun.z;
            (of_sky + of_sun).dot(LUMINANCE) / std::f32::consts::PI
        };
        let usual = ground(42.0);
        assert!((usual - BRIGHTNESS).abs() < 0.02, "{usual}");
        // A dusk is darker, and not black
        let dusk = ground(2.0);
        assert!((0.25..0.6).contains(&(dusk / usual)), "{dusk}");
        assert!(ground(90.0) > usual);
        for (turbidity, albedo) in [(1.0, 0.0), (10.0, 1.0)] {
            let sky = ClearSky::new(&SkySettings { turbidity, albedo, ..settings(0.0) });
            assert!(sky.sun().is_finite() && sky.exposure.is_finite(), "{turbidity}");
        }
    }

    #[test]
    fn it_is_blue_and_brightest_at_the_sun() {
        let (axes, level) = (axes(), Vec3::new(-1.0, -1.0, 1.0));
        let SkySettings { sun, .. } = settings(42.0);
        let sky = ClearSky::new(&settings(42.0)).environment(axes, Vec3::ONE);
        let [there, away] = [sun, level * sun].map(|at| sky.radiance(axes.to_world(at)));
        assert!(away.z > 1.5 * away.x, "{away}");
        assert!(there.dot(LUMINANCE) > 2.0 * away.dot(LUMINANCE), "{there} {away}");
        // No dark band at the horizon
        let [above, below] =
            [0.01, -0.01].map(|z| sky.radiance(Vec3::new(0.0, 1.0, z).normalize()));
        assert!((above - below).abs().max_element() < 0.1 * above.max_element(), "{above} {below}");
    }

    /// In the open, about a sixth of the light on the ground comes from a clear sky if the sun is high (12 to 15 klx of about
    /// 75), and most of it if the sun is low.
    #[test]
    fn the_ratio_of_sky_and_sun_is_that_outdoors() {
        let share = |elevation: f64| {
            let model = Model::new(&settings(elevation));
            let sky = model.irradiance_of_ground().dot(LUMINANCE);
            let SkySettings { sun, turbidity, .. } = settings(elevation);
            let sun = sun_irradiance(sun.z, turbidity).dot(LUMINANCE) * sun.z;
            sky / (sky + sun)
        };
        assert!((0.12..0.25).contains(&share(42.0)), "{}", share(42.0));
        assert!(share(2.0) > 0.6, "{}", share(2.0));
    }

    /// Values of the authors' RGB code (version 1.4a, as ported by the crate `hw-skymodel` 0.1.1) for turbidity 2.5,
    /// albedo 0.2, a sun 42 degrees high.
    #[test]
    fn radiance_is_that_of_the_published_code() {
        let model = Model::new(&SkySettings { sun: sky_direction(42.0, 0.0), ..settings(42.0) });
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
