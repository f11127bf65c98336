//! A clear sky and its sun.
//!
//! The light that the air scatters (`scattering.rs`) is tabulated over the elevation and the azimuth from the sun, without
//! the halo of the sun, which is sharper than the table.

use glam::{DVec3, Vec3};

use super::atmosphere::sun_irradiance;
use super::multiple::cell;
use super::scattering::{Scattered, Scattering, halo};
use super::{Environment, EnvironmentAxes, LUMINANCE};
use spherule_tree::math::functions::{asin, atan2};
use spherule_tree::math::narrow;

/// Irradiance of sky and sun on the ground over pi, in luminance, with the sun of [`REFERENCE_ELEVATION`].
const BRIGHTNESS: f32 = 0.8;

/// Elevation of the sun for [`BRIGHTNESS`], degrees.
const REFERENCE_ELEVATION: f64 = 42.0;

/// How much of the differences in brightness is left by day, as an exponent: an eye or camera that has adapted sees a low
/// sun as dark, but not as much darker as it is.
const ADAPTED: f64 = 0.55;

/// The same for a dusk.
const ADAPTED_TO_DUSK: f64 = 0.05;

/// The part of the light by day where adaptation changes from one to the other.
const DUSK: f64 = 0.012;

/// Sine of the angle below the horizon at which only the ground is left.
const FADE: f32 = 0.3;

/// Rows and columns of the table of a sky.
const FINE: [usize; 2] = [44, 25];

/// The same where only the light on the ground matters.
const COARSE: [usize; 2] = [20, 9];

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
    /// Unit vector towards the sun, in the axes of the environment. It may be up to 12 degrees below the horizon.
    pub sun: Vec3,
    /// The haze in the air, 1 to 10: 2 is very clear, 10 hazy.
    pub turbidity: f32,
    /// Reflectance of the ground, which lights the sky, 0 to 1.
    pub albedo: f32,
}

/// A clear sky and its sun in their true ratio, as bright as suits pictures.
pub struct ClearSky {
    table: SkyTable,
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
        let by_day = light_on_ground(&SkyTable::new(&usual, COARSE), &usual).dot(LUMINANCE);
        let table = SkyTable::new(settings, FINE);
        let light = light_on_ground(&table, settings);
        let luminance = light.dot(LUMINANCE).max(f32::MIN_POSITIVE);
        let exposure = BRIGHTNESS * adapted(f64::from(luminance / by_day)) / luminance;
        Self { table, exposure, sun: sun_of(settings), ground: settings.albedo * light }
    }

    /// Irradiance of the sun on a surface that faces it, linear RGB. A sun more than 0.27 degrees below
    /// the horizon has none.
    pub fn sun(&self) -> Vec3 {
        self.exposure * self.sun
    }

    /// The sky without its sun, times `scale` per component.
    pub fn environment(&self, axes: EnvironmentAxes, scale: Vec3) -> Environment {
        Environment::from_fn(axes, |at| {
            // Below the horizon, fade to the light that the ground reflects
            let depth = -at.z / FADE;
            let radiance = if depth >= 1.0 {
                self.ground
            } else {
                self.table.radiance(at).lerp(self.ground, depth.max(0.0))
            };
            self.exposure * scale * radiance
        })
    }
}

/// The brightness of the ground beside that by day, if it has a part `light` of the light of that.
fn adapted(light: f64) -> f32 {
    let by_day = libm::pow(light, ADAPTED);
    let brighter = (1.0 + DUSK / light) / (1.0 + DUSK);
    narrow(by_day * libm::pow(brighter, ADAPTED - ADAPTED_TO_DUSK))
}

/// Irradiance of the sun on a surface that faces it.
fn sun_of(settings: &SkySettings) -> Vec3 {
    sun_irradiance(f64::from(settings.sun.z), settings.turbidity)
}

