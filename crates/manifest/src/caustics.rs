//! `render.caustics`: light on ground, meshes and opaque particles through transmissive particles.

use serde_json::{Value as Json, json};
use spherule_tracer::render::{DEFAULT_PHOTONS, MAX_PHOTONS};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, Value};

/// How caustics are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Caustics {
    /// Number of photons of all lights; 0 for none.
    pub photons: u32,
}

impl Caustics {
    pub(super) const DEFAULT: Self = Self { photons: DEFAULT_PHOTONS };
}

fn photons() -> Key {
    Key::new("photons", &[]).from(0).to(MAX_PHOTONS)
}

impl Value for Caustics {
    fn kind(_: &Key) -> String {
        format!("a table such as {}", Self::DEFAULT.toml())
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let Some(mut section) = field.as_table() else {
            return Err(Fault::Unwanted);
        };
        let mut caustics = Self::DEFAULT;
        section.read(&photons(), &mut caustics.photons);
        section.finish();
        Ok(caustics)
    }

    fn toml(&self) -> String {
        format!("{{ photons = {} }}", self.photons)
    }

    fn schema(_: &Key) -> Json {
        json!({
            "type": "object",
            "properties": { "photons": u32::schema(&photons()) },
            "additionalProperties": false,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::Manifest;

    #[test]
    fn photons_are_a_number_in_a_table() {
        let photons = |setting: &str| {
            let text = format!("input.path = \"a\"\n{setting}");
            let manifest = Manifest::parse(&text, Path::new("job.toml"));
            manifest.map(|manifest| manifest.render.caustics.photons)
        };
        assert_eq!(photons(""), Ok(500_000));
        assert_eq!(photons("[render.caustics]\nphotons = 0"), Ok(0));
        assert_eq!(photons("render.caustics.photons = 7"), Ok(7));
        for (setting, part) in [
            ("render.caustics = 5", "expected a table such as { photons = 500000 }"),
            ("render.caustics.photons = -1", "render.caustics.photons: "),
            ("render.caustics.photons = 1e30", "render.caustics.photons: "),
            ("render.caustics.photon = 1", "did you mean `render.caustics.photons`?"),
        ] {
            let error = photons(setting).unwrap_err().to_string();
            assert!(error.contains(part), "{setting}: {error}");
        }
    }
}
