//! The stored types of attributes and radii in a native frame.

use half::f16;

use crate::ScalarType;

/// How the values of an attribute are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredType {
    /// The unchanged type of the source.
    Plain(ScalarType),
    /// Half precision: 11 bits, up to 65504.
    Half,
    /// 8 bits over a range for each component: `low + code * (high - low) / 255`.
    Ranged,
}

impl StoredType {
    const HALF: u32 = 11;
    const RANGED: u32 = 12;

    /// The code of the type in the index.
    pub const fn code(self) -> u32 {
        match self {
            Self::Plain(ScalarType::I8) => 1,
            Self::Plain(ScalarType::U8) => 2,
            Self::Plain(ScalarType::I16) => 3,
            Self::Plain(ScalarType::U16) => 4,
            Self::Plain(ScalarType::I32) => 5,
            Self::Plain(ScalarType::U32) => 6,
            Self::Plain(ScalarType::I64) => 7,
            Self::Plain(ScalarType::U64) => 8,
            Self::Plain(ScalarType::F32) => 9,
            Self::Plain(ScalarType::F64) => 10,
            Self::Half => Self::HALF,
            Self::Ranged => Self::RANGED,
        }
    }

    /// The type with this code; `None` for unknown codes.
    pub const fn of_code(code: u32) -> Option<Self> {
        Some(Self::Plain(match code {
            1 => ScalarType::I8,
            2 => ScalarType::U8,
            3 => ScalarType::I16,
            4 => ScalarType::U16,
            5 => ScalarType::I32,
            6 => ScalarType::U32,
            7 => ScalarType::I64,
            8 => ScalarType::U64,
            9 => ScalarType::F32,
            10 => ScalarType::F64,
            Self::HALF => return Some(Self::Half),
            Self::RANGED => return Some(Self::Ranged),
            _ => return None,
        }))
    }

    /// Bytes per value.
    pub const fn size(self) -> usize {
        match self {
            Self::Plain(kind) => kind.size(),
            Self::Half => 2,
            Self::Ranged => 1,
        }
    }

    /// The name in listings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain(kind) => kind.name(),
            Self::Half => "f16",
            Self::Ranged => "8-bit",
        }
    }

    /// The value of code 0 and the step between codes, for `range`.
    pub(crate) fn ranged(range: [f64; 2]) -> (f64, f64) {
        let [low, high] = range;
        (low, (high - low) / 255.0)
    }

    /// Decodes a value from the lowest bytes of `bytes`; `range` is used for [`Self::Ranged`].
    ///
    /// # Panics
    /// If there are fewer bytes than [`Self::size`].
    #[inline]
    pub fn value(self, bytes: &[u8], range: [f64; 2]) -> f64 {
        fn word<const N: usize>(bytes: &[u8]) -> [u8; N] {
            *bytes.first_chunk().expect("a whole value")
        }
        #[expect(clippy::cast_precision_loss, reason = "values are looked at in double precision")]
        match self {
            Self::Plain(ScalarType::I8) => f64::from(i8::from_le_bytes(word(bytes))),
            Self::Plain(ScalarType::U8) => f64::from(bytes[0]),
            Self::Plain(ScalarType::I16) => f64::from(i16::from_le_bytes(word(bytes))),
            Self::Plain(ScalarType::U16) => f64::from(u16::from_le_bytes(word(bytes))),
            Self::Plain(ScalarType::I32) => f64::from(i32::from_le_bytes(word(bytes))),
            Self::Plain(ScalarType::U32) => f64::from(u32::from_le_bytes(word(bytes))),
            Self::Plain(ScalarType::I64) => i64::from_le_bytes(word(bytes)) as f64,
            Self::Plain(ScalarType::U64) => u64::from_le_bytes(word(bytes)) as f64,
            Self::Plain(ScalarType::F32) => f64::from(f32::from_le_bytes(word(bytes))),
            Self::Plain(ScalarType::F64) => f64::from_le_bytes(word(bytes)),
            Self::Half => f16::from_le_bytes(word(bytes)).to_f64(),
            Self::Ranged => {
                let (low, step) = Self::ranged(range);
                low + f64::from(bytes[0]) * step
            }
        }
    }
}

/// How radii that differ are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum RadiusCode {
    /// 8 bits over the range of the frame.
    U8,
    /// 16 bits over the range of the frame.
    U16,
    /// Unchanged f32.
    F32,
}

impl RadiusCode {
    /// All types, the smallest first.
    pub const ALL: [Self; 3] = [Self::U8, Self::U16, Self::F32];

    /// The code of the type in the index, which is the code of the scalar type that holds it.
    pub const fn code(self) -> u32 {
        match self {
            Self::U8 => StoredType::Plain(ScalarType::U8).code(),
            Self::U16 => StoredType::Plain(ScalarType::U16).code(),
            Self::F32 => StoredType::Plain(ScalarType::F32).code(),
        }
    }

    /// The type with this code; `None` for unknown codes.
    pub fn of_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|c| c.code() == code)
    }

    /// Bytes per radius.
    pub const fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 => 4,
        }
    }

    /// Difference of the radii of successive codes; 0 for radii that are stored as f32.
    pub fn step(self, low: f32, high: f32) -> f32 {
        match self {
            Self::U8 => (high - low) / 255.0,
            Self::U16 => (high - low) / 65_535.0,
            Self::F32 => 0.0,
        }
    }
}
