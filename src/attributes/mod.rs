//! Attributes with a meaning to the program, by their names, and the values of particles that users name.

use spherule_formats::native::{AttributeView, StoredType};
use spherule_formats::{Attribute, AttributeData, ScalarType, names};

mod value;

pub use value::{GEOMETRIC_VALUES, ParticleValue, SPEED, shown_name};

/// An attribute by name and number of components, in memory or in a file.
pub trait Named {
    /// Its name.
    fn name(&self) -> &str;
    /// Components per particle.
    fn components(&self) -> usize;
    /// Whether its values are integers.
    fn is_integer(&self) -> bool;
}

impl Named for Attribute {
    fn name(&self) -> &str {
        &self.name
    }

    fn components(&self) -> usize {
        self.components
    }

    fn is_integer(&self) -> bool {
        !matches!(self.data, AttributeData::F32(_) | AttributeData::F64(_))
    }
}

impl Named for AttributeView<'_> {
    fn name(&self) -> &str {
        self.name()
    }

    fn components(&self) -> usize {
        self.components()
    }

    fn is_integer(&self) -> bool {
        matches!(self.stored(), StoredType::Plain(kind) if !matches!(kind, ScalarType::F32 | ScalarType::F64))
    }
}

/// The attribute with velocities, if there is one.
pub fn velocity_of<A: Named>(attributes: &[A]) -> Option<&A> {
    names::VELOCITY.iter().find_map(|name| {
        attributes.iter().find(|a| a.components() == 3 && a.name().eq_ignore_ascii_case(name))
    })
}

/// The attribute with ids, if there is one. An exact match of the name is preferred over one that ignores case.
pub fn id_of<A: Named>(attributes: &[A]) -> Option<&A> {
    names::ID.iter().find_map(|name| {
        let exact = attributes.iter().find(|a| a.name() == *name);
        let alike = || attributes.iter().find(|a| a.name().eq_ignore_ascii_case(name));
        exact.or_else(alike).filter(|a| a.components() == 1)
    })
}

/// Names of attributes that divide particles into parts, the most specific first.
pub const PART_NAMES: [&str; 3] = ["part", "type", "phase"];

/// The attribute that divides particles into parts, if there is one. Only integers do.
pub fn part_of<A: Named>(attributes: &[A]) -> Option<&A> {
    let is_part = |a: &&A, name: &str| a.components() == 1 && a.name().eq_ignore_ascii_case(name);
    let mut names = PART_NAMES.iter();
    names.find_map(|name| attributes.iter().find(|a| is_part(a, name) && a.is_integer()))
}
