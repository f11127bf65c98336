//! Emission of photons: each light sends photons towards the particles only.

use std::f32::consts::PI;

use glam::Vec3;

use crate::render::{
    lights::{Beam, PhotonSource},
    sampler::PathSeed,
    settings::RenderSettings,
    shading::{disc, in_cone, tangents},
};
use crate::scene::environment::LUMINANCE;
use spherule_tree::ray::Ray;

/// Dimensions of the random numbers of all photons: position and direction.
const POSITION: u32 = 0;
const DIRECTION: u32 = 1;

/// Random numbers of photons; no pixel has this row.
const PHOTONS: u32 = u32::MAX;

/// Least cosine in the estimate of the power of a flat light: its plane may cut through the particles.
const MIN_COSINE: f32 = 0.05;

/// The photons of one light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Emitter {
    source: Source,
    /// The light group of the light.
    pub(super) group: usize,
    pub(super) photons: u32,
    pub(super) seed: PathSeed,
}

/// How photons leave a light.
#[derive(Debug, Clone, Copy)]
enum Source {
    Parallel(Parallel),
    Local(Local),
}

/// Parallel light that covers the particles.
#[derive(Debug, Clone, Copy)]
struct Parallel {
    beam: Beam,
    /// Centre of the particles.
    center: Vec3,
    /// Half the edges of a rectangle that faces the light and covers the particles.
    sides: [Vec3; 2],
    /// Distance between that rectangle and the origin of the photons.
    distance: f32,
}

/// A light at a finite distance, and the sphere around the particles at which it aims.
#[derive(Debug, Clone, Copy)]
struct Local {
    light: PhotonSource,
    center: Vec3,
    radius: f32,
}

impl Emitter {
    /// Emitters for these lights, each with its light group, and particles in the box with these corners. They share
    /// the photons of `settings` by their power.
    pub(super) fn of(
        lights: &[(usize, PhotonSource)],
        particles: [Vec3; 2],
        settings: &RenderSettings,
    ) -> Vec<Self> {
        // Find the power of each light that reaches the particles
        let source =
            |(group, light): &(usize, PhotonSource)| (*group, Source::new(*light, particles));
        let sources: Vec<(usize, Source)> = lights.iter().map(source).collect();
        let powers: Vec<f64> = sources.iter().map(|(_, source)| source.power()).collect();
        let whole: f64 = powers.iter().sum();
        // Share the photons by power, at least one for each light
        let share =
            |power: f64| if whole > 0.0 { power / whole } else { 1.0 / powers.len() as f64 };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the number of all photons"
        )]
        let count = |power: f64| (share(power) * f64::from(settings.photons)).ceil() as u32;
        let emitter = |(number, ((group, source), power)): (u32, ((usize, Source), &f64))| Self {
            source,
            group,
            photons: count(*power).max(1),
            seed: PathSeed::of_pixel(number, PHOTONS).in_sequence(settings.seed),
        };
        (0..).zip(sources.into_iter().zip(&powers)).map(emitter).collect()
    }

    /// Whether its light is parallel, or almost, and comes from infinitely far away.
    pub(super) const fn is_parallel(&self) -> bool {
        matches!(self.source, Source::Parallel(_))
    }

    /// The ray of a photon, and its flux. `None` if no light leaves in its direction.
    pub(super) fn photon(&self, photon: u32) -> Option<(Ray, Vec3)> {
        let position = self.seed.get_2d(POSITION, photon);
        let direction = self.seed.get_2d(DIRECTION, photon);
        let photons = self.photons as f32;
        match &self.source {
            Source::Parallel(light) => {
                let flux = light.beam.irradiance * (light.area() / photons);
                Some((light.ray(position, direction), flux))
            }
            Source::Local(light) => {
                let (ray, flux) = light.ray(position, direction)?;
                Some((ray, flux / photons))
            }
        }
    }
}

impl Source {
    fn new(light: PhotonSource, [min, max]: [Vec3; 2]) -> Self {
        let (center, half) = (0.5 * (min + max), 0.5 * (max - min));
        match light {
            PhotonSource::Distant(beam) => Self::Parallel(Parallel::new(beam, center, half)),
            _ => Self::Local(Local { light, center, radius: half.length() }),
        }
    }

