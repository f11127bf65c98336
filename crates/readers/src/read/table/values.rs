//! The typed arrays that rows of text are parsed into.

use bytemuck::allocation::try_cast_vec;
use glam::DVec3;

use super::Decimal;
use crate::read::text;
use spherule_frame::{AttributeData, Positions};

/// The numbers of one target.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::read) enum ColumnValues {
    /// All are numbers.
    Real(Vec<f64>),
    /// All are integers.
    Whole(Vec<i64>),
    /// At least one is text.
    Text,
}

impl ColumnValues {
    /// Appends a row of zeros.
    pub(super) fn add_row(&mut self, components: usize) {
        match self {
            Self::Real(v) => v.resize(v.len() + components, 0.0),
            Self::Whole(v) => v.resize(v.len() + components, 0),
            Self::Text => {}
        }
    }

    /// Puts `token` `from_end` numbers before the end; false if it is none. Nothing at all is NaN.
    #[inline]
    pub(super) fn set(&mut self, from_end: usize, token: &[u8], decimal: Decimal) -> bool {
        if let Self::Whole(v) = self {
            if let Some(value) = text::integer(token) {
                let index = v.len() - from_end;
                v[index] = value;
                return true;
            }
            *self = Self::Real(real(v));
        }
        let Self::Real(v) = self else {
            return true;
        };
        let value = match decimal {
            Decimal::Point => text::number(token),
            Decimal::Comma => text::number_with_comma(token),
        };
        let value = match value {
            Some(value) => value,
            None if token.is_empty() => f64::NAN,
            None => return false,
        };
        let index = v.len() - from_end;
        v[index] = value;
        true
    }

    /// Puts `value` `from_end` numbers before the end of integers.
    #[inline]
    pub(super) fn set_whole(&mut self, from_end: usize, value: i64) {
        if let Self::Whole(v) = self {
            let index = v.len() - from_end;
            v[index] = value;
        }
    }

    /// How many numbers there are.
    pub(in crate::read) fn len(&self) -> usize {
        match self {
            Self::Real(v) => v.len(),
            Self::Whole(v) => v.len(),
            Self::Text => 0,
        }
    }

    /// The numbers for an attribute; `None` for text.
    pub(in crate::read) fn into_data(self) -> Option<AttributeData> {
        match self {
            Self::Real(v) => Some(AttributeData::F64(v)),
            Self::Whole(v) => Some(AttributeData::I64(v)),
            Self::Text => None,
        }
    }

    /// The numbers of [`super::TargetArray::positions`].
    pub(in crate::read) fn into_positions(self) -> Positions {
        let Self::Real(mut v) = self else {
            return Positions::F64(Vec::new());
        };
        v.truncate(v.len() / 3 * 3);
        let triples = try_cast_vec(v).or_else(|(_, mut v)| {
            // The spare capacity is not a whole number of triples.
            v.shrink_to_fit();
            try_cast_vec(v)
        });
        Positions::F64(triples.unwrap_or_else(|(_, v)| {
            let (triples, _) = v.as_chunks::<3>();
            triples.iter().copied().map(DVec3::from_array).collect()
        }))
    }
}

/// Ids beyond 2^53 are rounded; it takes a fraction in the same column to get here.
fn real(whole: &[i64]) -> Vec<f64> {
    whole.iter().map(|v| *v as f64).collect()
}
