//! Environments against integrals and single values. Each environment takes a while to make, as its map is resampled
//! whatever its size; tests need several.

use std::f32::consts::PI;

use super::*;

/// Points in the unit square, evenly spread (Roberts, 2018).
fn points(count: u32) -> impl Iterator<Item = [f32; 2]> {
    (0..count).map(|i| {
        let fraction =
            |step: u32| (step.wrapping_mul(i).wrapping_add(1 << 31) >> 8) as f32 / 16_777_216.0;
        [fraction(3_242_174_889), fraction(2_447_445_414)]
    })
}

/// Directions uniform over the sphere.
fn directions(count: u32) -> impl Iterator<Item = Vec3> {
    points(count).map(|[a, b]| {
        let z = 1.0 - 2.0 * a;
        let level = (1.0 - z * z).sqrt();
        let longitude = 2.0 * PI * b;
        Vec3::new(level * longitude.cos(), level * longitude.sin(), z)
    })
}

/// Axes that are not those of the world.
fn tilted() -> EnvironmentAxes {
    EnvironmentAxes::of_view(DVec3::new(1.0, 2.0, -0.5), DVec3::new(0.2, -0.3, 1.0), 33.0)
}

/// One bright pixel among faint ones.
fn bright_pixel(width: usize, height: usize, pixel: usize) -> Environment {
    let mut pixels = vec![Vec3::splat(0.01); width * height];
    pixels[pixel] = Vec3::new(9000.0, 7000.0, 5000.0);
    let map = RadianceMap::new(width, height, pixels).unwrap();
    Environment::from_map(tilted(), &map, Vec3::ONE)
}

fn all() -> Vec<(&'static str, Environment)> {
    vec![
        ("constant", Environment::constant(Vec3::new(0.5, 1.0, 2.0))),
        ("black", Environment::constant(Vec3::ZERO)),
        ("studio", studio(tilted(), Vec3::ONE)),
        ("bright", bright_pixel(512, 256, 40 * 512 + 511)),
        ("large", bright_pixel(1024, 512, 500 * 1024 + 3)),
        ("small", bright_pixel(8, 4, 13)),
        ("pole", bright_pixel(512, 256, 7)),
    ]
}

#[test]
fn the_density_integrates_to_one() {
    for (name, environment) in all() {
        // Exactly, texel by texel
        let table = environment.table();
        let count = u32::try_from(table.texel_count()).unwrap();
        let sum: f64 = (0..count).map(|texel| f64::from(table.texel(texel).1)).sum();
        let sum = sum * 4.0 * std::f64::consts::PI / f64::from(count);
        assert!((sum - 1.0).abs() < 1e-5, "{name}: {sum}");
    }
    // By directions, where the density is smooth enough for that
    let studio = studio(tilted(), Vec3::ONE);
    let count = 400_000;
    let pdf = |direction| f64::from(studio.table().radiance_and_pdf(direction).1);
    let mean: f64 = directions(count).map(pdf).sum::<f64>() / f64::from(count);
    assert!((mean * 4.0 * std::f64::consts::PI - 1.0).abs() < 0.01, "{mean}");
}

#[test]
fn samples_agree_with_their_direction() {
    for (name, environment) in all() {
        let (table, mut same, count) = (environment.table(), 0, 20_000);
        for u in points(count) {
            let sample = table.sample(u);
            assert!((sample.direction.length() - 1.0).abs() < 1e-5, "{name}: {u:?}");
            assert!(sample.pdf > 0.0, "{name}: {u:?}");
            // Rounding may move a direction to the next texel
            let (radiance, pdf) = table.radiance_and_pdf(sample.direction);
            same += u32::from(radiance == sample.radiance && pdf == sample.pdf);
        }
        assert!(same > count * 99 / 100, "{name}: {same} of {count}");
    }
}

#[test]
fn the_table_has_the_radiance_of_the_image() {
    let studio = studio(tilted(), Vec3::ONE);
    let (mut differences, count) = (0.0, 20_000);
    for direction in directions(count) {
        let (radiance, pdf) = studio.table().radiance_and_pdf(direction);
        differences += f64::from((radiance - studio.radiance(direction)).abs().max_element());
        // The density is proportional to the luminance
        let luminance = radiance.dot(LUMINANCE);
        let flux = studio.table().flux().dot(LUMINANCE);
        assert!((pdf * flux / luminance - 1.0).abs() < 5e-3, "{direction}: {pdf} {luminance}");
    }
    // The mean radiance is about 0.7; only the edges of lights differ
    assert!(differences / f64::from(count) < 0.04, "{differences}");
}

