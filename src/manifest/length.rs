//! A length that is given, or settled by what is in the pictures.

use super::reader::{Field, narrow};
use super::write::{Toml, described};

/// See the module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AutoLength {
    /// By the extent of the particles.
    Auto,
    /// Scene units.
    Length(f64),
}

impl AutoLength {
    pub(super) fn read(field: &Field<'_>) -> Option<Self> {
        if field.as_text() == Some("auto") {
            return Some(Self::Auto);
        }
        let holds = |v: f64| narrow(v) > 0.0 && narrow(v).is_finite();
        field
            .number("a length above 0 or \"auto\"", holds)
            .map(Self::Length)
    }
}

impl Toml for AutoLength {
    fn toml(&self) -> String {
        match self {
            Self::Auto => "auto".toml(),
            Self::Length(length) => length.toml(),
        }
    }
}

described!(AutoLength, {
    "anyOf": [
        { "const": "auto" },
        { "type": "number", "exclusiveMinimum": 0, "maximum": f32::MAX },
    ],
});
