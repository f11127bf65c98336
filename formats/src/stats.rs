//! The statistics that `inspect` reports about a frame: counts, bounds, means, and the range of every attribute.
//!
//! All numbers are computed from the values in the file, in f64 or exact integers. Sums are computed over fixed
//! pieces, so that the result does not depend on the number of threads.

use std::fmt;

use glam::DVec3;
use rayon::prelude::*;

use crate::frame::find_radius;
use crate::{Attribute, AttributeData, Positions, Radius, RawParticles, ScalarType};

/// Number of particles in a piece that one thread adds up.
const PIECE: usize = 1 << 16;

/// Statistics of a frame, world units.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameStats {
    /// Number of particles with finite positions.
    pub count: u64,
    /// Number of particles with a NaN or infinite coordinate; the other fields ignore them.
    pub dropped: u64,
    /// Smallest and largest radius in the file; `None` if the file has no radii.
    pub radius: Option<(f32, f32)>,
    /// Smallest and largest position; `None` without particles.
    pub bounds: Option<(DVec3, DVec3)>,
    /// Mean position; `None` without particles.
    pub mean: Option<DVec3>,
    /// One entry for each attribute, in the order of the file.
    pub attributes: Vec<AttributeStats>,
}

/// Statistics of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeStats {
    /// The name in the file.
    pub name: String,
    /// Type of the numbers.
    pub scalar_type: ScalarType,
    /// One entry for each component.
    pub components: Vec<ComponentStats>,
}

/// Statistics of one component of an attribute over all particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentStats {
    /// Smallest value that is not NaN; `None` if all values are NaN.
    pub min: Option<Number>,
    /// Largest value that is not NaN; `None` if all values are NaN.
    pub max: Option<Number>,
    /// Mean of the values that are not NaN; `None` if all values are NaN.
    pub mean: Option<f64>,
    /// Sum of the values that are not NaN; exact for integers.
    pub sum: Number,
    /// Number of NaN values.
    pub nan: u64,
}

/// A number that stays exact for integers: i128 holds the sum of any array of 64-bit integers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A number of an integer attribute.
    Int(i128),
    /// A number of a floating-point attribute.
    Float(f64),
}

impl Number {
    /// The number as f64; integers beyond 2^53 are rounded.
    #[expect(clippy::cast_precision_loss, reason = "said in the doc comment")]
    pub const fn as_f64(self) -> f64 {
        match self {
            Self::Int(n) => n as f64,
            Self::Float(x) => x,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int(n) => n.fmt(f),
            Self::Float(x) => x.fmt(f),
        }
    }
}

impl FrameStats {
    /// Counts, bounds and means of `raw`.
    pub fn of(raw: &RawParticles) -> Self {
        let keep = finite(&raw.positions);
        let count = keep.iter().filter(|k| **k).count();
        let axes = [0, 1, 2].map(|axis| axis_stats(&raw.positions, &keep, axis));
        let vector =
            |value: fn(&FloatSum) -> f64| DVec3::from_array([0, 1, 2].map(|a| value(&axes[a])));
        let some = count > 0;
        Self {
            count: count as u64,
            dropped: (keep.len() - count) as u64,
            radius: radius_range(raw, &keep),
            bounds: some.then(|| (vector(|a| a.min), vector(|a| a.max))),
            mean: some.then(|| vector(FloatSum::mean)),
            attributes: raw
                .attributes
                .iter()
                .map(|a| AttributeStats {
                    name: a.name.clone(),
                    scalar_type: a.data.scalar_type(),
                    components: (0..a.components)
                        .map(|component| component_stats(a, component, &keep))
                        .collect(),
                })
                .collect(),
        }
    }
}

fn finite(positions: &Positions) -> Vec<bool> {
    match positions {
        Positions::F32(v) => v.par_iter().map(|p| p.is_finite()).collect(),
        Positions::F64(v) => v.par_iter().map(|p| p.is_finite()).collect(),
    }
}

fn axis_stats(positions: &Positions, keep: &[bool], axis: usize) -> FloatSum {
    match positions {
        Positions::F32(v) => float_sum(v, 1, 0, keep, |p| f64::from(p[axis])),
        Positions::F64(v) => float_sum(v, 1, 0, keep, |p| p[axis]),
    }
}

