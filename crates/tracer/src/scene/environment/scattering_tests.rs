//! Scattered light against a Monte Carlo simulation of the same air, without the approximations of the marched rays.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::*;
use crate::scene::environment::spectrum::OpticalDepths;

/// Random numbers of 0 to 1 (Marsaglia, "Xorshift RNGs", 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// A unit vector at an angle with the given `cosine` from `axis`.
    fn around(&mut self, axis: DVec3, cosine: f64) -> DVec3 {
        let turn = self.next() * TAU;
        let side = axis.any_orthonormal_vector();
        let level = (1.0 - cosine * cosine).max(0.0).sqrt();
        cosine * axis + level * (turn.cos() * side + turn.sin() * axis.cross(side))
    }

    /// The cosine of an angle of scattering.
    fn scattering(&mut self, by_molecules: bool) -> f64 {
        if by_molecules {
            loop {
                let cosine = 2.0 * self.next() - 1.0;
                if 2.0 * self.next() < 1.0 + cosine * cosine {
                    return cosine;
                }
            }
        }
        let mut u = narrow(self.next());
        let lobe = LOBES.into_iter().find(|(weight, _)| {
            u -= weight;
            u < 0.0
        });
        let g = f64::from(lobe.unwrap_or(LOBES[1]).1);
        let q = (1.0 - g * g) / (1.0 - g + 2.0 * g * self.next());
        (1.0 + g * g - q * q) / (2.0 * g)
    }
}

/// Air of one wavelength, and the sun.
struct Air1 {
    depths: OpticalDepths,
    sun: DVec3,
    albedo: f64,
}

/// Albedo of the aerosols.
const AEROSOLS: f64 = 0.93;

impl Air1 {
    /// Extinction by molecules, aerosols and ozone at a distance from the centre of the earth, per km.
    fn extinction(&self, radius: f64) -> [f64; 3] {
        let density = Air::density(radius - EARTH);
        let OpticalDepths { rayleigh, aerosols, ozone } = self.depths;
        [rayleigh * density.molecules, aerosols * density.aerosols, ozone * density.ozone]
    }

    /// The part of the light of the sun that arrives at a place.
    fn sunlight(&self, place: DVec3) -> f64 {
        let point = Point { radius: place.length(), rise: place.normalize().dot(self.sun) };
        let air = Air::above(point);
        let OpticalDepths { rayleigh, aerosols, ozone } = self.depths;
        let depth = rayleigh * air.molecules + aerosols * air.aerosols + ozone * air.ozone;
        point.visible_sun() * libm::exp(-depth)
    }

    /// Irradiance of the sky on the ground, in parts of that of the sun above the air: the mean of `count` paths of light,
    /// from the ground, through free flights by delta tracking (Woodcock, 1965).
    fn irradiance(&self, count: u32) -> f64 {
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let mut sum = 0.0;
        for _ in 0..count {
            let mut place = DVec3::Z * (EARTH + 1e-5);
            let up = random.next().sqrt();
            let mut direction = random.around(DVec3::Z, up);
            let mut weight = 1.0;
            while weight > 1e-3 && self.fly(&mut place, direction, &mut random) {
                if place.length() <= EARTH {
                    let normal = place.normalize();
                    place = (EARTH + 1e-5) * normal;
                    weight *= self.albedo;
                    sum += weight * self.sunlight(place) * normal.dot(self.sun).max(0.0);
                    let up = random.next().sqrt();
                    direction = random.around(normal, up);
                    continue;
                }
                let [molecules, aerosols, ozone] = self.extinction(place.length());
                let scattered = molecules + AEROSOLS * aerosols;
                weight *= scattered / (molecules + aerosols + ozone);
                let cosine = direction.dot(self.sun);
                let phases = 0.1875 / PI * (1.0 + cosine * cosine) * molecules
                    + f64::from(halo(narrow(cosine))) * AEROSOLS * aerosols;
                sum += weight * self.sunlight(place) * PI * phases / scattered;
                let by_molecules = random.next() * scattered < molecules;
                let cosine = random.scattering(by_molecules);
                direction = random.around(direction, cosine);
            }
        }
        sum / f64::from(count)
    }