/// The integral of radiance times the squared cosine with an axis, by directions on a fine grid.
fn brute_force(environment: &Environment, axis: Vec3) -> f64 {
    let (columns, rows) = (4 * COLUMNS, 4 * ROWS);
    let mut sum = 0.0;
    for row in 0..rows {
        let edge = |row: usize| (row as f64 * std::f64::consts::PI / rows as f64).cos();
        let polar = (row as f64 + 0.5) * std::f64::consts::PI / rows as f64;
        let mut of_row = 0.0;
        for column in 0..columns {
            let longitude = (column as f64 + 0.5) * 2.0 * std::f64::consts::PI / columns as f64;
            let [x, y] = [polar.sin() * longitude.cos(), polar.sin() * longitude.sin()];
            let own = DVec3::new(x, y, polar.cos()).as_vec3();
            let axes = &environment.axes;
            let direction = own.x * axes.right + own.y * axes.back + own.z * axes.up;
            let radiance = environment.radiance(direction).y;
            of_row += f64::from(radiance * direction.dot(axis).powi(2));
        }
        sum += of_row * (edge(row) - edge(row + 1));
    }
    sum * 2.0 * std::f64::consts::PI / columns as f64
}

#[test]
fn the_mean_of_samples_is_the_integral() {
    let axis = Vec3::new(0.6, -0.48, 0.64);
    for (name, environment) in all() {
        let count = 200_000;
        let mean: f64 = points(count)
            .map(|u| {
                let sample = environment.table().sample(u);
                let part = sample.radiance.y * sample.direction.dot(axis).powi(2);
                f64::from(part / sample.pdf)
            })
            .sum::<f64>()
            / f64::from(count);
        let wanted = brute_force(&environment, axis);
        // A single pixel has another shape in the image than in the table, where it is up to four texels
        let tolerance = if ["constant", "black", "studio"].contains(&name) { 0.002 } else { 0.015 };
        assert!((mean - wanted).abs() <= tolerance * wanted, "{name}: {mean} {wanted}");
    }
}

#[test]
fn one_bright_pixel_keeps_its_power_and_is_found() {
    for (width, height, pixel) in
        [(512, 256, 70 * 512 + 100), (2048, 1024, 700 * 2048 + 99), (16, 8, 50)]
    {
        let environment = bright_pixel(width, height, pixel);
        // Power of the pixel alone
        let edge = |row: usize| (row as f64 * std::f64::consts::PI / height as f64).cos();
        let row = pixel / width;
        let solid_angle = (edge(row) - edge(row + 1)) * 2.0 * std::f64::consts::PI / width as f64;
        let power = 7000.0 * solid_angle;
        let faint = 0.01 * 4.0 * std::f64::consts::PI;
        let flat = |environment: &Environment| {
            let axes = [Vec3::X, Vec3::Y, Vec3::Z];
            axes.iter().map(|axis| brute_force(environment, *axis)).sum::<f64>()
        };
        let total = flat(&environment);
        assert!((total - power - faint).abs() < 0.02 * (power + faint), "{width}: {total} {power}");
        // Its share of the power is its share of the samples
        let found =
            points(4096).filter(|u| environment.table().sample(*u).radiance.y > 1.0).count();
        let wanted = 4096.0 * power / (power + faint);
        assert!(found as f64 > 0.98 * wanted, "{width}: {found} {wanted}");
    }
}

#[test]
fn a_constant_environment_is_uniform() {
    let environment = Environment::constant(Vec3::new(0.5, 1.0, 2.0));
    for direction in directions(500) {
        let (radiance, pdf) = environment.table().radiance_and_pdf(direction);
        assert_eq!(environment.radiance(direction), radiance);
        assert!((radiance - Vec3::new(0.5, 1.0, 2.0)).abs().max_element() < 1e-6);
        assert!((pdf * 4.0 * PI - 1.0).abs() < 2e-3, "{direction}: {pdf}");
        let irradiance = environment.irradiance(direction);
        assert!((irradiance.y / PI - 1.0).abs() < 1e-3, "{direction}: {irradiance}");
    }
    assert!(!environment.is_black());
    assert!(Environment::constant(Vec3::ZERO).is_black());
}

