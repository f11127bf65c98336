//! Decodes stored numbers.

use crate::{AttributeData, Endian, ParseError, ScalarType};

impl ScalarType {
    /// Decodes all of `bytes`, which must be a whole number of scalars.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at byte 0 if the length is not a multiple of [`Self::size`].
    pub fn decode(self, endian: Endian, bytes: &[u8]) -> Result<AttributeData, ParseError> {
        if !bytes.len().is_multiple_of(self.size()) {
            return Err(ParseError::malformed(
                0,
                format!("{} bytes are not a whole number of {}", bytes.len(), self.name()),
            ));
        }
        macro_rules! decode {
            ($variant:ident, $ty:ty) => {
                AttributeData::$variant(
                    bytes
                        .as_chunks::<{ size_of::<$ty>() }>()
                        .0
                        .iter()
                        .map(|b| match endian {
                            Endian::Little => <$ty>::from_le_bytes(*b),
                            Endian::Big => <$ty>::from_be_bytes(*b),
                        })
                        .collect(),
                )
            };
        }
        Ok(match self {
            Self::I8 => decode!(I8, i8),
            Self::U8 => decode!(U8, u8),
            Self::I16 => decode!(I16, i16),
            Self::U16 => decode!(U16, u16),
            Self::I32 => decode!(I32, i32),
            Self::U32 => decode!(U32, u32),
            Self::I64 => decode!(I64, i64),
            Self::U64 => decode!(U64, u64),
            Self::F32 => decode!(F32, f32),
            Self::F64 => decode!(F64, f64),
        })
    }
}
