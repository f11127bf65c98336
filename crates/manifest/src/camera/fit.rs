//! `camera.fit` and `camera.box`: what is in the picture of an automatic camera.

use glam::DVec3;
use serde_json::{Value as Json, json};

use crate::field::Field;
use crate::key::Key;
use crate::value::{Fault, Value, numbers_schema, quoted};

const ALL: &str = "all";
const THIS: &str = "this";

/// What is in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FitSetting {
    /// All particles of all frames, except a few that are far from the others.
    All,
    /// The particles of the frame of a still.
    This,
    /// At least this percentage of the particles of all frames.
    Percent(f64),
}

impl Value for FitSetting {
    fn kind(_: &Key) -> String {
        "all, this, or a percentage from 50% to 100%".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        match field.as_text() {
            Some(ALL) => Ok(Self::All),
            Some(THIS) => Ok(Self::This),
            Some(text) => {
                let percent = text.strip_suffix('%').and_then(|text| text.trim().parse().ok());
                let usable = |percent: &f64| (50.0..=100.0).contains(percent);
                percent.filter(usable).map(Self::Percent).ok_or(Fault::Unwanted)
            }
            None => Err(Fault::Unwanted),
        }
    }

    fn toml(&self) -> String {
        match self {
            Self::All => quoted(ALL),
            Self::This => quoted(THIS),
            Self::Percent(percent) => quoted(&format!("{percent}%")),
        }
    }

    fn schema(_: &Key) -> Json {
        json!({ "anyOf": [
            { "enum": [ALL, THIS] },
            { "type": "string", "pattern": "^(100|[5-9][0-9](\\.[0-9]+)?)%$" },
        ] })
    }

    fn words() -> Vec<&'static str> {
        vec![ALL, THIS]
    }
}

/// A box by two of its corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxSetting {
    /// Its lowest coordinates.
    pub min: DVec3,
    /// Its highest coordinates.
    pub max: DVec3,
}

impl Value for BoxSetting {
    fn kind(_: &Key) -> String {
        "two corners of a box, such as [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]".to_owned()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let items = field.items().ok_or(Fault::Unwanted)?;
        let [a, b] = &items[..] else {
            return Err(Fault::Unwanted);
        };
        let (a, b) = (DVec3::parse(a, key)?, DVec3::parse(b, key)?);
        if a == b {
            let what = "has no extent: its corners are equal".to_owned();
            return Err(Fault::Because(what));
        }
        Ok(Self { min: a.min(b), max: a.max(b) })
    }

    fn toml(&self) -> String {
        format!("[{}, {}]", self.min.toml(), self.max.toml())
    }

    fn schema(_: &Key) -> Json {
        json!({ "type": "array", "items": numbers_schema(3), "minItems": 2, "maxItems": 2 })
    }
}
