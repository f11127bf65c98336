//! The values that names in a condition stand for, loaded for blocks of particles.

use glam::DVec3;
use spherule_frame::values::{Column, Context, Named, Value};
use spherule_frame::with_values;
use spherule_frame::{Attribute, Positions, RawParticles, names};

use super::condition::NameUse;

/// A name without a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownName {
    /// The name.
    pub name: String,
    /// Where the condition has it, in characters from 1.
    pub column: usize,
    /// Why it has none.
    pub fault: NameFault,
}

/// Why a name in a condition has no value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NameFault {
    /// It is not the name of a value.
    NoValue,
    /// It is text that no particle has.
    NoText {
        /// The value that it is compared with.
        of: String,
        /// The texts of this value.
        known: Vec<String>,
    },
    /// It is a column of text, and a number is needed.
    NotNumber {
        /// A text of the column.
        example: String,
    },
}

impl UnknownName {
    /// What is wrong with text; None if the name should be that of a value.
    pub fn text_fault(&self, hint: &str) -> Option<String> {
        const LISTED: usize = 12;
        let name = &self.name;
        let (of, known) = match &self.fault {
            NameFault::NoValue => return None,
            NameFault::NoText { of, known } => (of, known),
            NameFault::NotNumber { example } => {
                return Some(format!(
                    "`{name}` is text, not a number; compare it with text in quotes by ==, != or in, as in {name} == \
                     '{example}'"
                ));
            }
        };
        let listed: Vec<String> =
            known.iter().take(LISTED).map(|text| format!("`{text}`")).collect();
        let more = if known.len() > LISTED { ", ..." } else { "" };
        Some(if known.is_empty() {
            format!("`{of}` has numbers, and none of them is called `{name}`")
        } else {
            format!("`{of}` has no value `{name}`{hint}; it has {}{more}", listed.join(", "))
        })
    }
}

/// The value of `used` of particles with `attributes` at `time`, with heights along `up`.
pub(super) fn value_of<A: Named>(
    used: &NameUse,
    attributes: &[A],
    time: Option<f64>,
    up: Option<DVec3>,
) -> Result<Value, UnknownName> {
    let is_known = |value: &Value| match value {
        Value::Time => time.is_some(),
        Value::Height => up.is_some(),
        Value::Radius => radius_of(attributes).is_some(),
        // The camera depends on the particles that are drawn
        Value::Depth => false,
        _ => true,
    };
    let found = Value::named(&used.name, attributes).filter(is_known);
    found.ok_or_else(|| UnknownName {
        name: used.name.clone(),
        column: used.column,
        fault: NameFault::NoValue,
    })
}

/// The column with the radii that files have, and the factor that makes radii of them.
fn radius_of<A: Named>(attributes: &[A]) -> Option<(&A, f64)> {
    names::RADII.iter().find_map(|(name, factor)| {
        let is_radius =
            |a: &&A| a.components() == 1 && !a.is_integer() && a.name().eq_ignore_ascii_case(name);
        Some((attributes.iter().find(is_radius)?, *factor))
    })
}

/// Particles as they are in a file.
#[derive(Clone, Copy)]
pub(super) struct FileContext<'a> {
    particles: &'a RawParticles,
    radius: Option<(&'a Attribute, f64)>,
    up: DVec3,
}

impl<'a> FileContext<'a> {
    pub(super) fn new(particles: &'a RawParticles, up: Option<DVec3>) -> Self {
        let radius = radius_of(&particles.attributes);
        Self { particles, radius, up: up.unwrap_or(DVec3::NAN) }
    }

    /// The value of these particles.
    pub(super) fn bind(&self, value: &Value) -> Option<Value<&'a Attribute>> {
        let mut all = self.particles.attributes.iter();
        value.bind(|name| all.find(|attribute| attribute.name == name))
    }

    /// Writes the values of the particles from `first` on.
    pub(super) fn load(&self, value: Value<&Attribute>, first: usize, to: &mut [f64]) {
        match value {
            Value::Position(axis) => {
                load_position(&self.particles.positions, axis, first, to);
            }
            Value::Component(attribute, component) => {
                load_component(attribute, component, first, to);
            }
            Value::Magnitude(attribute) if attribute.components == 1 => {
                load_component(attribute, 0, first, to);
            }
            Value::Magnitude(attribute) => load_magnitude(attribute, first, to),
            other => fill(to, |i| other.get(first + i, self)),
        }
    }
}

impl Context for FileContext<'_> {
    fn position(&self, particle: usize) -> DVec3 {
        self.particles.positions.get(particle)
    }

    fn radius(&self, particle: usize) -> f64 {
        self.radius.map_or(f64::NAN, |(column, factor)| column.get(particle, 0) * factor)
    }

    fn up(&self) -> DVec3 {
        self.up
    }

    fn time(&self) -> f64 {
        self.particles.time.unwrap_or(f64::NAN)
    }
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

#[expect(
    clippy::cast_precision_loss,
    clippy::cast_lossless,
    clippy::unnecessary_cast,
    reason = "one body for ten types; integers beyond 2^53 round"
)]
fn load_component(attribute: &Attribute, component: usize, first: usize, to: &mut [f64]) {
    let components = attribute.components;
    with_values!(&attribute.data, v => {
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
    with_values!(&attribute.data, v => {
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
