//! Sums over the values of particles, piece by piece, so that the result does not depend on the number of threads.

use rayon::prelude::*;

use super::{ComponentStats, Number};
use crate::{Attribute, AttributeData, Positions};

/// Number of particles in a piece that one thread adds up.
pub(super) const PIECE: usize = 1 << 16;

/// The sums of one component over the particles so far.
#[derive(Clone)]
pub(super) enum Sum {
    Int(IntSum),
    Float(FloatSum),
}

impl Sum {
    /// No values of the type of `is_float`.
    pub(super) fn new(is_float: bool) -> Self {
        if is_float { Self::Float(FloatSum::new()) } else { Self::Int(IntSum::default()) }
    }

    /// Adds the values of `component` of the particles that `keep` marks.
    pub(super) fn add(&mut self, attribute: &Attribute, component: usize, keep: &[bool]) {
        let width = attribute.components;
        match self {
            Self::Int(sum) => {
                let own = std::mem::take(sum);
                *sum = own.join(int_sum(&attribute.data, width, component, keep));
            }
            Self::Float(sum) => match &attribute.data {
                AttributeData::F32(v) => {
                    sum.add_all(v, width, keep, |x| f64::from(x[component]));
                }
                AttributeData::F64(v) => sum.add_all(v, width, keep, |x| x[component]),
                _ => {}
            },
        }
    }

    /// The statistics of the component.
    pub(super) fn stats(&self) -> ComponentStats {
        match self {
            Self::Int(sum) => sum.stats(),
            Self::Float(sum) => sum.stats(),
        }
    }
}

#[derive(Clone)]
pub(super) struct IntSum {
    count: u64,
    sum: i128,
    min: i128,
    max: i128,
}

impl Default for IntSum {
    fn default() -> Self {
        Self { count: 0, sum: 0, min: i128::MAX, max: i128::MIN }
    }
}

impl IntSum {
    fn add(&mut self, value: i128) {
        self.count += 1;
        self.sum += value;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
    }

    fn join(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            sum: self.sum + other.sum,
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    fn stats(&self) -> ComponentStats {
        let some = self.count > 0;
        #[expect(clippy::cast_precision_loss, reason = "a mean is rounded anyway")]
        let mean = self.sum as f64 / self.count as f64;
        ComponentStats {
            min: some.then_some(Number::Int(self.min)),
            max: some.then_some(Number::Int(self.max)),
            mean: some.then_some(mean),
            sum: Number::Int(self.sum),
            nan: 0,
        }
    }
}

/// Adds up in the type of the file.
fn int_sum(data: &AttributeData, width: usize, component: usize, keep: &[bool]) -> IntSum {
    macro_rules! sum {
        ($v:expr) => {
            pieces($v, width, keep)
                .map(|(values, keep)| {
                    let mut sum = IntSum::default();
                    for (value, keep) in values.chunks_exact(width).zip(keep) {
                        if *keep {
                            sum.add(i128::from(value[component]));
                        }
                    }
                    sum
                })
                .reduce(IntSum::default, IntSum::join)
        };
    }
    match data {
        AttributeData::I8(v) => sum!(v),
        AttributeData::U8(v) => sum!(v),
        AttributeData::I16(v) => sum!(v),
        AttributeData::U16(v) => sum!(v),
        AttributeData::I32(v) => sum!(v),
        AttributeData::U32(v) => sum!(v),
        AttributeData::I64(v) => sum!(v),
        AttributeData::U64(v) => sum!(v),
        AttributeData::F32(_) | AttributeData::F64(_) => IntSum::default(),
    }
}

/// The values and the marks of [`PIECE`] particles at a time, in order.
fn pieces<'a, T: Sync>(
    values: &'a [T],
    width: usize,
    keep: &'a [bool],
) -> impl IndexedParallelIterator<Item = (&'a [T], &'a [bool])> {
    let values = values.par_chunks(PIECE.saturating_mul(width.max(1)));
    values.zip(keep.par_chunks(PIECE))
}

/// A sum with compensated rounding errors (Neumaier), so that the mean of ten million equal numbers is that number.
#[derive(Clone)]
pub(super) struct FloatSum {
    count: u64,
    nan: u64,
    sum: f64,
    error: f64,
    pub(super) min: f64,
    pub(super) max: f64,
}

impl FloatSum {
    pub(super) const fn new() -> Self {
        Self { count: 0, nan: 0, sum: 0.0, error: 0.0, min: f64::INFINITY, max: f64::NEG_INFINITY }
    }

    fn add(&mut self, value: f64) {
        if value.is_nan() {
            self.nan += 1;
            return;
        }
        self.count += 1;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.add_to_sum(value);
    }

    fn add_to_sum(&mut self, value: f64) {
        let sum = self.sum + value;
        self.error += if self.sum.abs() >= value.abs() {
            (self.sum - sum) + value
        } else {
            (value - sum) + self.sum
        };
        self.sum = sum;
    }

    fn join(mut self, other: &Self) -> Self {
        self.count += other.count;
        self.nan += other.nan;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.add_to_sum(other.sum);
        self.error += other.error;
        self
    }

    fn total(&self) -> f64 {
        // With infinite values, the compensation is NaN and the plain sum is correct.
        if self.sum.is_finite() { self.sum + self.error } else { self.sum }
    }

    #[expect(clippy::cast_precision_loss, reason = "counts are below 2^53")]
    pub(super) fn mean(&self) -> f64 {
        self.total() / self.count as f64
    }

    /// Adds the numbers of the particles that `keep` marks; `number` takes one from the `width` values of a particle.
    fn add_all<T: Sync>(
        &mut self,
        values: &[T],
        width: usize,
        keep: &[bool],
        number: impl Fn(&[T]) -> f64 + Sync,
    ) {
        let sums: Vec<Self> = pieces(values, width, keep)
            .map(|(values, keep)| {
                let mut sum = Self::new();
                for (value, keep) in values.chunks_exact(width).zip(keep) {
                    if *keep {
                        sum.add(number(value));
                    }
                }
                sum
            })
            .collect();
        *self = sums.iter().fold(self.clone(), Self::join);
    }

    /// Adds a coordinate of the particles that `keep` marks.
    pub(super) fn add_axis(&mut self, positions: &Positions, keep: &[bool], axis: usize) {
        match positions {
            Positions::F32(v) => self.add_all(v, 1, keep, |p| f64::from(p[0][axis])),
            Positions::F64(v) => self.add_all(v, 1, keep, |p| p[0][axis]),
        }
    }

    fn stats(&self) -> ComponentStats {
        let some = self.count > 0;
        ComponentStats {
            min: some.then_some(Number::Float(self.min)),
            max: some.then_some(Number::Float(self.max)),
            mean: some.then(|| self.mean()),
            sum: Number::Float(self.total()),
            nan: self.nan,
        }
    }
}
