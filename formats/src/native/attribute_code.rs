//! Attribute values in fewer bits: half precision, or 8 bits over the range of each component. Works on runs
//! of values, so that a frame of any size passes through; the largest error is measured by reading back.

use std::io;

use half::f16;
use rayon::prelude::*;

use super::StoredType;
use crate::{ID_NAMES, ScalarType};

/// Particles that one thread codes at a time.
const CHUNK: usize = 4096;

/// How the values of an attribute are to be stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum AttributeCode {
    /// As they are.
    #[default]
    Exact,
    /// Half precision: 11 bits, up to 65504.
    Half,
    /// 8 bits over the range of each component.
    Ranged,
}

impl AttributeCode {
    /// How an attribute called `name`, of numbers of type `scalar`, is stored with this code.
    ///
    /// # Errors
    /// Ids are stored as they are or not at all: another id is another particle.
    pub fn stored(self, name: &str, scalar: ScalarType) -> io::Result<StoredType> {
        let stored = match self {
            Self::Exact => return Ok(StoredType::Plain(scalar)),
            Self::Half => StoredType::Half,
            Self::Ranged => StoredType::Ranged,
        };
        if ID_NAMES.iter().any(|id| name.eq_ignore_ascii_case(id)) {
            let what = format!(
                "attribute {name} holds ids, which {} would change; store it as it is",
                stored.name()
            );
            return Err(invalid(what));
        }
        Ok(stored)
    }
}

/// The smallest and the largest value of each component of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub struct ValueRanges {
    /// Infinity to minus infinity before there are values.
    ranges: Vec<[f64; 2]>,
    is_finite: bool,
}

impl ValueRanges {
    /// Of no values.
    pub fn none(components: usize) -> Self {
        Self {
            ranges: vec![[f64::INFINITY, f64::NEG_INFINITY]; components],
            is_finite: true,
        }
    }

    /// Of a run: all components of one particle, then of the next, little-endian. A part of a particle at the
    /// end does not count.
    pub fn of_run(components: usize, scalar: ScalarType, values_le: &[u8]) -> Self {
        let width = components.max(1) * scalar.size();
        let of_chunk = |chunk: &[u8]| {
            let mut all = Self::none(components);
            for particle in chunk.chunks_exact(width) {
                let values = particle.chunks_exact(scalar.size());
                for (range, bytes) in all.ranges.iter_mut().zip(values) {
                    let value = StoredType::Plain(scalar).value(bytes, [0.0; 2]);
                    all.is_finite &= value.is_finite();
                    *range = [range[0].min(value), range[1].max(value)];
                }
            }
            all
        };
        let chunks = values_le.par_chunks(CHUNK * width).map(of_chunk);
        chunks.reduce(|| Self::none(components), Self::join)
    }

    /// Of the values of both, which have the same components.
    #[must_use]
    pub fn join(mut self, other: Self) -> Self {
        self.is_finite &= other.is_finite;
        for (range, more) in self.ranges.iter_mut().zip(other.ranges) {
            *range = [range[0].min(more[0]), range[1].max(more[1])];
        }
        self
    }

    /// The ranges for [`encode_run`] and for the index. Without values they are 0.
    ///
    /// # Errors
    /// If a value of the attribute, called `name`, was not finite: there is no code for it.
    pub fn finish(self, name: &str) -> io::Result<Vec<[f64; 2]>> {
        if !self.is_finite {
            let what = format!(
                "attribute {name} has values that are not finite, which 8 bits cannot hold; store it as f16 \
                 or as it is"
            );
            return Err(invalid(what));
        }
        let known = |range: [f64; 2]| {
            if range[0] <= range[1] {
                range
            } else {
                [0.0; 2]
            }
        };
        Ok(self.ranges.into_iter().map(known).collect())
    }
}

