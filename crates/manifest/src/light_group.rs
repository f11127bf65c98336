//! Names of light groups.

use serde_json::{Value as Json, json};
use spherule_images::output::DEFAULT_LIGHT_GROUP;

use super::field::Field;
use super::key::Key;
use super::value::{Fault, Value, quoted};
use super::{LightGroup, Manifest};

/// Greatest length of a name, bytes.
const MAX_LENGTH: usize = 64;

impl LightGroup {
    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Manifest {
    /// The names of all light groups, in the order of their layers after that of light without a group.
    pub fn light_groups(&self) -> Vec<&str> {
        let own = self.lights.iter().filter_map(|light| light.group.as_ref());
        let mut names: Vec<&str> =
            own.chain(&self.environment.group).map(LightGroup::as_str).collect();
        names.sort_unstable();
        names.dedup();
        names
    }
}

impl Value for LightGroup {
    fn kind(_: &Key) -> String {
        format!("a name of 1 to {MAX_LENGTH} letters, digits, \"_\" and \"-\"")
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let is_valid = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
        let valid = field.as_text().filter(|text| text.chars().all(is_valid));
        let text = valid.filter(|text| (1..=MAX_LENGTH).contains(&text.len()));
        match text {
            Some(DEFAULT_LIGHT_GROUP) => Err(Fault::Because(format!(
                "\"{DEFAULT_LIGHT_GROUP}\" is the layer of light without a group; choose another name, or remove the key"
            ))),
            Some(name) => Ok(Self(name.to_owned())),
            None => Err(Fault::Unwanted),
        }
    }

    fn toml(&self) -> String {
        quoted(&self.0)
    }

    fn schema(_: &Key) -> Json {
        let pattern = format!("^[A-Za-z0-9_-]{{1,{MAX_LENGTH}}}$");
        json!({ "type": "string", "pattern": pattern, "not": { "const": DEFAULT_LIGHT_GROUP } })
    }
}
