//! Numbers of particles as their dialect has them: values of a data set, constants, and values with a unit.

use rayon::prelude::*;

use super::values::{Cache, Values};
use spherule_frame::{Endian, ParseError, ScalarType};

/// Rows that are converted together by one thread.
const BLOCK: usize = 4096;
/// Least rows that are in memory twice while they are converted.
const CONVERTED_ROWS: u64 = 1 << 17;

/// Some components of a property of the particles of one part.
#[derive(Debug, Clone)]
pub(super) enum Piece {
    /// As they are in the file.
    Stored(Values),
    /// The same number for all particles.
    Constant(f64, ScalarType),
    /// `values * unit + offset * offset_unit`, in f64.
    Scaled { values: Box<Self>, unit: f64, offset: Box<Self>, offset_unit: f64 },
}

impl Piece {
    /// A third coordinate of particles in a plane, with the type of the others.
    pub(super) const fn zero(scalar: ScalarType) -> Self {
        Self::Constant(0.0, scalar)
    }

    /// Numbers per particle.
    pub(super) fn components(&self) -> usize {
        match self {
            Self::Stored(values) => values.components(),
            Self::Constant(..) => 1,
            Self::Scaled { values, .. } => values.components(),
        }
    }

    /// Type of the numbers.
    pub(super) fn scalar(&self) -> ScalarType {
        match self {
            Self::Stored(values) => values.scalar(),
            Self::Constant(_, scalar) => *scalar,
            Self::Scaled { .. } => ScalarType::F64,
        }
    }

    /// All values of data sets in it.
    pub(super) fn stored(&self) -> Vec<&Values> {
        match self {
            Self::Stored(values) => vec![values],
            Self::Constant(..) => Vec::new(),
            Self::Scaled { values, offset, .. } => [values.stored(), offset.stored()].concat(),
        }
    }

    /// Rows to convert together: whole chunks.
    fn converted_rows(&self) -> u64 {
        let bands = self.stored().into_iter().filter_map(Values::band_rows);
        let rows = bands.max().unwrap_or(1).max(1);
        CONVERTED_ROWS.next_multiple_of(rows)
    }

    /// The numbers of `count` rows from `first` on, little-endian in the type of the piece.
    fn numbers(&self, cache: Cache<'_>, first: u64, count: usize) -> Result<Vec<u8>, ParseError> {
        let mut bytes = vec![0; count * self.components() * self.scalar().size()];
        match self {
            Self::Stored(values) => values.read(cache, first, &mut bytes)?,
            Self::Constant(value, scalar) => {
                let number = encoded(*value, *scalar);
                let size = scalar.size();
                for to in bytes.chunks_exact_mut(size) {
                    to.copy_from_slice(&number[..size]);
                }
            }
            Self::Scaled { values, unit, offset, offset_unit } => {
                let (v, o) = (values.scalar(), offset.scalar());
                let values = values.numbers(cache, first, count)?;
                let offset = offset.numbers(cache, first, count)?;
                let numbers = values.chunks_exact(v.size()).zip(offset.chunks_exact(o.size()));
                for (to, (value, offset)) in bytes.as_chunks_mut().0.iter_mut().zip(numbers) {
                    let value = v.decode_one(value, Endian::Little) * unit;
                    let offset = o.decode_one(offset, Endian::Little) * offset_unit;
                    *to = (value + offset).to_le_bytes();
                }
            }
        }
        Ok(bytes)
    }

    /// The numbers of the first `count` rows as f64.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a chunk is damaged.
    pub(super) fn all(&self, count: usize) -> Result<Vec<f64>, ParseError> {
        let scalar = self.scalar();
        let bytes = self.numbers(None, 0, count)?;
        let numbers = bytes.chunks_exact(scalar.size());
        Ok(numbers.map(|number| scalar.decode_one(number, Endian::Little)).collect())
    }

