//! `[[material.part]]`: materials of parts of the particles.

use std::collections::BTreeMap;

use glam::Vec3;
use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::{Affects, Key};
use super::keys::{Keys, keys};
use super::value::{Fault, FlagKind, Value, list, named};

pub(super) const ABOUT: &[&str] =
    &["Materials of parts of the particles, for integrator = \"path\" and separate \
                                     spheres"];

named! {
    /// Materials of parts.
    PartKind {
        /// Light leaves in all directions alike.
        Matte = "matte",
        /// A matte base under a clear coat.
        Plastic = "plastic",
        /// A mirror in the base colour.
        Metal = "metal",
    }
}

/// Default roughness, also of `[material]`: satin plastic, and a brushed metal.
pub(super) const ROUGHNESS: f32 = 0.55;

/// The remedy for transmissive parts.
const TRANSMISSIVE: &str = "parts are opaque; for spheres of glass or water among others, make [material] glass or \
                            water, and give the parts that are not a material here";

/// One `[[material.part]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The values of the attribute that divides particles into parts.
    pub parts: Vec<i32>,
    /// The material.
    pub kind: PartKind,
    /// Roughness of plastic and metal, 0 to 1.
    pub roughness: f32,
    /// Base colour, linear RGB; by default that of each particle.
    pub color: Option<Vec3>,
}

impl Default for Part {
    fn default() -> Self {
        Self { parts: vec![1], kind: PartKind::Matte, roughness: ROUGHNESS, color: None }
    }
}

impl Part {
    /// Reads or lists one table; `named` has the parts of the tables before, with the index of each.
    pub(super) fn keys(
        &mut self,
        keys: &mut Keys<'_>,
        named: &mut BTreeMap<i32, usize>,
        index: usize,
    ) {
        if let Some(section) = keys.reading()
            && let Some(field) = section.get("type")
            && matches!(field.as_text(), Some("glass" | "water"))
        {
            field.fail(TRANSMISSIVE);
            section.close();
            return;
        }
        keys!(keys:
            /// Parts of this material: values of the attribute part, type or phase
            ///
            /// The particles of all other parts have the material of `[material]`.
            parts => self.parts, example("[1, 2]"),
                required("a material needs its parts, such as [1, 2]"), affects(Affects::PathTracing);
            /// Material: matte | plastic | metal
            type => self.kind, affects(Affects::PathTracing);
            /// Roughness of plastic and metal, 0 (a mirror) to 1
            roughness => self.roughness, from(0), to(1), affects(Affects::PathTracing);
            /// Colour, linear RGB
            color => self.color, from(0), to(1), example("[0.95, 0.64, 0.54]"), unset("that of material.color"),
                affects(Affects::PathTracing);
        );
        if let Some(section) = keys.reading()
            && section.has("parts")
        {
            for part in &self.parts {
                if let Some(other) = named.insert(*part, index) {
                    let what = format!("part {part} is in material.part.{other} already");
                    section.wrong("parts", &what);
                }
            }
        }
    }
}

/// At least one integer.
impl Value for Vec<i32> {
    const FLAG: FlagKind = FlagKind::Integers;

    fn kind(key: &Key) -> String {
        format!("a list of integers, such as {}", key.example)
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let items = field.items().filter(|items| !items.is_empty());
        let part = |item: &Field<'_>| i32::try_from(item.as_integer()?).ok();
        let parts = items.and_then(|items| items.iter().map(part).collect::<Option<Self>>());
        parts.ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        list(self.iter().map(ToString::to_string))
    }

    fn schema(_: &Key) -> Json {
        let item = json!({ "type": "integer", "minimum": i32::MIN, "maximum": i32::MAX });
        json!({ "type": "array", "items": item, "minItems": 1 })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Manifest;

    fn read(text: &str) -> Result<Vec<Part>, String> {
        let text = format!("input.path = \"a\"\n{text}");
        let manifest = Manifest::parse(&text, Path::new("job.toml"));
        manifest.map(|manifest| manifest.material.parts).map_err(|e| e.to_string())
    }

    #[test]
    fn parts_have_materials() {
        assert_eq!(read("").unwrap(), []);
        let text = "[material]\ntype = \"glass\"\n[[material.part]]\nparts = [1]\n[[material.part]]\n\
                    parts = [-2, 5]\ntype = \"metal\"\nroughness = 0.2\ncolor = [1, 0, 0.5]";
        let parts = read(text).unwrap();
        assert_eq!(parts[0], Part::default());
        assert_eq!(parts[1].parts, [-2, 5]);
        assert_eq!((parts[1].kind, parts[1].roughness), (PartKind::Metal, 0.2));
        assert_eq!(parts[1].color, Some(Vec3::new(1.0, 0.0, 0.5)));
    }

    #[test]
    fn impossible_parts_are_refused() {
        for (text, part) in [
            ("[[material.part]]", "material.part.0.parts: is missing"),
            ("[[material.part]]\nparts = []", "material.part.0.parts: expected a list of integers"),
            (
                "[[material.part]]\nparts = [1.5]",
                "material.part.0.parts: expected a list of integers",
            ),
            (
                "[[material.part]]\nparts = [3000000000]",
                "material.part.0.parts: expected a list of integers",
            ),
            (
                "[[material.part]]\nparts = [1, 2, 1]",
                "material.part.0.parts: part 1 is in material.part.0 already",
            ),
            (
                "[[material.part]]\nparts = [1, 2]\n[[material.part]]\nparts = [2]",
                "material.part.1.parts: part 2 is in material.part.0 already",
            ),
            (
                "[[material.part]]\nparts = [1]\ntype = \"glass\"",
                "material.part.0.type: parts are opaque",
            ),
            ("[[material.part]]\nparts = [1]\ntype = \"gold\"", "matte, plastic, metal"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