    /// Moves `place` to where light along `direction` meets air or ground; false if it leaves the air.
    fn fly(&self, place: &mut DVec3, direction: DVec3, random: &mut Random) -> bool {
        loop {
            let radius = place.length();
            // Extinction is not larger within a layer above the next lower border
            let lower = [30.0, 12.0, 4.0, 0.0].into_iter().find(|height| radius - EARTH > *height);
            let bottom = EARTH + lower.unwrap_or(0.0);
            let bound = self.extinction(bottom).iter().sum::<f64>() + self.depths.ozone / 15.0;
            let point = Point { radius, rise: place.dot(direction) / radius };
            let border = if point.rise < 0.0 { bottom } else { f64::INFINITY };
            let along = radius * point.rise;
            let square = along * along - radius * radius + border * border;
            let down = if border.is_finite() && square > 0.0 {
                -along - square.sqrt()
            } else {
                f64::INFINITY
            };
            let flight = -libm::log(1.0 - random.next()) / bound;
            if flight > down {
                *place += (down + 1e-6) * direction;
                if bottom <= EARTH {
                    return true;
                }
                continue;
            }
            *place += flight * direction;
            if place.length() > EARTH + TOP {
                return false;
            }
            let all: f64 = self.extinction(place.length()).iter().sum();
            if random.next() * bound < all {
                return true;
            }
        }
    }
}

/// Irradiance of the sky by rays.
fn irradiance_by_rays(scattering: &Scattering, elevation: f64) -> Vec3 {
    let (rows, columns) = (40, 20);
    let mut sum = Vec3::ZERO;
    for row in 0..rows {
        let root = (f64::from(row) + 0.5) / f64::from(rows);
        let angle = root * root * PI / 2.0;
        let ray = scattering.ray(angle.sin());
        let weight =
            angle.sin() * angle.cos() * PI * root / f64::from(rows) * TAU / f64::from(columns);
        for column in 0..columns {
            let turn = (f64::from(column) + 0.5) / f64::from(columns) * PI;
            let cosine = angle.sin() * elevation.sin() + angle.cos() * elevation.cos() * turn.cos();
            let Scattered { even, halo: of_halo } = scattering.scattered(&ray, cosine);
            sum += narrow(weight) * (even + halo(narrow(cosine)) * of_halo);
        }
    }
    sum
}

/// Light of the sky on the ground, from a high sun to a dusk. The noise of the simulation is 2 %.
#[test]
fn irradiance_is_that_of_a_simulation() {
    let (turbidity, albedo) = (2.5, 0.2);
    let bands = Bands::new(turbidity);
    for (elevation, count) in [(60.0_f64, 8000), (10.0, 16_000), (3.0, 8000), (-3.0, 16_000)] {
        let elevation = elevation.to_radians();
        let sun = DVec3::new(elevation.cos(), 0.0, elevation.sin());
        let simulated = bands.depths.map(|depths| {
            narrow(Air1 { depths, sun, albedo: f64::from(albedo) }.irradiance(count))
        });
        let expected = bands.rgb(&simulated);
        let found = irradiance_by_rays(&Scattering::new(elevation, turbidity, albedo), elevation);
        let error = (found - expected).abs().max_element();
        assert!(error < 0.1 * expected.max_element(), "{elevation}: {found} {expected}");
    }
}

/// Phase functions have a mean of 1 over all directions.
#[test]
fn the_halo_has_all_of_the_light() {
    let count = 200_000;
    let cosine = |i: i32| 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
    let sum: f64 = (0..count).map(|i| f64::from(halo(narrow(cosine(i))))).sum();
    let mean = 4.0 * PI * sum / f64::from(count);
    assert!((mean - 1.0).abs() < 1e-3, "{mean}");
    // Mie scattering at 5 and 30 degrees, see LOBES
    for (angle, expected) in [(5.0_f64, 15.07), (30.0, 3.45), (90.0, 0.311)] {
        let found = 4.0 * PI * f64::from(halo(narrow(angle.to_radians().cos())));
        assert!((found / expected - 1.0).abs() < 0.15, "{angle}: {found}");
    }
}