/// Irradiance of sky and sun on the ground, over pi.
fn light_on_ground(table: &SkyTable, settings: &SkySettings) -> Vec3 {
    let of_sun = sun_of(settings) * settings.sun.z.max(0.0);
    (table.irradiance_of_ground() + of_sun) / std::f32::consts::PI
}

/// The light of the sky over the square root of the elevation and the azimuth from the sun.
struct SkyTable {
    size: [usize; 2],
    /// Row by row from the horizon, columns from the side of the sun.
    cells: Vec<Scattered>,
    /// Unit vector towards the sun.
    sun: Vec3,
    /// Its horizontal part, of length 1.
    ahead: Vec3,
}

impl SkyTable {
    /// The table for one position of the sun.
    fn new(settings: &SkySettings, size: [usize; 2]) -> Self {
        let SkySettings { sun, turbidity, albedo } = *settings;
        let elevation = libm::asin(f64::from(sun.z).clamp(-1.0, 1.0));
        let (level, height) = (libm::cos(elevation), libm::sin(elevation));
        let scattering = Scattering::new(elevation, turbidity, albedo);
        let [rows, columns] = size;
        let mut cells = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            let root = row as f64 / (rows - 1) as f64;
            let angle = root * root * std::f64::consts::FRAC_PI_2;
            let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
            let ray = scattering.ray(sine);
            cells.extend((0..columns).map(|column| {
                let turn = column as f64 / (columns - 1) as f64 * std::f64::consts::PI;
                let from_sun = sine * height + cosine * level * libm::cos(turn);
                scattering.scattered(&ray, from_sun)
            }));
        }
        let ahead = sun.with_z(0.0).try_normalize().unwrap_or(Vec3::X);
        Self { size, cells, sun, ahead }
    }

    /// Radiance of the sky in unit `direction`, or at the horizon if that is below.
    fn radiance(&self, direction: Vec3) -> Vec3 {
        let [rows, columns] = self.size;
        let cell = |part: f32, count: usize| cell(f64::from(part) * (count - 1) as f64, count);
        let height = asin(direction.z.clamp(0.0, 1.0)) / std::f32::consts::FRAC_PI_2;
        let (row, up) = cell(height.sqrt(), rows);
        let aside = self.ahead.cross(direction).z.abs();
        let turn = atan2(aside, self.ahead.dot(direction)) / std::f32::consts::PI;
        let (column, across) = cell(turn, columns);
        let start = row * columns + column;
        let [low, high] = [start, start + columns].map(|i| {
            let [a, b] = [self.cells[i], self.cells[i + 1]];
            [a.even.lerp(b.even, across), a.halo.lerp(b.halo, across)]
        });
        let [even, of_halo] = [0, 1].map(|i| low[i].lerp(high[i], up));
        let cosine = direction.dot(self.sun).clamp(-1.0, 1.0);
        (even + halo(cosine) * of_halo).max(Vec3::ZERO)
    }

    /// Irradiance of the sky on the ground.
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
                sum += self.radiance(at);
            }
        }
        sum * std::f32::consts::PI / (f32::from(rows) * f32::from(columns))
    }
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
        let (noon, dusk) = (ground(60.0), ground(0.5));
        assert!((7.0..11.0).contains(&(noon / dusk)), "{noon} {dusk}");
        for (turbidity, albedo) in [(1.0, 0.0), (10.0, 1.0)] {
            let sky = ClearSky::new(&SkySettings { turbidity, albedo, ..settings(0.0) });
            assert!(sky.sun().is_finite() && sky.exposure.is_finite(), "{turbidity}");
        }
    }

    /// Also over the elevation where the table of scattered light changes its size.
    #[test]
    fn a_lower_sun_is_darker() {
        let elevations =
            [90.0, 60.0, 30.0, 20.06, 20.04, 10.0, 3.0, 0.5, 0.0, -1.0, -3.0, -6.0, -9.0, -12.0];
        let lights = elevations.map(|elevation| {
            let settings = settings(elevation);
            let light = light_on_ground(&SkyTable::new(&settings, COARSE), &settings);
            light.dot(LUMINANCE)
        });
        let [first, .., last] = lights;
        for pair in lights.windows(2) {
            assert!(pair[1] < pair[0], "{lights:?}");
        }
        // 100 klx, and 0.008 lx at the end of the nautical dusk
        assert!((3e-8..3e-7).contains(&(last / first)), "{lights:?}");
        assert!((lights[3] / lights[4] - 1.0).abs() < 0.01, "{lights:?}");
        // The brightness of pictures falls, too, but less
        let brightness = lights.map(|light| adapted(f64::from(light / lights[0])));
        assert!(brightness.is_sorted_by(|a, b| a > b), "{brightness:?}");
        assert!(brightness[13] > 0.02, "{brightness:?}");
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

    #[test]
    fn a_dusk_has_a_blue_zenith_a_red_glow_and_the_shadow_of_the_earth() {
        let of = |elevation: f64| {
            let table = SkyTable::new(&settings(elevation), FINE);
            move |height: f64, azimuth: f64| table.radiance(sky_direction(height, 140.0 + azimuth))
        };
        let dusk = of(-6.0);
        let [zenith, glow] = [dusk(90.0, 0.0), dusk(2.0, 0.0)];
        assert!(zenith.z > 3.0 * zenith.x, "{zenith}");
        assert!(glow.x > 2.0 * glow.z && glow.x > 10.0 * zenith.x, "{glow} {zenith}");
        // Opposite the sun the shadow is dark and blue below the reddish belt of Venus
        let early = of(-3.0);
        let [shadow, belt] = [early(2.0, 180.0), early(12.0, 180.0)];
        assert!(belt.dot(LUMINANCE) > 1.2 * shadow.dot(LUMINANCE), "{belt} {shadow}");
        assert!(belt.x / belt.z > 1.1 * shadow.x / shadow.z, "{belt} {shadow}");
    }

    /// Cells are not visible: radiance between its nodes is that of a ray there.
    #[test]
    fn the_table_has_the_radiance_of_rays() {
        for elevation in [42.0, 3.0, -6.0] {
            let settings = settings(elevation);
            let table = SkyTable::new(&settings, FINE);
            let scattering =
                Scattering::new(elevation.to_radians(), settings.turbidity, settings.albedo);
            for (height, azimuth) in
                [(0.3, 20.0), (1.1, 3.0), (7.0, 100.0), (42.0, 2.0), (70.0, 170.0)]
            {
                let at = sky_direction(height, 140.0 + azimuth);
                let cosine = at.dot(settings.sun);
                let ray = scattering.ray(f64::from(at.z));
                let Scattered { even, halo: of_halo } =
                    scattering.scattered(&ray, f64::from(cosine));
                let expected = even + halo(cosine) * of_halo;
                let error = (table.radiance(at) - expected).abs().max_element();
                assert!(
                    error < 0.05 * expected.max_element(),
                    "{elevation} {height} {azimuth}: {error} {expected}"
                );
            }
        }
    }

    /// In the open, about a sixth of the light on the ground comes from a clear sky if the sun is high (12 to 15 klx of about
    /// 75), and most of it if the sun is low.
    #[test]
    fn the_ratio_of_sky_and_sun_is_that_outdoors() {
        let share = |elevation: f64| {
            let settings = settings(elevation);
            let sky = SkyTable::new(&settings, COARSE).irradiance_of_ground().dot(LUMINANCE);
            let sun = sun_of(&settings).dot(LUMINANCE) * settings.sun.z;
            sky / (sky + sun)
        };
        assert!((0.12..0.25).contains(&share(42.0)), "{}", share(42.0));
        assert!((0.9..0.98).contains(&share(3.0)), "{}", share(3.0));
    }
}
