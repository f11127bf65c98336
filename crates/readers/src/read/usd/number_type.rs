//! Types of numbers in USD files, and numbers that have been read.

use half::f16;

use spherule_frame::{AttributeData, Endian, ScalarType};

/// Type of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    /// A type that attributes have. Booleans are `u8`.
    Plain(ScalarType),
    /// 16 bits, which become `f32`.
    Half,
}

/// Type of one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NumberType {
    pub(super) scalar: Scalar,
    /// Numbers in a value: 1 to 4, 4, 9 or 16 for matrices.
    pub(super) components: usize,
    /// Whether it is a quaternion, which becomes real part first.
    pub(super) is_quaternion: bool,
}

impl NumberType {
    pub(super) const fn new(scalar: Scalar, components: usize) -> Self {
        Self { scalar, components, is_quaternion: false }
    }

    pub(super) const fn quaternion(scalar: Scalar) -> Self {
        Self { scalar, components: 4, is_quaternion: true }
    }

    /// Type of the numbers in memory.
    pub(super) const fn in_memory(self) -> ScalarType {
        match self.scalar {
            Scalar::Plain(scalar) => scalar,
            Scalar::Half => ScalarType::F32,
        }
    }

    /// Bytes of a stored value.
    pub(super) const fn stored_len(self) -> usize {
        self.components * self.scalar.stored_len()
    }

    /// Decodes `bytes`, the numbers of whole values as binary files have them.
    pub(super) fn decode(self, bytes: &[u8]) -> AttributeData {
        let mut data = self.scalar.decode(bytes);
        if self.is_quaternion {
            match &mut data {
                AttributeData::F32(v) => real_first(v),
                AttributeData::F64(v) => real_first(v),
                _ => {}
            }
        }
        data
    }
}

impl Scalar {
    /// Bytes of a stored number.
    pub(super) const fn stored_len(self) -> usize {
        match self {
            Self::Plain(scalar) => scalar.size(),
            Self::Half => 2,
        }
    }

    /// Decodes little-endian numbers. An incomplete last one is left out.
    pub(super) fn decode(self, bytes: &[u8]) -> AttributeData {
        match self {
            Self::Half => {
                let numbers = bytes.as_chunks().0.iter().map(|b| f16::from_le_bytes(*b).to_f32());
                AttributeData::F32(numbers.collect())
            }
            Self::Plain(scalar) => {
                let len = bytes.len() / scalar.size() * scalar.size();
                let whole = bytes.get(..len).unwrap_or_default();
                let numbers = scalar.decode(Endian::Little, whole);
                numbers.unwrap_or(AttributeData::U8(Vec::new()))
            }
        }
    }
}

/// Moves the real part of quaternions, which binary files have last, to the front.
fn real_first<T>(numbers: &mut [T]) {
    for quaternion in numbers.chunks_exact_mut(4) {
        quaternion.rotate_right(1);
    }
}

/// One value, or the values of an array.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Numbers {
    pub(super) components: usize,
    pub(super) data: AttributeData,
    /// Whether the file has an array, not a single value.
    pub(super) is_array: bool,
    /// Whether values are quaternions.
    pub(super) is_quaternion: bool,
}

impl Numbers {
    /// Number of values.
    pub(super) fn len(&self) -> usize {
        self.data.len() / self.components.max(1)
    }

    /// The numbers in f64, if there is a single value with `N` numbers.
    pub(super) fn single<const N: usize>(&self) -> Option<[f64; N]> {
        let is_single = self.components == N && self.data.len() == N;
        is_single.then(|| std::array::from_fn(|index| self.data.get_f64(index)))
    }

    /// Values between these and `next` as OpenUSD interpolates them; `weight` in 0..1 is that of `next`. These values
    /// if the two differ in number or type, or are not of floating point.
    pub(super) fn interpolated(mut self, next: &Self, weight: f64) -> Self {
        if self.components != next.components || self.data.len() != next.data.len() {
            return self;
        }
        match (&mut self.data, &next.data) {
            (AttributeData::F32(v), AttributeData::F32(w)) => {
                let between =
                    if self.components == 1 { between_scalars } else { between_components };
                v.iter_mut().zip(w).for_each(|(a, b)| *a = between(*a, *b, weight));
            }
            (AttributeData::F64(v), AttributeData::F64(w)) => {
                let between = |a: f64, b: f64| (1.0 - weight) * a + weight * b;
                v.iter_mut().zip(w).for_each(|(a, b)| *a = between(*a, *b));
            }
            _ => {}
        }
        self
    }
}

/// Rounded once, as `GfLerp` does for numbers.
#[expect(clippy::cast_possible_truncation, reason = "as in OpenUSD")]
fn between_scalars(a: f32, b: f32, weight: f64) -> f32 {
    ((1.0 - weight) * f64::from(a) + weight * f64::from(b)) as f32
}

/// Rounded after each product, as `GfLerp` does for vectors.
#[expect(clippy::cast_possible_truncation, reason = "as in OpenUSD")]
fn between_components(a: f32, b: f32, weight: f64) -> f32 {
    let (a, b) = ((1.0 - weight) * f64::from(a), weight * f64::from(b));
    a as f32 + b as f32
}
