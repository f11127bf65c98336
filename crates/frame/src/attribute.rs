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

/// Runs `$body` with `$v` bound to the vector inside, whatever its type.
#[macro_export]
macro_rules! with_values {
    ($data:expr, $v:ident => $body:expr) => {
        match $data {
            $crate::AttributeData::I8($v) => $body,
            $crate::AttributeData::U8($v) => $body,
            $crate::AttributeData::I16($v) => $body,
            $crate::AttributeData::U16($v) => $body,
            $crate::AttributeData::I32($v) => $body,
            $crate::AttributeData::U32($v) => $body,
            $crate::AttributeData::I64($v) => $body,
            $crate::AttributeData::U64($v) => $body,
            $crate::AttributeData::F32($v) => $body,
            $crate::AttributeData::F64($v) => $body,
        }
    };
}

impl AttributeData {
    /// Reserves space for `more` numbers if the system allows it; pages that are not used cost nothing.
    pub fn reserve(&mut self, more: usize) {
        with_values!(self, v => {
            let _ = v.try_reserve_exact(more);
        });
    }

    /// Appends the numbers of `more` if it has the same type; otherwise does nothing.
    pub fn append(&mut self, more: &mut Self) {
        macro_rules! append {
            ($($variant:ident),*) => {
                match (self, more) {
                    $((Self::$variant(all), Self::$variant(more)) => all.append(more),)*
                    _ => {}
                }
            };
        }
        append!(I8, U8, I16, U16, I32, U32, I64, U64, F32, F64);
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
