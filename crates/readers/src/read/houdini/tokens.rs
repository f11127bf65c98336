//! The tokens that Houdini's JSON consists of, binary or text.

use spherule_frame::{ParseError, ScalarType};

/// One token.
#[derive(Debug, Clone, Copy)]
pub(super) struct Token<'a> {
    /// Offset of its first byte.
    pub(super) at: usize,
    pub(super) value: Value<'a>,
}

/// What a token means.
#[derive(Debug, Clone, Copy)]
pub(super) enum Value<'a> {
    Null,
    Bool(bool),
    Integer(i64),
    Real(f64),
    Text(&'a [u8]),
    Uniform(UniformArray<'a>),
    Begin,
    End,
}

/// The type of the elements of a uniform array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ElementType {
    /// Bits, in words of 32.
    Bits,
    /// Half precision.
    Half,
    Number(ScalarType),
    /// Strings, or references to names.
    Text,
}

/// Elements of one type.
#[derive(Debug, Clone, Copy)]
pub(super) struct UniformArray<'a> {
    pub(super) element: ElementType,
    pub(super) count: usize,
    /// The elements as they are in the file.
    pub(super) bytes: &'a [u8],
}

/// The error for a token that the layout of geometry does not have at `at`.
pub(super) fn unexpected(at: usize, what: &str) -> ParseError {
    ParseError::malformed(at, format!("{what} expected here: the file is damaged here"))
}
