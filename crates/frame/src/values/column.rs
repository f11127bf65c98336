//! Columns of numbers, and those with a meaning to the program.

use crate::join::ColumnShape;
use crate::{Attribute, AttributeData, ScalarType, names};

/// A column by name and number of components, in memory or in a file.
pub trait Named {
    /// Its name.
    fn name(&self) -> &str;
    /// Components per particle.
    fn components(&self) -> usize;
    /// Whether its values are integers.
    fn is_integer(&self) -> bool;
}

/// A column with its numbers.
pub trait Column: Named {
    /// Component `component` of particle `index`, which exist.
    fn get(&self, index: usize, component: usize) -> f64;
    /// The value of particle `index`: a scalar itself, or the Euclidean length of a vector.
    fn magnitude(&self, index: usize) -> f64;
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

impl Column for Attribute {
    fn get(&self, index: usize, component: usize) -> f64 {
        self.data.get_f64(index * self.components + component)
    }

    fn magnitude(&self, index: usize) -> f64 {
        self.magnitude(index)
    }
}

impl<C: Named> Named for &C {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn components(&self) -> usize {
        (**self).components()
    }

    fn is_integer(&self) -> bool {
        (**self).is_integer()
    }
}

impl<C: Column> Column for &C {
    fn get(&self, index: usize, component: usize) -> f64 {
        (**self).get(index, component)
    }

    fn magnitude(&self, index: usize) -> f64 {
        (**self).magnitude(index)
    }
}

impl Named for ColumnShape<'_> {
    fn name(&self) -> &str {
        self.name
    }

    fn components(&self) -> usize {
        self.components
    }

    fn is_integer(&self) -> bool {
        !matches!(self.scalar, ScalarType::F32 | ScalarType::F64)
    }
}

/// The column with velocities, if there is one.
pub fn velocity_of<C: Named>(columns: &[C]) -> Option<&C> {
    names::VELOCITY.iter().find_map(|name| {
        columns.iter().find(|c| c.components() == 3 && c.name().eq_ignore_ascii_case(name))
    })
}

/// The column with ids, if there is one. An exact match of the name is preferred over one that ignores case.
pub fn id_of<C: Named>(columns: &[C]) -> Option<&C> {
    names::ID.iter().find_map(|name| {
        let exact = columns.iter().find(|c| c.name() == *name);
        let alike = || columns.iter().find(|c| c.name().eq_ignore_ascii_case(name));
        exact.or_else(alike).filter(|c| c.components() == 1)
    })
}

/// Names of columns that divide particles into parts, the most specific first.
pub const PART_NAMES: [&str; 3] = ["part", "type", "phase"];

/// The column that divides particles into parts, if there is one. Only integers do.
pub fn part_of<C: Named>(columns: &[C]) -> Option<&C> {
    let is_part = |c: &&C, name: &str| c.components() == 1 && c.name().eq_ignore_ascii_case(name);
    let mut names = PART_NAMES.iter();
    names.find_map(|name| columns.iter().find(|c| is_part(c, name) && c.is_integer()))
}
