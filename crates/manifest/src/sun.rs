//! `environment.sun`: the sun of a clear sky.

use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, Value};

/// The sun of a clear sky.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Above the horizon, degrees. Negative in a dusk.
    pub elevation: f64,
    /// From the right of the first view towards the viewer, degrees.
    pub azimuth: f64,
    /// Apparent diameter, degrees.
    pub size: f64,
}

impl Sun {
    /// High on the left behind the viewer. It is larger than the sun as seen from the earth, so that shadows and
    /// caustics are not too sharp.
    pub(super) const DEFAULT: Self = Self { elevation: 42.0, azimuth: 140.0, size: 1.2 };
}

/// The keys of the table.
fn keys() -> [Key; 3] {
    let key = |name| Key::new(name, &[]).unit("degrees");
    [key("elevation").from(-12).to(90), key("azimuth"), key("size").above(0).to(90)]
}

impl Value for Sun {
    fn kind(_: &Key) -> String {
        "a table such as { elevation = 42.0, azimuth = 140.0, size = 1.2 }".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let Some(mut section) = field.as_table() else {
            return Err(Fault::Unwanted);
        };
        let mut sun = Self::DEFAULT;
        let values = [&mut sun.elevation, &mut sun.azimuth, &mut sun.size];
        for (key, value) in keys().iter().zip(values) {
            section.read(key, value);
        }
        section.finish();
        Ok(sun)
    }

    fn toml(&self) -> String {
        let Self { elevation, azimuth, size } = self;
        format!("{{ elevation = {elevation:?}, azimuth = {azimuth:?}, size = {size:?} }}")
    }

    fn schema(_: &Key) -> Json {
        let [elevation, azimuth, size] = keys().map(|key| f64::schema(&key));
        json!({
            "type": "object",
            "properties": { "elevation": elevation, "azimuth": azimuth, "size": size },
            "additionalProperties": false,
        })
    }
}