/// The radii that the renderer uses, of the particles that it keeps.
fn radius_range(raw: &RawParticles, keep: &[bool]) -> Option<(f32, f32)> {
    match find_radius(&raw.attributes)? {
        Radius::Common(radius) => Some((radius, radius)),
        Radius::PerParticle(radii) => {
            let kept = radii.iter().zip(keep).filter(|(_, k)| **k);
            kept.map(|(radius, _)| *radius)
                .fold(None, |range: Option<(f32, f32)>, r| match range {
                    Some((min, max)) => Some((min.min(r), max.max(r))),
                    None => Some((r, r)),
                })
        }
    }
}

fn component_stats(attribute: &Attribute, component: usize, keep: &[bool]) -> ComponentStats {
    let width = attribute.components;
    let float = |sum: FloatSum| {
        let some = sum.count > 0;
        ComponentStats {
            min: some.then_some(Number::Float(sum.min)),
            max: some.then_some(Number::Float(sum.max)),
            mean: some.then(|| sum.mean()),
            sum: Number::Float(sum.total()),
            nan: sum.nan,
        }
    };
    match &attribute.data {
        AttributeData::F32(v) => float(float_sum(v, width, component, keep, |x| f64::from(*x))),
        AttributeData::F64(v) => float(float_sum(v, width, component, keep, |x| *x)),
        integers => int_stats(integers, width, component, keep),
    }
}

