//! Attributes of particles for shading: colour, id and velocity.

use std::iter::Sum;
use std::ops::Mul;

use glam::Vec3;

use super::aov::NO_ID;
use crate::scene::{ColorMap, MaterialId};

/// Looks up attributes by the index of a particle in the frame, as in [`spherule_surface::Intersection`].
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

    /// The styles of the last particles, with rising indices.
    fn styles(&self) -> &[StyleShading<'_>] {
        &[]
    }

    /// The material of a particle whose style has its own.
    fn style(&self, index: u32) -> Option<MaterialId> {
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

/// How the particles from one index on are drawn, up to those of the next style.
#[derive(Debug, Clone, Copy)]
pub struct StyleShading<'a> {
    /// Index of the first particle.
    pub first: u32,
    /// The material.
    pub material: MaterialId,
    /// Base colours; slices are of all particles of the frame.
    pub colors: Colors<'a>,
    /// Opacities.
    pub opacities: Opacities<'a>,
}

/// A [`ShadeSource`] over slices in the order of the particles.
#[derive(Debug, Clone)]
pub struct ParticleShading<'a> {
    /// Base colours, unless a style has its own.
    pub colors: Colors<'a>,
    /// Opacities, unless a style has its own.
    pub opacities: Opacities<'a>,
    /// The styles of the last particles, with rising indices.
    pub styles: Vec<StyleShading<'a>>,
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
            styles: Vec::new(),
            ids: None,
            velocities: None,
            parts: None,
            attributes: &[],
        }
    }
}

impl<'a> ParticleShading<'a> {
    /// The style of a particle, if it is not drawn like the first ones.
    #[inline]
    fn style_of(&self, index: u32) -> Option<&StyleShading<'a>> {
        self.styles.iter().rev().find(|style| style.first <= index)
    }

    /// The colours of the style of a particle.
    #[inline]
    fn colors_of(&self, index: u32) -> &Colors<'a> {
        self.style_of(index).map_or(&self.colors, |style| &style.colors)
    }
}

impl ShadeSource for ParticleShading<'_> {
    fn color(&self, index: u32) -> Vec3 {
        let i = index as usize;
        // If slices are too short, return black; a panic would abort the job.
        match *self.colors_of(index) {
            Colors::Constant(color) => color,
            Colors::PerParticle(colors) => colors.get(i).copied().unwrap_or_default(),
            Colors::Mapped { values, map } => map.color(values.get(i).copied().unwrap_or(f32::NAN)),
        }
    }

    fn constant_color(&self) -> Option<Vec3> {
        match self.colors {
            Colors::Constant(color) if self.styles.is_empty() => Some(color),
            _ => None,
        }
    }

    fn blended_color(&self, parts: &[(u32, f32)]) -> Vec3 {
        // A surface belongs to particles of one style
        let first = parts.first().map_or(0, |(particle, _)| *particle);
        match *self.colors_of(first) {
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

    fn styles(&self) -> &[StyleShading<'_>] {
        &self.styles
    }

    fn style(&self, index: u32) -> Option<MaterialId> {
        self.style_of(index).map(|style| style.material)
    }

    fn is_translucent(&self) -> bool {
        let is_opaque = |opacities: &Opacities<'_>| matches!(opacities, Opacities::Constant(1.0));
        !is_opaque(&self.opacities) || self.styles.iter().any(|style| !is_opaque(&style.opacities))
    }

    fn opacity(&self, index: u32) -> f32 {
        match *self.style_of(index).map_or(&self.opacities, |style| &style.opacities) {
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