/// Appends the values of a run, little-endian numbers of type `scalar`, to `out` as `stored` has them, and
/// gives the largest difference of a value that is read back, in double or single precision, from the true
/// one.
///
/// `ranges` has one range a component for [`StoredType::Ranged`], and the run begins with the first component;
/// otherwise it is not looked at. The error is infinite if a value has no code: see [`check_error`].
///
/// # Panics
/// If `stored` is another plain type than `scalar`, or ranges are missing.
pub fn encode_run(
    stored: StoredType,
    ranges: &[[f64; 2]],
    scalar: ScalarType,
    values_le: &[u8],
    out: &mut Vec<u8>,
) -> f64 {
    let ranges = match stored {
        StoredType::Plain(kind) => {
            assert_eq!(kind, scalar, "plain values keep their type");
            out.extend_from_slice(values_le);
            return 0.0;
        }
        StoredType::Half => &[[0.0; 2]],
        StoredType::Ranged => ranges,
    };
    assert!(!ranges.is_empty(), "a range for each component");
    let start = out.len();
    let values = values_le.len() / scalar.size();
    out.resize(start + values * stored.size(), 0);
    let chunk = CHUNK * ranges.len();
    let from = values_le.par_chunks(chunk * scalar.size());
    out[start..]
        .par_chunks_mut(chunk * stored.size())
        .zip(from)
        .map(|(to, from)| encode_chunk(stored, ranges, scalar, from, to))
        .reduce(|| 0.0, f64::max)
}

/// Whether an error that [`encode_run`] gave for the attribute `name` is one.
///
/// # Errors
/// If it is infinite, because a value has no code.
pub fn check_error(name: &str, stored: StoredType, max_error: f64) -> io::Result<()> {
    if max_error.is_finite() {
        return Ok(());
    }
    let limit = match stored {
        StoredType::Half => ", whose largest number is 65504",
        StoredType::Ranged | StoredType::Plain(_) => "",
    };
    let kind = stored.name();
    Err(invalid(format!(
        "attribute {name} has values that do not fit {kind}{limit}; store it as it is"
    )))
}

/// [`encode_run`] of some whole particles.
fn encode_chunk(
    stored: StoredType,
    ranges: &[[f64; 2]],
    scalar: ScalarType,
    from: &[u8],
    to: &mut [u8],
) -> f64 {
    let mut max_error = 0.0_f64;
    let values = from.chunks_exact(scalar.size());
    let codes = to.chunks_exact_mut(stored.size());
    for ((bytes, code), range) in values.zip(codes).zip(ranges.iter().cycle()) {
        let value = StoredType::Plain(scalar).value(bytes, [0.0; 2]);
        match stored {
            StoredType::Ranged => code[0] = ranged_code(value, *range),
            _ => code.copy_from_slice(&f16::from_f64(value).to_le_bytes()),
        }
        let read = stored.value(code, *range);
        max_error = max_error.max(difference(value, read) + rounding(scalar, bytes));
    }
    max_error
}

/// The nearest code of a value in `range`; 0 for those that have none.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to eight bits; a value that is no number gives 0"
)]
fn ranged_code(value: f64, range: [f64; 2]) -> u8 {
    let (low, step) = StoredType::ranged(range);
    if step > 0.0 {
        ((value - low) / step).round().clamp(0.0, 255.0) as u8
    } else {
        0
    }
}

/// How far `read`, as it is or in single precision, is from `value`; infinite where one of them alone is no
/// number.
#[expect(
    clippy::cast_possible_truncation,
    reason = "copies of the values are in single precision"
)]
fn difference(value: f64, read: f64) -> f64 {
    if value == read && !value.is_finite() || value.is_nan() && read.is_nan() {
        return 0.0;
    }
    let apart = |read: f64| {
        let apart = (value - read).abs();
        if apart.is_nan() { f64::INFINITY } else { apart }
    };
    apart(read).max(apart(f64::from(read as f32)))
}

/// How far an integer of 64 bits is from its double.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "the difference is a small integer; that the casts round is what is measured"
)]
fn rounding(scalar: ScalarType, bytes: &[u8]) -> f64 {
    let Some(word) = bytes.first_chunk::<8>() else {
        return 0.0;
    };
    let exact = match scalar {
        ScalarType::I64 => i128::from(i64::from_le_bytes(*word)),
        ScalarType::U64 => i128::from(u64::from_le_bytes(*word)),
        _ => return 0.0,
    };
    (exact - exact as f64 as i128).abs() as f64
}

fn invalid(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}

#[cfg(test)]
mod tests;
