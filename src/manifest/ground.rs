//! `render.ground`: the kind of ground.

use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Named, Value, named, quoted};

named! {
    /// Kinds of ground.
    GroundKind {
        /// No ground.
        None = "none",
        /// A plane of one colour, or with the pattern of `render.ground_pattern`.
        Plain = "plain",
        /// A plane with squares, every other one darker.
        Checker = "checker",
        /// An invisible plane: only shadows on it are visible.
        ShadowCatcher = "shadow_catcher",
    }
}

/// The setting: a name, alone or as the `type` of a table; `true` is a plain ground, `false` is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GroundSetting(pub GroundKind);

impl Value for GroundSetting {
    const FLAG: FlagKind = FlagKind::SwitchOrText(GroundKind::Plain.name());

    fn kind(_: &Key) -> String {
        format!("true, false or one of {}", Self::words().join(", "))
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        if let Some(is_on) = field.as_bool() {
            let kind = match is_on {
                true => GroundKind::Plain,
                false => GroundKind::None,
            };
            return Ok(Self(kind));
        }
        let Some(mut section) = field.as_table() else {
            return GroundKind::parse(field, key).map(Self);
        };
        let mut kind = GroundKind::None;
        let key = Key::new("type", &[]).required("the kind of ground, such as \"shadow_catcher\"");
        section.read(&key, &mut kind);
        section.finish();
        Ok(Self(kind))
    }

    /// As older versions wrote it, if they knew it.
    fn toml(&self) -> String {
        match self.0 {
            GroundKind::None => "false".to_owned(),
            GroundKind::Plain => "true".to_owned(),
            other => quoted(other.name()),
        }
    }

    fn schema(key: &Key) -> Json {
        let kind = GroundKind::schema(key);
        json!({ "anyOf": [
            { "type": "boolean" },
            kind,
            {
                "type": "object",
                "properties": { "type": kind },
                "required": ["type"],
                "additionalProperties": false,
            },
        ] })
    }

    fn words() -> Vec<&'static str> {
        GroundKind::names()
            .into_iter()
            .map(|(_, name)| name)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::manifest::Manifest;

    #[test]
    fn a_ground_is_switched_named_or_a_table() {
        let kind = |setting: &str| {
            let text = format!("input.path = \"a\"\n{setting}");
            let manifest = Manifest::parse(&text, Path::new("job.toml"));
            manifest.map(|manifest| manifest.render.ground.map(|ground| ground.0))
        };
        for (setting, wanted) in [
            ("", None),
            ("render.ground = \"auto\"", None),
            ("render.ground = false", Some(GroundKind::None)),
            ("render.ground = true", Some(GroundKind::Plain)),
            ("render.ground = \"none\"", Some(GroundKind::None)),
            ("render.ground = \"checker\"", Some(GroundKind::Checker)),
            (
                "[render.ground]\ntype = \"shadow_catcher\"",
                Some(GroundKind::ShadowCatcher),
            ),
        ] {
            assert_eq!(kind(setting), Ok(wanted), "{setting}");
        }
        for (setting, part) in [
            ("render.ground = 1", "expected true, false or one of none"),
            (
                "render.ground = \"shadowcatcher\"",
                "did you mean shadow_catcher?",
            ),
            (
                "[render.ground]\nkind = 1",
                "render.ground.type: is missing",
            ),
            ("[render.ground]\ntype = 1", "expected one of none"),
        ] {
            let error = kind(setting).unwrap_err().to_string();
            assert!(error.contains(part), "{setting}: {error}");
        }
    }
}