    /// Luminance of the flux towards the particles, estimated.
    fn power(&self) -> f64 {
        let flux = match self {
            Self::Parallel(light) => light.beam.irradiance * light.area(),
            Self::Local(light) => light.flux(),
        };
        let power = f64::from(flux.dot(LUMINANCE));
        if power.is_finite() { power.max(0.0) } else { 0.0 }
    }
}

impl Parallel {
    fn new(beam: Beam, center: Vec3, half: Vec3) -> Self {
        let distance = 2.0 * half.length();
        let spread = distance * beam.spread();
        // A box reaches as far along an axis as its half edges do together
        let reach = |axis: Vec3| axis.abs().dot(half) + spread;
        let sides = tangents(beam.to_light.to_array()).map(Vec3::from_array);
        Self { beam, center, sides: sides.map(|axis| reach(axis) * axis), distance }
    }

    /// The area of the rectangle.
    fn area(&self) -> f32 {
        4.0 * self.sides[0].length() * self.sides[1].length()
    }

    fn ray(&self, position: [f32; 2], direction: [f32; 2]) -> Ray {
        let [x, y] = position.map(|u| 2.0 * u - 1.0);
        let to_light = self.beam.direction(direction);
        let target = self.center + x * self.sides[0] + y * self.sides[1];
        Ray::new(target + self.distance * to_light, -to_light)
    }
}

impl Local {
    /// Directions from `origin` towards the particles: the axis of a cone, and 1 minus the cosine of half its opening
    /// angle; all directions from inside the sphere around the particles.
    fn cone(&self, origin: Vec3) -> (Vec3, f32) {
        let to_center = self.center - origin;
        let axis = to_center.normalize_or(Vec3::Z);
        let sin2 = self.radius * self.radius / to_center.length_squared();
        // Written so that NaN counts as inside
        let cap = if sin2 < 1.0 { sin2 / (1.0 + (1.0 - sin2).sqrt()) } else { 2.0 };
        (axis, cap)
    }

    /// The flux of all photons, estimated from the centre of the light.
    fn flux(&self) -> Vec3 {
        let solid_angle = |origin: Vec3| 2.0 * PI * self.cone(origin).1;
        match self.light {
            PhotonSource::Point { position, intensity } => solid_angle(position) * intensity,
            PhotonSource::Sphere { center, radius, radiance } => {
                PI * radius * radius * solid_angle(center) * radiance
            }
            PhotonSource::Panel { center, axes, area, radiance, .. } => {
                let cosine = axes[2].dot((self.center - center).normalize_or(axes[2]));
                area * cosine.max(MIN_COSINE) * solid_angle(center) * radiance
            }
            PhotonSource::Distant(_) => Vec3::ZERO,
        }
    }

    /// The ray of a photon, and the flux that it would have alone.
    fn ray(&self, position: [f32; 2], direction: [f32; 2]) -> Option<(Ray, Vec3)> {
        // Choose a point of the light; the power of a point does not depend on the direction
        let (origin, normal, power) = match self.light {
            PhotonSource::Point { position, intensity } => (position, None, intensity),
            PhotonSource::Sphere { center, radius, radiance } => {
                let normal = Vec3::from_array(in_cone([0.0, 0.0, 1.0], 2.0, position));
                let area = 4.0 * PI * radius * radius;
                (center + radius * normal, Some(normal), area * radiance)
            }
            PhotonSource::Panel { center, axes, half, is_ellipse, area, radiance } => {
                let [x, y] =
                    if is_ellipse { disc(position) } else { position.map(|u| 2.0 * u - 1.0) };
                let origin = center + x * half[0] * axes[0] + y * half[1] * axes[1];
                (origin, Some(axes[2]), area * radiance)
            }
            PhotonSource::Distant(_) => return None,
        };
        // Choose a direction towards the particles
        let (axis, cap) = self.cone(origin);
        let direction = Vec3::from_array(in_cone(axis.to_array(), cap, direction));
        let cosine = normal.map_or(1.0, |normal| normal.dot(direction));
        let flux = (2.0 * PI * cap * cosine) * power;
        (cosine > 0.0 && flux.is_finite()).then(|| (Ray::new(origin, direction), flux))
    }
}
