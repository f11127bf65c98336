//! A value of a manifest before it is parsed.

use super::problem::Problems;
use super::tree::{Kind, TomlNode};

/// A value that is present.
pub(super) struct Field<'a> {
    pub(super) key: String,
    pub(super) node: &'a TomlNode,
    pub(super) problems: &'a Problems,
}

impl<'a> Field<'a> {
    /// Reports that the value is invalid.
    pub(super) fn fail(&self, what: &str) {
        self.problems.note(&self.node.place, &self.key, what);
    }

    pub(super) fn as_text(&self) -> Option<&'a str> {
        match &self.node.kind {
            Kind::Text(text) => Some(text),
            _ => None,
        }
    }

    pub(super) const fn as_integer(&self) -> Option<i64> {
        match self.node.kind {
            Kind::Integer(i) => Some(i),
            _ => None,
        }
    }

    pub(super) const fn as_bool(&self) -> Option<bool> {
        match self.node.kind {
            Kind::Bool(b) => Some(b),
            _ => None,
        }
    }

    /// A finite number; integers need no decimal point.
    pub(super) fn as_number(&self) -> Option<f64> {
        match self.node.kind {
            #[expect(clippy::cast_precision_loss, reason = "what the user means by it")]
            Kind::Integer(i) => Some(i as f64),
            Kind::Float(f) if f.is_finite() => Some(f),
            _ => None,
        }
    }

    /// A list of `N` finite numbers.
    pub(super) fn as_numbers<const N: usize>(&self) -> Option<[f64; N]> {
        let numbers: Vec<f64> = self.items()?.iter().filter_map(Self::as_number).collect();
        let all = numbers.len() == self.items()?.len();
        numbers.try_into().ok().filter(|_| all)
    }

    /// The items of a list.
    pub(super) fn items(&self) -> Option<Vec<Self>> {
        let Kind::Array(items) = &self.node.kind else {
            return None;
        };
        let item = |(index, node)| Self {
            key: format!("{}.{index}", self.key),
            node,
            problems: self.problems,
        };
        Some(items.iter().enumerate().map(item).collect())
    }
}
