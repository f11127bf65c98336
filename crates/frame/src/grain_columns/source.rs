//! Where the numbers of an orientation or a size are: components of attributes.

use super::GrainColumnError;
use crate::Attribute;
use crate::values::Value;

/// Greatest number of numbers: those of a matrix.
pub(super) const MAX_NUMBERS: usize = 9;

/// Components of attributes, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Sources(Vec<Source>);

/// A component of an attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Source {
    attribute: usize,
    component: usize,
}

impl Sources {
    /// All components of the attribute `name`, if it has `components`.
    pub(super) fn vector(
        attributes: &[Attribute],
        is_name: impl Fn(&str) -> bool,
        components: usize,
    ) -> Option<Self> {
        let is_found = |a: &Attribute| a.components == components && is_name(&a.name);
        let attribute = attributes.iter().position(is_found)?;
        Some(Self((0..components).map(|component| Source { attribute, component }).collect()))
    }

    /// The scalars with these names, or the components of a vector whose name they extend.
    pub(super) fn scalars(attributes: &[Attribute], names: &[&str]) -> Option<Self> {
        let source = |name: &&str| {
            let is_found = |a: &Attribute| a.components == 1 && a.name.eq_ignore_ascii_case(name);
            attributes.iter().position(is_found).map(|attribute| Source { attribute, component: 0 })
        };
        names.iter().map(source).collect::<Option<_>>().map(Self)
    }

    /// The columns that a user names, which together have one of the `allowed` numbers of components.
    ///
    /// # Errors
    /// There is no such column, or another number of components.
    pub(super) fn named(
        attributes: &[Attribute],
        names: &[String],
        what: &'static str,
        allowed: &[usize],
    ) -> Result<Self, GrainColumnError> {
        let mut sources = Vec::new();
        for name in names {
            sources.extend(components_of(attributes, name)?);
        }
        if allowed.contains(&sources.len()) {
            return Ok(Self(sources));
        }
        let expected: Vec<String> = allowed.iter().map(usize::to_string).collect();
        Err(GrainColumnError::Components {
            what,
            expected: expected.join(" or "),
            found: sources.len(),
            columns: names.to_vec(),
        })
    }

    /// How many numbers a particle has.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Names of the attributes, each once.
    pub(super) fn names(&self, attributes: &[Attribute]) -> Vec<String> {
        let mut places: Vec<usize> = self.0.iter().map(|source| source.attribute).collect();
        places.dedup();
        places.into_iter().map(|place| attributes[place].name.clone()).collect()
    }

    /// Number of particles that have all numbers.
    pub(super) fn count(&self, attributes: &[Attribute]) -> usize {
        self.0.iter().map(|source| attributes[source.attribute].count()).min().unwrap_or(0)
    }

    /// The numbers of particle `index`, which exists, in `numbers`.
    pub(super) fn read<'n>(
        &self,
        attributes: &[Attribute],
        index: usize,
        numbers: &'n mut [f64; MAX_NUMBERS],
    ) -> &'n [f64] {
        for (number, source) in numbers.iter_mut().zip(&self.0) {
            let attribute = &attributes[source.attribute];
            *number = attribute.data.get_f64(index * attribute.components + source.component);
        }
        &numbers[..self.len().min(MAX_NUMBERS)]
    }
}

/// The components of a column or the component that `name` stands for.
fn components_of(attributes: &[Attribute], name: &str) -> Result<Vec<Source>, GrainColumnError> {
    let place = |name: &str| attributes.iter().position(|a| a.name.eq_ignore_ascii_case(name));
    if let Some(attribute) = place(name) {
        let components = 0..attributes[attribute].components;
        return Ok(components.map(|component| Source { attribute, component }).collect());
    }
    let unknown = || GrainColumnError::unknown(name, attributes);
    match Value::named(name, attributes) {
        Some(Value::Component(column, component)) => {
            let attribute = place(&column).ok_or_else(unknown)?;
            Ok(vec![Source { attribute, component }])
        }
        _ => Err(unknown()),
    }
}