fn int_stats(
    data: &AttributeData,
    width: usize,
    component: usize,
    keep: &[bool],
) -> ComponentStats {
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
    // Add up in the type of the file
    let sum = match data {
        AttributeData::I8(v) => sum!(v),
        AttributeData::U8(v) => sum!(v),
        AttributeData::I16(v) => sum!(v),
        AttributeData::U16(v) => sum!(v),
        AttributeData::I32(v) => sum!(v),
        AttributeData::U32(v) => sum!(v),
        AttributeData::I64(v) => sum!(v),
        AttributeData::U64(v) => sum!(v),
        AttributeData::F32(_) | AttributeData::F64(_) => IntSum::default(),
    };
    // Compute the mean
    let some = sum.count > 0;
    #[expect(clippy::cast_precision_loss, reason = "a mean is rounded anyway")]
    let mean = sum.sum as f64 / sum.count as f64;
    ComponentStats {
        min: some.then_some(Number::Int(sum.min)),
        max: some.then_some(Number::Int(sum.max)),
        mean: some.then_some(mean),
        sum: Number::Int(sum.sum),
        nan: 0,
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

struct IntSum {
    count: u64,
    sum: i128,
    min: i128,
    max: i128,
}

impl Default for IntSum {
    fn default() -> Self {
        Self {
            count: 0,
            sum: 0,
            min: i128::MAX,
            max: i128::MIN,
        }
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
}

/// A sum with compensated rounding errors (Neumaier), so that the mean of ten million equal numbers is that number.
struct FloatSum {
    count: u64,
    nan: u64,
    sum: f64,
    error: f64,
    min: f64,
    max: f64,
}

impl FloatSum {
    const fn new() -> Self {
        Self {
            count: 0,
            nan: 0,
            sum: 0.0,
            error: 0.0,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
        }
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
        if self.sum.is_finite() {
            self.sum + self.error
        } else {
            self.sum
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "counts are below 2^53")]
    fn mean(&self) -> f64 {
        self.total() / self.count as f64
    }
}

fn float_sum<T: Sync>(
    values: &[T],
    width: usize,
    component: usize,
    keep: &[bool],
    number: impl Fn(&T) -> f64 + Sync,
) -> FloatSum {
    let sums: Vec<FloatSum> = pieces(values, width, keep)
        .map(|(values, keep)| {
            let mut sum = FloatSum::new();
            for (value, keep) in values.chunks_exact(width).zip(keep) {
                if *keep {
                    sum.add(number(&value[component]));
                }
            }
            sum
        })
        .collect();
    sums.iter().fold(FloatSum::new(), FloatSum::join)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn raw(positions: Positions, attributes: Vec<(&str, usize, AttributeData)>) -> RawParticles {
        let attribute = |(name, components, data): (&str, usize, AttributeData)| Attribute {
            name: name.to_owned(),
            components,
            data,
        };
        RawParticles {
            positions,
            attributes: attributes.into_iter().map(attribute).collect(),
            time: None,
            step: None,
            cell: None,
            bonds: Vec::new(),
        }
    }

    #[test]
    fn dropped_particles_are_excluded_from_statistics() {
        let positions = vec![
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(f32::NAN, 0.0, 0.0),
            Vec3::new(3.0, 4.0, -5.0),
            Vec3::new(0.0, f32::INFINITY, 0.0),
        ];
        let stats = FrameStats::of(&raw(
            Positions::F32(positions),
            vec![
                ("id", 1, AttributeData::I32(vec![-1, 50, 2, 60])),
                (
                    "v",
                    2,
                    AttributeData::F32(vec![1.0, 2.0, 9.0, 9.0, f32::NAN, 5.0, 9.0, 9.0]),
                ),
                ("pscale", 1, AttributeData::F32(vec![0.5, 9.0, 0.25, 9.0])),
            ],
        ));
        assert_eq!((stats.count, stats.dropped), (2, 2));
        assert_eq!(
            stats.bounds,
            Some((DVec3::new(1.0, 2.0, -5.0), DVec3::new(3.0, 4.0, 3.0)))
        );
        assert_eq!(stats.mean, Some(DVec3::new(2.0, 3.0, -1.0)));
        assert_eq!(stats.radius, Some((0.25, 0.5)));
        let id = stats.attributes[0].components[0];
        assert_eq!(
            (id.min, id.max),
            (Some(Number::Int(-1)), Some(Number::Int(2)))
        );
        assert_eq!((id.sum, id.mean, id.nan), (Number::Int(1), Some(0.5), 0));
        let v = &stats.attributes[1].components;
        assert_eq!(
            (v[0].max, v[0].nan, v[0].mean),
            (Some(Number::Float(1.0)), 1, Some(1.0))
        );
        assert_eq!((v[1].sum, v[1].nan), (Number::Float(7.0), 0));
    }

    #[test]
    fn empty_frames_have_no_bounds() {
        let ids = vec![
            ("id", 1, AttributeData::U8(vec![])),
            ("v", 3, AttributeData::F64(vec![])),
        ];
        let stats = FrameStats::of(&raw(Positions::F32(vec![]), ids));
        assert_eq!((stats.count, stats.bounds, stats.mean), (0, None, None));
        assert_eq!(stats.attributes[0].components[0].sum.to_string(), "0");
        assert_eq!(stats.attributes[1].components.len(), 3);
        assert_eq!(stats.attributes[1].components[2].mean, None);
    }

    #[test]
    fn integer_sums_are_exact() {
        let ids = vec![u64::MAX; 3];
        let positions = Positions::F32(vec![Vec3::ZERO; 3]);
        let stats = FrameStats::of(&raw(positions, vec![("id", 1, AttributeData::U64(ids))]));
        let sum = stats.attributes[0].components[0].sum;
        assert_eq!(sum.to_string(), "55340232221128654845");
    }

    #[test]
    fn means_are_accurate_over_many_particles() {
        let point = DVec3::new(1e6 + 0.1, -0.3, 1e-9);
        let stats = FrameStats::of(&raw(Positions::F64(vec![point; 3 * PIECE + 7]), vec![]));
        assert_eq!(stats.mean, Some(point));
        assert_eq!(stats.count, 3 * PIECE as u64 + 7);
    }

    #[test]
    fn infinite_values_are_numbers() {
        let values = AttributeData::F32(vec![1.0, f32::INFINITY]);
        let positions = Positions::F32(vec![Vec3::ZERO; 2]);
        let stats = FrameStats::of(&raw(positions, vec![("p", 1, values)]));
        let p = stats.attributes[0].components[0];
        assert_eq!(
            (p.max, p.sum),
            (
                Some(Number::Float(f64::INFINITY)),
                Number::Float(f64::INFINITY)
            )
        );
    }
}
