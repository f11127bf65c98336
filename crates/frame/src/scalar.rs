//! Scalar types of numbers in files.

use crate::with_number_type;

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
#[expect(missing_docs, reason = "the names are self-explanatory")]
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

    /// The smallest type that holds the numbers of both exactly, and f64 where none does.
    pub fn common_with(self, other: Self) -> Self {
        let is_signed = |t| matches!(t, Self::I8 | Self::I16 | Self::I32 | Self::I64);
        let is_float = |t| matches!(t, Self::F32 | Self::F64);
        if self == other {
            return self;
        }
        if is_float(self) || is_float(other) {
            let fits_f32 = self.is_exact_in_f32() && other.is_exact_in_f32();
            return if fits_f32 { Self::F32 } else { Self::F64 };
        }
        let (large, small) =
            if self.size() >= other.size() { (self, other) } else { (other, self) };
        match (is_signed(large), is_signed(small)) {
            (true, true) | (false, false) => large,
            (true, false) if large.size() > small.size() => large,
            _ => match large.size() {
                1 => Self::I16,
                2 => Self::I32,
                4 => Self::I64,
                _ => Self::F64,
            },
        }
    }

    /// Whether f32 holds all numbers of the type: integers of up to 16 bits fit.
    pub const fn is_exact_in_f32(self) -> bool {
        match self {
            Self::F32 | Self::I8 | Self::U8 | Self::I16 | Self::U16 => true,
            Self::I32 | Self::U32 | Self::I64 | Self::U64 | Self::F64 => false,
        }
    }

    /// The number in `bytes`, which have the size of the type; 0 if they do not. Integers beyond 2^53 round.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_lossless,
        clippy::unnecessary_cast,
        reason = "one body for ten types, and no wider type to keep integers of 64 bits in"
    )]
    pub fn decode_one(self, bytes: &[u8], endian: Endian) -> f64 {
        with_number_type!(self, Number => bytes.try_into().map_or(0.0, |bytes| match endian {
            Endian::Little => Number::from_le_bytes(bytes) as f64,
            Endian::Big => Number::from_be_bytes(bytes) as f64,
        }))
    }
}
