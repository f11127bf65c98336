//! Scalar types of numbers in files.

use crate::{AttributeData, ParseError};

/// Byte order of stored numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Endian {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// The type of one stored number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names say all")]
pub enum ScalarType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl ScalarType {
    /// Size in bytes.
    pub const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Name in reports, such as `f32` or `u32`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::I8 => "i8",
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::I64 => "i64",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// Decodes all of `bytes`, which must be a whole number of scalars.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at byte 0 if the length is not a multiple of [`Self::size`].
    pub fn decode(self, endian: Endian, bytes: &[u8]) -> Result<AttributeData, ParseError> {
        if !bytes.len().is_multiple_of(self.size()) {
            return Err(ParseError::malformed(
                0,
                format!(
                    "{} bytes are not a whole number of {}",
                    bytes.len(),
                    self.name()
                ),
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
