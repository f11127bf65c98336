//! `camera.focus`: what the lens focuses on.

use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Value};

/// What the lens focuses on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FocusSetting {
    /// The target point of the camera.
    Auto,
    /// A distance along the view.
    Distance(f64),
    /// The particle with this id.
    Particle(u32),
}

impl Value for FocusSetting {
    const FLAG: FlagKind = FlagKind::NumberOrText;

    fn kind(_: &Key) -> String {
        "a length above 0, \"auto\", or { particle = 7 }".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        if field.as_text() == Some("auto") {
            return Ok(Self::Auto);
        }
        let Some(mut section) = field.as_table() else {
            let distance = field.as_number().filter(|v| *v > 0.0);
            return distance.map(Self::Distance).ok_or(Fault::Unwanted);
        };
        let mut id = 0_u32;
        let key = Key::new("particle", &[]).required("the id of a particle, such as 7");
        section.read(&key.from(0), &mut id);
        section.finish();
        Ok(Self::Particle(id))
    }

    fn toml(&self) -> String {
        match self {
            Self::Auto => "\"auto\"".to_owned(),
            Self::Distance(distance) => distance.toml(),
            Self::Particle(id) => format!("{{ particle = {id} }}"),
        }
    }

    fn schema(_: &Key) -> Json {
        json!({ "anyOf": [
            { "const": "auto" },
            { "type": "number", "exclusiveMinimum": 0 },
            {
                "type": "object",
                "properties": { "particle": { "type": "integer", "minimum": 0, "maximum": u32::MAX } },
                "required": ["particle"],
                "additionalProperties": false,
            },
        ] })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Manifest, ManifestError};

    fn read(setting: &str) -> Result<Manifest, ManifestError> {
        let text = format!("input.path = \"a\"\n{setting}");
        Manifest::parse(&text, Path::new("job.toml"))
    }

    #[test]
    fn focus_is_a_word_a_distance_or_a_particle() {
        for (setting, wanted) in [
            ("", FocusSetting::Auto),
            ("camera.focus = \"auto\"", FocusSetting::Auto),
            ("camera.focus = 3", FocusSetting::Distance(3.0)),
            ("camera.focus = { particle = 4 }", FocusSetting::Particle(4)),
        ] {
            let focus = read(setting).map(|manifest| manifest.camera.focus);
            assert_eq!(focus, Ok(wanted), "{setting}");
        }
        for (setting, part) in [
            ("camera.focus = 0", "expected a length above 0"),
            ("camera.focus = \"far\"", "expected a length above 0"),
            ("camera.focus = { id = 4 }", "camera.focus.particle: is missing"),
            ("camera.focus = { particle = -4 }", "expected a whole number from 0"),
            (
                "camera = { f_stop = 2, aperture = 1 }",
                "camera.aperture: is given, but so is f_stop",
            ),
        ] {
            let error = read(setting).unwrap_err().to_string();
            assert!(error.contains(part), "{setting}: {error}");
        }
        assert!(read("camera = { f_stop = 0, aperture = 1 }").is_ok());
    }
}
