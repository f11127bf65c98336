//! `absorption`: the colour that white light takes inside clear bodies.

use glam::Vec3;
use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Value};

/// The colour that white light takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Absorption {
    /// The same everywhere, linear RGB.
    Color(Vec3),
    /// Those of the particles around, by `color` and `color_by`.
    OfParticles,
}

/// The word for [`Absorption::OfParticles`].
const OF_PARTICLES: &str = "color";

impl Default for Absorption {
    fn default() -> Self {
        Self::Color(Vec3::ONE)
    }
}

impl Value for Absorption {
    const FLAG: FlagKind = FlagKind::Toml;

    fn kind(key: &Key) -> String {
        format!("\"{OF_PARTICLES}\" for the colours of the particles, or {}", Vec3::kind(key))
    }

    fn words() -> Vec<&'static str> {
        [vec![OF_PARTICLES], Vec3::words()].concat()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        if field.as_text() == Some(OF_PARTICLES) {
            return Ok(Self::OfParticles);
        }
        Vec3::parse(field, key).map(Self::Color)
    }

    fn toml(&self) -> String {
        match self {
            Self::Color(color) => color.toml(),
            Self::OfParticles => OF_PARTICLES.to_owned().toml(),
        }
    }

    fn schema(key: &Key) -> Json {
        json!({ "anyOf": [{ "const": OF_PARTICLES }, Vec3::schema(key)] })
    }
}