#[test]
fn directions_of_a_map_are_where_they_are_shown() {
    // Four columns: behind, left, front and right of the viewer who looks along +y; two rows.
    let colors: Vec<Vec3> = (0..8_u8).map(|i| Vec3::splat(f32::from(i))).collect();
    let map = RadianceMap::new(4, 2, colors).unwrap();
    let axes = |rotation| EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, rotation);
    let at = |rotation: f64, direction: Vec3| {
        let environment = Environment::from_map(axes(rotation), &map, Vec3::ONE);
        environment.radiance(direction.normalize()).x
    };
    // The middles of the columns are 45 degrees off.
    let [front_left, front_right] = [Vec3::new(-1.0, 1.0, 0.3), Vec3::new(1.0, 1.0, 0.3)];
    assert!((at(0.0, front_left) - 1.0).abs() < 1e-4);
    assert!((at(0.0, front_right) - 2.0).abs() < 1e-4);
    assert!((at(0.0, front_left.with_z(-0.3)) - 5.0).abs() < 1e-4);
    // Turned left by a quarter, what was on the right is on the left.
    assert!((at(90.0, front_left) - 2.0).abs() < 1e-4);
    assert!((at(90.0, Vec3::new(-1.0, -1.0, 0.3)) - 1.0).abs() < 1e-4);
}

#[test]
fn a_studio_has_its_key_light_on_the_left_of_the_viewer() {
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    let environment = studio(axes, Vec3::ONE);
    let key = environment.radiance(Vec3::new(-0.75, -0.55, 1.0).normalize());
    assert!(key.x > 35.0, "{key}");
    assert!(environment.radiance(Vec3::new(0.75, -0.55, 1.0).normalize()).x < 1.5);
    let share = |normal: Vec3| environment.irradiance(normal) / PI;
    let (up, down) = (share(Vec3::Z), share(Vec3::NEG_Z));
    let towards_viewer = share(Vec3::new(0.0, -1.0, 0.35).normalize());
    assert!((up.y - 1.31).abs() < 0.05, "{up}");
    assert!((towards_viewer.y - 0.95).abs() < 0.05, "{towards_viewer}");
    assert!((down.y - 0.19).abs() < 0.03, "{down}");
    // Twice as bright, it is sampled in the same way.
    let twice = studio(axes, Vec3::splat(2.0));
    let direction = |e: &Environment| e.table().sample([0.3, 0.7]).direction;
    assert_eq!(direction(&twice), direction(&environment));
}

#[test]
fn extreme_values_stay_finite() {
    let map = |value: f32| {
        let mut pixels = vec![Vec3::ZERO; 32];
        pixels[11] = Vec3::splat(value);
        RadianceMap::new(8, 4, pixels).unwrap()
    };
    for (value, scale) in
        [(f32::MAX, 1.0), (f32::MAX, f32::MAX), (1e-38, 1.0), (f32::from_bits(1), 1e-3)]
    {
        let environment = Environment::from_map(tilted(), &map(value), Vec3::splat(scale));
        for u in points(64) {
            let sample = environment.table().sample(u);
            let estimate = sample.radiance / sample.pdf;
            assert!(estimate.is_finite() && sample.pdf > 0.0, "{value} {scale}: {sample:?}");
        }
        assert!(environment.irradiance(Vec3::Z).is_finite());
    }
    // Directions that are not numbers have some radiance, and no panic.
    let environment = studio(tilted(), Vec3::ONE);
    for direction in [Vec3::NAN, Vec3::INFINITY, Vec3::ZERO, Vec3::splat(-1e30)] {
        let _ = environment.radiance(direction);
        let _ = environment.table().radiance_and_pdf(direction);
    }
    assert!(environment.byte_len() < 4 << 20);
}

#[test]
fn reduced_maps_give_the_same_environment() {
    for (width, height) in [(2, 1), (700, 350), (1024, 512), (1500, 751)] {
        let pixel = |i: usize| Vec3::new((i % 7) as f32, (i % 11) as f32 * 0.5, (i % 1000) as f32);
        let pixels = (0..width * height).map(pixel).collect();
        let map = RadianceMap::new(width, height, pixels).unwrap();
        let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 20.0);
        let of = |map: &RadianceMap| Environment::from_map(axes, map, Vec3::ONE);
        assert!(of(&map) == of(&map.reduced()), "{width}x{height}");
    }
}
