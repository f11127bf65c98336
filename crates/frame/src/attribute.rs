//! Named per-particle values beside the positions: velocity, density, id and others.

use crate::ScalarType;

/// One named array with `components` numbers per particle, interleaved (`x0 y0 z0 x1 ...`).
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute {
    /// The name in the file.
    pub name: String,
    /// Numbers per particle: 1 for a scalar, 3 for a vector.
    pub components: usize,
    /// The numbers: `components` for each particle.
    pub data: AttributeData,
}

/// The numbers of an attribute in the type of the file, so that ids stay exact.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub enum AttributeData {
    I8(Vec<i8>),
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Runs `$body` with `$v` bound to the vector inside [`AttributeData`], and `$number` to the type of its numbers.
#[macro_export]
macro_rules! with_values {
    ($data:expr, $v:ident => $body:expr) => {
        $crate::with_values!($data, $v: _Number => $body)
    };
    ($data:expr, $v:ident: $number:ident => $body:expr) => {
        $crate::with_values!(@ $data, $v, $number, $body,
            I8 i8 U8 u8 I16 i16 U16 u16 I32 i32 U32 u32 I64 i64 U64 u64 F32 f32 F64 f64)
    };
    (@ $data:expr, $v:ident, $number:ident, $body:expr, $($variant:ident $type:ty)*) => {
        match $data {
            $($crate::AttributeData::$variant($v) => {
                type $number = $type;
                $body
            })*
        }
    };
}

/// Runs `$body` with `$v` bound to the vector inside, and puts the vector that it gives into the same variant.
#[macro_export]
macro_rules! map_values {
    ($data:expr, $v:ident => $body:expr) => {
        $crate::with_values!($data, $v: Number => {
            let numbers: Vec<Number> = $body;
            $crate::AttributeData::from(numbers)
        })
    };
}

/// Runs `$body` with `$number` as the type of a [`ScalarType`].
#[macro_export]
macro_rules! with_number_type {
    ($scalar:expr, $number:ident => $body:expr) => {
        $crate::with_number_type!(@ $scalar, $number, $body,
            I8 i8 U8 u8 I16 i16 U16 u16 I32 i32 U32 u32 I64 i64 U64 u64 F32 f32 F64 f64)
    };
    (@ $scalar:expr, $number:ident, $body:expr, $($variant:ident $type:ty)*) => {
        match $scalar {
            $($crate::ScalarType::$variant => {
                type $number = $type;
                $body
            })*
        }
    };
}

macro_rules! from_vectors {
    ($($variant:ident $type:ty),*) => {
        $(impl From<Vec<$type>> for AttributeData {
            fn from(numbers: Vec<$type>) -> Self {
                Self::$variant(numbers)
            }
        })*
    };
}

from_vectors!(
    I8 i8, U8 u8, I16 i16, U16 u16, I32 i32, U32 u32, I64 i64, U64 u64, F32 f32, F64 f64
);

impl AttributeData {
    /// `len` zeros; pages that are not touched cost nothing yet.
    pub fn zeros(scalar: ScalarType, len: usize) -> Self {
        with_number_type!(scalar, Number => vec![Number::default(); len].into())
    }

    /// The numbers in another type, which [`ScalarType::common_with`] gives: it holds them, except that integers beyond
    /// 2^53 round in f64.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        clippy::cast_lossless,
        reason = "one body for ten types"
    )]
    #[must_use]
    pub fn into_type(self, scalar: ScalarType) -> Self {
        if self.scalar_type() == scalar {
            return self;
        }
        with_number_type!(scalar, Number => {
            let numbers: Vec<Number> =
                with_values!(self, v => v.into_iter().map(|number| number as Number).collect());
            numbers.into()
        })
    }

    /// Reserves space for `more` numbers if the system allows it; pages that are not used cost nothing.
    pub fn reserve(&mut self, more: usize) {
        with_values!(self, v => {
            let _ = v.try_reserve_exact(more);
        });
    }

    /// Appends the numbers of `more` if it has the same type; otherwise does nothing. Its memory is used if there are
    /// no numbers before it.
    pub fn append(&mut self, more: Self) {
        macro_rules! append {
            ($($variant:ident),*) => {
                match (self, more) {
                    $((Self::$variant(all), Self::$variant(mut more)) => {
                        if all.capacity() == 0 {
                            *all = more;
                        } else {
                            all.append(&mut more);
                        }
                    })*
                    _ => {}
                }
            };
        }
        append!(I8, U8, I16, U16, I32, U32, I64, U64, F32, F64);
    }

    /// Appends `count` NaN; zeros to integers.
    pub fn append_nan(&mut self, count: usize) {
        match self {
            Self::F32(v) => v.resize(v.len() + count, f32::NAN),
            Self::F64(v) => v.resize(v.len() + count, f64::NAN),
            integers => integers.append(Self::zeros(integers.scalar_type(), count)),
        }
    }

    /// The numbers as bytes, to be filled with little-endian ones before [`Self::decode_little_endian`].
    pub fn as_bytes_mut(&mut self) -> &mut [u8] {
        with_values!(self, v => bytemuck::cast_slice_mut(v))
    }

    /// Brings numbers whose bytes are little-endian into the order of the machine.
    pub fn decode_little_endian(&mut self) {
        if cfg!(target_endian = "big") {
            let size = self.scalar_type().size();
            for number in self.as_bytes_mut().chunks_exact_mut(size) {
                number.reverse();
            }
        }
    }

    /// Releases unused capacity.
    pub fn shrink(&mut self) {
        with_values!(self, v => v.shrink_to_fit());
    }

    /// Number of scalars.
    pub fn len(&self) -> usize {
        with_values!(self, v => v.len())
    }

    /// True if there are no scalars.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of the scalars in memory.
    pub fn byte_len(&self) -> u64 {
        self.len() as u64 * self.scalar_type().size() as u64
    }

    /// The stored type.
    pub const fn scalar_type(&self) -> ScalarType {
        match self {
            Self::I8(_) => ScalarType::I8,
            Self::U8(_) => ScalarType::U8,
            Self::I16(_) => ScalarType::I16,
            Self::U16(_) => ScalarType::U16,
            Self::I32(_) => ScalarType::I32,
            Self::U32(_) => ScalarType::U32,
            Self::I64(_) => ScalarType::I64,
            Self::U64(_) => ScalarType::U64,
            Self::F32(_) => ScalarType::F32,
            Self::F64(_) => ScalarType::F64,
        }
    }

    /// Scalar `index` as f64 (integers beyond 2^53 round).
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn get_f64(&self, index: usize) -> f64 {
        #[expect(
            clippy::unnecessary_cast,
            clippy::cast_lossless,
            reason = "one body for ten types"
        )]
        {
            with_values!(self, v => v[index] as f64)
        }
    }

    /// Keeps the groups of `components` scalars whose particle is marked in `keep`.
    pub fn retain_particles(&mut self, components: usize, keep: &[bool]) {
        with_values!(self, v => {
            let mut scalar = 0;
            v.retain(|_| {
                let kept = keep.get(scalar / components.max(1)).copied().unwrap_or(false);
                scalar += 1;
                kept
            });
        });
    }
}

impl Attribute {
    /// Number of particles.
    pub fn count(&self) -> usize {
        self.data.len() / self.components.max(1)
    }

    /// The value of particle `index`: a scalar itself, or the Euclidean length of a vector.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn magnitude(&self, index: usize) -> f64 {
        if self.components == 1 {
            return self.data.get_f64(index);
        }
        (0..self.components)
            .map(|c| self.data.get_f64(index * self.components + c).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}