    /// Writes the numbers of the rows from `first` on to component `component` of records of `width` numbers of
    /// type `scalar`, little-endian.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a chunk is damaged.
    pub(super) fn read(
        &self,
        cache: Cache<'_>,
        first: u64,
        to: &mut [u8],
        (component, width, scalar): (usize, usize, ScalarType),
    ) -> Result<(), ParseError> {
        let record = width * scalar.size();
        let own = self.components();
        if let Self::Stored(values) = self
            && own == width
            && values.scalar() == scalar
        {
            return values.read(cache, first, to);
        }
        let mut first = first;
        let mut left = to;
        while left.len() >= record {
            // Up to the end of a block of whole chunks
            let block = self.converted_rows();
            let rows = usize::try_from(block - first % block).unwrap_or(usize::MAX);
            let (to, rest) = left.split_at_mut(rows.saturating_mul(record).min(left.len()));
            let numbers = self.numbers(cache, first, to.len() / record)?;
            let from = self.scalar();
            let each = own * from.size();
            let blocks = to.par_chunks_mut(BLOCK * record);
            blocks.zip(numbers.par_chunks(BLOCK * each)).for_each(|(to, numbers)| {
                let records = to.chunks_exact_mut(record);
                for (record, numbers) in records.zip(numbers.chunks_exact(each)) {
                    let start = component * scalar.size();
                    let to = &mut record[start..start + own * scalar.size()];
                    convert(numbers, from, to, scalar);
                }
            });
            first += block - first % block;
            left = rest;
        }
        Ok(())
    }
}

/// Converts little-endian numbers to a type that [`ScalarType::common_with`] gives.
fn convert(numbers: &[u8], from: ScalarType, to: &mut [u8], scalar: ScalarType) {
    if from == scalar {
        to.copy_from_slice(numbers);
        return;
    }
    let size = scalar.size();
    let pairs = to.chunks_exact_mut(size).zip(numbers.chunks_exact(from.size()));
    for (to, number) in pairs {
        let bytes = match scalar {
            ScalarType::F32 | ScalarType::F64 => {
                encoded(from.decode_one(number, Endian::Little), scalar)
            }
            // Wider integers: the sign fills the new bytes.
            _ => {
                let is_signed = matches!(
                    from,
                    ScalarType::I8 | ScalarType::I16 | ScalarType::I32 | ScalarType::I64
                );
                let is_negative = is_signed && number.last().is_some_and(|byte| byte & 0x80 != 0);
                let mut wide = [if is_negative { 0xff } else { 0 }; 8];
                wide[..number.len()].copy_from_slice(number);
                wide
            }
        };
        to.copy_from_slice(&bytes[..size]);
    }
}

/// `value` as the first bytes of the result, little-endian.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast saturates; values come from the type that they are stored in"
)]
pub(super) fn encoded(value: f64, scalar: ScalarType) -> [u8; 8] {
    let mut bytes = [0; 8];
    let mut put = |number: &[u8]| bytes[..number.len()].copy_from_slice(number);
    match scalar {
        ScalarType::F32 => put(&(value as f32).to_le_bytes()),
        ScalarType::F64 => put(&value.to_le_bytes()),
        ScalarType::U64 => put(&(value as u64).to_le_bytes()),
        other => put(&(value as i64).to_le_bytes()[..other.size()]),
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn converts(number: &[u8], from: ScalarType, scalar: ScalarType, expected: &[u8]) {
        let mut to = vec![0; scalar.size()];
        convert(number, from, &mut to, scalar);
        assert_eq!(to, expected, "{from:?} to {scalar:?}");
    }

    #[test]
    fn numbers_keep_their_values_in_wider_types() {
        use ScalarType::{F32, F64, I8, I16, I64, U8, U32, U64};
        converts(&[0xfe], I8, I16, &(-2_i16).to_le_bytes());
        converts(&[0xfe], U8, I16, &254_i16.to_le_bytes());
        converts(&u32::MAX.to_le_bytes(), U32, I64, &i64::from(u32::MAX).to_le_bytes());
        converts(&7_u64.to_le_bytes(), U64, F64, &7_f64.to_le_bytes());
        converts(&1.5_f32.to_le_bytes(), F32, F64, &1.5_f64.to_le_bytes());
        converts(&[0xff], I8, F32, &(-1_f32).to_le_bytes());
        assert_eq!(encoded(3.0, U8)[..1], [3]);
    }
}
