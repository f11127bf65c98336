//! The values that names in a condition stand for.

use glam::DVec3;
use spherule_formats::{Attribute, AttributeData, Positions, RawParticles, names};

use super::condition::NameUse;
use crate::attributes::{Named, ParticleValue, id_of};

/// Names of values that do not need an attribute; for messages.
pub const OTHER_NAMES: [&str; 6] = ["x", "y", "z", "height", "index", "id"];

/// A number for each particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value {
    /// World coordinate on an axis.
    Position(usize),
    /// World coordinate along a direction.
    Height(DVec3),
    /// Position of the particle in its frame.
    Index,
    /// The same number for all.
    Constant(f64),
    /// A component of the attribute with an index.
    Component { attribute: usize, component: usize },
    /// The magnitude of the attribute with an index.
    Magnitude(usize),
    /// A scalar attribute with an index, times a factor.
    Scaled { attribute: usize, factor: f64 },
}

/// A name without a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownName {
    /// The name.
    pub name: String,
    /// Where the condition has it, in characters from 1.
    pub column: usize,
}

impl Value {
    /// The value of `used` of particles with `attributes` at `time`, with heights along `up`.
    pub(super) fn of<A: Named>(
        used: &NameUse,
        attributes: &[A],
        time: Option<f64>,
        up: Option<DVec3>,
    ) -> Result<Self, UnknownName> {
        let name = used.name.to_ascii_lowercase();
        if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
            return Ok(Self::Position(axis));
        }
        if name == "id" {
            return Ok(Self::id(attributes));
        }
        let index_of = |name: &str| attributes.iter().position(|a| a.name() == name);
        let found = match ParticleValue::named(&used.name, attributes) {
            Some(ParticleValue::Magnitude(name)) => index_of(&name).map(Self::Magnitude),
            Some(ParticleValue::Component(name, component)) => {
                index_of(&name).map(|attribute| Self::Component { attribute, component })
            }
            Some(ParticleValue::Index) => Some(Self::Index),
            Some(ParticleValue::Radius) => radius(attributes),
            Some(ParticleValue::Position(axis)) => Some(Self::Position(axis)),
            Some(ParticleValue::Height) => up.map(Self::Height),
            // The camera depends on the particles that are drawn
            Some(ParticleValue::Depth) => None,
            None if name == "time" => time.map(Self::Constant),
            None => None,
        };
        found.ok_or_else(|| UnknownName { name: used.name.clone(), column: used.column })
    }

    /// The ids of particles, or their indices if they have none.
    pub(super) fn id<A: Named>(attributes: &[A]) -> Self {
        let ids = id_of(attributes).and_then(|ids| {
            let mut all = attributes.iter();
            all.position(|a| std::ptr::eq(a, ids))
        });
        ids.map_or(Self::Index, |attribute| Self::Component { attribute, component: 0 })
    }

    /// Writes the values of the particles from `first` on.
    pub(super) fn load(&self, particles: &RawParticles, first: usize, to: &mut [f64]) {
        let attribute = |index: usize| &particles.attributes[index];
        match *self {
            Self::Position(axis) => load_position(&particles.positions, axis, first, to),
            Self::Height(up) => fill(to, |i| up.dot(particles.positions.get(first + i))),
            Self::Index => fill(to, |i| (first + i) as f64),
            Self::Constant(value) => to.fill(value),
            Self::Component { attribute: index, component } => {
                load_component(attribute(index), component, first, to)
            }
            Self::Scaled { attribute: index, factor } => {
                load_component(attribute(index), 0, first, to);
                to.iter_mut().for_each(|value| *value *= factor);
            }
            Self::Magnitude(index) => {
                let attribute = attribute(index);
                match attribute.components {
                    1 => load_component(attribute, 0, first, to),
                    _ => load_magnitude(attribute, first, to),
                }
            }
        }
    }
}

/// The radius that files have.
fn radius<A: Named>(attributes: &[A]) -> Option<Value> {
    let named = |name: &str| {
        attributes.iter().position(|a| {
            a.components() == 1 && !a.is_integer() && a.name().eq_ignore_ascii_case(name)
        })
    };
    let mut found = names::RADII.iter();
    found.find_map(|(name, factor)| {
        named(name).map(|attribute| Value::Scaled { attribute, factor: *factor })
    })
}

fn fill(to: &mut [f64], value: impl Fn(usize) -> f64) {
    for (i, to) in to.iter_mut().enumerate() {
        *to = value(i);
    }
}

fn load_position(positions: &Positions, axis: usize, first: usize, to: &mut [f64]) {
    match positions {
        Positions::F32(all) => {
            let all = &all[first..first + to.len()];
            fill(to, |i| f64::from(all[i][axis]));
        }
        Positions::F64(all) => {
            let all = &all[first..first + to.len()];
            fill(to, |i| all[i][axis]);
        }
    }
}

/// Runs `$body` with `$v` bound to the numbers of `$data`, whatever their type.
macro_rules! with_numbers {
    ($data:expr, $v:ident => $body:expr) => {
        match $data {
            AttributeData::I8($v) => $body,
            AttributeData::U8($v) => $body,
            AttributeData::I16($v) => $body,
            AttributeData::U16($v) => $body,
            AttributeData::I32($v) => $body,
            AttributeData::U32($v) => $body,
            AttributeData::I64($v) => $body,
            AttributeData::U64($v) => $body,
            AttributeData::F32($v) => $body,
            AttributeData::F64($v) => $body,
        }
    };
}

#[expect(
    clippy::cast_precision_loss,
    clippy::cast_lossless,
    clippy::unnecessary_cast,
    reason = "one body for ten types; integers beyond 2^53 round"
)]
fn load_component(attribute: &Attribute, component: usize, first: usize, to: &mut [f64]) {
    let components = attribute.components;
    with_numbers!(&attribute.data, v => {
        let v = &v[first * components..(first + to.len()) * components];
        match components {
            1 => fill(to, |i| v[i] as f64),
            _ => fill(to, |i| v[i * components + component] as f64),
        }
    });
}

#[expect(
    clippy::cast_precision_loss,
    clippy::cast_lossless,
    clippy::unnecessary_cast,
    reason = "one body for ten types; integers beyond 2^53 round"
)]
fn load_magnitude(attribute: &Attribute, first: usize, to: &mut [f64]) {
    let components = attribute.components;
    with_numbers!(&attribute.data, v => {
        let v = &v[first * components..(first + to.len()) * components];
        if components == 3 {
            // The same sum, as a loop that the compiler can make vector instructions of
            let vectors = v.as_chunks::<3>().0;
            fill(to, |i| {
                let [x, y, z] = vectors[i].map(|value| value as f64);
                (x * x + y * y + z * z).sqrt()
            });
            return;
        }
        for (to, values) in to.iter_mut().zip(v.chunks_exact(components)) {
            let squares = values.iter().map(|value| (*value as f64) * (*value as f64));
            *to = squares.sum::<f64>().sqrt();
        }
    });
}
