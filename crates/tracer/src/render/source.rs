//! Attributes of particles for shading: colour, id and velocity.

use std::iter::Sum;
use std::ops::Mul;

use glam::Vec3;

use super::aov::NO_ID;
use crate::scene::ColorMap;

/// Looks up attributes by the index of a particle in the frame, as in [`crate::surface::Intersection`].
pub trait ShadeSource: Sync {
    /// Base colour, linear RGB.
    fn color(&self, index: u32) -> Vec3;

    /// The base colour of all particles, if they have the same.
    fn constant_color(&self) -> Option<Vec3> {
        None
    }

    /// Base colour of a place between particles: of the weighted mean of what they are coloured by.
    /// Weights are positive.
    fn blended_color(&self, parts: &[(u32, f32)]) -> Vec3 {
        mean(parts, |i| self.color(i))
    }

    /// The value for the `id` channel.
    fn id(&self, index: u32) -> u32;

    /// Velocity in world units per time; zero if it is unknown.
    fn velocity(&self, index: u32) -> Vec3;

    /// The attribute that divides particles into parts, and the part of the particle.
    fn part(&self, index: u32) -> Option<(&str, i32)> {
        let _ = index;
        None
    }

    /// Whether particles may have an opacity below 1.
    fn is_translucent(&self) -> bool {
        false
    }

    /// How much of what is behind it the particle covers, 0 to 1.
    fn opacity(&self, index: u32) -> f32 {
        let _ = index;
        1.0
    }

    /// Stores the values of the attribute channels in `floats`, as many as [`super::layers::Layers::attributes`].
    fn attributes(&self, index: u32, floats: &mut [f32]) {
        let _ = index;
        floats.fill(0.0);
    }
}

/// The weighted mean of `of` over `parts`, in their order.
pub fn mean<T>(parts: &[(u32, f32)], of: impl Fn(u32) -> T) -> T
where
    T: Sum + Mul<f32, Output = T>,
{
    let total: f32 = parts.iter().map(|(_, weight)| weight).sum();
    let sum: T = parts.iter().map(|(i, weight)| of(*i) * *weight).sum();
    sum * (1.0 / total)
}

/// Base colours of a frame.
#[derive(Debug, Clone, Copy)]
pub enum Colors<'a> {
    /// One colour for all particles.
    Constant(Vec3),
    /// Linear RGB per particle.
    PerParticle(&'a [Vec3]),
    /// A scalar per particle, with a colour map.
    Mapped {
        /// The scalars.
        values: &'a [f32],
        /// The map with its range.
        map: &'a ColorMap,
    },
}

/// Opacities of a frame.
#[derive(Debug, Clone, Copy)]
pub enum Opacities<'a> {
    /// The same for all particles.
    Constant(f32),
    /// By a scalar per particle.
    Mapped {
        /// The scalars.
        values: &'a [f32],
        /// The values with opacity 0 and 1.
        range: [f32; 2],
    },
}

/// The opacity of a particle with this `value`; 0 if it is not a number.
pub fn opacity_of(value: f32, [clear, opaque]: [f32; 2]) -> f32 {
    let opacity = (value - clear) / (opaque - clear);
    if opacity > 0.0 { opacity.min(1.0) } else { 0.0 }
}

/// A [`ShadeSource`] over slices in the order of the particles.
#[derive(Debug, Clone, Copy)]
pub struct ParticleShading<'a> {
    /// Base colours.
    pub colors: Colors<'a>,
    /// Opacities.
    pub opacities: Opacities<'a>,
    /// Ids; by default the id of a particle is its index.
    pub ids: Option<&'a [u32]>,
    /// Velocities; zero by default.
    pub velocities: Option<&'a [Vec3]>,
    /// Name of the attribute with the parts of particles, and the parts.
    pub parts: Option<(&'a str, &'a [i32])>,
    /// The floats of attribute channels, one plane for each.
    pub attributes: &'a [Vec<f32>],
}

impl ParticleShading<'_> {
    /// One colour for all particles, and indices as ids.
    pub const fn constant(color: Vec3) -> Self {
        Self {
            colors: Colors::Constant(color),
            opacities: Opacities::Constant(1.0),
            ids: None,
            velocities: None,
            parts: None,
            attributes: &[],
        }
    }
}

impl ShadeSource for ParticleShading<'_> {
    fn color(&self, index: u32) -> Vec3 {
        let i = index as usize;
        // If slices are too short, return black; a panic would abort the job.
        match self.colors {
            Colors::Constant(color) => color,
            Colors::PerParticle(colors) => colors.get(i).copied().unwrap_or_default(),
            Colors::Mapped { values, map } => map.color(values.get(i).copied().unwrap_or(f32::NAN)),
        }
    }

    fn constant_color(&self) -> Option<Vec3> {
        match self.colors {
            Colors::Constant(color) => Some(color),
            Colors::PerParticle(_) | Colors::Mapped { .. } => None,
        }
    }

    fn blended_color(&self, parts: &[(u32, f32)]) -> Vec3 {
        match self.colors {
            Colors::Mapped { map, .. } if map.categories().is_some() => {
                mean(parts, |i| self.color(i))
            }
            Colors::Mapped { values, map } => {
                let value = |i: u32| values.get(i as usize).copied().unwrap_or(f32::NAN);
                map.color(mean(parts, value))
            }
            Colors::Constant(_) | Colors::PerParticle(_) => mean(parts, |i| self.color(i)),
        }
    }

    fn id(&self, index: u32) -> u32 {
        self.ids.map_or(index, |ids| ids.get(index as usize).copied().unwrap_or(NO_ID))
    }

    fn velocity(&self, index: u32) -> Vec3 {
        let velocities = self.velocities.unwrap_or_default();
        velocities.get(index as usize).copied().unwrap_or_default()
    }

    fn part(&self, index: u32) -> Option<(&str, i32)> {
        let (name, parts) = self.parts?;
        Some((name, *parts.get(index as usize)?))
    }

    fn is_translucent(&self) -> bool {
        !matches!(self.opacities, Opacities::Constant(1.0))
    }

    fn opacity(&self, index: u32) -> f32 {
        match self.opacities {
            Opacities::Constant(opacity) => opacity,
            Opacities::Mapped { values, range } => {
                let value = values.get(index as usize).copied();
                opacity_of(value.unwrap_or(f32::NAN), range)
            }
        }
    }

    fn attributes(&self, index: u32, floats: &mut [f32]) {
        for (number, float) in floats.iter_mut().enumerate() {
            let plane = self.attributes.get(number);
            let value = plane.and_then(|plane| plane.get(index as usize));
            *float = value.copied().unwrap_or_default();
        }
    }
}
