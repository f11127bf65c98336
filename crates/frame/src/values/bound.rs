//! Values of particles in memory or in a file.

use glam::DVec3;

use super::{Column, Value};

/// What values need beside the columns. Particles are those in memory, by index.
pub trait Context {
    /// The position of a particle in world coordinates.
    fn position(&self, particle: usize) -> DVec3;

    /// The place of a particle in its frame.
    fn file_index(&self, particle: usize) -> usize {
        particle
    }

    /// The radius of a particle; NaN if it is unknown.
    fn radius(&self, _particle: usize) -> f64 {
        f64::NAN
    }

    /// The distance of a particle from the camera along its view axis; NaN if it is unknown.
    fn depth(&self, _particle: usize) -> f64 {
        f64::NAN
    }

    /// The up direction.
    fn up(&self) -> DVec3;

    /// The time of the frame; NaN if it is unknown.
    fn time(&self) -> f64;
}

impl Value {
    /// This value of particles with the columns that `find` finds by their names.
    pub fn bind<C>(&self, find: impl FnOnce(&str) -> Option<C>) -> Option<Value<C>> {
        Some(match self {
            Self::Magnitude(name) => Value::Magnitude(find(name)?),
            Self::Component(name, component) => Value::Component(find(name)?, *component),
            Self::Position(axis) => Value::Position(*axis),
            Self::Height => Value::Height,
            Self::Depth => Value::Depth,
            Self::Index => Value::Index,
            Self::Radius => Value::Radius,
            Self::Time => Value::Time,
        })
    }
}

impl<C: Column> Value<C> {
    /// The value of a particle.
    pub fn get(&self, particle: usize, context: &impl Context) -> f64 {
        match self {
            Self::Magnitude(column) => column.magnitude(particle),
            Self::Component(column, component) => column.get(particle, *component),
            Self::Position(axis) => context.position(particle)[*axis],
            Self::Height => context.up().dot(context.position(particle)),
            Self::Depth => context.depth(particle),
            #[expect(clippy::cast_precision_loss, reason = "f64 holds all indices of a frame")]
            Self::Index => context.file_index(particle) as f64,
            Self::Radius => context.radius(particle),
            Self::Time => context.time(),
        }
    }

    /// Whether it is the length of a vector.
    pub fn is_length(&self) -> bool {
        matches!(self, Self::Magnitude(column) if column.components() > 1)
    }
}
