//! The encodings and type names of the format.

use super::cursor::shown;
use spherule_frame::{ParseError, ScalarType};

/// How the file stores numbers; line 3 of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum VtkEncoding {
    Ascii,
    Binary,
}

/// A type name of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum VtkType {
    /// The same size everywhere.
    Scalar(ScalarType),
    /// Size in binary files differs by writer: the usual type, then the other.
    Either(ScalarType, ScalarType),
    /// Eight to a byte in binary files.
    Bit,
    /// Text, one a line or with binary lengths; never a particle attribute here.
    Text,
}

impl VtkType {
    /// The type called `name` in whatever case.
    pub(super) fn parse(name: &[u8]) -> Option<Self> {
        use ScalarType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        let name = name.to_ascii_lowercase();
        Some(match name.as_slice() {
            b"bit" => Self::Bit,
            b"char" | b"signed_char" | b"vtktypeint8" => Self::Scalar(I8),
            b"unsigned_char" | b"vtktypeuint8" => Self::Scalar(U8),
            b"short" | b"vtktypeint16" => Self::Scalar(I16),
            b"unsigned_short" | b"vtktypeuint16" => Self::Scalar(U16),
            b"int" | b"vtktypeint32" => Self::Scalar(I32),
            b"unsigned_int" | b"vtktypeuint32" => Self::Scalar(U32),
            b"float" | b"vtktypefloat32" => Self::Scalar(F32),
            b"double" | b"vtktypefloat64" => Self::Scalar(F64),
            b"vtktypeint64" | b"long_long" => Self::Scalar(I64),
            b"vtktypeuint64" | b"unsigned_long_long" => Self::Scalar(U64),
            // Written on Windows, `long` has 4 bytes.
            b"long" => Self::Either(I64, I32),
            b"unsigned_long" => Self::Either(U64, U32),
            // 8 bytes in memory, but VTK writes `int`.
            b"vtkidtype" => Self::Either(I32, I64),
            b"string" | b"utf8_string" => Self::Text,
            _ => return None,
        })
    }
}

/// Parses a type name.
///
/// # Errors
/// Malformed, naming it, if there is no such type.
pub(super) fn stored_type(at: usize, name: &[u8]) -> Result<VtkType, ParseError> {
    VtkType::parse(name)
        .ok_or_else(|| ParseError::malformed(at, format!("`{}` is not a VTK type", shown(name))))
}
